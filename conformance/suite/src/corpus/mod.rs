//! The corpus: ledgers, cases and what the mutants showed, as they are compiled in or
//! stand in a folder.

pub mod lint;
#[cfg(feature = "wasmtime")]
mod sessions;

use crate::given::case::Case;
use crate::given::file_error::FileError;
use crate::given::ledger::Ledger;
use crate::given::load::LoadError;
use crate::given::neighbours::{find_long, find_neighbours};
use crate::mutants::Matrix;
use crate::random::SessionGroup;
use crate::script::{self, Script};
use data_encoding::HEXLOWER;
use sha2::{Digest as _, Sha256};
use softplug_fixtures::{Dir, MUTANTS, REQUIREMENTS, TRACES};
use softplug_report::{CaseKind, Level};
use softplug_trace::{self as trace, Assignment, Trace};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::{fs, io};

/// Parts of a corpus, a folder each.
const PARTS: [&str; 3] = ["requirements", "traces", "mutants"];
/// What is left of the mutants for judging.
const MATRIX: &str = "mutants/matrix.toml";

/// The most bytes that a corpus may have.
const CORPUS_BYTES: u64 = 1 << 30;
/// The most files.
const CORPUS_FILES: usize = 100_000;

/// What plug-ins are judged by.
///
/// ```
/// use softplug_conformance::{Corpus, Source};
///
/// let corpus = Corpus::embedded();
/// assert!(corpus.ledger("xon-xoff").is_some());
/// let list = corpus.list();
/// let hold = list.iter().find(|case| case.id == "xon-xoff.tx.hold").expect("it is in the corpus");
/// assert!(hold.cites("xon-xoff.tx.obey-xoff") && matches!(hold.source, Source::Trace(_)));
/// assert_eq!(corpus.digest.len(), 64);
/// ```
#[derive(Clone, Debug)]
pub struct Corpus {
    /// One for each profile, sorted by its name.
    pub ledgers: Vec<Ledger>,
    /// Traces, sorted by id. Their paths begin at the corpus' folder.
    pub cases: Vec<Case>,
    /// Scripts whose clauses the ledgers have, sorted by id.
    pub scripts: Vec<Script>,
    /// Random sessions of the profiles that have a model.
    pub sessions: Vec<SessionGroup>,
    /// How many mutants of the reference plug-ins are killed, by the clause that they break.
    pub kills: BTreeMap<String, u32>,
    /// SHA-256 over the names and contents of all files, as 64 hex digits.
    pub digest: String,
}

/// A case as lists show it, whatever its kind.
///
/// The example of [`Corpus`] shows one.
#[derive(Copy, Clone, Debug)]
pub struct Listed<'a> {
    /// Its id.
    pub id: &'a str,
    /// One sentence.
    pub title: &'a str,
    /// The profile.
    pub profile: &'a str,
    /// The clauses that it cites.
    pub clauses: &'a [String],
    /// How much it binds.
    pub level: Level,
    /// The revision that brought it.
    pub since: u32,
    /// Trace or script.
    pub kind: CaseKind,
    /// The case itself.
    pub source: Source<'a>,
}

/// Where a case's timeline stands.
///
/// The example of [`Corpus`] shows one.
#[derive(Copy, Clone, Debug)]
#[non_exhaustive]
pub enum Source<'a> {
    /// In a trace.
    Trace(&'a Case),
    /// In code.
    Script(&'a Script),
    /// Drawn at random.
    Sessions(&'a SessionGroup),
}

/// A corpus that cannot be read.
///
/// ```
/// use softplug_conformance::{Corpus, CorpusError};
/// use std::path::Path;
///
/// let error = Corpus::read(Path::new("benches")).unwrap_err();
/// assert!(matches!(error, CorpusError::Empty { .. }));
/// assert!(error.to_string().starts_with("benches holds no ledger (requirements/*.toml)"));
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CorpusError {
    /// A file or folder cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// It is too large.
    #[error("{} has more than {CORPUS_FILES} files or {CORPUS_BYTES} bytes; is it a corpus?", path.display())]
    TooLarge {
        /// The folder.
        path: PathBuf,
    },
    /// A text file is not UTF-8.
    #[error("{}:{line}:1: this is not UTF-8 text; save the file as UTF-8", path.display())]
    NotText {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
    },
    /// A ledger or the kill matrix is damaged.
    #[error(transparent)]
    File(#[from] FileError),
    /// Two ledgers have one profile, or a ledger stands in another's file.
    #[error("{} holds the profile \"{profile}\"; name the file {profile}.toml", path.display())]
    LedgerName {
        /// The file.
        path: PathBuf,
        /// The profile in it.
        profile: String,
    },
    /// A trace is damaged or misplaced.
    #[error(transparent)]
    Trace(#[from] LoadError),
    /// There is nothing to judge by.
    #[error("{} holds no ledger (requirements/*.toml) or no trace (traces/*/*.spt); `softplug trace new` begins a trace", path.display())]
    Empty {
        /// The folder.
        path: PathBuf,
    },
}

/// Files by their name in the corpus.
type Files<'a> = BTreeMap<String, std::borrow::Cow<'a, [u8]>>;

impl Corpus {
    /// The corpus of this suite.
    pub fn embedded() -> Self {
        let mut files = Files::new();
        for (part, folder) in PARTS.into_iter().zip([&REQUIREMENTS, &TRACES, &MUTANTS]) {
            embedded(part, folder, &mut files);
        }
        Self::build(Path::new(""), &files, true)
            .expect("a test keeps the files that are compiled in")
    }

    /// A corpus in a folder that has the parts of `fixtures`.
    ///
    /// # Errors
    /// The first file that cannot be read or is damaged, with its line and column.
    pub fn read(folder: &Path) -> Result<Self, CorpusError> {
        Self::read_with(folder, true)
    }

    /// A corpus that is being written: it may have no case yet.
    ///
    /// # Errors
    /// The first file that cannot be read or is damaged, with its line and column.
    ///
    /// # Examples
    /// ```
    /// use softplug_conformance::{Corpus, CorpusError};
    ///
    /// let folder = tempfile::tempdir()?;
    /// let ledger = "profile = \"mine\"\nrevision = 1\ntitle = \"Mine\"\n";
    /// std::fs::create_dir(folder.path().join("requirements"))?;
    /// std::fs::write(folder.path().join("requirements/mine.toml"), ledger)?;
    /// assert_eq!(Corpus::begun(folder.path())?.list().len(), 0);
    /// assert!(matches!(Corpus::read(folder.path()), Err(CorpusError::Empty { .. })));
    /// # Ok::<_, Box<dyn std::error::Error>>(())
    /// ```
    pub fn begun(folder: &Path) -> Result<Self, CorpusError> {
        Self::read_with(folder, false)
    }

    fn read_with(folder: &Path, needs_cases: bool) -> Result<Self, CorpusError> {
        let mut files = Files::new();
        let mut bytes = 0;
        for part in PARTS {
            read_folder(folder, part, &mut files, &mut bytes)?;
        }
        Self::build(folder, &files, needs_cases)
    }

    /// `folder` stands in errors and nowhere else.
    fn build(folder: &Path, files: &Files<'_>, needs_cases: bool) -> Result<Self, CorpusError> {
        let mut ledgers: Vec<Ledger> = Vec::new();
        let mut cases: BTreeMap<String, Case> = BTreeMap::new();
        let mut kills = BTreeMap::new();
        let attached = Arc::new(attachments(files));
        for (name, content) in files {
            let path = folder.join(name);
            let text = || as_text(&path, content);
            match Path::new(name).extension().and_then(|extension| extension.to_str()) {
                Some("toml") if name.starts_with("requirements/") => {
                    let ledger = Ledger::parse(&path, text()?)?;
                    if *name != format!("requirements/{}.toml", ledger.profile) {
                        let profile = ledger.profile;
                        return Err(CorpusError::LedgerName { path, profile });
                    }
                    ledgers.push(ledger);
                }
                Some("spt") => {
                    let trace = Trace::parse(text()?).map_err(|source| LoadError::Parse {
                        path: path.clone(),
                        source: Box::new(source),
                    })?;
                    trace.front.check_path(&path).map_err(LoadError::Name)?;
                    let id = trace.front.id.clone();
                    let case = Case::attached(name, trace, Arc::clone(&attached));
                    if let Some(first) = cases.insert(id.clone(), case) {
                        let first = folder.join(first.path);
                        return Err(LoadError::Twice { id, first, second: path }.into());
                    }
                }
                Some("toml") if name == MATRIX => {
                    let matrix = Matrix::parse(&path, text()?)?;
                    let counts = matrix.killed_by_clause().into_iter();
                    kills = counts.map(|(clause, count)| (clause.to_owned(), count)).collect();
                }
                _ => {}
            }
        }
        if ledgers.is_empty() || needs_cases && cases.is_empty() {
            return Err(CorpusError::Empty { path: folder.to_owned() });
        }
        ledgers.sort_by(|a, b| a.profile.cmp(&b.profile));
        let mut cases: Vec<Case> = cases.into_values().collect();
        for case in &mut cases {
            let profile = &case.trace.front.profile;
            if let Some(ledger) = ledgers.iter().find(|ledger| ledger.profile == *profile) {
                case.dispense_with(&ledger.settings);
            }
        }
        find_neighbours(&mut cases);
        find_long(&mut cases);
        let has_clauses = |script: &Script| {
            let ledger = ledgers.iter().find(|ledger| ledger.profile == script.profile);
            let has = |ledger: &Ledger| script.clauses.iter().all(|id| ledger.clause(id).is_some());
            ledger.is_some_and(has)
        };
        let scripts = script::all().into_iter().filter(has_clauses).collect();
        let sessions = ledgers.iter().flat_map(SessionGroup::of).collect();
        Ok(Self { ledgers, cases, scripts, sessions, kills, digest: digest(files) })
    }

    /// The ledger of a profile.
    pub fn ledger(&self, profile: &str) -> Option<&Ledger> {
        self.ledgers.iter().find(|ledger| ledger.profile == profile)
    }

    /// Every case, sorted by id.
    pub fn list(&self) -> Vec<Listed<'_>> {
        let scripts = self.scripts.iter().map(Listed::of_script);
        let sessions = self.sessions.iter().map(Listed::of_sessions);
        let traces = self.cases.iter().map(Listed::of_trace);
        let mut list: Vec<_> = traces.chain(scripts).chain(sessions).collect();
        list.sort_by_key(|case| case.id);
        list
    }
}

impl<'a> Listed<'a> {
    fn of_trace(case: &'a Case) -> Self {
        let front = &case.trace.front;
        Self {
            id: &front.id,
            title: &front.title,
            profile: &front.profile,
            clauses: &front.clauses,
            level: level(front.level),
            since: front.since,
            kind: CaseKind::Trace,
            source: Source::Trace(case),
        }
    }

    fn of_script(script: &'a Script) -> Self {
        Self {
            id: &script.id,
            title: &script.title,
            profile: script.profile,
            clauses: &script.clauses,
            level: level(script.level),
            since: script.since,
            kind: CaseKind::Script,
            source: Source::Script(script),
        }
    }

    /// Whether it cites this clause.
    pub fn cites(&self, clause: &str) -> bool {
        self.clauses.iter().any(|cited| cited == clause)
    }

    /// Settings that it uses.
    fn of_sessions(group: &'a SessionGroup) -> Self {
        Self {
            id: &group.id,
            title: &group.title,
            profile: group.profile,
            clauses: &group.clauses,
            level: Level::Must,
            since: group.since,
            kind: CaseKind::Random,
            source: Source::Sessions(group),
        }
    }

    pub(crate) fn config(&self) -> &'a [Assignment] {
        match self.source {
            Source::Trace(case) => &case.trace.front.config,
            // Its settings are looked up in the manifest when it runs.
            Source::Script(_) | Source::Sessions(_) => &[],
        }
    }

    /// Clauses that leave a choice in it.
    pub(crate) fn alternatives(&self) -> impl Iterator<Item = &'a String> + use<'a> {
        let trace = match self.source {
            Source::Trace(case) => Some(&case.trace),
            Source::Script(_) | Source::Sessions(_) => None,
        };
        trace.into_iter().flat_map(|trace| trace.alternatives().map(|block| &block.clause))
    }
}

/// The trace's word for a level in that of a report.
pub(crate) fn level(level: trace::Level) -> Level {
    match level {
        trace::Level::Must => Level::Must,
        trace::Level::Should => Level::Should,
        trace::Level::May => Level::May,
    }
}

fn embedded(part: &str, folder: &'static Dir<'static>, files: &mut Files<'_>) {
    for file in folder.files() {
        let name = format!("{part}/{}", file.path().display());
        files.insert(name, file.contents().into());
    }
    for inner in folder.dirs() {
        embedded(part, inner, files);
    }
}

/// Reads all files in and below `folder/part`. A part that is not there is empty.
fn read_folder(
    folder: &Path,
    part: &str,
    files: &mut Files<'_>,
    bytes: &mut u64,
) -> Result<(), CorpusError> {
    let path = folder.join(part);
    let io = |path: &Path, source| CorpusError::Io { path: path.to_owned(), source };
    let entries = match fs::read_dir(&path) {
        Ok(entries) => entries,
        Err(error) if error.kind() == io::ErrorKind::NotFound && folder.is_dir() => return Ok(()),
        Err(error) => return Err(io(&path, error)),
    };
    for entry in entries {
        let entry = entry.map_err(|error| io(&path, error))?;
        let path = entry.path();
        let mut kind = entry.file_type().map_err(|error| io(&path, error))?;
        if kind.is_symlink() {
            // A linked file counts like any other; a folder could lead round in a circle.
            kind = fs::metadata(&path).map_err(|error| io(&path, error))?.file_type();
            if !kind.is_file() {
                let error = io::Error::other("it is a link, and not to a file");
                return Err(io(&path, error));
            }
        }
        let Ok(name) = entry.file_name().into_string() else { continue };
        let name = format!("{part}/{name}");
        if kind.is_dir() {
            read_folder(folder, &name, files, bytes)?;
        } else if kind.is_file() {
            *bytes += fs::metadata(&path).map_err(|error| io(&path, error))?.len();
            if *bytes > CORPUS_BYTES || files.len() >= CORPUS_FILES {
                return Err(CorpusError::TooLarge { path: folder.to_owned() });
            }
            files.insert(name, fs::read(&path).map_err(|error| io(&path, error))?.into());
        }
    }
    Ok(())
}

/// What `file:` items name: files in a folder `files`, called by their digest.
fn attachments(files: &Files<'_>) -> BTreeMap<String, Vec<u8>> {
    let named = files.iter().filter_map(|(name, content)| {
        let (folder, name) = name.rsplit_once('/')?;
        folder.ends_with("/files").then(|| (name.to_owned(), content.to_vec()))
    });
    named.collect()
}

fn as_text<'a>(path: &Path, content: &'a [u8]) -> Result<&'a str, CorpusError> {
    std::str::from_utf8(content).map_err(|error| {
        let good = &content[..error.valid_up_to()];
        let line = good.split(|byte| *byte == b'\n').count();
        CorpusError::NotText { path: path.to_owned(), line }
    })
}

/// Each file's name and length stand before its content: no file can pass for another.
fn digest(files: &Files<'_>) -> String {
    let mut digest = Sha256::new();
    for (name, content) in files {
        digest.update(format!("{name}\n{}\n", content.len()));
        digest.update(content);
    }
    HEXLOWER.encode(&digest.finalize())
}
