//! What comes from the machine, until the server has put it away.

use std::collections::VecDeque;

use softplug_abi::{DeliveryId, Failure};
use softplug_live::reservoir::{Drawn, ReservoirReader};
use softplug_unit_protocol::ToServer;

/// Bytes that may be on their way to the server and not stored yet.
const UNDER_WAY: usize = 4_096;
/// Bytes of a message of data beside the data.
const HEAD: usize = 3 + 1 + 4 + 8;

pub(super) struct Deliveries {
    link: u8,
    /// The first one goes to the server; the others wait.
    waiting: VecDeque<Delivery>,
    next: u32,
}

struct Delivery {
    /// The plug-in's number for it; while it is open.
    of_lane: DeliveryId,
    number: u32,
    job: u64,
    name: String,
    from: ReservoirReader,
    /// Not stored yet: from `stored` on.
    held: VecDeque<u8>,
    stored: u64,
    /// Up to here it was sent in this session.
    sent: u64,
    is_announced: bool,
    /// The lane has given all there is.
    is_drawn: bool,
    end: Option<End>,
    is_end_told: bool,
}

/// How it ended.
#[derive(Copy, Clone)]
struct End {
    failure: Option<Failure>,
    /// The protocol's own code.
    status: u16,
    /// How many bytes it has; `None`: what has come of it.
    size: Option<u64>,
}

impl Deliveries {
    pub(super) fn new(link: u8) -> Self {
        Self { link, waiting: VecDeque::new(), next: 1 }
    }

    pub(super) fn begun(&mut self, of_lane: DeliveryId, job: u64, from: ReservoirReader) {
        let number = self.next;
        self.next += 1;
        self.waiting.push_back(Delivery {
            of_lane,
            number,
            job,
            name: String::new(),
            from,
            held: VecDeque::new(),
            stored: 0,
            sent: 0,
            is_announced: false,
            is_drawn: false,
            end: None,
            is_end_told: false,
        });
    }

    /// The one that is open on the lane with this number.
    fn open(&mut self, of_lane: DeliveryId) -> Option<&mut Delivery> {
        self.waiting.iter_mut().rev().find(|one| one.of_lane == of_lane && one.end.is_none())
    }

    pub(super) fn named(&mut self, of_lane: DeliveryId, name: String) {
        if let Some(delivery) = self.open(of_lane) {
            delivery.name = name;
            delivery.is_announced = false;
        }
    }

    pub(super) fn ended(
        &mut self,
        of_lane: DeliveryId,
        failure: Option<Failure>,
        status: u16,
        size: u64,
    ) {
        if let Some(delivery) = self.open(of_lane) {
            delivery.end = Some(End { failure, status, size: Some(size) });
        }
    }

    /// The plug-in, or its lane, has ended: what is open will never be whole.
    pub(super) fn break_off(&mut self) {
        for delivery in self.waiting.iter_mut().filter(|delivery| delivery.end.is_none()) {
            let failure = Some(Failure::Interrupted);
            delivery.end = Some(End { failure, status: 0, size: None });
        }
    }

    /// Whether something that answers this job is not stored yet.
    pub(super) fn answer(&self, job: u64) -> bool {
        self.waiting.iter().any(|delivery| delivery.job == job)
    }

    /// A new session: what is not stored is sent again.
    pub(super) fn begin_anew(&mut self) {
        for delivery in &mut self.waiting {
            delivery.sent = delivery.stored;
            (delivery.is_announced, delivery.is_end_told) = (false, false);
        }
    }

    pub(super) fn stored(&mut self, number: u32, until: u64, is_whole: bool) {
        let Some(first) = self.waiting.front_mut().filter(|first| first.number == number) else {
            return;
        };
        // Nothing is forgotten that was never sent.
        let until = until.min(first.sent);
        if until > first.stored {
            first.held.drain(..(until - first.stored) as usize);
            first.stored = until;
        }
        if is_whole && first.is_end_told && first.held.is_empty() {
            self.waiting.pop_front();
        }
    }

    /// Sends what `send` takes.
    pub(super) fn pump(&mut self, send: &mut dyn FnMut(&ToServer<'_>) -> bool, longest: usize) {
        let link = self.link;
        let Some(first) = self.waiting.front_mut() else { return };
        if !first.is_announced {
            let Delivery { number, job, ref name, sent, .. } = *first;
            let announced = ToServer::Delivery { link, delivery: number, job, at: sent, name };
            if !send(&announced) {
                return;
            }
            first.is_announced = true;
        }
        let most = longest.saturating_sub(HEAD).max(1);
        loop {
            first.draw();
            let begin = (first.sent - first.stored) as usize;
            let data: Vec<u8> = first.held.iter().skip(begin).take(most).copied().collect();
            if data.is_empty() {
                break;
            }
            let (delivery, at) = (first.number, first.sent);
            if !send(&ToServer::Delivered { link, delivery, at, bytes: &data }) {
                return;
            }
            first.sent += data.len() as u64;
        }
        let is_sent = first.is_drawn && first.sent == first.stored + first.held.len() as u64;
        if let Some(End { failure, status, size }) = first.end
            && is_sent
            && !first.is_end_told
        {
            let (delivery, size) = (first.number, size.unwrap_or(first.sent));
            first.is_end_told =
                send(&ToServer::DeliveryEnded { link, delivery, failure, status, size });
        }
    }
}

impl Delivery {
    /// Takes from the lane what there is room for.
    fn draw(&mut self) {
        let mut buffer = [0; 1_024];
        while !self.is_drawn && self.held.len() < UNDER_WAY {
            let room = (UNDER_WAY - self.held.len()).min(buffer.len());
            match self.from.read(&mut buffer[..room]) {
                Drawn::Bytes(count) => self.held.extend(&buffer[..count]),
                // Of one that was broken off there is no more.
                Drawn::Later if self.end.is_none_or(|end| end.size.is_some()) => return,
                Drawn::Later | Drawn::End | Drawn::Failed => self.is_drawn = true,
            }
        }
    }
}
