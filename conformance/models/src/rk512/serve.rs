//! The partner's commands: requests to the host, and our reactions.

use super::awaited::Due;
use super::layer::{Layer, Sender};
use super::reactions::{AREA, COMMAND, GOOD, HEADER, LENGTH, SEQUENCE, STOP, of_refusal};
use super::telegram::{Area, Command, FIRST, FOLLOW_UP, Kind, MOST, SHORT, reaction};
use super::telegram;
use softplug_abi::{Failure, Micros};

/// A command of the partner, as far as it has come.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Series {
    pub(super) command: Command,
    /// Bytes of data of the parts that were granted.
    pub(super) done: usize,
}

impl Series {
    /// Bytes of the next part.
    pub(super) fn part(&self) -> usize {
        (self.command.bytes() - self.done).min(MOST)
    }
}

/// What the host was asked.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Request {
    /// The plug-in's id for it, when it is seen.
    pub(super) id: u32,
    pub(super) kind: Kind,
    /// Bytes of data that it is about.
    pub(super) part: usize,
    /// First byte of the reaction.
    pub(super) front: u8,
    pub(super) until: Micros,
}

impl Layer {
    /// A command, or what is none.
    pub(super) fn serve(&mut self, at: Micros, telegram: &[u8]) {
        self.withdraw("rk512.serve.withdrawn");
        self.reaction = None;
        let is_follow_up = telegram.first() == Some(&FOLLOW_UP);
        let front = if is_follow_up { FOLLOW_UP } else { FIRST };
        let part = if is_follow_up { self.follow_up(telegram) } else { self.first(telegram) };
        match part {
            Ok(data) => self.ask(at, front, &data),
            Err(number) => {
                self.series = None;
                self.react(reaction(front, number));
            }
        }
    }

    fn first(&mut self, telegram: &[u8]) -> Result<Vec<u8>, u8> {
        if telegram.len() < telegram::HEADER || telegram[0] != FIRST || telegram[1] != 0 {
            return Err(HEADER);
        }
        let kind = match telegram[2] {
            0x41 | 0x4F => Kind::Send,
            0x45 => Kind::Fetch,
            _ => return Err(COMMAND),
        };
        let area = Area::of_code(telegram[3]).ok_or(AREA)?;
        let count = u16::from_be_bytes([telegram[6], telegram[7]]);
        let flag = [telegram[8], telegram[9]];
        let command =
            Command { kind, area, block: telegram[4], offset: telegram[5], count, flag };
        let series = Series { command, done: 0 };
        let data = &telegram[telegram::HEADER..];
        let expected = if kind == Kind::Send { series.part() } else { 0 };
        if count == 0 || data.len() != expected {
            return Err(LENGTH);
        }
        self.series = Some(series);
        Ok(data.to_vec())
    }

    fn follow_up(&mut self, telegram: &[u8]) -> Result<Vec<u8>, u8> {
        if telegram.len() < SHORT || telegram[1] != 0 {
            return Err(HEADER);
        }
        let kind = match telegram[2] {
            0x41 | 0x4F => Kind::Send,
            0x45 => Kind::Fetch,
            _ => return Err(COMMAND),
        };
        let area = Area::of_code(telegram[3]).ok_or(AREA)?;
        let series = self.series.as_ref().ok_or(SEQUENCE)?;
        if series.command.kind != kind || series.command.area != area {
            return Err(SEQUENCE);
        }
        let data = &telegram[SHORT..];
        let expected = if kind == Kind::Send { series.part() } else { 0 };
        if data.len() != expected { Err(LENGTH) } else { Ok(data.to_vec()) }
    }

    fn ask(&mut self, at: Micros, front: u8, data: &[u8]) {
        let Some(series) = &self.series else { return };
        let command = &series.command;
        let part = series.part();
        let unit = command.area.unit();
        let mut fields = vec![
            ("area", command.area.name().to_owned()),
            ("block", command.block.to_string()),
            ("offset", (usize::from(command.offset) + series.done / unit).to_string()),
            ("count", (part / unit).to_string()),
        ];
        let [byte, rest] = command.flag;
        let (cpu, bit) = (rest >> 4, rest & 0xF);
        if byte != 0xFF {
            fields.push(("flag_byte", byte.to_string()));
        }
        if bit != 0xF {
            fields.push(("flag_bit", bit.to_string()));
        }
        if cpu != 0xF {
            fields.push(("cpu", cpu.to_string()));
        }
        let kind = command.kind;
        if kind == Kind::Send {
            let bytes: Vec<String> = data.iter().map(|byte| format!("{byte:02X}")).collect();
            fields.push(("data", bytes.join(" ")));
        }
        let (name, clause) = match kind {
            Kind::Send => ("write", "rk512.serve.write"),
            Kind::Fetch => ("read", "rk512.serve.read"),
        };
        let clause = if front == FOLLOW_UP { "rk512.serve.follow-up" } else { clause };
        let fields = fields.into_iter().map(|(name, value)| (name.to_owned(), value)).collect();
        self.awaited.push(clause, Due::Requested { kind: name, fields });
        let until = at + self.reaction_time;
        self.request = Some(Request { id: 0, kind, part, front, until });
    }

    pub(super) fn withdraw(&mut self, clause: &'static str) {
        if let Some(request) = self.request.take() {
            self.awaited.push(clause, Due::Withdrawn(request.id));
        }
    }

    /// The host answers.
    pub(super) fn answer(&mut self, id: u32, answer: &Result<Vec<u8>, Failure>) {
        let Some(request) = self.request.take_if(|request| request.id == id) else { return };
        let number = match answer {
            Ok(data) if request.kind == Kind::Fetch && data.len() != request.part => LENGTH,
            Ok(_) => GOOD,
            Err(failure) => of_refusal(*failure),
        };
        let mut telegram = reaction(request.front, number);
        if number == GOOD {
            if let (Kind::Fetch, Ok(data)) = (request.kind, answer) {
                telegram.extend(data);
            }
            self.series = self.series.take().and_then(|mut series| {
                series.done += request.part;
                (series.done < series.command.bytes()).then_some(series)
            });
        } else {
            self.series = None;
        }
        self.react(telegram);
    }

    /// The host has not answered in time.
    pub(super) fn request_ran_out(&mut self) {
        let Some(request) = self.request.take() else { return };
        self.awaited.push("rk512.serve.time-out", Due::Withdrawn(request.id));
        self.series = None;
        self.react(reaction(request.front, STOP));
    }

    fn react(&mut self, telegram: Vec<u8>) {
        self.reaction = Some(telegram);
        self.feed(false);
    }

    pub(super) fn send_reaction(&mut self) {
        let Some(telegram) = self.reaction.take() else { return };
        self.sender = Sender::Reaction;
        self.station.send(&telegram);
    }
}
