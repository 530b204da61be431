//! All machines that can be asked for.

mod known;

use std::fs::{self, File};
use std::io::Read as _;
use std::path::{Path, PathBuf};

use crate::error::{FolderError, MachineError};
use crate::limits::MOST_FILE_BYTES;
use crate::machine::Machine;

/// Machines by their names.
///
/// The example of the [crate](crate) asks one.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Catalogue {
    /// In the order of their names.
    machines: Vec<Machine>,
}

impl Catalogue {
    /// The machines that come with Softplug.
    pub fn known() -> Self {
        let mut catalogue = Self::default();
        for text in known::KNOWN {
            catalogue.add(Machine::parse(text).expect("a test reads each of them"));
        }
        catalogue
    }

    /// Adds the machines of all `.toml` files of a folder. One of a name that is there takes its
    /// place.
    ///
    /// # Errors
    /// The folder or a file cannot be read, is no machine, or two files have one name. Nothing is
    /// added then.
    ///
    /// ```
    /// # let folder = std::env::temp_dir().join(format!("machines-{}", std::process::id()));
    /// # std::fs::create_dir_all(&folder)?;
    /// # std::fs::write(folder.join("m.toml"), "name = \"m\"\ntitle = \"M\"\nplugin = \"r3964\"")?;
    /// use softplug_catalogue::Catalogue;
    ///
    /// let mut catalogue = Catalogue::known();
    /// catalogue.add_folder(&folder)?;
    /// assert_eq!(catalogue.find("m").map(|machine| &*machine.plugin), Some("r3964"));
    /// # std::fs::remove_dir_all(&folder)?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn add_folder(&mut self, folder: &Path) -> Result<(), FolderError> {
        let unread = |path: &Path| {
            let path = path.to_owned();
            move |source| FolderError::Read { path, source }
        };
        let mut files = Vec::new();
        for entry in fs::read_dir(folder).map_err(unread(folder))? {
            let path = entry.map_err(unread(folder))?.path();
            if path.extension().is_some_and(|extension| extension == "toml") {
                files.push(path);
            }
        }
        files.sort();
        let mut read: Vec<(PathBuf, Machine)> = Vec::with_capacity(files.len());
        for path in files {
            let text = text_of(&path).map_err(unread(&path))?;
            let machine = text.ok_or(MachineError::TooLong).and_then(|text| Machine::parse(&text));
            let machine = match machine {
                Ok(machine) => machine,
                Err(source) => return Err(FolderError::Machine { path, source }),
            };
            if let Some((first, _)) = read.iter().find(|(_, other)| other.name == machine.name) {
                let first = first.clone();
                return Err(FolderError::Twice { name: machine.name, first, second: path });
            }
            read.push((path, machine));
        }
        for (_, machine) in read {
            self.add(machine);
        }
        Ok(())
    }

    /// Adds a machine; it takes the place of one with its name.
    pub fn add(&mut self, machine: Machine) {
        match self.machines.binary_search_by(|other| other.name.cmp(&machine.name)) {
            Ok(at) => self.machines[at] = machine,
            Err(at) => self.machines.insert(at, machine),
        }
    }

    /// The machine of this name.
    pub fn find(&self, name: &str) -> Option<&Machine> {
        let at = self.machines.binary_search_by(|machine| (*machine.name).cmp(name)).ok()?;
        self.machines.get(at)
    }

    /// All, in the order of their names.
    pub fn machines(&self) -> &[Machine] {
        &self.machines
    }
}

/// What stands in a file; `None` if that is too much.
fn text_of(path: &Path) -> Result<Option<String>, std::io::Error> {
    // Opening a FIFO would wait for a writer.
    if !fs::metadata(path)?.is_file() {
        return Err(std::io::Error::other("it is no regular file"));
    }
    let mut text = String::new();
    File::open(path)?.take(MOST_FILE_BYTES as u64 + 1).read_to_string(&mut text)?;
    Ok((text.len() <= MOST_FILE_BYTES).then_some(text))
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_pipe_in_the_place_of_a_file_is_refused_at_once() {
        let folder = std::env::temp_dir().join(format!("machines-pipe-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let pipe = folder.join("x.toml");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let error = Catalogue::known().add_folder(&folder).unwrap_err();
        assert!(error.to_string().contains("x.toml"), "{error}");
        fs::remove_dir_all(&folder).unwrap();
    }
}
