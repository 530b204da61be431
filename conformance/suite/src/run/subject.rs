//! What is judged: something that gives fresh instances of one plug-in.

use softplug_abi::Instance;
use softplug_abi::manifest::Manifest;
use std::error::Error;

/// A plug-in to be judged.
///
/// ```
/// use softplug_abi::manifest::Manifest;
/// use softplug_abi::{Instance, Micros};
/// use softplug_conformance::{FromFn, Subject};
/// use softplug_native::NativePlugin;
///
/// fn takes_defaults<S: Subject>(subject: &S) -> Result<bool, Box<dyn std::error::Error>> {
///     let defaults = subject.manifest().resolve_settings([])?;
///     let mut instance = subject.instantiate()?;
///     let capacity = instance.input_capacity();
///     let given = defaults.pieces(capacity, |event| instance.step(event, Micros::ZERO).map(drop));
///     Ok(given.is_ok())
/// }
///
/// let plugin = NativePlugin::XonXoff;
/// let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
/// let subject = FromFn::new(manifest, move || plugin.instantiate());
/// assert!(takes_defaults(&subject)?);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Subject {
    /// One running plug-in.
    type Instance: Instance;

    /// A new instance, which knows no settings yet.
    ///
    /// # Errors
    /// There is none; the plug-in cannot be judged.
    fn instantiate(&self) -> Result<Self::Instance, SubjectError>;

    /// What the plug-in says of itself.
    fn manifest(&self) -> &Manifest;

    /// How reports name it.
    fn label(&self) -> &str;

    /// Fuel that all steps of an instance used; native code counts none.
    fn fuel(_instance: &Self::Instance) -> Fuel {
        Fuel::default()
    }
}

/// Fuel, in units of one engine.
///
/// The example of [`Sandboxed`] shows some.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub struct Fuel {
    /// All of it.
    pub total: u64,
    /// The most that one step used.
    pub largest: u64,
}

/// A plug-in gives no instance.
///
/// ```
/// use softplug_conformance::SubjectError;
///
/// // For subjects of your own: whatever went wrong.
/// let error = SubjectError::from(Box::<dyn std::error::Error + Send + Sync>::from("no memory"));
/// assert_eq!(error.to_string(), "the plug-in cannot be started: no memory");
/// ```
#[derive(Debug, thiserror::Error)]
#[error("the plug-in cannot be started: {0}")]
pub struct SubjectError(#[from] Box<dyn Error + Send + Sync>);

/// A plug-in in the sandbox.
///
/// ```
/// use softplug_abi::{Event, Instance, Micros};
/// use softplug_conformance::{Fuel, Sandboxed, Subject};
/// use softplug_host::{Host, HostOptions};
///
/// # let wasm = wat::parse_file("../../fixtures/abi/echo.wat")?;
/// let subject = Sandboxed::new(Host::new(HostOptions::default())?.load_bytes(&wasm)?);
/// assert_eq!(subject.label(), "echo");
/// let mut instance = subject.instantiate()?;
/// instance.step(&Event::Received(b"G1"), Micros::ZERO)?;
/// let Fuel { total, largest } = Sandboxed::fuel(&instance);
/// assert!(total > 0 && total == largest, "one step so far");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Sandboxed {
    plugin: softplug_host::Plugin,
    label: String,
}

impl Sandboxed {
    /// The plug-in as it was loaded; it is labelled by its name.
    pub fn new(plugin: softplug_host::Plugin) -> Self {
        let label = plugin.manifest().name.clone();
        Self { plugin, label }
    }

    /// The plug-in.
    pub fn plugin(&self) -> &softplug_host::Plugin {
        &self.plugin
    }
}

impl Subject for Sandboxed {
    type Instance = softplug_host::Session;

    fn instantiate(&self) -> Result<Self::Instance, SubjectError> {
        self.plugin.instantiate().map_err(|error| SubjectError(error.into()))
    }

    fn manifest(&self) -> &Manifest {
        self.plugin.manifest()
    }

    fn label(&self) -> &str {
        &self.label
    }

    fn fuel(instance: &Self::Instance) -> Fuel {
        Fuel { total: instance.total_fuel(), largest: instance.largest_fuel() }
    }
}

/// A plug-in as native code: a function that makes instances.
///
/// ```
/// use softplug_abi::manifest::Manifest;
/// use softplug_conformance::{FromFn, Subject};
/// use softplug_native::NativePlugin;
///
/// let plugin = NativePlugin::XonXoff;
/// let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
/// let subject = FromFn::new(manifest, move || plugin.instantiate());
/// assert_eq!(subject.label(), "xon-xoff (native)");
/// assert_eq!(subject.manifest().name, "xon-xoff");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct FromFn<F> {
    make: F,
    manifest: Manifest,
    label: String,
}

impl<I: Instance, F: Fn() -> I> FromFn<F> {
    /// Instances from `make`, labelled as `NAME (native)`.
    pub fn new(manifest: Manifest, make: F) -> Self {
        let label = format!("{} (native)", manifest.name);
        Self { make, manifest, label }
    }
}

impl<I: Instance, F: Fn() -> I> Subject for FromFn<F> {
    type Instance = I;

    fn instantiate(&self) -> Result<I, SubjectError> {
        Ok((self.make)())
    }

    fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    fn label(&self) -> &str {
        &self.label
    }
}
