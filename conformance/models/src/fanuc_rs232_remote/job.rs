//! The job under way, and the state of the dialogue.

use softplug_abi::Micros;

/// A job whose check was good.
#[derive(Clone, Debug)]
pub(super) struct Job {
    pub(super) id: u32,
    /// The encoded program.
    tape: Vec<u8>,
    /// How much of it was packed.
    at: usize,
    /// A GTD of this instant is to be answered.
    pub(super) is_asked: bool,
    /// A first DAT, or the EOD of an empty program, was packed.
    pub(super) has_begun: bool,
    /// The EOD was sent.
    pub(super) is_ended: bool,
    pub(super) is_paused: bool,
}

impl Job {
    pub(super) fn new(id: u32, tape: Vec<u8>) -> Self {
        Self {
            id,
            tape,
            at: 0,
            is_asked: false,
            has_begun: false,
            is_ended: false,
            is_paused: false,
        }
    }

    /// The data that come next, at most so many.
    pub(super) fn packet(&mut self, size: usize) -> Vec<u8> {
        let end = (self.at + size).min(self.tape.len());
        let packet = self.tape[self.at..end].to_vec();
        self.at = end;
        packet
    }

    /// Data that were not packed.
    pub(super) fn remaining(&self) -> usize {
        self.tape.len() - self.at
    }
}

/// What a message of ours was.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Said {
    Syn,
    Dat,
    Eod,
    /// An answer that has nothing of a job.
    Answer,
}

/// What both sides know of each other.
#[derive(Clone, Debug, Default)]
pub(super) struct Dialogue {
    /// The control has initialised, or answered ours.
    pub(super) is_ready: bool,
    /// Our SYN has not been answered.
    pub(super) awaits_rdy: bool,
    /// Our last message but RTY, without parity bits.
    pub(super) last: Option<(Said, Vec<u8>)>,
    /// The last job's id when that message was sent.
    pub(super) last_job: u32,
    /// Our own RTY came behind it.
    pub(super) asked_again: bool,
    /// RTY of the control in a row.
    pub(super) repeats: u32,
    /// Bad messages in a row.
    pub(super) bad: u32,
    /// From when silence counts.
    pub(super) heard: Micros,
}
