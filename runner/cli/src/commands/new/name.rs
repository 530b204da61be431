//! Names of projects: what is good for a plug-in, a crate and a profile at once.

use std::fmt;

use softplug_conformance::Corpus;

use crate::failure::Failure;

/// Most characters of a plug-in's name.
const LONGEST: usize = 40;

/// Words that name no crate: of the language, of what cargo makes, of the crates that come with the compiler, of devices.
const TAKEN: &str = "abstract alloc as async await become box break build const continue core crate \
    deps do dyn else enum examples extern false final fn for gen if impl in incremental let loop \
    macro match mod move mut override priv proc-macro pub ref return self static std struct super \
    test trait true try type typeof union unsafe unsized use virtual where while yield \
    con prn aux nul";

/// The name of a project.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Name(String);

impl Name {
    pub(super) fn parse(text: &str) -> Result<Self, Failure> {
        let refuse = |why: &str| {
            let shown = text.escape_debug();
            Failure::usage(format_args!("\"{shown}\" cannot be the name of a project: {why}"))
        };
        let is_known = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        if text.is_empty() || text.len() > LONGEST {
            return Err(refuse("1 to 40 characters"));
        }
        if !text.chars().all(is_known) {
            let failure = refuse("it is made of a to z, 0 to 9 and hyphens");
            return Err(match suggestion(text) {
                Some(name) => failure.hint(format_args!("`softplug new {name}`")),
                None => failure,
            });
        }
        if !text.starts_with(|c: char| c.is_ascii_lowercase()) {
            return Err(refuse("it begins with a letter"));
        }
        if text.ends_with('-') || text.contains("--") {
            return Err(refuse("hyphens stand single and inside"));
        }
        if TAKEN.split_whitespace().any(|word| word == text) {
            return Err(refuse("this word has a meaning of its own to Rust or to the system")
                .hint(format_args!("`softplug new {text}-link`, for example")));
        }
        if text.starts_with("softplug") {
            return Err(refuse("crates of the project itself are called so"));
        }
        if Corpus::embedded().ledger(text).is_some() {
            return Err(refuse("a profile that comes with this command is called so")
                .hint(format_args!("`softplug new my-{text}`, for example")));
        }
        Ok(Self(text.to_owned()))
    }

    /// As folder, package, plug-in and profile.
    pub(super) fn as_str(&self) -> &str {
        &self.0
    }

    /// As the crate is called in code.
    pub(super) fn as_identifier(&self) -> String {
        self.0.replace('-', "_")
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// What was probably meant, where that is a name.
fn suggestion(text: &str) -> Option<Name> {
    let other = text.to_ascii_lowercase().replace(['_', ' ', '.'], "-");
    // What stays as it is would be asked about for ever.
    if other == text { None } else { Name::parse(&other).ok() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_good_for_all_that_they_name() {
        for good in ["a", "my-machine", "r2", "x-1-y", &"a".repeat(40)] {
            assert_eq!(Name::parse(good).unwrap().as_str(), good);
        }
        assert_eq!(Name::parse("my-machine").unwrap().as_identifier(), "my_machine");
        for bad in [
            "",
            "1a",
            "-a",
            "a-",
            "a--b",
            "../a",
            "a/b",
            "a\\b",
            "a b",
            "ä",
            "a\n",
            "\u{1b}[2J",
            "fn",
            "self",
            "test",
            "core",
            "nul",
            "softplug-plugin",
            "xon-xoff",
            "abi",
            &"a".repeat(41),
        ] {
            let failure = Name::parse(bad).unwrap_err();
            assert!(!failure.message.contains(char::is_control), "{failure:?}");
        }
        let hint = |text| Name::parse(text).unwrap_err().hint;
        assert_eq!(hint("My_Machine").as_deref(), Some("`softplug new my-machine`"));
        assert_eq!(hint("ä"), None);
    }
}
