//! What a plug-in does that concerns more than its line.

use crate::deliveries::Deliveries;
use crate::feed::{Ending, Feed};
use crate::outbox::Outbox;
use alloc::borrow::ToOwned;
use alloc::string::String;
use alloc::vec::Vec;
use softplug_abi::{Action, Failure, JobId, Micros, RequestId};
use softplug_link::{LinkHost, Supply};
use softplug_unit_protocol::{Outcome, ToServer};

/// The longest text in a message, in bytes: frames here are short.
const LONGEST_TEXT: usize = 300;
/// The longest fields of a request, in bytes: they must fit into a message.
pub(crate) const LONGEST_FIELDS: usize = 450;

/// All that is known of the link beside the plug-in and its line.
pub(crate) struct Host {
    pub(crate) outbox: Outbox,
    pub(crate) feed: Feed,
    pub(crate) deliveries: Deliveries,
    pub(crate) requests: Vec<Asked>,
    next_request: u32,
    /// The state that the plug-in is in.
    pub(crate) state: String,
    /// A plug-in that delivers without end is at fault.
    pub(crate) has_flooded: bool,
    /// A request that cannot be told: it is refused at once.
    pub(crate) refused: Vec<RequestId>,
}

/// A request of the machine that is not answered.
pub(crate) struct Asked {
    pub(crate) number: u32,
    /// The plug-in's number for it.
    pub(crate) of_link: RequestId,
    pub(crate) kind: u16,
    pub(crate) fields: Vec<u8>,
}

impl Host {
    pub(crate) fn new() -> Self {
        Self {
            outbox: Outbox::default(),
            feed: Feed::new(),
            deliveries: Deliveries::new(),
            requests: Vec::new(),
            next_request: 1,
            state: String::new(),
            has_flooded: false,
            refused: Vec::new(),
        }
    }

    fn job_ended(&mut self, job: JobId, ending: Ending) {
        if let Some(active) = self.feed.of_link(job) {
            active.ending = Some(ending);
        }
    }

    fn ask(&mut self, of_link: RequestId, kind: u16, fields: &[u8]) {
        if fields.len() > LONGEST_FIELDS {
            self.refused.push(of_link);
            return;
        }
        let number = self.next_request;
        self.next_request += 1;
        let asked = Asked { number, of_link, kind, fields: fields.to_vec() };
        self.outbox.say(&asked.message());
        self.requests.push(asked);
    }

    fn withdraw(&mut self, is_it: impl Fn(&Asked) -> bool) {
        let outbox = &mut self.outbox;
        self.requests.retain(|asked| {
            let stays = !is_it(asked);
            if !stays {
                outbox.say(&ToServer::Withdrawn { link: 0, request: asked.number });
            }
            stays
        });
    }

    /// The plug-in has ended: what is open will never be whole.
    pub(crate) fn break_off(&mut self) {
        self.deliveries.ended(Some(Failure::Interrupted), 0);
        self.withdraw(|_| true);
        self.refused.clear();
        self.has_flooded = false;
    }
}

impl Asked {
    pub(crate) fn message(&self) -> ToServer<'_> {
        let Self { number, kind, ref fields, .. } = *self;
        ToServer::Request { link: 0, request: number, kind, fields }
    }
}

// A new action has to be decided on here.
#[deny(clippy::wildcard_enum_match_arm)]
impl LinkHost for Host {
    fn handle(&mut self, _now: Micros, action: &Action<'_>) {
        match action {
            Action::DeliveryBegin { job, .. } => {
                let job = self.feed.of_link(*job).map_or(0, |active| active.job);
                if !self.deliveries.begun(job) {
                    self.has_flooded = true;
                }
            }
            Action::Deliver { bytes, .. } => self.deliveries.data(bytes),
            Action::DeliveryName { name, .. } => self.deliveries.named(name),
            Action::DeliveryEnd { failure, status, .. } => {
                self.deliveries.ended(*failure, *status);
            }
            Action::JobDone { job, sent } => {
                let ending = Ending { sent: *sent, ..Ending::of(Outcome::Done, None, 0) };
                self.job_ended(*job, ending);
            }
            Action::JobFailed { job, failure, status, sent } => {
                let ending = Ending::of(Outcome::Failed, Some(*failure), *status);
                self.job_ended(*job, Ending { sent: *sent, ..ending });
            }
            Action::CheckResult { job, failure: Some(failure), status, line, column } => {
                let ending = Ending::of(Outcome::CheckFailed, Some(*failure), *status);
                self.job_ended(*job, Ending { line: *line, column: *column, ..ending });
            }
            Action::Request { request, kind, fields } => {
                self.ask(*request, *kind, fields.as_bytes());
            }
            Action::Withdraw { request } => {
                let request = *request;
                self.withdraw(|asked| asked.of_link == request);
                self.refused.retain(|refused| *refused != request);
            }
            Action::Note { level, code, text } => {
                let (level, code, text) = (*level, *code, short(text));
                self.outbox.remark(&ToServer::Note { link: 0, level, code, text });
            }
            Action::State { name } => {
                self.outbox.remark(&ToServer::State { link: 0, name: short(name) });
                (*name).clone_into(&mut self.state);
            }
            // The line has no modem lines; a break comes where the line is given what is to be sent.
            Action::ModemLines { .. }
            | Action::Break { .. }
            | Action::Hold
            | Action::Release
            | Action::Transmit { .. }
            | Action::TransmitUrgent { .. }
            | Action::Discard
            | Action::SetTimer { .. }
            | Action::CancelTimer { .. }
            | Action::Want { .. }
            | Action::CheckResult { .. }
            | Action::Saved { .. } => {}
        }
    }

    fn supply(&mut self, job: JobId, buffer: &mut [u8]) -> Supply {
        self.feed.supply(job, buffer)
    }

    fn rewind(&mut self, job: JobId) {
        self.feed.rewind(job, &mut self.outbox);
    }

    fn drained(&mut self) -> u32 {
        self.deliveries.drained()
    }
}

impl Ending {
    pub(crate) fn of(outcome: Outcome, failure: Option<Failure>, status: u16) -> Self {
        Self { outcome, failure, status, line: 0, column: 0, sent: 0 }
    }
}

/// As much of a text as a message has room for.
pub(crate) fn short(text: &str) -> &str {
    &text[..text.floor_char_boundary(LONGEST_TEXT)]
}
