//! Times that run out.

use super::{Fe, State};
use softplug_abi::{Failure, Micros};

impl Fe {
    /// When the next time runs out.
    pub(super) fn deadline(&self) -> Option<Micros> {
        let character = self.frame.as_ref().map(|frame| frame.latest + self.rules.character_time);
        let request = self.job.as_ref().and_then(|job| job.until);
        let state = match &self.state {
            State::Receiving(reception) if self.frame.is_none() && reception.waiting.is_none() => {
                self.rules.block_time.map(|time| reception.latest + time)
            }
            State::Granted { until, .. } => Some(*until),
            State::Sending(sending) => sending.answer_until(),
            State::Receiving(_) | State::Asking { .. } | State::Idle => None,
        };
        [character, request, state].into_iter().flatten().min()
    }

    pub(super) fn runs_out(&mut self, deadline: Micros) {
        let character = self.frame.as_ref().map(|frame| frame.latest + self.rules.character_time);
        if character == Some(deadline) {
            if let Some(frame) = &mut self.frame {
                frame.is_bad = true;
            }
            return self.frame_ends();
        }
        if self.job.as_ref().is_some_and(|job| job.until == Some(deadline)) {
            return self.fail_job(Failure::NoAnswer, "heidenhain-fe.tx.request-time");
        }
        match self.state {
            State::Receiving(_) => {
                self.end_delivery(Some(Failure::NoAnswer), "heidenhain-fe.rx.silence");
                self.end_all("heidenhain-fe.rx.silence");
            }
            State::Granted { .. } => self.end_all("heidenhain-fe.tx.granted"),
            State::Sending(_) => {
                self.fail_job(Failure::NoAnswer, "heidenhain-fe.tx.answer-time");
                self.end_all("heidenhain-fe.tx.answer-time");
            }
            State::Asking { .. } | State::Idle => {}
        }
    }
}
