//! The client's half of RFC 2217 without its socket: bytes of the connection
//! in, what the serial port heard out, and the other way round.
//!
//! The crate `rfc2217` does the protocol. What it leaves to us: the mask
//! without which a server tells no line errors, a question that proves that the
//! server still reads, obeying its request for a pause, and keeping commands
//! that find no room.

use std::collections::VecDeque;

use rfc2217::{
    Client, ComPortState, CommandError, DataBits, Event, FlowControl, LineState, PartialSettings,
    Purge, StopBits,
};
use softplug_abi::{LineErrorKind, LineParameters, ModemLines};

use super::super::marks::Input;
use super::super::rfc2217_bound::SubnegotiationBound;
use super::super::rfc2217_values::{inputs_of, settings_of};
use super::super::spec::{Flow, PortOptions};
use crate::difference::{
    BAUD_RATE, DifferenceWeight, SettingDifference, setting_texts, weight_of_rate,
};

/// `IAC SB COM-PORT-OPTION SET-LINESTATE-MASK (overrun, parity, framing,
/// break) IAC SE`: without it a server tells no line errors.
const LINE_STATE_MASK: [u8; 7] = [0xFF, 0xFA, 44, 10, 0x1E, 0xFF, 0xF0];
/// `SET-BAUDRATE 0`, which asks for the rate and changes nothing: every server
/// answers it, in turn with the data before it.
const QUESTION: [u8; 10] = [0xFF, 0xFA, 44, 1, 0, 0, 0, 0, 0xFF, 0xF0];
/// A server sends line errors apart from the data; so far back, at most, the
/// damaged character is: as much as servers gather.
const SPAN: u32 = 1_024;
/// Commands that may wait for room. A server that takes none of so many has
/// stopped reading.
const COMMANDS: usize = 64;
/// Payload that is decoded at once.
const CHUNK: usize = 512;

const ERRORS: [(LineState, LineErrorKind); 4] = [
    (LineState::OVERRUN_ERROR, LineErrorKind::Overrun),
    (LineState::PARITY_ERROR, LineErrorKind::Parity),
    (LineState::FRAMING_ERROR, LineErrorKind::Framing),
    (LineState::BREAK_DETECT, LineErrorKind::Break),
];

#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Command {
    Dtr(bool),
    Rts(bool),
    Break(bool),
    PurgeTransmit,
    Signature,
}

/// Why the session cannot go on.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Broken {
    /// The server refuses, or no longer wants, COM-PORT-OPTION.
    Refused,
    /// It sends our own requests back: a raw port before something that echoes.
    Echo,
    /// It takes no more commands.
    Deaf,
    /// A subnegotiation of its is longer than any can be.
    Overlong,
    /// Its port has other settings now than it was asked for.
    Reset,
}

/// How far opening has come.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Opening {
    /// No answer to the offer of COM-PORT-OPTION yet.
    Offered,
    /// The option is on; some settings have no answer yet.
    Setting,
    /// Every setting is answered, one way or another.
    Done,
}

#[derive(Debug)]
pub(super) struct Session {
    client: Client,
    asked: LineParameters,
    flow: Flow,
    /// Input that waits until output has left.
    rest: Vec<u8>,
    /// Subnegotiations of our own, sent between those of `client`.
    own: Vec<u8>,
    /// How much of `own` has been sent.
    own_sent: usize,
    commands: VecDeque<Command>,
    outputs: ModemLines,
    differences: Vec<SettingDifference>,
    compared: Option<PartialSettings>,
    /// Bytes heard since the last note of a line error.
    since_note: u32,
    /// Answers about the rate, our questions' included.
    rates: u64,
    signature: Option<String>,
    bound: SubnegotiationBound,
    broken: Option<Broken>,
}

impl Session {
    pub(super) fn new(options: &PortOptions) -> Self {
        let client = Client::new(settings_of(options.line, options.flow));
        Self {
            client,
            asked: options.line,
            flow: options.flow,
            rest: Vec::new(),
            own: LINE_STATE_MASK.to_vec(),
            own_sent: 0,
            commands: VecDeque::from([Command::Signature]),
            outputs: ModemLines::OUTPUTS,
            differences: Vec::new(),
            compared: None,
            since_note: 0,
            rates: 0,
            signature: None,
            bound: SubnegotiationBound::default(),
            broken: None,
        }
    }

    /// Takes what the connection brought, in order, and gives what the serial
    /// port heard to `sink`. What cannot be taken before output has left stays
    /// for [`resume`](Self::resume).
    pub(super) fn receive(&mut self, input: &[u8], sink: &mut impl FnMut(Input<'_>)) {
        debug_assert!(self.rest.is_empty(), "what came earlier comes first");
        let taken = self.decode(input, sink);
        self.rest.extend_from_slice(&input[taken..]);
    }

    /// Whether input waits.
    pub(super) fn has_rest(&self) -> bool {
        !self.rest.is_empty()
    }

    /// Goes on with at most `most` bytes of the input that waits; how many
    /// were taken.
    pub(super) fn resume(&mut self, most: usize, sink: &mut impl FnMut(Input<'_>)) -> usize {
        let mut rest = std::mem::take(&mut self.rest);
        let taken = self.decode(&rest[..most.min(rest.len())], sink);
        rest.drain(..taken);
        self.rest = rest;
        taken
    }

    /// Gives bytes to the serial port; how many were taken. None while the
    /// server wants a pause, and none before commands that wait.
    pub(super) fn write(&mut self, bytes: &[u8]) -> usize {
        self.send_commands();
        if self.client.flow_suspended() || !self.commands.is_empty() {
            return 0;
        }
        self.client.try_write_data(bytes).unwrap_or(0)
    }

    /// Bytes for the connection; more may follow once these have left.
    pub(super) fn output(&mut self) -> &[u8] {
        self.send_commands();
        if self.sends_own() { &self.own[self.own_sent..] } else { self.client.output() }
    }

    /// So many bytes of [`output`](Self::output) have left.
    pub(super) fn sent(&mut self, count: usize) {
        if !self.sends_own() {
            self.client.consume_output(count);
            return;
        }
        self.own_sent += count;
        if self.own_sent == self.own.len() {
            self.own.clear();
            self.own_sent = 0;
        }
    }

    /// Bytes for the connection that wait.
    pub(super) fn waiting(&self) -> usize {
        let own = if self.is_active() { self.own.len() - self.own_sent } else { 0 };
        self.client.output().len() + own
    }

    /// Whether the server was asked to let the partner stop it.
    pub(super) fn is_stoppable(&self) -> bool {
        self.flow.is_stoppable()
    }

    /// Whether the server wants a pause.
    pub(super) fn is_suspended(&self) -> bool {
        self.client.flow_suspended()
    }

    /// Asks the server something that it answers once it has read all before.
    pub(super) fn ask(&mut self) {
        if self.own.is_empty() {
            self.own.extend_from_slice(&QUESTION);
        }
    }

    /// How often the server has told the rate.
    pub(super) fn rates(&self) -> u64 {
        self.rates
    }

    pub(super) fn set_break(&mut self, on: bool) {
        self.command(Command::Break(on));
    }

    pub(super) fn set_modem_lines(&mut self, mask: ModemLines, on: ModemLines) {
        let outputs = mask.0 & ModemLines::OUTPUTS.0;
        self.outputs = ModemLines((self.outputs.0 & !outputs) | (on.0 & outputs));
        if mask.contains(ModemLines::DTR) {
            self.command(Command::Dtr(on.contains(ModemLines::DTR)));
        }
        if mask.contains(ModemLines::RTS) {
            self.command(Command::Rts(on.contains(ModemLines::RTS)));
        }
    }

    /// Has the server drop what it holds for the serial port.
    pub(super) fn purge_transmit(&mut self) {
        self.command(Command::PurgeTransmit);
    }

    /// The lines that the port has, as far as the server has told, and those
    /// that are on.
    pub(super) fn modem_lines(&self) -> (ModemLines, ModemLines) {
        let Some(state) = self.client.modem_state() else {
            return (ModemLines::OUTPUTS, self.outputs);
        };
        (ModemLines::ALL, inputs_of(state).union(self.outputs))
    }

    /// The rate as the server tells it, the rest as it was asked for: where a
    /// server makes other characters, its port is no UART.
    pub(super) fn line(&self) -> LineParameters {
        let told = self.client.reported_settings().baud_rate;
        let baud = told.filter(|rate| *rate != 0).unwrap_or(self.asked.baud);
        LineParameters { baud, ..self.asked }
    }

    /// What was asked for and the server did not take, or did not answer.
    pub(super) fn differences(&self) -> &[SettingDifference] {
        &self.differences
    }

    /// What the server calls itself, if it said so.
    pub(super) fn signature(&self) -> Option<&str> {
        self.signature.as_deref()
    }

    pub(super) fn broken(&self) -> Option<Broken> {
        self.broken
    }

    pub(super) fn opening(&self) -> Opening {
        if !self.is_active() {
            return Opening::Offered;
        }
        if self.client.pending_settings().is_empty() { Opening::Done } else { Opening::Setting }
    }

    /// Compares what the server has told with what was asked for; from then on
    /// after everything that it tells.
    pub(super) fn compare(&mut self) {
        let told = self.client.reported_settings();
        if self.compared == Some(told) {
            return;
        }
        self.compared = Some(told);
        self.differences.clear();
        let not_told = || "what it does not tell".to_owned();
        let mut add = |setting, asked, has: Option<String>, weight| {
            let weight = if has.is_some() { weight } else { DifferenceWeight::Note };
            let has = has.unwrap_or_else(not_told);
            self.differences.push(SettingDifference { setting, asked, has, weight });
        };
        for ((setting, asked), has) in setting_texts(self.asked).into_iter().zip(texts(&told)) {
            let weight = match (setting, told.baud_rate) {
                // Without a rate, it is left to the server.
                (BAUD_RATE, _) if self.asked.baud == 0 => continue,
                (BAUD_RATE, Some(rate)) => weight_of_rate(self.asked.baud, rate),
                _ => DifferenceWeight::Refused,
            };
            if has.as_ref() != Some(&asked) {
                add(setting, asked, has, weight);
            }
        }
        let asked = self.client.requested_settings().flow_control;
        let has = told.flow_control;
        // A port that has nobody's flow control is what was asked for even if
        // the server will not say so.
        if has != Some(asked) && (self.flow.is_stoppable() || has.is_some()) {
            // A server that obeys XON and XOFF unasked takes them out of the data; one
            // that does not obey what it was asked to lets the machine overflow. Wires that it
            // obeys unasked only wait.
            let matters = asked != FlowControl::None || has == Some(FlowControl::XonXoff);
            let weight = if matters { DifferenceWeight::Refused } else { DifferenceWeight::Note };
            let has = has.map(|flow| flow_text(flow).to_owned());
            add("flow control", flow_text(asked).to_owned(), has, weight);
        }
    }

    fn is_active(&self) -> bool {
        self.client.com_port_state() == ComPortState::Active
    }

    /// Whether our own bytes come next: begun, or nothing else is there.
    fn sends_own(&self) -> bool {
        let begun = self.own_sent > 0;
        begun || (!self.own.is_empty() && self.is_active() && !self.client.has_output())
    }

    fn decode(&mut self, input: &[u8], sink: &mut impl FnMut(Input<'_>)) -> usize {
        let mut payload = [0; CHUNK];
        let mut taken = 0;
        let all = input;
        let input = &input[..self.bound.within(input)];
        loop {
            let progress = self.client.receive_into(&input[taken..], &mut payload);
            taken += progress.consumed;
            if progress.payload_len > 0 {
                self.since_note = self.since_note.saturating_add(progress.payload_len as u32);
                sink(Input::Bytes(&payload[..progress.payload_len]));
            }
            while let Some(event) = self.client.poll_event() {
                self.event(&event, sink);
            }
            if progress.consumed == 0 {
                self.bound.pass(&input[..taken]);
                if taken == input.len() && taken < all.len() {
                    self.broken = Some(Broken::Overlong);
                }
                return taken;
            }
        }
    }

    fn event(&mut self, event: &Event, sink: &mut impl FnMut(Input<'_>)) {
        match event {
            Event::LineState(state) => self.line_state(*state, sink),
            Event::ComPortRefused => self.broken = Some(Broken::Refused),
            Event::Signature(text) if !text.as_bytes().is_empty() => {
                let signature = text.as_bytes().escape_ascii().to_string();
                tracing::debug!(signature, "the device server names itself");
                self.signature = Some(signature);
            }
            Event::BaudRate(_) => {
                self.rates += 1;
                self.told();
            }
            Event::DataBits(_) | Event::Parity(_) | Event::StopBits(_) | Event::FlowControl(_) => {
                self.told();
            }
            Event::Unknown(body) => match body.as_bytes() {
                // Codes below 100 are the client's: ours.
                [_, code, ..] if *code < 100 => self.broken = Some(Broken::Echo),
                // An answer all the same, which can change what is known.
                _ => self.told(),
            },
            _ => {}
        }
    }

    /// After the opening, what the server tells is compared at once.
    fn told(&mut self) {
        if self.compared.is_none() {
            return;
        }
        self.compare();
        if self.differences.iter().any(SettingDifference::is_refused) {
            self.broken = Some(Broken::Reset);
        }
    }

    fn line_state(&mut self, state: LineState, sink: &mut impl FnMut(Input<'_>)) {
        let span = std::mem::take(&mut self.since_note).clamp(1, SPAN);
        for (bit, kind) in ERRORS {
            if state.contains(bit) {
                sink(Input::LineError { kind, byte: None, span });
            }
        }
    }

    fn command(&mut self, command: Command) {
        if self.commands.len() < COMMANDS {
            self.commands.push_back(command);
        } else {
            self.broken = Some(Broken::Deaf);
        }
    }

    fn send_commands(&mut self) {
        while let Some(command) = self.commands.front() {
            let client = &mut self.client;
            let sent = match *command {
                Command::Dtr(on) => client.try_set_dtr(on),
                Command::Rts(on) => client.try_set_rts(on),
                Command::Break(on) => client.try_set_break(on),
                Command::PurgeTransmit => client.try_purge(Purge::Transmit),
                Command::Signature => client.try_request_signature(),
            };
            // Before the option is on, and until output has left. After any other
            // error the session is broken, and says so.
            if matches!(sent, Err(CommandError::Negotiating | CommandError::OutputFull)) {
                return;
            }
            self.commands.pop_front();
        }
    }
}

/// As [`setting_texts`], of what a server has told.
fn texts(told: &PartialSettings) -> [Option<String>; 4] {
    let data_bits = told.data_bits.map(|bits| match bits {
        DataBits::Five => "5",
        DataBits::Six => "6",
        DataBits::Seven => "7",
        DataBits::Eight => "8",
    });
    let parity = told.parity.map(|parity| match parity {
        rfc2217::Parity::None => "none",
        rfc2217::Parity::Odd => "odd",
        rfc2217::Parity::Even => "even",
        rfc2217::Parity::Mark => "mark",
        rfc2217::Parity::Space => "space",
    });
    let stop_bits = told.stop_bits.map(|bits| match bits {
        StopBits::One => "1",
        StopBits::OnePointFive => "1.5",
        StopBits::Two => "2",
    });
    // A server that answers 0 says that it does not know.
    let rate = told.baud_rate.filter(|rate| *rate != 0).map(|rate| rate.to_string());
    let texts = [data_bits, parity, stop_bits].map(|text| text.map(str::to_owned));
    let [data_bits, parity, stop_bits] = texts;
    [rate, data_bits, parity, stop_bits]
}

fn flow_text(flow: FlowControl) -> &'static str {
    match flow {
        FlowControl::None => "none",
        FlowControl::XonXoff => "XON/XOFF",
        FlowControl::RtsCts => "RTS/CTS",
        FlowControl::Dcd => "DCD",
        FlowControl::Dsr => "DSR",
    }
}
