//! The clauses that characters of ours break.

use super::Fanuc;
use super::rules::Code;

impl Fanuc {
    /// The clause that a character breaks which had not to leave now.
    pub(super) fn clause_of(&self, byte: u8) -> &'static str {
        let Self { rules, feed, flow, .. } = self;
        match () {
            () if [0x13, 0x93].contains(&byte) && feed.job().is_none() => "fanuc-rs232.punch.flow",
            () if byte == 0x11 && feed.job().is_none() && flow.is_stopped() => {
                "fanuc-rs232.punch.flow"
            }
            () if byte == 0x11 && feed.job().is_none() => "fanuc-rs232.punch.answer-dc2",
            () if feed.job().is_none() => "fanuc-rs232.feed.abort-clean",
            () if feed.is_waiting() => "fanuc-rs232.feed.wait-dc1",
            () if feed.is_held() => "fanuc-rs232.feed.obey-dc3",
            () if feed.is_paused() => "fanuc-rs232.feed.pause",
            () if feed.is_ending() => "fanuc-rs232.feed.end-wait",
            () if rules.tv_pad => "fanuc-rs232.tape.tv-pad",
            () if rules.code == Code::Eia => "fanuc-rs232.code.eia",
            () => "fanuc-rs232.code.iso",
        }
    }

    /// The clause that silence breaks where a character had to leave.
    pub(super) fn clause_of_silence(&self) -> &'static str {
        match () {
            () if self.wire.port.urgent() == 0 => "fanuc-rs232.feed.resume",
            () if self.rules.answer_dc2 => "fanuc-rs232.punch.answer-dc2",
            () => "fanuc-rs232.punch.flow",
        }
    }
}
