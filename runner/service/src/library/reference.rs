//! How a plug-in is named: `xon-xoff`, `xon-xoff@0.1`, `xon-xoff@sha256:…`.

use std::cmp::Ordering;
use std::fmt;
use std::str::FromStr;

use thiserror::Error;

/// Fewer digits of a digest than this are too easily met by chance.
const FEWEST_DIGITS: usize = 8;
/// Longest version.
const VERSION_BYTES: usize = 64;

/// A plug-in, by name and version or digest.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Reference {
    /// The plug-in's name.
    pub name: String,
    /// Which one of that name.
    pub which: Which,
}

/// Which one of a name.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Which {
    /// The newest version.
    Newest,
    /// This version, or the newest that begins with it: `0.1` is `0.1.4` too.
    Version(String),
    /// The module with this SHA-256, or the only one whose SHA-256 begins so: lower-case
    /// hex digits, 8 to 64.
    Digest(String),
}

/// Text that names no plug-in.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub enum BadReference {
    /// The name.
    #[error("\"{0}\" is no name of a plug-in: it is 1 to 40 of a-z, 0-9 and hyphens")]
    Name(String),
    /// What stands behind the @.
    #[error(
        "\"{0}\" is no version: it is 1 to {VERSION_BYTES} of letters, digits, dots, hyphens, plus and underscore"
    )]
    Version(String),
    /// What stands behind `sha256:`.
    #[error(
        "\"{0}\" is no SHA-256: it is 64 hex digits, of which the first {FEWEST_DIGITS} or more are enough"
    )]
    Digest(String),
}

impl FromStr for Reference {
    type Err = BadReference;

    fn from_str(text: &str) -> Result<Self, BadReference> {
        let (name, which) = match text.split_once('@') {
            None => (text, Which::Newest),
            Some((name, version)) => match version.strip_prefix("sha256:") {
                Some(digits) => (name, Which::Digest(digits.to_ascii_lowercase())),
                None => (name, Which::Version(version.to_owned())),
            },
        };
        let fits = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        if !(1..=40).contains(&name.len()) || !name.chars().all(fits) {
            return Err(BadReference::Name(shown(name)));
        }
        match &which {
            Which::Newest => {}
            Which::Version(version) => {
                if !is_version(version) {
                    return Err(BadReference::Version(shown(version)));
                }
            }
            Which::Digest(digits) => {
                let is_hex = digits.bytes().all(|byte| byte.is_ascii_hexdigit());
                if !is_hex || !(FEWEST_DIGITS..=64).contains(&digits.len()) {
                    return Err(BadReference::Digest(shown(digits)));
                }
            }
        }
        Ok(Self { name: name.to_owned(), which })
    }
}

impl fmt::Display for Reference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.which {
            Which::Newest => f.write_str(&self.name),
            Which::Version(version) => write!(f, "{}@{version}", self.name),
            Which::Digest(digits) => write!(f, "{}@sha256:{digits}", self.name),
        }
    }
}

/// Enough to recognise it by, and nothing that moves a cursor.
fn shown(text: &str) -> String {
    text.chars().take(80).flat_map(char::escape_debug).collect()
}

/// Whether a version can be the name of a file, and be written behind an @.
pub(super) fn is_version(version: &str) -> bool {
    let fits = |c: char| c.is_ascii_alphanumeric() || ".+_-".contains(c);
    (1..=VERSION_BYTES).contains(&version.len())
        && version.chars().all(fits)
        && version.starts_with(|c: char| c.is_ascii_alphanumeric())
}

/// Whether `version` is `asked` or one of its line: `0.1` means `0.1.4` too, not `0.10`.
pub(super) fn is_of(version: &str, asked: &str) -> bool {
    version.strip_prefix(asked).is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '+']))
}

/// A version that is meant for trying out: `1.0.0-beta`.
pub(super) fn is_trial(version: &str) -> bool {
    version.split('+').next().unwrap_or_default().contains('-')
}

/// The order of versions: numbers as numbers, a trial before what it is a trial of.
pub(super) fn compare(one: &str, other: &str) -> Ordering {
    let halves = |version: &str| {
        let without_build = version.split('+').next().unwrap_or_default().to_owned();
        match without_build.split_once('-') {
            Some((core, trial)) => (core.to_owned(), Some(trial.to_owned())),
            None => (without_build, None),
        }
    };
    let ((core, trial), (other_core, other_trial)) = (halves(one), halves(other));
    let by_trial = || match (&trial, &other_trial) {
        (None, None) => Ordering::Equal,
        (None, Some(_)) => Ordering::Greater,
        (Some(_), None) => Ordering::Less,
        (Some(trial), Some(other)) => by_parts(trial, other),
    };
    by_parts(&core, &other_core).then_with(by_trial).then_with(|| one.cmp(other))
}

fn by_parts(one: &str, other: &str) -> Ordering {
    let (mut parts, mut others) = (one.split('.'), other.split('.'));
    loop {
        let order = match (parts.next(), others.next()) {
            (None, None) => return Ordering::Equal,
            (None, Some(_)) => Ordering::Less,
            (Some(_), None) => Ordering::Greater,
            (Some(part), Some(other)) => by_part(part, other),
        };
        if order.is_ne() {
            return order;
        }
    }
}

/// Numbers come before words. A number may have any length.
fn by_part(one: &str, other: &str) -> Ordering {
    let number = |part: &str| {
        let is_number = !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
        is_number.then(|| part.trim_start_matches('0').to_owned())
    };
    match (number(one), number(other)) {
        (Some(one), Some(other)) => one.len().cmp(&other.len()).then_with(|| one.cmp(&other)),
        (Some(_), None) => Ordering::Less,
        (None, Some(_)) => Ordering::Greater,
        (None, None) => one.cmp(other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn names_versions_and_digests_are_told_apart() {
        let read = |text: &str| text.parse::<Reference>().map(|reference| reference.which);
        assert_eq!(read("xon-xoff"), Ok(Which::Newest));
        assert_eq!(read("xon-xoff@0.1"), Ok(Which::Version("0.1".to_owned())));
        assert_eq!(read("xon-xoff@sha256:E3B0C442"), Ok(Which::Digest("e3b0c442".to_owned())));
        for bad in [
            "",
            "Xon",
            "a/b",
            "..",
            "a@",
            "a@../x",
            "a@.1",
            "a@sha256:e3b0c4",
            "a@sha256:g3b0c442",
            "a b",
        ] {
            assert!(read(bad).is_err(), "{bad}");
        }
        assert_eq!(
            "a\u{1b}b".parse::<Reference>().unwrap_err().to_string(),
            "\"a\\u{1b}b\" is no name of a plug-in: it is 1 to 40 of a-z, 0-9 and hyphens"
        );
    }

    #[test]
    fn versions_have_the_order_that_people_expect() {
        let ascending = [
            "0.1",
            "0.1.0-beta.2",
            "0.1.0-beta.11",
            "0.1.0-rc",
            "0.1.0",
            "0.1.0+b",
            "0.1.2",
            "0.1.10",
            "0.10.0",
            "1.0.0",
            "2024.11",
        ];
        for pair in ascending.windows(2) {
            assert_eq!(compare(pair[0], pair[1]), Ordering::Less, "{pair:?}");
        }
        assert!(is_of("0.1.4", "0.1") && is_of("0.1.4", "0.1.4") && !is_of("0.10.0", "0.1"));
        assert!(!is_of("0.1.4-beta", "0.1.4") && is_trial("0.1.4-beta") && !is_trial("1+a-b"));
    }

    proptest! {
        #[test]
        fn the_order_of_versions_is_total(
            one in "[0-9a-z.+-]{1,12}", two in "[0-9a-z.+-]{1,12}", three in "[0-9a-z.+-]{1,12}",
        ) {
            prop_assert_eq!(compare(&one, &two), compare(&two, &one).reverse());
            prop_assert_eq!(compare(&one, &two).is_eq(), one == two);
            if compare(&one, &two).is_le() && compare(&two, &three).is_le() {
                prop_assert!(compare(&one, &three).is_le());
            }
        }

        #[test]
        fn what_is_read_is_shown_the_same(text in "[a-z-]{1,5}(@[0-9a-z.]{1,9}|@sha256:[0-9a-f]{8,12})?") {
            if let Ok(reference) = text.parse::<Reference>() {
                prop_assert_eq!(reference.to_string(), text);
            }
        }
    }
}
