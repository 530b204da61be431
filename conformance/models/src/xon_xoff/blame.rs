//! The clause that a delivery, a request or the end of a job breaks.

use crate::demands::Blame;
use crate::model::Effect;
use softplug_abi::Failure;

pub(super) const BLAME: Blame = Blame { differing, unasked };

/// The clause of what differs in a delivery.
fn differing(demanded: &Effect, seen: &Effect) -> Option<&'static str> {
    let Effect::Delivered { id, bytes, failure, .. } = demanded else { return None };
    let Effect::Delivered { id: seen_id, bytes: seen_bytes, failure: seen_failure, .. } = seen
    else {
        return None;
    };
    if bytes != seen_bytes {
        Some("xon-xoff.rx.deliver")
    } else if id != seen_id {
        Some("xon-xoff.rx.several")
    } else {
        failure.or(*seen_failure).and_then(clause_of)
    }
}

/// The clause that comes nearest to an effect that nothing asks for.
fn unasked(effect: &Effect) -> &'static str {
    match effect {
        Effect::Failed { failure: Failure::Aborted, .. } => "xon-xoff.tx.abort-clean",
        Effect::Failed { failure, .. } => clause_of(*failure).unwrap_or("xon-xoff.tx.held-timeout"),
        Effect::Delivered { failure: Some(failure), .. } => {
            clause_of(*failure).unwrap_or("xon-xoff.rx.quiet-ends")
        }
        Effect::Delivered { .. } => "xon-xoff.rx.quiet-ends",
        Effect::Checked { .. } => "xon-xoff.tx.control-in-data",
        Effect::Done { .. } => "xon-xoff.tx.done-when-left",
        _ => "xon-xoff.rx.deliver",
    }
}

/// The clause that names a failure.
fn clause_of(failure: Failure) -> Option<&'static str> {
    Some(match failure {
        Failure::Overrun => "xon-xoff.rx.overrun",
        Failure::LineError => "xon-xoff.rx.line-error",
        Failure::NoEndMark => "xon-xoff.rx.no-end-mark",
        Failure::Aborted => "xon-xoff.rx.abort",
        Failure::LinkDown => "xon-xoff.link.down",
        Failure::Interrupted => "xon-xoff.link.close",
        Failure::HeldTooLong => "xon-xoff.tx.held-timeout",
        Failure::Busy => "xon-xoff.tx.one-job",
        Failure::UnsupportedCharacter => "xon-xoff.tx.control-in-data",
        _ => return None,
    })
}
