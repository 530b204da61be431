//! All interleavings of small cells, with programs that may say anything.
//!
//! A channel that may be fed can say every word, end, or fail, at any time: so every program is
//! among those that are explored. Outside of the channels, somebody begins programs, takes and
//! frees axes, ends programs that wait, and the gateway is ended at any point and starts again.

mod checks;
mod graph;
mod symmetry;

use std::collections::HashSet;

use graph::{Alphabet, Graph, events, is_inside};
use softplug_cell::Cell;

fn is_long() -> bool {
    std::env::var_os("SOFTPLUG_CELL_LONG").is_some()
}

/// Every state of a cell, and in each whether "stuck" means that no course frees the channel.
fn explore(alphabet: &Alphabet) -> Graph {
    let graph = Graph::of(alphabet, checks::transition);
    checks::stuck_is_what_no_course_frees(&graph);
    eprintln!("{} states, {} ways by channels themselves", graph.states.len(), graph.inside.len());
    graph
}

#[test]
fn three_channels_with_marks_and_axes() {
    let graph = explore(&Alphabet { channels: 3, marks: 2, axes: 1, loads: false, turns: true });
    assert!(graph.states.len() > 5_000, "{} states", graph.states.len());
    assert!(graph.deadlocks() > 100 && graph.forsaken() > 100);
}

#[test]
fn three_channels_with_two_axes() {
    let graph = explore(&Alphabet { channels: 3, marks: 1, axes: 2, loads: false, turns: true });
    assert!(graph.states.len() > 20_000, "{} states", graph.states.len());
}

/// `SOFTPLUG_CELL_LONG=1` gives them an axis, too: 1.5 million states.
#[test]
fn four_channels_at_a_mark() {
    let axes = u8::from(is_long());
    let graph = explore(&Alphabet { channels: 4, marks: 1, axes, loads: false, turns: false });
    assert!(graph.states.len() > 2_000, "{} states", graph.states.len());
}

#[test]
fn three_channels_that_load_and_start_each_other() {
    let graph = explore(&Alphabet { channels: 3, marks: 1, axes: 1, loads: true, turns: false });
    assert!(graph.states.len() > 20_000, "{} states", graph.states.len());
}

/// The largest, one state for all that differ in names only. `SOFTPLUG_CELL_LONG=1` explores four
/// channels, three marks and two axes; without it there are two marks and one axis.
#[test]
fn four_channels_up_to_their_names() {
    let (marks, axes) = if is_long() { (3, 2) } else { (2, 1) };
    let alphabet = Alphabet { channels: 4, marks, axes, loads: false, turns: false };
    let mut seen = HashSet::new();
    let mut next = vec![alphabet.cell()];
    seen.insert(symmetry::key(&next[0], &alphabet));
    let (mut transitions, mut deadlocks) = (0_u64, 0_u64);
    while let Some(cell) = next.pop() {
        deadlocks += u64::from(!cell.deadlocked().is_empty());
        for event in events(&cell, &alphabet) {
            let mut after: Cell = cell.clone();
            let Ok(changes) = after.handle(0, event.clone()) else { continue };
            transitions += 1;
            checks::transition(&cell, &event, &changes, &after);
            if is_inside(&cell, &event, &alphabet) {
                checks::who_is_stuck_stays_stuck(&cell, &event, &after);
            }
            if seen.insert(symmetry::key(&after, &alphabet)) {
                next.push(after);
                if is_long() && seen.len().is_multiple_of(100_000) {
                    eprintln!("{} states, {transitions} transitions", seen.len());
                }
            }
        }
    }
    eprintln!("{} states, {transitions} transitions, {deadlocks} with a deadlock", seen.len());
    assert!(seen.len() > 1_000 && deadlocks > 100);
}
