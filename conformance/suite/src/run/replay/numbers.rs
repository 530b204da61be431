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
            | Observed::Checked { job, .. } => job.0 = job_of_case(self.job_base, job.0),
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

/// The link's id for the job that a trace calls by this one: so many behind it, in a ring
/// without 0, which is no job.
pub(super) fn job_of_link(base: u32, job: u32) -> u32 {
    if job == 0 { 0 } else { 1 + ring(u64::from(job - 1) + u64::from(base)) }
}

/// The other way around.
fn job_of_case(base: u32, job: u32) -> u32 {
    let ids = u64::from(u32::MAX);
    if job == 0 { 0 } else { 1 + ring(u64::from(job - 1) + ids - u64::from(base) % ids) }
}

/// There are so many ids besides 0.
fn ring(place: u64) -> u32 {
    (place % u64::from(u32::MAX)) as u32
}

/// The place of an id among those that were seen, from 1. One below all of them is the first
/// of a link that was opened anew.
fn number(known: &mut Vec<u32>, id: u32) -> u32 {
    let place = known.iter().position(|known| *known == id).unwrap_or_else(|| {
        if known.iter().all(|known| id < *known) {
            known.clear();
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn where_the_link_is_opened_anew_ids_begin_again_or_go_on() {
        let numbers = |ids: &[u32]| {
            let mut known = Vec::new();
            ids.iter().map(|id| number(&mut known, *id)).collect::<Vec<_>>()
        };
        // As if first on the link, and behind two others.
        assert_eq!(numbers(&[1, 2, 2, 1, 1, 2, 3]), [1, 2, 2, 1, 1, 2, 3]);
        assert_eq!(numbers(&[3, 4, 4, 1, 1, 2, 3]), [1, 2, 2, 1, 1, 2, 3]);
        // A plug-in that counts on.
        assert_eq!(numbers(&[3, 4, 5]), [1, 2, 3]);
    }

    #[test]
    fn the_last_ids_come_behind_others_too() {
        for base in [0, 1, 10_000, (1 << 24) - 1, 660_000_000, u32::MAX - 1, u32::MAX] {
            for job in [1, 2, 9_999, 1 << 31, u32::MAX - 1, u32::MAX] {
                let on_link = job_of_link(base, job);
                assert_ne!(on_link, 0, "{base} {job}");
                assert_eq!(job_of_case(base, on_link), job, "{base}");
            }
        }
        assert_eq!((job_of_link(0, 7), job_of_link(10_000, 7), job_of_link(5, 0)), (7, 10_007, 0));
    }
}
