//! A cell's programs without machines: how long they take, where each channel waits, who gets stuck.

use crate::cell::Cell;
use crate::chart::Chart;
use crate::event::{Change, End, Event};
use crate::notation::Stop;
use crate::setup::{ChannelId, Setup};
use crate::timing::{BlockTimes, Machine};
use crate::word::Word;

/// Events after which a set of programs that starts itself again and again is left.
const MOST_EVENTS: u64 = 200_000;
/// Spans of each channel in the chart.
const SPANS: usize = 100_000;

/// A program as it is rehearsed: times, each with the word behind it.
#[derive(Clone, PartialEq, Debug)]
pub struct Course {
    /// Its name.
    pub program: String,
    /// Milliseconds up to a word, and the word; the last has none.
    pub parts: Vec<(u64, Option<Word>)>,
}

/// How a rehearsal ended.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Outcome {
    /// All programs ended.
    Ended,
    /// Programs are left that cannot go on.
    Stuck,
    /// Programs start each other without an end.
    Endless,
}

/// What a rehearsal found.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Rehearsal {
    /// How it ended.
    pub outcome: Outcome,
    /// When, in milliseconds.
    pub at: u64,
    /// The cell as it was then.
    pub cell: Cell,
    /// Who ran and who waited, in milliseconds.
    pub chart: Chart,
    /// Programs that were to be loaded and are not there.
    pub missing: Vec<String>,
}

impl Course {
    /// A program's blocks and words, as they would be sent to a machine.
    pub fn new(program: &str, sent: &[u8], stops: &[Stop], machine: Machine) -> Self {
        let mut times = BlockTimes::new(machine);
        let (mut parts, mut seconds, mut at) = (Vec::new(), 0.0, 0_u64);
        let mut stops = stops.iter().peekable();
        let mut end_part = |at: u64, seconds: &mut f64| {
            while let Some(stop) = stops.next_if(|stop| stop.at <= at) {
                parts.push((millis(std::mem::take(seconds)), Some(stop.word.clone())));
            }
        };
        end_part(0, &mut seconds);
        for block in sent.split_inclusive(|byte| *byte == b'\n') {
            seconds += times.seconds(block);
            at += block.len() as u64;
            end_part(at, &mut seconds);
        }
        parts.push((millis(seconds), None));
        Self { program: program.to_owned(), parts }
    }
}

/// Runs programs that begin at one time; `load` finds those that programs load.
pub fn rehearse(
    setup: Setup,
    programs: Vec<(ChannelId, Course)>,
    load: impl FnMut(ChannelId, &str) -> Option<Course>,
) -> Rehearsal {
    let channels = setup.channels().count();
    let mut stage = Stage {
        cell: Cell::new(setup),
        chart: Chart::new(SPANS),
        now: 0,
        events: 0,
        running: vec![None; channels],
        loaded: vec![None; channels],
        missing: Vec::new(),
        load,
    };
    for (channel, course) in programs {
        let program = course.program.clone();
        stage.running[usize::from(channel.0)] = Some(Running::new(course));
        stage.tell(Event::Begin { channel, program, by_hand: true });
    }
    let outcome = stage.run();
    let Stage { cell, mut chart, now, missing, .. } = stage;
    chart.look(now, &cell);
    Rehearsal { outcome, at: now, cell, chart, missing }
}

/// A program under way.
#[derive(Clone, Debug)]
struct Running {
    course: Course,
    part: usize,
    left: u64,
    /// It stands behind its part.
    has_arrived: bool,
}

impl Running {
    fn new(course: Course) -> Self {
        let left = course.parts.first().map_or(0, |(time, _)| *time);
        Self { course, part: 0, left, has_arrived: false }
    }
}

struct Stage<L> {
    cell: Cell,
    chart: Chart,
    now: u64,
    events: u64,
    running: Vec<Option<Running>>,
    loaded: Vec<Option<Course>>,
    missing: Vec<String>,
    load: L,
}

impl<L: FnMut(ChannelId, &str) -> Option<Course>> Stage<L> {
    fn run(&mut self) -> Outcome {
        loop {
            let moving: Vec<ChannelId> =
                self.cell.setup().channels().filter(|one| self.cell.may_be_fed(*one)).collect();
            for channel in &moving {
                // Its word is fulfilled: the next part begins.
                if let Some(running) = &mut self.running[usize::from(channel.0)]
                    && std::mem::take(&mut running.has_arrived)
                {
                    running.part += 1;
                    running.left = running.course.parts.get(running.part).map_or(0, |(t, _)| *t);
                }
            }
            let left = |one: &ChannelId| Some(self.running[usize::from(one.0)].as_ref()?.left);
            let Some(next) = moving.iter().filter_map(left).min() else {
                let is_left = self.cell.setup().channels().any(|one| self.cell.runs(one));
                return if is_left { Outcome::Stuck } else { Outcome::Ended };
            };
            self.now += next;
            self.events += 1;
            if self.events > MOST_EVENTS {
                return Outcome::Endless;
            }
            for channel in &moving {
                if let Some(running) = &mut self.running[usize::from(channel.0)] {
                    running.left -= next;
                }
            }
            for channel in moving {
                self.arrive(channel);
            }
        }
    }

    fn arrive(&mut self, channel: ChannelId) {
        let place = usize::from(channel.0);
        let Some(running) = &mut self.running[place] else { return };
        // Another channel may have taken its axis at this moment.
        if running.left > 0 || running.has_arrived || !self.cell.may_be_fed(channel) {
            return;
        }
        let part = running.course.parts.get(running.part);
        if let Some(word) = part.and_then(|(_, word)| word.clone()) {
            running.has_arrived = true;
            self.tell(Event::Reached { channel, word });
        } else {
            self.running[place] = None;
            self.tell(Event::Ended { channel, end: End::Done });
        }
    }

    fn tell(&mut self, event: Event) {
        // A rehearsal says only what fits.
        let changes = self.cell.handle(self.now, event).unwrap_or_default();
        for change in changes {
            match change {
                Change::Loaded { channel, program, .. } => {
                    let course = (self.load)(channel, &program);
                    if course.is_none() && !self.missing.contains(&program) {
                        self.missing.push(program.clone());
                    }
                    let nothing = Course { program, parts: vec![(0, None)] };
                    self.loaded[usize::from(channel.0)] = Some(course.unwrap_or(nothing));
                }
                Change::Began { channel, by: Some(_), .. } => {
                    let place = usize::from(channel.0);
                    self.running[place] = self.loaded[place].take().map(Running::new);
                }
                _ => {}
            }
        }
        self.chart.look(self.now, &self.cell);
    }
}

fn millis(seconds: f64) -> u64 {
    (seconds * 1_000.0).round() as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::Doing;
    use crate::notation::{Notation, Program};

    fn setup() -> Setup {
        Setup::new(&["A", "B"], &["G"], &[]).unwrap()
    }

    fn course(channel: u8, name: &str, text: &str) -> (ChannelId, Course) {
        let (setup, machine) = (setup(), Machine { bytes_per_second: 1e9, rapid: 6_000.0 });
        let channel = ChannelId(channel);
        let read = Program::read(text.as_bytes(), channel, &setup, Notation::Comment).unwrap();
        (channel, Course::new(name, &read.sent, &read.stops, machine))
    }

    #[test]
    fn who_comes_first_waits() {
        let a = course(0, "O1", "G1 X10 F600\n(SOFTPLUG WAIT 1)\nG1 X20\n");
        let b = course(1, "O2", "G1 X30 F600\n(SOFTPLUG WAIT 1)\nG1 X50\n");
        let found = rehearse(setup(), vec![a, b], |_, _| None);
        assert_eq!((found.outcome, found.at), (Outcome::Ended, 5_000));
        let spans: Vec<(u64, Option<u64>, &Doing)> =
            found.chart.spans(ChannelId(0)).map(|span| (span.from, span.to, &span.doing)).collect();
        let waits = Doing::Waits("waits at mark 1 for B".to_owned());
        let runs = Doing::Runs("O1".to_owned());
        let expected = [
            (0, Some(1_000), &runs),
            (1_000, Some(3_000), &waits),
            (3_000, Some(4_000), &runs),
            (4_000, None, &Doing::Idle),
        ];
        assert_eq!(spans, expected);
    }

    #[test]
    fn a_deadlock_is_found_before_anything_is_cut() {
        let a = course(0, "O1", "(SOFTPLUG GET G)\nG4 P500\n(SOFTPLUG WAIT 1)\n");
        let b = course(1, "O2", "G4 P100\n(SOFTPLUG GET G)\n(SOFTPLUG WAIT 1)\n");
        let found = rehearse(setup(), vec![a, b], |_, _| None);
        assert_eq!((found.outcome, found.at), (Outcome::Stuck, 500));
        let stuck = found.cell.stuck();
        assert_eq!(stuck.len(), 2);
        assert_eq!(stuck[1].text, "B waits for G, which A has: release G, or end the program of B");
    }

    #[test]
    fn programs_that_start_each_other_for_ever_are_left() {
        let text = "(SOFTPLUG LOAD B P)\n(SOFTPLUG START B)\n";
        let other = "(SOFTPLUG LOAD A P)\n(SOFTPLUG START A)\n";
        let found = rehearse(setup(), vec![course(0, "P", text)], |channel, name| {
            let text = if channel.0 == 0 { text } else { other };
            (name == "P").then(|| course(channel.0, name, text).1)
        });
        assert_eq!(found.outcome, Outcome::Endless);
        let found = rehearse(setup(), vec![course(0, "P", text)], |_, _| None);
        assert_eq!((found.outcome, found.missing), (Outcome::Ended, vec!["P".to_owned()]));
    }
}
