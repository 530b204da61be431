//! Frames out of a stream of bytes that may be damaged.

use alloc::boxed::Box;
use alloc::vec;
use softplug_unit_protocol::{Frame, HEADER, TRAILER, length_of_frame};

/// What comes, until a frame is whole.
pub(crate) struct Frames {
    bytes: Box<[u8]>,
    length: usize,
}

impl Frames {
    /// For frames with so many bytes of payload at most.
    pub(crate) fn new(payload: usize) -> Self {
        Self { bytes: vec![0; HEADER + payload + TRAILER].into(), length: 0 }
    }

    /// Takes a byte; the length of the frame that is whole with it. It stands at the front until
    /// [`next`](Self::next).
    ///
    /// Where a frame cannot begin, or is longer than one that this end takes, a byte is passed over; and where
    /// the check of one does not fit, its first byte only: the next one may begin inside.
    pub(crate) fn take(&mut self, byte: u8) -> Option<usize> {
        self.bytes[self.length] = byte;
        self.length += 1;
        self.whole()
    }

    fn whole(&mut self) -> Option<usize> {
        loop {
            match length_of_frame(&self.bytes[..self.length]) {
                Ok(Some(length)) if length <= self.bytes.len() => {
                    if self.length < length {
                        return None;
                    }
                    if Frame::decode(&self.bytes[..length]).is_ok() {
                        return Some(length);
                    }
                }
                Ok(None) => return None,
                Ok(Some(_)) | Err(_) => {}
            }
            self.drop_front(1);
        }
    }

    /// The frame at the front.
    pub(crate) fn frame(&self, length: usize) -> &[u8] {
        &self.bytes[..length]
    }

    /// Behind a frame of this length: whether another one is whole.
    pub(crate) fn next(&mut self, length: usize) -> Option<usize> {
        self.drop_front(length);
        self.whole()
    }

    fn drop_front(&mut self, count: usize) {
        self.bytes.copy_within(count..self.length, 0);
        self.length -= count;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use softplug_unit_protocol::FrameKind;

    fn frame(number: u32, payload: &[u8]) -> Vec<u8> {
        let kind = FrameKind::Data;
        let mut bytes = [0; 64];
        let frame = Frame { kind, session: 7, number, taken: 0, payload };
        let length = frame.encode(&mut bytes).unwrap();
        bytes[..length].to_vec()
    }

    /// The numbers of the frames that come of these bytes.
    fn numbers(bytes: &[u8]) -> Vec<u32> {
        let mut frames = Frames::new(16);
        let mut numbers = Vec::new();
        for &byte in bytes {
            let mut whole = frames.take(byte);
            while let Some(length) = whole {
                numbers.push(Frame::decode(frames.frame(length)).unwrap().number);
                whole = frames.next(length);
            }
        }
        numbers
    }

    #[test]
    fn frames_follow_each_other() {
        let stream = [frame(1, b"one"), frame(2, b""), frame(3, b"three")].concat();
        assert_eq!(numbers(&stream), [1, 2, 3]);
    }

    #[test]
    fn what_is_damaged_costs_no_more_than_itself() {
        let good = frame(9, b"good");
        let mut damaged = frame(8, b"damaged");
        damaged[17] ^= 1;
        assert_eq!(numbers(&[&damaged[..], &good].concat()), [9]);
        // One that was cut off: the next begins inside what it claims to be.
        assert_eq!(numbers(&[&frame(8, b"cut off")[..11], &good, &good].concat()), [9, 9]);
        assert_eq!(numbers(&[&b"\x01\x04\xff\xff\x00"[..], &good].concat()), [9]);
        assert_eq!(numbers(&[&[0xFF; 100][..], &good].concat()), [9]);
    }

    #[test]
    fn a_frame_that_is_longer_than_this_end_takes_is_passed_over() {
        let stream = [frame(1, &[b'x'; 17]), frame(2, b"fits")].concat();
        assert_eq!(numbers(&stream), [2]);
    }
}
