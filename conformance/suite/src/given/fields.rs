//! Fields of jobs and requests, between a trace and the plug-in.

use softplug_abi::manifest::{FieldError, Kind};
use softplug_trace::Assignment;

/// The fields as value records. A trace may leave a required field out: what
/// the plug-in then does is the trace's to demand.
pub(crate) fn records(kind: &Kind, fields: &[Assignment]) -> Result<Vec<u8>, FieldError> {
    let given = fields.iter().map(|field| (field.name.as_str(), field.value.as_str()));
    kind.records(given)
}

/// The other way round, as far as the records can be read.
pub(crate) fn assignments(kind: &Kind, records: &[u8]) -> Vec<Assignment> {
    let named = kind.assignments(records).into_iter();
    named.map(|(name, value)| Assignment { name, value }).collect()
}
