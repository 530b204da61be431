//! What comes from the machine, until the server has put it away.

use alloc::borrow::ToOwned;
use alloc::collections::VecDeque;
use alloc::string::String;
use alloc::vec::Vec;
use softplug_abi::Failure;
use softplug_unit_protocol::ToServer;

/// Bytes of all deliveries together that wait to be put away.
pub(crate) const ROOM: u32 = 2_048;
/// Deliveries that may wait to be put away: each has its name, however few bytes it has.
const MOST: usize = 16;
/// Bytes of a message of data beside the data.
const HEAD: usize = 3 + 1 + 4 + 8;

pub(crate) struct Deliveries {
    /// The first one goes to the server; the others wait.
    waiting: VecDeque<Delivery>,
    /// Of all of them, from what the first one's server has stored.
    bytes: VecDeque<u8>,
    next: u32,
    /// Put away, and the link has not heard of it.
    drained: u32,
}

struct Delivery {
    number: u32,
    job: u64,
    name: String,
    size: u64,
    stored: u64,
    /// Up to here it was sent in this session.
    sent: u64,
    is_announced: bool,
    end: Option<(Option<Failure>, u16)>,
    is_end_told: bool,
}

impl Deliveries {
    pub(crate) fn new() -> Self {
        let bytes = VecDeque::with_capacity(ROOM as usize);
        Self { waiting: VecDeque::new(), bytes, next: 1, drained: 0 }
    }

    /// `false`: there are too many.
    pub(crate) fn begun(&mut self, job: u64) -> bool {
        if self.waiting.len() == MOST {
            return false;
        }
        let number = self.next;
        self.next += 1;
        self.waiting.push_back(Delivery {
            number,
            job,
            name: String::new(),
            size: 0,
            stored: 0,
            sent: 0,
            is_announced: false,
            end: None,
            is_end_told: false,
        });
        true
    }

    /// The one that is open is the latest.
    fn open(&mut self) -> Option<&mut Delivery> {
        self.waiting.back_mut().filter(|one| one.end.is_none())
    }

    pub(crate) fn data(&mut self, bytes: &[u8]) {
        if let Some(delivery) = self.open() {
            delivery.size += bytes.len() as u64;
            self.bytes.extend(bytes);
        }
    }

    pub(crate) fn named(&mut self, name: &str) {
        if let Some(delivery) = self.open() {
            name.clone_into(&mut delivery.name);
            delivery.is_announced = false;
        }
    }

    pub(crate) fn ended(&mut self, failure: Option<Failure>, status: u16) {
        if let Some(delivery) = self.open() {
            delivery.end = Some((failure, status));
        }
    }

    /// Bytes put away since the last call.
    pub(crate) fn drained(&mut self) -> u32 {
        core::mem::take(&mut self.drained)
    }

    /// Whether something that answers this job is not stored yet.
    pub(crate) fn answer(&self, job: u64) -> bool {
        self.waiting.iter().any(|delivery| delivery.job == job)
    }

    /// A new session: what is not stored is sent again.
    pub(crate) fn begin_anew(&mut self) {
        for delivery in &mut self.waiting {
            delivery.sent = delivery.stored;
            (delivery.is_announced, delivery.is_end_told) = (false, false);
        }
    }

    pub(crate) fn stored(&mut self, number: u32, until: u64, is_whole: bool) {
        let Some(first) = self.waiting.front_mut().filter(|first| first.number == number) else {
            return;
        };
        // Nothing is forgotten that was never sent.
        let until = until.min(first.sent);
        if until > first.stored {
            let count = (until - first.stored) as usize;
            self.bytes.drain(..count);
            self.drained += count as u32;
            first.stored = until;
        }
        if is_whole && first.is_end_told && first.stored == first.size {
            self.waiting.pop_front();
        }
    }

    /// Sends what `send` takes, in messages of at most `longest` bytes.
    pub(crate) fn pump(&mut self, longest: usize, mut send: impl FnMut(&ToServer<'_>) -> bool) {
        let link = 0;
        let Some(first) = self.waiting.front_mut() else { return };
        let delivery = first.number;
        if !first.is_announced {
            let Delivery { job, ref name, sent, .. } = *first;
            if !send(&ToServer::Delivery { link, delivery, job, at: sent, name }) {
                return;
            }
            first.is_announced = true;
        }
        let most = longest.saturating_sub(HEAD).max(1);
        while first.sent < first.size {
            let begin = (first.sent - first.stored) as usize;
            let count = most.min((first.size - first.sent) as usize);
            let data: Vec<u8> = self.bytes.range(begin..begin + count).copied().collect();
            if !send(&ToServer::Delivered { link, delivery, at: first.sent, bytes: &data }) {
                return;
            }
            first.sent += count as u64;
        }
        if let Some((failure, status)) = first.end
            && !first.is_end_told
        {
            let size = first.size;
            first.is_end_told =
                send(&ToServer::DeliveryEnded { link, delivery, failure, status, size });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sent(deliveries: &mut Deliveries, mut room: usize) -> Vec<String> {
        let mut heard = Vec::new();
        deliveries.pump(HEAD + 2, |message| {
            let is_taken = room > 0;
            room = room.saturating_sub(1);
            if is_taken {
                heard.push(match message {
                    ToServer::Delivery { at, name, .. } => format!("{name} at {at}"),
                    ToServer::Delivered { at, bytes, .. } => format!("{at}: {bytes:?}"),
                    ToServer::DeliveryEnded { size, .. } => format!("end {size}"),
                    _ => unreachable!("a delivery says nothing else"),
                });
            }
            is_taken
        });
        heard
    }

    #[test]
    fn what_is_not_stored_is_sent_again() {
        let mut deliveries = Deliveries::new();
        assert!(deliveries.begun(0));
        deliveries.named("O1");
        deliveries.data(&[1, 2, 3]);
        assert_eq!(sent(&mut deliveries, 2), ["O1 at 0", "0: [1, 2]"]);
        deliveries.stored(1, 9, false);
        assert_eq!((deliveries.drained(), deliveries.drained()), (2, 0));
        deliveries.ended(None, 0);
        assert_eq!(sent(&mut deliveries, 9), ["2: [3]", "end 3"]);
        deliveries.begin_anew();
        assert_eq!(sent(&mut deliveries, 9), ["O1 at 2", "2: [3]", "end 3"]);
        // The next one is said when this one has been put away.
        assert!(deliveries.begun(7));
        assert!(sent(&mut deliveries, 9).is_empty() && deliveries.answer(7));
        deliveries.stored(1, 3, true);
        assert_eq!(sent(&mut deliveries, 9), [" at 0"]);
    }

    #[test]
    fn there_are_no_more_than_the_most() {
        let mut deliveries = Deliveries::new();
        for _ in 0..MOST {
            assert!(deliveries.begun(0));
            deliveries.ended(None, 0);
        }
        assert!(!deliveries.begun(0));
    }
}
