//! Wherever and however a plug-in fails on probation, the line and the host see
//! what they would have seen had there been no swap.

use crate::common::rooms;
use softplug_abi::manifest::SettingValues;
use softplug_abi::{
    Action, ActionWriter, DeliveryId, Event, Failure, Instance, JobId, MarkId, MarkState, Micros,
    Output, RequestId,
};
use softplug_abi::{ModemLines, Values};
use softplug_link::{Job, LinkOptions, Observed, Recorder, Spare, Successor, VirtualLine};
use std::cell::RefCell;
use std::rc::Rc;

/// How an instance fails.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Failing {
    /// Traps.
    Traps,
    /// Acts well, then writes what cannot be read.
    Garbles,
    /// Acts well, then breaks a rule.
    BreaksRule,
    /// Acts well in a first round, then traps.
    TrapsInSecondRound,
    /// Acts well, and then cannot save.
    CannotSave,
    /// Acts well, and saves only the beginning.
    SavesHalf,
}

const WAYS: [Failing; 6] = [
    Failing::Traps,
    Failing::Garbles,
    Failing::BreaksRule,
    Failing::TrapsInSecondRound,
    Failing::CannotSave,
    Failing::SavesHalf,
];

#[derive(Copy, Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("it trapped")]
struct Trapped;

/// What the converter of these tests knows.
#[derive(Clone, Debug, Default)]
struct State {
    transmit_room: usize,
    delivery_room: usize,
    job: Option<JobId>,
    data_ended: bool,
    to_send: Vec<u8>,
    /// All that was transmitted: what a discard dropped is sent again.
    transmitted: Vec<u8>,
    discarding: bool,
    sent: u64,
    mark: MarkId,
    marks: u32,
    delivering: bool,
    to_deliver: Vec<u8>,
    silent_at: Option<Micros>,
    answered: bool,
}

/// States by number: what a state is made of does not matter here.
type Shelf = Rc<RefCell<Vec<State>>>;

/// Sends a job's data and delivers what it receives, up to a silence.
#[derive(Debug)]
struct Converter {
    state: State,
    shelf: Shelf,
    events: u64,
    /// The event, counted from the opening, at which it fails.
    fails: Option<(u64, Failing)>,
    failing_now: Option<Failing>,
    output: Vec<u8>,
}

impl Converter {
    fn new(shelf: &Shelf, fails: Option<(u64, Failing)>) -> Self {
        Self {
            state: State::default(),
            shelf: Rc::clone(shelf),
            events: 0,
            fails,
            failing_now: None,
            output: Vec::new(),
        }
    }
}

/// Gathers actions.
struct Out(Vec<u8>);

impl Out {
    fn put(&mut self, action: &Action<'_>) {
        let mut buffer = [0; 1_024];
        let mut writer = ActionWriter::new(&mut buffer);
        writer.push(action).expect("the actions are short");
        self.0.extend(writer.written());
    }
}

impl State {
    fn take(&mut self, event: &Event<'_>, now: Micros, out: &mut Out) {
        match event {
            Event::Open { resumed, transmit_room, delivery_room, .. } => {
                if !resumed {
                    *self = Self::default();
                }
                self.transmit_room = *transmit_room as usize;
                self.delivery_room = *delivery_room as usize;
                if let Some(deadline) = self.silent_at {
                    out.put(&Action::SetTimer { id: 1, deadline });
                }
                // Whoever waits for room waits for the event that tells it.
                return;
            }
            Event::JobBegin { job, .. } => {
                self.job = Some(*job);
                out.put(&Action::Want { job: *job, bytes: 7 });
                let fields = Values::new(b"");
                out.put(&Action::Request { request: RequestId(9), kind: 0, fields });
            }
            Event::JobData { job, bytes } => {
                self.to_send.extend(*bytes);
                out.put(&Action::Want { job: *job, bytes: bytes.len() as u32 });
            }
            Event::JobEnd { .. } => self.data_ended = true,
            Event::Answer { .. } => self.answered = true,
            Event::TransmitRoom { grown } => self.transmit_room += *grown as usize,
            Event::DeliveryRoom { grown } => self.delivery_room += *grown as usize,
            Event::Discarded { bytes } => {
                self.discarding = false;
                self.transmit_room += *bytes as usize;
                self.sent -= u64::from(*bytes);
                let dropped = self.transmitted.len() - *bytes as usize;
                let mut again = self.transmitted.split_off(dropped);
                again.append(&mut self.to_send);
                self.to_send = again;
            }
            Event::Mark { state, .. } if *state != MarkState::MaybeLeft => self.marks -= 1,
            Event::Received(bytes) => self.hear(bytes, now, out),
            Event::Timer { .. } => {
                self.silent_at = None;
                self.delivering = false;
                out.put(&Action::DeliveryEnd { delivery: DeliveryId(1), failure: None, status: 0 });
            }
            Event::ModemLines { on, .. } => out.put(&Action::Note {
                level: softplug_abi::NoteLevel::Debug,
                code: u16::from(on.0),
                text: "lines",
            }),
            Event::LinkDown(_) => out.put(&Action::State { name: "down" }),
            Event::LinkUp => out.put(&Action::State { name: "up" }),
            Event::Pause { .. } => out.put(&Action::Hold),
            Event::Resume { .. } => out.put(&Action::Release),
            Event::Abort { job } => {
                self.job = None;
                let failure = Failure::Aborted;
                out.put(&Action::JobFailed { job: *job, failure, status: 0, sent: self.sent });
            }
            _ => {}
        }
        self.flow(out);
    }

    fn hear(&mut self, bytes: &[u8], now: Micros, out: &mut Out) {
        for byte in bytes {
            match byte {
                0x13 => out.put(&Action::Hold),
                0x11 => out.put(&Action::Release),
                b'?' => out.put(&Action::TransmitUrgent { mark: MarkId::NONE, bytes: b"U" }),
                b'#' => {
                    self.discarding = true;
                    out.put(&Action::Discard);
                }
                byte => {
                    self.to_deliver.push(*byte);
                    let deadline = now + Micros(4_000);
                    self.silent_at = Some(deadline);
                    out.put(&Action::SetTimer { id: 1, deadline });
                }
            }
        }
    }

    fn flow(&mut self, out: &mut Out) {
        let count = self.to_send.len().min(self.transmit_room).min(5);
        if count > 0 && !self.discarding {
            let bytes: Vec<u8> = self.to_send.drain(..count).collect();
            self.transmitted.extend(&bytes);
            self.mark = self.mark.next();
            self.marks += 1;
            self.sent += count as u64;
            self.transmit_room -= count;
            out.put(&Action::Transmit { mark: self.mark, bytes: &bytes });
        }
        let count = self.to_deliver.len().min(self.delivery_room);
        if count > 0 {
            let bytes: Vec<u8> = self.to_deliver.drain(..count).collect();
            self.delivery_room -= count;
            if !self.delivering {
                self.delivering = true;
                out.put(&Action::DeliveryBegin { delivery: DeliveryId(1), job: JobId::NONE });
            }
            out.put(&Action::Deliver { delivery: DeliveryId(1), bytes: &bytes });
        }
        let is_done = self.data_ended && self.to_send.is_empty() && self.marks == 0;
        if let Some(job) = self.job.filter(|_| is_done && self.answered) {
            self.job = None;
            out.put(&Action::JobDone { job, sent: self.sent });
        }
    }
}

impl Instance for Converter {
    type Fault = Trapped;

    fn input_capacity(&self) -> usize {
        512
    }

    fn step(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, Trapped> {
        let mut out = Out(Vec::new());
        match event {
            Event::Continue => return Err(Trapped),
            Event::Settings { .. } => {}
            Event::Restore { bytes, .. } => {
                let number = u32::from_le_bytes((*bytes).try_into().expect("a number")) as usize;
                self.state = self.shelf.borrow()[number].clone();
            }
            Event::Save => {
                if self.failing_now == Some(Failing::CannotSave) {
                    return Err(Trapped);
                }
                let number = self.shelf.borrow().len() as u32;
                self.shelf.borrow_mut().push(self.state.clone());
                let bytes = number.to_le_bytes();
                let half = self.failing_now == Some(Failing::SavesHalf);
                let total = if half { 8 } else { 4 };
                out.put(&Action::Saved { format: 3, offset: 0, total, bytes: &bytes });
            }
            event => {
                self.events += 1;
                let now_failing = self.fails.filter(|(at, _)| *at == self.events);
                self.failing_now = now_failing.map(|(_, how)| how);
                if self.failing_now == Some(Failing::Traps) {
                    return Err(Trapped);
                }
                self.state.take(event, now, &mut out);
            }
        }
        match self.failing_now {
            Some(Failing::Garbles) => out.0.extend([1, 0, 9, 0, 0]),
            Some(Failing::BreaksRule) => {
                out.put(&Action::Deliver { delivery: DeliveryId(77), bytes: b"x" });
            }
            _ => {}
        }
        self.output = out.0;
        let more = self.failing_now == Some(Failing::TrapsInSecondRound);
        Ok(Output { actions: &self.output, more })
    }
}

/// What was seen of the story.
#[derive(PartialEq, Eq, Debug)]
struct Seen {
    observed: Vec<(Micros, Observed)>,
    reverted: bool,
    /// Events that the successor has mastered.
    events: u64,
}

/// One story: a job, a hold, a discard, deliveries, a lost port. At `swap_at` a
/// successor takes over, which fails as said.
fn story(swap_at: Option<i64>, fails: Option<(u64, Failing)>) -> Seen {
    let shelf = Shelf::default();
    let lines = (ModemLines::CTS, ModemLines::CTS);
    let options = LinkOptions { modem_lines: Some(lines), ..rooms(16, 12) };
    let mut line = VirtualLine::new(Converter::new(&shelf, None), options, 2);
    let mut out = Recorder::default();
    line.link.open(Micros::ZERO, &mut out).unwrap();
    out.add_source(JobId(1), (b'A'..=b'z').collect());
    let mut events = 0;
    for at in (0..120_000).step_by(500) {
        let now = Micros(at);
        line.run_until(now, &mut out).unwrap();
        let link = &mut line.link;
        if swap_at == Some(at) {
            let spare = Spare { instance: Converter::new(&shelf, None), accepts: vec![3] };
            let successor = Successor {
                instance: Converter::new(&shelf, fails),
                settings: SettingValues::default(),
                accepts: vec![3],
                spare: Some(spare),
            };
            link.swap_to(now, successor, &mut out).unwrap();
        }
        match at {
            1_000 => {
                let job =
                    Job { id: JobId(1), kind: 0, size: None, fields: Vec::new(), check: false };
                link.begin_job(now, job, &mut out).unwrap();
            }
            4_000 | 4_500 | 9_000 => link.received(now, b"xyz", &mut out).unwrap(),
            11_000 => link.received(now, &[0x13], &mut out).unwrap(),
            13_500 => link.received(now, b"a?", &mut out).unwrap(),
            17_000 => link.received(now, &[0x11], &mut out).unwrap(),
            25_000 => link.received(now, b"#", &mut out).unwrap(),
            30_000 => {
                link.modem_lines(now, ModemLines::CTS, ModemLines::default(), &mut out).unwrap();
            }
            33_000 => {
                link.link_down(now, softplug_abi::LinkDownReason::Unplugged, &mut out).unwrap();
            }
            36_000 => link.link_up(now, &mut out).unwrap(),
            40_000 => link.pause(now, JobId(1), &mut out).unwrap(),
            42_000 => link.resume(now, JobId(1), &mut out).unwrap(),
            50_000 => link.answer(now, RequestId(9), Ok(b"yes"), &mut out).unwrap(),
            52_000 => {
                out.drain_by_hand = true;
                link.received(now, b"0123456789abcdefghij", &mut out).unwrap();
            }
            54_000 => out.drain(8),
            56_000 => out.drain_by_hand = false,
            57_000 => out.drain(u32::MAX),
            _ => {}
        }
        line.transmit(now, &mut out).unwrap();
        events = line.link.on_probation().unwrap_or(events);
    }
    let reverted = line.link.take_reverted().is_some();
    assert!(!line.link.has_ended());
    // A successor hears of the modem lines again, as does whoever goes on.
    out.observed.retain(|(_, seen)| !matches!(seen, Observed::Note(..)));
    Seen { observed: out.observed, reverted, events }
}

#[test]
fn a_failure_on_probation_is_not_seen_outside() {
    let reference = story(None, None);
    let saw = |wanted: fn(&Observed) -> bool| reference.observed.iter().any(|(_, it)| wanted(it));
    assert!(saw(|seen| matches!(seen, Observed::Done { .. })));
    assert!(saw(|seen| matches!(seen, Observed::Delivery(delivery) if delivery.bytes.len() == 20)));
    for swap_at in [0, 11_500] {
        let good = story(Some(swap_at), None);
        assert_eq!((&good.observed, good.reverted), (&reference.observed, false));
        assert!(good.events > 40, "{}", good.events);
        for at in 2..=good.events + 1 {
            for how in WAYS {
                let failed = story(Some(swap_at), Some((at, how)));
                assert!(failed.reverted, "swap at {swap_at}, {how:?} at event {at}");
                let case = format!("swap at {swap_at}, {how:?} at event {at}");
                assert_eq!(failed.observed, reference.observed, "{case}");
            }
        }
    }
}
