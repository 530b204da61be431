//! Plug-ins from the library, compiled once and shared by all links that run them.

use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Mutex, PoisonError};

use softplug_abi::manifest::{SettingError, SettingValues};
use softplug_host::{Digest, Host, LoadError, Plugin, Session};
use softplug_live::units::UnitPlugin;
use thiserror::Error;

use crate::Refusal;
use crate::library::{BadReference, Entry, Library, LibraryError, Reference};
use crate::view::PluginRef;
use softplug_abi::{LineParameters, Micros};

/// Finds, compiles and starts plug-ins. Slow: never on a thread that serves links.
#[derive(Debug)]
pub(crate) struct Loader {
    host: Host,
    library: Library,
    loaded: Mutex<HashMap<Digest, Loaded>>,
    /// Modules that are at fault, and how: many links may ask for one that takes seconds to be
    /// refused.
    refused: Mutex<HashMap<Digest, String>>,
}

/// A plug-in, and its module for units.
type Loaded = (Plugin, Arc<[u8]>);

/// Most modules of which it is known that they are refused. Past it, all are tried again.
const REFUSED: usize = 256;

/// A plug-in with settings that it takes.
#[derive(Clone, Debug)]
pub(crate) struct Prepared {
    pub(crate) which: PluginRef,
    pub(crate) plugin: Plugin,
    /// The module, for units.
    pub(crate) module: Arc<[u8]>,
    /// Id of the key and signature, if it is signed for units.
    pub(crate) signature: Option<Box<[u8]>>,
    pub(crate) values: SettingValues,
    /// As they were given.
    pub(crate) settings: BTreeMap<String, String>,
}

/// Why a plug-in cannot be put on a link.
#[derive(Debug, Error)]
pub(crate) enum Unloadable {
    #[error(transparent)]
    Reference(#[from] BadReference),
    #[error(transparent)]
    Library(#[from] LibraryError),
    #[error("{0}")]
    Plugin(String),
    #[error("{text}")]
    Setting {
        /// The setting, if it is one in particular.
        name: Option<String>,
        text: String,
        hint: String,
    },
}

impl From<Unloadable> for Refusal {
    fn from(error: Unloadable) -> Self {
        match error {
            Unloadable::Setting { name, text, .. } => {
                let field = name.map_or("settings".to_owned(), |name| format!("settings.{name}"));
                Self::invalid(field, text)
            }
            error => Self::invalid("plugin", error),
        }
    }
}

impl Loader {
    pub(crate) fn new(host: Host, library: Library) -> Self {
        Self { host, library, loaded: Mutex::default(), refused: Mutex::default() }
    }

    pub(crate) fn library(&self) -> &Library {
        &self.library
    }

    /// The plug-in that a reference means now.
    pub(crate) fn resolve(&self, reference: &str) -> Result<Entry, Unloadable> {
        let reference: Reference = reference.parse()?;
        Ok(self.library.resolve(&reference)?)
    }

    /// A plug-in of the library, with these settings checked.
    pub(crate) fn prepare(
        &self,
        reference: &str,
        settings: &BTreeMap<String, String>,
    ) -> Result<Prepared, Unloadable> {
        let entry = self.resolve(reference)?;
        let (plugin, module) = self.plugin(entry.digest)?;
        let values = values(&plugin, settings)?;
        let settings = settings.clone();
        let signature = self.library.signature(entry.digest)?;
        Ok(Prepared { which: reference_of(&entry), plugin, module, signature, values, settings })
    }

    fn plugin(&self, digest: Digest) -> Result<Loaded, Unloadable> {
        let loaded = || self.loaded.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(loaded) = loaded().get(&digest) {
            return Ok(loaded.clone());
        }
        let refused = || self.refused.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(reason) = refused().get(&digest) {
            return Err(Unloadable::Plugin(reason.clone()));
        }
        let module = self.library.read(digest)?;
        let plugin = self.host.load_bytes(&module).map_err(|error| {
            if is_its_fault(&error) {
                let mut refused = refused();
                if refused.len() >= REFUSED {
                    refused.clear();
                }
                refused.insert(digest, error.to_string());
            }
            Unloadable::Plugin(error.to_string())
        })?;
        let both = (plugin, Arc::from(module));
        loaded().insert(digest, both.clone());
        Ok(both)
    }

    /// Breaks off what is being compiled, and lets nothing more be.
    pub(crate) fn stop(&self) {
        self.host.stop_compiling();
    }

    /// Lets go of the code of plug-ins that no link runs.
    pub(crate) fn forget_all_but(&self, used: &[Digest]) {
        let mut loaded = self.loaded.lock().unwrap_or_else(PoisonError::into_inner);
        loaded.retain(|digest, _| used.contains(digest));
    }
}

/// Whether the same module would be refused for the same reason again.
fn is_its_fault(error: &LoadError) -> bool {
    matches!(
        error,
        LoadError::Lint(_)
            | LoadError::Compile(_)
            | LoadError::CompileTime { .. }
            | LoadError::CompileMemory { .. }
    )
}

impl Prepared {
    /// The line that the plug-in names for its settings; a rate of 0 is left open.
    pub(crate) fn line(&self) -> Option<LineParameters> {
        let asked = self.settings.iter().map(|(name, value)| (name.as_str(), value.as_str()));
        self.plugin.manifest().line_for(asked, &self.values).map(|named| named.parameters)
    }

    pub(crate) fn digest(&self) -> Digest {
        self.plugin.digest()
    }

    /// As a unit takes it.
    pub(crate) fn for_unit(&self) -> UnitPlugin {
        UnitPlugin {
            module: Arc::clone(&self.module),
            digest: *self.digest().as_bytes(),
            signature: self.signature.clone(),
            settings: self.settings.clone().into_iter().collect(),
        }
    }

    /// A new instance.
    pub(crate) fn instance(&self) -> Result<Session, Unloadable> {
        self.plugin.instantiate().map_err(|error| Unloadable::Plugin(error.to_string()))
    }
}

/// Which plug-in an entry of the library is.
pub(crate) fn reference_of(entry: &Entry) -> PluginRef {
    PluginRef {
        name: entry.name.clone(),
        version: entry.version.clone(),
        digest: entry.digest.to_string(),
    }
}

/// A value for every setting; what the plug-in itself refuses is found out on an
/// instance that is not used further.
fn values(
    plugin: &Plugin,
    settings: &BTreeMap<String, String>,
) -> Result<SettingValues, Unloadable> {
    let manifest = plugin.manifest();
    let pairs = settings.iter().map(|(name, value)| (name.as_str(), value.as_str()));
    let values = manifest.resolve_settings(pairs).map_err(|error| {
        let known = manifest.settings.iter().map(|setting| setting.name.as_str());
        let presets = manifest.presets.iter().map(|preset| preset.name.as_str());
        let (name, hint) = match &error {
            SettingError::Unknown { name, .. } => {
                (name.clone(), crate::config::of_names("its settings", name, known))
            }
            SettingError::UnknownPreset { name, .. } => {
                ("preset".to_owned(), crate::config::of_names("its presets", name, presets))
            }
            SettingError::Type { name, .. } | SettingError::Range { name, .. } => {
                let hint = format!("`softplug plugin show {}` lists them", manifest.name);
                (name.clone(), hint)
            }
        };
        Unloadable::Setting { name: Some(name), text: error.to_string(), hint }
    })?;
    let mut instance =
        plugin.instantiate().map_err(|error| Unloadable::Plugin(error.to_string()))?;
    instance.configure(&values, Micros::ZERO).map_err(|fault| Unloadable::Setting {
        name: None,
        text: format!("the plug-in does not take these settings: {fault}"),
        hint: format!("`softplug plugin show {}` lists them", manifest.name),
    })?;
    Ok(values)
}
