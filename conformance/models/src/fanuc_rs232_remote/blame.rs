//! The clause that a delivery, a request or the end of a job breaks.

use crate::demands::Blame;
use crate::model::Effect;
use softplug_abi::Failure;

pub(super) const BLAME: Blame = Blame { differing: |_, _| None, unasked };

/// The clause that comes nearest to an effect that nothing asks for.
fn unasked(effect: &Effect) -> &'static str {
    match effect {
        Effect::Failed { failure: Failure::Aborted, .. } => "fanuc-rs232.remote.abort",
        Effect::Failed { failure: Failure::PartnerReset, .. } => "fanuc-rs232.remote.reset",
        Effect::Failed { failure: Failure::PartnerAlarm, .. } => "fanuc-rs232.remote.alarm",
        Effect::Failed { failure: Failure::PartnerGone, .. } => "fanuc-rs232.feed.dsr",
        Effect::Failed { failure: Failure::AttemptsUsedUp, .. } => "fanuc-rs232.remote.repeat",
        Effect::Failed { failure: Failure::Checksum | Failure::Protocol, .. } => {
            "fanuc-rs232.remote.ask-again"
        }
        Effect::Failed { failure: Failure::LinkDown, .. } => "fanuc-rs232.link.down",
        Effect::Failed { failure: Failure::Busy, .. } => "fanuc-rs232.feed.one-job",
        Effect::Failed { .. } => "fanuc-rs232.remote.silence",
        Effect::Checked { .. } => "fanuc-rs232.tape.unsupported",
        Effect::Done { .. } => "fanuc-rs232.remote.end",
        _ => "fanuc-rs232.remote.sum",
    }
}
