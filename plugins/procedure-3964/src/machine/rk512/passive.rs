//! The partner's commands: each becomes a request to the host, whose answer
//! becomes the reaction.

use super::fields::{self, BYTES, Fields, TEXT};
use super::header::{
    AREA, BLOCK, COUNT, CPU, FETCH, FLAG_BIT, FLAG_BYTE, FOLLOW_UP, Header, OFFSET, SEND_DB,
    SEND_DX,
};
use super::{HEADER, LARGEST_DATA, Rk512, SHORT_HEADER, Turn};
use crate::frame::{holds_end, holds_wider};
use crate::machine::{Machine, NEVER, after};
use softplug_plugin::{Context, Failure, RequestId, Values};

// Errors in a reaction.
const ACCESS: u8 = 0x0A;
const TYPE: u8 = 0x0C;
const HEADER_UNKNOWN: u8 = 0x10;
const NOT_FOUND: u8 = 0x14;
const COMMAND: u8 = 0x16;
const IN_STOP: u8 = 0x2A;
const LOCKED: u8 = 0x32;
const LENGTH: u8 = 0x34;
const SEQUENCE: u8 = 0x36;

/// Field of a `write` request only.
const DATA: u8 = 7;

impl Machine {
    /// A telegram came: a reaction has 00 where a command has its letter.
    pub(crate) fn telegram(&mut self, link: &mut Context<'_>) {
        if self.block.as_slice().get(2) == Some(&0) {
            self.reaction(link);
            return;
        }
        let error = self.rk512.command(self.block.as_slice());
        self.rk512.forget_request(link);
        self.rk512.reaction_ready = false;
        match error {
            Ok(data) => {
                let bytes = self.block.as_slice();
                self.rk512.answer_until = after(link, self.options.reaction_timeout);
                self.rk512.ask(link, bytes.get(data..).unwrap_or_default());
            }
            Err(error) => {
                self.warn(link, error.into());
                let is_follow_up = self.block.as_slice().first() == Some(&FOLLOW_UP);
                self.rk512.left = 0;
                self.rk512.react(is_follow_up, error);
            }
        }
    }

    pub(crate) fn answer(
        &mut self,
        link: &mut Context<'_>,
        request: RequestId,
        answer: Result<&[u8], Failure>,
        more: bool,
    ) {
        if request == self.rk512.last_request && self.rk512.answer_until != NEVER {
            self.rk512.answered(link, answer, more, self.options.doubling, self.data_bits);
        }
        self.begin_block(link);
    }

    pub(crate) fn answer_late(&mut self, link: &mut Context<'_>) {
        self.rk512.forget_request(link);
        self.rk512.left = 0;
        self.rk512.react(self.rk512.is_next, IN_STOP);
    }
}

impl Rk512 {
    /// Takes a command; returns where its data begins, or the error to react with.
    fn command(&mut self, bytes: &[u8]) -> Result<usize, u8> {
        let [first, 0, command, area, ..] = *bytes else { return Err(HEADER_UNKNOWN) };
        if first != 0 && first != FOLLOW_UP {
            return Err(HEADER_UNKNOWN);
        }
        let is_known = matches!(command, SEND_DB | SEND_DX | FETCH);
        if !is_known {
            return Err(COMMAND);
        }
        let start = if first == FOLLOW_UP {
            let is_due = match self.turn {
                Turn::Acknowledged => self.left > 0,
                Turn::Ours => self.left > 0 && self.is_next,
                Turn::Unsure => false,
            };
            if !is_due || command != self.asked.command() || area != self.asked.area() {
                return Err(SEQUENCE);
            }
            SHORT_HEADER
        } else {
            let header = bytes.first_chunk::<HEADER>().ok_or(HEADER_UNKNOWN)?;
            self.asked = Header(*header);
            self.asked.area_name().ok_or(TYPE)?;
            self.left = self.asked.size();
            self.offset = header[5].into();
            HEADER
        };
        self.is_next = first != 0;
        self.turn = Turn::Ours;
        self.piece = self.left.min(LARGEST_DATA.into()) as u8;
        let expected = if self.asked.is_read() { 0 } else { usize::from(self.piece) };
        let is_short = bytes.len() != start + expected;
        if self.piece == 0 || is_short {
            return Err(LENGTH);
        }
        Ok(start)
    }

    /// Asks the host.
    fn ask(&mut self, link: &mut Context<'_>, data: &[u8]) {
        self.last_request = self.last_request.next();
        // A granted answer is gathered behind the head of the reaction.
        self.react(self.is_next, 0);
        self.reaction_ready = false;
        let header = self.asked;
        let mut fields = Fields::new();
        fields::put(&mut fields, AREA, TEXT, header.area_name().unwrap_or_default().as_bytes());
        let [.., block, _, _, _, flag, cpu_bit] = header.0;
        let count = u32::from(self.piece) / header.unit();
        // A coordination flag and a CPU that are all ones are none.
        fields::put_number(&mut fields, BLOCK, block.into(), u32::MAX);
        fields::put_number(&mut fields, OFFSET, self.offset, u32::MAX);
        fields::put_number(&mut fields, COUNT, count, u32::MAX);
        fields::put_number(&mut fields, FLAG_BYTE, flag.into(), 0xFF);
        fields::put_number(&mut fields, FLAG_BIT, (cpu_bit & 0x0F).into(), 0x0F);
        fields::put_number(&mut fields, CPU, (cpu_bit >> 4).into(), 0x0F);
        if !header.is_read() {
            fields::put(&mut fields, DATA, BYTES, data);
        }
        let kind = u16::from(header.is_read());
        link.request(self.last_request, kind, Values::new(fields.as_slice()));
    }

    fn answered(
        &mut self,
        link: &mut Context<'_>,
        answer: Result<&[u8], Failure>,
        more: bool,
        doubling: bool,
        data_bits: u8,
    ) {
        let error = match answer {
            Ok(data) => {
                let is_wanted = self.asked.is_read();
                let fits = !is_wanted || self.reaction.extend(data) == data.len();
                let expected = if is_wanted { usize::from(self.piece) } else { 0 };
                let length = self.reaction.len() - SHORT_HEADER;
                if fits && more {
                    return;
                }
                let is_right = length == expected;
                match fits && is_right {
                    false => LENGTH,
                    true if !doubling && holds_end(self.reaction.as_slice()) => IN_STOP,
                    true if holds_wider(self.reaction_data(), data_bits) => IN_STOP,
                    true => 0,
                }
            }
            Err(failure) => error_of(failure),
        };
        if more {
            // The rest of an answer that is too long is not for us.
            link.withdraw(self.last_request);
        }
        self.answer_until = NEVER;
        if error == 0 {
            self.reaction_ready = true;
        } else {
            self.left = 0;
            self.react(self.is_next, error);
        }
    }

    fn reaction_data(&self) -> &[u8] {
        self.reaction.as_slice().get(SHORT_HEADER..).unwrap_or_default()
    }

    /// A reaction without data.
    pub(super) fn react(&mut self, is_follow_up: bool, error: u8) {
        self.reaction.clear();
        self.reaction.extend(&[if is_follow_up { FOLLOW_UP } else { 0 }, 0, 0, error]);
        self.reaction_ready = true;
    }

    /// The reaction may have left.
    pub(crate) fn reaction_left(&mut self) {
        if self.turn == Turn::Ours {
            self.turn = Turn::Unsure;
        }
    }

    /// The partner has the reaction: a follow-up now is the next one.
    pub(crate) fn advance(&mut self) {
        if self.turn != Turn::Acknowledged && self.left > 0 {
            self.left -= u32::from(self.piece);
            let unit = self.asked.unit();
            self.offset += u32::from(self.piece) / unit;
        }
        self.turn = Turn::Acknowledged;
    }

    pub(crate) fn reaction_ended(&mut self) {
        self.reaction_ready = false;
    }
}

/// What a refusal of the host is to the partner.
fn error_of(failure: Failure) -> u8 {
    match failure {
        Failure::NotFound => NOT_FOUND,
        Failure::Denied => ACCESS,
        Failure::Busy => LOCKED,
        Failure::NotSupported => HEADER_UNKNOWN,
        Failure::BadJob | Failure::TooLong => LENGTH,
        _ => IN_STOP,
    }
}
