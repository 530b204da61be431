//! Jobs, and what a control does to whoever sends.

use super::Guess;
use crate::dice::Dice;
use crate::fanuc_rs232::rules::{Code, Parity};
use crate::model::{HostRequest, Proposal};
use crate::propose::{come, host};

impl Guess<'_> {
    pub(super) fn sending(&self, dice: &mut Dice) -> Proposal {
        let feed = &self.model.feed;
        let Some(job) = feed.job() else {
            return match dice.below(12) {
                0 => come(self.pause(dice), vec![self.control(0x93, dice)]),
                1..=2 => come(self.pause(dice), vec![0x11]),
                3 => come(self.pause(dice), vec![self.control(0x96, dice)]),
                4 => host(self.pause(dice), HostRequest::ForceResume),
                _ => self.job(dice),
            };
        };
        if feed.is_paused() && !dice.one_in(3) {
            return host(self.pause(dice), HostRequest::Resume(job));
        }
        match dice.below(28) {
            0 => host(self.within(dice), HostRequest::Pause(job)),
            1 => host(self.within(dice), HostRequest::Resume(job)),
            2 => host(self.within(dice), HostRequest::Abort(job)),
            3 if self.model.punch.is_idle() => host(self.within(dice), HostRequest::ForceResume),
            3 | 4 => self.job(dice),
            5 => come(self.within(dice), self.controls(dice)),
            6 => {
                let code = *dice.pick(&[0x96, 0x95]);
                come(self.within(dice), vec![self.control(code, dice)])
            }
            7 => {
                let any = dice.byte();
                let byte = *dice.pick(&[0x11, 0x13, 0x93, 0x96, 0x95, 0x12, any]);
                self.damaged(byte, dice)
            }
            8 => come(self.within(dice), vec![dice.byte()]),
            9 => self.nothing(dice),
            _ if feed.is_waiting() || feed.is_held() => {
                if dice.one_in(5) {
                    self.nothing(dice)
                } else {
                    come(self.pause(dice), vec![0x11])
                }
            }
            10..=16 => come(self.within(dice), vec![self.control(0x93, dice)]),
            17..=20 => self.near_the_end(dice),
            _ => self.nothing(dice),
        }
    }

    /// DC3 where the closing `%` leaves or has left.
    fn near_the_end(&self, dice: &mut Dice) -> Proposal {
        let began = self.model.began.0;
        let last = began + self.characters(self.model.feed.missing());
        let wait = last - self.now.0 + dice.between(-2, 2);
        come(wait, vec![self.control(0x93, dice)])
    }

    /// Several control codes of one time, maybe with data between.
    fn controls(&self, dice: &mut Dice) -> Vec<u8> {
        let count = dice.between(1, 6);
        let next = |_| {
            if dice.one_in(5) {
                dice.byte()
            } else {
                let code = *dice.pick(&[0x11, 0x11, 0x93, 0x93, 0x12, 0x14, 0x96]);
                self.control(code, dice)
            }
        };
        (0..count).map(next).collect()
    }

    /// A control code with parity or without, mostly as the control sends it.
    pub(super) fn control(&self, code: u8, dice: &mut Dice) -> u8 {
        let rules = &self.model.rules;
        let is_plain = rules.code == Code::Iso && dice.one_in(2)
            || rules.plain_codes && dice.one_in(2)
            || dice.one_in(12);
        let code = if is_plain { code & 0x7F } else { code };
        let is_marked = rules.parity == Parity::None && dice.one_in(4);
        if is_marked { code | 0x80 } else { code }
    }

    fn job(&self, dice: &mut Dice) -> Proposal {
        let longest = if dice.one_in(40) { 20_000 } else { 600 };
        let mut data = self.program(dice.length(longest), dice);
        if dice.one_in(60) {
            // New numbers come to their end.
            data = [b"%\n".to_vec(), b"N1\n".repeat(dice.between(99, 300) as usize)].concat();
        }
        let (id, kind) = (self.model.jobs + 1, "send".to_owned());
        let fields = if dice.one_in(3) { fields(dice) } else { Vec::new() };
        host(self.pause(dice), HostRequest::Job { id, kind, fields, data })
    }
}

fn fields(dice: &mut Dice) -> Vec<(String, String)> {
    let mut fields = Vec::new();
    let mut add = |name: &str, value: String| fields.push((name.to_owned(), value));
    let number = dice.between(-1, 12).to_string();
    match dice.below(8) {
        0..=1 => add("from_block", number),
        2 => add("from_line", number),
        3..=5 => add("from_sequence", (dice.below(6) * 10).to_string()),
        6 => add("from_sequence", number),
        7 if dice.one_in(2) => {
            let large = ["4294967294", "4294967295", "4294967296", "65536", "256", "30"];
            let name = *dice.pick(&["from_block", "from_line", "from_sequence"]);
            add(name, (*dice.pick(&large)).to_owned());
        }
        _ => {}
    }
    if dice.one_in(3) {
        let long = ["X1\n".repeat(133), "A".repeat(400), "/N5 (T)\r\n".repeat(40)];
        let preambles = [
            "T1M6",
            "T1M6\nG0Z50\n",
            "N7G1\n/N8",
            "\n",
            "g1(tool",
            "(A\r\nB)\r\n",
            "G1;",
            "50%",
            "(%)",
            "A&B",
            "",
            "\nT1\r",
            "\r",
            "A\n\r",
            long[0].as_str(),
            long[1].as_str(),
            long[2].as_str(),
        ];
        add("preamble", (*dice.pick(&preambles)).to_owned());
    }
    fields
}
