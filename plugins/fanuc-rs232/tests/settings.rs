//! Settings that cannot work together.

use fanuc_rs232::FanucRs232;
use softplug_plugin::bench::{Bench, BenchError};

/// Why the converter does not open with these settings.
fn refusal(settings: &[(&str, &str)]) -> Option<String> {
    Some(opened(settings).err()?.to_string())
}

fn opened(settings: &[(&str, &str)]) -> Result<Bench<FanucRs232>, BenchError> {
    Bench::<FanucRs232>::new().set_all(settings).try_open()
}

#[test]
fn settings_that_cannot_work_are_refused_in_words() {
    let refused = [
        (vec![("replace", "41")], "replace and eia_codes need pairs"),
        (vec![("eia_codes", "414243")], "replace and eia_codes need pairs"),
        (vec![("mode", "remote-a"), ("code", "eia")], "remote-a needs code iso"),
        (
            vec![("mode", "remote-a"), ("packet_end", "cr"), ("eob", "lfcrcr")],
            "packets end with CR; set eob to lf",
        ),
        (vec![("request_pattern", "O")], "request_pattern needs one *"),
        (vec![("request_pattern", "**")], "request_pattern needs one *"),
    ];
    for (settings, text) in refused {
        let said = refusal(&settings).unwrap_or_else(|| panic!("{settings:?} was taken"));
        assert!(said.contains(text), "{settings:?}: {said}");
    }
    for taken in [
        vec![("replace", "4142")],
        vec![("code", "eia")],
        vec![("mode", "remote-a"), ("packet_end", "cr")],
        vec![("request_pattern", "O*")],
    ] {
        assert_eq!(refusal(&taken), None, "{taken:?}");
    }
}
