//! The modules of the reference plug-ins, changed one instruction at a time: a sample.

use crate::common::{module, root};
use softplug_conformance::Corpus;
use softplug_conformance::mutants::Scores;
use softplug_conformance::score::{ScoreOptions, score};
use softplug_native::NativePlugin;
use std::fs;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

fn file() -> PathBuf {
    root().join("fixtures/scores.toml")
}

/// What the last long hunt wrote, if there was one.
pub(crate) fn scores() -> Scores {
    let Ok(text) = fs::read_to_string(file()) else { return Scores::default() };
    Scores::parse(&file(), &text).unwrap_or_else(|error| panic!("{error}"))
}

macro_rules! samples {
    ($($test:ident: $plugin:literal;)*) => {
        $(
            #[test]
            fn $test() {
                assert_most_are_noticed($plugin);
            }
        )*

        #[test]
        fn every_plug_in_has_a_sample() {
            let all: Vec<&str> = NativePlugin::ALL.iter().map(|plugin| plugin.name()).collect();
            let mut sampled = vec![$($plugin),*];
            sampled.sort_unstable_by_key(|name| all.iter().position(|other| other == name));
            assert_eq!(sampled, all);
        }
    };
}

samples! {
    changes_of_xon_xoff_are_noticed: "xon-xoff";
    changes_of_r3964_are_noticed: "r3964";
    changes_of_r3964_simplified_are_noticed: "r3964-simplified";
    changes_of_fanuc_rs232_are_noticed: "fanuc-rs232";
    changes_of_heidenhain_fe_are_noticed: "heidenhain-fe";
    changes_of_pulse_lathe_are_noticed: "pulse-lathe";
    changes_of_xmodem_are_noticed: "xmodem";
    changes_of_kermit_are_noticed: "kermit";
}

/// 60 changes, and few of the sessions of a verdict.
fn assert_most_are_noticed(plugin: &str) {
    let options = ScoreOptions {
        sample: Some(60),
        seed: 1,
        sessions: 200,
        permutations: 0,
        crossed: 0,
        threads: 1,
    };
    let stop = AtomicBool::new(false);
    let score = score(&module(plugin), &Corpus::embedded(), &options, &|_, _| {}, &stop)
        .unwrap_or_else(|error| panic!("{plugin}: {error}"));
    assert!(score.adds_up() && score.noticed.all() > 15, "{score:?}");
    assert!(score.share() >= 950, "{} of {}: {score:?}", score.noticed.all(), score.told());
}
