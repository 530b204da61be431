//! The lathe: keeps the queue filled with pulses, block by block.

use crate::block::{Bad, Block, Motion, Next, restore_option, save_option};
use crate::cut::Cut;
use crate::line::Line;
use crate::program::Program;
use crate::queued::Queued;
use crate::said::Said;
use crate::settings::{Settings, Underrun};
use crate::stage::Stage;
use crate::thread::Thread;
use crate::{ECHO, TICK, codes, status};
use softplug_plugin::{
    Context, Failure, JobId, MarkId, MarkState, Micros, StateReader, StateWriter,
};

/// Bytes that are queued at a time.
const PIECE: usize = 256;
/// Marks under way at most: a power of two.
const MARKS: usize = 16;
/// Beyond so many, bytes are queued without one.
const MARKS_OF_PIECES: u32 = 8;
/// A byte each.
const PERIOD: Micros = Micros(250);
/// Pulses of a thread that may wait in the queue.
const THREAD_WAITS: u32 = 32;
/// Blocks at a time of which nothing was sent.
const BLOCKS_AT_A_TIME: u32 = 64;
/// Steps of arcs at a time in the blocks before the first one, and what one of these costs.
const STEPS_AT_A_TIME: u32 = 1_000;
const STEPS_A_BLOCK: u32 = 50;
/// After so much else has had its turn.
const PAUSE: Micros = Micros::from_millis(1);
/// No way of one cut is longer, in pulses.
const FARTHEST: i64 = 1 << 30;

/// The lathe, as the computer sees it.
#[derive(Clone, Debug)]
pub(crate) struct Lathe {
    pub(crate) settings: Settings,
    pub(crate) program: Program,
    pub(crate) queued: Queued,
    pub(crate) stage: Stage,
    pub(crate) job: JobId,
    /// Asked for and not yet given.
    pub(crate) wanted: u32,
    /// Bytes that the queue holds.
    capacity: u32,
    /// The mark that was set last, the last one that was told of, and the last one before the job.
    pub(crate) mark: MarkId,
    pub(crate) seen: MarkId,
    pub(crate) mark_before: MarkId,
    /// How many bytes of the job stand before each of the marks under way.
    before: [u64; MARKS],
    /// Bytes of the job that may have left.
    pub(crate) left: u64,
    /// When bytes were queued last, and how many were there before that instant. Not saved.
    queued_at: (Micros, u64),
    pub(crate) block: Block,
    /// What of the block comes next.
    pub(crate) step: u8,
    pub(crate) cut: Option<Cut>,
    /// Periods of a dwell to go.
    pub(crate) dwell: u32,
    thread: Thread,
    /// When the pulses of the thread so far will have left.
    until: Micros,
    /// In force at the machine.
    pub(crate) speed: Option<u8>,
    pub(crate) tool: Option<u8>,
    pub(crate) offset: (i32, i32),
    pub(crate) is_paused: bool,
    /// By the operator.
    pub(crate) is_held: bool,
    /// Whether the queue is held for either reason.
    is_holding: bool,
    pub(crate) said: Said,
    pub(crate) underruns: u32,
    /// Where the blocks before the first one end.
    pub(crate) rebuilt: (i64, i64),
    /// When the timers run out.
    timers: [Option<Micros>; 2],
}

/// What follows a part of a block.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Then {
    /// The next part.
    GoOn,
    /// Nothing, before something else happens.
    Wait,
    /// What was queued leaves first.
    Enter(Stage),
    /// The program cannot be read.
    Fail(Bad),
}

impl Lathe {
    pub(crate) fn new(settings: Settings) -> Self {
        Self {
            settings,
            program: Program::new(settings.input),
            queued: Queued::new(),
            stage: Stage::Idle,
            job: JobId::NONE,
            wanted: 0,
            capacity: 0,
            mark: MarkId::NONE,
            seen: MarkId::NONE,
            mark_before: MarkId::NONE,
            before: [0; MARKS],
            left: 0,
            queued_at: (Micros::ZERO, 0),
            block: Block::default(),
            step: 0,
            cut: None,
            dwell: 0,
            thread: Thread::new(false, 0, 1, 1),
            until: Micros::ZERO,
            speed: None,
            tool: None,
            offset: (0, 0),
            is_paused: false,
            is_held: false,
            is_holding: false,
            said: Said::default(),
            underruns: 0,
            rebuilt: (0, 0),
            timers: [None, None],
        }
    }

    pub(crate) fn opened(&mut self, link: &mut Context<'_>, is_resumed: bool) {
        if !is_resumed {
            self.capacity = link.transmit_room();
            return;
        }
        for (id, deadline) in [ECHO, TICK].into_iter().zip(self.timers) {
            if let Some(deadline) = deadline {
                link.set_timer(id, deadline);
            }
        }
        self.work(link);
    }

    fn set_timer(&mut self, link: &mut Context<'_>, id: u8, span: Micros) {
        let deadline = link.now() + span;
        link.set_timer(id, deadline);
        if let Some(timer) = self.timers.get_mut(usize::from(id)) {
            *timer = Some(deadline);
        }
    }

    pub(crate) fn cancel(&mut self, link: &mut Context<'_>, id: u8) {
        if self.ran_out(id) {
            link.cancel_timer(id);
        }
    }

    /// Whether the timer was set; it is no more.
    pub(crate) fn ran_out(&mut self, id: u8) -> bool {
        self.timers.get_mut(usize::from(id)).is_some_and(|timer| timer.take().is_some())
    }

    /// Bytes that wait in the queue, as far as marks and room tell.
    fn waiting(&self, link: &Context<'_>) -> u32 {
        let behind = self.queued.count.saturating_sub(self.left);
        let taken = self.capacity.saturating_sub(link.transmit_room());
        behind.min(u64::from(taken)) as u32
    }

    /// Queues bytes that are counted already. A mark tells when they have left.
    fn send(&mut self, link: &mut Context<'_>, bytes: &[u8], must_mark: bool) {
        if self.queued_at.0 != link.now() {
            self.queued_at = (link.now(), self.queued.count - bytes.len() as u64);
        }
        if must_mark || self.mark.0.wrapping_sub(self.seen.0) < MARKS_OF_PIECES {
            self.mark = self.mark.next();
            if let Some(before) = self.before.get_mut(self.mark.0 as usize % MARKS) {
                *before = self.queued.count;
            }
            link.transmit_marked(self.mark, bytes);
        } else {
            link.transmit(bytes);
        }
    }

    /// How many bytes stand before a mark under way.
    fn before(&self, mark: MarkId) -> u64 {
        self.before.get(mark.0 as usize % MARKS).copied().unwrap_or_default()
    }

    /// Does what can be done now.
    pub(crate) fn work(&mut self, link: &mut Context<'_>) {
        if self.timers[usize::from(TICK)].is_some() {
            return;
        }
        if self.stage == Stage::Rebuilding {
            self.rebuild(link);
        }
        let most = self.settings.bytes_ahead().min(self.capacity);
        let piece = (most / 4).max(1);
        while self.stage == Stage::Running
            && most.saturating_sub(self.waiting(link)).min(link.transmit_room()) >= piece
            && self.fill(link, (piece as usize).min(PIECE))
        {}
    }

    /// Queues up to `most` bytes. Returns whether it can go on at once.
    fn fill(&mut self, link: &mut Context<'_>, most: usize) -> bool {
        let mut piece = [0; PIECE];
        let (mut filled, mut blocks) = (0, 0);
        let then = loop {
            let Some(free) = piece.get_mut(filled).filter(|_| filled < most) else {
                break Then::GoOn;
            };
            if let Some(byte) = self.pulses() {
                *free = byte;
                self.queued.put(byte);
                filled += 1;
                continue;
            }
            blocks += u32::from(self.step == 0);
            if blocks > BLOCKS_AT_A_TIME {
                self.set_timer(link, TICK, PAUSE);
                break Then::Wait;
            }
            let (code, then) = self.advance();
            if let Some(code) = code {
                *free = code;
                self.queued.put(code);
                filled += 1;
            }
            if then != Then::GoOn {
                break then;
            }
        };
        let bytes = piece.get(..filled).unwrap_or_default();
        let is_entered = matches!(then, Then::Enter(_));
        if filled > 0 || is_entered {
            self.send(link, bytes, is_entered);
        }
        match then {
            Then::GoOn => true,
            Then::Wait => {
                self.ask(link);
                false
            }
            Then::Enter(stage) => {
                self.stage = stage;
                false
            }
            Then::Fail(bad) => {
                self.stop(link, Failure::BadJob, bad.status);
                false
            }
        }
    }

    /// The next byte of what moves.
    fn pulses(&mut self) -> Option<u8> {
        if let Some(cut) = &mut self.cut {
            if let Some(byte) = cut.period() {
                return Some(byte);
            }
            self.cut = None;
        }
        self.dwell = self.dwell.checked_sub(1)?;
        Some(0)
    }

    /// Begins the next part of a block: a command, or what moves.
    fn advance(&mut self) -> (Option<u8>, Then) {
        let step = self.step;
        self.step += 1;
        match step {
            0 => self.fetch(),
            1 => {
                let is_new = self.block.speed.is_some() && self.block.speed != self.speed;
                self.speed = self.block.speed.or(self.speed);
                command(codes::SPEED, self.speed.filter(|_| is_new))
            }
            2 => {
                let is_new = self.block.tool.is_some() && self.block.tool != self.tool;
                self.tool = self.block.tool.or(self.tool);
                command(codes::TOOL, self.tool.filter(|_| is_new))
            }
            3 => {
                let function = self.block.function;
                command(codes::FUNCTION, Some(function).filter(|function| *function != 0))
            }
            4..=7 => (None, self.begin_cut(step)),
            8 => {
                self.dwell = self.block.dwell;
                (None, Then::GoOn)
            }
            _ => {
                self.step = 0;
                let is_single = self.settings.single_block;
                (
                    None,
                    if is_single {
                        Then::Enter(Stage::Single { has_left: false })
                    } else {
                        Then::GoOn
                    },
                )
            }
        }
    }

    /// The next block.
    fn fetch(&mut self) -> (Option<u8>, Then) {
        let next = self.program.next(&self.settings);
        if let Ok(Next::Block(block)) = next {
            self.block = block;
            return (None, Then::GoOn);
        }
        self.step = 0;
        match next {
            Ok(Next::End) => (Some(codes::END), Then::Enter(Stage::Ending)),
            Ok(Next::Text) => (None, Then::Wait),
            Ok(Next::Nothing | Next::Block(_)) => (None, Then::GoOn),
            Err(bad) => (None, Then::Fail(bad)),
        }
    }

    /// The offset in x and in z, then the motion in two parts.
    fn begin_cut(&mut self, step: u8) -> Then {
        let is_zero = matches!(self.block.motion, Motion::Zero { .. });
        let tool = self.tool.filter(|_| self.block.with_offset).unwrap_or(0);
        let wanted = self.settings.offset(tool);
        match (step, self.block.motion) {
            (4, _) if !is_zero => {
                let way = wanted.0 - self.offset.0;
                self.offset.0 = wanted.0;
                self.travel(way, 0);
            }
            (5, _) if !is_zero => {
                let way = wanted.1 - self.offset.1;
                self.offset.1 = wanted.1;
                self.travel(0, way);
            }
            (6, Motion::Cut(path)) => self.cut = Some(Cut::new(path, self.block.feed)),
            (6, Motion::Thread(thread)) if !thread.is_over() => {
                self.thread = thread;
                return Then::Enter(Stage::Index { has_left: false });
            }
            (6, Motion::Zero { x: true, .. }) => {
                self.offset.0 = 0;
                self.travel(back(self.queued.x), 0);
            }
            (7, Motion::Zero { z: true, .. }) => {
                self.offset.1 = 0;
                self.travel(0, back(self.queued.z));
            }
            (6, Motion::Way { z, .. }) => self.travel(0, z),
            (7, Motion::Way { x, .. }) => self.travel(x, 0),
            _ => {}
        }
        Then::GoOn
    }

    fn travel(&mut self, x: i32, z: i32) {
        self.cut = Some(Cut::line(Line::between(x, z), self.block.travel));
    }

    /// Goes through the blocks before the first one.
    fn rebuild(&mut self, link: &mut Context<'_>) {
        let mut steps = STEPS_AT_A_TIME;
        loop {
            if let Some(cut) = &mut self.cut {
                if cut.skip(&mut steps, &mut self.rebuilt).is_none() {
                    break;
                }
                self.cut = None;
            }
            if self.program.is_at_start(&self.settings) {
                self.begin_behind();
                return;
            }
            let Some(left) = steps.checked_sub(STEPS_A_BLOCK) else { break };
            steps = left;
            match self.program.next(&self.settings) {
                Ok(Next::Block(block)) => self.pass_over(block),
                Ok(Next::Nothing) => {}
                Ok(Next::Text) => {
                    self.ask(link);
                    return;
                }
                Ok(Next::End) => {
                    self.stop(link, Failure::BadJob, status::NO_SUCH_BLOCK);
                    return;
                }
                Err(bad) => {
                    self.stop(link, Failure::BadJob, bad.status);
                    return;
                }
            }
        }
        self.set_timer(link, TICK, PAUSE);
    }

    /// A block before the first one: only where it ends, and what it leaves in force.
    fn pass_over(&mut self, block: Block) {
        let function = if block.function == 0 { self.block.function } else { block.function };
        self.block = Block { function, ..block };
        match block.motion {
            Motion::Nothing | Motion::Way { .. } => {}
            Motion::Cut(path) => self.cut = Some(Cut::new(path, block.feed)),
            Motion::Thread(thread) => self.rebuilt.1 += thread.rest(),
            Motion::Zero { x, z } => {
                let (own_x, own_z) = &mut self.rebuilt;
                *own_x = if x { 0 } else { *own_x };
                *own_z = if z { 0 } else { *own_z };
            }
        }
    }

    /// The first block comes next: S, T, M and the way there are a block of their own.
    fn begin_behind(&mut self) {
        let way = |to: i64, from: i64| (to - from).clamp(-FARTHEST, FARTHEST) as i32;
        let motion = Motion::Way {
            x: way(self.rebuilt.0, self.queued.x),
            z: way(self.rebuilt.1, self.queued.z),
        };
        self.block = Block { motion, with_offset: false, dwell: 0, ..self.block };
        self.step = 1;
        self.stage = Stage::Running;
    }

    /// News of a marked byte: of the last one that was queued.
    pub(crate) fn marked(&mut self, link: &mut Context<'_>, mark: MarkId, state: MarkState) {
        let is_said = self.said.marked(mark, state);
        let is_old = state == MarkState::Dropped || mark <= self.mark_before;
        if is_said || is_old || !self.stage.is_under_way() {
            return;
        }
        self.seen = mark;
        self.left = self.left.max(self.before(mark));
        if state == MarkState::SurelyLeft && self.ran_empty(link.now(), self.before(mark)) {
            self.underrun(link);
            if self.settings.underrun == Underrun::Stop {
                self.stop(link, Failure::Overrun, status::UNDERRUN);
                return;
            }
        }
        if self.left == self.queued.count {
            self.all_left(link, state);
        } else if mark == self.mark {
            self.send(link, &[], true);
        }
        self.work(link);
    }

    /// Whether all that was queued before this instant has left, and another byte had to follow:
    /// what was queued in this instant comes too late. Once for each place.
    fn ran_empty(&mut self, now: Micros, left: u64) -> bool {
        let has_new = self.queued_at.0 == now;
        let end = if has_new { self.queued_at.1 } else { self.queued.count };
        let is_empty = left == end && self.queued.follows(end);
        if is_empty {
            self.queued_at = (now, u64::MAX);
        }
        is_empty
    }

    /// All that was queued may have left, or has.
    fn all_left(&mut self, link: &mut Context<'_>, state: MarkState) {
        let surely = state == MarkState::SurelyLeft;
        match &mut self.stage {
            Stage::Echo { may_have_left, .. } => {
                *may_have_left = true;
                if surely {
                    let span = Micros::from_millis(self.settings.echo_time);
                    self.set_timer(link, ECHO, span);
                }
            }
            Stage::Single { has_left } | Stage::Index { has_left } => *has_left |= surely,
            Stage::Ending if surely => self.done(link),
            _ => {}
        }
    }

    /// Characters of the machine.
    pub(crate) fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        let mut pulses = 0;
        for byte in bytes {
            match *byte {
                turn @ ..=0x7F => pulses += self.turned(turn),
                code @ 0x80..=0xDF => self.echo(link, code),
                codes::KEY_HOLD => self.is_held = self.stage.is_under_way(),
                codes::KEY_START => {
                    self.is_held = false;
                    self.go(link);
                }
                codes::KEY_STOP => self.stop(link, Failure::Refused, status::OPERATOR),
                limit if codes::LIMITS.contains(&limit) => {
                    self.stop(link, Failure::PartnerAlarm, status::LIMIT);
                }
                _ => {}
            }
            if pulses > 0 {
                self.queue_thread(link, core::mem::take(&mut pulses));
            }
            self.update_hold(link);
        }
        self.work(link);
    }

    fn turned(&mut self, turn: u8) -> u32 {
        match self.stage {
            Stage::Index { has_left: true } if turn & codes::INDEX != 0 && !self.is_holding => {
                self.stage = Stage::Thread;
                self.until = Micros::ZERO;
                0
            }
            Stage::Thread => self.thread.turned(u32::from(turn & codes::INCREMENTS)),
            _ => 0,
        }
    }

    fn queue_thread(&mut self, link: &mut Context<'_>, pulses: u32) {
        // Nothing else is in the queue: how much of it has left is a matter of time.
        let begin = self.until.max(link.now());
        let waits = (begin - link.now()).0.unsigned_abs().div_ceil(PERIOD.0.unsigned_abs());
        if pulses > THREAD_WAITS.saturating_sub(waits as u32).min(link.transmit_room()) {
            self.stop(link, Failure::Overrun, status::FAST_SPINDLE);
            return;
        }
        let bytes = [self.thread.pulse(); THREAD_WAITS as usize];
        for byte in bytes.iter().take(pulses as usize) {
            self.queued.put(*byte);
        }
        self.until = begin + Micros(PERIOD.0 * i64::from(pulses));
        self.send(link, bytes.get(..pulses as usize).unwrap_or_default(), false);
        if self.thread.is_over() {
            self.stage = Stage::Running;
        }
    }

    fn echo(&mut self, link: &mut Context<'_>, code: u8) {
        if self.stage == (Stage::Echo { code, may_have_left: true }) {
            self.cancel(link, ECHO);
            self.stage = Stage::Running;
        }
    }

    /// A start, of the operator or the host.
    pub(crate) fn go(&mut self, link: &mut Context<'_>) {
        if self.stage == (Stage::Single { has_left: true }) {
            self.stage = Stage::Running;
        }
        self.update_hold(link);
        self.work(link);
    }

    /// Holds the queue, or lets it go on. A thread cannot stand still, and behind a program's last
    /// byte there is nothing to hold.
    pub(crate) fn update_hold(&mut self, link: &mut Context<'_>) {
        let may_hold = match self.stage {
            Stage::Idle | Stage::Thread | Stage::Stopping(..) => false,
            Stage::Ending => self.waiting(link) > 0,
            _ => true,
        };
        let is_holding = (self.is_paused || self.is_held) && may_hold;
        if is_holding == self.is_holding {
            return;
        }
        self.is_holding = is_holding;
        if is_holding {
            link.hold();
            self.said.hold(link);
        } else {
            link.release();
        }
    }

    pub(crate) fn save(&self, state: &mut StateWriter<'_>) {
        self.stage.save(state);
        let (job, mark) = (self.job.0, self.mark.0);
        for value in [job, self.wanted, self.capacity, mark, self.dwell, self.underruns] {
            state.u32(value);
        }
        self.block.save(state);
        state.u8(self.step);
        state.bool(self.cut.is_some());
        if let Some(cut) = &self.cut {
            cut.save(state);
        }
        self.thread.save(state);
        state.micros(self.until);
        state.u32(self.seen.0);
        state.u32(self.mark_before.0);
        for before in self.before {
            state.u64(before);
        }
        state.u64(self.left);
        save_option(state, self.speed);
        save_option(state, self.tool);
        state.u32(self.offset.0.cast_unsigned());
        state.u32(self.offset.1.cast_unsigned());
        state.bool(self.is_paused);
        state.bool(self.is_held);
        state.bool(self.is_holding);
        self.said.save(state);
        state.u64(self.rebuilt.0.cast_unsigned());
        state.u64(self.rebuilt.1.cast_unsigned());
        for timer in self.timers {
            state.deadline(timer);
        }
        self.queued.save(state);
        self.program.save(state);
    }

    pub(crate) fn restore(&mut self, state: &mut StateReader<'_>) {
        self.stage = Stage::restore(state);
        self.job = JobId(state.u32());
        self.wanted = state.u32();
        self.capacity = state.u32();
        self.mark = MarkId(state.u32());
        self.dwell = state.u32();
        self.underruns = state.u32();
        self.block = Block::restore(state);
        self.step = state.u8();
        self.cut = state.bool().then(|| Cut::restore(state));
        self.thread = Thread::restore(state);
        self.until = state.micros();
        self.seen = MarkId(state.u32());
        self.mark_before = MarkId(state.u32());
        self.before = [0; MARKS].map(|_: u64| state.u64());
        self.left = state.u64();
        self.speed = restore_option(state);
        self.tool = restore_option(state);
        self.offset = (state.u32().cast_signed(), state.u32().cast_signed());
        self.is_paused = state.bool();
        self.is_held = state.bool();
        self.is_holding = state.bool();
        self.said = Said::restore(state);
        self.rebuilt = (state.u64().cast_signed(), state.u64().cast_signed());
        self.timers = [state.deadline(), state.deadline()];
        self.queued.restore(state);
        self.program.restore(state);
    }
}

/// From here to zero.
fn back(position: i64) -> i32 {
    (-position).clamp(-FARTHEST, FARTHEST) as i32
}

/// A command, and what follows it.
fn command(kind: u8, value: Option<u8>) -> (Option<u8>, Then) {
    match value {
        Some(value) => {
            let code = kind | value;
            (Some(code), Then::Enter(Stage::Echo { code, may_have_left: false }))
        }
        None => (None, Then::GoOn),
    }
}
