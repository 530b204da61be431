//! Traces crossed at random. Nobody says what has to come of one: a change that shows on one can
//! be told from the module as it is, that is all.

use crate::given::case::Case;
use crate::given::timeline::{Asked, Given, Input, Timeline, Windows};
use crate::run::cut::Cuts;
use crate::run::replay::{Conditions, conditions};
use softplug_abi::manifest::Manifest;
use softplug_abi::{Failure, JobId, LineErrorKind, LinkDownReason, Micros, ModemLines};
use softplug_models::Dice;
use softplug_trace::Drain;

/// Longer traces are not crossed: one of them costs as much as hundreds of others.
const INPUTS: usize = 600;

/// Longer traces are not crossed either, nor do crossed ones become longer.
const SPAN: Micros = Micros::from_secs(1_800);

/// What waits at the end has so long, but no longer than all before it.
const TAIL: Micros = Micros::from_secs(20);

/// Rooms in which something may end.
const ROOMS: &[u32] =
    &[1, 2, 3, 4, 7, 8, 15, 16, 17, 20, 31, 32, 48, 63, 64, 65, 127, 128, 129, 256, 300];

/// The traces of one profile that a plug-in can be given.
pub(super) struct Stock<'a> {
    profile: &'a str,
    /// Bytes that mean something in its protocol, if there is a model that names them.
    special: &'static [u8],
    traces: Vec<Conditions>,
}

impl<'a> Stock<'a> {
    /// None: there is nothing to cross.
    pub(super) fn new<'c>(
        profile: &'a str,
        cases: impl Iterator<Item = &'c Case>,
        manifest: &Manifest,
    ) -> Option<Self> {
        let is_short = |conditions: &Conditions| {
            conditions.timeline.given.len() <= INPUTS && conditions.timeline.end <= SPAN
        };
        let traces = cases.filter(|case| !case.trace.is_recording());
        let traces =
            traces.filter_map(|case| conditions(case, manifest, Windows::Early, None).ok());
        let traces: Vec<Conditions> = traces.filter(is_short).collect();
        let special = softplug_models::profile(profile).map_or(&[][..], |model| model.special);
        (!traces.is_empty()).then_some(Self { profile, special, traces })
    }

    /// The crossed trace with this number.
    pub(super) fn crossed(&self, seed: u64, number: u64) -> Conditions {
        let first = &self.traces[(number % self.traces.len() as u64) as usize];
        let mut crossing = Crossing {
            jobs: last_job(&first.timeline),
            made: first.clone(),
            special: self.special,
            dice: Dice::new(seed, self.profile, number),
        };
        for _ in 0..=crossing.dice.below(2) {
            let other = crossing.dice.pick(&self.traces).clone();
            crossing.cross(other);
        }
        for _ in 0..=crossing.dice.below(6) {
            crossing.edit();
        }
        crossing.end()
    }
}

/// A trace while it is crossed.
struct Crossing {
    made: Conditions,
    /// The jobs that it has had.
    jobs: u32,
    special: &'static [u8],
    dice: Dice,
}

impl Crossing {
    /// Puts the inputs of another trace behind, among, or in the place of the last ones.
    fn cross(&mut self, other: Conditions) {
        let Conditions { timeline: Timeline { given, end }, options, .. } = other;
        let own = &mut self.made.timeline;
        let place = self.dice.below(own.given.len() as u64 + 1) as usize;
        let at_place = own.given.get(place).map_or(own.end, |given| given.at);
        let at = match self.dice.below(4) {
            0 => own.end + Micros(self.dice.between(0, 3_000_000)),
            1 | 2 => at_place,
            _ => {
                own.given.truncate(place);
                at_place
            }
        };
        // From the beginning, or from where it does something else already.
        let skipped = match self.dice.below(3) {
            0 => self.dice.below(given.len() as u64 + 1) as usize,
            _ => 0,
        };
        let from = given.get(skipped).map_or(Micros::ZERO, |given| given.at);
        let jobs = self.jobs;
        let added = given.into_iter().skip(skipped).map(|Given { at: own_at, what }| Given {
            at: at + (own_at - from),
            what: of_later_job(what, jobs),
        });
        own.given.extend(added);
        own.end = own.end.max(at + (end - from).max(Micros::ZERO));
        self.jobs = last_job(own).max(jobs);
        own.sort();
        match self.dice.below(6) {
            0 => self.made.options.settings = options.settings,
            1 => self.made.options = options,
            _ => {}
        }
    }

    /// Changes one thing.
    fn edit(&mut self) {
        let length = self.made.timeline.given.len() as u64;
        let place = self.dice.below(length) as usize;
        match self.dice.below(16) {
            0 => {
                if place < self.made.timeline.given.len() {
                    self.made.timeline.given.remove(place);
                }
            }
            1 => self.repeat(place),
            2 => self.move_one(place),
            3 | 4 => self.change_byte(place),
            5 => self.join(place),
            6 => self.change_data(place),
            7 => {
                let room = *self.dice.pick(ROOMS);
                match self.dice.below(3) {
                    0 => self.made.options.transmit_room = room,
                    _ => self.made.options.delivery_room = room,
                }
            }
            8 | 9 => {
                let what = self.port();
                self.insert(place, what);
            }
            10 => {
                // Either is followed by the other after a while.
                let pause = self.dice.between(0, 2_000_000);
                let (first, then) = match self.dice.below(3) {
                    0 => (Input::Host(Asked::Close), Input::Host(Asked::Open)),
                    1 => (Input::Down(LinkDownReason::Unplugged), Input::Up),
                    _ => (
                        Input::Host(Asked::Drain(Drain::Off)),
                        Input::Host(Asked::Drain(Drain::Auto)),
                    ),
                };
                let at = self.insert(place, first);
                self.made.timeline.given.push(Given { at: at + Micros(pause), what: then });
                self.made.timeline.sort();
            }
            _ => {
                let what = self.host();
                self.insert(place, what);
            }
        }
    }

    /// Right at, or a little behind, the time of another input.
    fn insert(&mut self, place: usize, what: Input) -> Micros {
        let later = match self.dice.below(3) {
            0 => 0,
            1 => self.dice.between(1, 20_000),
            _ => self.dice.between(1, 3_000_000),
        };
        let own = &mut self.made.timeline;
        let at = own.given.get(place).map_or(Micros::ZERO, |given| given.at) + Micros(later);
        own.given.push(Given { at, what });
        own.sort();
        at
    }

    fn repeat(&mut self, place: usize) {
        let Some(Given { what, .. }) = self.made.timeline.given.get(place).cloned() else { return };
        let what = match what {
            Input::Host(Asked::Job(mut job, data)) => {
                self.jobs = self.jobs.wrapping_add(1).max(1);
                job.id = JobId(self.jobs);
                Input::Host(Asked::Job(job, data))
            }
            other => other,
        };
        for _ in 0..=self.dice.below(3) {
            if matches!(what, Input::Host(Asked::Job(..))) && self.dice.one_in(2) {
                break;
            }
            self.insert(place, what.clone());
        }
    }

    fn move_one(&mut self, place: usize) {
        let own = &mut self.made.timeline;
        let to = self.dice.below(own.given.len() as u64) as usize;
        let (Some(at), Some(moved)) =
            (own.given.get(to).map(|given| given.at), own.given.get_mut(place))
        else {
            return;
        };
        moved.at = match self.dice.below(3) {
            0 => at,
            1 => moved.at + Micros(self.dice.between(-20_000, 20_000)),
            _ => moved.at + Micros(self.dice.between(0, 5_000_000)),
        }
        .max(Micros::ZERO);
        own.sort();
    }

    /// Of the nearest input from there that has bytes.
    fn change_byte(&mut self, place: usize) {
        let with = self.byte();
        let mut rest = self.made.timeline.given[place..].iter_mut();
        let Some(what) = rest.find_map(|given| match &mut given.what {
            what @ (Input::Bytes(_) | Input::Character(_)) => Some(what),
            _ => None,
        }) else {
            return;
        };
        match what {
            Input::Character(byte) => *byte = with,
            Input::Bytes(bytes) => changed(&mut self.dice, bytes, with),
            _ => {}
        }
    }

    /// Bytes that came one after the other come at one time, with what else is at that time.
    fn join(&mut self, place: usize) {
        let count = 2 + self.dice.below(12) as usize;
        let own = &mut self.made.timeline;
        let Some(at) = own.given.get(place).map(|given| given.at) else { return };
        for given in own.given[place..].iter_mut().take(count) {
            given.at = at;
            if let Input::Character(byte) = given.what {
                given.what = Input::Bytes(vec![byte]);
            }
        }
        own.sort();
        if self.dice.one_in(2) {
            *own = std::mem::take(own).cut("", Cuts::Whole);
        }
    }

    /// Of the nearest job from there.
    fn change_data(&mut self, place: usize) {
        let with = self.byte();
        let mut rest = self.made.timeline.given[place..].iter_mut();
        let Some((job, data)) = rest.find_map(|given| match &mut given.what {
            Input::Host(Asked::Job(job, data)) => Some((job, data)),
            _ => None,
        }) else {
            return;
        };
        match self.dice.below(4) {
            0 => data.extend_from_within(..),
            1 => data.truncate(self.dice.below(data.len() as u64 + 1) as usize),
            _ => changed(&mut self.dice, data, with),
        }
        job.size = job.size.map(|_| data.len() as u64);
    }

    fn byte(&mut self) -> u8 {
        if self.special.is_empty() || self.dice.one_in(2) {
            self.dice.byte()
        } else {
            *self.dice.pick(self.special)
        }
    }

    fn port(&mut self) -> Input {
        let byte = Some(self.byte());
        let (kind, byte) = match self.dice.below(5) {
            0 => (LineErrorKind::Parity, byte),
            1 => (LineErrorKind::Framing, byte),
            2 => (LineErrorKind::Break, None),
            3 => (LineErrorKind::Overrun, None),
            _ => {
                let line = *self.dice.pick(&[ModemLines::CTS, ModemLines::DSR, ModemLines::DCD]);
                let on = if self.dice.one_in(2) { line } else { ModemLines::default() };
                return Input::Modem(line, on);
            }
        };
        Input::Damaged { kind, byte, span: self.dice.below(3) as u32 }
    }

    fn host(&mut self) -> Input {
        let job = 1 + self.dice.below(u64::from(self.jobs)) as u32;
        Input::Host(match self.dice.below(12) {
            0 | 1 => Asked::Pause(job),
            2 => Asked::Resume(job),
            3 | 4 => Asked::Abort(job),
            5 => Asked::Abort(0),
            6 => Asked::ForceResume,
            7 => Asked::Room(*self.dice.pick(ROOMS)),
            8 => Asked::Drain(*self.dice.pick(&[Drain::Off, Drain::Auto])),
            9 => {
                let answer = match self.dice.below(3) {
                    0 => Err(Failure::NotFound),
                    _ => Ok((0..self.dice.length(300)).map(|_| self.dice.byte()).collect()),
                };
                Asked::Answer(1 + self.dice.below(4) as u32, answer)
            }
            _ => Asked::Swap,
        })
    }

    /// At the end the host takes everything, and what waits ends.
    fn end(self) -> Conditions {
        let Self { mut made, .. } = self;
        let own = &mut made.timeline;
        own.given.truncate(2 * INPUTS);
        let last = own.given.last().map_or(Micros::ZERO, |given| given.at);
        let end = own.end.max(last).min(SPAN);
        own.given.retain(|given| given.at <= end);
        only_sound(&mut own.given);
        let auto = Input::Host(Asked::Drain(Drain::Auto));
        own.given.push(Given { at: end, what: auto });
        own.end = end + end.min(TAIL);
        made
    }
}

/// No host opens a link that is open, closes one that is closed, or swaps there.
fn only_sound(given: &mut Vec<Given>) {
    let mut is_open = true;
    given.retain(|given| match given.what {
        Input::Host(Asked::Open) => !std::mem::replace(&mut is_open, true),
        Input::Host(Asked::Close) => std::mem::replace(&mut is_open, false),
        Input::Host(Asked::Swap) => is_open,
        _ => true,
    });
}

fn changed(dice: &mut Dice, bytes: &mut Vec<u8>, with: u8) {
    let place = dice.below(bytes.len() as u64 + 1) as usize;
    match dice.below(3) {
        0 => bytes.insert(place, with),
        1 if place < bytes.len() && bytes.len() > 1 => drop(bytes.remove(place)),
        _ => {
            if let Some(byte) = bytes.get_mut(place) {
                *byte = with;
            }
        }
    }
}

/// The greatest id of the timeline's jobs; 0: it has none.
fn last_job(timeline: &Timeline) -> u32 {
    let ids = timeline.given.iter().filter_map(|given| match &given.what {
        Input::Host(Asked::Job(job, _)) => Some(job.id.0),
        _ => None,
    });
    ids.max().unwrap_or(0)
}

/// Behind so many other jobs.
fn of_later_job(what: Input, jobs: u32) -> Input {
    let later = |job: u32| if job == 0 { 0 } else { job.wrapping_add(jobs).max(1) };
    match what {
        Input::Host(asked) => Input::Host(match asked {
            Asked::Job(mut job, data) => {
                job.id = JobId(later(job.id.0));
                Asked::Job(job, data)
            }
            Asked::Pause(job) => Asked::Pause(later(job)),
            Asked::Resume(job) => Asked::Resume(later(job)),
            Asked::Abort(job) => Asked::Abort(later(job)),
            other => other,
        }),
        other => other,
    }
}
