//! The suite proves that it bites: every mutant of the reference plug-ins is noticed,
//! by the run that the kill matrix names; one that does nothing is not.
//!
//! `cargo xtask mutants` runs this with `SOFTPLUG_MUTANTS`, the folder of the modules;
//! `SOFTPLUG_MATRIX=write`, to write the matrix instead of comparing it; and
//! `SOFTPLUG_MUTANTS_FILTER`, to hunt only mutants whose id contains it.

mod explore;
mod modules;
mod score;
mod sources;

use crate::common::{assert_all_pass, root};
use modules::modules;
use score::scores;
use softplug_conformance::mutants::{
    Catalogue, Hunt, KillRow, Matrix, Mutant, Place, Scores, check_all, hunt, hunt_all, id,
    subject, unproved,
};
use softplug_conformance::{Case, Corpus, Filter, run_all};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{fs, thread};

fn folder() -> PathBuf {
    root().join("fixtures/mutants")
}

fn matrix_file() -> PathBuf {
    folder().join("matrix.toml")
}

fn page_file() -> PathBuf {
    root().join("docs/kill-matrix.md")
}

fn catalogues() -> Vec<Catalogue> {
    Catalogue::read(&folder()).unwrap_or_else(|error| panic!("{error}"))
}

fn corpus() -> Corpus {
    Corpus::read(&root().join("fixtures")).unwrap_or_else(|error| panic!("{error}"))
}

fn cases() -> Vec<Case> {
    corpus().cases
}

fn of_profile<'a>(cases: &'a [Case], profile: &str) -> Vec<&'a Case> {
    cases.iter().filter(|case| case.trace.front.profile == profile).collect()
}

/// Not a mutant: no code asks for it.
fn inert(plugin: &str) -> Mutant {
    Mutant {
        id: "xon-xoff.tx.obey-xoff/nothing-at-all".to_owned(),
        plugin: plugin.to_owned(),
        text: "Nothing is wrong".to_owned(),
        survivor: None,
        place: Place { line: 1, column: 1 },
    }
}

#[test]
fn every_mutant_is_noticed_as_the_matrix_says() {
    let catalogues = catalogues();
    let filter = std::env::var("SOFTPLUG_MUTANTS_FILTER").unwrap_or_default();
    let progress = |mutant: &Mutant, hunt: &Hunt| println!("{}", line(mutant, hunt));
    let threads = thread::available_parallelism().map_or(1, usize::from);
    let wanted = |mutant: &Mutant| mutant.id.contains(&filter);
    let hunts = hunt_all(&catalogues, wanted, &modules(), &cases(), threads, &progress)
        .unwrap_or_else(|error| panic!("{error}"));
    assert!(!hunts.is_empty(), "no mutant's id contains \"{filter}\"");
    let some: Vec<Catalogue> = catalogues
        .into_iter()
        .map(|mut catalogue| {
            catalogue.mutants.retain(wanted);
            catalogue
        })
        .collect();
    let matrix = Matrix::new(&some, |mutant| hunts[&mutant.id].clone()).unwrap_or_else(|errors| {
        let errors: Vec<_> = errors.iter().map(ToString::to_string).collect();
        panic!("{} mutants prove nothing:\n{}", errors.len(), errors.join("\n"))
    });
    if !filter.is_empty() {
        return;
    }
    keep(&matrix_file(), &matrix.to_toml());
    keep(&page_file(), &matrix.to_markdown(&scores()));
}

fn line(mutant: &Mutant, hunt: &Hunt) -> String {
    let Hunt { kill, not_kills, runs } = hunt;
    let mut line = match kill {
        Some(kill) => format!("killed   {} by {} ({})", mutant.id, kill.run, kill.class),
        None => format!("SURVIVED {}", mutant.id),
    };
    let _ = write!(line, ", {runs} runs");
    for not_kill in not_kills.iter().take(3) {
        let _ = write!(line, "\n         not a kill: {} ({})", not_kill.run, not_kill.class);
    }
    line
}

/// Writes a file if that was asked for; else it must hold this text already.
fn keep(path: &Path, text: &str) {
    if std::env::var_os("SOFTPLUG_MATRIX").is_some_and(|what| what == "write") {
        fs::write(path, text).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        return;
    }
    let kept =
        fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let change = kept.lines().zip(text.lines()).find(|(kept, new)| kept != new);
    assert!(
        kept == text,
        "{} would change ({change:?}): run `cargo xtask mutants` and look at the difference",
        path.display()
    );
}

#[test]
fn the_matrix_can_be_read_again_and_counts_what_is_killed() {
    let text = fs::read_to_string(matrix_file()).expect("the matrix is there");
    let matrix = Matrix::parse(&matrix_file(), &text).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(matrix.to_toml(), text);
    let killed: u32 = matrix.killed_by_clause().values().sum();
    assert_eq!(killed as usize, matrix.kills.len());
    let wrong = text.replacen("kill", "kil", 1);
    let error = Matrix::parse(Path::new("m.toml"), &wrong).expect_err("there is no such table");
    assert!(error.to_string().starts_with("m.toml:3:3: unknown field `kil`"), "{error}");
}

#[test]
fn catalogues_are_sound() {
    let corpus = corpus();
    let is_clause = |id: &str| corpus.ledgers.iter().any(|ledger| ledger.clause(id).is_some());
    let wrong = check_all(&catalogues(), is_clause);
    let wrong: Vec<_> = wrong.iter().map(ToString::to_string).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_clause_that_must_be_kept_has_a_mutant_or_a_reason() {
    let (catalogues, corpus) = (catalogues(), corpus());
    let missing = unproved(&catalogues, &corpus.ledgers);
    assert!(
        missing.is_empty(),
        "no mutant breaks {} clauses; write one, or an [[unbreakable]] with its reason:\n{}",
        missing.len(),
        missing.join("\n")
    );
    // A clause whose only mutant is taken away is missed.
    let fewer: Vec<Catalogue> = catalogues
        .into_iter()
        .map(|mut catalogue| {
            catalogue.mutants.retain(|mutant| mutant.clause() != "xon-xoff.tx.obey-xoff");
            catalogue
        })
        .collect();
    assert_eq!(unproved(&fewer, &corpus.ledgers), ["xon-xoff.tx.obey-xoff"]);
}

#[test]
fn a_mutant_that_is_none_survives_all_cases() {
    let cases = cases();
    let mutant = inert("xon-xoff");
    let subject = subject(&modules(), &mutant).unwrap_or_else(|error| panic!("{error}"));
    let of_profile = of_profile(&cases, "xon-xoff");
    let scripts = softplug_conformance::script::all();
    let scripts: Vec<_> = scripts.iter().filter(|script| script.profile == "xon-xoff").collect();
    assert!(!scripts.is_empty());
    let hunt = hunt(&subject, &mutant, &of_profile, &scripts);
    assert_eq!(hunt.kill, None);
    assert_eq!(hunt.not_kills, []);
    assert!(hunt.runs > 10 * of_profile.len(), "only {} runs", hunt.runs);
}

/// With all mutants asleep a module is as good as the real one.
fn assert_sleeping_passes(plugin: &str, profile: &str) {
    let module = fs::read(modules().join(format!("{plugin}.wasm"))).expect("it was built");
    let host = softplug_host::Host::new(softplug_host::HostOptions::default());
    let loaded = host.and_then(|host| host.load_bytes(&module));
    let subject = softplug_conformance::Sandboxed::new(loaded.expect("it is a plug-in"));
    let cases: Vec<Case> = of_profile(&cases(), profile).into_iter().cloned().collect();
    let summary = run_all(&[&subject], &cases, &Filter::default());
    assert_all_pass(&subject, &summary);
    assert!(summary.total > 100);
}

macro_rules! sleeping {
    ($($test:ident: $plugin:literal, $profile:literal;)*) => {
        $(
            #[test]
            fn $test() {
                assert_sleeping_passes($plugin, $profile);
            }
        )*
    };
}

sleeping! {
    asleep_xon_xoff_passes: "xon-xoff", "xon-xoff";
    asleep_r3964_passes: "r3964", "r3964";
    asleep_r3964_without_check_passes: "r3964", "3964";
    asleep_r3964_simplified_passes: "r3964-simplified", "r3964-simplified";
    asleep_rk512_passes: "r3964", "rk512";
    asleep_fanuc_rs232_passes: "fanuc-rs232", "fanuc-rs232";
    asleep_heidenhain_fe_passes: "heidenhain-fe", "heidenhain-fe";
    asleep_pulse_lathe_passes: "pulse-lathe", "pulse-lathe";
    asleep_xmodem_passes: "xmodem", "xmodem";
    asleep_kermit_passes: "kermit", "kermit";
}

#[test]
fn marker_and_number_are_those_that_the_modules_ask() {
    assert_eq!(softplug_conformance::mutants::MARKER, softplug_mutant::MARKER);
    for name in ["", "a.b/c", "xon-xoff.tx.obey-xoff/ignored"] {
        assert_eq!(id(name), softplug_mutant::id(name));
    }
}

#[test]
fn a_page_keeps_its_columns_whatever_stands_in_a_text() {
    let row = KillRow {
        mutant: "a.b/c".to_owned(),
        profile: "a".to_owned(),
        plugin: "a".to_owned(),
        text: "one | two\nthree".to_owned(),
        run: "a.b.d/uncut".to_owned(),
        class: "diverged".to_owned(),
        cites: false,
    };
    let matrix = Matrix { kills: vec![row], ..Matrix::default() };
    let page = matrix.to_markdown(&Scores::default());
    let expected = "| `a.b/c` | one \\| two three | `a.b.d/uncut` † | diverged |\n";
    assert!(page.contains(expected), "{page}");
}
