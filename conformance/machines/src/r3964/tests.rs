//! A station alone, against what the other side would say.

use softplug_abi::{LineErrorKind, LineParameters, Micros};

use super::*;

const STX: u8 = 0x02;
const DLE: u8 = 0x10;
const MILLI: i64 = 1_000;
const NOTHING: [u8; 0] = [];

/// A station on a line without a rate, where all is said at once, and what it
/// said: (µs, byte).
struct Rig {
    station: Station,
    said: Vec<(i64, u8)>,
}

impl Rig {
    fn new(options: Options) -> Self {
        let line = LineParameters::new(0);
        let options = Options { line, nak_at_start: false, ..options };
        Self { station: Station::new(options).unwrap(), said: Vec::new() }
    }

    fn with(when: When, fault: Fault) -> Self {
        Self::new(Options { faults: Faults::one(when, fault), ..Options::default() })
    }

    /// Lets time go on; what was said since the last call.
    fn until(&mut self, until: i64) -> Vec<(i64, u8)> {
        while let Some(next) = self.station.next_event().filter(|next| next.0 <= until) {
            self.station.advance(next);
            self.listen(next.0);
        }
        std::mem::take(&mut self.said)
    }

    fn listen(&mut self, now: i64) {
        while let Some(byte) = self.station.poll_transmit(Micros(now)) {
            self.said.push((now, byte));
        }
    }

    /// The other side says all of this at once; what the station answers at once.
    fn say(&mut self, at: i64, bytes: &[u8]) -> Vec<u8> {
        self.until(at - 1);
        self.said.clear();
        for byte in bytes {
            self.station.receive(Micros(at), *byte);
            self.listen(at);
        }
        self.said.drain(..).map(|(_, byte)| byte).collect()
    }

    fn errors(&self) -> Vec<Error> {
        self.station.report().errors.iter().map(|(_, error)| *error).collect()
    }

    fn received(&self) -> Vec<&[u8]> {
        self.station.report().received.iter().map(|block| block.data.as_slice()).collect()
    }
}

const BLOCK: &[u8] = &[0x31, 0x32, 0x33, 0x10, 0x03, 0x23];

#[test]
fn without_a_partner_six_stx_and_a_nak_go_out() {
    let mut rig = Rig::new(Options::default());
    rig.station.send(Micros::ZERO, b"123".to_vec());
    let stx = |n: i64| (n * 2_000 * MILLI, STX);
    let mut expected: Vec<_> = (0..6).map(stx).collect();
    expected.push((12_000 * MILLI, NAK));
    assert_eq!(rig.until(60_000 * MILLI), expected);
    let sent = &rig.station.report().sent[0];
    assert_eq!((sent.result, sent.stx, sent.blocks), (Err(Error::SetUpNoAnswer), 6, 0));
    assert!(rig.station.is_idle());
}

#[test]
fn a_block_is_repeated_from_stx_until_the_attempts_are_used_up() {
    let mut rig = Rig::new(Options { transmission_attempts: 2, ..Options::default() });
    rig.station.send(Micros::ZERO, b"123".to_vec());
    assert_eq!(rig.say(1, &[DLE]), BLOCK);
    // An STX is no DLE.
    assert_eq!(rig.say(2, &[STX]), [STX]);
    assert_eq!(rig.say(3, &[DLE]), BLOCK);
    assert_eq!(rig.say(4, &[NAK]), [NAK]);
    let sent = &rig.station.report().sent[0];
    assert_eq!((sent.result, sent.stx, sent.blocks), (Err(Error::EndRefused), 2, 2));
}

#[test]
fn a_character_in_its_block_stops_it_and_silence_goes_before_nak() {
    let line = LineParameters::new(9_600);
    let mut station =
        Station::new(Options { line, nak_at_start: false, ..Options::default() }).unwrap();
    station.send(Micros::ZERO, vec![b'x'; 100]);
    assert_eq!(station.poll_transmit(Micros(1_042)), Some(STX));
    station.receive(Micros(3_000), DLE);
    station.receive(Micros(20_000), b'?');
    let mut said = Vec::new();
    for now in (20_000..400_000).step_by(100) {
        while let Some(byte) = station.poll_transmit(Micros(now)) {
            said.push((now, byte));
        }
        station.advance(Micros(now));
    }
    // What the UART had leaves, the rest does not.
    assert!(said.len() < 22, "{said:?}");
    assert!(matches!(said[said.len() - 2..], [(nak, NAK), (_, STX)] if nak > 240_000));
    assert_eq!(station.report().errors, [(Micros(240_000), Error::Disturbed)]);
}

#[test]
fn a_dle_before_the_stx_has_left_is_no_answer() {
    let line = LineParameters::new(9_600);
    let mut station =
        Station::new(Options { line, nak_at_start: false, ..Options::default() }).unwrap();
    station.send(Micros::ZERO, b"1".to_vec());
    station.receive(Micros(1_041), DLE);
    assert_eq!(station.report().errors, [(Micros(1_041), Error::SetUpRefused)]);
}

#[test]
fn a_good_block_is_acknowledged_and_a_bad_one_may_be_repeated() {
    let mut rig = Rig::new(Options::default());
    assert_eq!(rig.say(0, &[STX]), [DLE]);
    assert_eq!(rig.say(1, &[0x31, 0x32, 0x33, 0x10, 0x03, 0x24]), [NAK]);
    assert_eq!(rig.say(4_000 * MILLI, &[STX]), [DLE]);
    assert_eq!(rig.say(4_001 * MILLI, BLOCK), [DLE]);
    assert_eq!(rig.received(), [b"123"]);
    assert_eq!(rig.errors(), [Error::Check]);
    assert!(rig.station.is_idle());
}

#[test]
fn the_count_of_bad_blocks_survives_the_new_stx() {
    let mut rig = Rig::new(Options { transmission_attempts: 3, ..Options::default() });
    for n in 0..3 {
        assert_eq!(rig.say(n * 10, &[STX]), [DLE]);
        assert!(!rig.station.is_idle());
        assert_eq!(rig.say(n * 10 + 1, &[0x31, 0x10, 0x03, 0x00]), [NAK]);
    }
    assert!(rig.station.is_idle());
}

#[test]
fn the_block_wait_ends_a_bad_reception_with_its_first_error() {
    let mut rig = Rig::new(Options::default());
    rig.say(0, &[STX]);
    assert_eq!(rig.say(1, &[0x31, 0x10, 0x03, 0x00]), [NAK]);
    assert_eq!(rig.until(10_000 * MILLI), []);
    assert_eq!(rig.errors(), [Error::Check, Error::Check]);
    assert!(rig.station.is_idle());
}

#[test]
fn a_gap_of_zvz_is_taken_and_one_a_microsecond_longer_is_not() {
    for (gap, last) in [(220 * MILLI, DLE), (220 * MILLI + 1, NAK)] {
        let mut rig = Rig::new(Options::default());
        rig.say(0, &[STX]);
        rig.say(10, &BLOCK[..2]);
        rig.said.clear();
        let answer = rig.say(10 + gap, &BLOCK[2..]);
        if last == DLE {
            assert_eq!(answer, [DLE]);
        } else {
            assert_eq!(rig.errors()[0], Error::CharacterDelay);
        }
    }
}

#[test]
fn damaged_characters_are_answered_at_the_end_of_the_block() {
    let mut rig = Rig::new(Options::default());
    rig.say(0, &[STX]);
    assert_eq!(rig.say(1, &[0x31]), NOTHING);
    rig.station.receive_damaged(Micros(2), LineErrorKind::Parity);
    assert_eq!(rig.say(3, &[0x33, 0x10, 0x03]), NOTHING);
    assert_eq!(rig.say(4, &[0x23]), [NAK]);
    assert_eq!(rig.errors(), [Error::Line]);
}

#[test]
fn a_break_ends_everything() {
    let mut rig = Rig::new(Options::default());
    rig.say(0, &[STX]);
    rig.station.receive_damaged(Micros(2), LineErrorKind::Break);
    assert!(rig.station.is_idle());
    rig.station.send(Micros(3), b"1".to_vec());
    rig.station.receive_damaged(Micros(4), LineErrorKind::Break);
    assert!(rig.station.is_idle());
    assert_eq!(rig.station.report().sent[0].result, Err(Error::Break));
}

#[test]
fn garbage_is_answered_after_silence_and_nak_and_break_are_not() {
    let mut rig = Rig::new(Options::default());
    assert_eq!(rig.say(0, &[NAK]), NOTHING);
    rig.station.receive_damaged(Micros(1), LineErrorKind::Break);
    assert_eq!(rig.until(1_000 * MILLI), []);
    assert_eq!(rig.say(2_000 * MILLI, b"x"), NOTHING);
    assert_eq!(rig.say(2_100 * MILLI, &[DLE]), NOTHING);
    assert_eq!(rig.until(3_000 * MILLI), [(2_320 * MILLI, NAK)]);
}

#[test]
fn low_priority_gives_way_and_high_does_not() {
    let mut low = Rig::new(Options { priority: Priority::Low, ..Options::default() });
    low.station.send(Micros::ZERO, b"9".to_vec());
    assert_eq!(low.say(5, &[STX]), [DLE]);
    // The DLE for the other side's block and its own STX go out together.
    assert_eq!(low.say(6, BLOCK), [DLE, STX]);
    assert_eq!(low.received(), [b"123"]);

    let mut high = Rig::new(Options::default());
    high.station.send(Micros::ZERO, b"9".to_vec());
    assert_eq!(high.say(1_000 * MILLI, &[STX]), NOTHING);
    // QVZ keeps running.
    assert_eq!(high.until(2_500 * MILLI), [(2_000 * MILLI, STX)]);
    assert_eq!(high.station.report().conflicts, 1);
}

#[test]
fn both_of_the_same_priority_fail_with_their_numbers() {
    let mut high = Rig::new(Options { setup_attempts: 1, ..Options::default() });
    high.station.send(Micros::ZERO, b"9".to_vec());
    high.say(1_000 * MILLI, &[STX]);
    high.until(3_000 * MILLI);
    let result = high.station.report().sent[0].result;
    assert_eq!(result.map_err(Error::status), Err(0x070B));

    let mut low = Rig::new(Options { priority: Priority::Low, ..Options::default() });
    low.station.send(Micros::ZERO, b"9".to_vec());
    assert_eq!(low.say(5, &[STX]), [DLE]);
    assert_eq!(low.say(6, &[DLE]), NOTHING);
    low.until(1_000 * MILLI);
    let result = low.station.report().sent[0].result;
    assert_eq!(result.map_err(Error::status), Err(0x070C));
}

#[test]
fn without_handshake_all_goes_in_one_and_an_stx_is_not_answered() {
    let mut rig = Rig::new(Options { handshake: false, ..Options::simplified() });
    assert_eq!(rig.say(0, &[STX]), NOTHING);
    assert_eq!(rig.say(1, BLOCK), [DLE]);
    rig.station.send(Micros(10), b"123".to_vec());
    let said: Vec<u8> = rig.until(10).into_iter().map(|(_, byte)| byte).collect();
    assert_eq!(said, [&[STX], BLOCK].concat());
    rig.station.receive(Micros(20), DLE);
    assert_eq!(rig.station.report().sent[0].result, Ok(()));
}

#[test]
fn an_oversize_block_is_refused_at_once() {
    let mut rig = Rig::new(Options { block_size: 2, ..Options::default() });
    rig.say(0, &[STX]);
    assert_eq!(rig.say(1, b"12"), NOTHING);
    assert_eq!(rig.say(2, b"3"), [NAK]);
    assert_eq!(rig.errors(), [Error::TooLong]);
}

#[test]
fn each_wrong_answer_to_stx_happens_on_demand() {
    let answer = |fault: Fault| {
        let mut rig = Rig::with(When::Nth(1), fault);
        rig.say(10, &[STX]);
        rig.said.clear();
        let mut rig = Rig::with(When::Nth(1), rig.station.report().faults[0].1.clone());
        rig.station.receive(Micros(10), STX);
        rig.until(1_000 * MILLI)
    };
    let late = (10 + 700 * MILLI, DLE);
    // Nobody begins a block, so that after a DLE comes the NAK of ZVZ.
    assert_eq!(answer(Fault::NoAnswer), []);
    assert_eq!(answer(Fault::LateAnswer(Micros(700 * MILLI)))[0], late);
    assert_eq!(answer(Fault::NakAnswer), [(10, NAK)]);
    assert_eq!(answer(Fault::OtherAnswer(0x41)), [(10, 0x41)]);
    assert_eq!(answer(Fault::Conflict), [(10, STX)]);
    assert_eq!(answer(Fault::NoBuffer), [(10 + 400 * MILLI, NAK)]);
    assert_eq!(answer(Fault::Silence(Micros(100))), []);
}

#[test]
fn each_wrong_end_answer_happens_on_demand() {
    let answer = |fault: Fault| {
        let mut rig = Rig::with(When::Nth(1), fault);
        rig.say(10, &[STX]);
        for byte in BLOCK {
            rig.station.receive(Micros(20), *byte);
        }
        let said = rig.until(1_000 * MILLI);
        (said, rig.station.report().received.len())
    };
    assert_eq!(answer(Fault::NoAcknowledgement), (vec![], 1));
    let late = Fault::LateAcknowledgement(Micros(100));
    assert_eq!(answer(late), (vec![(120, DLE)], 1));
    assert_eq!(answer(Fault::NakAcknowledgement), (vec![(20, NAK)], 0));
    assert_eq!(answer(Fault::OtherAcknowledgement(STX)), (vec![(20, STX)], 0));
}

#[test]
fn the_other_sides_block_is_interrupted_on_demand() {
    for (fault, expected) in [
        (Fault::NakInBlock(2), vec![NAK]),
        (Fault::OtherInBlock(2, 0x41), vec![0x41]),
        (Fault::BreakInBlock(2), vec![]),
    ] {
        let is_break = expected.is_empty();
        let mut rig = Rig::with(When::Nth(1), fault);
        rig.say(10, &[STX]);
        assert_eq!(rig.say(11, &BLOCK[..1]), NOTHING);
        rig.station.receive(Micros(12), BLOCK[1]);
        let mut said = Vec::new();
        let mut breaks = 0;
        while let Some(next) = rig.station.next_event().filter(|next| next.0 < 100 * MILLI) {
            rig.station.advance(next);
            while let Some(signal) = rig.station.poll_signal(next) {
                match signal {
                    Signal::Character(byte) => said.push(byte),
                    _ => breaks += 1,
                }
            }
        }
        assert_eq!((said, breaks), (expected, i32::from(is_break)));
    }
}

#[test]
fn its_own_block_is_spoilt_on_demand() {
    let block = |fault: Fault| {
        let mut rig = Rig::with(When::Nth(1), fault);
        rig.station.send(Micros::ZERO, vec![0x10, 0x41, 0x42]);
        rig.until(5);
        rig.station.receive(Micros(10), DLE);
        rig.until(1_000 * MILLI)
    };
    let bytes = |said: Vec<(i64, u8)>| said.into_iter().map(|(_, byte)| byte).collect::<Vec<_>>();
    let good = [0x10, 0x10, 0x41, 0x42, 0x10, 0x03, 0x10];
    assert_eq!(bytes(block(Fault::LateStart(Micros(0)))), good);
    let wrong = bytes(block(Fault::WrongCheck));
    assert_eq!((wrong.len(), &wrong[..6]), (7, &good[..6]));
    assert_ne!(wrong[6], good[6]);
    assert_eq!(bytes(block(Fault::LoneDle(1))), [0x10, 0x10, 0x10, 0x41, 0x42, 0x10, 0x03, 0x00]);
    assert_eq!(bytes(block(Fault::Cut(3))), good[..3]);
    let gap = block(Fault::Gap(3, Micros(500)));
    assert_eq!((gap[2].0, gap[3].0), (10, 510));
}

#[test]
fn stray_characters_come_at_rest_on_demand() {
    let mut rig = Rig::with(When::Nth(1), Fault::Garbage(vec![0x55, 0x66]));
    rig.station.send(Micros::ZERO, Vec::new());
    rig.until(5);
    rig.say(6, &[DLE]);
    assert_eq!(rig.say(7, &[DLE]), [0x55, 0x66]);
    rig.station.behave();
    rig.station.send(Micros(8), Vec::new());
    rig.until(9);
    rig.say(10, &[DLE]);
    assert_eq!(rig.say(11, &[DLE]), NOTHING);
}

#[test]
fn lateness_of_its_driver_shows() {
    let mut rig = Rig::new(Options::default());
    rig.station.send(Micros::ZERO, Vec::new());
    rig.until(5);
    rig.station.advance(Micros(2_000 * MILLI + 7));
    assert_eq!(rig.station.report().late, Micros(7));
}
