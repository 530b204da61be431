//! Ids of jobs, requests and deliveries in a case that stands behind another one on the same link.

use crate::run::seen::Seen;
use softplug_abi::Micros;
use softplug_link::{Delivery, Observed};

/// The ids of one case behind another on the same link, as if it were the first.
#[derive(Default)]
pub(super) struct Numbers {
    job_base: u32,
    requests: Vec<u32>,
    deliveries: Vec<u32>,
}

impl Numbers {
    /// Of a case whose jobs are numbered from here on.
    pub(super) fn behind(job_base: u32) -> Self {
        Self { job_base, ..Self::default() }
    }

    pub(super) fn of_this_case(&mut self, mut seen: Seen) -> Seen {
        match &mut seen.what {
            Observed::Done { job, .. }
            | Observed::Failed { job, .. }
            | Observed::Checked { job, .. } => job.0 = job.0.saturating_sub(self.job_base),
            Observed::Request { request, .. } | Observed::Withdraw(request) => {
                request.0 = number(&mut self.requests, request.0);
            }
            Observed::Delivery(Delivery { id, .. }) => {
                id.0 = number(&mut self.deliveries, id.0);
            }
            _ => {}
        }
        seen
    }
}

/// The place of an id among those that were seen, from 1.
fn number(known: &mut Vec<u32>, id: u32) -> u32 {
    let place = known.iter().position(|known| *known == id).unwrap_or_else(|| {
        known.push(id);
        known.len() - 1
    });
    place as u32 + 1
}

/// The link's id for the request that a trace calls by its number.
pub(super) fn request_of_link(observed: &[(Micros, Observed)], asked: u32) -> u32 {
    let mut requests = Vec::new();
    for (_, observed) in observed {
        if let Observed::Request { request, .. } = observed {
            number(&mut requests, request.0);
        }
    }
    requests.get((asked as usize).saturating_sub(1)).copied().unwrap_or(u32::MAX)
}
