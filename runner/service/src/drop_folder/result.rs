//! What stands beside a file that was put away: what became of it, in plain sentences.

use std::fmt::Write as _;

use softplug_live::plain_text;

use super::place::Shelf;
use crate::jobs::{Claimed, Job, State, grouped};
use crate::view::utc;

const COPY: &str = "Copy under another name, and rename the file when it is whole.";

/// What a file is when its job has ended, beside what was taken of it.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Now {
    AsTaken,
    /// It has another size.
    OfSize(u64),
    /// It has the same size, and says something else.
    Rewritten,
    /// It cannot be read any more.
    Unreadable,
    /// Something that is no file is in its place.
    NoFile,
    /// Somebody has removed it.
    Gone,
}

/// A job has ended: where its file goes, and what is said.
pub(super) fn of_job(job: &Job, claimed: Claimed, now: Now) -> (Shelf, String) {
    let (id, link) = (job.id, &job.spec.link);
    let bytes = grouped(claimed.size);
    let is_all = job.state == State::Done && job.extent.surely >= job.size();
    let mut text = if is_all {
        format!("Job {id} is done: all of this program, {bytes} bytes, has left for \"{link}\".\n")
    } else {
        let state = job.state.name();
        let why = job.reason.as_ref().map(|reason| {
            let at =
                reason.check.as_ref().filter(|at| at.line > 0).map_or_else(String::new, |at| {
                    format!(
                        " (line {}, column {})",
                        grouped(at.line.into()),
                        grouped(at.column.into())
                    )
                });
            format!(": {}{at}", plain_text(&reason.text))
        });
        let how = job.progress(None).text;
        format!(
            "Job {id} is {state}{}.\nOf this program, {bytes} bytes, for \"{link}\": {}.\n",
            why.unwrap_or_default(),
            if how.is_empty() { "nothing has left".to_owned() } else { how },
        )
    };
    let _ = write!(text, "It was given at {}", utc(job.created));
    for (what, at) in [("began", job.began), ("ended", job.ended)] {
        if let Some(at) = at {
            let _ = write!(text, ", {what} at {}", utc(at));
        }
    }
    text.push_str(".\n");
    let _ = match now {
        Now::AsTaken => Ok(()),
        Now::OfSize(size) => writeln!(
            text,
            "The file has been written to after it was taken: it has {} bytes now, {bytes} were \
             taken. {COPY}",
            grouped(size)
        ),
        Now::Rewritten => writeln!(
            text,
            "The file has been written to after it was taken: what it says now is not what was \
             taken. {COPY}"
        ),
        Now::Unreadable => writeln!(
            text,
            "The file cannot be read any more: nobody knows whether it was written to after it was \
             taken."
        ),
        Now::NoFile => writeln!(text, "What lies here now is no file, and not what was taken."),
        Now::Gone => writeln!(text, "Somebody has removed the file from work while it was a job."),
    };
    if !is_all {
        let _ = writeln!(
            text,
            "What to do: put the file into the folder again to send all of it, or restart the job, \
             from a block if need be: softplug job restart {id} --from-block N"
        );
    }
    (if is_all { Shelf::Done } else { Shelf::Failed }, text)
}

/// The job is too old: nobody knows any more how it ended.
pub(super) fn of_forgotten(claimed: Claimed) -> String {
    format!(
        "Job {} was made of this file, {} bytes, and has ended. The gateway no longer knows how.\n\
         What to do: look at the machine, and put the file into the folder again if it lacks it.\n",
        claimed.job,
        grouped(claimed.size)
    )
}

/// It never became a job.
pub(super) fn of_refused(why: &str) -> String {
    format!(
        "This file has not become a job, nothing of it was sent: {}.\n\
         What to do: mend that, and put the file into the folder again.\n",
        plain_text(why.trim_end_matches('.'))
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_says_what_to_do() {
        assert_eq!(
            of_refused("the program is larger than 9 bytes, which is the most that is taken"),
            "This file has not become a job, nothing of it was sent: the program is larger than 9 \
             bytes, which is the most that is taken.\n\
             What to do: mend that, and put the file into the folder again.\n"
        );
    }
}
