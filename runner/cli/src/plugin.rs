//! Finding and loading the plug-in that was asked for.

use std::env;
use std::path::{Path, PathBuf};

use clap::Args;
use softplug_abi::manifest::{Manifest, SettingError, SettingValues};
use softplug_abi::{Event, Instance, Micros, Output};
#[cfg(feature = "native")]
use softplug_conformance::FromFn;
use softplug_conformance::{Call, Case, Permutation, Sandboxed, Stepper, calls};
use softplug_host::{Host, HostOptions, LoadError, Plugin, Session, SessionFault, read_module};
#[cfg(feature = "native")]
use softplug_native::{NativeInstance, NativePlugin};

use crate::assignment::Assignment;
use crate::failure::Failure;
use crate::guess::nearest;

/// The kind of job that is meant if nothing else is said.
pub(crate) const SEND: &str = "send";

/// Where plug-ins are looked for by name.
#[derive(Debug, Args)]
pub(crate) struct Library {
    /// Folder in which plug-ins are looked up by name [env: SOFTPLUG_PLUGINS]
    #[arg(long, value_name = "DIR")]
    plugins: Option<PathBuf>,
}

impl Library {
    /// The file of a plug-in: a path as it is, a name in the folders.
    pub(crate) fn find(&self, plugin: &str) -> Result<PathBuf, Failure> {
        let is_file = Path::new(plugin).extension().is_some_and(|extension| extension == "wasm");
        if is_file || plugin.contains(['/', '\\']) {
            return Ok(PathBuf::from(plugin));
        }
        let mut places = Vec::new();
        for folder in self.folders() {
            let file = folder.join(format!("{plugin}.wasm"));
            if file.is_file() {
                return Ok(file);
            }
            places.push(file.display().to_string());
        }
        Err(Failure::usage(format_args!(
            "there is no plug-in \"{plugin}\"; looked for {}",
            places.join(", ")
        ))
        .hint("give the path of a .wasm file, or the folder with --plugins or SOFTPLUG_PLUGINS"))
    }

    /// Finds a plug-in and reads its module, which may be none.
    pub(crate) fn read(&self, plugin: &str) -> Result<Vec<u8>, Failure> {
        let file = self.find(plugin)?;
        read_module(&file).map_err(|error| load_failure(&file, &error))
    }

    fn folders(&self) -> Vec<PathBuf> {
        let variable = env::var_os("SOFTPLUG_PLUGINS").filter(|folder| !folder.is_empty());
        let executable = env::current_exe().unwrap_or_default();
        // Beside the command; beside the folder in which it is, as `bin` or `target/release`.
        let beside =
            executable.ancestors().skip(1).take(2).map(|folder| Some(folder.join("plugins")));
        let mut folders: Vec<PathBuf> = Vec::new();
        let all = [
            self.plugins.clone(),
            variable.map(PathBuf::from),
            Some(PathBuf::from("target/plugins")),
        ];
        for folder in all.into_iter().chain(beside).flatten() {
            if !folders.contains(&folder) {
                folders.push(folder);
            }
        }
        folders
    }

    /// Finds and loads a plug-in.
    pub(crate) fn load(&self, plugin: &str) -> Result<Chosen, Failure> {
        if let Some(name) = plugin.strip_prefix("native:") {
            return native(name);
        }
        let file = self.find(plugin)?;
        let host = Host::new(HostOptions::default()).map_err(Failure::plug_in)?;
        let plugin = host.load(&file).map_err(|error| load_failure(&file, &error))?;
        Ok(Chosen::Sandboxed(plugin))
    }
}

/// A plug-in as it was named, as one word of a command to run again.
pub(crate) fn as_word(plugin: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "/._-:+=".contains(c);
    if plugin.chars().all(is_plain) {
        plugin.to_owned()
    } else {
        format!("'{}'", plugin.replace('\'', r"'\''"))
    }
}

/// A plug-in to make instances of.
#[derive(Clone, Debug)]
pub(crate) enum Chosen {
    /// A module in the sandbox.
    Sandboxed(Plugin),
    /// A reference plug-in as native code.
    #[cfg(feature = "native")]
    Native(NativePlugin, Box<Manifest>),
}

impl Chosen {
    pub(crate) fn manifest(&self) -> &Manifest {
        match self {
            Self::Sandboxed(plugin) => plugin.manifest(),
            #[cfg(feature = "native")]
            Self::Native(_, manifest) => manifest,
        }
    }

    pub(crate) fn instantiate(&self) -> Result<AnyInstance, Failure> {
        self.new_instance().map_err(Failure::plug_in)
    }

    pub(crate) fn new_instance(&self) -> Result<AnyInstance, LoadError> {
        match self {
            Self::Sandboxed(plugin) => Ok(AnyInstance::Sandboxed(Box::new(plugin.instantiate()?))),
            #[cfg(feature = "native")]
            Self::Native(plugin, _) => Ok(AnyInstance::Native(Box::new(plugin.instantiate()))),
        }
    }

    /// One run of a case, to be walked through.
    pub(crate) fn step_through(&self, case: &Case, permutation: &Permutation) -> Stepper {
        match self {
            Self::Sandboxed(plugin) => {
                Stepper::new(&Sandboxed::new(plugin.clone()), case, permutation)
            }
            #[cfg(feature = "native")]
            Self::Native(plugin, manifest) => {
                let plugin = *plugin;
                let subject = FromFn::new((**manifest).clone(), move || plugin.instantiate());
                Stepper::new(&subject, case, permutation)
            }
        }
    }

    /// Every call of a run of a case as it is written.
    pub(crate) fn calls(&self, case: &Case) -> Vec<Call> {
        match self {
            Self::Sandboxed(plugin) => {
                calls(&Sandboxed::new(plugin.clone()), case, &Permutation::Uncut)
            }
            #[cfg(feature = "native")]
            Self::Native(plugin, manifest) => {
                let plugin = *plugin;
                let subject = FromFn::new((**manifest).clone(), move || plugin.instantiate());
                calls(&subject, case, &Permutation::Uncut)
            }
        }
    }

    /// The values of all settings; those that the plug-in cannot work with are
    /// found out here, on an instance that is not used further.
    pub(crate) fn settings(&self, asked: &[Assignment]) -> Result<SettingValues, Failure> {
        let manifest = self.manifest();
        let pairs = asked.iter().map(Assignment::as_pair);
        let values = manifest.resolve_settings(pairs).map_err(|error| {
            let guess = match &error {
                SettingError::Unknown { name, .. } => {
                    nearest(name, manifest.settings.iter().map(|setting| &*setting.name))
                }
                SettingError::UnknownPreset { name, .. } => {
                    nearest(name, manifest.presets.iter().map(|preset| &*preset.name))
                }
                SettingError::Type { .. } | SettingError::Range { .. } => None,
            };
            Failure::usage(&error).hint(match guess {
                Some(guess) => format!("did you mean \"{guess}\"?"),
                None => format!(
                    "`softplug inspect {}` shows every setting with its range",
                    manifest.name
                ),
            })
        })?;
        let mut instance = self.instantiate()?;
        let capacity = instance.input_capacity();
        values
            .pieces(capacity, |event| instance.step(event, Micros::ZERO).map(drop))
            .map_err(|fault| Failure::usage(fault.of_settings()))?;
        Ok(values)
    }
}

/// An instance of either sort.
#[derive(Debug)]
pub(crate) enum AnyInstance {
    Sandboxed(Box<Session>),
    #[cfg(feature = "native")]
    Native(Box<NativeInstance>),
}

/// Why an instance did not take an event.
#[derive(Debug, thiserror::Error)]
pub(crate) enum AnyFault {
    #[error(transparent)]
    Sandboxed(#[from] SessionFault),
    #[cfg(feature = "native")]
    #[error("the plug-in {0}")]
    Native(<NativeInstance as Instance>::Fault),
}

impl AnyFault {
    /// Why the settings were refused: the plug-in knows best.
    fn of_settings(&self) -> String {
        let words = match self {
            Self::Sandboxed(SessionFault::Refused { words, .. }) => words.as_deref(),
            #[cfg(feature = "native")]
            Self::Native(fault) => Some(fault.words),
            Self::Sandboxed(_) => None,
        };
        match words.filter(|words| !words.is_empty()) {
            Some(words) => format!("these settings do not go together: {words}"),
            None => format!("these settings do not go together: {self}"),
        }
    }
}

impl Instance for AnyInstance {
    type Fault = AnyFault;

    fn input_capacity(&self) -> usize {
        match self {
            Self::Sandboxed(session) => session.input_capacity(),
            #[cfg(feature = "native")]
            Self::Native(native) => native.input_capacity(),
        }
    }

    fn step(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, AnyFault> {
        match self {
            Self::Sandboxed(session) => Ok(session.step(event, now)?),
            #[cfg(feature = "native")]
            Self::Native(native) => native.step(event, now).map_err(AnyFault::Native),
        }
    }
}

/// What keeps a file from being loaded, and whose fault that is.
pub(crate) fn load_failure(file: &Path, error: &LoadError) -> Failure {
    match error {
        LoadError::Io { .. } | LoadError::NotAFile { .. } => Failure::usage(error),
        LoadError::Lint(rule) => {
            Failure::plug_in(format_args!("{} is not a plug-in: {rule}", file.display()))
        }
        LoadError::TooLarge { .. } | LoadError::Engine(_) => Failure::plug_in(error),
        LoadError::CompilerProcess(_) => Failure::internal(error),
        error => Failure::plug_in(format_args!("{}: {error}", file.display())),
    }
}

#[cfg(feature = "native")]
pub(crate) fn native(name: &str) -> Result<Chosen, Failure> {
    let Some(plugin) = NativePlugin::from_name(name) else {
        let known: Vec<_> = NativePlugin::ALL.iter().map(|plugin| plugin.name()).collect();
        return Err(Failure::usage(format_args!(
            "there is no native plug-in \"{name}\"; there are: {}",
            known.join(", ")
        )));
    };
    let manifest = Manifest::parse(plugin.manifest().as_bytes()).map_err(Failure::internal)?;
    Ok(Chosen::Native(plugin, Box::new(manifest)))
}

#[cfg(not(feature = "native"))]
pub(crate) fn native(_: &str) -> Result<Chosen, Failure> {
    Err(Failure::usage("this command was built without native plug-ins")
        .hint("build it with the feature \"native\", or give a .wasm file"))
}
