//! One sandbox that many states of a plug-in take turns in.

use crate::ExploreError;
use crate::image::{AHEAD, BLOCK, Block, Blocks, Image, NoTime, Placed, Time, Word};
use crate::leftovers::Leftovers;
use crate::marked::Marked;
use crate::module::{Opened, Stack, opened};
use softplug_abi::{Action, Actions, Event, Instance, Mailbox, Micros, Region};
use softplug_host::{Host, HostOptions, LoadError, Plugin, Session, SessionFault, lint};
use std::ops::Range;
use std::sync::Arc;
use thiserror::Error;

/// A module that can be explored.
#[derive(Clone, Debug)]
pub(crate) struct Subject {
    pub(crate) plugin: Plugin,
    globals: Arc<[String]>,
    /// Globals that are no part of a state: they have a bit for each place that was executed.
    marks: Arc<[String]>,
    stack: Option<Stack>,
}

/// Why a state has no successor.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub(crate) enum StepFault {
    /// The sandbox says so.
    #[error("{0}")]
    Session(#[from] SessionFault),
    /// The second instance answered otherwise.
    #[error(
        "it does something else where only the clock is another, or what it left in its stack or mailbox"
    )]
    Differs,
    /// Something in memory depends on the time and is no time.
    #[error(
        "what it keeps at address {address} depends on the time and is no time in µs: it cannot \
         be explored"
    )]
    KeepsNoTime {
        /// In its memory.
        address: usize,
    },
    /// No instance could be made.
    #[error("no instance could be made: {0}")]
    NoInstance(String),
    /// Two states want the sandbox at once.
    #[error("two states want one sandbox at once")]
    TwoAtOnce,
    /// The stack is not empty after an event.
    #[error("its stack is not empty after an event: it cannot be explored")]
    Stack,
}

impl StepFault {
    /// Whether it is the plug-in's fault, wherever it runs.
    pub(crate) fn is_its_own(&self) -> bool {
        matches!(self, Self::Session(_))
    }
}

impl Subject {
    pub(crate) fn new(module: &[u8], marked: Option<&Marked>) -> Result<Self, ExploreError> {
        let inspection = lint(module).map_err(LoadError::from)?;
        let mut options = HostOptions { instances: 64, ..HostOptions::default() };
        let (run, marks) = match marked {
            Some(Marked { wasm, globals, fuel }) => {
                options.fuel_per_event = *fuel;
                (&wasm[..], &globals[..])
            }
            None => (module, &[][..]),
        };
        let Opened { wasm, globals, stack } = opened(run, marks)?;
        let plugin = Host::new(options)?.load_instrumented(&inspection, &wasm)?;
        Ok(Self { plugin, globals: globals.into(), marks: marks.into(), stack })
    }
}

/// Two instances: one that is told the time as it is, and one whose clock is [`AHEAD`]. What
/// differs between the two is time.
pub(crate) struct Sandbox {
    subject: Subject,
    sessions: [Session; 2],
    /// Nothing in here is to be alive between two events: it is cleared. In the second instance it
    /// is as it was left, so that what is alive nevertheless shows.
    dead: Vec<Range<usize>>,
    /// What stands there in the second instance.
    left: Arc<Leftovers>,
    /// A new instance's memory, which has one size for ever: the lint sees to that.
    base: Box<[u8]>,
    new: Arc<Image>,
    holds: Holds,
    /// Of whoever was loaded last.
    ticket: u64,
    answer_ahead: Vec<u8>,
    /// What the second instance saved last.
    saved_ahead: Vec<u8>,
    /// The marks of instances that are gone.
    marks: Vec<u64>,
}

/// What the two memories hold.
enum Holds {
    /// This, as it is at the time.
    Image(Arc<Image>, Micros),
    /// This, after events.
    Since(Arc<Image>),
    /// Nobody knows.
    Anything,
}

impl Sandbox {
    pub(crate) fn new(subject: Subject) -> Result<Self, ExploreError> {
        let sessions = [subject.plugin.instantiate()?, subject.plugin.instantiate()?];
        let Mailbox { input, output, .. } = sessions[0].mailbox();
        let dead = [range(input), range(output)].into_iter();
        let dead = dead.chain(subject.stack.as_ref().map(|stack| stack.range.clone())).collect();
        let new = Arc::new(Image::new(Vec::new(), Vec::new(), Vec::new()));
        let mut sandbox = Self {
            subject,
            sessions,
            dead,
            left: Arc::default(),
            base: Box::default(),
            new: Arc::clone(&new),
            holds: Holds::Anything,
            ticket: 0,
            answer_ahead: Vec::new(),
            saved_ahead: Vec::new(),
            marks: Vec::new(),
        };
        sandbox.clear_dead();
        sandbox.base = sandbox.sessions[0].memory().into();
        let globals = sandbox
            .globals(Micros::ZERO)
            .map_err(|fault| ExploreError::Module { reason: fault.to_string() })?;
        sandbox.new = Arc::new(Image::new(Vec::new(), Vec::new(), globals));
        sandbox.holds = Holds::Image(Arc::clone(&sandbox.new), Micros::ZERO);
        Ok(sandbox)
    }

    /// A new instance.
    pub(crate) fn new_image(&self) -> &Arc<Image> {
        &self.new
    }

    pub(crate) fn input_capacity(&self) -> usize {
        self.sessions[0].input_capacity()
    }

    pub(crate) fn is_held_by(&self, ticket: u64) -> bool {
        self.ticket == ticket
    }

    /// A bit for each place that was executed in here.
    pub(crate) fn marks(&mut self) -> &[u64] {
        let Self { subject, sessions: [here, _], marks, .. } = self;
        marks.resize(subject.marks.len(), 0);
        for (word, name) in marks.iter_mut().zip(&*subject.marks) {
            *word |= here.global(name).unwrap_or_default().cast_unsigned();
        }
        marks
    }

    /// Lets an image go on that was made at `now`. Whoever was here before is not any more.
    pub(crate) fn load(
        &mut self,
        image: &Arc<Image>,
        left: &Arc<Leftovers>,
        now: Micros,
    ) -> Result<u64, StepFault> {
        self.ticket += 1;
        self.left.clear(self.sessions[1].memory_mut());
        if self.sessions.iter().any(|session| session.fault().is_some()) {
            self.marks();
            let plugin = &self.subject.plugin;
            let failed = |error: LoadError| StepFault::NoInstance(error.to_string());
            let start = || plugin.instantiate().map_err(failed);
            self.sessions = [start()?, start()?];
            self.holds = Holds::Anything;
        }
        let held = match std::mem::replace(&mut self.holds, Holds::Anything) {
            Holds::Image(held, at) => Some((held, at)),
            Holds::Since(_) | Holds::Anything => None,
        };
        for (session, ahead) in self.sessions.iter_mut().zip([0, AHEAD]) {
            let memory = session.memory_mut();
            if let Some((held, at)) = &held {
                write_changes(memory, &self.base, held, image, *at == now, now.0 + ahead);
            } else {
                memory.copy_from_slice(&self.base);
                for (place, block) in &image.blocks {
                    block.write(&mut memory[bytes_of(*place)], now.0 + ahead);
                }
            }
            image.across.iter().for_each(|time| time.add(memory, now.0 + ahead));
            for (name, Word { value, is_time }) in self.subject.globals.iter().zip(&image.globals) {
                let value = if *is_time { value + now.0 + ahead } else { *value };
                session.set_global(name, value);
            }
        }
        self.left = Arc::clone(left);
        self.left.write(self.sessions[1].memory_mut());
        self.holds = Holds::Image(Arc::clone(image), now);
        Ok(self.ticket)
    }

    /// Gives an event to both instances; the answer of the first goes to `answer`.
    pub(crate) fn step(
        &mut self,
        event: &Event<'_>,
        now: Micros,
        answer: &mut Vec<u8>,
    ) -> Result<bool, StepFault> {
        self.holds = match std::mem::replace(&mut self.holds, Holds::Anything) {
            Holds::Image(image, _) | Holds::Since(image) => Holds::Since(image),
            Holds::Anything => Holds::Anything,
        };
        answer.clear();
        let Self { sessions: [here, ahead], answer_ahead, saved_ahead, .. } = self;
        let first = here.step(event, now).map(|output| {
            answer.extend_from_slice(output.actions);
            output.more
        });
        let second = ahead.step(&later(event, saved_ahead), Micros(now.0 + AHEAD)).map(|output| {
            answer_ahead.clear();
            answer_ahead.extend_from_slice(output.actions);
            output.more
        });
        if first != second || (first.is_ok() && !is_shifted(answer, answer_ahead, saved_ahead)) {
            return Err(StepFault::Differs);
        }
        Ok(first?)
    }

    /// What the first instance has come to, with times as they are ahead of `now`, and what the second
    /// one left besides.
    pub(crate) fn capture(
        &mut self,
        now: Micros,
    ) -> Result<(Arc<Image>, Arc<Leftovers>), StepFault> {
        let before = match &self.holds {
            Holds::Image(image, _) => return Ok((Arc::clone(image), Arc::clone(&self.left))),
            Holds::Since(image) => Some(Arc::clone(image)),
            Holds::Anything => None,
        };
        let left = Arc::new(Leftovers::of(self.sessions[1].memory(), &self.dead));
        self.clear_dead();
        self.left = Arc::default();
        let globals = self.globals(now)?;
        let before = before.as_deref().map_or(&[][..], |image| &image.blocks);
        let (blocks, across) = self.blocks(before, now)?;
        let image = Arc::new(Image::new(blocks, across, globals));
        self.holds = Holds::Image(Arc::clone(&image), now);
        Ok((image, left))
    }

    fn clear_dead(&mut self) {
        for session in &mut self.sessions {
            let memory = session.memory_mut();
            for range in &self.dead {
                memory[range.clone()].fill(0);
            }
        }
    }

    fn globals(&mut self, now: Micros) -> Result<Vec<Word>, StepFault> {
        let [here, ahead] = &mut self.sessions;
        let mut globals = Vec::with_capacity(self.subject.globals.len());
        for name in self.subject.globals.iter() {
            let value = here.global(name).unwrap_or_default();
            let difference = ahead.global(name).unwrap_or_default().wrapping_sub(value);
            globals.push(match difference {
                0 => Word { value, is_time: false },
                AHEAD => Word { value: value - now.0, is_time: true },
                _ => return Err(StepFault::Differs),
            });
        }
        if let Some(Stack { pointer, range }) = &self.subject.stack
            && globals[*pointer].value != range.end as i64
        {
            return Err(StepFault::Stack);
        }
        Ok(globals)
    }

    /// The blocks that differ from a new instance's; those that are as `before` are shared.
    fn blocks(
        &self,
        before: &[(u16, Arc<Block>)],
        now: Micros,
    ) -> Result<(Placed, Vec<Time>), StepFault> {
        const PAGE: usize = 16 * BLOCK;
        let [here, ahead] = &self.sessions;
        let (here, ahead) = (here.memory(), ahead.memory());
        let mut before = before.iter().peekable();
        let mut made = Blocks::new(here, ahead, now.0);
        let mut blocks = Vec::with_capacity(before.len() + 4);
        for page in (0..here.len()).step_by(PAGE) {
            let whole = page..here.len().min(page + PAGE);
            let base = &self.base[whole.clone()];
            let is_new = base == &here[whole.clone()] && base == &ahead[whole.clone()];
            if is_new && !made.goes_across(page) {
                continue;
            }
            for at in whole.step_by(BLOCK) {
                let bytes = at..at + BLOCK;
                let base = &self.base[bytes.clone()];
                let is_new = base == &here[bytes.clone()] && base == &ahead[bytes];
                if is_new && !made.goes_across(at) {
                    continue;
                }
                let place = (at / BLOCK) as u16;
                let failed = |NoTime { address }| StepFault::KeepsNoTime { address };
                let block = made.block(at).map_err(failed)?;
                while before.next_if(|(known, _)| *known < place).is_some() {}
                let known = before.next_if(|(known, _)| *known == place);
                let known = known.filter(|(_, known)| known.hash == block.hash);
                blocks.push(known.cloned().unwrap_or_else(|| (place, Arc::new(block))));
            }
        }
        Ok((blocks, made.into_across()))
    }
}

/// Writes what differs between what is `held` and `image`.
fn write_changes(
    memory: &mut [u8],
    base: &[u8],
    held: &Image,
    image: &Image,
    is_same_time: bool,
    now: i64,
) {
    let mut held = held.blocks.iter().peekable();
    let back_to_base = |memory: &mut [u8], place: u16| {
        memory[bytes_of(place)].copy_from_slice(&base[bytes_of(place)]);
    };
    for (place, block) in &image.blocks {
        while let Some((gone, _)) = held.next_if(|(known, _)| known < place) {
            back_to_base(memory, *gone);
        }
        let known = held.next_if(|(known, _)| known == place);
        let is_there = known.is_some_and(|(_, known)| Arc::ptr_eq(known, block));
        let is_as_it_was = block.is_timeless() || (is_same_time && !block.has_across);
        if !(is_there && is_as_it_was) {
            block.write(&mut memory[bytes_of(*place)], now);
        }
    }
    for (gone, _) in held {
        back_to_base(memory, *gone);
    }
}

fn bytes_of(place: u16) -> Range<usize> {
    let at = usize::from(place) * BLOCK;
    at..at + BLOCK
}

fn range(region: Region) -> Range<usize> {
    let start = region.address as usize;
    start..start + region.capacity as usize
}

/// The same event for the instance whose clock is ahead, and which saved `saved`.
fn later<'a>(event: &Event<'a>, saved: &'a [u8]) -> Event<'a> {
    match event {
        Event::Timer { id, deadline } => {
            Event::Timer { id: *id, deadline: Micros(deadline.0 + AHEAD) }
        }
        Event::Restore { format, offset, total, bytes } => {
            let start = *offset as usize;
            let bytes = saved.get(start..start + bytes.len()).unwrap_or(bytes);
            Event::Restore { format: *format, offset: *offset, total: *total, bytes }
        }
        other => other.clone(),
    }
}

/// Whether the second answer is the first with its times ahead. A state that is saved may have
/// times anywhere: the second one's goes to `saved`.
fn is_shifted(answer: &[u8], ahead: &[u8], saved: &mut Vec<u8>) -> bool {
    let (mut here, mut ahead) = (Actions::new(answer), Actions::new(ahead));
    loop {
        let is_same = match (here.next(), ahead.next()) {
            (None, None) => return true,
            (
                Some(Ok(Action::SetTimer { id, deadline })),
                Some(Ok(Action::SetTimer { id: id_ahead, deadline: deadline_ahead })),
            ) => id == id_ahead && deadline_ahead.0.wrapping_sub(deadline.0) == AHEAD,
            (
                Some(Ok(Action::Saved { format, offset, total, bytes })),
                Some(Ok(Action::Saved {
                    format: format_ahead,
                    offset: offset_ahead,
                    total: total_ahead,
                    bytes: bytes_ahead,
                })),
            ) => {
                saved.truncate(offset_ahead as usize);
                saved.extend_from_slice(bytes_ahead);
                (format, offset, total, bytes.len())
                    == (format_ahead, offset_ahead, total_ahead, bytes_ahead.len())
            }
            (one, other) => one == other,
        };
        if !is_same {
            return false;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use softplug_abi::{LineParameters, Parity};

    const ECHO: &str = include_str!("../../../fixtures/abi/echo.wat");
    /// Where echo takes what it received.
    const RECEIVED: &str = "(then (return (call $echo (local.get $len)))))";

    /// Gives two bytes one after the other to an echo that has this done with each.
    fn echoed(received: &str) -> Result<Vec<u8>, StepFault> {
        let module = wat::parse_str(ECHO.replacen(RECEIVED, received, 1)).unwrap();
        let mut sandbox = Sandbox::new(Subject::new(&module, None).unwrap()).unwrap();
        let line =
            LineParameters { baud: 9_600, data_bits: 8, parity: Parity::None, stop_half_bits: 2 };
        let open = Event::Open { resumed: false, line, transmit_room: 9, delivery_room: 9 };
        let (mut image, mut left) = (Arc::clone(sandbox.new_image()), Arc::default());
        let mut answer = Vec::new();
        for (now, event) in [open, Event::Received(b"a"), Event::Received(b"b")].iter().enumerate()
        {
            let now = Micros(now as i64);
            sandbox.load(&image, &left, now)?;
            sandbox.step(event, now, &mut answer)?;
            (image, left) = sandbox.capture(now)?;
        }
        Ok(answer)
    }

    #[test]
    fn what_is_left_in_the_mailbox_is_no_state() {
        assert_eq!(echoed(RECEIVED).unwrap()[8..], *b"b");
    }

    #[test]
    fn a_state_that_is_kept_in_the_mailbox_shows() {
        for last in [1_535, 3_071] {
            let received = format!(
                "(then
                  (if (i32.load8_u (i32.const {last})) (then (return (i32.const 0))))
                  (i32.store8 (i32.const {last}) (i32.const 7))
                  (return (call $echo (local.get $len)))))"
            );
            assert_eq!(echoed(&received).unwrap_err(), StepFault::Differs, "{last}");
        }
    }
}
