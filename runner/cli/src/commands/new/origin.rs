//! The reference plug-ins, as what a project begins from.

use include_dir::{Dir, File, include_dir};
use softplug_fixtures::{REQUIREMENTS, TRACES};

use super::Language;
use crate::failure::Failure;

/// A reference plug-in in one language.
#[derive(Debug)]
pub(super) struct Origin {
    /// Its name.
    pub(super) name: &'static str,
    pub(super) language: Language,
    /// The name in its manifest.
    pub(super) plugin: &'static str,
    /// Profiles that it claims.
    pub(super) profiles: &'static [&'static str],
    /// What stands in `src`.
    pub(super) sources: Dir<'static>,
    /// Crates beside `softplug-plugin`: those of Softplug with their folder in a clone, others
    /// with their entry.
    pub(super) crates: &'static [(&'static str, &'static str)],
}

const PROCEDURE: &[(&str, &str)] = &[("softplug-procedure-3964", "plugins/procedure-3964")];

static ALL: [Origin; 9] = [
    Origin {
        name: "xon-xoff",
        language: Language::Rust,
        plugin: "xon-xoff",
        profiles: &["xon-xoff"],
        sources: include_dir!("$CARGO_MANIFEST_DIR/templates/from/xon-xoff"),
        crates: &[],
    },
    Origin {
        name: "r3964",
        language: Language::Rust,
        plugin: "r3964",
        profiles: &["r3964", "3964", "rk512"],
        sources: include_dir!("$CARGO_MANIFEST_DIR/templates/from/r3964"),
        crates: PROCEDURE,
    },
    Origin {
        name: "r3964-simplified",
        language: Language::Rust,
        plugin: "r3964-simplified",
        profiles: &["r3964-simplified"],
        sources: include_dir!("$CARGO_MANIFEST_DIR/templates/from/r3964-simplified"),
        crates: PROCEDURE,
    },
    Origin {
        name: "fanuc-rs232",
        language: Language::Rust,
        plugin: "fanuc-rs232",
        profiles: &["fanuc-rs232"],
        sources: include_dir!("$CARGO_MANIFEST_DIR/templates/from/fanuc-rs232"),
        crates: &[(
            "zerocopy",
            "{ version = \"0.8\", default-features = false, features = [\"derive\"] }",
        )],
    },
    Origin {
        name: "heidenhain-fe",
        language: Language::Rust,
        plugin: "heidenhain-fe",
        profiles: &["heidenhain-fe"],
        sources: include_dir!("$CARGO_MANIFEST_DIR/templates/from/heidenhain-fe"),
        crates: &[],
    },
    Origin {
        name: "pulse-lathe",
        language: Language::Rust,
        plugin: "pulse-lathe",
        profiles: &["pulse-lathe"],
        sources: include_dir!("$CARGO_MANIFEST_DIR/templates/from/pulse-lathe"),
        crates: &[],
    },
    Origin {
        name: "kermit",
        language: Language::Rust,
        plugin: "kermit",
        profiles: &["kermit"],
        sources: include_dir!("$CARGO_MANIFEST_DIR/templates/from/kermit"),
        crates: &[],
    },
    Origin {
        name: "xmodem",
        language: Language::Rust,
        plugin: "xmodem",
        profiles: &["xmodem"],
        sources: include_dir!("$CARGO_MANIFEST_DIR/templates/from/xmodem"),
        crates: &[],
    },
    Origin {
        name: "xon-xoff",
        language: Language::C,
        plugin: "xon-xoff-c",
        profiles: &["xon-xoff"],
        sources: include_dir!("$CARGO_MANIFEST_DIR/templates/from/xon-xoff-c"),
        crates: &[],
    },
];

impl Origin {
    /// The reference plug-in of a profile, and the profile's name.
    pub(super) fn of(
        profile: &str,
        language: Language,
    ) -> Result<(&'static Self, &'static str), Failure> {
        let find = |origin: &'static Origin| {
            let own = origin.profiles.iter().find(|own| **own == profile)?;
            (origin.language == language).then_some((origin, *own))
        };
        ALL.iter().find_map(find).ok_or_else(|| {
            let there = ALL.iter().filter(|origin| origin.language == language);
            let there: Vec<_> = there.flat_map(|origin| origin.profiles).copied().collect();
            Failure::usage(format_args!(
                "there is no reference plug-in for the profile \"{}\" in this language; there are: {}",
                profile.escape_debug(),
                there.join(", ")
            ))
        })
    }

    /// Its source files, with their paths in `src`.
    pub(super) fn sources(&'static self) -> Vec<&'static File<'static>> {
        files_below(&self.sources)
    }

    /// Ledgers and traces of its profiles, with their paths in a corpus.
    pub(super) fn corpus(&self) -> Vec<(String, &'static [u8])> {
        let mut files = Vec::new();
        for profile in self.profiles {
            let ledger = REQUIREMENTS.get_file(format!("{profile}.toml"));
            files.extend(
                ledger.map(|file| (format!("requirements/{profile}.toml"), file.contents())),
            );
            let traces = TRACES.get_dir(profile).into_iter().flat_map(files_below);
            let named = |file: &'static File<'static>| {
                (format!("traces/{}", file.path().display()), file.contents())
            };
            files.extend(traces.map(named));
        }
        files
    }
}

/// All files of a folder and of those in it.
pub(super) fn files_below(folder: &'static Dir<'static>) -> Vec<&'static File<'static>> {
    let mut files: Vec<_> = folder.files().collect();
    files.extend(folder.dirs().flat_map(files_below));
    files
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_origin_has_sources_and_the_corpus_of_its_profiles() {
        for origin in &ALL {
            assert!(!origin.sources().is_empty(), "{}", origin.name);
            let corpus = origin.corpus();
            for profile in origin.profiles {
                let has = |start: &str| corpus.iter().any(|(path, _)| path.starts_with(start));
                assert!(has(&format!("requirements/{profile}.toml")), "{profile}");
                assert!(has(&format!("traces/{profile}/{profile}.")), "{profile}");
            }
        }
    }
}
