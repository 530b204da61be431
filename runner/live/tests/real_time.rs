//! Which threads of a reactor have real-time priority.

#![cfg(target_os = "linux")]

use std::fs;

use softplug_live::PortError;
use softplug_live::reactor::{Reactor, ReactorOptions};
use softplug_native::NativeInstance;

/// Linux's number of `SCHED_RR`.
const ROUND_ROBIN: u32 = 2;

/// Names and priorities of this process's threads that have a real-time priority.
fn of_real_time() -> Vec<(String, u32)> {
    let mut found = Vec::new();
    for task in fs::read_dir("/proc/self/task").unwrap() {
        let stat = fs::read_to_string(task.unwrap().path().join("stat")).unwrap();
        let (before, rest) = stat.rsplit_once(") ").unwrap();
        let (_, name) = before.split_once('(').unwrap();
        // The third field is the first after the name; 40 and 41 are wanted.
        let fields: Vec<&str> = rest.split_whitespace().collect();
        if fields[38].parse() == Ok(ROUND_ROBIN) {
            found.push((name.to_owned(), fields[37].parse().unwrap()));
        }
    }
    found
}

#[test]
fn threads_for_links_have_the_priority_and_no_other_has() {
    let options = ReactorOptions { real_time_priority: Some(1), ..ReactorOptions::default() };
    match Reactor::<NativeInstance>::start(options, |_, _| {}) {
        Ok(_reactor) => assert_eq!(of_real_time(), [("softplug-io-0".to_owned(), 1)]),
        // Who runs the test has no right to it.
        Err(error) => assert!(matches!(error, PortError::RealTime { priority: 1, .. }), "{error}"),
    }
}
