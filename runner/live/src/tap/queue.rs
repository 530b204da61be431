//! What has come from one side and waits to be passed on: bytes, and what
//! happened between them, in the line's order.

use std::collections::VecDeque;

use softplug_abi::LineErrorKind;

use crate::port::Input;

/// Bytes with the places of what is no good byte.
#[derive(Debug, Default)]
pub(super) struct Queue {
    bytes: VecDeque<u8>,
    marks: VecDeque<Mark>,
    /// Bytes put in and taken out so far.
    put: u64,
    taken: u64,
}

/// Something that is no good byte.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) struct Mark {
    /// Bytes that were put in before it.
    at: u64,
    pub(super) kind: LineErrorKind,
    /// The damaged character, which is not among the bytes.
    pub(super) byte: Option<u8>,
    pub(super) span: u32,
}

/// What is first in the queue.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum First<'a> {
    Bytes(&'a [u8]),
    Mark(Mark),
}

impl Queue {
    pub(super) fn put(&mut self, input: &Input<'_>) {
        match *input {
            Input::Bytes(bytes) => {
                self.bytes.extend(bytes);
                self.put += bytes.len() as u64;
            }
            Input::LineError { kind, byte, span } => {
                self.marks.push_back(Mark { at: self.put, kind, byte, span });
            }
        }
    }

    /// Bytes and marks that wait.
    pub(super) fn len(&self) -> usize {
        self.bytes.len() + self.marks.len()
    }

    pub(super) fn first(&self) -> Option<First<'_>> {
        let good = match self.marks.front() {
            Some(mark) if mark.at == self.taken => return Some(First::Mark(*mark)),
            Some(mark) => (mark.at - self.taken) as usize,
            None => self.bytes.len(),
        };
        let (run, _) = self.bytes.as_slices();
        (good > 0).then(|| First::Bytes(&run[..good.min(run.len())]))
    }

    /// The first `count` bytes are passed on.
    pub(super) fn take_bytes(&mut self, count: usize) {
        self.bytes.drain(..count);
        self.taken += count as u64;
    }

    /// The mark that is first is passed on.
    pub(super) fn take_mark(&mut self) {
        self.marks.pop_front();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fmt::Write as _;

    #[test]
    fn marks_keep_their_place_among_the_bytes() {
        let mut queue = Queue::default();
        let error = |kind, byte| Input::LineError { kind, byte, span: 0 };
        queue.put(&Input::Bytes(b"AB"));
        queue.put(&error(LineErrorKind::Parity, Some(b'C')));
        queue.put(&error(LineErrorKind::Break, None));
        queue.put(&Input::Bytes(b"DE"));
        assert_eq!(queue.len(), 6);
        let mut out = String::new();
        loop {
            match queue.first() {
                None => break,
                Some(First::Bytes(bytes)) => {
                    out.push(char::from(bytes[0]));
                    queue.take_bytes(1);
                }
                Some(First::Mark(mark)) => {
                    let _ = write!(out, "<{} {:?}>", mark.kind, mark.byte.map(char::from));
                    queue.take_mark();
                }
            }
        }
        assert_eq!((out.as_str(), queue.len()), ("AB<parity Some('C')><break None>DE", 0));
    }
}
