use super::*;
use crate::code::tests::bytes;
use crate::code::{Code, encode};
use crate::{AfterEnd, BlockNumbers, Eob, SendCode, Settings, Unsupported};
use softplug_plugin::{SettingSet, Values};

/// The settings as a host gives them, all at their defaults.
fn defaults() -> Settings {
    Settings { upper: true, percent: true, tv_cr: true, tv_comments: true, ..Settings::UNSET }
}

fn padded(eob: Eob) -> Settings {
    Settings { tv_pad: true, eob, ..defaults() }
}

/// A field of a job.
fn field(index: u8, kind: u8, payload: &[u8]) -> Vec<u8> {
    let length = (payload.len() as u16).to_le_bytes();
    [&[index, 0, kind, 0], &length[..], payload].concat()
}

fn from_block(block: i64) -> Vec<u8> {
    field(0, 2, &block.to_le_bytes())
}

fn from_sequence(sequence: i64) -> Vec<u8> {
    field(1, 2, &sequence.to_le_bytes())
}

fn preamble(text: &str) -> Vec<u8> {
    field(2, 3, text.as_bytes())
}

/// What was sent, or why and where not. Never more comes out than is promised.
fn encoded_from(
    settings: &Settings,
    fields: &[u8],
    program: &[u8],
) -> Result<Vec<u8>, (Failure, u32, u32)> {
    let settings = &Setup::new(settings);
    let mut encoder = Encoder::new_zeroed();
    encoder.begin(&Values::new(fields)).map_err(|failure| (failure, 0, 0))?;
    let mut sent = Vec::new();
    let mut growth = 0;
    let mut step = |encoder: &mut Encoder, byte: Option<u8>| {
        let before = sent.len();
        let done = match byte {
            Some(byte) => encoder.push(settings, byte),
            None if encoder.is_waiting() => encoder.next(settings),
            None => encoder.finish(settings),
        };
        sent.extend_from_slice(encoder.output.first(encoder.output.len()));
        encoder.output.clear();
        assert!(sent.len() - before <= MOST_PER_BYTE);
        growth += settings.growth() as usize;
        assert!(fields.len() > 100 || sent.len() <= growth + MOST_PER_BYTE);
        let (line, column) = encoder.position();
        done.map_err(|failure| (failure, line, column))
    };
    for byte in program {
        step(&mut encoder, Some(*byte))?;
        while encoder.is_waiting() {
            step(&mut encoder, None)?;
        }
    }
    step(&mut encoder, None)?;
    while encoder.is_waiting() {
        step(&mut encoder, None)?;
    }
    step(&mut encoder, None)?;
    Ok(sent)
}

fn encoded(settings: &Settings, program: &str) -> Result<String, (Failure, u32, u32)> {
    let sent = encoded_from(settings, &[], program.as_bytes())?;
    Ok(String::from_utf8(sent).expect("parity is not made here"))
}

#[track_caller]
fn assert_sent(settings: &Settings, program: &str, expected: &str) {
    assert_eq!(encoded(settings, program).as_deref(), Ok(expected), "{program:?}");
}

const UNSUPPORTED: Failure = Failure::UnsupportedCharacter;

#[test]
fn the_tape_begins_at_its_first_percent_and_ends_at_the_next() {
    let settings = defaults();
    assert_sent(&settings, "%\nO1\nM30\n%\n", "%\nO1\nM30\n%");
    assert_sent(&settings, "\0\0 \r\n\n%PART 7\nM30\n%\r\n\0 \t\x7F\x1A", "%PART 7\nM30\n%");
    assert_sent(&settings, "%\nM30%", "%\nM30%");
    assert_sent(&settings, "%%", "%%");
    for program in ["O1\nM30", "O1\nM30\n", "%\nO1\nM30", "%\nO1\nM30\n", "O1\nM30\n%"] {
        assert_sent(&settings, program, "%\nO1\nM30\n%");
    }
    assert_sent(&settings, "", "%\n%");
    let refused = encoded(&settings, "PART 7\n%\n\nO1\n%\n");
    assert_eq!(refused, Err((Failure::BadJob, 4, 1)));
    // Text behind the closing % would not arrive.
    let more = "%\nM30\n%\n\nG0\n%\nü";
    assert_eq!(encoded(&settings, more), Err((Failure::BadJob, 5, 1)));
    assert_eq!(encoded(&settings, "%\nO1\nM30\n%\n%\nO2\n%"), Err((Failure::BadJob, 5, 1)));
    assert_eq!(encoded(&settings, "%\nO1\nM30%O2"), Err((Failure::BadJob, 3, 5)));
    let ascii = Settings { ascii: true, ..settings };
    assert_eq!(encoded(&ascii, "%\nM6 ; 50% DONE\nM30\n%"), Err((Failure::BadJob, 2, 10)));
    let first = Settings { after_end: AfterEnd::Drop, ..settings };
    assert_sent(&first, more, "%\nM30\n%");
    let refused = encoded(&first, "PART 7\n%\n\nO1\n%\n");
    assert_eq!(refused, Err((Failure::BadJob, 4, 1)));
    let off = Settings { percent: false, ..settings };
    for program in ["O1\nM30", "O1\nM30\n", "%\nO1\nM30", "O1\nM30\n%", "", "N1"] {
        assert_sent(&off, program, program);
    }
}

#[test]
fn every_line_end_is_one_eob_in_every_form() {
    let forms = [
        (Eob::Lf, "\n"),
        (Eob::CrLf, "\r\n"),
        (Eob::LfCrCr, "\n\r\r"),
        (Eob::LfCr, "\n\r"),
        (Eob::Cr, "\r"),
    ];
    for (_, end) in forms {
        for (eob, sent) in forms {
            let settings = Settings { eob, ..defaults() };
            let program = ["%", "O1", "", "M30", "%", ""].join(end);
            assert_sent(&settings, &program, &["%", "O1", "", "M30", "%"].join(sent));
            // The place of a fault is that in the file.
            let program = ["%", "O1", "", "G1;", "%"].join(end);
            assert_eq!(encoded(&settings, &program), Err((UNSUPPORTED, 4, 3)), "{program:?}");
        }
    }
}

#[test]
fn eia_has_one_eob_and_no_colon() {
    let settings = Settings { code: SendCode::Eia, eob: Eob::LfCrCr, ..defaults() };
    let sent = encoded_from(&settings, &[], b"%\r\nO35\nM6%");
    assert_eq!(sent, Ok(vec![0x0B, 0x80, 0x46, 0x13, 0x15, 0x80, 0x54, 0x16, 0x0B]));
    // A blank tape around the program.
    let sent = encoded_from(&settings, &[], b"\0\0%\nM6\n%\n\0\0");
    assert_eq!(sent, Ok(vec![0x0B, 0x80, 0x54, 0x16, 0x80, 0x0B]));
    assert_eq!(encoded(&settings, "%\n:1\n%"), Err((UNSUPPORTED, 2, 1)));
    assert_eq!(encoded(&settings, "%\nO1\0\n%"), Err((UNSUPPORTED, 2, 3)));
}

#[test]
fn every_character_is_sent_as_it_can_be_or_refused_at_its_place() {
    for code in [Code::Iso, Code::Eia] {
        let send_code = if code == Code::Iso { SendCode::Iso } else { SendCode::Eia };
        let settings = Settings { code: send_code, upper: false, ..defaults() };
        for byte in (0..=u8::MAX).filter(|byte| !b"\n\r%".contains(byte)) {
            let sent = encoded_from(&settings, &[], &[b'%', b'\n', b'A', byte, b'1']);
            let wire = |character| encode(&settings, code, character).unwrap();
            match encode(&settings, code, byte) {
                Some(own) => {
                    let ends = [wire(b'%'), wire(b'\n'), wire(b'A'), own, wire(b'1')];
                    let expected = [&ends[..], &[wire(b'\n'), wire(b'%')]].concat();
                    assert_eq!(sent, Ok(expected));
                }
                None => assert_eq!(sent, Err((UNSUPPORTED, 2, 2)), "{byte:02x}"),
            }
        }
    }
}

#[test]
fn what_the_code_has_not_is_replaced_raised_spaced_or_dropped() {
    let program = "%\nO1(a_b;ü%)\nM30\n%";
    let settings = |unsupported| Settings { unsupported, ..defaults() };
    assert_eq!(encoded(&settings(Unsupported::Refuse), program), Err((UNSUPPORTED, 2, 5)));
    assert_sent(&settings(Unsupported::Space), program, "%\nO1(A B    )\nM30\n%");
    assert_sent(&settings(Unsupported::Drop), program, "%\nO1(AB)\nM30\n%");
    let replace = bytes(b"_-;/\xC3U\xBCE");
    let replacing = Settings { replace, ..settings(Unsupported::Drop) };
    assert_sent(&replacing, program, "%\nO1(A-B/UE)\nM30\n%");
    // An EOB may be written as a semicolon; lines are those of the file still.
    let replacing = Settings { replace: bytes(b";\n"), ..defaults() };
    assert_sent(&replacing, "%;O1;M30;%", "%\nO1\nM30\n%");
    assert_eq!(encoded(&replacing, "%;O1\nM30;_"), Err((UNSUPPORTED, 2, 5)));
}

#[test]
fn a_percent_in_a_comment_does_not_end_the_tape() {
    let settings = defaults();
    assert_eq!(encoded(&settings, "%\nO1 (50%)\n%"), Err((UNSUPPORTED, 2, 7)));
    // A comment ends with its block at the latest.
    assert_sent(&settings, "%\nO1(\nM30\n%", "%\nO1(\nM30\n%");
    assert_sent(&settings, "%\nO1(A)%", "%\nO1(A)%");
}

#[test]
fn odd_blocks_are_padded_by_the_counting_rule() {
    let lf = padded(Eob::Lf);
    assert_sent(&lf, "%\nO1\nO12\n\nG1X5\n%", "%\nO1 \nO12\n \nG1X5 \n%");
    assert_sent(&lf, "%X\nM30%", "%X\nM30%");
    assert_sent(&lf, "%\n(AB)\n(A)\nM30\n%", "%\n(AB) \n(A)\nM30\n%");
    let crlf = padded(Eob::CrLf);
    assert_sent(&crlf, "%\nO1\nO12\n%", "%\r\nO1\r\nO12 \r\n%");
    assert_sent(&Settings { tv_cr: false, ..crlf }, "%\nO1\nO12\n%", "%\r\nO1 \r\nO12\r\n%");
    assert_sent(&padded(Eob::LfCr), "%\nO1\nO12\n%", "%\n\rO1\n\rO12 \n\r%");
    let without = Settings { tv_cr: false, ..padded(Eob::LfCr) };
    assert_sent(&without, "%\nO1\nO12\n%", "%\n\rO1 \n\rO12\n\r%");
    assert_sent(&padded(Eob::LfCrCr), "%\nO1\nO12\n%", "%\n\r\rO1 \n\r\rO12\n\r\r%");
    assert_sent(&padded(Eob::Cr), "%\nO1\nO12\n%", "%\rO1 \rO12\r%");
    let without = Settings { tv_comments: false, ..lf };
    assert_sent(&without, "%\nO1(A)\nO12(AB)\n%", "%\nO1(A) \nO12(AB)\n%");
}

#[test]
fn every_padded_block_is_even() {
    for eob in [Eob::Lf, Eob::CrLf, Eob::LfCrCr, Eob::LfCr, Eob::Cr] {
        for (tv_cr, tv_comments) in [(true, true), (true, false), (false, true), (false, false)] {
            let settings = Settings { tv_cr, tv_comments, ..padded(eob) };
            let text = "%\nO1\nG1X22(ABC)Y3\n\n(D)(EF)\nN5\nM30\n%";
            let sent = encoded(&settings, text).unwrap();
            // The control's own way to count.
            let end = if eob == Eob::Cr { '\r' } else { '\n' };
            let mut blocks = sent.split_inclusive(end).skip(1).collect::<Vec<_>>();
            assert_eq!(blocks.pop().map(str::trim_start), Some("%"));
            for block in blocks {
                let mut in_comment = false;
                let counted = block.chars().filter(|character| {
                    in_comment &= *character != ')';
                    let counts = (tv_comments || !in_comment)
                        && (tv_cr || *character != '\r' || *character == end);
                    in_comment |= *character == '(';
                    counts
                });
                assert_eq!(counted.count() % 2, 0, "{block:?}");
            }
        }
    }
}

#[test]
fn numbers_are_kept_left_out_or_new_where_a_block_begins() {
    let program = "%N1\nO1(N1)\nN5 G1X1\n/N6G1\n/2 N7\n(N8)\nG1N8\nNX\nN\n  N9M30\n%";
    let numbers = |block_numbers| Settings { block_numbers, number_step: 10, ..defaults() };
    assert_sent(&numbers(BlockNumbers::Keep), program, program);
    assert_sent(
        &numbers(BlockNumbers::Strip),
        program,
        "%N1\nO1(N1)\nG1X1\n/G1\n/2 \n(N8)\nG1N8\nNX\nN\n  M30\n%",
    );
    assert_sent(
        &numbers(BlockNumbers::Renumber),
        program,
        "%N1\nO1(N1)\nN10 G1X1\n/N20G1\n/2 N30\n(N8)\nG1N8\nNX\nN\n  N40M30\n%",
    );
    let by_thousand = Settings { number_step: 1_000, ..numbers(BlockNumbers::Renumber) };
    let sent = encoded(&by_thousand, &"N1\n".repeat(100)).unwrap();
    assert!(sent.starts_with("%\nN1000\nN2000\n") && sent.ends_with("N98000\nN99000\nN1000\n%"));
    // No number of a control is as long.
    let long = "%\nN1234567890123456G1\n/ / / / / / / / N5\n%";
    assert_sent(&by_thousand, long, long);
}

const PROGRAM: &[u8] = b"%\nO77(50)\nN10T1M6(5%)\n(;N30)\nN0030G1X5\n/N40M30\n%";

#[test]
fn a_restart_sends_head_preamble_and_the_rest() {
    let restart = |fields: &[Vec<u8>]| {
        let sent = encoded_from(&defaults(), &fields.concat(), PROGRAM)?;
        Ok::<_, (Failure, u32, u32)>(String::from_utf8(sent).unwrap())
    };
    let rest = |preamble: &str| Ok(format!("%\nO77(50)\n{preamble}N0030G1X5\n/N40M30\n%"));
    assert_eq!(restart(&[from_block(4)]), rest(""));
    assert_eq!(restart(&[from_sequence(30)]), rest(""));
    assert_eq!(restart(&[from_sequence(30), preamble("T1M6\ng0Z50")]), rest("T1M6\nG0Z50\n"));
    assert_eq!(restart(&[from_block(3), from_sequence(30), preamble("(A)\r\n")]), rest("(A)\n"));
    assert_eq!(restart(&[from_sequence(40)]), Ok("%\nO77(50)\n/N40M30\n%".into()));
    // What is skipped is not looked at, the first block is the O line.
    assert!(restart(&[from_block(2)]).is_err());
    let not_found = Err((Failure::NotFound, 7, 1));
    assert_eq!(restart(&[from_block(6)]), not_found);
    assert_eq!(restart(&[from_sequence(35)]), not_found);
    for bad in [from_block(0), from_block(-1), from_sequence(-5), from_sequence(1 << 40)] {
        assert_eq!(restart(&[bad]), Err((Failure::BadJob, 0, 0)));
    }
    for text in ["M98%", "G1;"] {
        let refused = restart(&[from_block(4), preamble(text)]);
        assert_eq!(refused.map_err(|(failure, ..)| failure), Err(Failure::BadJob));
    }
}

#[test]
fn a_restart_without_an_o_line_or_a_last_eob() {
    let restart = |fields: &[u8], program: &str| {
        encoded_from(&defaults(), fields, program.as_bytes())
            .map(|sent| String::from_utf8(sent).unwrap())
    };
    let preamble = preamble("T1");
    assert_eq!(restart(&preamble, "%\nG0\nM30\n%"), Ok("%\nT1\nG0\nM30\n%".into()));
    let fields = [from_sequence(2), preamble].concat();
    for program in ["O1\nN1\nN2", "%\nO1\nN1\nN2\n", "%\n:1\nN2\n%"] {
        let head = if program.contains(':') { ":1" } else { "O1" };
        assert_eq!(restart(&fields, program), Ok(format!("%\n{head}\nT1\nN2\n%")), "{program:?}");
    }
    assert_eq!(restart(&fields, "%\nO1\n%"), Err((Failure::NotFound, 3, 1)));
    assert_eq!(restart(&fields, ""), Err((Failure::NotFound, 1, 0)));
}

#[test]
fn a_bad_job_says_what_is_bad() {
    let fault = |fields: &[u8], program: &str| {
        let settings = &Setup::new(&defaults());
        let mut encoder = Encoder::new_zeroed();
        let mut taken = encoder.begin(&Values::new(fields));
        let mut bytes = program.bytes();
        while taken.is_ok() {
            taken = match bytes.next() {
                _ if encoder.is_waiting() => encoder.next(settings),
                Some(byte) => encoder.push(settings, byte),
                None => encoder.finish(settings).and(Err(Failure::Internal)),
            };
        }
        taken.map_err(|failure| encoder.status(failure)).unwrap_err()
    };
    assert_eq!(fault(&from_block(0), ""), Fault::Field as u16);
    assert_eq!(fault(&preamble("M98%"), "%\nG1\n%"), Fault::Preamble as u16);
    assert_eq!(fault(&[], "PART 7\n%\nO1\n"), Fault::TextBefore as u16);
    assert_eq!(fault(&[], "%\nO1\n%\nO2\n"), Fault::TextBehind as u16);
    assert_eq!(fault(&[], "%\nG1;\n%"), 0, "it is no bad job");
}
