//! How far a job is, in numbers and in words: made here, shown everywhere.

use super::{Extent, Job, Kind, State};
use crate::view::{BlockView, JobProgress};

/// What the lane of a job that is under way knows of it now, counted from the beginning of the
/// program.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct LaneProgress {
    /// Bytes of the program that the plug-in took.
    pub taken: u64,
    /// Which bytes have left.
    pub extent: Extent,
    /// The machine holds the line.
    pub is_held: bool,
    /// What the machine or its operator has to do before the job goes on, in a sentence.
    pub awaits: Option<String>,
    /// The program is looked at; nothing of it is sent yet.
    pub is_check: bool,
    /// Bytes that left in a second, over the last seconds.
    pub rate: Option<u64>,
    /// The block that is being sent.
    pub block: Option<BlockView>,
}

impl Job {
    /// How far it is. `lately`: of one that is under way, what its lane knows.
    pub fn progress(&self, lane_progress: Option<&LaneProgress>) -> JobProgress {
        let known = self.extent;
        let (taken, extent) = match lane_progress {
            None => (self.taken, known),
            // What is written down lags behind, and was the lane's, too.
            Some(lane_progress) => {
                let surely = lane_progress.extent.surely.max(known.surely);
                (
                    lane_progress.taken,
                    Extent { surely, maybe: lane_progress.extent.maybe.max(surely) },
                )
            }
        };
        let size = self.spec.data.map(|data| data.size);
        let percent = |size: u64| (extent.surely.min(size) * 100 / size) as u8;
        let mut progress = JobProgress {
            size,
            taken: taken.max(extent.surely),
            maybe_left: extent.maybe,
            surely_left: extent.surely,
            percent: size.filter(|size| *size > 0).map(percent),
            is_held: lane_progress.is_some_and(|lane_progress| lane_progress.is_held)
                && self.state == State::Running,
            awaits: lane_progress.and_then(|lane_progress| lane_progress.awaits.clone()),
            rate: None,
            remaining_us: None,
            block: None,
            text: String::new(),
        };
        if let Some(lane_progress) = lane_progress
            && !lane_progress.is_check
        {
            progress.block.clone_from(&lane_progress.block);
            let moves = self.state == State::Running && progress.awaits.is_none();
            progress.rate = lane_progress.rate.filter(|rate| moves && *rate > 0);
            let rest = size.map(|size| size.saturating_sub(extent.surely));
            // Nobody knows for how long the machine holds it.
            let rate = progress.rate.filter(|_| !progress.is_held);
            progress.remaining_us = rest.zip(rate).map(|(rest, rate)| {
                u64::try_from(u128::from(rest) * 1_000_000 / u128::from(rate)).unwrap_or(u64::MAX)
            });
        }
        progress.text = self
            .words(&progress, lane_progress.is_some_and(|lane_progress| lane_progress.is_check));
        progress
    }

    fn words(&self, progress: &JobProgress, is_check: bool) -> String {
        let mut parts = Vec::new();
        let moves_data = self.spec.kind == Kind::Send;
        if moves_data && self.has_begun() {
            parts.push(self.left_in_words(progress));
        } else if let Some(size) = progress.size {
            parts.push(format!("{} bytes", grouped(size)));
        } else if let Some(reception) = &self.reception {
            parts.push(format!("{} bytes came", grouped(reception.bytes)));
        }
        match self.state {
            State::Queued => parts.push("waits for its turn".to_owned()),
            State::Paused => parts.push("paused".to_owned()),
            State::Running if progress.is_held => parts.push("held by the machine".to_owned()),
            State::Running if is_check => parts.push("the program is checked".to_owned()),
            State::Running => parts.extend(progress.awaits.clone()),
            _ => {}
        }
        parts.join("; ")
    }

    /// `601 of 40,015 bytes have surely left, 1 %, up to 4,697 may have`.
    pub(super) fn left_in_words(&self, progress: &JobProgress) -> String {
        let JobProgress { size, maybe_left: maybe, surely_left: surely, .. } = *progress;
        let from = self.spec.from;
        let whole = size.map_or(String::new(), |size| format!(" of {}", grouped(size)));
        let percent = progress.percent.map_or(String::new(), |percent| format!(", {percent} %"));
        let bytes = |count: u64| format!("{}{whole} bytes", grouped(count));
        let text = match (self.state.is_final(), surely > from, maybe > surely) {
            (false, false, _) => "nothing has left yet".to_owned(),
            // While it is under way there is always something on its way.
            (false, true, _) | (true, true, false) => {
                format!("{} have left{percent}", bytes(surely))
            }
            (true, true, true) => {
                let surely = bytes(surely);
                format!("{surely} have surely left{percent}, up to {} may have", grouped(maybe))
            }
            (true, false, true) => {
                format!("nothing has surely left, up to {} may have", bytes(maybe))
            }
            (true, false, false) => "nothing has left".to_owned(),
        };
        match (from, self.spec.from_block) {
            (0, 0..=1) => text,
            (0, block) => format!("{text}; it began at block {}", grouped(block)),
            (from, _) => format!("{text}; it began behind byte {}", grouped(from)),
        }
    }
}

/// Digits in groups of three.
pub(crate) fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (at, digit) in digits.chars().enumerate() {
        if at > 0 && (digits.len() - at).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::{Data, JobSpec};
    use softplug_abi::JobId;
    use softplug_host::Digest;

    fn job(state: State, from: u64, surely: u64, maybe: u64) -> Job {
        let data = Data { digest: Digest::of(b"G1"), size: 40_015 };
        let spec = JobSpec { from, ..JobSpec::send("lathe", "O1", data) };
        let mut job = super::super::created(JobId(1), spec, state);
        job.began = (state != State::Queued).then_some(1);
        job.extent = Extent { surely, maybe };
        job
    }

    #[test]
    fn the_rest_is_known_while_something_moves() {
        let now = |state, rate, is_held| {
            let block = Some(BlockView { number: 7, text: "N7".to_owned() });
            let extent = Extent { surely: 30_015, maybe: 30_500 };
            let lane = LaneProgress { extent, is_held, rate, block, ..LaneProgress::default() };
            let progress = job(state, 0, 0, 0).progress(Some(&lane));
            (progress.rate, progress.remaining_us, progress.block.map(|block| block.number))
        };
        assert_eq!(now(State::Running, Some(960), false), (Some(960), Some(10_416_666), Some(7)));
        // For how long a machine holds the line, or somebody pauses, nobody knows.
        assert_eq!(now(State::Running, Some(960), true), (Some(960), None, Some(7)));
        assert_eq!(now(State::Paused, Some(960), false), (None, None, Some(7)));
        assert_eq!(now(State::Running, None, false), (None, None, Some(7)));
    }

    #[test]
    fn a_job_is_told_in_the_same_words_wherever_it_stands() {
        let text = |job: Job| job.progress(None).text;
        assert_eq!(text(job(State::Queued, 0, 0, 0)), "40,015 bytes; waits for its turn");
        assert_eq!(text(job(State::Running, 0, 0, 900)), "nothing has left yet");
        assert_eq!(text(job(State::Running, 0, 601, 900)), "601 of 40,015 bytes have left, 1 %");
        assert_eq!(
            text(job(State::Failed, 0, 601, 4_697)),
            "601 of 40,015 bytes have surely left, 1 %, up to 4,697 may have"
        );
        assert_eq!(
            text(job(State::Aborted, 0, 0, 300)),
            "nothing has surely left, up to 300 of 40,015 bytes may have"
        );
        assert_eq!(text(job(State::Interrupted, 0, 0, 0)), "nothing has left");
        assert_eq!(
            text(job(State::Done, 0, 40_015, 40_015)),
            "40,015 of 40,015 bytes have left, 100 %"
        );
        assert_eq!(
            text(job(State::Failed, 500, 500, 500)),
            "nothing has left; it began behind byte 500"
        );
    }

    #[test]
    fn what_the_lane_knows_goes_before_what_was_written_down() {
        let extent = Extent { surely: 7_000, maybe: 7_500 };
        let mut lane_progress = LaneProgress { taken: 8_000, extent, ..LaneProgress::default() };
        // 16 KiB were granted.
        let mut running = job(State::Running, 0, 601, 16_384);
        let progress = running.progress(Some(&lane_progress));
        let figures = (progress.surely_left, progress.maybe_left, progress.taken, progress.percent);
        assert_eq!(figures, (7_000, 7_500, 8_000, Some(17)));
        lane_progress.is_held = true;
        let held = running.progress(Some(&lane_progress));
        assert_eq!(held.text, "7,000 of 40,015 bytes have left, 17 %; held by the machine");
        // Paused is not held, whatever the queue does.
        running.state = State::Paused;
        let paused = running.progress(Some(&lane_progress));
        assert_eq!(paused.text, "7,000 of 40,015 bytes have left, 17 %; paused");
        assert!(!paused.is_held);
    }
}
