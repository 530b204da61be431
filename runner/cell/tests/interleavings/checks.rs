//! What must hold at every step, said in other words than the coordinator's.

use std::collections::VecDeque;

use softplug_cell::{Cell, Change, ChannelId, ChannelSet, End, Event, Word};

use crate::graph::Graph;

pub(crate) fn transition(before: &Cell, event: &Event, changes: &[Change], after: &Cell) {
    let told = || format!("{event:?}\nbefore {before:#?}\nafter {after:#?}\n{changes:#?}");
    saved_is_restored(after);
    for channel in after.setup().channels() {
        let ended = Change::Ended { channel, end: End::Failed };
        let is_met =
            changes.contains(&ended) || goes_only_when_all_are_there(before, event, after, channel);
        assert!(is_met, "{channel} goes alone\n{}", told());
        assert!(
            is_told_whether_it_may_be_fed(before, event, changes, after, channel),
            "{}",
            told()
        );
        if let Some((mark, with)) = meeting(after, channel) {
            let missing = with.iter().any(|one| meeting(after, one) != Some((mark, with)));
            assert!(missing, "a signal is lost: all are at mark {mark}\n{}", told());
        }
    }
    for axis in after.setup().axes() {
        let (owner, queue) = after.axis(axis);
        let (owned_before, queued_before) = before.axis(axis);
        assert!(owner.is_some() || queue.is_empty(), "neutral, and wanted\n{}", told());
        for (at, one) in queue.iter().enumerate() {
            assert!(!queue[..at].contains(one) && Some(*one) != owner, "{}", told());
            assert!(!after.may_be_fed(*one), "it goes on without its axis\n{}", told());
        }
        // Who was in the queue stays in its order. Who is new stands at the end, but for the one
        // that an axis was taken from.
        let stayed: Vec<ChannelId> =
            queued_before.iter().copied().filter(|one| queue.contains(one)).collect();
        let new: Vec<ChannelId> =
            queue.iter().copied().filter(|one| !queued_before.contains(one)).collect();
        let is_taken = new.len() == 1 && owned_before == Some(new[0]) && !is_freed(event);
        let expected = if is_taken { [new, stayed].concat() } else { [stayed, new].concat() };
        assert_eq!(queue, expected, "{}", told());
        let Some(owner) = owner.filter(|owner| owned_before != Some(*owner)) else { continue };
        let head = queued_before.iter().find(|one| after.runs(**one) && *one != &quits(event));
        let is_its_turn = head == Some(&owner) && owned_before.is_none_or(|old| gives(event, old));
        let was_neutral = owned_before.is_none() && queued_before.is_empty();
        assert!(is_its_turn || was_neutral || is_forced(event, owner), "{}", told());
    }
}

/// Whoever is stuck stays so, whatever channels do.
pub(crate) fn who_is_stuck_stays_stuck(before: &Cell, event: &Event, after: &Cell) {
    for channel in stuck(before).iter() {
        assert!(stuck(after).has(channel), "{event:?} frees {channel}\n{before:#?}");
    }
}

/// Looks from the states in which a channel is free back along all that channels do: it must be
/// told stuck in the others in which it runs, and only there.
pub(crate) fn stuck_is_what_no_course_frees(graph: &Graph) {
    let mut backward: Vec<Vec<u32>> = vec![Vec::new(); graph.states.len()];
    for (from, to) in &graph.inside {
        backward[*to as usize].push(*from);
    }
    for channel in graph.states[0].setup().channels() {
        let is_free = |cell: &Cell| cell.may_be_fed(channel);
        let mut frees: Vec<bool> = graph.states.iter().map(is_free).collect();
        let free = frees.iter().enumerate().filter(|(_, free)| **free);
        let mut next: VecDeque<u32> = free.map(|(at, _)| at as u32).collect();
        while let Some(at) = next.pop_front() {
            for from in &backward[at as usize] {
                if !std::mem::replace(&mut frees[*from as usize], true) {
                    next.push_back(*from);
                }
            }
        }
        for (cell, frees) in graph.states.iter().zip(&frees) {
            if cell.runs(channel) {
                let is_told = stuck(cell).has(channel);
                assert_eq!(is_told, !frees, "{channel}: told {is_told}, {cell:?}");
            }
        }
    }
}

fn stuck(cell: &Cell) -> ChannelSet {
    cell.deadlocked().iter().chain(cell.forsaken().iter()).collect()
}

fn saved_is_restored(cell: &Cell) {
    let restored = Cell::restore(cell.setup().clone(), cell.save());
    assert_eq!(restored.as_ref(), Ok(cell));
}

fn meeting(cell: &Cell, channel: ChannelId) -> Option<(u32, ChannelSet)> {
    match cell.channel(channel).waits {
        Some((Word::Wait { mark, with }, _)) => Some((*mark, *with)),
        _ => None,
    }
}

/// A channel leaves a mark only together with all that it named, each of which was there.
fn goes_only_when_all_are_there(
    before: &Cell,
    event: &Event,
    after: &Cell,
    channel: ChannelId,
) -> bool {
    let arrives = match event {
        Event::Reached { channel, word: Word::Wait { mark, with } } => {
            Some((*channel, (*mark, *with)))
        }
        _ => None,
    };
    let was_at = |one: ChannelId| match arrives {
        Some((who, meeting)) if who == one => Some(meeting),
        _ => meeting(before, one),
    };
    let Some((mark, with)) = was_at(channel) else { return true };
    let has_left = meeting(after, channel).is_none();
    !has_left
        || !after.runs(channel)
        || with.iter().all(|one| was_at(one) == Some((mark, with)) && meeting(after, one).is_none())
}

/// The feed is told each time, and told the truth.
fn is_told_whether_it_may_be_fed(
    before: &Cell,
    event: &Event,
    changes: &[Change],
    after: &Cell,
    channel: ChannelId,
) -> bool {
    let arrives = matches!(event, Event::Reached { channel: who, .. } if *who == channel);
    let begins =
        |change: &Change| matches!(change, Change::Began { channel: who, .. } if *who == channel);
    let arrives = arrives || changes.iter().any(begins);
    let last = changes.iter().rev().find_map(|change| match change {
        Change::Goes { channel: who } if *who == channel => Some(true),
        Change::Stands { channel: who } if *who == channel => Some(false),
        _ => None,
    });
    match last {
        Some(may) => may == after.may_be_fed(channel),
        None if arrives => !after.may_be_fed(channel),
        None => !after.runs(channel) || before.may_be_fed(channel) == after.may_be_fed(channel),
    }
}

fn is_freed(event: &Event) -> bool {
    matches!(event, Event::Free { .. })
}

fn is_forced(event: &Event, channel: ChannelId) -> bool {
    match event {
        Event::Force { channel: to, .. } => *to == channel,
        Event::Reached { channel: by, word: Word::Get { forced: true, .. } } => *by == channel,
        _ => false,
    }
}

/// Who leaves the queue by this event: it releases what it waits for.
fn quits(event: &Event) -> ChannelId {
    match event {
        Event::Reached { channel, word: Word::Release { .. } } => *channel,
        _ => ChannelId(u8::MAX),
    }
}

/// Whether this event makes an axis neutral that this channel has.
fn gives(event: &Event, owner: ChannelId) -> bool {
    match event {
        Event::Reached { channel, word: Word::Release { .. } } | Event::Ended { channel, .. } => {
            *channel == owner
        }
        Event::Free { .. } => true,
        _ => false,
    }
}
