//! The remote buffer with protocol A: the control asks, we answer.
//!
//! The control's manual leaves some of it open. This project's decisions: the first
//! job begins with our SYN, unless the control has said something; after that we
//! only answer; RDY is answered by RDY, unless it answers our SYN; GTD without a job,
//! in a pause or without data is answered by WAT; a job is done when the control
//! speaks after EOD, or is silent for Tp; any other silence of Tp fails the job. Of
//! what a host may answer, RDI, SDO and CLB are not used.

mod message;
mod packet;
mod queue;

use crate::PACKET;
use crate::reason::Reason;
use crate::state::State;
use crate::tape::{Encoder, Setup};
use crate::timer::Timer;
use message::{Command, HEAD, Reader, command, end_code, head, with_parity};
use queue::Queue;
use softplug_plugin::{Context, Failure, JobId, JobStart, MarkId, MarkState};
use zerocopy::{FromZeros, Immutable, IntoBytes};

/// How often a message is repeated, or asked for again.
const MOST_REPEATS: u8 = 3;
/// Marks that may be outstanding: messages beyond them go without.
const MOST_MARKS: u8 = 64;
/// Reason in our RTY: the message was damaged.
const DAMAGED: u8 = b'1';
/// Reason in our RTY: there is no such command.
const UNKNOWN: u8 = b'2';

const DAT: Command = command(*b"DAT");
const EOD: Command = command(*b"EOD");
const GTD: Command = command(*b"GTD");
const RDY: Command = command(*b"RDY");
const RTY: Command = command(*b"RTY");
const STATUS: Command = command(*b"SET");
const SYN: Command = command(*b"SYN");
const WAT: Command = command(*b"WAT");

/// What the control says, the answer, and what it means for data that was sent.
const ANSWERS: [(Command, Command, Option<Failure>); 6] = [
    (GTD, WAT, None),
    (command(*b"SAT"), STATUS, None),
    (RDY, RDY, None),
    (SYN, RDY, Some(Failure::PartnerReset)),
    (command(*b"RST"), command(*b"ARS"), Some(Failure::PartnerReset)),
    (command(*b"ALM"), command(*b"AAL"), Some(Failure::PartnerAlarm)),
];

/// What the remote buffer is at.
#[derive(Copy, Clone, PartialEq, Eq, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(u8)]
enum Stage {
    /// No job.
    Idle,
    /// A job; its data is pulled when the control asks.
    Feeding,
    /// All data was given; the encoder is not through.
    Closing,
    /// The encoder is through; the buffer may hold something.
    Closed,
    /// EOD was sent.
    Ending,
    /// The queue is being dropped; then the job fails.
    Stopping,
}

/// What is known of the control.
#[derive(Copy, Clone, PartialEq, Eq, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(u8)]
enum Control {
    /// Nothing.
    Down,
    /// It is initialised.
    Ready,
    /// Our SYN waits for RDY.
    Initialising,
    /// It is initialised; a RDY for a SYN of ours is still to come.
    Crossing,
}

impl Control {
    fn is_ready(self) -> bool {
        matches!(self, Self::Ready | Self::Crossing)
    }

    fn awaits_rdy(self) -> bool {
        matches!(self, Self::Initialising | Self::Crossing)
    }

    /// Behind a SYN of ours.
    fn asked(self) -> Self {
        if self.is_ready() { Self::Crossing } else { Self::Initialising }
    }

    /// Behind its SYN, or a RDY that is not for ours.
    fn up(self) -> Self {
        if self.awaits_rdy() { Self::Crossing } else { Self::Ready }
    }

    /// After silence. A late RDY still is for our SYN.
    fn silent(self) -> Self {
        if self.awaits_rdy() { Self::Initialising } else { Self::Down }
    }
}

#[derive(Copy, Clone, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(C)]
pub(crate) struct RemoteBuffer {
    timer: Timer,
    /// Bytes of DAT and EOD queued for the job, repetitions included.
    queued: u64,
    job: u32,
    wanted: u32,
    queue: Queue,
    /// The latest message, in case it must be repeated.
    last: Command,
    /// Bytes of the output that the latest DAT had.
    packet: u16,
    /// Why the job fails.
    failure: Reason,
    stage: Stage,
    /// Messages that have not left: their marks are outstanding. One more than there may be:
    /// others without a mark are behind them.
    leaving: u8,
    is_paused: bool,
    control: Control,
    /// GTD is not answered yet.
    is_asked: bool,
    repeats: u8,
    retries: u8,
    spare: u8,
    reader: Reader,
}

impl RemoteBuffer {
    /// As it is before anything was said, of zeros.
    pub(crate) fn begin(&mut self) {
        self.last = WAT;
    }

    /// What people are told, if there is a job.
    pub(crate) fn state(&self) -> Option<State> {
        (self.stage != Stage::Idle).then_some(State::Answering)
    }

    pub(crate) fn set_timers(&self, link: &mut Context<'_>) {
        self.timer.resume(link, PACKET);
    }

    pub(crate) fn job_begin(
        &mut self,
        link: &mut Context<'_>,
        settings: &Setup,
        encoder: &mut Encoder,
        job: &JobStart<'_>,
    ) {
        if let Err(failure) = encoder.begin(&job.fields) {
            link.job_failed(job.job, failure, 0, 0);
            return;
        }
        self.stage = Stage::Feeding;
        self.job = job.job.0;
        self.wanted = 0;
        self.queued = 0;
        self.queue.begin();
        self.packet = 0;
        if !self.control.is_ready() {
            self.say(link, settings, encoder, SYN);
        }
        self.await_control(link, settings);
    }

    pub(crate) fn job_data(
        &mut self,
        link: &mut Context<'_>,
        settings: &Setup,
        encoder: &mut Encoder,
        bytes: &[u8],
    ) {
        self.wanted = self.wanted.saturating_sub(bytes.len() as u32);
        if self.stage != Stage::Feeding {
            return;
        }
        for byte in bytes {
            if let Err(failure) = encoder.push(settings, *byte) {
                return self.fail(link, failure);
            }
        }
        self.fill(link, settings, encoder);
    }

    pub(crate) fn job_end(
        &mut self,
        link: &mut Context<'_>,
        settings: &Setup,
        encoder: &mut Encoder,
    ) {
        if self.stage == Stage::Feeding {
            self.stage = Stage::Closing;
            self.fill(link, settings, encoder);
        }
    }

    /// Says what may have to be repeated.
    fn say(
        &mut self,
        link: &mut Context<'_>,
        settings: &Setup,
        encoder: &Encoder,
        command: Command,
    ) {
        self.last = command;
        if command == SYN {
            self.control = self.control.asked();
        }
        let packet = if command == DAT { usize::from(self.packet) } else { 0 };
        let data = encoder.output.first(packet);
        let length = transmit(link, settings, command, data, &mut self.leaving);
        self.count(length, is_own(command));
        self.await_control(link, settings);
    }

    /// A message was queued.
    fn count(&mut self, length: usize, is_own: bool) {
        // Behind a discard it is none of what that drops.
        if self.stage != Stage::Stopping {
            self.queue.push(length, is_own);
            self.queued += if is_own { length as u64 } else { 0 };
        }
    }

    /// A message has left: with the last one it is the control's turn.
    pub(crate) fn mark(&mut self, link: &mut Context<'_>, settings: &Setup, state: MarkState) {
        if state == MarkState::MaybeLeft {
            return;
        }
        let has_unmarked = self.leaving > MOST_MARKS;
        self.leaving = self.leaving.saturating_sub(1);
        if has_unmarked {
            link.transmit_marked(MarkId(1), &[]);
        }
        self.await_control(link, settings);
    }

    /// Silence counts in a job, when nothing of ours has to leave.
    fn await_control(&mut self, link: &mut Context<'_>, settings: &Setup) {
        if self.is_asked || matches!(self.stage, Stage::Idle | Stage::Stopping) {
            return;
        }
        if self.leaving > 0 {
            self.timer.stop(link, PACKET);
        } else {
            self.timer.start(link, PACKET, settings.poll_time);
        }
    }

    /// The control was silent, or the host has no data for it.
    pub(crate) fn timer(&mut self, link: &mut Context<'_>, settings: &Setup, encoder: &Encoder) {
        self.timer.has_run_out();
        if self.is_asked {
            self.give(link, settings, encoder);
        } else if self.stage == Stage::Ending {
            self.done(link);
        } else {
            self.control = self.control.silent();
            self.fail(link, Failure::NoAnswer);
        }
    }

    pub(crate) fn byte(
        &mut self,
        link: &mut Context<'_>,
        settings: &Setup,
        encoder: &mut Encoder,
        byte: u8,
    ) {
        self.await_control(link, settings);
        let Some(message) = self.reader.read(settings, byte) else { return };
        // What came before this message is answered first.
        if self.is_asked {
            self.give(link, settings, encoder);
        }
        match message {
            Ok(RTY) => {
                self.repeats += 1;
                // Where RTY answers our RTY, the control may have taken the data and
                // asked for more: data must not be carried out twice.
                let is_unsure = self.retries > 0 && self.last == DAT;
                if is_unsure || self.repeats > MOST_REPEATS {
                    self.repeats = 0;
                    self.fail(link, Failure::AttemptsUsedUp);
                } else {
                    self.say(link, settings, encoder, self.last);
                }
            }
            Ok(command) => self.message(link, settings, encoder, command),
            Err(()) => self.retry(link, settings, DAMAGED),
        }
    }

    /// Asks for the message again. Ours that may have to be repeated stays the same.
    fn retry(&mut self, link: &mut Context<'_>, settings: &Setup, reason: u8) {
        self.retries += 1;
        if self.retries > MOST_REPEATS {
            self.retries = 0;
            let is_unknown = reason == UNKNOWN;
            let failure = if is_unknown { Failure::Protocol } else { Failure::Checksum };
            self.fail(link, failure);
        } else {
            let reason = with_parity(settings, reason);
            let length = transmit(link, settings, RTY, &[reason], &mut self.leaving);
            self.count(length, false);
            self.await_control(link, settings);
        }
    }

    /// A sound message. Our latest one has come through.
    fn message(
        &mut self,
        link: &mut Context<'_>,
        settings: &Setup,
        encoder: &mut Encoder,
        command: Command,
    ) {
        self.repeats = 0;
        let Some((_, answer, failure)) = ANSWERS.iter().find(|(own, ..)| *own == command) else {
            return self.retry(link, settings, UNKNOWN);
        };
        self.retries = 0;
        let is_for_ours = command == RDY && self.control.awaits_rdy();
        if is_for_ours {
            // What we have said since may still have to be repeated.
            self.control = Control::Ready;
        } else {
            if matches!(command, SYN | RDY) {
                self.control = self.control.up();
            }
            encoder.output.drop_first(usize::from(self.packet));
            self.packet = 0;
        }
        match failure {
            Some(failure) if command == SYN => self.lost(link, *failure),
            Some(failure) => self.fail(link, *failure),
            None if self.stage == Stage::Ending => self.done(link),
            None => {}
        }
        let has_data = matches!(self.stage, Stage::Feeding | Stage::Closing | Stage::Closed);
        if command == GTD && has_data && !self.is_paused && self.control.is_ready() {
            self.is_asked = true;
            // While the data is waited for the control must hear something.
            self.timer.start(link, PACKET, settings.poll_time / 2);
            self.fill(link, settings, encoder);
        } else if !is_for_ours {
            self.say(link, settings, encoder, *answer);
        }
    }

    pub(crate) fn damaged(
        &mut self,
        link: &mut Context<'_>,
        settings: &Setup,
        encoder: &mut Encoder,
        byte: Option<u8>,
    ) {
        self.reader.damaged();
        if let Some(byte) = byte {
            self.byte(link, settings, encoder, byte);
        }
    }

    /// The port is gone: what comes back is initialised anew.
    pub(crate) fn link_down(&mut self, link: &mut Context<'_>) {
        self.control = Control::Down;
        self.reader = Reader::new_zeroed();
        self.repeats = 0;
        self.retries = 0;
        self.fail(link, Failure::LinkDown);
        self.last = WAT;
        if self.stage == Stage::Idle {
            link.discard();
        }
    }

    /// The control is gone; a job that it has not begun to read stays.
    pub(crate) fn lost(&mut self, link: &mut Context<'_>, failure: Failure) {
        if self.queued > 0 {
            self.fail(link, failure);
        }
    }

    pub(crate) fn set_paused(&mut self, is_paused: bool) {
        self.is_paused = is_paused;
    }

    fn done(&mut self, link: &mut Context<'_>) {
        link.job_done(JobId(self.job), self.queued);
        self.finish(link);
    }

    /// Stops at once. The job fails when it is known how much was sent.
    pub(crate) fn fail(&mut self, link: &mut Context<'_>, failure: Failure) {
        if matches!(self.stage, Stage::Idle | Stage::Stopping) {
            return;
        }
        self.stage = Stage::Stopping;
        self.failure = Reason::new(Some(failure));
        self.is_asked = false;
        self.forget();
        self.timer.stop(link, PACKET);
        link.discard();
    }

    /// Nothing of the job is repeated after its end.
    fn forget(&mut self) {
        if is_own(self.last) || self.last == SYN {
            self.last = WAT;
        }
        self.packet = 0;
    }

    pub(crate) fn discarded(&mut self, link: &mut Context<'_>, bytes: u32) {
        let (Stage::Stopping, Some(failure)) = (self.stage, self.failure.failure()) else { return };
        let sent = self.queued.saturating_sub(self.queue.own(bytes).into());
        link.job_failed(JobId(self.job), failure, 0, sent);
        // What the port has taken still leaves.
        let mark = mark_next(&mut self.leaving);
        link.transmit_marked(MarkId(mark), &[]);
        self.finish(link);
    }

    fn finish(&mut self, link: &mut Context<'_>) {
        self.timer.stop(link, PACKET);
        self.stage = Stage::Idle;
        self.is_paused = false;
        self.forget();
        self.queued = 0;
    }
}

/// Whether a message counts as sent for the job.
fn is_own(command: Command) -> bool {
    matches!(command, DAT | EOD)
}

/// Sends a message; its length. Without room it is lost as on the line: the control
/// asks again.
fn transmit(
    link: &mut Context<'_>,
    settings: &Setup,
    command: Command,
    data: &[u8],
    leaving: &mut u8,
) -> usize {
    let length = HEAD + data.len() + 1;
    if length > link.transmit_room() as usize {
        return 0;
    }
    link.transmit(&head(settings, command, data));
    if !data.is_empty() {
        link.transmit(data);
    }
    let mark = mark_next(leaving);
    link.transmit_marked(MarkId(mark), &[with_parity(settings, end_code(settings))]);
    length
}

/// The mark of what is sent now, if there may be another one.
fn mark_next(leaving: &mut u8) -> u32 {
    let mark = u32::from(*leaving < MOST_MARKS);
    *leaving = (*leaving + 1).min(MOST_MARKS + 1);
    mark
}

#[cfg(test)]
mod tests {
    use crate::FanucRs232;
    use softplug_plugin::JobId;
    use softplug_plugin::LineParameters;
    use softplug_plugin::bench::{Bench, Observed};

    #[test]
    fn the_control_initialises_and_asks() {
        let mut bench = Bench::<FanucRs232>::new().set("mode", "remote-a").open();
        for byte in b"07SYN\rECGTD\r" {
            bench.receive(&[*byte]);
            bench.run_for_millis(2);
        }
        bench.run_for_millis(20);
        assert_eq!(bench.sent(), b"FCRDY\rF9WAT\r");
        bench.send(b"%\nO1\nM30\n%");
        for byte in b"ECGTD\r" {
            bench.receive(&[*byte]);
            bench.run_for_millis(2);
        }
        bench.run_for_millis(50);
        assert_eq!(bench.sent(), b"FCRDY\rF9WAT\r7EDAT%\nO1\nM30\n%\r");
    }

    /// Behind a RDY, with a job; then these messages come at one instant.
    fn at_one_instant(messages: &[u8]) -> Bench<FanucRs232> {
        let mut bench = Bench::<FanucRs232>::new().set("mode", "remote-a").open();
        bench.receive(b"FCRDY\r");
        bench.run_for_millis(20);
        bench.send(b"%\nO1\nM30\n%");
        bench.receive(messages);
        bench.run_for_millis(60);
        bench
    }

    #[test]
    fn rty_behind_gtd_repeats_no_packet_without_its_data() {
        let mut bench = at_one_instant(b"ECGTD\r3DRTY1\r");
        assert_eq!(bench.sent(), b"FCRDY\rF9WAT\rF9WAT\r");
        bench.receive(b"ECGTD\r");
        bench.run_for_millis(60);
        assert!(bench.sent().ends_with(b"7EDAT%\nO1\nM30\n%\r"));
    }

    #[test]
    fn what_comes_behind_gtd_is_answered_behind_it() {
        let bench = at_one_instant(b"ECGTD\rF5SAT\r");
        assert_eq!(bench.sent(), b"FCRDY\rF9WAT\rF9SET\r");
        // No data leaves behind a reset.
        let bench = at_one_instant(b"ECGTD\r06RST\r");
        assert!(bench.sent().ends_with(b"F3ARS\r"));
    }

    fn has_failed(bench: &Bench<FanucRs232>) -> bool {
        bench.observed().iter().any(|(_, seen)| matches!(seen, Observed::Failed { .. }))
    }

    #[test]
    fn silence_counts_from_the_last_of_many_answers() {
        let mut bench = Bench::<FanucRs232>::new().set("mode", "remote-a").open();
        bench.receive(b"FCRDY\r");
        bench.run_for_millis(20);
        bench.send(b"%\nO1\nM30\n%");
        // 170 answers of six characters, of which 64 have a mark: 1,063 ms at 9,600 baud.
        bench.receive(&b"F5SAT\r".repeat(170));
        bench.run_for_millis(6_000);
        assert_eq!(bench.sent().len(), 171 * 6);
        assert!(!has_failed(&bench), "5,000 ms are not over");
        bench.run_for_millis(100);
        assert!(has_failed(&bench));
    }

    #[test]
    fn silence_counts_from_what_the_port_still_holds_of_a_job_before() {
        let line = LineParameters::new(300);
        let options = Bench::<FanucRs232>::new().set("mode", "remote-a").set("poll_time", "100");
        let mut bench = options.line(line).depth(16).open();
        bench.receive(b"FCRDY\r");
        bench.run_for_millis(500);
        bench.send(b"%\nO1\nM30\n%");
        bench.receive(b"ECGTD\r");
        bench.run_for_millis(40);
        bench.host(|link, now, host| link.abort(now, JobId(1), host));
        bench.send(b"%\nO2\nM30\n%");
        // Some 15 characters of 33 ms have still to leave.
        bench.run_for_millis(450);
        let failed = |bench: &Bench<FanucRs232>| {
            let has_failed = |(_, seen): &&(_, Observed)| matches!(seen, Observed::Failed { .. });
            bench.observed().iter().filter(has_failed).count()
        };
        assert_eq!(failed(&bench), 1, "the abort alone");
        bench.run_for_millis(300);
        assert_eq!(failed(&bench), 2);
    }
}
