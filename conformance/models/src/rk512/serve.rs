//! The partner's commands: requests to the host, and our reactions.

use super::awaited::Due;
use super::layer::{Layer, Sender};
use super::reactions::{AREA, COMMAND, GOOD, HEADER, LENGTH, SEQUENCE, STOP, of_refusal};
use super::series::{Request, Series};
use super::telegram::{
    Area, Command, FIRST, FOLLOW_UP, HEADER as HEADER_BYTES, Kind, MOST, SHORT, reaction,
};
use softplug_abi::{Failure, Micros};

fn kind_of(code: u8) -> Option<Kind> {
    match code {
        0x41 | 0x4F => Some(Kind::Send),
        0x45 => Some(Kind::Fetch),
        _ => None,
    }
}

/// What is wrong with the first bytes of a telegram, in the order in which it is told.
fn faults_of_head(telegram: &[u8]) -> Vec<u8> {
    let mut faults = Vec::new();
    let is_front = telegram.first().is_some_and(|front| matches!(*front, FIRST | FOLLOW_UP));
    if telegram.len() < SHORT || !is_front || telegram[1] != 0 {
        faults.push(HEADER);
    }
    let kind = telegram.get(2).map(|code| kind_of(*code));
    if kind == Some(None) {
        faults.push(COMMAND);
    }
    faults
}

/// What is wrong with the first telegram of a command.
fn faults_of_first(telegram: &[u8]) -> Vec<u8> {
    let mut faults = faults_of_head(telegram);
    if telegram.len() < HEADER_BYTES {
        faults.push(HEADER);
    }
    let kind = telegram.get(2).and_then(|code| kind_of(*code));
    let is_there = telegram.get(3).is_some_and(|area| area_of(kind, *area));
    if !is_there || is_crossed(telegram) {
        faults.push(AREA);
    }
    if let Some(command) = first(telegram) {
        let data = if command.kind == Kind::Send { command.bytes().min(MOST) } else { 0 };
        if command.count == 0 || telegram.len() != HEADER_BYTES + data {
            faults.push(LENGTH);
        }
    }
    faults
}

/// Whether bytes 3 and 4 are a SEND and an area, and not a pair of the table.
fn is_crossed(telegram: &[u8]) -> bool {
    matches!(telegram, [_, _, 0x41, 0x58, ..] | [_, _, 0x4F, 0x44, ..])
}

/// The command of a first telegram that can be read.
fn first(telegram: &[u8]) -> Option<Command> {
    let [_, _, code, area, block, offset, high, low, byte, rest, ..] = *telegram else {
        return None;
    };
    let kind = kind_of(code)?;
    let area = Area::of_code(area)?;
    let count = u16::from_be_bytes([high, low]);
    Some(Command { kind, area, block, offset, count, flag: [byte, rest] })
}

/// A SEND goes into a DB or DX: the host is asked with the same fields as a job has.
fn area_of(kind: Option<Kind>, code: u8) -> bool {
    let is_open = |area: Area| kind != Some(Kind::Send) || area.is_block();
    Area::of_code(code).is_some_and(is_open)
}

impl Layer {
    /// A command, or what is none.
    pub(super) fn serve(&mut self, at: Micros, telegram: &[u8]) {
        // The partner no longer waits for it.
        if self.has_reaction() {
            self.drop_reaction();
        }
        let is_follow_up = telegram.first() == Some(&FOLLOW_UP);
        let front = if is_follow_up { FOLLOW_UP } else { FIRST };
        self.withdraw("rk512.serve.withdrawn");
        let faults = if is_follow_up {
            self.settle_part();
            self.faults_of_follow_up(telegram)
        } else {
            faults_of_first(telegram)
        };
        if let Some(number) = faults.first() {
            self.end_series();
            return self.react(reaction(front, *number));
        }
        if !is_follow_up {
            self.end_series();
            self.series = first(telegram).map(|command| Series {
                command,
                done: 0,
                is_open: false,
                has_left: false,
            });
        }
        let header = if is_follow_up { SHORT } else { HEADER_BYTES };
        self.ask(at, front, &telegram[header..]);
    }

    /// A follow-up comes although the reaction to the part before is not acknowledged: it
    /// can only be that part again while the reaction has not left. Then it is not known
    /// which it is, so that it is out of sequence.
    fn settle_part(&mut self) {
        let Some(series) = self.series.as_mut().filter(|series| series.is_open) else { return };
        series.is_open = false;
        if series.done == 0 || series.has_left {
            self.end_series();
        }
    }

    /// Nothing of the partner's command goes on.
    pub(super) fn end_series(&mut self) {
        if let Some(series) = self.series.take() {
            self.ended = Some(series);
        }
    }

    /// The part at hand is done with.
    fn part_done(&mut self) {
        self.series = self.series.take().and_then(|mut series| {
            series.done += series.part();
            series.is_open = false;
            (series.done < series.command.bytes()).then_some(series)
        });
    }

    /// Our reaction is acknowledged.
    pub(super) fn reaction_sent(&mut self) {
        if self.series.as_ref().is_some_and(|series| series.is_open) {
            self.part_done();
        }
    }

    fn faults_of_follow_up(&self, telegram: &[u8]) -> Vec<u8> {
        let mut faults = faults_of_head(telegram);
        let kind = telegram.get(2).and_then(|code| kind_of(*code));
        // It repeats bytes 3 and 4 of its command.
        let is_of = |command: &Command| telegram.get(2..4) == Some(&command.follow_up()[2..]);
        match self.series.as_ref().filter(|series| is_of(&series.command)) {
            None => faults.push(SEQUENCE),
            Some(series) => {
                let data = if kind == Some(Kind::Send) { series.part() } else { 0 };
                if telegram.len() != SHORT + data {
                    faults.push(LENGTH);
                }
            }
        }
        faults
    }

    fn ask(&mut self, at: Micros, front: u8, data: &[u8]) {
        let Some(series) = &mut self.series else { return };
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
        (series.is_open, series.has_left) = (true, false);
        let until = at + self.reaction_time;
        self.request = Some(Request { id: None, kind, part, front, until });
    }

    pub(super) fn withdraw(&mut self, clause: &'static str) {
        if let Some(request) = self.request.take() {
            self.awaited.push(clause, Due::Withdrawn(request.id));
        }
    }

    /// Whether a reaction with these data cannot be sent.
    fn is_unfit(&self, data: &[u8]) -> bool {
        self.station.holds_end(data) || self.station.holds_wider(data)
    }

    /// The host answers.
    pub(super) fn answer(&mut self, id: u32, answer: &Result<Vec<u8>, Failure>) {
        let Some(request) = self.request.take_if(|request| request.id == Some(id)) else { return };
        if answer.as_ref().is_ok_and(|data| data.len() > request.part) && self.ways.is_other() {
            // Enough has come before the last piece of it: that is left open.
            self.awaited.push("rk512.serve.read", Due::Withdrawn(Some(id)));
        }
        let number = match answer {
            Ok(data) if request.kind == Kind::Fetch && data.len() != request.part => LENGTH,
            // As if the host had refused.
            Ok(data) if request.kind == Kind::Fetch && self.is_unfit(data) => STOP,
            Ok(_) => GOOD,
            Err(failure) => of_refusal(*failure),
        };
        let mut telegram = reaction(request.front, number);
        if number == GOOD {
            if let (Kind::Fetch, Ok(data)) = (request.kind, answer) {
                telegram.extend(data);
            }
        } else {
            self.end_series();
        }
        self.react(telegram);
    }

    /// The host has not answered in time.
    pub(super) fn request_ran_out(&mut self) {
        let Some(request) = self.request.take() else { return };
        self.awaited.push("rk512.serve.time-out", Due::Withdrawn(request.id));
        self.end_series();
        self.react(reaction(request.front, STOP));
    }

    fn react(&mut self, telegram: Vec<u8>) {
        self.reaction = Some(telegram);
    }

    pub(super) fn send_reaction(&mut self) {
        let Some(telegram) = self.reaction.take() else { return };
        self.sender = Sender::Reaction;
        self.station.send(&telegram);
    }

    /// A reaction waits, or is on the line.
    fn has_reaction(&self) -> bool {
        self.reaction.is_some() || self.sender == Sender::Reaction
    }

    /// Our reaction has left if the procedure awaits its acknowledgement.
    pub(super) fn look_at_reaction(&mut self) {
        if self.sender == Sender::Reaction
            && self.station.awaits_acknowledgement()
            && let Some(series) = &mut self.series
        {
            series.has_left = true;
        }
    }

    fn drop_reaction(&mut self) {
        self.reaction = None;
        if self.sender == Sender::Reaction {
            self.sender = Sender::Nobody;
            let _ = self.station.forget_block();
        }
    }
}
