//! The state's name, for people.

use crate::Context;

/// Tells the state's name, once for each change. It is no part of a saved state: mark it
/// `#[state(skip)]`.
///
/// ```
/// use softplug_plugin::bench::Bench;
/// use softplug_plugin::parts::StateName;
/// use softplug_plugin::{Context, Converter};
///
/// #[derive(Default)]
/// struct Doors {
///     are_open: bool,
///     name: StateName,
/// }
///
/// impl Converter for Doors {
///     type Settings = ();
///     const MANIFEST: &'static str = r#"{"abi": "1.0", "name": "doors", "version": "1.0.0",
///         "licence": "MIT", "protocol": "none", "description": "Open or closed."}"#;
///
///     fn new((): ()) -> Self {
///         Self::default()
///     }
///
///     fn received(&mut self, _link: &mut Context<'_>, bytes: &[u8]) {
///         self.are_open = bytes.ends_with(b"O");
///     }
///
///     fn after(&mut self, link: &mut Context<'_>) {
///         self.name.tell(link, if self.are_open { "open" } else { "closed" });
///     }
/// }
///
/// let mut bench = Bench::<Doors>::new().open();
/// for heard in [b"C", b"O", b"O", b"C"] {
///     bench.receive(heard);
/// }
/// assert_eq!(bench.observed().len(), 3);
/// ```
#[derive(Copy, Clone, Debug, Default)]
pub struct StateName(Option<&'static str>);

impl StateName {
    /// None was told yet.
    pub const fn new() -> Self {
        Self(None)
    }

    /// The name now, of at most 48 bytes.
    pub fn tell(&mut self, link: &mut Context<'_>, name: &'static str) {
        if self.0 != Some(name) {
            self.0 = Some(name);
            link.state(name);
        }
    }
}
