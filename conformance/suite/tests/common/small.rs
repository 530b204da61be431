//! A small corpus for the plug-in `xon-xoff`, which any test can spoil.

use crate::common::module;
use softplug_conformance::Corpus;
use softplug_conformance::certify::{CertifyError, CertifyOptions, Loaded, certify};
use softplug_conformance::ledger::fingerprint;
use softplug_report::{Report, check};
use std::fmt::Write as _;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// A case of one byte that is sent.
#[derive(Clone, Debug)]
pub(crate) struct Small {
    pub(crate) id: &'static str,
    pub(crate) level: &'static str,
    pub(crate) since: u32,
    /// The byte that is demanded; `A` is sent.
    pub(crate) expected: char,
    pub(crate) clause: &'static str,
}

impl Small {
    /// One that passes.
    pub(crate) const fn good(id: &'static str) -> Self {
        Self { id, level: "must", since: 1, expected: 'A', clause: "xon-xoff.tx.at-once" }
    }

    /// One that fails.
    pub(crate) const fn bad(id: &'static str) -> Self {
        Self { expected: 'B', ..Self::good(id) }
    }

    pub(crate) fn text(&self) -> String {
        let Self { id, level, since, expected, clause } = self;
        format!(
            "id: {id}\ntitle: A byte leaves at once\nprofile: xon-xoff\nclauses: {clause}\n\
             level: {level}\nline: 9600 8N1 depth=1 reaction=0\nsince: {since}\n\
             origin: hand-written\n---\n? 0.000000 send 1 \"A\"\n= 0.000000 check 1 good\n\
             > 0.000000 \"{expected}\"\n= 0.001042 done 1 sent=1\n"
        )
    }
}

/// Clauses as `(id, level, feature)`.
pub(crate) fn ledger(revision: u32, clauses: &[(&str, &str, &str)]) -> String {
    let mut text = format!("profile = \"xon-xoff\"\nrevision = {revision}\ntitle = \"Small\"\n");
    let features: std::collections::BTreeSet<_> =
        clauses.iter().map(|clause| clause.2).filter(|feature| !feature.is_empty()).collect();
    for feature in features {
        let _ = write!(text, "\n[[feature]]\nname = \"{feature}\"\ntext = \"Optional.\"\n");
    }
    for (id, level, feature) in clauses {
        let _ = write!(
            text,
            "\n[[clause]]\nid = \"{id}\"\nlevel = \"{level}\"\nsentence = \"Words.\"\n\
             sha256 = \"{}\"\nsince = 1\n",
            fingerprint("Words.")
        );
        if !feature.is_empty() {
            let _ = writeln!(text, "feature = \"{feature}\"");
        }
    }
    text
}

/// The ledger that fits [`Small`].
pub(crate) fn plain_ledger() -> String {
    ledger(
        2,
        &[
            ("xon-xoff.tx.at-once", "must", ""),
            ("xon-xoff.tx.escaped", "must", "transparent"),
            ("xon-xoff.tx.foreign", "must", "unheard-of"),
        ],
    )
}

pub(crate) fn write(folder: &Path, name: &str, text: impl AsRef<[u8]>) {
    let path = folder.join(name);
    std::fs::create_dir_all(path.parent().expect("it has a folder")).expect("it can be made");
    std::fs::write(path, text).expect("it can be written");
}

/// The files of a small corpus.
pub(crate) fn files(cases: &[Small]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("there is room");
    write(folder.path(), "requirements/xon-xoff.toml", plain_ledger());
    for case in cases {
        write(folder.path(), &format!("traces/xon-xoff/{}.spt", case.id), case.text());
    }
    folder
}

pub(crate) fn small(cases: &[Small]) -> Corpus {
    Corpus::read(files(cases).path()).unwrap_or_else(|error| panic!("{error}"))
}

/// Claims the features that [`plain_ledger`] knows.
pub(crate) fn plugin() -> Vec<u8> {
    claiming(r#"{"name":"xon-xoff","features":["transparent"]}"#)
}

/// The plug-in with another claim in its manifest.
pub(crate) fn claiming(claims: &str) -> Vec<u8> {
    let module = module("xon-xoff");
    let begin = b"\"profiles\":[";
    let at = module.windows(begin.len()).position(|window| window == begin);
    let start = at.expect("the manifest has claims") + begin.len();
    let length = module[start..].windows(2).position(|window| window == b"}]");
    let length = length.expect("they end") + 1;
    patched(&module, start, length, claims)
}

/// Text that is shorter than what stood there is filled up with spaces.
pub(crate) fn patched(module: &[u8], start: usize, length: usize, text: &str) -> Vec<u8> {
    let filled = format!("{text:length$}");
    assert_eq!(filled.len(), length, "{text} does not fit");
    let mut patched = module.to_vec();
    patched[start..start + length].copy_from_slice(filled.as_bytes());
    patched
}

pub(crate) fn options() -> CertifyOptions {
    CertifyOptions { threads: 1, revision: Some(1), ..CertifyOptions::new("xon-xoff") }
}

/// Every report follows from its rows.
pub(crate) fn run(corpus: &Corpus, options: &CertifyOptions) -> Report {
    judge(&plugin(), corpus, options).unwrap_or_else(|error| panic!("{error}"))
}

pub(crate) fn judge(
    module: &[u8],
    corpus: &Corpus,
    options: &CertifyOptions,
) -> Result<Report, CertifyError> {
    let report = certify(&Loaded::new(module)?, corpus, options, &|_| {}, &AtomicBool::new(false))?;
    assert_eq!(check(&report), Ok(()));
    Ok(report)
}
