//! Programs in each notation: what the machine gets, and where the feed stops.

use softplug_cell::{ChannelId, Notation, Program, Setup, Word};

fn setup() -> Setup {
    Setup::new(&["LATHE-1", "LATHE-2", "LOADER"], &["GANTRY", "C2"], &[]).unwrap()
}

/// Where a feed stops, in which block, and what that says.
type Told = (u64, u32, String);

fn read(program: &str, notation: &str) -> Result<(String, Vec<Told>), String> {
    let (setup, by) = (setup(), ChannelId(0));
    let notation: Notation = notation.parse().expect("a notation");
    let read =
        Program::read(program.as_bytes(), by, &setup, notation).map_err(|e| e.to_string())?;
    let stops = read.stops.iter().map(|stop| (stop.at, stop.block, stop.word.told(by, &setup)));
    Ok((String::from_utf8(read.sent.to_vec()).unwrap(), stops.collect()))
}

#[test]
fn comments_go_to_the_machine_in_every_notation() {
    let program =
        "%\nO1\nG0X0(SOFTPLUG WAIT 10 LATHE-2)\n(softplug get gantry)\nM30 ; SOFTPLUG START 2\n";
    for notation in ["comment", "wai", "siemens", "m100-m199"] {
        let (sent, stops) = read(program, notation).unwrap();
        assert_eq!(sent, program);
        let told: Vec<(u64, u32, &str)> =
            stops.iter().map(|(at, block, told)| (*at, *block, &**told)).collect();
        assert_eq!(
            told,
            [
                (36, 3, "waits at mark 10 for LATHE-2"),
                (58, 4, "wants GANTRY"),
                (81, 5, "starts LATHE-2")
            ]
        );
    }
}

#[test]
fn words_of_other_notations_do_not_go_to_the_machine() {
    let (sent, stops) =
        read("O1\r\nN10 WAI 10 LOADER\r\nG1X1\r\nLAD lathe-2 O77\r\n", "wai").unwrap();
    assert_eq!(sent, "O1\r\nG1X1\r\n");
    let loads = "loads O77 into LATHE-2".to_owned();
    assert_eq!(stops, [(4, 2, "waits at mark 10 for LOADER".to_owned()), (10, 4, loads)]);

    let (sent, stops) = read(
        "N10 WAITM(3,1,2)\nN20 INIT(2,\"_N_A_MPF\",\"S\")\nSTART(2,3)\nGETD(C2, GANTRY)\nG0 X1\n",
        "siemens",
    )
    .unwrap();
    assert_eq!(sent, "G0 X1\n");
    let told: Vec<&str> = stops.iter().map(|(.., told)| &**told).collect();
    let expected = [
        "waits at mark 3 for LATHE-2",
        "loads _N_A_MPF into LATHE-2",
        "starts LATHE-2",
        "starts LOADER",
        "takes C2",
        "takes GANTRY",
    ];
    assert_eq!(told, expected);

    let (sent, stops) = read("N1 M101 P12\nM8\nM102\nG1 X-1.5 M9\n", "M100-M199").unwrap();
    assert_eq!(sent, "M8\nG1 X-1.5 M9\n");
    let told: Vec<&str> = stops.iter().map(|(.., told)| &**told).collect();
    assert_eq!(told, ["waits at mark 101 for LATHE-2", "waits at mark 102 for LATHE-2 and LOADER"]);
}

#[test]
fn what_coordinates_and_cannot_be_understood_is_told_with_its_block() {
    let refused = |program: &str, notation: &str| read(program, notation).unwrap_err();
    assert_eq!(
        refused("O1\n(SOFTPLUG WAIT 10 LATHE-9)\n", "comment"),
        "block 2: \"LATHE-9\" is no channel of the cell, which has LATHE-1, LATHE-2 and LOADER"
    );
    assert_eq!(
        refused("(SOFTPLUG WAIT ten LATHE-2)", "comment"),
        "block 1: \"ten\" is no mark: give a whole number up to 4294967295"
    );
    assert_eq!(
        refused("(SOFTPLUG WAIT 1 LATHE-1)", "comment"),
        "block 1: a channel cannot meet itself: name another one"
    );
    for (program, notation) in
        [("(SOFTPLUG START 1)", "comment"), ("EXE lathe-1", "wai"), ("START(2,1)", "siemens")]
    {
        let text = "block 1: a channel cannot start itself: its program would wait for its own end";
        assert_eq!(refused(program, notation), text);
    }
    assert!(
        refused("(SOFTPLUG)", "comment").contains("cannot be understood: write (SOFTPLUG WAIT")
    );
    assert!(refused("WAI", "wai").contains("write WAI mark channels"));
    assert!(refused("WAITM(1)", "siemens").contains("cannot be understood"));
    assert!(refused("G0 X0 WAITM(1,1,2)", "siemens").contains("stand alone"));
    assert!(refused("WAITE(2)", "siemens").contains("WAITE is not understood"));
    assert!(refused("GET(X1)", "siemens").contains("\"X1\" is no axis of the cell"));
    assert!(refused("G1 X1 M101", "M100-M199").contains("alone in its block"));
    for (program, notation) in [
        ("N10 G1 X1 WAI 1 LOADER", "wai"),
        ("WAI1 LOADER", "wai"),
        ("/WAI 1 LOADER", "wai"),
        ("WAI 1 LOADER (SOFTPLUG GET C2)", "wai"),
        ("(SOFTPLUG GET C2) M101 P2", "M100-M199"),
        ("WAITM (1,1,2)", "siemens"),
        ("/WAITM(1,1,2)", "siemens"),
        ("/M101", "M100-M199"),
        ("M101.5", "M100-M199"),
        ("M101 P", "M100-M199"),
        ("(SOFTPLUGWAIT 1 LOADER)", "comment"),
        ("(SOFTPLUG: WAIT 1 LOADER)", "comment"),
    ] {
        assert!(!refused(program, notation).is_empty(), "{program}");
    }
    assert_eq!(read("(MSG (SOFTPLUG WAIT 1 LOADER))", "comment").unwrap().1.len(), 1);
    assert_eq!(read("\u{feff}WAI 1 LOADER", "wai").unwrap().1.len(), 1);
}

#[test]
fn what_does_not_coordinate_goes_as_it_is() {
    let program = "%\n:77 (WAITING FOR SOFTPLUG)\n; WAIT\nN5 G3 X1 I(2+3)\nWAIT\nTARGET(1)\nM99\n\r\r\nM1x\n\u{fc}";
    for notation in ["comment", "siemens", "M100-M199", "wai"] {
        let read = read(program, notation).unwrap();
        assert_eq!(read, (program.to_owned(), Vec::new()), "{notation}");
    }
    let bytes = [0xff, 0xfe, b'\n', 0x80];
    let read = Program::read(&bytes, ChannelId(0), &setup(), Notation::Wai).unwrap();
    assert_eq!((&*read.sent, read.stops.len()), (&bytes[..], 0));
    assert!(matches!(read.sent, std::borrow::Cow::Borrowed(_)));
}

#[test]
fn a_word_means_what_it_says() {
    let (setup, by) = (setup(), ChannelId(1));
    let program = b"(SOFTPLUG TAKE C2)(SOFTPLUG RELEASE GANTRY)\n";
    let read = Program::read(program, by, &setup, Notation::Comment).unwrap();
    let words: Vec<&Word> = read.stops.iter().map(|stop| &stop.word).collect();
    let (c2, gantry) = (setup.axis("C2").unwrap(), setup.axis("GANTRY").unwrap());
    assert_eq!(words, [&Word::Get { axis: c2, forced: true }, &Word::Release { axis: gantry }]);
    assert_eq!([read.stops[0].at, read.stops[1].at], [44, 44]);
}

#[test]
fn a_line_end_of_lf_cr_is_one() {
    for end in ["\n\r", "\n\r\r"] {
        let program = format!("O1{end}WAI 1 LOADER{end}{end}G1{end}");
        let (sent, stops) = read(&program, "wai").unwrap();
        assert_eq!(sent, format!("O1{end}{end}G1{end}"));
        assert_eq!(
            stops.iter().map(|(at, block, _)| (*at as usize, *block)).collect::<Vec<_>>(),
            [(2 + end.len(), 2)]
        );
    }
}
