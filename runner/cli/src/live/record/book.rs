//! The trace on its way to the disk: written as it comes, in parts that a trace
//! may be long.

use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf};

use softplug_trace::{FrontMatter, Line, Trace, limits};

use crate::failure::Failure;
use crate::files::{Partial, unwritable};

/// Where a part ends: with room for a last batch below what a trace may have.
const PART_BYTES: usize = limits::FILE_BYTES / 4 * 3;
const PART_LINES: usize = limits::LINES / 4 * 3;
/// Lines that wait for the disk at the most.
const BATCH: usize = 256;

/// Writes lines into a file, and into further ones as it gets long.
pub(super) struct Book {
    out: PathBuf,
    force: bool,
    front: FrontMatter,
    part: u32,
    partial: Partial,
    batch: Vec<Line>,
    bytes: usize,
    lines: usize,
    complete: Vec<PathBuf>,
}

impl Book {
    /// Makes the first part's file.
    pub(super) fn create(out: &Path, force: bool, front: FrontMatter) -> Result<Self, Failure> {
        let partial = Partial::create(out, force)?;
        let mut book = Self {
            out: out.to_owned(),
            force,
            front,
            part: 1,
            partial,
            batch: Vec::new(),
            bytes: 0,
            lines: 0,
            complete: Vec::new(),
        };
        let head = book.head();
        book.write(&head)?;
        Ok(book)
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
        if self.bytes >= PART_BYTES || self.lines >= PART_LINES {
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
        written.map_err(|error| unwritable(&self.partial.path, &error))
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
