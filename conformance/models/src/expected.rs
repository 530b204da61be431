//! What has to happen before an instant is over, in any order.

use crate::model::{Broken, Effect};
use softplug_abi::Failure;

/// Effects that have to be seen at this instant, each with the clause that asks for it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Expected(Vec<(&'static str, Effect)>);

impl Expected {
    pub(crate) fn expect(&mut self, clause: &'static str, effect: Effect) {
        self.0.push((clause, effect));
    }

    /// Something was seen that is no byte. `false`: nothing asks for it.
    pub(crate) fn sees(&mut self, effect: &Effect) -> bool {
        let place = self.0.iter().position(|(_, expected)| is_same(expected, effect));
        place.map(|place| self.0.remove(place)).is_some()
    }

    /// The instant is over: something that had to come may have been missed.
    pub(crate) fn missed(&self) -> Result<(), Broken> {
        let Some((clause, effect)) = self.0.first() else { return Ok(()) };
        Err(Broken::new(clause, format!("{effect:?} had to come")))
    }

    /// This was seen in place of what is expected, which breaks this clause, or the nearest.
    pub(crate) fn broken(&self, clause: &'static str, effect: &Effect) -> Broken {
        let expected: Vec<_> = self.0.iter().map(|(_, effect)| effect).collect();
        Broken::new(clause, format!("{effect:?} came, expected was {expected:?}"))
    }
}

/// Whether what was seen is what was expected. A name without characters is none. What has left for
/// a job that the end of the link has interrupted is not always known: it may be told to be nothing.
fn is_same(expected: &Effect, seen: &Effect) -> bool {
    match (expected, seen) {
        (
            Effect::Delivered { id, bytes, name, failure, status },
            Effect::Delivered {
                id: id2,
                bytes: bytes2,
                name: name2,
                failure: failure2,
                status: status2,
            },
        ) => {
            let names = [name, name2].map(|name| name.as_deref().unwrap_or_default());
            (id, bytes, failure, status) == (id2, bytes2, failure2, status2) && names[0] == names[1]
        }
        (
            Effect::Failed { job, failure: Failure::Interrupted, .. },
            Effect::Failed { job: job2, failure: Failure::Interrupted, status: 0, sent: 0 },
        ) => job == job2,
        _ => expected == seen,
    }
}
