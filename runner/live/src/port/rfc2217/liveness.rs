//! Whether a device server still lives, asked over the protocol itself: its
//! TCP can go on answering when the server has hung.
//!
//! A server takes things in turn, and one whose machine holds the line may keep
//! our bytes, and the question behind them, for hours. So silence proves
//! something only if all that was written before was read, which an answer
//! tells, and nothing was written since.

use softplug_abi::Micros;

const LOOK_EVERY: Micros = Micros::from_secs(5);
/// Looks without a byte heard before the server is asked.
const SILENT_LOOKS: u32 = 2;
/// Looks that an answer may take.
const PATIENCE: u32 = 3;

#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Look {
    Fine,
    /// Put the question.
    Ask,
    Dead,
}

#[derive(Debug, Default)]
pub(super) struct Liveness {
    next: Micros,
    has_heard: bool,
    silent_looks: u32,
    /// All that was written has been read by the server.
    is_read: bool,
    question: Option<Question>,
}

#[derive(Debug)]
struct Question {
    /// Answers before it.
    rates: u64,
    /// Everything before it had been read.
    was_read: bool,
    /// Something was written since.
    is_followed: bool,
    looks: u32,
}

impl Liveness {
    /// Something came.
    pub(super) fn heard(&mut self) {
        self.has_heard = true;
    }

    /// Bytes were written.
    pub(super) fn wrote(&mut self) {
        self.is_read = false;
        if let Some(question) = &mut self.question {
            question.is_followed = true;
        }
    }

    /// When to look next.
    pub(super) fn poll_timeout(&self) -> Micros {
        self.next
    }

    /// `rates`: answers so far. `is_idle`: nothing waits to be written.
    pub(super) fn look(&mut self, now: Micros, rates: u64, is_idle: bool) -> Look {
        if now < self.next {
            return Look::Fine;
        }
        self.next = now + LOOK_EVERY;
        if let Some(question) = self.question.take_if(|question| rates > question.rates) {
            self.is_read |= !question.is_followed;
        }
        if std::mem::take(&mut self.has_heard) {
            self.silent_looks = 0;
        } else {
            self.silent_looks += 1;
        }
        match &mut self.question {
            Some(question) => {
                question.looks += 1;
                let is_late = question.looks >= PATIENCE && self.silent_looks >= PATIENCE;
                let proves = question.was_read && !question.is_followed;
                if is_late && proves { Look::Dead } else { Look::Fine }
            }
            None if self.silent_looks >= SILENT_LOOKS && is_idle => {
                self.question =
                    Some(Question { rates, was_read: self.is_read, is_followed: false, looks: 0 });
                Look::Ask
            }
            None => Look::Fine,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Looks every 5 s; gives what the looks said, Fine left out.
    fn looks(liveness: &mut Liveness, rates: u64, count: u32) -> Vec<Look> {
        let looks = (0..count).map(|_| liveness.look(liveness.poll_timeout(), rates, true));
        looks.filter(|look| *look != Look::Fine).collect()
    }

    /// A server that has answered one question.
    fn known() -> Liveness {
        let mut liveness = Liveness::default();
        assert_eq!(looks(&mut liveness, 1, 2), [Look::Ask]);
        liveness.heard();
        assert_eq!(looks(&mut liveness, 2, 1), []);
        liveness
    }

    #[test]
    fn a_server_that_hangs_is_found_within_half_a_minute() {
        assert_eq!(looks(&mut known(), 2, 5), [Look::Ask, Look::Dead]);
    }

    #[test]
    fn a_server_that_answers_is_asked_now_and_then() {
        let mut liveness = known();
        for rates in 2..20 {
            assert_eq!(looks(&mut liveness, rates, 2), [Look::Ask]);
            liveness.heard();
            assert_eq!(looks(&mut liveness, rates + 1, 1), []);
        }
    }

    #[test]
    fn a_server_that_never_answers_such_questions_may_live() {
        assert_eq!(looks(&mut Liveness::default(), 1, 50), [Look::Ask]);
    }

    #[test]
    fn a_machine_that_holds_the_line_may_do_so_for_hours() {
        let mut liveness = known();
        liveness.wrote();
        assert_eq!(looks(&mut liveness, 2, 5_000), [Look::Ask]);
        // The line is free: the answer comes, and from then on silence counts.
        liveness.heard();
        assert_eq!(looks(&mut liveness, 3, 6), [Look::Ask, Look::Dead]);
    }

    #[test]
    fn an_answer_says_nothing_of_what_was_written_after_the_question() {
        let mut liveness = known();
        assert_eq!(looks(&mut liveness, 2, 2), [Look::Ask]);
        liveness.wrote();
        liveness.heard();
        assert_eq!(looks(&mut liveness, 3, 100), [Look::Ask]);
    }
}
