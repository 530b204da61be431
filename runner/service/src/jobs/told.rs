//! What the journal says of jobs.

use softplug_abi::JobId;
use std::fmt::Write as _;

use super::{Comparison, Job, Kind, Note, Reason, Reception, State, Subject, Weight};

pub(super) fn note(job: &Job, text: String) -> Note {
    Note::new(Subject::Job, text).of_link(&*job.spec.link).of_job(job.id).tamed()
}

pub(super) fn what(job: &Job) -> String {
    let mut text = match job.spec.kind {
        Kind::Send => "sends",
        Kind::Fetch => "fetches",
        Kind::Receive => "receives",
    }
    .to_owned();
    if let Some(program) = &job.spec.program {
        let _ = write!(text, " {program}");
        if let Some(named) = job.other_name() {
            let _ = write!(text, " ({})", named.escape_debug());
        }
    }
    if let Some(data) = job.spec.data {
        let _ = write!(text, ", {} bytes", data.size - job.spec.from);
    }
    if job.spec.from > 0 {
        let _ = write!(text, " from byte {}", job.spec.from);
    } else if job.spec.from_block > 1 {
        let _ = write!(text, " from block {}", job.spec.from_block);
    }
    if let Some(before) = job.spec.restarts {
        let _ = write!(text, ", in place of job {before}");
    }
    text
}

pub(super) fn ended_note(job: &Job) -> Note {
    let mut text = format!("job {} is {}", job.id, job.state.name());
    if let Some(reason) = &job.reason {
        let _ = write!(text, ": {}", reason.text);
    }
    let is_short =
        job.state == State::Done && job.spec.data.is_some_and(|data| job.extent.surely < data.size);
    if (job.state != State::Done || is_short) && job.spec.kind == Kind::Send {
        let _ = write!(text, "; {}", job.progress(None).text);
    }
    let weight = match job.state {
        _ if is_short => Weight::Warning,
        State::Failed | State::Interrupted => Weight::Warning,
        _ => Weight::Normal,
    };
    note(job, text).weighing(weight)
}

pub(super) fn received_note(
    job: &Job,
    name: Option<&str>,
    reception: &Reception,
    reason: Option<&Reason>,
) -> Note {
    let text = received_text(job.id, name, reception, reason);
    let weight = if reason.is_some() { Weight::Warning } else { Weight::Normal };
    Note::new(Subject::Reception, text).of_link(&*job.spec.link).of_job(job.id).weighing(weight)
}

fn received_text(
    id: JobId,
    name: Option<&str>,
    reception: &Reception,
    reason: Option<&Reason>,
) -> String {
    let Reception { file, bytes, compared, .. } = reception;
    let mut text = format!("job {id}: {bytes} bytes");
    if let Some(name) = name {
        let _ = write!(text, " of {name}");
    }
    text.push_str(" came");
    if let Some(reason) = reason {
        let _ = write!(text, ", not all: {}", reason.text);
    }
    if let Some(file) = file {
        let _ = write!(text, "; kept as {file}");
    }
    match compared {
        None => {}
        Some(Comparison { with, differs_at: None }) => {
            let _ = write!(text, "; the same as job {with} sent");
        }
        Some(Comparison { with, differs_at: Some(at) }) => {
            let _ = write!(text, "; differs from what job {with} sent at byte {at}");
        }
    }
    text
}
