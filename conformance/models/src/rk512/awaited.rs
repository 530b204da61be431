//! What has to be seen at this instant, besides characters.

use crate::model::Effect;
use softplug_abi::Failure;

/// One thing that is due now. Ids of deliveries and requests are the plug-in's own.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) enum Due {
    Delivered {
        bytes: Vec<u8>,
        failure: Option<Failure>,
        status: u16,
    },
    Done {
        job: u32,
        sent: u64,
    },
    Failed {
        job: u32,
        failure: Failure,
        status: u16,
        sent: u64,
    },
    Requested {
        kind: &'static str,
        fields: Vec<(String, String)>,
    },
    /// Its id; `None`: that of a request which is due itself.
    Withdrawn(Option<u32>),
}

impl Due {
    /// Whether this is it.
    fn is(&self, effect: &Effect) -> bool {
        match (self, effect) {
            (
                Self::Delivered { bytes, failure, status },
                Effect::Delivered { id, bytes: own, name, failure: why, status: code },
            ) => *id != 0 && name.is_none() && (bytes, failure, status) == (own, why, code),
            (Self::Done { job, sent }, Effect::Done { job: own, sent: count }) => {
                job == own && sent == count
            }
            (
                Self::Failed { job, failure, status, sent },
                Effect::Failed { job: own, failure: why, status: code, sent: count },
            ) => (job, failure, status) == (own, why, code) && sent == count,
            (
                Self::Requested { kind, fields },
                Effect::Requested { id, kind: name, fields: own },
            ) => *id != 0 && kind == name && fields == own,
            (Self::Withdrawn(request), Effect::Withdrawn(own)) => *request == Some(*own),
            _ => false,
        }
    }

    fn is_alike(&self, effect: &Effect) -> bool {
        matches!(
            (self, effect),
            (Self::Delivered { .. }, Effect::Delivered { .. })
                | (Self::Done { .. }, Effect::Done { .. })
                | (Self::Failed { .. }, Effect::Failed { .. })
                | (Self::Requested { .. }, Effect::Requested { .. })
                | (Self::Withdrawn(_), Effect::Withdrawn(_))
        )
    }
}

/// All that is due now.
#[derive(Clone, PartialEq, Debug, Default)]
pub(super) struct Awaited(Vec<(&'static str, Due)>);

impl Awaited {
    pub(super) fn push(&mut self, clause: &'static str, due: Due) {
        self.0.push((clause, due));
    }

    /// One is seen.
    ///
    /// # Errors
    /// Another one had to be, or none of its kind.
    pub(super) fn seen(&mut self, effect: &Effect) -> Result<(), Option<(&'static str, String)>> {
        let place = self.0.iter().position(|(_, due)| due.is_alike(effect)).ok_or(None)?;
        let (clause, due) = self.0.remove(place);
        if due.is(effect) {
            if let Effect::Requested { id, .. } = effect {
                self.name_withdrawn(*id);
            }
            return Ok(());
        }
        Err(Some((clause, format!("{due:?} had to come, and not {effect:?}"))))
    }

    /// The request that is due to be withdrawn has an id.
    fn name_withdrawn(&mut self, id: u32) {
        let unnamed = self.0.iter_mut().find_map(|(_, due)| match due {
            Due::Withdrawn(request @ None) => Some(request),
            _ => None,
        });
        if let Some(request) = unnamed {
            *request = Some(id);
        }
    }

    /// The first that was not seen.
    pub(super) fn missing(&self) -> Option<(&'static str, String)> {
        self.0.first().map(|(clause, due)| (*clause, format!("{due:?} had to come, and did not")))
    }
}
