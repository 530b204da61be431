//! The clause that a delivery, a request or the end of a job breaks.

use crate::demands::Blame;
use crate::model::Effect;
use softplug_abi::Failure;

pub(super) const BLAME: Blame = Blame { differing, unasked };

/// The clause of what differs.
fn differing(demanded: &Effect, seen: &Effect) -> Option<&'static str> {
    match (demanded, seen) {
        (
            Effect::Delivered { bytes, name, failure, .. },
            Effect::Delivered { bytes: seen_bytes, name: seen_name, failure: seen_failure, .. },
        ) => {
            if bytes != seen_bytes {
                Some("fanuc-rs232.punch.dc2-dc4")
            } else if name != seen_name {
                Some("fanuc-rs232.punch.name")
            } else if failure != seen_failure {
                failure.or(*seen_failure).and_then(capture_clause)
            } else {
                None
            }
        }
        (Effect::Checked { failure, .. }, Effect::Checked { failure: seen, .. }) => {
            failure.or(*seen).map(check_clause)
        }
        (Effect::Requested { fields, .. }, Effect::Requested { fields: seen, .. }) => {
            (fields != seen).then_some("fanuc-rs232.request.number")
        }
        _ => None,
    }
}

/// The clause that comes nearest to an effect that nothing asks for.
fn unasked(effect: &Effect) -> &'static str {
    match effect {
        Effect::Failed { failure, .. } => job_clause(*failure),
        Effect::Delivered { failure: Some(failure), .. } => {
            capture_clause(*failure).unwrap_or("fanuc-rs232.punch.dc2-dc4")
        }
        Effect::Delivered { .. } => "fanuc-rs232.punch.dc2-dc4",
        Effect::Checked { failure: Some(failure), .. } => check_clause(*failure),
        Effect::Checked { .. } => "fanuc-rs232.tape.unsupported",
        Effect::Done { .. } => "fanuc-rs232.feed.done-when-left",
        Effect::Requested { .. } => "fanuc-rs232.request.program",
        Effect::Withdrawn(_) => "fanuc-rs232.request.answer",
        Effect::ModemLines(..) => "fanuc-rs232.punch.flow-rts",
        Effect::Break(_) | Effect::Byte(_) => "fanuc-rs232.feed.wait-dc1",
    }
}

fn check_clause(failure: Failure) -> &'static str {
    match failure {
        Failure::NotFound => "fanuc-rs232.feed.from-block",
        Failure::BadJob => "fanuc-rs232.tape.after-end",
        _ => "fanuc-rs232.tape.unsupported",
    }
}

/// The clause that names the failure of a job.
fn job_clause(failure: Failure) -> &'static str {
    match failure {
        Failure::NoAnswer => "fanuc-rs232.feed.dc1-timeout",
        Failure::HeldTooLong => "fanuc-rs232.feed.held-timeout",
        Failure::PartnerReset => "fanuc-rs232.feed.reset",
        Failure::PartnerAlarm => "fanuc-rs232.feed.alarm",
        Failure::PartnerGone => "fanuc-rs232.feed.dsr",
        Failure::LinkDown => "fanuc-rs232.link.down",
        Failure::Busy => "fanuc-rs232.feed.one-job",
        _ => "fanuc-rs232.feed.abort-clean",
    }
}

/// The clause that names the failure of a capture.
fn capture_clause(failure: Failure) -> Option<&'static str> {
    Some(match failure {
        Failure::Overrun => "fanuc-rs232.punch.overrun",
        Failure::LineError => "fanuc-rs232.punch.line-error",
        Failure::ParityCheck => "fanuc-rs232.punch.tv-check",
        Failure::NoEndMark => "fanuc-rs232.punch.no-end-mark",
        Failure::PartnerReset => "fanuc-rs232.punch.reset",
        Failure::PartnerAlarm => "fanuc-rs232.punch.alarm",
        Failure::PartnerGone => "fanuc-rs232.punch.dsr",
        Failure::Aborted => "fanuc-rs232.punch.abort",
        Failure::LinkDown => "fanuc-rs232.link.down",
        Failure::Interrupted => "fanuc-rs232.link.close",
        _ => return None,
    })
}
