//! A module that marks what of it is executed.

/// A plug-in that does what it does, and besides sets bits in globals for what it executes.
///
/// ```no_run
/// use softplug_explore::{Bounds, Changes, Marked, explore_marked, plans};
/// use std::sync::atomic::AtomicBool;
///
/// let module = std::fs::read("my-plugin.wasm")?;
/// let marked = Marked {
///     wasm: std::fs::read("my-plugin.marked.wasm")?,
///     globals: vec!["executed.0".to_owned(), "executed.1".to_owned()],
///     fuel: 80_000_000,
/// };
/// let (bounds, changes) = (Bounds::default(), Changes::default());
/// let (plan, never) = (plans("r3964")?[0], AtomicBool::new(false));
/// let explored = explore_marked(&module, &marked, plan, &changes, &bounds, &|_| {}, &never)?;
/// assert_eq!(explored.marks.len(), marked.globals.len());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Marked {
    /// The module.
    pub wasm: Vec<u8>,
    /// The names under which it exports the globals with its marks, 64 bits each. They are no part
    /// of what it is.
    pub globals: Vec<String>,
    /// Fuel for one event: marking costs some.
    pub fuel: u64,
}

/// Adds marks to those that are known; whether any of them are new.
pub(crate) fn add_marks(known: &mut Vec<u64>, marks: &[u64]) -> bool {
    known.resize(known.len().max(marks.len()), 0);
    let mut is_new = false;
    for (known, marks) in known.iter_mut().zip(marks) {
        is_new |= marks & !*known != 0;
        *known |= marks;
    }
    is_new
}
