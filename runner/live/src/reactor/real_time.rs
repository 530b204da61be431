//! Threads that come before all that is not of real time.

use std::io;

use thread_priority::{
    Error, RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};

use crate::error::PortError;

/// Gives this thread a real-time priority, 1 to 99. Threads of one priority take turns.
pub(super) fn give(priority: u8) -> Result<(), PortError> {
    let refused = |reason| PortError::RealTime { priority, reason };
    let value = ThreadPriorityValue::try_from(priority).map_err(refused)?;
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::RoundRobin);
    set_thread_priority_and_policy(thread_native_id(), ThreadPriority::Crossplatform(value), policy)
        .map_err(|error| refused(in_words(error)))
}

fn in_words(error: Error) -> String {
    match error {
        Error::OS(code) => io::Error::from_raw_os_error(code).to_string(),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_priority_that_there_is_not_is_refused() {
        for priority in [0, 100] {
            let error = give(priority).unwrap_err();
            assert!(error.to_string().contains(&format!("priority {priority}: ")), "{error}");
        }
    }
}
