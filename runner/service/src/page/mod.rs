//! The web page: plain files, built into the program.

/// A file of the page.
#[derive(Debug)]
pub(crate) struct File {
    /// Where it is asked for.
    pub(crate) path: &'static str,
    /// Its media type.
    pub(crate) kind: &'static str,
    /// What is in it.
    pub(crate) text: &'static str,
}

/// All of them.
pub(crate) const FILES: &[File] = &[];
