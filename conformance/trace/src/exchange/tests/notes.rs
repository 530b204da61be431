//! Nothing is dropped in silence.

use super::*;

const BODY: &str = r#"? 0.000000 send 1 "A"
< 0.000000~0.000010 ~e41
! 0.001000 cts+
! 0.002000 lineerror parity byte=31 span=2
! 0.002500 lineerror overrun byte=31
! 0.003000 break
! 0.004000 down unplugged
! 0.005000 up
> 0.006000 rts-
> 0.007000 break 1000
{ alt p.c
  > 0.008000 41
|
  > 0.008000 42
}
= 0.010000 done 1
= 0.010000 request 1 read
. 1.000000
"#;

fn notes(format: Format) -> Vec<String> {
    let exported = export(&trace(BODY), format, &NoFiles).unwrap();
    exported
        .notes
        .iter()
        .map(|note| format!("{} {} {}", note.what.name(), note.count, note.first))
        .collect()
}

#[test]
fn an_export_tells_what_it_left_out() {
    // The first event stands in line 10.
    let always = [
        "front-matter 1 0",
        "requests 1 10",
        "actions 2 25",
        "quiet 1 27",
        "windows 1 11",
        "alternatives 1 21",
        "links 2 16",
    ];
    let with = |more: &[&'static str]| [&always[..], more].concat();
    assert_eq!(
        notes(Format::Pcapng),
        with(&[
            "unknown-modem-lines 2 12",
            "either-error 1 11",
            "error-place 2 13",
            "break-length 1 19"
        ])
    );
    let text = with(&["modem-lines 2 12", "line-errors 3 11", "breaks 2 15"]);
    assert_eq!(notes(Format::Hexdump), text);
    assert_eq!(notes(Format::Candump), text);
    assert_eq!(
        notes(Format::Saleae),
        with(&["modem-lines 2 12", "line-errors 2 13", "either-error 1 11", "breaks 2 15"])
    );
}

#[test]
fn a_note_is_a_sentence_for_people() {
    let exported = export(&trace(BODY), Format::Candump, &NoFiles).unwrap();
    let texts: Vec<_> = exported.notes.iter().map(ToString::to_string).collect();
    assert_eq!(texts[0], "the front matter stays in the trace");
    assert_eq!(texts[1], "requests of the host (`?`) stay in the trace (at 10)");
    assert_eq!(texts[2], "expected actions (`=`) stay in the trace (2 times, first at 25)");
}

#[test]
fn only_so_many_bytes_are_exported() {
    let at_most = limits::EXPORT_BYTES;
    let export = |body: &str| export(&trace(body), Format::Pcapng, &NoFiles);
    let long = format!("< 0.000000 gen:text(1,{at_most})\n");
    assert!(export(&long).is_ok());
    assert_eq!(export(&(long + "< 0.000000 41\n")), Err(ExportError::TooMuch));
    let error = export(
        "> 0.000000 file:0000000000000000000000000000000000000000000000000000000000000000\n",
    );
    let message = error.unwrap_err().to_string();
    assert!(
        message.starts_with("line 10: file:0000") && message.ends_with("no files are at hand"),
        "{message}"
    );
}
