//! Which threads of a reactor have real-time priority.

#![cfg(target_os = "linux")]

use std::fs;

use softplug_gateway::PortError;
use softplug_gateway::reactor::{Reactor, ReactorOptions};
use softplug_native::NativeInstance;

/// Linux's number of `SCHED_RR`, and that of ordinary threads.
const ROUND_ROBIN: u32 = 2;
const ORDINARY: u32 = 0;

/// Priority and policy of this process's thread of a name.
fn scheduled(name: &str) -> (u32, u32) {
    let stats = fs::read_dir("/proc/self/task").unwrap().filter_map(|task| {
        // A thread of another test may have ended meanwhile.
        fs::read_to_string(task.unwrap().path().join("stat")).ok()
    });
    for stat in stats {
        let (of, rest) = stat.rsplit_once(") ").unwrap();
        if of.ends_with(&format!("({name}")) {
            // The third field is the first after the name; 40 and 41 are wanted.
            let fields: Vec<&str> = rest.split_whitespace().collect();
            return (fields[37].parse().unwrap(), fields[38].parse().unwrap());
        }
    }
    panic!("no thread {name}");
}

#[test]
fn threads_for_links_have_the_priority_and_no_other_has() {
    let options = ReactorOptions { real_time_priority: Some(1), ..ReactorOptions::default() };
    match Reactor::<NativeInstance>::start(options, |_, _| {}) {
        Ok(_reactor) => {
            assert_eq!(scheduled("softplug-io-0"), (1, ROUND_ROBIN));
            assert_eq!(scheduled("softplug-aside"), (0, ORDINARY));
        }
        // Who runs the test has no right to it.
        Err(error) => assert!(matches!(error, PortError::RealTime { priority: 1, .. }), "{error}"),
    }
}

#[test]
fn a_priority_that_there_is_not_is_refused() {
    for priority in [0, 100] {
        let options =
            ReactorOptions { real_time_priority: Some(priority), ..ReactorOptions::default() };
        let error = Reactor::<NativeInstance>::start(options, |_, _| {}).unwrap_err();
        assert!(matches!(error, PortError::RealTime { .. }), "{error}");
    }
}
