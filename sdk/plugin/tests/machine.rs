//! Events as they arrive, state in both directions, and the limits of one event.

use softplug_abi::{Action, Actions, Event, Instance, MarkState, Micros, Refusal, Values};
use softplug_plugin::export::{Buffers, Cell};
use softplug_plugin::{
    Context, Converter, DeliveryId, JobId, LineParameters, MarkId, Native, NativeFault, NoteLevel,
    Opening, StateError, StateReader, StateWriter,
};

/// Does what it receives, and has a state of any length.
#[derive(Debug, Default)]
struct Probe {
    state: Vec<u8>,
    left: u8,
}

impl Converter for Probe {
    type Settings = ();
    const MANIFEST: &'static str = "";
    const STATE_FORMAT: Option<u16> = Some(3);

    fn new((): ()) -> Self {
        Self::default()
    }

    fn opened(&mut self, link: &mut Context<'_>, opening: &Opening) {
        link.state(if opening.resumed { "resumed" } else { "new" });
    }

    fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        match bytes {
            b"transmit" => link.transmit(&[b'x'; 65]),
            b"transmit in two" => {
                link.transmit(&[b'x'; 60]);
                link.transmit_marked(MarkId(1), b"12345");
            }
            b"deliver" => {
                link.delivery_begin(DeliveryId(1), JobId::NONE);
                link.deliver(DeliveryId(1), &[b'x'; 33]);
            }
            b"flood" => (0..5_000).for_each(|_| link.hold()),
            b"fill" => {
                while link.output_room() >= 4 {
                    link.hold();
                }
            }
            b"again" => {
                self.left = 3;
                self.more(link);
            }
            b"names" => {
                link.note(NoteLevel::Info, 0, &"é".repeat(150));
                link.note(NoteLevel::Info, 0, &format!("x{}", "é".repeat(150)));
                link.state(&"€".repeat(20));
                link.state(&format!("xx{}", "€".repeat(20)));
                link.delivery_name(DeliveryId(1), &"𝄞".repeat(40));
                link.delivery_name(DeliveryId(1), &format!("x{}", "𝄞".repeat(40)));
            }
            _ => self.state = bytes.iter().copied().cycle().take(bytes.len() * 100).collect(),
        }
    }

    fn more(&mut self, link: &mut Context<'_>) {
        if self.left > 0 {
            link.transmit(&[self.left]);
            self.left -= 1;
            link.again();
        }
    }

    fn save(&self, state: &mut StateWriter<'_>) {
        state.u32(self.state.len() as u32);
        // Field by field, so that pieces end anywhere.
        for part in self.state.chunks(7) {
            state.bytes(part);
        }
    }

    fn restore(&mut self, format: u16, state: &mut StateReader<'_>) -> Result<(), StateError> {
        if format != 3 {
            return Err(StateError::FORMAT);
        }
        let length = state.u32() as usize;
        self.state = state.bytes(length).to_vec();
        Ok(())
    }
}

fn opening(resumed: bool) -> Event<'static> {
    let line = LineParameters::new(9_600);
    Event::Open { resumed, line, transmit_room: 64, delivery_room: 32 }
}

fn opened() -> Native<Probe> {
    let mut native = Native::new();
    native.step(&opening(false), Micros::ZERO).unwrap();
    native
}

fn refused(native: &mut Native<Probe>, event: &Event<'_>) -> NativeFault {
    native.step(event, Micros::ZERO).map(drop).unwrap_err()
}

/// The pieces of a save: offset, total, bytes, and the number of rounds.
fn save(native: &mut Native<Probe>) -> (Vec<(u32, u32, Vec<u8>)>, usize) {
    let mut pieces = Vec::new();
    let mut event = Event::Save;
    for round in 1.. {
        let output = native.step(&event, Micros(5)).unwrap();
        for action in Actions::new(output.actions) {
            let Ok(Action::Saved { format: 3, offset, total, bytes }) = action else {
                panic!("{action:?}")
            };
            pieces.push((offset, total, bytes.to_vec()));
        }
        if !output.more {
            return (pieces, round);
        }
        event = Event::Continue;
    }
    unreachable!("rounds have no end of their own")
}

fn state_of(pieces: &[(u32, u32, Vec<u8>)]) -> Vec<u8> {
    let mut state = Vec::new();
    for (offset, total, bytes) in pieces {
        assert_eq!((*offset as usize, *total), (state.len(), pieces[0].1));
        state.extend(bytes);
    }
    assert_eq!(state.len(), pieces[0].1 as usize);
    state
}

fn restore(state: &[u8], format: u16, piece: usize) -> Result<Native<Probe>, NativeFault> {
    let mut native = Native::new();
    let total = state.len() as u32;
    for (at, bytes) in state.chunks(piece).enumerate() {
        let offset = (at * piece) as u32;
        native.step(&Event::Restore { format, offset, total, bytes }, Micros::ZERO)?;
    }
    Ok(native)
}

#[test]
fn an_unknown_event_is_refused_as_unknown() {
    let (cell, buffers) = (Cell::<Probe>::new(), Buffers::<4_096>::new());
    let unknown = -i32::from(Refusal::UnknownEvent.code());
    for kind in [0, 25, 26, 255, 65_536 + 4, -1, i32::MIN, i32::MAX] {
        assert_eq!(cell.step(&buffers, kind, 0, 0), unknown, "{kind}");
    }
    // Lengths that no event can have, and an event that comes too early.
    let malformed = -i32::from(Refusal::MalformedEvent.code());
    for length in [-1, i32::MIN, 1_041, i32::MAX] {
        assert_eq!(cell.step(&buffers, 4, length, 0), malformed, "{length}");
    }
    assert_eq!(cell.step(&buffers, 4, 3, 0), malformed, "not open");
}

#[test]
fn malformed_events_are_refused_and_change_nothing() {
    let mut native = opened();
    let broken = [0, 0, 2, 0, 8, 0, 1];
    let values = || Values::new(&broken);
    let events = [
        Event::Received(&[]),
        Event::Mark { mark: MarkId::NONE, state: MarkState::SurelyLeft },
        Event::Timer { id: 16, deadline: Micros::ZERO },
        Event::JobData { job: JobId(1), bytes: &[] },
        Event::JobEnd { job: JobId::NONE },
        Event::Restore { format: 3, offset: 2, total: 2, bytes: &[1] },
        Event::Settings { first: true, last: true, values: values() },
    ];
    for event in events {
        let fault = refused(&mut native, &event);
        assert_eq!(fault.refusal, Refusal::MalformedEvent, "{event:?}");
    }
    let fault = refused(&mut native, &Event::Received(&[0; 1_041]));
    assert_eq!(fault.refusal, Refusal::MalformedEvent);
    assert_eq!(fault.words, "the event is longer than the input buffer");
    // The largest event, and the converter of before.
    native.step(&Event::Received(&[b'x'; 1_040]), Micros::ZERO).unwrap();
    native.step(&Event::Received(b"state"), Micros::ZERO).unwrap();
    assert_eq!(state_of(&save(&mut native).0).len(), 4 + 500);
}

#[test]
fn before_open_and_after_close_nothing_is_taken() {
    let mut native = Native::<Probe>::new();
    let fault = refused(&mut native, &Event::Received(b"x"));
    assert_eq!((fault.refusal, fault.words), (Refusal::MalformedEvent, "the link is not open"));
    refused(&mut native, &Event::Save);
    // To go on there must be something to go on with.
    refused(&mut native, &opening(true));
    native.step(&opening(false), Micros::ZERO).unwrap();
    native.step(&Event::Close, Micros::ZERO).unwrap();
    refused(&mut native, &Event::Received(b"x"));
}

#[test]
fn a_state_travels_in_pieces() {
    for length in [0, 1, 250, 252, 253, 400, 4_000, 10_000] {
        let mut native = opened();
        if length > 0 {
            let text: Vec<u8> = (0..=length / 100).map(|byte| byte as u8).collect();
            native.step(&Event::Received(&text), Micros::ZERO).unwrap();
        }
        let (pieces, rounds) = save(&mut native);
        let state = state_of(&pieces);
        assert_eq!(rounds > 1, state.len() > 4_096 - 16 * 15, "{} bytes, {rounds}", state.len());
        assert_eq!(save(&mut native).0, pieces, "saving changes nothing");
        if state.len() > 4_096 {
            continue;
        }
        for piece in [1, 16, 1_028] {
            let mut next = restore(&state, 3, piece).unwrap();
            let output = next.step(&opening(true), Micros::ZERO).unwrap();
            let first = Actions::new(output.actions).next();
            assert_eq!(first, Some(Ok(Action::State { name: "resumed" })));
            assert_eq!(state_of(&save(&mut next).0), state);
        }
    }
}

#[test]
fn a_save_that_is_cut_off_leaves_nothing_behind() {
    let mut native = opened();
    native.step(&Event::Received(&[b'x'; 100]), Micros::ZERO).unwrap();
    assert!(native.step(&Event::Save, Micros::ZERO).unwrap().more);
    native.step(&Event::Received(b"again"), Micros::ZERO).unwrap();
    let output = native.step(&Event::Continue, Micros::ZERO).unwrap();
    let actions: Vec<_> = Actions::new(output.actions).collect();
    assert_eq!(actions, [Ok(Action::Transmit { mark: MarkId::NONE, bytes: &[2] })]);
}

#[test]
fn a_state_that_does_not_fit_is_refused() {
    let state = [8, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8];
    restore(&state, 3, 5).unwrap();
    let words = |fault: NativeFault| {
        assert_eq!(fault.refusal, Refusal::State);
        fault.words
    };
    let wrong = |fault: NativeFault| {
        assert_eq!(words(fault), "the saved state cannot be taken: ");
        fault.wrong
    };
    assert_eq!(wrong(restore(&state, 2, 5).unwrap_err()), Some(StateError::FORMAT));
    assert_eq!(wrong(restore(&state[..11], 3, 5).unwrap_err()), Some(StateError::DAMAGED));
    let trailing = [state.as_slice(), &[9]].concat();
    assert_eq!(wrong(restore(&trailing, 3, 5).unwrap_err()), Some(StateError::DAMAGED));
    let long = vec![0; 4_097];
    let too_long = "the state is too long";
    assert_eq!(words(restore(&long, 3, 1_000).unwrap_err()), too_long);

    let gap = "a piece of the state is missing";
    let piece = |offset, bytes| Event::Restore { format: 3, offset, total: 12, bytes };
    let mut native = Native::<Probe>::new();
    assert_eq!(words(refused(&mut native, &piece(4, &state[4..]))), gap);
    native.step(&piece(0, &state[..4]), Micros::ZERO).unwrap();
    assert_eq!(words(refused(&mut native, &piece(5, &state[5..]))), gap);
    assert_eq!(words(refused(&mut native, &piece(3, &state[3..]))), gap);
    // From the beginning once more.
    native.step(&piece(0, &state[..6]), Micros::ZERO).unwrap();
    native.step(&piece(6, &state[6..]), Micros::ZERO).unwrap();
    native.step(&opening(true), Micros::ZERO).unwrap();
    assert_eq!(state_of(&save(&mut native).0), state);
}

#[test]
fn more_output_is_asked_for_until_there_is_none() {
    let mut native = opened();
    let mut event = Event::Received(b"again");
    let mut rounds = Vec::new();
    loop {
        let output = native.step(&event, Micros(7)).unwrap();
        rounds.push((output.actions.to_vec(), output.more));
        if !output.more {
            break;
        }
        event = Event::Continue;
    }
    let transmit = |byte| vec![1, 0, 5, 0, 0, 0, 0, 0, byte];
    let expected =
        [(transmit(3), true), (transmit(2), true), (transmit(1), true), (Vec::new(), false)];
    assert_eq!(rounds, expected);
    // With nothing left to write.
    let output = native.step(&Event::Continue, Micros(7)).unwrap();
    assert!(output.actions.is_empty() && !output.more);
}

#[test]
fn texts_are_cut_between_characters() {
    let mut native = opened();
    let output = native.step(&Event::Received(b"names"), Micros::ZERO).unwrap();
    let lengths: Vec<_> = Actions::new(output.actions)
        .map(|action| match action.unwrap() {
            Action::Note { text, .. } => text.len(),
            Action::State { name } | Action::DeliveryName { name, .. } => name.len(),
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(lengths, [240, 239, 48, 47, 128, 125]);
}

#[test]
fn the_whole_output_buffer_can_be_used() {
    let mut native = opened();
    let output = native.step(&Event::Received(b"fill"), Micros::ZERO).unwrap();
    assert_eq!(output.actions.len(), 4_096);
}

#[test]
#[should_panic(expected = "transmits more bytes than there is room for")]
fn it_panics_past_the_room_to_transmit() {
    let _ = opened().step(&Event::Received(b"transmit"), Micros::ZERO);
}

#[test]
#[should_panic(expected = "transmits more bytes than there is room for")]
fn it_panics_past_the_room_that_is_left() {
    let _ = opened().step(&Event::Received(b"transmit in two"), Micros::ZERO);
}

#[test]
#[should_panic(expected = "delivers more bytes than there is room for")]
fn it_panics_past_the_room_to_deliver() {
    let _ = opened().step(&Event::Received(b"deliver"), Micros::ZERO);
}

#[test]
#[should_panic(expected = "writes more actions in one event than the output buffer holds")]
fn it_panics_past_the_output_buffer() {
    let _ = opened().step(&Event::Received(b"flood"), Micros::ZERO);
}

#[test]
fn rooms_grow_as_the_host_tells() {
    let mut native = opened();
    native.step(&Event::TransmitRoom { grown: 1 }, Micros::ZERO).unwrap();
    native.step(&Event::Received(b"transmit"), Micros::ZERO).unwrap();
    native.step(&Event::Discarded { bytes: 65 }, Micros::ZERO).unwrap();
    native.step(&Event::Received(b"transmit"), Micros::ZERO).unwrap();
    native.step(&Event::DeliveryRoom { grown: 1 }, Micros::ZERO).unwrap();
    native.step(&Event::Received(b"deliver"), Micros::ZERO).unwrap();
    native.step(&Event::TransmitRoom { grown: u32::MAX }, Micros::ZERO).unwrap();
    native.step(&Event::TransmitRoom { grown: u32::MAX }, Micros::ZERO).unwrap();
    native.step(&Event::Received(b"transmit in two"), Micros::ZERO).unwrap();
}
