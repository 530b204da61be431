//! Whatever comes from the line and from the host, the converter keeps the ABI, and a
//! swap after every event changes nothing that can be seen.

use fanuc_rs232::FanucRs232;
use proptest::prelude::*;
use softplug_plugin::bench::{Bench, Observed};
use softplug_plugin::{Failure, JobId, LineErrorKind, LinkDownReason, Micros, ModemLines};

/// Room that is never short.
const PLENTY: u32 = 1_000_000;

/// What happens on the link.
#[derive(Clone, Debug)]
enum Happening {
    Bytes(Vec<u8>),
    Damaged(LineErrorKind, Option<u8>),
    Dsr(bool),
    Down,
    Up,
    Send(Vec<u8>),
    Abort(bool),
    Pause(bool),
    ForceResume,
    Drain(u32),
    Answer(bool),
    Wait(i64),
}

/// Bytes that mean something, often.
fn bytes() -> impl Strategy<Value = Vec<u8>> {
    let codes = [0x11, 0x12, 0x13, 0x93, 0x14, 0x15, 0x16, 0x95, 0x96, 0x00, 0x7F];
    let text = *b"%\n\rO1:9()NA%\n\nO1SEND 7*";
    let eia = [0x0B, 0x80, 0x46, 0x01, 0x13, 0x1A, 0x4A, 0x0D, 0x25];
    let one = prop_oneof![
        2 => prop::sample::select(codes.to_vec()),
        6 => prop::sample::select(text.to_vec()),
        2 => prop::sample::select(eia.to_vec()),
        1 => any::<u8>(),
    ];
    let pieces: Vec<Vec<u8>> = [
        "\x12%\nO1\nM30\n%\n\x14",
        "\x12%\nO9999(SEND 77)\n%\n\x14",
        "O1\nM\nO2\nM\nO3\nM\nO4\nM\nO5\nM\n",
        "07SYN\r",
        "FCRDY\r",
        "ECGTD\r",
        "F5SAT\r",
        "3DRTY1\r",
        "06RST\r",
        "E7ALM\r",
        "ECGTX\r",
    ]
    .iter()
    .map(|text| text.as_bytes().to_vec())
    .collect();
    let many = |count| move |piece: Vec<u8>| piece.repeat(count);
    prop_oneof![
        4 => prop::collection::vec(one, 1..40),
        4 => prop::sample::select(pieces.clone()),
        1 => prop::sample::select(pieces).prop_map(many(60)),
    ]
    .prop_map(|mut bytes| {
        bytes.truncate(1_024);
        bytes
    })
}

fn happening() -> impl Strategy<Value = Happening> {
    let kinds = vec![
        LineErrorKind::Parity,
        LineErrorKind::Framing,
        LineErrorKind::Overrun,
        LineErrorKind::Break,
    ];
    let damaged = (prop::sample::select(kinds), any::<u8>()).prop_map(|(kind, byte)| {
        let has_byte = !matches!(kind, LineErrorKind::Overrun | LineErrorKind::Break);
        Happening::Damaged(kind, has_byte.then_some(byte))
    });
    let program = "[%\\n\\rONG0-9() X.]{0,300}".prop_map(|text| Happening::Send(text.into_bytes()));
    prop_oneof![
        8 => bytes().prop_map(Happening::Bytes),
        1 => damaged,
        1 => any::<bool>().prop_map(Happening::Dsr),
        1 => Just(Happening::Down),
        1 => Just(Happening::Up),
        3 => program,
        1 => any::<bool>().prop_map(Happening::Abort),
        1 => any::<bool>().prop_map(Happening::Pause),
        1 => Just(Happening::ForceResume),
        2 => (1..2_000_u32).prop_map(Happening::Drain),
        1 => any::<bool>().prop_map(Happening::Answer),
        6 => prop_oneof![0..50_i64, 0..20_000_i64].prop_map(Happening::Wait),
    ]
}

fn settings() -> impl Strategy<Value = Vec<(&'static str, &'static str)>> {
    let choices: [(&str, &[&str]); 13] = [
        ("mode", &["reader", "remote-a", "remote-b"]),
        ("receive_code", &["auto", "iso", "eia"]),
        ("parity", &["uart", "software", "none"]),
        ("line_end", &["lf", "crlf"]),
        ("programs", &["keep", "split"]),
        ("output_flow", &["dc3", "rts", "none"]),
        ("need_dc2", &["on", "off"]),
        ("answer_dc2", &["on", "off"]),
        ("tv_check", &["on", "off"]),
        ("on_line_error", &["fail", "keep"]),
        ("watch_dsr", &["on", "off"]),
        ("packet_size", &["16", "1024"]),
        ("trailer", &["0", "2000"]),
    ];
    choices
        .into_iter()
        .map(|(name, values)| prop::sample::select(values.to_vec()).prop_map(move |it| (name, it)))
        .collect::<Vec<_>>()
}

/// All that was seen, but for notes and names of states.
fn run(
    settings: &[(&str, &str)],
    room: (u32, u32),
    drains: bool,
    happenings: &[Happening],
    swaps: bool,
) -> Vec<(Micros, Observed)> {
    let options = Bench::<FanucRs232>::new().set_all(settings).room(room.0, room.1);
    let mut bench = if drains { options } else { options.drain_by_hand() }.open();
    let mut is_up = true;
    let mut job = JobId::NONE;
    let mut answered = 0;
    for happening in happenings {
        let has_job = bench.link().job().is_some();
        match happening.clone() {
            Happening::Bytes(bytes) if is_up => bench.receive(&bytes),
            Happening::Damaged(kind, byte) if is_up => bench.line_error(kind, byte),
            Happening::Dsr(on) if is_up => {
                let on = if on { ModemLines::DSR } else { ModemLines::default() };
                bench.modem_lines(ModemLines::DSR, on);
            }
            Happening::Down if is_up => {
                is_up = false;
                bench.host(|link, now, host| link.link_down(now, LinkDownReason::Unplugged, host));
            }
            Happening::Up if !is_up => {
                is_up = true;
                bench.host(|link, now, host| link.link_up(now, host));
            }
            Happening::Send(program) if !has_job => job = bench.send(&program),
            Happening::Abort(true) if has_job => {
                bench.host(|link, now, host| link.abort(now, job, host));
            }
            Happening::Abort(false) => {
                bench.host(|link, now, host| link.abort(now, JobId::NONE, host));
            }
            Happening::Pause(true) if has_job => {
                bench.host(|link, now, host| link.pause(now, job, host));
            }
            Happening::Pause(false) if has_job => {
                bench.host(|link, now, host| link.resume(now, job, host));
            }
            Happening::ForceResume => {
                bench.host(|link, now, host| link.force_resume(now, host));
            }
            Happening::Answer(is_granted) => {
                let asked = |(_, seen): &(Micros, Observed)| match seen {
                    Observed::Request { request, .. } => Some(*request),
                    _ => None,
                };
                if let Some(request) = bench.observed().iter().filter_map(asked).nth(answered) {
                    answered += 1;
                    let answer =
                        if is_granted { Ok([].as_slice()) } else { Err(Failure::NotFound) };
                    bench.host(|link, now, host| link.answer(now, request, answer, host));
                }
            }
            Happening::Drain(bytes) => bench.drain(bytes),
            Happening::Wait(millis) => bench.run_for_millis(millis),
            _ => {}
        }
        if swaps {
            bench.swap();
        }
    }
    bench.run_for_millis(60_000);
    let is_told = |seen: &Observed| matches!(seen, Observed::Note(..) | Observed::State(_));
    bench.observed().iter().filter(|(_, seen)| !is_told(seen)).cloned().collect()
}

proptest! {
    #[test]
    fn nothing_breaks_it_and_a_swap_changes_nothing(
        settings in settings(),
        room in prop_oneof![Just((PLENTY, PLENTY)), (64..2_000_u32, 16..5_000_u32)],
        drains in any::<bool>(),
        happenings in prop::collection::vec(happening(), 1..60),
    ) {
        let plain = run(&settings, room, drains, &happenings, false);
        let swapped = run(&settings, room, drains, &happenings, true);
        // A new converter is told the room there is, the old one hears of it later.
        if drains && room == (PLENTY, PLENTY) {
            prop_assert_eq!(plain, swapped);
        }
    }
}
