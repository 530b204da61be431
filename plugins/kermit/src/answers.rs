//! Answers as packets.

use crate::packet::{Packet, SHORT};
use crate::terms::Terms;
use crate::{Kermit, OWED};
use softplug_plugin::{Context, copy};

impl Kermit {
    /// Sends an answer; what finds no room waits for it, before all else. One that cannot wait as
    /// a whole is not sent.
    pub(crate) fn say_with(
        &mut self,
        link: &mut Context<'_>,
        terms: &Terms,
        kind: u8,
        number: u8,
        data: &[u8],
    ) {
        // The text of an error ends where the longest packet does; nothing else is as long.
        let most = usize::from(terms.short).min(self.settings.packet_length as usize);
        let data = data.get(..most.saturating_sub(2 + usize::from(terms.check))).unwrap_or(data);
        let mut packet = Packet::new();
        packet.clear();
        packet.push(data);
        packet.finish(kind, number, terms.check, SHORT);
        let mut answer = [terms.pad; OWED];
        let padding = usize::from(terms.padding);
        let packet = packet.as_slice();
        let end = padding + packet.len();
        copy(answer.get_mut(padding..).unwrap_or_default(), packet);
        copy(answer.get_mut(end..).unwrap_or_default(), &[terms.end]);
        if let Some(answer) = answer.get(..=end) {
            self.answers.say(link, answer);
        }
    }
}
