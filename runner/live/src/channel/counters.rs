//! What a channel counts.

use softplug_abi::{LineErrorKind, Micros};

use crate::port::Input;

/// Counts since the link was opened.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub struct Counters {
    /// Good bytes received.
    pub bytes_in: u64,
    /// Bytes that the port took.
    pub bytes_out: u64,
    /// Line errors, by [`LineErrorKind`] in the order of their codes.
    pub line_errors: [u64; LineErrorKind::ALL.len()],
    /// How often the partner held the transmit queue. What a pause of the host's holds does not
    /// count here and below.
    pub holds: u64,
    /// How long it was held in all.
    pub held: Micros,
    /// Characters in flight, beyond recall, when it was held: in all.
    pub after_hold: u64,
    /// The most at one time.
    pub after_hold_most: u64,
    /// How often the line stood still for a character or longer although bytes waited: what gives them
    /// to the port was late by more than the port had.
    pub gaps: u64,
    /// The longest of these times.
    pub longest_gap: Micros,
    /// The latest write left bytes behind that may leave, and nothing has stopped them since.
    leaves_some: bool,
    /// Since when the partner has held it.
    held_since: Option<Micros>,
    /// Whether it stands, whoever wants that.
    stands: bool,
    /// The host has paused the job: that it stands says nothing of the partner.
    is_paused: bool,
    /// The partner held it when the pause began.
    was_held: bool,
}

impl Counters {
    /// Whether the partner holds the transmit queue, as far as is known: not while the host has
    /// paused the job.
    pub fn is_held(&self) -> bool {
        self.held_since.is_some()
    }

    /// The counts at `now`, a hold that is under way included.
    pub(crate) fn at(mut self, now: Micros) -> Self {
        if let Some(since) = self.held_since {
            self.held = self.held + (now - since);
        }
        self
    }

    pub(crate) fn count_input(&mut self, input: &Input<'_>) {
        match input {
            Input::Bytes(bytes) => self.bytes_in += bytes.len() as u64,
            Input::LineError { kind, .. } => {
                self.line_errors[usize::from(kind.code()) - 1] += 1;
            }
        }
    }

    /// Nothing waits that may leave: whatever comes now does not come late.
    pub(crate) fn nothing_to_send(&mut self) {
        self.leaves_some = false;
    }

    /// Bytes were given to a line that had stood still for `idle`; a character takes `character`.
    /// More of them wait, or not.
    pub(crate) fn wrote(&mut self, count: usize, idle: Micros, character: Micros, has_more: bool) {
        self.bytes_out += count as u64;
        if self.leaves_some && idle >= character && idle > Micros::ZERO {
            self.gaps += 1;
            self.longest_gap = self.longest_gap.max(idle);
        }
        self.leaves_some = has_more;
    }

    pub(crate) fn hold(&mut self, now: Micros, in_flight: u64) {
        self.stands = true;
        if self.held_since.is_none() && !self.is_paused {
            self.after_hold += in_flight;
            self.after_hold_most = self.after_hold_most.max(in_flight);
            self.holds += 1;
            self.held_since = Some(now);
        }
    }

    pub(crate) fn release(&mut self, now: Micros) {
        (self.stands, self.was_held) = (false, false);
        self.end_hold(now);
    }

    /// The host pauses the job: to be told before the plug-in is. Ends the pause: after it.
    pub(crate) fn pause(&mut self, now: Micros, is_paused: bool) {
        if is_paused == self.is_paused {
            return;
        }
        self.is_paused = is_paused;
        if is_paused {
            self.was_held = self.held_since.is_some();
            self.end_hold(now);
        } else if self.stands {
            // It still stands: now that is the partner's doing.
            self.holds += u64::from(!std::mem::take(&mut self.was_held));
            self.held_since = Some(now);
        }
    }

    fn end_hold(&mut self, now: Micros) {
        if let Some(since) = self.held_since.take() {
            self.held = self.held + (now - since);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pause_is_no_hold_of_the_partners() {
        let mut counters = Counters::default();
        counters.pause(Micros(0), true);
        counters.hold(Micros(1), 3);
        assert!(!counters.is_held());
        counters.release(Micros(5));
        counters.pause(Micros(5), false);
        assert_eq!((counters.holds, counters.at(Micros(9)).held), (0, Micros::ZERO));
        assert_eq!(counters.after_hold, 0);
    }

    /// 16 bytes, behind this time.
    fn wrote(counters: &mut Counters, idle: i64, has_more: bool) {
        counters.wrote(16, Micros(idle), Micros(250), has_more);
    }

    #[test]
    fn less_than_a_character_is_no_gap() {
        let mut counters = Counters::default();
        wrote(&mut counters, 5_000, true);
        for idle in [0, 249, 250, 900, 300] {
            wrote(&mut counters, idle, true);
        }
        assert_eq!((counters.gaps, counters.longest_gap), (3, Micros(900)));
        // Where the rate is unknown nothing is.
        counters.wrote(1, Micros::ZERO, Micros::ZERO, true);
        assert_eq!((counters.gaps, counters.bytes_out), (3, 97));
    }

    #[test]
    fn a_line_for_which_nothing_waited_or_that_was_held_has_no_gap() {
        let mut counters = Counters::default();
        wrote(&mut counters, 5_000, false);
        wrote(&mut counters, 5_000, true);
        counters.nothing_to_send();
        wrote(&mut counters, 5_000, true);
        assert_eq!(counters.gaps, 0);
        wrote(&mut counters, 5_000, true);
        assert_eq!(counters.gaps, 1);
    }

    #[test]
    fn a_hold_that_outlasts_a_pause_is_one_hold_and_counts_without_it() {
        let mut counters = Counters::default();
        counters.hold(Micros(10), 2);
        counters.pause(Micros(20), true);
        assert!(!counters.is_held());
        counters.pause(Micros(50), false);
        assert!(counters.is_held());
        assert_eq!((counters.holds, counters.at(Micros(55)).held), (1, Micros(15)));
        counters.release(Micros(60));
        assert!(!counters.is_held());
        // Held while it was paused: known from the pause's end on.
        counters.pause(Micros(70), true);
        counters.hold(Micros(71), 1);
        counters.pause(Micros(80), false);
        assert_eq!((counters.holds, counters.is_held()), (2, true));
    }
}
