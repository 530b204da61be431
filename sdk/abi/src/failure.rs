//! Why a job or a delivery failed, and why a plug-in refuses an event.

use crate::code::codes;

codes! {
    /// Why a job or a delivery failed. The protocol's own status code stands
    /// beside it in the record.
    pub enum Failure: u16 {
        1 "aborted" Aborted "the host asked for it to end",
        2 "no-answer" NoAnswer "the partner did not answer in time",
        3 "refused" Refused "the partner refused it",
        4 "line-error" LineError "a character was damaged on the line",
        5 "protocol" Protocol "the partner broke the protocol",
        6 "checksum" Checksum "the check character does not match",
        7 "too-long" TooLong "longer than the protocol or a setting allows",
        8 "unsupported-character" UnsupportedCharacter "a character that cannot be sent on this link",
        9 "held-too-long" HeldTooLong "the partner held the line longer than the setting allows",
        10 "partner-reset" PartnerReset "the partner was reset",
        11 "partner-alarm" PartnerAlarm "the partner reports an alarm",
        12 "link-down" LinkDown "the port is gone or the connection is closed",
        13 "partner-gone" PartnerGone "the partner's ready line dropped",
        14 "overrun" Overrun "bytes came faster than they could be taken, some are lost",
        15 "no-end-mark" NoEndMark "reception ended without the end mark",
        16 "conflict" Conflict "both sides insisted on sending",
        17 "attempts-used-up" AttemptsUsedUp "every attempt failed",
        18 "bad-job" BadJob "the job's kind or a field of it does not fit",
        19 "not-supported" NotSupported "this plug-in or partner cannot do it",
        20 "interrupted" Interrupted "the plug-in ended in the middle; only a host reports this",
        21 "busy" Busy "another job is under way",
        22 "not-found" NotFound "what was asked for does not exist",
        23 "denied" Denied "what was asked for is not permitted",
        24 "break" Break "the partner sent a break",
        25 "echo" Echo "our own bytes came back",
        26 "no-buffer" NoBuffer "the receiver had no room in time",
        27 "parity-check" ParityCheck "a block failed its tape check",
        28 "internal" Internal "the plug-in met a state that it should not",
    }
}

codes! {
    /// Why a plug-in did not take an event: the negative results of
    /// `softplug_v1_step`, without the sign.
    pub enum Refusal: u16 {
        1 "malformed-event" MalformedEvent "the event's payload does not follow the ABI: the host is at fault",
        2 "unknown-event" UnknownEvent "the event's kind is newer than the plug-in",
        3 "settings" Settings "a setting has a value that the plug-in cannot work with",
        4 "state" State "the saved state is in a format or of a content that the plug-in cannot take",
    }
}
