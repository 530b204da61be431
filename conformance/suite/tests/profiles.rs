//! Every reference plug-in passes its profiles in every permutation, natively and under both
//! engines, and all three do the same.

use crate::common::{assert_all_pass, cases, module, native, root};
use softplug_conformance::certify::{CertifyOptions, Loaded, certify};
use softplug_conformance::{Corpus, Filter, Judge, Summary, load, run_all};
use softplug_native::NativePlugin;
use softplug_report::{Report, VerdictKind, check};
use std::collections::BTreeSet;
use std::sync::atomic::AtomicBool;

/// A folder of traces, a plug-in that must pass all of them, and how many traces
/// there are at the least.
struct Profile {
    folder: &'static str,
    plugin: &'static str,
    at_least: usize,
}

/// The table of profiles, and one test for each, so that they can be run singly.
macro_rules! profiles {
    ($($test:ident: $folder:literal, $plugin:literal, $at_least:literal;)*) => {
        const PROFILES: &[Profile] = &[
            $(Profile { folder: $folder, plugin: $plugin, at_least: $at_least }),*
        ];

        $(
            #[test]
            fn $test() {
                assert_alike_and_passed(&Profile {
                    folder: $folder,
                    plugin: $plugin,
                    at_least: $at_least,
                });
            }
        )*
    };
}

profiles! {
    xon_xoff: "xon-xoff", "xon-xoff", 28;
    r3964: "r3964", "r3964", 120;
    r3964_without_check: "3964", "r3964", 16;
    r3964_simplified: "r3964-simplified", "r3964-simplified", 26;
    rk512: "rk512", "r3964", 45;
    rk512_simplified: "rk512", "r3964-simplified", 45;
    fanuc_rs232: "fanuc-rs232", "fanuc-rs232", 20;
    heidenhain_fe: "heidenhain-fe", "heidenhain-fe", 60;
    pulse_lathe: "pulse-lathe", "pulse-lathe", 40;
    xmodem: "xmodem", "xmodem", 60;
    kermit: "kermit", "kermit", 60;
}

fn traces() -> std::path::PathBuf {
    root().join("fixtures/traces")
}

fn judged(subject: &dyn Judge, folder: &str) -> Summary {
    let summary = run_all(&[subject], &cases(folder), &Filter::default());
    assert_all_pass(subject, &summary);
    summary
}

fn assert_alike_and_passed(profile: &Profile) {
    let native = judged(&native(profile.plugin), profile.folder);
    let count = cases(profile.folder).len();
    assert!(count >= profile.at_least, "{}: only {count} traces", profile.folder);
    // Scripts are held against native code by a test of their own.
    let traces = Corpus { scripts: Vec::new(), sessions: Vec::new(), ..Corpus::embedded() };
    let report = conformant(profile, &traces);
    assert_eq!(report.digest, native.digest, "native and sandboxed code do different things");
    // The second engine's is the one run more.
    assert_eq!(report.counts.runs as usize, native.total + report.cases.len());
    assert!(report.cases.iter().all(|case| case.fuel > 0));
    assert!(report.fuel.largest_event > 0 && report.fuel.tenths_per_byte > 0);
}

fn conformant(profile: &Profile, corpus: &Corpus) -> Report {
    let options = CertifyOptions::new(profile.folder);
    let module = module(profile.plugin);
    let loaded = Loaded::new(&module).unwrap_or_else(|error| panic!("{error}"));
    let report = certify(&loaded, corpus, &options, &|_| {}, &AtomicBool::new(false))
        .unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(check(&report), Ok(()));
    let failed = report.cases.iter().flat_map(|case| &case.failures);
    let failed: Vec<_> =
        failed.map(|failed| format!("{}: {}", failed.run, failed.message)).collect();
    assert_eq!(report.verdict, VerdictKind::Conformant, "{}", failed.join("\n"));
    assert_eq!(report.counts.unclaimed, 0, "a reference plug-in has every feature");
    report
}

#[test]
fn scripts_are_part_of_a_certification() {
    let scripts = Corpus { cases: Vec::new(), sessions: Vec::new(), ..Corpus::embedded() };
    let all = softplug_conformance::script::all().len();
    assert_eq!(scripts.scripts.len(), all, "a script cites a clause that is in no ledger");
    let abi = NativePlugin::ALL.iter().map(|plugin| ("abi", plugin.name()));
    let own = PROFILES.iter().map(|profile| (profile.folder, profile.plugin));
    for (profile, plugin) in own.chain(abi) {
        if scripts.list().iter().any(|case| case.profile == profile) {
            let report = conformant(&Profile { folder: profile, plugin, at_least: 1 }, &scripts);
            assert!(report.cases.iter().all(|case| case.runs == 2));
        }
    }
}

#[test]
fn every_trace_is_in_canonical_form_and_in_the_folder_of_its_profile() {
    for case in load([traces()]).unwrap_or_else(|error| panic!("{}", error.report())) {
        let text = std::fs::read_to_string(&case.path).expect("it was just read");
        let canonical = case.trace.format();
        assert!(text == canonical, "{} is not: run softplug trace fmt", case.path.display());
        let folder = case.path.parent().and_then(|folder| folder.file_name());
        let profile = case.trace.front.profile.as_str();
        assert_eq!(folder, Some(profile.as_ref()), "{}", case.path.display());
    }
}

#[test]
fn no_folder_and_no_plug_in_is_left_out() {
    let judged: BTreeSet<_> = PROFILES.iter().map(|profile| profile.folder.to_owned()).collect();
    let folders: BTreeSet<_> = std::fs::read_dir(traces())
        .expect("the folder of the traces can be read")
        .map(|entry| entry.expect("its entries can be read").file_name())
        .map(|name| name.into_string().expect("names are UTF-8"))
        .filter(|name| name != "files")
        .collect();
    assert_eq!(judged, folders);
    let claimed: BTreeSet<_> = NativePlugin::ALL
        .iter()
        .flat_map(|plugin| {
            let manifest = native(plugin.name()).manifest().clone();
            manifest.profiles.into_iter().map(|profile| (profile.name, plugin.name()))
        })
        .collect();
    let judged: BTreeSet<_> =
        PROFILES.iter().map(|profile| (profile.folder.to_owned(), profile.plugin)).collect();
    assert_eq!(judged, claimed, "plug-ins are judged by the profiles that they claim");
}
