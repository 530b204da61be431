//! The journal: what happened, when, to which link and job.

use serde::{Deserialize, Serialize};
use softplug_abi::JobId;
use softplug_live::is_plain;

pub use crate::view::{JournalKind as Subject, JournalWeight as Weight};

/// A text that comes from a machine or a plug-in is no longer than this here.
const TEXT_BYTES: usize = 2_000;

/// What is to be written down.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Note {
    /// What it is about.
    pub subject: Subject,
    /// How much it matters.
    #[serde(default)]
    pub weight: Weight,
    /// The link.
    #[serde(default)]
    pub link: Option<String>,
    /// The job.
    #[serde(default)]
    pub job: Option<JobId>,
    /// One sentence.
    pub text: String,
}

impl Note {
    /// About no link and no job, of normal weight.
    pub fn new(subject: Subject, text: impl Into<String>) -> Self {
        Self { subject, weight: Weight::Normal, link: None, job: None, text: text.into() }
    }

    /// This entry about a link.
    pub fn of_link(self, link: impl Into<String>) -> Self {
        Self { link: Some(link.into()), ..self }
    }

    /// This entry about a job.
    pub fn of_job(self, job: JobId) -> Self {
        Self { job: Some(job), ..self }
    }

    /// This entry, mattering so much.
    pub fn weighing(self, weight: Weight) -> Self {
        Self { weight, ..self }
    }

    /// Bounded, and without anything that moves a cursor.
    pub(super) fn tamed(mut self) -> Self {
        let mut end = self.text.len().min(TEXT_BYTES);
        while !self.text.is_char_boundary(end) {
            end -= 1;
        }
        self.text.truncate(end);
        if !self.text.chars().all(is_plain) {
            let plain = |c: char| if is_plain(c) { c } else { '\u{fffd}' };
            self.text = self.text.chars().map(plain).collect();
        }
        self
    }
}

/// A note with its place and time.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Entry {
    /// Its number: later ones are higher.
    #[serde(default)]
    pub number: u64,
    /// When it was written, in milliseconds since 1970.
    pub time: u64,
    /// What happened.
    #[serde(flatten)]
    pub note: Note,
}

/// Which entries are wanted.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct EntryFilter {
    /// Of this link only.
    pub link: Option<String>,
    /// Of this job only.
    pub job: Option<JobId>,
    /// About this only.
    pub subject: Option<Subject>,
    /// That matter at least so much.
    pub at_least: Weight,
    /// With this, in small letters, in the text or the link's name.
    pub find: Option<String>,
    /// Written at this time or later, in milliseconds since 1970.
    pub since: Option<u64>,
    /// Written before this time.
    pub until: Option<u64>,
    /// Older than the entry of this number.
    pub before: Option<u64>,
    /// At most so many.
    pub most: usize,
}

impl EntryFilter {
    pub(super) fn takes(&self, entry: &Entry) -> bool {
        let note = &entry.note;
        self.link.as_ref().is_none_or(|link| note.link.as_ref() == Some(link))
            && self.job.is_none_or(|job| note.job == Some(job))
            && self.subject.is_none_or(|subject| note.subject == subject)
            && note.weight >= self.at_least
            && self.since.is_none_or(|since| entry.time >= since)
            && self.until.is_none_or(|until| entry.time < until)
            && self.find.as_ref().is_none_or(|find| {
                let has = |text: &str| text.to_lowercase().contains(find);
                has(&note.text) || note.link.as_deref().is_some_and(has)
            })
    }
}

/// How much is kept.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Keep {
    /// Entries of the journal.
    pub entries: u64,
    /// Days for which an entry is kept.
    pub days: u64,
    /// Jobs that have ended.
    pub jobs: usize,
}

impl Default for Keep {
    fn default() -> Self {
        Self { entries: 100_000, days: 400, jobs: 10_000 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_comes_from_outside_is_bounded_and_plain() {
        let note =
            Note::new(Subject::Fault, format!("a\u{1b}[2J\u{202e}{}", "ä".repeat(2_000))).tamed();
        assert!(note.text.starts_with("a\u{fffd}[2J\u{fffd}ä"));
        assert!(note.text.len() <= TEXT_BYTES + 4, "{}", note.text.len());
    }
}
