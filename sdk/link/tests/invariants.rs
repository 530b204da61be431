//! Whatever a plug-in does and however the port takes it, nothing is lost,
//! doubled or out of order.

use crate::common;
use proptest::prelude::*;
use softplug_abi::limits::MARKS;
use softplug_abi::{
    Action, ActionWriter, DeliveryId, Event, Instance, JobId, MarkId, MarkState, Micros, Output,
};
use softplug_link::{Link, Recorder, Taken};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::convert::Infallible;
use std::rc::Rc;

/// What happens next.
#[derive(Clone, Debug)]
enum Step {
    /// Transmit so many bytes, with a mark or without.
    Transmit(usize, bool),
    Urgent(usize, bool),
    Hold,
    Release,
    Discard,
    Deliver(usize),
    /// The port takes so many bytes.
    Take(usize),
    /// So many characters more have maybe and surely left.
    Left(u64, u64),
    Drain(u32),
    /// Close and open again.
    Reopen,
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        6 => (0..20_usize, any::<bool>()).prop_map(|(count, mark)| Step::Transmit(count, mark)),
        2 => (1..6_usize, any::<bool>()).prop_map(|(count, mark)| Step::Urgent(count, mark)),
        1 => Just(Step::Hold),
        2 => Just(Step::Release),
        1 => Just(Step::Discard),
        2 => (1..30_usize).prop_map(Step::Deliver),
        6 => (0..25_usize).prop_map(Step::Take),
        6 => (0..25_u64, 0..25_u64).prop_map(|(maybe, surely)| Step::Left(maybe, surely)),
        2 => (1..30_u32).prop_map(Step::Drain),
        1 => Just(Step::Reopen),
    ]
}

/// All that the plug-in knows, and what it is to do on its next byte.
#[derive(Debug, Default)]
struct Known {
    todo: Option<Step>,
    next_byte: u8,
    next_mark: u32,
    transmit_room: u32,
    delivery_room: u32,
    /// Marks outstanding, with whether `maybe-left` came.
    marks: Vec<(MarkId, bool)>,
    /// What must come out of the port, if nothing is dropped.
    queue: VecDeque<u8>,
    urgent: VecDeque<u8>,
    held: bool,
    delivered: Vec<u8>,
    transmitted: u64,
    discarded: u64,
    taken: u64,
    answers_missing: u32,
}

impl Known {
    fn act(&mut self, writer: &mut ActionWriter<'_>) {
        let mut put = |action: &Action<'_>| writer.push(action).expect("the buffer is large");
        match self.todo.take() {
            Some(Step::Transmit(count, marked)) => {
                let count = count.min(self.transmit_room as usize);
                let marked = marked && self.marks.len() < MARKS;
                let bytes: Vec<u8> = self.bytes(count);
                self.queue.extend(&bytes);
                self.transmit_room -= count as u32;
                self.transmitted += count as u64;
                let mark = self.mark(marked);
                if marked || count > 0 {
                    put(&Action::Transmit { mark: MarkId(mark), bytes: &bytes });
                }
            }
            Some(Step::Urgent(count, marked)) => {
                let count = count.min(16 - self.urgent.len());
                let marked = marked && self.marks.len() < MARKS;
                if count > 0 {
                    let bytes: Vec<u8> = self.bytes(count);
                    self.urgent.extend(&bytes);
                    let mark = self.mark(marked);
                    put(&Action::TransmitUrgent { mark: MarkId(mark), bytes: &bytes });
                }
            }
            Some(Step::Hold) => {
                self.held = true;
                put(&Action::Hold);
            }
            Some(Step::Release) => {
                self.held = false;
                put(&Action::Release);
            }
            Some(Step::Discard) => {
                self.answers_missing += 1;
                put(&Action::Discard);
            }
            Some(Step::Deliver(count)) => {
                let count = count.min(self.delivery_room as usize);
                if count > 0 {
                    let bytes = self.bytes(count);
                    self.delivery_room -= count as u32;
                    self.delivered.extend(&bytes);
                    put(&Action::Deliver { delivery: DeliveryId(1), bytes: &bytes });
                }
            }
            _ => {}
        }
    }

    fn bytes(&mut self, count: usize) -> Vec<u8> {
        let first = self.next_byte;
        self.next_byte = first.wrapping_add(count as u8);
        (0..count).map(|at| first.wrapping_add(at as u8)).collect()
    }

    fn mark(&mut self, marked: bool) -> u32 {
        if !marked {
            return 0;
        }
        self.next_mark += 1;
        self.marks.push((MarkId(self.next_mark), false));
        self.next_mark
    }

    fn hear(&mut self, event: &Event<'_>) {
        match event {
            Event::Open { transmit_room, delivery_room, .. } => {
                self.transmit_room = *transmit_room;
                self.delivery_room = *delivery_room;
            }
            Event::Close => {
                self.marks.clear();
                self.queue.clear();
                self.urgent.clear();
                self.held = false;
                self.answers_missing = 0;
            }
            Event::TransmitRoom { grown } => self.transmit_room += grown,
            Event::DeliveryRoom { grown } => self.delivery_room += grown,
            Event::Discarded { bytes } => {
                self.transmit_room += bytes;
                self.discarded += u64::from(*bytes);
                self.answers_missing -= 1;
            }
            Event::Mark { mark, state } => {
                let at = self.marks.iter().position(|(known, _)| known == mark);
                let at = at.unwrap_or_else(|| panic!("mark {mark} is not outstanding"));
                match (state, self.marks[at].1) {
                    (MarkState::MaybeLeft, false) => self.marks[at].1 = true,
                    (MarkState::SurelyLeft, true) | (MarkState::Dropped, false) => {
                        self.marks.remove(at);
                    }
                    (state, told) => panic!("mark {mark} {state}, maybe told: {told}"),
                }
            }
            _ => {}
        }
        assert!(self.transmit_room <= TRANSMIT && self.delivery_room <= DELIVERY);
    }
}

const TRANSMIT: u32 = 50;
const DELIVERY: u32 = 64;

#[derive(Debug)]
struct Player {
    known: Rc<RefCell<Known>>,
    output: Vec<u8>,
}

impl Instance for Player {
    type Fault = Infallible;

    fn input_capacity(&self) -> usize {
        512
    }

    fn step(&mut self, event: &Event<'_>, _now: Micros) -> Result<Output<'_>, Infallible> {
        let mut known = self.known.borrow_mut();
        known.hear(event);
        let mut buffer = [0; 4_096];
        let mut writer = ActionWriter::new(&mut buffer);
        match event {
            Event::Received(_) => known.act(&mut writer),
            Event::Open { .. } => {
                let begin = Action::DeliveryBegin { delivery: DeliveryId(1), job: JobId::NONE };
                writer.push(&begin).expect("the buffer is large");
            }
            _ => {}
        }
        self.output = writer.written().to_vec();
        Ok(Output { actions: &self.output, more: false })
    }
}

fn check(steps: Vec<Step>) {
    let known = Rc::new(RefCell::new(Known::default()));
    let player = Player { known: Rc::clone(&known), output: Vec::new() };
    let mut out = Recorder::default();
    out.drain_by_hand = true;
    let mut link = Link::new(player, common::rooms(TRANSMIT, DELIVERY));
    link.open(Micros::ZERO, &mut out).unwrap();
    let (mut maybe, mut surely, mut given) = (0, 0, 0);
    let mut kept = Vec::new();
    for (at, step) in steps.into_iter().enumerate() {
        let now = Micros(at as i64);
        match step {
            Step::Take(most) => {
                let mut buffer = [0; 32];
                let before = known.borrow().queue.len() + known.borrow().urgent.len();
                let took = link.take(&mut buffer[..most]);
                let mut known = known.borrow_mut();
                let count = match took {
                    Taken::Bytes(count) => count,
                    Taken::Nothing => 0,
                    Taken::Break(_) => panic!("there was no break"),
                };
                for byte in &buffer[..count] {
                    let held = known.held;
                    let from_queue = |known: &mut Known| {
                        assert!(!held, "a held byte was sent");
                        known.taken += 1;
                        known.queue.pop_front()
                    };
                    let expected = known.urgent.pop_front().or_else(|| from_queue(&mut known));
                    assert_eq!(expected, Some(*byte));
                }
                let sendable = if known.held { known.urgent.len() } else { before - count };
                assert!(count == most || sendable == 0, "kept back though there was space");
                given += count as u64;
            }
            Step::Left(more_maybe, more_surely) => {
                maybe = (maybe + more_maybe).min(given);
                surely = (surely + more_surely).min(maybe);
                link.left(maybe, surely);
            }
            Step::Drain(bytes) => out.drain(bytes),
            Step::Reopen => {
                link.close(now, &mut out).unwrap();
                kept.extend(out.deliveries().last().unwrap().bytes.clone());
                link.open(now, &mut out).unwrap();
            }
            other => {
                let discards = matches!(other, Step::Discard);
                known.borrow_mut().todo = Some(other);
                link.received(now, b"!", &mut out).unwrap();
                if discards {
                    let dropped = std::mem::take(&mut known.borrow_mut().queue).len() as u64;
                    let before = known.borrow().discarded;
                    link.handle_timeout(now, &mut out).unwrap();
                    assert_eq!(known.borrow().discarded - before, dropped);
                }
            }
        }
        link.handle_timeout(now, &mut out).unwrap();
        let known = known.borrow();
        assert_eq!(known.answers_missing, 0, "a discard was not answered");
        assert_eq!(link.waiting(), known.queue.len());
        // What the plug-in may transmit and what waits never exceed the capacity.
        assert!(u64::from(known.transmit_room) + known.queue.len() as u64 <= u64::from(TRANSMIT));
        if known.queue.is_empty() {
            assert_eq!(known.transmit_room, TRANSMIT, "all room is back once the queue is empty");
        }
    }
    // At the end all of it leaves, and every mark is told to its end.
    let end = Micros(1_000_000);
    known.borrow_mut().todo = Some(Step::Release);
    link.received(end, b"!", &mut out).unwrap();
    link.handle_timeout(end, &mut out).unwrap();
    let mut rest: Vec<u8> = Vec::new();
    let mut buffer = [0; 7];
    while let Taken::Bytes(count) = link.take(&mut buffer) {
        rest.extend(&buffer[..count]);
        given += count as u64;
        link.handle_timeout(end, &mut out).unwrap();
    }
    let mut left: Vec<u8> = known.borrow().urgent.iter().copied().collect();
    left.extend(&known.borrow().queue);
    assert_eq!(rest, left);
    link.left(given, given);
    link.handle_timeout(end, &mut out).unwrap();
    assert_eq!(known.borrow().marks, []);
    assert_eq!(known.borrow().transmit_room, TRANSMIT);
    kept.extend(out.open_delivery.take().map(|open| open.bytes).unwrap_or_default());
    assert_eq!(kept, known.borrow().delivered);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn nothing_is_lost_doubled_or_out_of_order(
        steps in proptest::collection::vec(step(), 1..120),
    ) {
        check(steps);
    }
}
