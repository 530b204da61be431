//! Catalogues: the mutants of a profile, in `fixtures/mutants/*.toml`.

use super::patch::id;
use crate::FileError;
use crate::given::file_error::read_toml;
use crate::given::ledger::Ledger;
use serde::Deserialize;
use serde::de::IgnoredAny;
use softplug_report::Level;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::{fs, io};
use toml::Spanned;

/// The file beside the catalogues that is none.
const MATRIX: &str = "matrix.toml";

/// The mutants of one profile.
///
/// ```
/// use softplug_conformance::mutants::{Catalogue, Place};
/// use std::path::Path;
///
/// let text = r#"
/// profile = "xon-xoff"
/// plugin = "xon-xoff"
///
/// [[mutant]]
/// id = "xon-xoff.tx.obey-xoff/ignored"
/// text = "XOFF means nothing"
///
/// [[unbreakable]]
/// clause = "xon-xoff.line.parameters"
/// reason = "A plug-in cannot choose the line's parameters."
/// "#;
/// let catalogue = Catalogue::parse(Path::new("xon-xoff.toml"), text)?;
/// assert_eq!(catalogue.mutants[0].clause(), "xon-xoff.tx.obey-xoff");
/// assert_eq!(catalogue.mutants[0].place, Place { line: 6, column: 6 });
/// assert_eq!(catalogue.unbreakable[0].clause, "xon-xoff.line.parameters");
/// # Ok::<(), softplug_conformance::FileError>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Catalogue {
    /// The file, as it was named.
    pub file: PathBuf,
    /// The profile whose cases must notice.
    pub profile: String,
    /// What is known to be wrong on purpose, in the order of the file.
    pub mutants: Vec<Mutant>,
    /// Clauses that no change of a plug-in can break.
    pub unbreakable: Vec<Unbreakable>,
}

/// A plug-in with one broken rule.
///
/// The example of [`Catalogue`] shows one.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Mutant {
    /// The clause, a slash, a slug: `xon-xoff.tx.obey-xoff/ignored`.
    pub id: String,
    /// The plug-in whose build holds it.
    pub plugin: String,
    /// What is wrong, in words.
    pub text: String,
    /// Why no case can notice it; `None`: one must.
    pub survivor: Option<String>,
    /// Where in the file.
    pub place: Place,
}

impl Mutant {
    /// The clause that it breaks.
    pub fn clause(&self) -> &str {
        self.id.split('/').next().unwrap_or_default()
    }
}

/// A clause that no change of a plug-in can break.
///
/// The example of [`Catalogue`] shows one.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Unbreakable {
    /// The clause.
    pub clause: String,
    /// Why.
    pub reason: String,
    /// Where in the file.
    pub place: Place,
}

/// Where something stands in a file.
///
/// The example of [`Catalogue`] shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Place {
    /// From 1.
    pub line: u32,
    /// In characters, from 1.
    pub column: u32,
}

/// What is wrong with a catalogue.
///
/// ```
/// use softplug_conformance::mutants::{Catalogue, CatalogueError};
/// use std::path::Path;
///
/// let error = Catalogue::read(Path::new("none")).unwrap_err();
/// assert!(matches!(error, CatalogueError::Io { .. }));
/// assert!(error.to_string().starts_with("cannot read none: "));
/// ```
#[derive(Debug, thiserror::Error)]
pub enum CatalogueError {
    /// A file or folder cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// A file says what cannot be.
    #[error(transparent)]
    Wrong(#[from] FileError),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawCatalogue {
    profile: String,
    plugin: String,
    #[serde(default)]
    mutant: Vec<RawMutant>,
    #[serde(default)]
    unbreakable: Vec<RawUnbreakable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMutant {
    id: Spanned<String>,
    text: Spanned<String>,
    plugin: Option<String>,
    survivor: Option<Spanned<String>>,
    /// What it changes of the plug-in's code: who builds the mutants reads it.
    #[serde(default, rename = "change")]
    _change: Vec<IgnoredAny>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawUnbreakable {
    clause: Spanned<String>,
    reason: Spanned<String>,
}

impl Catalogue {
    /// Reads a catalogue.
    ///
    /// # Errors
    /// The text is no TOML of the catalogue's shape, or a word of it is empty or not
    /// of the shape that it needs.
    pub fn parse(file: &Path, text: &str) -> Result<Self, FileError> {
        let wrong =
            |span: Range<usize>, message: String| FileError::at(file, text, &span, &message);
        let place = |span: Range<usize>| {
            let FileError { line, column, .. } = FileError::at(file, text, &span, "");
            Place { line, column }
        };
        let raw: RawCatalogue = read_toml(file, text)?;
        let words = |word: &Spanned<String>| {
            let is_empty = word.get_ref().trim().is_empty();
            let message = "this says nothing: write one sentence".to_owned();
            if is_empty { Err(wrong(word.span(), message)) } else { Ok(word.get_ref().clone()) }
        };
        let mut mutants = Vec::new();
        for mutant in &raw.mutant {
            let id = mutant.id.get_ref();
            if !is_mutant(id) {
                let message = format!(
                    "\"{id}\" is no mutant's id: write the clause, a slash and a slug, as in \
                     \"xon-xoff.tx.obey-xoff/ignored\""
                );
                return Err(wrong(mutant.id.span(), message));
            }
            mutants.push(Mutant {
                id: id.clone(),
                plugin: mutant.plugin.as_ref().unwrap_or(&raw.plugin).clone(),
                text: words(&mutant.text)?,
                survivor: mutant.survivor.as_ref().map(words).transpose()?,
                place: place(mutant.id.span()),
            });
        }
        let mut unbreakable = Vec::new();
        for clause in &raw.unbreakable {
            unbreakable.push(Unbreakable {
                clause: clause.clause.get_ref().clone(),
                reason: words(&clause.reason)?,
                place: place(clause.clause.span()),
            });
        }
        Ok(Self { file: file.to_owned(), profile: raw.profile, mutants, unbreakable })
    }

    /// Reads all catalogues of a folder, sorted by file.
    ///
    /// # Errors
    /// The first one that cannot be read.
    pub fn read(folder: &Path) -> Result<Vec<Self>, CatalogueError> {
        let io = |path: &Path, source| CatalogueError::Io { path: path.to_owned(), source };
        let mut files = Vec::new();
        for entry in fs::read_dir(folder).map_err(|error| io(folder, error))? {
            let path = entry.map_err(|error| io(folder, error))?.path();
            let is_toml = path.extension().is_some_and(|extension| extension == "toml");
            if is_toml && path.file_name().is_some_and(|name| name != MATRIX) {
                files.push(path);
            }
        }
        files.sort();
        let read = |path: &PathBuf| {
            let text = fs::read_to_string(path).map_err(|error| io(path, error))?;
            Ok(Self::parse(path, &text)?)
        };
        files.iter().map(read).collect()
    }

    fn wrong(&self, place: Place, message: String) -> FileError {
        let Place { line, column } = place;
        FileError { file: self.file.clone(), line, column, message }
    }
}

/// Holds catalogues against each other and against the clauses that there are. All
/// that is wrong, in the order of the files.
///
/// ```
/// use softplug_conformance::mutants::{Catalogue, check_all};
/// use std::path::Path;
///
/// let text = r#"
/// profile = "xon-xoff"
/// plugin = "xon-xoff"
///
/// [[mutant]]
/// id = "xon-xoff.tx.obey-xof/ignored"
/// text = "XOFF means nothing"
/// "#;
/// let catalogue = Catalogue::parse(Path::new("xon-xoff.toml"), text)?;
/// let wrong = check_all(&[catalogue], |clause| clause == "xon-xoff.tx.obey-xoff");
/// assert_eq!(wrong.len(), 1);
/// assert_eq!(
///     wrong[0].to_string(),
///     "xon-xoff.toml:6:6: there is no clause \"xon-xoff.tx.obey-xof\""
/// );
/// # Ok::<(), softplug_conformance::FileError>(())
/// ```
pub fn check_all(catalogues: &[Catalogue], is_clause: impl Fn(&str) -> bool) -> Vec<FileError> {
    let mut wrong = Vec::new();
    let mut numbers: BTreeMap<u64, &str> = BTreeMap::new();
    let mut broken: BTreeMap<&str, &str> = BTreeMap::new();
    for catalogue in catalogues {
        for mutant in &catalogue.mutants {
            let name = mutant.id.as_str();
            broken.entry(mutant.clause()).or_insert(name);
            if !is_clause(mutant.clause()) {
                let message = format!("there is no clause \"{}\"", mutant.clause());
                wrong.push(catalogue.wrong(mutant.place, message));
            }
            match numbers.insert(id(name), name) {
                Some(other) if other == name => {
                    let message = format!("\"{name}\" is listed twice: rename or remove one");
                    wrong.push(catalogue.wrong(mutant.place, message));
                }
                Some(other) => {
                    let message = format!("\"{name}\" has the number of \"{other}\": rename it");
                    wrong.push(catalogue.wrong(mutant.place, message));
                }
                None => {}
            }
        }
    }
    let mut excused = BTreeSet::new();
    for catalogue in catalogues {
        for unbreakable in &catalogue.unbreakable {
            let clause = unbreakable.clause.as_str();
            let message = if !is_clause(clause) {
                format!("there is no clause \"{clause}\"")
            } else if let Some(mutant) = broken.get(clause) {
                format!("\"{clause}\" can be broken: \"{mutant}\" does; remove one of the two")
            } else if !excused.insert(clause) {
                format!("\"{clause}\" is listed twice: remove one")
            } else {
                continue;
            };
            wrong.push(catalogue.wrong(unbreakable.place, message));
        }
    }
    wrong
}

/// The clauses that must be kept and can be tested, for which no catalogue has a
/// mutant or a reason why there is none. Sorted.
///
/// ```
/// use softplug_conformance::Corpus;
/// use softplug_conformance::mutants::{Catalogue, unproved};
/// use std::path::Path;
///
/// let corpus = Corpus::embedded();
/// let catalogues = Catalogue::read(Path::new("../../fixtures/mutants"))?;
/// assert!(unproved(&catalogues, &corpus.ledgers).is_empty());
/// assert!(unproved(&[], &corpus.ledgers).contains(&"xon-xoff.tx.obey-xoff"));
/// # Ok::<(), softplug_conformance::mutants::CatalogueError>(())
/// ```
pub fn unproved<'a>(catalogues: &[Catalogue], ledgers: &'a [Ledger]) -> Vec<&'a str> {
    let broken = catalogues.iter().flat_map(|catalogue| &catalogue.mutants).map(Mutant::clause);
    let excused = catalogues.iter().flat_map(|catalogue| &catalogue.unbreakable);
    let proved: BTreeSet<&str> =
        broken.chain(excused.map(|unbreakable| unbreakable.clause.as_str())).collect();
    let binding = ledgers
        .iter()
        .flat_map(|ledger| &ledger.clauses)
        .filter(|clause| clause.level == Level::Must && clause.excluded.is_none());
    let mut unproved: Vec<&str> =
        binding.map(|clause| clause.id.as_str()).filter(|id| !proved.contains(id)).collect();
    unproved.sort_unstable();
    unproved
}

fn is_mutant(id: &str) -> bool {
    let is_run = |run: &str| {
        !run.is_empty() && run.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit())
    };
    let is_part = |part: &str| part.split('-').all(is_run);
    let Some((clause, slug)) = id.split_once('/') else { return false };
    id.len() <= 128 && clause.contains('.') && clause.split('.').all(is_part) && is_part(slug)
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "\
profile = \"xon-xoff\"
plugin = \"xon-xoff\"

[[mutant]]
id = \"xon-xoff.tx.obey-xoff/ignored\"
text = \"XOFF is ignored\"

[[mutant]]
id = \"xon-xoff.tx.depth/two\"
text = \"Two more leave\"
plugin = \"other\"
survivor = \"The port holds them.\"

[[unbreakable]]
clause = \"xon-xoff.link.close\"
reason = \"The host makes a new instance.\"
";

    fn parse(text: &str) -> Result<Catalogue, String> {
        Catalogue::parse(Path::new("m.toml"), text).map_err(|error| error.to_string())
    }

    #[test]
    fn mutants_take_the_plug_in_of_the_file() {
        let catalogue = parse(GOOD).expect("it is a catalogue");
        assert_eq!(catalogue.profile, "xon-xoff");
        let [ignored, two] = &catalogue.mutants[..] else { panic!("two mutants") };
        assert_eq!((ignored.plugin.as_str(), two.plugin.as_str()), ("xon-xoff", "other"));
        assert_eq!(ignored.clause(), "xon-xoff.tx.obey-xoff");
        let place = |line, column| Place { line, column };
        assert_eq!((ignored.place, two.place), (place(5, 6), place(9, 6)));
        assert_eq!(two.survivor.as_deref(), Some("The port holds them."));
        assert_eq!(catalogue.unbreakable[0].clause, "xon-xoff.link.close");
    }

    #[test]
    fn faults_have_their_place() {
        let fault = |from: &str, to: &str| parse(&GOOD.replacen(from, to, 1)).unwrap_err();
        assert!(fault("obey-xoff/ignored", "obey-xoff").starts_with("m.toml:5:6: \"xon-xoff.tx"));
        assert!(fault("XOFF is ignored", " ").starts_with("m.toml:6:8: this says nothing"));
        assert!(fault("The port holds them.", "").starts_with("m.toml:12:12: this says nothing"));
        assert!(fault("The host makes a new instance.", "").starts_with("m.toml:16:10: "));
        assert!(fault("survivor =", "survives =").starts_with("m.toml:12:1: unknown field"));
        assert!(fault("profile =", "profile").starts_with("m.toml:1:"));
        for bad in ["a.b/", "/a", "a/b", "a..b/c", "A.b/c", "a.b/c/d", "a.b/c--d", "a.b/-c"] {
            assert!(!is_mutant(bad), "{bad}");
        }
    }

    #[test]
    fn catalogues_agree_with_each_other_and_with_the_clauses() {
        let good = parse(GOOD).expect("it is a catalogue");
        let is_clause = |_: &str| true;
        assert!(check_all(std::slice::from_ref(&good), is_clause).is_empty());
        let all = |catalogues: &[Catalogue], known: &[&str]| {
            let wrong = check_all(catalogues, |clause| known.contains(&clause));
            wrong.iter().map(ToString::to_string).collect::<Vec<_>>()
        };
        let known = ["xon-xoff.tx.obey-xoff", "xon-xoff.tx.depth", "xon-xoff.link.close"];
        assert_eq!(
            all(std::slice::from_ref(&good), &known[1..2]),
            [
                "m.toml:5:6: there is no clause \"xon-xoff.tx.obey-xoff\"",
                "m.toml:15:10: there is no clause \"xon-xoff.link.close\"",
            ]
        );
        let twice = all(&[good.clone(), good.clone()], &known);
        assert_eq!(twice.len(), 3, "{twice:?}");
        assert!(twice.iter().all(|message| message.contains("listed twice")), "{twice:?}");
        let broken = GOOD.replace("xon-xoff.link.close", "xon-xoff.tx.depth");
        let broken = all(&[parse(&broken).expect("it is a catalogue")], &known);
        assert!(broken[0].contains("can be broken: \"xon-xoff.tx.depth/two\" does"), "{broken:?}");
    }
}
