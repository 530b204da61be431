//! Files as other tools write them.

use super::*;

/// A capture made by hand, in either byte order.
pub(super) struct Capture {
    pub(super) bytes: Vec<u8>,
    big: bool,
}

impl Capture {
    /// With a section and nothing in it.
    pub(super) fn new(big: bool) -> Self {
        let mut capture = Self { bytes: Vec::new(), big };
        let mut body = capture.u32(0x1A2B_3C4D).to_vec();
        body.extend(if big { [0, 1, 0, 0] } else { [1, 0, 0, 0] });
        body.extend([0xFF; 8]);
        capture.block(0x0A0D_0D0A, &body);
        capture
    }

    pub(super) fn u32(&self, number: u32) -> [u8; 4] {
        if self.big { number.to_be_bytes() } else { number.to_le_bytes() }
    }

    pub(super) fn block(&mut self, kind: u32, body: &[u8]) {
        let length = self.u32(12 + body.len() as u32);
        self.bytes.extend(self.u32(kind));
        self.bytes.extend(length);
        self.bytes.extend(body);
        self.bytes.extend(length);
    }

    pub(super) fn option(&self, code: u16, value: &[u8]) -> Vec<u8> {
        let number =
            |number: u16| if self.big { number.to_be_bytes() } else { number.to_le_bytes() };
        let mut option = [number(code), number(value.len() as u16)].concat();
        option.extend(value);
        option.resize(option.len().next_multiple_of(4), 0);
        option
    }

    pub(super) fn interface(&mut self, link: u32, options: &[u8]) {
        let link = self.u32(link);
        let mut body = if self.big { link[2..].to_vec() } else { link[..2].to_vec() };
        body.extend([0; 6]);
        body.extend(options);
        self.block(1, &body);
    }

    pub(super) fn packet(&mut self, interface: u32, time: u64, bytes: &[u8], options: &[u8]) {
        let length = bytes.len() as u32;
        let numbers = [interface, (time >> 32) as u32, time as u32, length, length];
        let mut body: Vec<u8> = numbers.iter().flat_map(|number| self.u32(*number)).collect();
        body.extend(bytes);
        body.resize(body.len().next_multiple_of(4), 0);
        body.extend(options);
        self.block(6, &body);
    }

    /// An event of a serial line.
    fn event(&mut self, time: u64, event: u8, levels: u8, bytes: &[u8]) {
        let header = [0, 0, 0, 0, 0, 0, 0, 0, event, levels, 0, 0];
        self.packet(0, time, &[&header[..], bytes].concat(), &[]);
    }
}

const LINES_UP: u8 = 0x01 | 0x04;

/// What a device of another maker may write: calendar times in ns, starts and ends,
/// names and statistics, an Ethernet beside it.
fn foreign(big: bool) -> Vec<u8> {
    const START: u64 = 1_700_000_000_000_000_000;
    let mut capture = Capture::new(big);
    capture.block(0x0000_0BAD, &[1, 2, 3, 4]);
    let resolution = capture.option(9, &[9]);
    capture.interface(250, &resolution);
    capture.interface(1, &[]);
    capture.event(START, 0x00, LINES_UP, &[]);
    capture.event(START + 1_000_000, 0x02, LINES_UP, b"AB");
    capture.packet(1, 5, &[0; 60], &[]);
    capture.event(START + 5_000_000, 0x04, LINES_UP, b"\x11");
    capture.event(START + 10_000_400, 0x01, LINES_UP | 0x08, b"CD");
    capture.event(START + 20_000_600, 0x03, 0x04 | 0x08, b"EF");
    capture.event(START + 30_000_000, 0x07, 0x04 | 0x08, b"\x31");
    capture.event(START + 31_000_000, 0x08, 0x04 | 0x08, b"123");
    capture.event(START + 32_000_000, 0x09, 0x04 | 0x08, &[]);
    capture.event(START + 33_000_000, 0x0A, 0x04 | 0x08, &[]);
    capture.event(START + 34_000_000, 0x05, 0x04 | 0x08, &[]);
    capture.event(START + 35_000_000, 0x77, 0x04 | 0x08, &[]);
    capture.event(START + 36_000_000, 0x06, 0x04 | 0x08, b"?");
    capture.block(3, &[4, 0, 0, 0, 1, 2, 3, 4]);
    capture.bytes
}

const FOREIGN: &str = r#"<< 0.000000 "AB"
< 0.002958 11             ; DC1=XON
> 0.007958 rts+
> 0.007958 "CD"
> 0.015875 "EF"
! 0.017959 cts-
< 0.027958 ~f31           ; ~'1'
< 0.028958 "123"
! 0.028958 lineerror parity span=3
! 0.029958 break
! 0.030958 overrun
"#;

#[test]
fn captures_of_others_are_read_in_both_byte_orders() {
    for big in [false, true] {
        let import = import_text(foreign(big), Format::Pcapng).unwrap();
        assert_eq!(body(&import.trace), FOREIGN);
        // The first character has arrived 1,042 µs after its start bit.
        assert_eq!(import.zero, 1_700_000_000_002_042);
        let front = import.trace.format();
        assert!(front.contains("\nmodem: cts+ dsr+\n"), "{front}");
        let notes: Vec<_> = import
            .notes
            .iter()
            .map(|note| format!("{} {} {}", note.what.name(), note.count, note.first))
            .collect();
        let expected = [
            "other-packets 1 3",
            "timeless-packets 1 14",
            "unknown-events 1 12",
            "stray-bytes 1 13",
            "lost-by-capture 1 11",
        ];
        assert_eq!(notes, expected);
    }
}

#[test]
fn every_resolution_of_time_is_counted_in() {
    let at = |options: &[Vec<u8>], time: u64| {
        let mut capture = Capture::new(false);
        capture.interface(250, &options.concat());
        let header = [0, 0, 0, 0, 0, 0, 0, 0, 4, 0, 0, 0, 0x41];
        capture.packet(0, time, &header, &[]);
        imported(capture.bytes, Format::Pcapng)
    };
    let capture = Capture::new(false);
    let line = |time: &str| format!("< {time} \"A\"\n");
    assert_eq!(at(&[], 1_500_000), line("1.500000"));
    assert_eq!(at(&[capture.option(9, &[3])], 1_500), line("1.500000"));
    assert_eq!(at(&[capture.option(9, &[9])], 1_500_000_500), line("1.500001"));
    assert_eq!(at(&[capture.option(9, &[0x8A])], 1_536), line("1.500000"));
    let offset = capture.option(14, &(-10_i64).to_le_bytes());
    assert_eq!(at(&[capture.option(9, &[0]), offset], 12), line("2.000000"));
}

#[test]
fn classic_captures_are_read() {
    let packet = |bytes: &[u8]| {
        let mut file = Vec::new();
        for number in [0x00A1_B2C3_u32, 1, 500_000, 13, 15] {
            file.extend(number.to_be_bytes());
        }
        file.drain(..4);
        file.extend([0, 0, 0, 0, 0, 0, 0, 0, 4, 0, 0, 0]);
        file.extend(bytes);
        file
    };
    let head = |magic: [u8; 4]| {
        let mut file = magic.to_vec();
        file.extend([0, 2, 0, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 4, 0, 0, 0, 0, 0, 250]);
        file
    };
    let file = [head([0xA1, 0xB2, 0xC3, 0xD4]), packet(b"A")].concat();
    let import = import_text(file, Format::Pcapng).unwrap();
    assert_eq!(body(&import.trace), "< 1.500000 \"A\"\n");
    assert_eq!(import.notes[0].what, Left::CutPackets);
    // The same number of ns is nearly nothing.
    let file = [head([0xA1, 0xB2, 0x3C, 0x4D]), packet(b"A")].concat();
    assert_eq!(imported(file, Format::Pcapng), "< 1.000500 \"A\"\n");
}

#[test]
fn plain_bytes_with_a_direction_are_read() {
    let mut capture = Capture::new(false);
    capture.interface(147, &[]);
    let direction = |number: u32| capture.option(2, &number.to_le_bytes());
    let (inbound, outbound) = (direction(1), direction(2));
    capture.packet(0, 1_000_000, b"\x11", &inbound);
    capture.packet(0, 2_000_000, b"AB", &outbound);
    let body = "< 1.000000 11             ; DC1=XON\n> 2.000000 \"AB\"\n";
    assert_eq!(imported(&capture.bytes, Format::Pcapng), body);
    capture.packet(0, 3_000_000, b"?", &[]);
    let error = refused(&capture.bytes, Format::Pcapng);
    assert!(error.starts_with("file: byte 164: the packet does not say its direction"), "{error}");
}

#[test]
fn hex_dumps_may_have_comments_and_text() {
    let text = "\
# A dump.
I 1.5
0000  41 42 43 44 45 46 47 48  49 4a 4b 4c 4d 4e 4f 50  |ABCDEFGHIJKLMNOP|
0010  51\r
O 2.25 000000 11

O 3
I 4.0000004
000 0a
";
    let body = "\
< 1.500000 \"ABCDEFGHIJKLMNOPQ\"
> 2.250000 11             ; DC1=XON
< 4.000000 0A             ; LF
";
    assert_eq!(imported(text, Format::Hexdump), body);
}

#[test]
fn logs_of_can_tools_are_read() {
    let text =
        "\u{FEFF}(1700000000.250000) ttyS0#0a R\r\n\n  (1700000001.250000)  ttyS0#4142  T \n";
    let body = "< 0.000000 0A             ; LF\n> 1.000000 \"AB\"\n";
    assert_eq!(imported(text, Format::Candump), body);
}

/// Imports a log of CAN frames; `received` and `sent` name the identifiers.
fn frames(text: &str, received: Option<&str>, sent: Option<&str>) -> Result<Imported, ImportError> {
    let mut import_as = Import::new(front("9600 8N1"));
    import_as.received = received.map(str::to_owned);
    import_as.sent = sent.map(str::to_owned);
    import(&[Source { name: "can.log", bytes: text.as_bytes() }], Format::Candump, &import_as)
}

#[test]
fn frames_as_candump_logs_them_are_read() {
    // As `candump -L -x` writes them: data, none, CAN FD, a request for data.
    let marked = "\
(0.500000) can0 123#11 R
(1.000000) can0 1ABCDEF0#4142 T
(1.100000) can0 123# R
(1.200000) can0 123#R R
(1.500000) can0 123##14344 R
";
    let import = frames(marked, None, None).unwrap();
    let expected = "\
< 0.500000 11             ; DC1=XON
> 1.000000 \"AB\"
< 1.500000 \"CD\"
";
    assert_eq!(body(&import.trace), expected);
    let notes: Vec<_> = import.notes.iter().map(ToString::to_string).collect();
    assert_eq!(notes, ["packets that are not of a serial line were left out (at 4)"]);
}

#[test]
fn frames_without_a_direction_are_told_apart_by_their_identifiers() {
    let log = "(0.5) can0 07a#11\n(1.0) can0 07B#4142\n(1.5) can0 7FF#00\n";
    let import = frames(log, Some("07A"), Some("07b")).unwrap();
    let expected = "< 0.500000 11             ; DC1=XON\n> 1.000000 \"AB\"\n";
    assert_eq!(body(&import.trace), expected);
    assert_eq!(import.notes.len(), 1);
    let only_one = frames(log, None, Some("07B")).unwrap();
    assert_eq!(body(&only_one.trace), "> 1.000000 \"AB\"\n");
    let which = "can.log: which frames are those of the line? \
                 Say --received ID and --sent ID; the file has ";
    let unclear = |log: &str| frames(log, None, None).unwrap_err().to_string();
    assert_eq!(unclear(log), format!("{which}07A, 07B, 7FF"));
    // Two machines on one bus are not one line.
    let two = "(0.5) can0 07A#11 R\n(0.6) can0 07C#12 R\n";
    assert_eq!(unclear(two), format!("{which}07A, 07C"));
    assert!(frames(two, Some("07C"), None).is_ok());
}

const LOGIC_2: &str = "\
name,type,start_time,duration,\"data\",\"error\"
\"CNC\",\"data\",-0.0005,0.000989,0x11,
\"SPI\",\"result\",0.1,0.000001,,
\"PC\",\"data\",0.5,0.000989,0x41,
\"PC\",\"data\",0.5010419,0.000989,0x42,\"framing\"
\"CNC\",\"data\",1e0,0.000989,0x31,\"parity\"
\"CNC\",\"data\",2,0.000989,0b01000001,\"framing\"
";

#[test]
fn tables_of_the_second_logic_are_read() {
    let source = Source { name: "table.csv", bytes: LOGIC_2.as_bytes() };
    let mut import_as = Import::new(front("9600 8N1"));
    import_as.received = Some("CNC".to_owned());
    import_as.sent = Some("PC".to_owned());
    let import = import(&[source], Format::Saleae, &import_as).unwrap();
    // The first has arrived at 542 µs: nothing is before zero.
    let expected = "\
< 0.000542 11             ; DC1=XON
> 0.500000 \"AB\"
< 1.001042 ~p31           ; ~'1'
< 2.001042 ~f41           ; ~'A'
";
    assert_eq!(body(&import.trace), expected);
    let notes: Vec<_> = import.notes.iter().map(ToString::to_string).collect();
    assert_eq!(
        notes,
        [
            "line errors were left out; of damaged characters only the byte was written (at 5)",
            "rows of other analysers, or without data, were left out (at 3)"
        ]
    );
    let error = refused(LOGIC_2, Format::Saleae);
    assert!(
        error.contains("--received NAME") && error.contains("\"CNC\", \"PC\", \"SPI\""),
        "{error}"
    );
}

#[test]
fn tables_of_the_first_logic_are_read_two_at_a_time() {
    let received =
        "Time [s],Value,Parity Error,Framing Error\n0.5,0x11,,\n0.6,0x12,Error,\n0.7,0x13,,Error\n";
    let sent = "Time [s],Value,Parity Error,Framing Error\r\n0.55,0x41,,\r\n";
    let sources = [received, sent].map(|text| Source { name: "table.csv", bytes: text.as_bytes() });
    let mut import_as = Import::new(front("9600 8N1"));
    import_as.from_first = true;
    let both = import(&sources, Format::Saleae, &import_as).unwrap();
    let expected = "\
< 0.000000 11             ; DC1=XON
> 0.048958 \"A\"
< 0.100000 ~p12           ; ~DC2
< 0.200000 ~f13           ; ~DC3=XOFF
";
    assert_eq!(body(&both.trace), expected);
    let error = import(&sources, Format::Candump, &import_as).unwrap_err().to_string();
    assert_eq!(error, "table.csv: one file is needed, and no more than 1 of this format");
}

#[test]
fn where_the_rate_is_unknown_the_table_tells_how_long_a_character_is() {
    let text = "name,type,start_time,duration,data\nrx,data,1,0.25,0x41\ntx,data,2,0.25,0x42\n";
    let source = Source { name: "table.csv", bytes: text.as_bytes() };
    let import = import(&[source], Format::Saleae, &Import::new(front("0 8N1"))).unwrap();
    assert_eq!(body(&import.trace), "< 1.250000 \"A\"\n> 2.000000 \"B\"\n");
}
