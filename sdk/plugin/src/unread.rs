//! Bytes of an event that wait for a round of output of their own.

use crate::Context;
use crate::export::INPUT;
use softplug_abi::wire::copy;

/// Bytes that came in one event and that a converter looks at in
/// [`Converter::more`](crate::Converter::more), because what they may bring no longer fits
/// the [output](Context::output_room): one event can hold a thousand requests.
///
/// ```
/// use softplug_plugin::bench::Bench;
/// use softplug_plugin::{Context, Converter, NoteLevel, Unread};
///
/// /// Notes each BEL.
/// struct Bells {
///     unread: Unread,
/// }
///
/// /// The most bytes of output that one character brings.
/// const RESERVE: usize = 64;
///
/// impl Converter for Bells {
///     type Settings = ();
///     const MANIFEST: &'static str = r#"{"abi": "1.0", "name": "bells", "version": "1.0.0",
///         "licence": "MIT", "protocol": "none", "description": "Notes each BEL."}"#;
///
///     fn new((): ()) -> Self {
///         Self { unread: Unread::new() }
///     }
///
///     fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
///         let rest = link.each_byte(bytes, RESERVE, |link, byte| {
///             if byte == 0x07 {
///                 link.note(NoteLevel::Info, 0, "the control rings");
///             }
///         });
///         self.unread.keep(link, rest);
///     }
///
///     fn more(&mut self, link: &mut Context<'_>) {
///         let unread = self.unread;
///         self.received(link, unread.bytes());
///     }
/// }
///
/// let mut bench = Bench::<Bells>::new().open();
/// bench.receive(&[0x07; 1_000]);
/// assert_eq!(bench.observed().len(), 1_000);
/// ```
#[derive(Copy, Clone, Debug)]
pub struct Unread {
    bytes: [u8; INPUT],
    length: usize,
}

impl Unread {
    /// None; all zeros.
    #[allow(clippy::new_without_default, reason = "it must be const")]
    pub const fn new() -> Self {
        Self { bytes: [0; INPUT], length: 0 }
    }

    /// Keeps the rest of an event, of at most 1,040 bytes, in place of what was kept
    /// before; asks to be called [again](Context::again) if there is any.
    pub fn keep(&mut self, link: &mut Context<'_>, rest: &[u8]) {
        self.length = rest.len();
        if !rest.is_empty() {
            copy(&mut self.bytes, rest);
            link.again();
        }
    }

    /// What was kept.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }
}
