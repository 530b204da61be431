//! Jobs and captures that are large, or many.

use super::{Course, Guess};
use crate::dice::Dice;
use crate::fanuc_rs232::rules::Code;
use crate::model::{Given, HostRequest, Proposal};
use crate::propose::{come, give, host};

/// Characters until something may be swapped or goes wrong.
const STRETCH: usize = 3_000;

impl Guess<'_> {
    /// The next step of one large job or capture; `None`: it has ended.
    pub(super) fn large(&self, course: Course, dice: &mut Dice) -> Option<Proposal> {
        let model = self.model;
        let size = match course {
            Course::Capture(size) => return self.large_capture(size, dice),
            Course::Job(size) => size,
            Course::Characters(count) => return self.one_character(count, dice),
            Course::Any | Course::Many(_) | Course::Requests => return None,
        };
        let feed = &model.feed;
        if feed.job().is_none() {
            return (model.jobs == 0).then(|| self.large_job(size, dice));
        }
        let wait = self.characters(dice.between(1, STRETCH as i64) as usize);
        Some(if feed.is_waiting() || feed.is_held() {
            come(self.pause(dice), vec![0x11])
        } else if feed.missing() > 0 && dice.one_in(6) {
            come(wait, vec![self.control(0x93, dice)])
        } else {
            give(wait, Given::Nothing)
        })
    }

    /// So many blocks, or as many characters.
    fn large_job(&self, size: usize, dice: &mut Dice) -> Proposal {
        let mut data = b"%\nO1\n".to_vec();
        let mut fields = Vec::new();
        // More is one program: a fault would leave nothing of it.
        match if size > 1_000_000 { 2 } else { dice.below(3) } {
            0 => {
                data.resize(size, b'\n');
                data.extend(*dice.pick(&[b"G1@\n%".as_slice(), b"%X", b"\x80", b"M30\n%"]));
            }
            1 => {
                data.resize(size, b'\n');
                let block = data.len() as i64 - dice.between(3, 30);
                fields.push(("from_block".to_owned(), block.to_string()));
                data.extend(b"G1X2\nM30\n%");
            }
            _ => {
                while data.len() < size {
                    let line = format!("N{}G1X{}\n", dice.below(99_999), dice.below(999));
                    data.extend(line.into_bytes());
                }
                data.extend(b"M30\n%");
            }
        }
        let (id, kind) = (self.model.jobs + 1, "send".to_owned());
        host(self.pause(dice), HostRequest::Job { id, kind, fields, data })
    }

    /// It is put away as it comes, and long.
    fn large_capture(&self, size: usize, dice: &mut Dice) -> Option<Proposal> {
        let (punch, room) = (&self.model.punch, &self.model.room);
        if room.keeps() {
            return Some(host(1_000, HostRequest::PutAllAway));
        }
        let code = punch.code().or(self.model.rules.receive_code).unwrap_or(Code::Iso);
        if punch.is_idle() {
            // Only once: a session does not begin with one that has been.
            if self.now.0 > 60_000_000 {
                return None;
            }
            let mut bytes = vec![0x12];
            bytes.extend(self.encoded(b"%\nO7(LARGE)\n", code, dice));
            return Some(come(self.pause(dice), bytes));
        }
        if !punch.is_receiving() {
            return Some(self.punching(dice));
        }
        if self.model.flow.is_stopped() {
            return Some(self.room(dice));
        }
        let mut text = Vec::new();
        while text.len() < STRETCH {
            text.extend(format!("N{}G1X{}\n", dice.below(99_999), dice.below(999)).bytes());
        }
        if dice.one_in((size / STRETCH) as u64) {
            text.extend(b"%");
        }
        let bytes = self.encoded(&text, code, dice);
        Some(come(self.characters(bytes.len()), bytes))
    }

    /// A capture that takes its time.
    fn one_character(&self, count: u32, dice: &mut Dice) -> Option<Proposal> {
        let punch = &self.model.punch;
        let code = punch.code().or(self.model.rules.receive_code).unwrap_or(Code::Iso);
        self.model.course.set(Some(Course::Characters(count.checked_sub(1)?)));
        if punch.is_idle() {
            let mut bytes = vec![0x12];
            bytes.extend(self.encoded(b"%\nO7(SLOW)\n", code, dice));
            return Some(come(self.characters(bytes.len()), bytes));
        }
        if !punch.is_receiving() || self.model.room.keeps() {
            return None;
        }
        let character = if count.is_multiple_of(16) { b'\n' } else { b'A' + (count % 26) as u8 };
        Some(come(self.characters(1).max(4_090), self.encoded(&[character], code, dice)))
    }

    /// The operator asks for programs, more than the host answers; `None`: nothing is one
    /// that can be asked for.
    pub(super) fn panel(&self, dice: &mut Dice) -> Option<Proposal> {
        let model = self.model;
        if !model.rules.request_pattern.contains('*') {
            return None;
        }
        let open: Vec<u32> = model.requests.open().iter().copied().collect();
        if !open.is_empty() && dice.one_in(if open.len() < 4 { 8 } else { 3 }) {
            let answer = HostRequest::Answer(*dice.pick(&open), Self::granted(dice));
            return Some(host(self.characters(1), answer));
        }
        let code = model.punch.code().or(model.rules.receive_code).unwrap_or(Code::Iso);
        let asked = model.rules.request_pattern.replace('*', &dice.below(9_999).to_string());
        let text = format!("%\nO{}{asked}\n%", model.rules.request_program);
        let mut bytes = vec![0x12];
        bytes.extend(self.encoded(text.as_bytes(), code, dice));
        bytes.push(0x14);
        Some(come(self.characters(bytes.len()), bytes))
    }

    /// The next step of many small jobs and captures.
    pub(super) fn small(&self, dice: &mut Dice) -> Proposal {
        let model = self.model;
        let code = model.punch.code().or(model.rules.receive_code).unwrap_or(Code::Iso);
        if model.punch.is_leaving() {
            return come(self.pause(dice), vec![0x12]);
        }
        if !model.punch.is_idle() {
            return come(self.characters(1), vec![0x14]);
        }
        if let Some(open) = model.requests.open().iter().next().filter(|_| dice.one_in(4)) {
            return host(self.characters(1), HostRequest::Answer(*open, Ok(Vec::new())));
        }
        if model.feed.job().is_some() {
            return if model.feed.is_waiting() || model.feed.is_held() {
                come(self.characters(1), vec![0x11])
            } else {
                give(self.characters(model.feed.missing() + 1), Given::Nothing)
            };
        }
        if dice.one_in(2) {
            let mut bytes = vec![0x12];
            let text = [b"%\n".to_vec(), self.block(dice), b"\n%".to_vec()].concat();
            bytes.extend(self.encoded(&text, code, dice));
            bytes.push(0x14);
            return come(self.characters(bytes.len()), bytes);
        }
        let (id, kind, data) = (model.jobs + 1, "send".to_owned(), b"%\nM30\n%".to_vec());
        host(self.characters(1), HostRequest::Job { id, kind, fields: Vec::new(), data })
    }
}
