//! What a host does.

use super::Guess;
use super::programs::program;
use crate::dice::Dice;
use crate::model::{HostRequest, Proposal};
use crate::propose::host;

impl Guess<'_> {
    /// Something of a host that is not usual.
    pub(super) fn host(&self, dice: &mut Dice) -> Proposal {
        let Some(job) = &self.model.job else { return self.job(dice) };
        let wait = if dice.one_in(2) { self.within(dice) } else { self.pause(dice) };
        if job.is_paused && !dice.one_in(3) {
            return host(wait, HostRequest::Resume(job.id));
        }
        match dice.below(12) {
            0..=2 => host(wait, HostRequest::Pause(job.id)),
            3 => host(wait, HostRequest::Resume(job.id)),
            4 | 5 => host(wait, HostRequest::Abort(job.id)),
            6 => host(wait, HostRequest::Abort(0)),
            7 => host(wait, HostRequest::ForceResume),
            8 => self.job(dice),
            _ => self.control_speaks(dice),
        }
    }

    /// A job, mostly one that can be sent.
    pub(super) fn job(&self, dice: &mut Dice) -> Proposal {
        let data = program(dice);
        let fields = if dice.one_in(3) { fields(dice) } else { Vec::new() };
        let (id, kind) = (self.model.jobs + 1, "send".to_owned());
        let wait = if dice.one_in(6) { self.within(dice) } else { self.pause(dice) };
        host(wait, HostRequest::Job { id, kind, fields, data })
    }
}

fn fields(dice: &mut Dice) -> Vec<(String, String)> {
    let mut fields = Vec::new();
    let mut field = |name: &str, value: String| fields.push((name.to_owned(), value));
    let number = match dice.below(12) {
        0 => *dice.pick(&[0, -1, 1_000, 4_294_967_295, 4_294_967_296]),
        _ => dice.between(1, 5),
    };
    match dice.below(8) {
        0..=2 => field("from_block", number.to_string()),
        3 => field("from_line", number.to_string()),
        4..=6 => field("from_sequence", (number * *dice.pick(&[10, 10, 10, 1])).to_string()),
        _ => {}
    }
    if dice.one_in(3) {
        let long = ["X1\n".repeat(133), "A".repeat(400)];
        let all: &[&str] = &[
            "T1M6",
            "T1M6\nG0Z50",
            "G90\n",
            "g90\r\nM3",
            "",
            "\n",
            "(A",
            "(AB)C",
            "N7G1\nX2",
            "_",
            "G1;",
            "%",
            "(%)",
            "\n\nA\n\n",
            "A~B",
            "ab_",
            "X\n_",
            "A\rB",
            "\nT1\r",
            "\r",
            &long[0],
            &long[1],
        ];
        field("preamble", (*dice.pick(all)).to_owned());
    }
    fields
}
