//! How the jobs of one end fare: what of each was delivered at the other.

use crate::end::{JobGiven, Told};
use crate::promise::{Breach, Wrong};

/// The jobs of one end, up to the one that began last.
#[derive(Clone, PartialEq, Eq, Hash, Debug, Default)]
pub(crate) struct Course {
    /// How often the job that began last was delivered.
    delivered: u8,
    /// The same of the one before it.
    delivered_before: u8,
    /// Something else was delivered in its place.
    is_altered: bool,
    begun: usize,
}

impl Course {
    pub(crate) fn begin(&mut self) {
        self.delivered_before = std::mem::take(&mut self.delivered);
        self.is_altered = false;
        self.begun += 1;
    }

    /// The end whose jobs these are says something of the one under way.
    pub(crate) fn told(&self, told: &Told, wrong: &Wrong) -> Option<Breach> {
        match told {
            Told::Done if self.delivered == 0 && !self.is_altered => Some(Breach::NotDelivered),
            Told::Failed(failure) if *wrong == Wrong::default() => {
                Some(Breach::FailedForNothing { failure: *failure })
            }
            _ => None,
        }
    }

    /// The other end has delivered this.
    pub(crate) fn delivered(&mut self, bytes: &[u8], jobs: &[JobGiven]) -> Option<Breach> {
        let Some(last) = self.begun.checked_sub(1) else {
            return Some(Breach::Invented { delivered: bytes.to_vec() });
        };
        if *jobs[last].data == *bytes {
            self.delivered += 1;
            return (self.delivered > 1).then_some(Breach::Doubled);
        }
        if last > 0 && *jobs[last - 1].data == *bytes {
            self.delivered_before += 1;
            return (self.delivered_before > 1).then_some(Breach::Doubled);
        }
        self.is_altered = true;
        Some(Breach::Altered { delivered: bytes.to_vec() })
    }
}
