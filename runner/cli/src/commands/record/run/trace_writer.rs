//! The trace on its way to the disk: written as it comes, in parts that a trace
//! may be long.

use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf};

use softplug_trace::{FrontMatter, Line, LineSettings, Trace, limits};

use crate::failure::Failure;
use crate::files::{Partial, unwritable};
use crate::screen::Screen;

/// Where a part ends: with room for a last batch below what a trace may have.
const PART: Limits = Limits { bytes: limits::FILE_BYTES / 4 * 3, lines: limits::LINES / 4 * 3 };
/// Lines that wait for the disk at the most.
const BATCH: usize = 256;

/// How long a part may get.
struct Limits {
    bytes: usize,
    lines: usize,
}

/// Writes lines into a file, and into further ones as it gets long.
pub(super) struct TraceWriter {
    out: PathBuf,
    force: bool,
    front: FrontMatter,
    part: u32,
    partial: Partial,
    batch: Vec<Line>,
    bytes: usize,
    lines: usize,
    complete: Vec<PathBuf>,
    limits: Limits,
    /// The head is written.
    is_begun: bool,
}

impl TraceWriter {
    /// Makes the first part's file.
    pub(super) fn create(out: &Path, force: bool, front: FrontMatter) -> Result<Self, Failure> {
        let partial = Partial::create(out, force)?;
        Ok(Self {
            out: out.to_owned(),
            force,
            front,
            part: 1,
            partial,
            batch: Vec::new(),
            bytes: 0,
            lines: 0,
            complete: Vec::new(),
            limits: PART,
            is_begun: false,
        })
    }

    /// Says where that is what a killed recording left, if there was something.
    pub(super) fn say_left(&self, screen: &Screen) {
        self.partial.say_left(screen);
    }

    /// Whether something stands in it: then it is known what its line is.
    pub(super) fn is_begun(&self) -> bool {
        self.is_begun
    }

    /// The line as it stands, or will stand, in it.
    pub(super) fn line(&self) -> LineSettings {
        self.front.line
    }

    /// Another line, before something stands in it.
    pub(super) fn set_line(&mut self, line: LineSettings) {
        debug_assert!(!self.is_begun, "the head is written");
        self.front.line = line;
    }

    /// Adds a line; the disk has it at the next [`flush`](Self::flush) at the latest.
    pub(super) fn add(&mut self, line: Line) -> Result<(), Failure> {
        self.batch.push(line);
        if self.batch.len() < BATCH { Ok(()) } else { self.flush() }
    }

    /// Writes what waits.
    pub(super) fn flush(&mut self) -> Result<(), Failure> {
        if self.batch.is_empty() {
            return Ok(());
        }
        if !std::mem::replace(&mut self.is_begun, true) {
            let head = self.head();
            self.write(&head)?;
        }
        if self.bytes >= self.limits.bytes || self.lines >= self.limits.lines {
            self.next_part()?;
        }
        let body = std::mem::take(&mut self.batch);
        self.lines += body.len();
        let front = self.part_front();
        let head = Trace { front: front.clone(), body: Vec::new() }.format().len();
        let text = Trace { front, body }.format();
        self.write(&text[head..])
    }

    /// Writes what waits and gives the file its name. All files, in order.
    pub(super) fn finish(mut self) -> Result<Vec<PathBuf>, Failure> {
        self.flush()?;
        self.complete.push(self.partial.complete()?);
        Ok(self.complete)
    }

    fn next_part(&mut self) -> Result<(), Failure> {
        self.part += 1;
        let next = Partial::create(&numbered(&self.out, self.part), self.force)?;
        let last = std::mem::replace(&mut self.partial, next);
        self.complete.push(last.complete()?);
        (self.bytes, self.lines) = (0, 0);
        let head = self.head();
        self.write(&head)
    }

    fn head(&self) -> String {
        Trace { front: self.part_front(), body: Vec::new() }.format()
    }

    fn part_front(&self) -> FrontMatter {
        let mut front = self.front.clone();
        if self.part > 1 {
            front.id = format!("{}.part-{}", front.id, self.part);
            front.title = format!("{}, part {}", front.title, self.part);
        }
        front
    }

    fn write(&mut self, text: &str) -> Result<(), Failure> {
        self.bytes += text.len();
        let written = self.partial.file.write_all(text.as_bytes());
        written.map_err(|error| unwritable(self.partial.file.path(), &error))
    }
}

/// `session.spt` becomes `session-2.spt`.
fn numbered(out: &Path, part: u32) -> PathBuf {
    let mut name = out.file_stem().map_or_else(OsString::new, OsString::from);
    name.push(format!("-{part}"));
    if let Some(extension) = out.extension() {
        name.push(".");
        name.push(extension);
    }
    out.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use softplug_trace::{Entry, Given, Payload, SourceLine, Time, What, When};

    use super::*;

    #[test]
    fn what_is_too_long_goes_on_in_another_file() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("session.spt");
        let head = "id: a.b\ntitle: T\nprofile: a\nclauses: a.c\nlevel: may\n\
                    line: 9600 8N1\nsince: 1\norigin: hand-written\n---\n. 0.0\n";
        let front = Trace::parse(head).unwrap().front;
        let mut writer = TraceWriter::create(&out, false, front).unwrap();
        writer.limits = Limits { bytes: usize::MAX, lines: 300 };
        for at in 0..1_000 {
            let what = What::Given(Given::Receive(Payload::from_bytes(b"A")));
            let when = When::at(Time(at));
            writer.add(Line::Entry(Entry { when, what, line: SourceLine::default() })).unwrap();
        }
        let files = writer.finish().unwrap();
        assert_eq!(files, [out.clone(), folder.path().join("session-2.spt")]);
        let traces: Vec<_> = files
            .iter()
            .map(|file| Trace::parse(&std::fs::read_to_string(file).unwrap()).unwrap())
            .collect();
        let times = traces.iter().flat_map(Trace::entries).map(|entry| entry.when.from.0);
        assert!(times.eq(0..1_000));
        assert_eq!((&*traces[0].front.id, &*traces[1].front.id), ("a.b", "a.b.part-2"));
        // Nothing is left behind, and nothing is overwritten by the next one.
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
        assert!(TraceWriter::create(&out, false, traces[0].front.clone()).is_err());
    }
}
