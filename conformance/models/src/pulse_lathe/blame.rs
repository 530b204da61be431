//! Which clause is broken.

use super::Lathe;
use super::run::Stage;
use crate::demands::Blame;
use crate::model::Effect;
use softplug_abi::Failure;

pub(super) const BLAME: Blame = Blame { differing: |_, _| None, unasked };

fn unasked(effect: &Effect) -> &'static str {
    match effect {
        Effect::Checked { status: 11..=18, .. } => "pulse-lathe.iso.refused",
        Effect::Checked { .. } => "pulse-lathe.words.refused",
        Effect::Failed { failure, .. } => match failure {
            Failure::NoAnswer => "pulse-lathe.line.echo-time",
            Failure::LinkDown => "pulse-lathe.link.down",
            Failure::Overrun => "pulse-lathe.cut.thread-fast",
            Failure::PartnerAlarm => "pulse-lathe.run.limit",
            Failure::Busy => "pulse-lathe.run.one-job",
            Failure::Interrupted => "pulse-lathe.link.close",
            _ => "pulse-lathe.run.stop",
        },
        _ => "pulse-lathe.line.end",
    }
}

impl Lathe {
    /// The clause that a byte breaks which had not to leave now.
    pub(super) fn clause_of(&self, byte: u8) -> &'static str {
        let Some(job) = &self.job else { return "pulse-lathe.run.stop" };
        if byte == 0xE0 || job.is_holding {
            return "pulse-lathe.run.hold";
        }
        match job.sent.get(job.begun) {
            Some((_, clause)) => clause,
            None => waits(job.stage),
        }
    }

    /// The clause that silence breaks.
    pub(super) fn clause_of_silence(&self) -> &'static str {
        if self.port.urgent() > 0 {
            return "pulse-lathe.run.hold";
        }
        let Some(job) = &self.job else { return "pulse-lathe.run.stop" };
        job.sent.get(job.begun).map_or_else(|| waits(job.stage), |(_, clause)| clause)
    }
}

fn waits(stage: Stage) -> &'static str {
    match stage {
        Stage::Sending | Stage::Ending => "pulse-lathe.line.end",
        Stage::Echo { .. } => "pulse-lathe.line.echo",
        Stage::Single => "pulse-lathe.run.single-block",
        Stage::Index { .. } => "pulse-lathe.cut.index",
        Stage::Thread { .. } => "pulse-lathe.cut.thread",
    }
}
