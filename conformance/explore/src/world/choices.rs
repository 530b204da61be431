//! What may happen next in a state.

use super::{Arriving, BEHIND, Due, End, World};
use crate::choice::{Choice, Damage};

impl World {
    /// All that may happen next, the usual first.
    pub(crate) fn choices(&self) -> Vec<Choice> {
        let next = self.next();
        let mut choices = Vec::new();
        choices.extend(next.map(|_| Choice::Next));
        // The instant is over, and nothing else is due just behind it.
        let is_over = next.is_none_or(|(at, _)| at > self.now + BEHIND);
        if is_over {
            self.usual_requests(&mut choices);
        }
        if self.faults_left > 0 {
            if let Some((_, Due::Arrival(end))) = next {
                self.faults_of_arrival(end, &mut choices);
            }
            if is_over {
                self.faults_out_of_turn(&mut choices);
            }
        }
        choices
    }

    /// Where nothing else is due, the first of these is the usual.
    fn usual_requests(&self, choices: &mut Vec<Choice>) {
        for (end, plugin) in self.plugins() {
            if plugin.is_paused() {
                choices.push(Choice::Resume(end));
            }
            if plugin.keeps() {
                choices.push(Choice::PutAway(end));
            }
            if plugin.is_down() {
                choices.push(Choice::Up(end));
            } else if plugin.job().is_none() && plugin.next_job().is_some() {
                choices.push(Choice::Begin(end));
            }
        }
    }

    fn faults_of_arrival(&self, end: usize, choices: &mut Vec<Choice>) {
        let is_sound = |coming: &&Arriving| coming.damage.is_none() && !coming.is_late;
        let Some(coming) = self.ways[end].front().filter(is_sound) else { return };
        choices.extend([
            Choice::Lost(end),
            Choice::Doubled(end),
            Choice::Damaged(end, Damage::Parity),
            Choice::Damaged(end, Damage::Break),
        ]);
        let others = self.scenario.alphabet.iter().filter(|byte| **byte != coming.byte);
        choices.extend(others.map(|byte| Choice::Altered(end, *byte)));
        if self.timer_of(end).is_some_and(|timer| timer > coming.at) {
            choices.extend([Choice::AtTimer(end), Choice::AfterTimer(end)]);
        }
        if matches!(self.ends[end], End::PlugIn(_)) {
            choices.push(Choice::Late(end));
        }
    }

    fn faults_out_of_turn(&self, choices: &mut Vec<Choice>) {
        for end in 0..2 {
            if self.ways[end].is_empty() {
                let alphabet = self.scenario.alphabet.iter();
                choices.extend(alphabet.map(|byte| Choice::Inserted(end, *byte)));
            }
        }
        // Of a port that is gone a host asks nothing.
        for (end, plugin) in self.plugins().filter(|(_, plugin)| !plugin.is_down()) {
            if plugin.job().is_some() {
                choices.push(Choice::Abort(end));
                if !plugin.is_paused() {
                    choices.push(Choice::Pause(end));
                }
            }
            if plugin.has_delivery() {
                choices.push(Choice::AbortDelivery(end));
            }
            if plugin.is_held() {
                choices.push(Choice::Force(end));
            }
            if self.scenario.has_small_room() && !plugin.keeps() {
                choices.push(Choice::Keep(end));
            }
            choices.extend([Choice::Down(end), Choice::Swap(end)]);
        }
    }
}
