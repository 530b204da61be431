//! What becomes of characters with the plug-ins of this tree.

use std::convert::Infallible;
use std::io::Cursor;

use softplug_abi::LineParameters;
use softplug_abi::manifest::Manifest;
use softplug_native::NativePlugin;
use softplug_trial::{Budget, CheckResult, Checked, Fate, Setup, Trial};

fn check(plugin: NativePlugin, set: &[(&str, &str)], data_bits: u8, program: &str) -> Checked {
    check_with(plugin, set, &[], data_bits, program)
}

fn check_with(
    plugin: NativePlugin,
    set: &[(&str, &str)],
    fields: &[(&str, &str)],
    data_bits: u8,
    program: &str,
) -> Checked {
    let manifest = Manifest::parse(plugin.manifest().as_bytes()).unwrap();
    let settings = manifest.resolve_settings(set.iter().copied()).unwrap();
    let line = LineParameters { data_bits, ..LineParameters::new(9_600) };
    let job_kind = manifest.job_kind("send").unwrap();
    let records = manifest.jobs[usize::from(job_kind)].records(fields.iter().copied()).unwrap();
    let setup =
        Setup { job_kind, records: &records, fields, ..Setup::new(&manifest, &settings, line) };
    let trial = Trial::new(setup, || Ok::<_, Infallible>(plugin.instantiate()), Budget::endless());
    trial.check(&mut Cursor::new(program), program.len() as u64).unwrap()
}

/// What becomes of a character in a program that has no other odd one.
fn fate_of(plugin: NativePlugin, set: &[(&str, &str)], data_bits: u8, character: char) -> Fate {
    let program = format!("%\nO1\n({character})\nG1 X1\nM30\n%\n");
    let checked = check(plugin, set, data_bits, &program);
    let found =
        checked.altered.iter().find(|one| one.found.written.shown() == character.to_string());
    found.map_or(Fate::Passes, |altered| altered.fate.clone())
}

#[test]
fn plain_text_passes_through_every_plug_in_that_sends_programs() {
    for plugin in [
        NativePlugin::XonXoff,
        NativePlugin::R3964,
        NativePlugin::R3964Simplified,
        NativePlugin::FanucRs232,
        NativePlugin::HeidenhainFe,
        NativePlugin::Kermit,
        NativePlugin::Xmodem,
    ] {
        let checked = check(plugin, &[], 8, "%\nO1 (PART)\nG1 X1.5\nM30\n%\n");
        assert_eq!(checked.result(), CheckResult::Passes, "{}: {checked:?}", plugin.name());
    }
}

#[test]
fn an_umlaut_is_two_bytes_in_whatever_frame_it_is_sent() {
    for plugin in [
        NativePlugin::XonXoff,
        NativePlugin::R3964,
        NativePlugin::R3964Simplified,
        NativePlugin::Kermit,
        NativePlugin::Xmodem,
    ] {
        // Of the second one Kermit sends a byte with a prefix.
        for umlaut in ['ä', 'ß'] {
            let bytes = Fate::Foreign(umlaut.to_string().into_bytes());
            assert_eq!(fate_of(plugin, &[], 8, umlaut), bytes, "{}", plugin.name());
        }
    }
}

#[test]
fn a_line_of_seven_bits_cuts_what_has_eight() {
    assert_eq!(fate_of(NativePlugin::XonXoff, &[], 7, 'ä'), Fate::Cut);
    assert_eq!(fate_of(NativePlugin::XonXoff, &[], 7, 'a'), Fate::Passes);
}

#[test]
fn what_a_plug_in_replaces_or_drops_is_told() {
    let fanuc =
        |set: &[(&str, &str)], character| fate_of(NativePlugin::FanucRs232, set, 7, character);
    assert_eq!(fanuc(&[], 'a'), Fate::Replaced("A".to_owned()));
    assert_eq!(fanuc(&[("unsupported", "drop")], 'ä'), Fate::Dropped);
    assert_eq!(fanuc(&[("unsupported", "space")], '$'), Fate::Replaced(" ".to_owned()));
    assert!(matches!(fanuc(&[], '$'), Fate::Refused(Some(_))));
}

#[test]
fn where_a_program_begins_changes_nothing_of_its_characters() {
    let program = "%\nO1\nN1 X1\nN2 G1\nN3 G2 g\nM30\n%\n";
    let whole = check(NativePlugin::FanucRs232, &[], 7, program);
    assert_eq!(whole.altered.len(), 1);
    for field in [("from_block", "2"), ("from_block", "3"), ("from_sequence", "3")] {
        let part = check_with(NativePlugin::FanucRs232, &[], &[field], 7, program);
        assert_eq!(part.altered, whole.altered, "{field:?}");
    }
}
