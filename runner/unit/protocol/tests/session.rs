//! Two ends of a session over an uplink that loses, doubles, delays and reorders: messages arrive
//! once and in order, or the session ends at both ends.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use softplug_abi::Micros;
use softplug_unit_protocol::{
    EndReason, Frame, FrameError, FrameKind, Identity, LONGEST, Messages, RefuseReason, Role,
    Session, SessionError, SessionEvent, ToServer, ToUnit,
};
use std::collections::BTreeMap;

type End = Session<4, 128>;

/// The uplink in one direction: frames by the time at which they arrive.
#[derive(Default)]
struct Wire {
    frames: BTreeMap<(Micros, u64), Vec<u8>>,
    count: u64,
}

impl Wire {
    fn put(&mut self, at: Micros, frame: Vec<u8>) {
        self.count += 1;
        self.frames.insert((at, self.count), frame);
    }

    fn next_at(&self) -> Option<Micros> {
        self.frames.keys().next().map(|(at, _)| *at)
    }

    fn take(&mut self, now: Micros) -> Option<Vec<u8>> {
        let (&key, _) = self.frames.first_key_value().filter(|((at, _), _)| *at <= now)?;
        self.frames.remove(&key)
    }
}

struct Pair {
    now: Micros,
    server: End,
    unit: End,
    to_unit: Wire,
    to_server: Wire,
    random: ChaCha8Rng,
    /// Of 1,000 frames, how many meet with a fault.
    faulty: u32,
    faults: u32,
    /// Frames that never arrive: whether it goes to the unit, and the frame.
    swallows: fn(bool, &[u8]) -> bool,
    server_events: Vec<SessionEvent>,
    unit_events: Vec<SessionEvent>,
    /// Numbers of the jobs in what has come, in this session.
    unit_heard: Vec<u64>,
    server_heard: Vec<u64>,
}

impl Pair {
    fn new(seed: u64, faulty: u32) -> Self {
        Self {
            now: Micros::ZERO,
            server: End::new(Role::Server, Identity(11)),
            unit: End::new(Role::Unit, Identity(22)),
            to_unit: Wire::default(),
            to_server: Wire::default(),
            random: ChaCha8Rng::seed_from_u64(seed),
            faulty,
            faults: 0,
            swallows: |_, _| false,
            server_events: Vec::new(),
            unit_events: Vec::new(),
            unit_heard: Vec::new(),
            server_heard: Vec::new(),
        }
    }

    fn up(seed: u64, faulty: u32) -> Self {
        let mut pair = Self::new(seed, faulty);
        pair.server.call(pair.now);
        pair.run_until(|pair| pair.server.is_up() && pair.unit.is_up());
        pair
    }

    fn below(&mut self, bound: u32) -> u32 {
        self.random.next_u32() % bound
    }

    /// All that is due now, and then time goes on to what comes next. `false`: nothing will.
    fn step(&mut self) -> bool {
        self.transmit();
        let next = [
            self.to_unit.next_at(),
            self.to_server.next_at(),
            self.server.poll_timeout(),
            self.unit.poll_timeout(),
        ];
        let Some(next) = next.into_iter().flatten().min() else { return false };
        self.now = self.now.max(next);
        while let Some(frame) = self.to_unit.take(self.now) {
            if let Ok(Some(payload)) = self.unit.receive(self.now, &frame) {
                self.unit_heard.extend(Messages::<ToUnit>::new(payload).map(|message| {
                    let Ok(ToUnit::Resume { job, .. }) = message else { panic!("{message:?}") };
                    job
                }));
            }
            if let Some(event) = self.unit.poll() {
                self.unit_heard.clear();
                self.unit_events.push(event);
            }
        }
        while let Some(frame) = self.to_server.take(self.now) {
            if let Ok(Some(payload)) = self.server.receive(self.now, &frame) {
                self.server_heard.extend(Messages::<ToServer>::new(payload).map(|message| {
                    let Ok(ToServer::Rewind { job, .. }) = message else { panic!("{message:?}") };
                    job
                }));
            }
            self.server_polled();
        }
        self.server.handle_timeout(self.now);
        self.server_polled();
        self.unit.handle_timeout(self.now);
        if let Some(event) = self.unit.poll() {
            self.unit_heard.clear();
            self.unit_events.push(event);
        }
        true
    }

    fn server_polled(&mut self) {
        if let Some(event) = self.server.poll() {
            self.server_heard.clear();
            self.server_events.push(event);
        }
    }

    fn transmit(&mut self) {
        let mut out = [0; LONGEST];
        while let Some(length) = self.server.poll_transmit(self.now, &mut out) {
            self.carry(&out[..length], true);
        }
        while let Some(length) = self.unit.poll_transmit(self.now, &mut out) {
            self.carry(&out[..length], false);
        }
    }

    fn carry(&mut self, frame: &[u8], is_to_unit: bool) {
        if (self.swallows)(is_to_unit, frame) {
            return;
        }
        let is_faulty = self.below(1_000) < self.faulty;
        let late = |pair: &mut Self, most| pair.now + Micros(i64::from(1_000 + pair.below(most)));
        let times = if is_faulty {
            self.faults += 1;
            match self.below(4) {
                0 => vec![],
                1 => vec![late(self, 1), late(self, 5_000)],
                2 => vec![late(self, 4_000_000)],
                _ => vec![late(self, 50_000)],
            }
        } else {
            vec![self.now + Micros(1_000)]
        };
        let wire = if is_to_unit { &mut self.to_unit } else { &mut self.to_server };
        for at in times {
            wire.put(at, frame.to_vec());
        }
    }

    fn run_until(&mut self, is_done: impl Fn(&Self) -> bool) {
        for _ in 0..100_000 {
            if is_done(self) {
                return;
            }
            assert!(self.step(), "nothing will happen any more");
        }
        panic!("it goes on for ever");
    }

    fn run_for(&mut self, span: Micros) {
        let until = self.now + span;
        while self.now < until && self.step() {}
    }
}

fn resume(job: u64) -> ToUnit<'static> {
    ToUnit::Resume { link: 0, job }
}

fn rewind(job: u64) -> ToServer<'static> {
    ToServer::Rewind { link: 0, job }
}

#[test]
fn a_session_begins_and_both_know_who_is_there() {
    let mut pair = Pair::up(1, 0);
    pair.run_for(Micros::from_secs(60));
    assert_eq!(pair.server_events, [SessionEvent::Began { peer: Identity(22) }]);
    assert_eq!(pair.unit_events, [SessionEvent::Began { peer: Identity(11) }]);
}

/// Both ends number their messages from 0 in each session; each may only ever hear 0, 1, 2 …
#[test]
fn ten_thousand_faults_lose_double_and_reorder_nothing() {
    let mut faults = 0;
    for seed in 0..200 {
        let mut pair = Pair::new(seed, 20 + 40 * (seed as u32 % 8));
        let (mut to_unit, mut to_server) = (0, 0);
        let mut sessions = 0;
        pair.server.call(pair.now);
        for _ in 0..2_000 {
            if pair.faults > 100 {
                break;
            }
            let (server_events, unit_events) = (pair.server_events.len(), pair.unit_events.len());
            assert!(pair.step());
            if pair.server_events.len() > server_events {
                to_unit = 0;
                match pair.server_events.last() {
                    Some(SessionEvent::Ended(_)) => pair.server.call(pair.now),
                    Some(SessionEvent::Began { .. }) => sessions += 1,
                    event => panic!("{event:?}"),
                }
            }
            if pair.unit_events.len() > unit_events {
                to_server = 0;
            }
            while pair.below(3) > 0 && pair.server.send(&resume(to_unit)).is_ok() {
                to_unit += 1;
            }
            while pair.below(3) > 0 && pair.unit.send(&rewind(to_server)).is_ok() {
                to_server += 1;
            }
            let counts = |heard: &[u64]| heard.iter().copied().eq(0..heard.len() as u64);
            assert!(counts(&pair.unit_heard), "seed {seed}: {:?}", pair.unit_heard);
            assert!(counts(&pair.server_heard), "seed {seed}: {:?}", pair.server_heard);
        }
        assert!(sessions > 0, "seed {seed}");
        // Without further faults all that was said arrives.
        pair.faulty = 0;
        pair.run_until(|pair| pair.to_unit.frames.is_empty() && pair.to_server.frames.is_empty());
        pair.run_for(Micros::from_secs(20));
        if !pair.server.is_up() {
            pair.server.call(pair.now);
            pair.run_until(|pair| pair.server.is_up() && pair.unit.is_up());
        }
        let (had_unit, had_server) = (pair.unit_heard.len(), pair.server_heard.len());
        pair.server.send(&resume(had_unit as u64)).unwrap();
        pair.unit.send(&rewind(had_server as u64)).unwrap();
        pair.run_until(|pair| {
            pair.unit_heard.len() > had_unit && pair.server_heard.len() > had_server
        });
        faults += pair.faults;
    }
    assert!(faults >= 10_000, "{faults}");
}

#[test]
fn what_is_not_confirmed_is_sent_again_and_no_more_is_taken_than_fits() {
    let mut pair = Pair::up(2, 0);
    let mut sent = 0;
    while pair.server.send(&resume(sent)).is_ok() {
        sent += 1;
    }
    assert_eq!(pair.server.send(&resume(sent)), Err(SessionError::Full));
    // Four frames of 128 bytes, 12 bytes a message.
    assert_eq!(sent, 4 * (128 / 12));
    assert!(!pair.server.has_room(12));
    // All of it is lost once.
    pair.transmit();
    pair.to_unit.frames.clear();
    pair.run_until(|pair| pair.unit_heard.len() as u64 == sent);
    pair.run_until(|pair| pair.server.has_room(12));
}

#[test]
fn a_message_that_never_fits_is_refused() {
    let mut pair = Pair::up(3, 0);
    let bytes = [0; 200];
    let data = ToUnit::Data { link: 0, job: 1, pass: 0, at: 0, bytes: &bytes };
    assert_eq!(pair.server.send(&data), Err(SessionError::TooLong));
    assert_eq!(pair.server.longest_message(), 128);
    // Nothing of it is left behind.
    pair.server.send(&resume(0)).unwrap();
    pair.run_until(|pair| pair.unit_heard == [0]);
}

#[test]
fn silence_ends_it_at_both_ends_and_a_call_begins_another() {
    let mut pair = Pair::up(4, 0);
    // The cable is out.
    pair.swallows = |_, _| true;
    pair.run_until(|pair| !pair.server.is_up() && !pair.unit.is_up());
    let ended = SessionEvent::Ended(EndReason::Silence);
    assert_eq!(pair.server_events.last(), Some(&ended));
    assert_eq!(pair.unit_events.last(), Some(&ended));
    assert_eq!(pair.server.send(&resume(0)), Err(SessionError::NoSession));
    pair.swallows = |_, _| false;
    pair.server.call(pair.now);
    pair.run_until(|pair| pair.server.is_up() && pair.unit.is_up());
    pair.server.send(&resume(0)).unwrap();
    pair.run_until(|pair| pair.unit_heard == [0]);
}

#[test]
fn a_unit_that_was_started_anew_says_so() {
    let mut pair = Pair::up(5, 0);
    pair.unit = End::new(Role::Unit, Identity(23));
    pair.server.send(&resume(0)).unwrap();
    pair.run_until(|pair| !pair.server.is_up());
    assert_eq!(pair.server_events.last(), Some(&SessionEvent::Ended(EndReason::Unknown)));
    pair.server.call(pair.now);
    pair.run_until(|pair| pair.server.is_up());
    assert_eq!(pair.server_events.last(), Some(&SessionEvent::Began { peer: Identity(23) }));
    assert!(pair.unit_heard.is_empty());
}

#[test]
fn a_second_server_is_refused_while_the_first_one_lives() {
    let mut pair = Pair::up(6, 0);
    let mut other = End::new(Role::Server, Identity(12));
    let mut wire = [0; LONGEST];
    other.call(pair.now);
    let length = other.poll_transmit(pair.now, &mut wire).unwrap();
    pair.unit.receive(pair.now, &wire[..length]).unwrap();
    let length = pair.unit.poll_transmit(pair.now, &mut wire).unwrap();
    other.receive(pair.now, &wire[..length]).unwrap();
    assert_eq!(other.poll(), Some(SessionEvent::Refused(RefuseReason::Busy)));
    assert!(pair.unit.is_up() && pair.unit.poll().is_none());
    // It calls again, and comes in when the first one is gone.
    pair.unit.uplink_lost();
    pair.unit.poll();
    other.handle_timeout(pair.now + Micros::from_secs(1));
    let length = other.poll_transmit(pair.now, &mut wire).unwrap();
    pair.unit.receive(pair.now, &wire[..length]).unwrap();
    assert_eq!(pair.unit.poll(), Some(SessionEvent::Began { peer: Identity(12) }));
}

/// A call that was under way for long must not end the session that came of the next one.
#[test]
fn a_late_call_changes_nothing() {
    let mut pair = Pair::new(7, 0);
    let mut wire = [0; LONGEST];
    pair.server.call(pair.now);
    let length = pair.server.poll_transmit(pair.now, &mut wire).unwrap();
    let late = wire[..length].to_vec();
    pair.server.call(pair.now);
    pair.run_until(|pair| pair.server.is_up() && pair.unit.is_up());
    pair.unit.receive(pair.now, &late).unwrap();
    assert_eq!(pair.unit.poll(), None);
    // Nor does it begin one when that has ended.
    pair.unit.uplink_lost();
    pair.unit.poll();
    pair.unit.receive(pair.now, &late).unwrap();
    assert_eq!(pair.unit.poll(), None);
    assert!(!pair.unit.is_up());
}

#[test]
fn another_version_is_refused_by_name() {
    let mut pair = Pair::new(8, 0);
    let mut wire = [0; LONGEST];
    let hello =
        Frame { kind: FrameKind::Hello, session: 0, number: 0, taken: 0, payload: &[0; 14] };
    let length = hello.encode(&mut wire).unwrap();
    wire[0] = 2;
    assert_eq!(pair.unit.receive(pair.now, &wire[..length]), Err(FrameError::Version(2)));
    let length = pair.unit.poll_transmit(pair.now, &mut wire).unwrap();
    pair.server.call(pair.now);
    pair.server.receive(pair.now, &wire[..length]).unwrap();
    assert_eq!(pair.server.poll(), Some(SessionEvent::Refused(RefuseReason::Version)));
}

#[test]
fn what_was_never_sent_cannot_be_confirmed() {
    let mut pair = Pair::up(9, 0);
    let number = {
        let mut wire = [0; LONGEST];
        pair.unit.send(&rewind(0)).unwrap();
        let length = pair.unit.poll_transmit(pair.now, &mut wire).unwrap();
        Frame::decode(&wire[..length]).unwrap().session
    };
    let mut wire = [0; LONGEST];
    let liar = Frame { kind: FrameKind::Data, session: number, number: 0, taken: 2, payload: &[] };
    let length = liar.encode(&mut wire).unwrap();
    pair.unit.receive(pair.now, &wire[..length]).unwrap();
    assert_eq!(pair.unit.poll(), Some(SessionEvent::Ended(EndReason::Broken)));
}

/// The server never hears the answer for so long that the unit has given the session up.
#[test]
fn answers_that_are_lost_for_long_do_not_shut_the_server_out() {
    let mut pair = Pair::new(10, 0);
    pair.swallows = |is_to_unit, _| !is_to_unit;
    pair.server.call(pair.now);
    pair.run_for(Micros::from_secs(30));
    assert!(!pair.server.is_up());
    pair.swallows = |_, _| false;
    pair.run_until(|pair| pair.server.is_up() && pair.unit.is_up());
    pair.server.send(&resume(0)).unwrap();
    pair.run_until(|pair| pair.unit_heard == [0]);
}

/// Whoever lives and never takes a frame must not be waited for without end.
#[test]
fn a_frame_that_is_never_taken_ends_the_session() {
    let mut pair = Pair::up(11, 0);
    pair.swallows = |is_to_unit, frame| is_to_unit && Frame::decode(frame).unwrap().number > 0;
    pair.server.send(&resume(0)).unwrap();
    pair.run_until(|pair| !pair.server.is_up());
    assert_eq!(pair.server_events.last(), Some(&SessionEvent::Ended(EndReason::Unconfirmed)));
}
