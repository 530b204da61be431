//! The handle's calls that concern programs, receptions and the library.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use softplug_host::lint;

use super::loading::reference_of;
use super::{Download, Gateway, show};
use crate::Refusal;
use crate::disk::{DiskError, is_full};
use crate::jobs::Kind;
use crate::library::{Entry, LibraryError, Reference};
use crate::programs::{ProgramError, ProgramName};
use crate::view::{Change, Compared, PluginRef, PluginView, ProgramView, ReceptionView};

impl From<DiskError> for Refusal {
    fn from(error: DiskError) -> Self {
        let text = error.to_string();
        if error.is_missing() { Self::NotFound(text) } else { Self::Unavailable(text) }
    }
}

impl From<ProgramError> for Refusal {
    fn from(error: ProgramError) -> Self {
        let text = error.to_string();
        match error {
            ProgramError::NotFound(_) => Self::NotFound(text),
            ProgramError::Exists(_) | ProgramError::InTheWay(_) | ProgramError::Busy(_) => {
                Self::Conflict(text)
            }
            ProgramError::Name(_) | ProgramError::Empty(_) => Self::invalid("program", text),
            ProgramError::TooLarge { .. } => Self::TooLarge(text),
            ProgramError::Source(error) if is_full(&error) => Self::Unavailable(error.to_string()),
            ProgramError::Source(_) => Self::invalid("body", text),
            ProgramError::NoFolder => Self::Forbidden(text),
            ProgramError::Disk(error) => error.into(),
        }
    }
}

impl From<LibraryError> for Refusal {
    fn from(error: LibraryError) -> Self {
        let text = error.to_string();
        match error {
            LibraryError::NotFound { .. } | LibraryError::NoLibrary(_) => Self::NotFound(text),
            LibraryError::NotAPlugin(_)
            | LibraryError::Unfit(_)
            | LibraryError::Version(_)
            | LibraryError::Ambiguous { .. } => Self::invalid("plugin", text),
            LibraryError::InUse { .. } => Self::Conflict(text),
            LibraryError::Damaged { .. }
            | LibraryError::Unchecked(_)
            | LibraryError::Signature(_) => Self::Unavailable(text),
            LibraryError::Disk(error) => error.into(),
        }
    }
}

/// Programs and receptions.
impl Gateway {
    /// All programs.
    pub fn programs(&self) -> Result<Vec<ProgramView>, Refusal> {
        let programs = self.shared.parts.programs.list()?;
        Ok(programs.into_iter().map(show::program).collect())
    }

    /// Stores a program under a name such as `O1234.nc` or `lathes/O1234.nc`: all
    /// of it or nothing. Reads `source` to its end.
    pub fn upload(
        &self,
        name: &str,
        overwrite: bool,
        source: &mut dyn Read,
    ) -> Result<ProgramView, Refusal> {
        let name: ProgramName = name.parse()?;
        let most = self.shared.upload_bytes;
        let parts = &self.shared.parts;
        let mut source = parts.quotas.within(source);
        let program = parts.programs.upload(&name, &mut source, most, overwrite)?;
        self.shared.changed(Change::Programs);
        Ok(show::program(program))
    }

    /// A program.
    pub fn download(&self, name: &str) -> Result<Download, Refusal> {
        let (file, program) = self.shared.parts.programs.download(&name.parse()?)?;
        let name = program.name.rsplit('/').next().unwrap_or_default().to_owned();
        Ok(Download { name, bytes: program.size, file })
    }

    /// Deletes a program. Jobs that send it have a copy.
    pub fn delete(&self, name: &str) -> Result<(), Refusal> {
        self.shared.parts.programs.delete(&name.parse()?)?;
        self.shared.changed(Change::Programs);
        Ok(())
    }

    /// What a link has received, the newest first.
    pub fn receptions(&self, link: &str) -> Result<Vec<ReceptionView>, Refusal> {
        let place = self.place(link)?;
        let files = self.shared.parts.receptions.list(&place)?;
        let names = files.iter().map(|file| file.name.as_str());
        let jobs = self.shared.parts.jobs.reader().of_receptions(link, names)?;
        let view = |file: &crate::programs::ReceptionFile| {
            let job = jobs.get(file.name.as_str());
            let reception = job.and_then(|job| job.reception.as_ref());
            let known = job.filter(|job| job.spec.kind == Kind::Receive);
            let reason = job.and_then(|job| job.reason.as_ref()).map(|reason| reason.text.clone());
            let failed = file.is_failed.then(|| "it is not whole".to_owned());
            ReceptionView {
                link: link.to_owned(),
                name: known.and_then(|job| job.spec.program.clone()),
                bytes: file.size,
                at_ms: file.modified,
                failure: if file.is_failed { reason.or(failed) } else { None },
                job: job.map(|job| job.id.0),
                compared: reception.and_then(|reception| reception.compared).map(|compared| {
                    Compared {
                        job: Some(compared.with),
                        is_same: compared.differs_at.is_none(),
                        differs_at: compared.differs_at,
                    }
                }),
                file: file.name.clone(),
            }
        };
        Ok(files.iter().map(view).collect())
    }

    /// Something that a link has received.
    pub fn download_reception(&self, link: &str, file: &str) -> Result<Download, Refusal> {
        let place = self.place(link)?;
        let (opened, bytes) = self.shared.parts.receptions.read(&place, file)?;
        Ok(Download { name: file.to_owned(), bytes, file: opened })
    }

    /// Deletes something that a link has received.
    pub fn delete_reception(&self, link: &str, file: &str) -> Result<(), Refusal> {
        let place = self.place(link)?;
        self.shared.parts.receptions.delete(&place, file)?;
        self.shared.changed(Change::Receptions { link: link.to_owned() });
        Ok(())
    }

    /// The trace that led to a fault, by the file's name in its view.
    pub fn download_trace(&self, link: &str, file: &str) -> Result<Download, Refusal> {
        self.place(link)?;
        let missing = || Refusal::NotFound("there is no such trace".to_owned());
        // Names that the gateway gives: nothing that leads elsewhere.
        let number = file.strip_suffix(".spt").ok_or_else(missing)?;
        if number.is_empty() || !number.bytes().all(|byte| byte.is_ascii_digit()) {
            return Err(missing());
        }
        open(&self.shared.trace_folder(link).join(file), file).ok_or_else(missing)
    }

    /// The folder of a link's receptions.
    fn place(&self, link: &str) -> Result<String, Refusal> {
        let link = link.to_owned();
        self.shared.ask(move |control| Ok(control.link(&link)?.config.receive.clone()))
    }
}

fn open(path: &Path, name: &str) -> Option<Download> {
    let file = File::open(path).ok()?;
    let bytes = file.metadata().ok()?.len();
    Some(Download { name: name.to_owned(), bytes, file })
}

/// The library of plug-ins.
impl Gateway {
    /// All plug-ins.
    pub fn plugins(&self) -> Result<Vec<PluginView>, Refusal> {
        let entries = self.shared.parts.loader.library().entries()?;
        let running = self.running()?;
        Ok(entries.iter().filter_map(|entry| self.plugin_view(entry, &running)).collect())
    }

    /// Checks a module and adds it.
    pub fn add_plugin(&self, module: &[u8]) -> Result<PluginView, Refusal> {
        let free = self.shared.parts.quotas.free();
        free.map_err(|over| Refusal::Unavailable(over.to_string()))?;
        let added = self.shared.parts.loader.library().add(module)?;
        self.shared.changed(Change::Plugins);
        let running = self.running()?;
        let view = self.plugin_view(&added.entry, &running);
        view.ok_or_else(|| Refusal::Unavailable("the plug-in cannot be read back".to_owned()))
    }

    /// Removes a plug-in that no link runs: `name@version` or `name@sha256:…`.
    pub fn remove_plugin(&self, plugin: &str) -> Result<(), Refusal> {
        let reference: Reference =
            plugin.parse().map_err(|error| Refusal::invalid("plugin", error))?;
        self.shared.parts.loader.library().remove(&reference, false)?;
        self.shared.changed(Change::Plugins);
        Ok(())
    }

    /// Removes modules that nothing refers to; which ones.
    pub fn collect_garbage(&self) -> Result<Vec<PluginRef>, Refusal> {
        let library = self.shared.parts.loader.library();
        let entries = library.entries()?;
        let removed = library.collect_garbage(false)?;
        let running = self.shared.ask(|control| {
            Ok(control.links.values().map(|link| link.plugin.digest()).collect::<Vec<_>>())
        })?;
        self.shared.parts.loader.forget_all_but(&running);
        self.shared.changed(Change::Plugins);
        let is_removed = |entry: &&Entry| removed.iter().any(|gone| gone.digest == entry.digest);
        Ok(entries.iter().filter(is_removed).map(reference_of).collect())
    }

    /// Which links run which module.
    fn running(&self) -> Result<BTreeMap<String, Vec<String>>, Refusal> {
        self.shared.ask(|control| {
            let mut running: BTreeMap<String, Vec<String>> = BTreeMap::new();
            for (name, link) in &control.links {
                running.entry(link.plugin.which.digest.clone()).or_default().push(name.clone());
            }
            Ok(running)
        })
    }

    /// `None` if it has gone meanwhile.
    fn plugin_view(
        &self,
        entry: &Entry,
        running: &BTreeMap<String, Vec<String>>,
    ) -> Option<PluginView> {
        let module = self.shared.parts.loader.library().read(entry.digest).ok()?;
        let manifest = lint(&module).ok()?.manifest;
        let links = running.get(&entry.digest.to_string()).cloned().unwrap_or_default();
        Some(show::plugin(entry, &manifest, links))
    }
}
