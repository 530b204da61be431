//! From the encoder into the queue.

use super::Feed;
use softplug_plugin::Context;

/// Bytes that are queued at a time.
pub(super) const PIECE: usize = 128;

impl Feed {
    /// Queues what there is room for; whether that was all.
    pub(super) fn flush(&mut self, link: &mut Context<'_>) -> bool {
        let output = &mut self.encoder.output;
        let count = output.len().min(link.transmit_room() as usize);
        self.queued += count as u64;
        link.transmit(output.first(count));
        output.drop_first(count);
        output.len() == 0
    }

    /// Queues the NULs of leader or trailer, with nothing before them in the output;
    /// whether that was all.
    pub(super) fn queue_nuls(&mut self, link: &mut Context<'_>) -> bool {
        // Other actions of the event need their place too.
        while self.nuls > 0 && link.transmit_room() > 0 && link.output_room() > 4 * PIECE {
            let count = self.nuls.min(link.transmit_room()).min(PIECE as u32);
            self.nuls -= count;
            self.queued += u64::from(count);
            link.transmit([0; PIECE].get(..count as usize).unwrap_or_default());
        }
        self.nuls == 0
    }
}
