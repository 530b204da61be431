//! The hashes of a ledger's sentences, written into its text.

use super::fingerprint;
use crate::given::file_error::{FileError, read_toml};
use serde::Deserialize;
use std::path::Path;
use toml::Spanned;

/// A ledger's text in which each clause has the hash of its sentence.
///
/// ```
/// use softplug_conformance::ledger::{Ledger, hashed};
/// use std::path::Path;
///
/// let text = r#"
/// profile = "echo"
/// revision = 1
/// title = "What comes is sent back"
///
/// [[clause]]
/// id = "echo.tx.at-once"
/// level = "must"
/// sentence = "Every byte is sent back at once" # as the page has it
/// since = 1
/// "#;
/// let hashed = hashed(Path::new("echo.toml"), text)?;
/// assert_eq!(hashed.clauses, ["echo.tx.at-once"]);
/// let ledger = Ledger::parse(Path::new("echo.toml"), &hashed.text)?;
/// assert_eq!(ledger.clauses[0].sha256, "9c8e10d29bfb0437");
/// assert!(hashed.text.contains("# as the page has it\n"));
/// # Ok::<(), softplug_conformance::ledger::LedgerError>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Hashed {
    /// The text; all that is no hash is as it was.
    pub text: String,
    /// Clauses whose hash is another one now, in the order of the file: their cases are to be
    /// looked at.
    pub clauses: Vec<String>,
}

/// Writes the hashes that are missing or wrong. `file` stands in errors.
///
/// # Errors
/// The text is no ledger's: the first fault, with its place. Whether all else of it is right is
/// not looked at.
pub fn hashed(file: &Path, text: &str) -> Result<Hashed, FileError> {
    let ledger: Clauses = read_toml(file, text)?;
    let mut hashed = Hashed { text: text.to_owned(), clauses: Vec::new() };
    // From the end: what is before keeps its place.
    for Clause { id, sentence, sha256 } in ledger.clause.into_iter().rev() {
        let hash = fingerprint(sentence.get_ref());
        match sha256 {
            Some(known) if *known.get_ref() == hash => continue,
            Some(known) => hashed.text.replace_range(known.span(), &format!("\"{hash}\"")),
            None => {
                let end = sentence.span().end;
                let line = text[end..].find('\n').map_or(text.len(), |rest| end + rest);
                hashed.text.insert_str(line, &format!("\nsha256 = \"{hash}\""));
            }
        }
        hashed.clauses.insert(0, id);
    }
    Ok(hashed)
}

/// What matters of a ledger here.
#[derive(Deserialize)]
struct Clauses {
    #[serde(default)]
    clause: Vec<Clause>,
}

#[derive(Deserialize)]
struct Clause {
    id: String,
    sentence: Spanned<String>,
    sha256: Option<Spanned<String>>,
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "echo.toml";

    fn of(text: &str) -> Hashed {
        hashed(Path::new(FILE), text).unwrap()
    }

    #[test]
    fn a_wrong_hash_is_replaced_and_a_right_one_left_alone() {
        let text = "[[clause]]\nid = \"a\"\nsha256 = 'old' # why\nsentence = '''\nTwo\nlines'''\n\n\
                    [[clause]]\nid = \"b\"\nsentence = \"Every byte is sent back at once\"\n\
                    sha256 = \"9c8e10d29bfb0437\"\n";
        let hashed = of(text);
        assert_eq!(hashed.clauses, ["a"]);
        let expected = fingerprint("Two\nlines");
        assert_eq!(hashed.text, text.replace("'old'", &format!("\"{expected}\"")));
        assert_eq!(of(&hashed.text).clauses, [""; 0]);
    }

    #[test]
    fn a_missing_hash_comes_behind_the_sentence() {
        let text = "[[clause]]\nid = \"a\"\nsentence = \"x\"";
        let hashed = of(text);
        assert_eq!(hashed.text, format!("{text}\nsha256 = \"{}\"", fingerprint("x")));
        assert_eq!(of(&hashed.text).clauses, [""; 0]);
    }
}
