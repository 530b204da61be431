//! Files that are damaged, or were made to do harm.

use proptest::prelude::*;
use proptest::sample::{Index, select};

use super::files::Capture;
use super::*;

#[test]
fn faults_in_texts_have_a_line_and_a_column() {
    let cases = [
        (
            Format::Hexdump,
            "0000 41",
            "file:1:1: expected the direction and the time of a packet, like `I 1.500000`",
        ),
        (Format::Hexdump, "I x\n", "file:1:3: expected a time in seconds like 1.500000"),
        (
            Format::Hexdump,
            "I 1\n0001 41",
            "file:2:1: expected the offset of the next byte in at least three hex digits, or the direction and the time of a packet",
        ),
        (
            Format::Hexdump,
            "I 1\n0000 41 4",
            "file:2:9: expected pairs of hex digits with spaces between them",
        ),
        (Format::Hexdump, "I 1\n0000 4142", "file:2:8: expected a space behind two hex digits"),
        (
            Format::Candump,
            "1.0 can0#41 R",
            "file:1:1: expected a time in parentheses, like (1.500000)",
        ),
        (
            Format::Candump,
            "(1.0] can0#41 R",
            "file:1:5: expected a closing parenthesis behind the time",
        ),
        (
            Format::Candump,
            "(1.0) #41 R",
            "file:1:7: expected the port, `#` and hex pairs, like ttyUSB0#4142",
        ),
        (
            Format::Candump,
            "(1.0) a#414 R",
            "file:1:11: expected hex pairs without spaces, then the direction",
        ),
        (
            Format::Candump,
            "\n(1.0) a#41 X",
            "file:2:12: expected the direction, R for received or T for transmitted",
        ),
        (Format::Candump, "(1.0) a#41 R R", "file:1:14: expected the end of the line"),
        (
            Format::Candump,
            "(99999999999999999999) a#41 R",
            "file:1:2: this time cannot be counted in µs",
        ),
        (
            Format::Candump,
            "(1.0) can0 12G#41 R",
            "file:1:12: expected `#` and hex pairs, or a CAN identifier before them, like 123#4142",
        ),
        (
            Format::Candump,
            "(1.0)  can0  123   [2]  41 42",
            "file:1:17: expected the port, `#` and hex pairs, like ttyUSB0#4142",
        ),
        (
            Format::Candump,
            "(1.0) can0 123##",
            "file:1:17: expected the flags of a CAN FD frame and hex pairs, like 123##04142",
        ),
        (
            Format::Candump,
            "(1.0) can0 123#414 R",
            "file:1:18: expected hex pairs without spaces, then the direction",
        ),
        (Format::Saleae, "a,b\n1,2\n", "file:1:1: the table has no column \"start_time\""),
        (
            Format::Saleae,
            "Time [s],Parity Error\n1,2\n",
            "file:1:1: the table has no column \"Value\"",
        ),
        (
            Format::Saleae,
            "Time [s],Value\n1,0x41\n2,65\n",
            "file:3:1: expected a byte like 0x41; export the table with hexadecimal values",
        ),
        (
            Format::Saleae,
            "name,start_time,data,error\nrx,1,0x41,odd\n",
            "file:2:1: expected \"parity\", \"framing\" or nothing in the column \"error\"",
        ),
    ];
    for (format, text, message) in cases {
        assert_eq!(refused(text, format), message, "{text}");
    }
    for format in [Format::Hexdump, Format::Candump, Format::Saleae] {
        assert_eq!(refused(b"I \xFF", format), "file: byte 2: this is not text in UTF-8");
    }
    for format in [Format::Hexdump, Format::Candump] {
        assert_eq!(refused("", format), "file: nothing in it happens on a serial line");
    }
    let apart = "(0.0) a#41 R\n(1000000000.0) a#41 R\n";
    assert_eq!(
        refused(apart, Format::Candump),
        "file: the recording takes more than 999999999 seconds; cut it"
    );
}

/// A capture of a serial line, with blocks made by `more`.
fn capture(more: impl Fn(&mut Capture)) -> Vec<u8> {
    let mut capture = Capture::new(false);
    capture.interface(250, &[]);
    more(&mut capture);
    capture.bytes
}

#[test]
fn faults_in_captures_have_their_byte() {
    let good = capture(|capture| capture.packet(0, 0, &[0; 13], &[]));
    let changed = |at: usize, value: u8| {
        let mut bytes = good.clone();
        bytes[at] = value;
        bytes
    };
    let cases = [
        (
            b"G1X1".to_vec(),
            "file: byte 0: this is no capture; expected a file that begins like pcapng or pcap",
        ),
        (good[..10].to_vec(), "file: byte 8: the file ends inside a block; it was cut short"),
        (good[..60].to_vec(), "file: byte 56: the file ends inside a block; it was cut short"),
        (
            changed(8, 0),
            "file: byte 0: this is no capture; expected a file that begins like pcapng or pcap",
        ),
        (changed(32, 13), "file: byte 28: a block has an impossible length, 13"),
        (changed(32, 8), "file: byte 28: a block has an impossible length, 8"),
        (changed(44, 24), "file: byte 28: a block has an impossible length, 20"),
        (
            changed(56, 1),
            "file: byte 56: the packet belongs to interface 1, which nothing describes",
        ),
        (changed(68, 200), "file: byte 76: the file ends inside a packet; it was cut short"),
        (
            changed(68, 5),
            "file: byte 76: the file ends inside the header of an event, which has twelve bytes; it was cut short",
        ),
        (
            capture(|capture| capture.interface(250, &capture.option(9, &[40]))),
            "file: byte 68: the capture's resolution of time, if_tsresol 40, is beyond what can be counted with",
        ),
        (
            capture(|capture| (0..limits::INTERFACES).for_each(|_| capture.interface(1, &[]))),
            "file: byte 20508: the capture describes more than 1024 interfaces",
        ),
        (
            capture(|capture| {
                capture.interface(250, &[]);
                capture.packet(0, 0, &[0; 12], &[]);
                capture.packet(1, 0, &[0; 12], &[]);
            }),
            "file: byte 140: packets of a second serial line begin here; keep one of them (Wireshark: frame.interface_id)",
        ),
        (capture(|_| {}), "file: nothing in it happens on a serial line"),
    ];
    for (bytes, message) in cases {
        assert_eq!(refused(&bytes, Format::Pcapng), message);
    }
    let slow = capture(|capture| {
        capture.interface(250, &capture.option(9, &[0]));
        capture.packet(1, u64::MAX, &[0; 12], &[]);
    });
    assert!(refused(slow, Format::Pcapng).ends_with("this time cannot be counted in µs"));
}

#[test]
fn what_is_too_long_is_refused() {
    let long = vec![b' '; limits::IMPORT_BYTES + 1];
    for format in Format::ALL {
        let error = refused(&long, *format);
        assert_eq!(error, "file: the file has more than 67108864 bytes; cut the recording");
    }
    let lines: Vec<_> = (0..=limits::LINES).map(|time| format!("({time}.0) a#41 R\n")).collect();
    let many = lines.concat();
    assert!(refused(many, Format::Candump).contains("the trace would have more than 500000 lines"));
}

const SAMPLE: &str = "<< 0.010000 41 42\n! 0.020000 cts+\n> 0.030000 \"CD\"\n< 0.040000 ~p41\n";

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn garbage_is_refused_or_read_and_never_panics(
        format in select(Format::ALL),
        bytes in prop_oneof![
            proptest::collection::vec(any::<u8>(), 0..300),
            "[IO0-9a-f #.()RT\n,x\"-]{0,200}".prop_map(String::into_bytes),
        ],
    ) {
        let _ = import_text(bytes, format);
    }

    #[test]
    fn damaged_files_are_refused_or_give_a_trace(
        format in select(Format::ALL),
        changes in proptest::collection::vec((any::<Index>(), any::<u8>()), 1..6),
        cut in any::<Index>(),
        cuts in any::<bool>(),
    ) {
        let mut bytes = export(&trace(SAMPLE), format, &NoFiles).unwrap().bytes;
        for (place, value) in changes {
            let place = place.index(bytes.len());
            bytes[place] = value;
        }
        if cuts {
            bytes.truncate(cut.index(bytes.len()));
        }
        if let Ok(import) = import_text(bytes, format) {
            let text = import.trace.format();
            prop_assert_eq!(Trace::parse(&text).map(|trace| trace.format()), Ok(text));
        }
    }
}
