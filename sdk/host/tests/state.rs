//! Settings in, state out and in again, also of plug-ins that lie about it.

use crate::common::{CAPACITY, Guest, HOST, HOSTS, INPUT, MANIFEST, OUTPUT, echo};
use softplug_abi::limits::STATE_BYTES;
use softplug_abi::manifest::SettingValues;
use softplug_abi::{Action, Actions, Event, EventKind, Instance, Micros, Refusal};
use softplug_host::{Misbehaviour, SavedState, Session, SessionFault};
use std::fmt::Write;

const NOW: Micros = Micros(7);

fn echoed(session: &mut Session, bytes: &[u8]) -> Vec<u8> {
    let output = session.step(&Event::Received(bytes), NOW).unwrap();
    let mut sent = Vec::new();
    for action in Actions::new(output.actions) {
        let Action::Transmit { bytes, .. } = action.unwrap() else { panic!("no transmit") };
        sent.extend(bytes);
    }
    sent
}

#[test]
fn settings_reach_the_plug_in() {
    for host in HOSTS.iter() {
        let plugin = host.load_bytes(&echo()).unwrap();
        let mut session = plugin.instantiate().unwrap();
        let values = plugin.manifest().resolve_settings([("shift", "1")]).unwrap();
        session.configure(&values, Micros::ZERO).unwrap();
        assert_eq!(echoed(&mut session, b"HAL 9000"), b"IBM!:111");
    }
}

#[test]
fn a_state_goes_from_one_instance_into_another() {
    let plugin = HOST.load_bytes(&echo()).unwrap();
    let mut old = plugin.instantiate().unwrap();
    let values = plugin.manifest().resolve_settings([("shift", "3")]).unwrap();
    old.configure(&values, Micros::ZERO).unwrap();
    let state = old.save(NOW).unwrap();
    assert_eq!(state, SavedState { format: 1, bytes: vec![3] });
    assert_eq!(old.save(NOW).unwrap(), state, "save changes nothing");

    // Also into one under another engine.
    for host in HOSTS.iter() {
        let mut new = host.load_bytes(&echo()).unwrap().instantiate().unwrap();
        assert_eq!(echoed(&mut new, b"A"), b"A");
        new.restore(&state, NOW).unwrap();
        assert_eq!(echoed(&mut new, b"A"), b"D");
        assert_eq!(new.save(NOW).unwrap(), state);
    }
}

#[test]
fn a_state_that_the_plug_in_cannot_take() {
    let plugin = HOST.load_bytes(&echo()).unwrap();
    let mut session = plugin.instantiate().unwrap();
    let format = SavedState { format: 9, bytes: vec![1] };
    assert_eq!(
        session.restore(&format, NOW).unwrap_err(),
        SessionFault::FormatNotAccepted { format: 9 }
    );
    let content = SavedState { format: 1, bytes: vec![1, 2] };
    let fault = session.restore(&content, NOW).unwrap_err();
    assert_eq!(fault.refusal(), Some(Refusal::State));
    let large = SavedState { format: 1, bytes: vec![0; STATE_BYTES as usize + 1] };
    assert_eq!(
        session.restore(&large, NOW).unwrap_err(),
        SessionFault::StateTooLarge { bytes: STATE_BYTES as usize + 1 }
    );
    assert_eq!(session.fault(), None);
}

#[test]
fn a_plug_in_that_does_not_save() {
    let manifest = MANIFEST.replace("\"saves\": 1, ", "");
    let guest =
        Guest { manifests: vec![manifest], step: "unreachable".to_owned(), ..Guest::default() };
    assert_eq!(guest.session().save(NOW).unwrap_err(), SessionFault::DoesNotSave);
}

/// Counts calls and adds up the lengths of the pieces, checking that each piece
/// begins where the one before ended; refuses otherwise.
const TAKES_PIECES: &str = "
    (if (i32.ne (i32.load (i32.const 0)) (i32.load (i32.const 0x1004)))
        (then (return (i32.const -4))))
    (i32.store (i32.const 0) (i32.add (i32.load (i32.const 0))
        (i32.sub (local.get 1) (i32.const 12))))
    (i32.const 0)";

#[test]
fn a_large_state_goes_in_pieces_in_order() {
    assert_eq!(INPUT, 0x1000);
    for length in [0, 1, 4_084, 4_085, STATE_BYTES as usize] {
        let mut session = Guest::stepping(TAKES_PIECES).session();
        session.restore(&SavedState { format: 2, bytes: vec![7; length] }, NOW).unwrap();
        // A further empty piece is taken only if all came: its offset must be the length.
        let total = length as u32;
        let end = Event::Restore { format: 2, offset: total, total, bytes: &[] };
        session.step(&end, NOW).unwrap();
    }
}

/// Kind and length of a record, as one word.
fn record(kind: u32, length: u32) -> u32 {
    kind + (length << 16)
}

/// Answers `save` with pieces of these (format, offset, total, length), each in
/// a round of its own.
fn saving(pieces: &[(u16, u32, u32, u32)]) -> Guest {
    let mut step =
        String::from("(i32.store (i32.const 0) (i32.add (i32.load (i32.const 0)) (i32.const 1)))");
    for (at, (format, offset, total, length)) in pieces.iter().enumerate() {
        let more = if at + 1 < pieces.len() { 0x4000_0000 } else { 0 };
        let head = record(22, length + 12);
        let result = more | (length + 16);
        write!(
            step,
            "(if (i32.eq (i32.load (i32.const 0)) (i32.const {})) (then
                (i32.store (i32.const {OUTPUT}) (i32.const {head}))
                (i32.store (i32.const {}) (i32.const {format}))
                (i32.store (i32.const {}) (i32.const {offset}))
                (i32.store (i32.const {}) (i32.const {total}))
                (return (i32.const {result}))))",
            at + 1,
            OUTPUT + 4,
            OUTPUT + 8,
            OUTPUT + 12,
        )
        .unwrap();
    }
    Guest::stepping(&(step + "(i32.const 0)"))
}

#[test]
fn pieces_that_make_a_whole() {
    let state = saving(&[(1, 0, 300, 100), (1, 100, 300, 200)]).session().save(NOW).unwrap();
    assert_eq!(state.bytes.len(), 300);
    let state = saving(&[(1, 0, 0, 0)]).session().save(NOW).unwrap();
    assert_eq!(state, SavedState { format: 1, bytes: Vec::new() });
    let full: Vec<_> = (0..32).map(|at| (1, at * 2_048, STATE_BYTES, 2_048)).collect();
    assert_eq!(saving(&full).session().save(NOW).unwrap().bytes.len(), STATE_BYTES as usize);
}

#[test]
fn pieces_that_lie() {
    for (pieces, what) in [
        (&[][..], "nothing at all"),
        (&[(1, 0, 10, 5)], "the end missing"),
        (&[(1, 0, 10, 5), (1, 6, 10, 4)], "a gap"),
        (&[(1, 0, 10, 5), (1, 4, 10, 6)], "an overlap"),
        (&[(1, 0, 10, 5), (1, 5, 11, 6)], "another total"),
        (&[(1, 5, 10, 5)], "the beginning missing"),
        (&[(2, 0, 5, 5)], "a format that the manifest does not name"),
        (&[(1, 0, 5, 5), (1, 5, 5, 1)], "more than the total"),
        (&[(1, 0, STATE_BYTES + 1, 5)], "a total over the limit"),
        (&[(1, u32::MAX, 5, 5)], "an offset that overflows"),
    ] {
        let mut session = saving(pieces).session();
        let fault = session.save(NOW).unwrap_err();
        assert!(
            matches!(
                fault,
                SessionFault::Malformed {
                    event: EventKind::Save,
                    reason: Misbehaviour::SavedPiece(_) | Misbehaviour::Actions(_)
                }
            ),
            "{what}: {fault}"
        );
        assert_eq!(session.fault(), Some(&fault), "{what}");
    }
}

#[test]
fn empty_pieces_without_end() {
    // The same empty piece in every round, always with more to come.
    let piece = format!(
        "(i32.store (i32.const {OUTPUT}) (i32.const {})) (i32.store (i32.const {}) (i32.const 1))
        (i32.store (i32.const {}) (i32.const 10)) (i32.const 0x40000010)",
        record(22, 12),
        OUTPUT + 4,
        OUTPUT + 12
    );
    let fault = Guest::stepping(&piece).session().save(NOW).unwrap_err();
    assert!(matches!(fault, SessionFault::Malformed { reason: Misbehaviour::TooManyRounds, .. }));
}

#[test]
fn actions_where_none_may_be() {
    // A hold in answer to anything.
    let guest =
        Guest::stepping(&format!("(i32.store (i32.const {OUTPUT}) (i32.const 3)) (i32.const 4)"));
    let end = |event| SessionFault::Malformed { event, reason: Misbehaviour::Action };
    let settings = SettingValues::default();
    assert_eq!(guest.session().configure(&settings, NOW).unwrap_err(), end(EventKind::Settings));
    assert_eq!(guest.session().save(NOW).unwrap_err(), end(EventKind::Save));
    let state = SavedState { format: 1, bytes: vec![1] };
    assert_eq!(guest.session().restore(&state, NOW).unwrap_err(), end(EventKind::Restore));

    // A note is heard in answer to settings, not among the pieces of a state.
    let note = Guest::stepping(&format!(
        "(i32.store (i32.const {OUTPUT}) (i32.const {})) (i32.store (i32.const {}) (i32.const 3))
        (i32.const 8)",
        record(20, 4),
        OUTPUT + 4
    ));
    note.session().configure(&settings, NOW).unwrap();
    assert_eq!(note.session().save(NOW).unwrap_err(), end(EventKind::Save));
}

#[test]
fn a_refused_setting_ends_nothing() {
    let mut session = Guest::stepping("(i32.const -3)").session();
    let fault = session.configure(&SettingValues::default(), NOW).unwrap_err();
    assert_eq!(fault.refusal(), Some(Refusal::Settings));
    assert_eq!(session.fault(), None);
    assert_eq!(session.input_capacity(), CAPACITY as usize);
}
