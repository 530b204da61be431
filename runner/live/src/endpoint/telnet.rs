//! The server's half of RFC 2217 for an endpoint's client, without its socket.
//!
//! The crate `rfc2217` does the protocol. It takes every setting that a client
//! asks for and says so; where the port's own are to be told, its answer is
//! replaced by one with the port's own value, and its model of the port set back.

use std::collections::VecDeque;

use rfc2217::{
    DataBits, ModemState, Parity, PortSettings, Progress, Purge, Server, ServerEvent, StopBits,
};
use softplug_abi::{LineParameters, ModemLines};

use super::LineAnswer;
use crate::port::Flow;
use crate::port::rfc2217_bound::SubnegotiationBound;
use crate::port::rfc2217_values::{line_state, modem_state, settings_of};
use crate::reactor::{EndpointRequest, LineNews};

/// Bytes that may wait for a client that does not read; then nothing more is
/// taken from it.
const WAITING: usize = 2_048;
/// Requests that may wait to be granted; while there are so many, the client is not read.
const REQUESTS: usize = 16;
/// Deliveries are encoded as far as so many bytes wait. Much less than above, so
/// that they alone never keep us from reading.
const DELIVERIES: usize = 512;

#[derive(Debug)]
pub(super) struct Telnet {
    server: Server,
    answer: LineAnswer,
    /// What the port has, where it is known.
    own: PortSettings,
    is_known: bool,
    /// What the server believes that the port has.
    model: PortSettings,
    output: VecDeque<u8>,
    requests: VecDeque<EndpointRequest>,
    /// The client wants what was received and not sent to it to be dropped.
    purges_received: bool,
    bound: SubnegotiationBound,
    /// The client has sent what nobody sends who speaks the protocol.
    is_broken: bool,
}

impl Telnet {
    pub(super) fn new(answer: LineAnswer, line: Option<LineParameters>) -> Self {
        let own = line.map_or_else(PortSettings::default, known_settings);
        let server =
            Server::new(own).with_signature(concat!("softplug ", env!("CARGO_PKG_VERSION")));
        let mut telnet = Self {
            server,
            answer,
            own,
            model: own,
            is_known: line.is_some(),
            output: VecDeque::new(),
            requests: VecDeque::new(),
            purges_received: false,
            bound: SubnegotiationBound::default(),
            is_broken: false,
        };
        telnet.gather();
        telnet
    }

    /// Takes what the client sent, as far as there is room for its answers, and
    /// gives the data in it to `payload`.
    pub(super) fn receive(&mut self, input: &[u8], payload: &mut [u8]) -> (usize, usize) {
        let (mut taken, mut count) = (0, 0);
        let all = input;
        let input = &input[..self.bound.within(input)];
        while self.output.len() < WAITING && self.requests.len() < REQUESTS {
            let progress = self.server.receive_into(&input[taken..], &mut payload[count..]);
            let Progress { consumed, payload_len, .. } = progress;
            (taken, count) = (taken + consumed, count + payload_len);
            let event = self.server.poll_event();
            self.gather();
            match &event {
                Some(event) => self.event(event),
                None if consumed == 0 => break,
                None => {}
            }
        }
        self.bound.pass(&input[..taken]);
        self.is_broken |= taken == input.len() && taken < all.len();
        (taken, count)
    }

    /// Whether the connection has to end: a subnegotiation is longer than any can be, and
    /// nothing from it on is taken.
    pub(super) fn is_broken(&self) -> bool {
        self.is_broken
    }

    /// Encodes as much of what was delivered as may wait; how much that was.
    pub(super) fn deliver(&mut self, bytes: &[u8]) -> usize {
        let mut taken = 0;
        while taken < bytes.len() && self.output.len() < DELIVERIES {
            match self.server.try_write_data(&bytes[taken..]) {
                Ok(count) => taken += count,
                Err(_) => break,
            }
            self.gather();
        }
        taken
    }

    /// Bytes for the connection.
    pub(super) fn output(&self) -> &[u8] {
        self.output.as_slices().0
    }

    /// So many of them have left.
    pub(super) fn sent(&mut self, count: usize) {
        self.output.drain(..count);
    }

    pub(super) fn next_request(&mut self) -> Option<EndpointRequest> {
        self.requests.pop_front()
    }

    /// Whether what was received and not sent to the client is to be dropped.
    pub(super) fn purges_received(&mut self) -> bool {
        std::mem::take(&mut self.purges_received)
    }

    /// Tells the client of the line what it wants to know.
    pub(super) fn line_news(&mut self, news: &LineNews) {
        // There is room: all output is taken out at once. What the client does
        // not want to know is not sent.
        match news {
            LineNews::Up(line, lines) => {
                self.own = known_settings(*line);
                self.is_known = true;
                self.tell_lines(*lines);
            }
            LineNews::Down => {
                let _ = self.server.try_set_modem_state(ModemState::default());
            }
            LineNews::ModemLines(known, on) => self.tell_lines(Some((*known, *on))),
            LineNews::LineError(kind) => {
                let _ = self.server.try_notify_line_state(line_state(*kind));
            }
            LineNews::Held(_) => {}
        }
        self.gather();
    }

    /// A port without such lines has them on, so that software which waits for
    /// them goes on.
    fn tell_lines(&mut self, lines: Option<(ModemLines, ModemLines)>) {
        let (known, on) = lines.unwrap_or_default();
        let ready = ModemLines::CTS.union(ModemLines::DSR).union(ModemLines::DCD);
        let on = ModemLines(on.0 | ready.0 & !known.0);
        let _ = self.server.try_set_modem_state(modem_state(on));
    }

    /// Takes the server's output over, so that it never lacks room.
    fn gather(&mut self) {
        while self.server.has_output() {
            let output = self.server.output();
            self.output.extend(output);
            let count = output.len();
            self.server.consume_output(count);
        }
    }

    fn event(&mut self, event: &ServerEvent) {
        match event {
            ServerEvent::SettingsChanged(settings) => self.settings_changed(*settings),
            ServerEvent::Dtr(on) => self.wish_lines(ModemLines::DTR, *on),
            ServerEvent::Rts(on) => self.wish_lines(ModemLines::RTS, *on),
            ServerEvent::Break(on) => self.requests.push_back(EndpointRequest::Break(*on)),
            ServerEvent::Purge(purge) => {
                if *purge != Purge::Receive {
                    self.requests.push_back(EndpointRequest::Purge);
                }
                self.purges_received |= *purge != Purge::Transmit;
            }
            _ => {}
        }
    }

    fn wish_lines(&mut self, line: ModemLines, on: bool) {
        let on = if on { line } else { ModemLines::default() };
        self.requests.push_back(EndpointRequest::ModemLines(line, on));
    }

    /// The client asked for one setting that the model did not have, and the
    /// answer that gives it is the last of the output.
    fn settings_changed(&mut self, asked: PortSettings) {
        let before = std::mem::replace(&mut self.model, asked);
        if self.answer == LineAnswer::AsAsked || !self.is_known {
            return;
        }
        let [before, asked, own] = [before, asked, self.own].map(commands);
        let Some(changed) = (0..before.len()).find(|index| before[*index] != asked[*index]) else {
            return;
        };
        let (given, own) = (asked[changed], own[changed]);
        if given == own {
            return;
        }
        self.take_back(&subnegotiation(given.code + SERVER, given.value()));
        // The same request with the port's own value: it is answered in place of
        // what was taken back, and sets the model. The client's own request has
        // just ended, so this one stands between two of its commands.
        let request = subnegotiation(own.code, own.value());
        let _ = self.server.receive_into(&request, &mut []);
        while self.server.poll_event().is_some() {}
        self.model = self.server.settings();
        self.gather();
    }

    fn take_back(&mut self, answer: &[u8]) {
        let kept = self.output.len().saturating_sub(answer.len());
        let is_last = self.output.iter().skip(kept).eq(answer);
        debug_assert!(is_last, "the answer to a setting is given at once");
        if is_last {
            self.output.truncate(kept);
        }
    }
}

const IAC: u8 = 255;
const COM_PORT_OPTION: u8 = 44;
/// What the codes of a server have more than those of a client.
const SERVER: u8 = 100;

/// A command that sets one setting.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
struct Set {
    code: u8,
    bytes: [u8; 4],
    length: usize,
}

impl Set {
    fn byte(code: u8, value: u8) -> Self {
        Self { code, bytes: [value, 0, 0, 0], length: 1 }
    }

    fn value(&self) -> &[u8] {
        &self.bytes[..self.length]
    }
}

/// The settings of a line as commands. Flow control is the port's own affair,
/// and taken as asked.
fn commands(settings: PortSettings) -> [Set; 4] {
    let data_bits = match settings.data_bits {
        DataBits::Five => 5,
        DataBits::Six => 6,
        DataBits::Seven => 7,
        DataBits::Eight => 8,
    };
    let parity = match settings.parity {
        Parity::None => 1,
        Parity::Odd => 2,
        Parity::Even => 3,
        Parity::Mark => 4,
        Parity::Space => 5,
    };
    let stop_bits = match settings.stop_bits {
        StopBits::One => 1,
        StopBits::Two => 2,
        StopBits::OnePointFive => 3,
    };
    [
        Set { code: 1, bytes: settings.baud_rate.to_be_bytes(), length: 4 },
        Set::byte(2, data_bits),
        Set::byte(3, parity),
        Set::byte(4, stop_bits),
    ]
}

fn subnegotiation(code: u8, value: &[u8]) -> Vec<u8> {
    let mut bytes = vec![IAC, 250, COM_PORT_OPTION, code];
    for byte in value {
        bytes.push(*byte);
        if *byte == IAC {
            bytes.push(IAC);
        }
    }
    bytes.extend([IAC, 240]);
    bytes
}

/// The settings of a port; a rate of 0 cannot be told.
fn known_settings(line: LineParameters) -> PortSettings {
    let settings = settings_of(line, Flow::Host);
    let known = PortSettings::default();
    match settings.baud_rate {
        0 => PortSettings { baud_rate: known.baud_rate, ..settings },
        _ => settings,
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use rfc2217::{Client, PartialSettings};
    use softplug_abi::Parity as LineParity;

    use super::*;

    /// Both halves over a wire that carries at most so many bytes at once, until
    /// nothing is left to say. Gives what each got of data.
    fn talk(
        client: &mut Client,
        telnet: &mut Telnet,
        pieces: &[usize],
        (to_send, to_deliver): (&[u8], &[u8]),
    ) -> (Vec<u8>, Vec<u8>) {
        let (mut to_telnet, mut to_client) = (Vec::new(), Vec::new());
        let (mut at_telnet, mut at_client) = (Vec::new(), Vec::new());
        let (mut sent, mut delivered) = (0, 0);
        for piece in pieces.iter().cycle().copied() {
            let output = client.output();
            let count = output.len().min(piece);
            to_telnet.extend_from_slice(&output[..count]);
            client.consume_output(count);
            let output = telnet.output();
            let back = output.len().min(piece);
            to_client.extend_from_slice(&output[..back]);
            telnet.sent(back);

            let mut payload = [0; 40];
            let (taken, got) = telnet.receive(&to_telnet, &mut payload);
            to_telnet.drain(..taken);
            at_telnet.extend_from_slice(&payload[..got]);
            let progress = client.receive_into(&to_client, &mut payload);
            to_client.drain(..progress.consumed);
            at_client.extend_from_slice(&payload[..progress.payload_len]);
            while client.poll_event().is_some() {}
            while telnet.next_request().is_some() {}

            sent += client.try_write_data(&to_send[sent..]).unwrap_or(0);
            delivered += telnet.deliver(&to_deliver[delivered..]);
            let is_said = sent == to_send.len() && delivered == to_deliver.len();
            let is_over = count + back + taken + progress.consumed == 0;
            if is_said && is_over && !client.has_output() && telnet.output().is_empty() {
                break;
            }
        }
        (at_telnet, at_client)
    }

    fn line() -> impl Strategy<Value = LineParameters> {
        let parities = [
            LineParity::None,
            LineParity::Odd,
            LineParity::Even,
            LineParity::Mark,
            LineParity::Space,
        ];
        // Rates with FF in them are doubled on the wire.
        let rates = prop_oneof![Just(65_535_u32), Just(0xFF_FFFF), 1_u32..16_000_000];
        (rates, 5_u8..=8, prop::sample::select(parities.to_vec()), 2_u8..=4).prop_map(
            |(baud, data_bits, parity, stop_half_bits)| LineParameters {
                baud,
                data_bits,
                parity,
                stop_half_bits,
            },
        )
    }

    fn four(settings: PortSettings) -> PartialSettings {
        PartialSettings {
            baud_rate: Some(settings.baud_rate),
            data_bits: Some(settings.data_bits),
            parity: Some(settings.parity),
            stop_bits: Some(settings.stop_bits),
            flow_control: Some(settings.flow_control),
        }
    }

    proptest! {
        /// Whatever a client asks for, and asks for again, it is told what the port
        /// has; and the data passes.
        #[test]
        fn a_client_is_told_the_ports_own_settings(
            own in line(), asked in line(), again in line(),
            pieces in prop::collection::vec(1_usize..60, 1..8),
            data in prop::collection::vec(prop_oneof![Just(0xFF_u8), any::<u8>()], 0..600),
        ) {
            let mut telnet = Telnet::new(LineAnswer::Own, Some(own));
            let mut client = Client::new(settings_of(asked, Flow::Host));
            let got = talk(&mut client, &mut telnet, &pieces, (&data, &data));
            prop_assert_eq!(got, (data.clone(), data));
            let known = four(settings_of(own, Flow::Host));
            prop_assert_eq!(client.reported_settings(), known);
            client.try_set_port_settings(settings_of(again, Flow::Host)).unwrap();
            talk(&mut client, &mut telnet, &pieces, (&[], &[]));
            prop_assert_eq!(client.reported_settings(), known);
        }

        #[test]
        fn software_that_insists_is_told_what_it_asked_for(own in line(), asked in line()) {
            let mut telnet = Telnet::new(LineAnswer::AsAsked, Some(own));
            let mut client = Client::new(settings_of(asked, Flow::Device));
            talk(&mut client, &mut telnet, &[50], (&[], &[]));
            prop_assert_eq!(client.readiness(), Ok(()));
        }

        /// A client that reads nothing and asks without end.
        #[test]
        fn what_waits_for_a_client_is_bounded(
            bytes in prop::collection::vec(
                prop_oneof![Just(0xFF_u8), Just(250), Just(253), Just(44), Just(240), 0_u8..13], 64,
            ),
        ) {
            let mut telnet = Telnet::new(LineAnswer::Own, None);
            let mut input = vec![0xFF, 251, 44];
            for _ in 0..200 {
                input.extend_from_slice(&bytes);
                input.extend([0xFF, 250, 44, 5, 8, 0xFF, 240, 0xFF, 250, 44, 0, 0xFF, 240]);
            }
            telnet.receive(&input, &mut vec![0; input.len()]);
            prop_assert!(telnet.output.len() < WAITING + 512);
            prop_assert!(telnet.requests.len() <= REQUESTS);
        }
    }
}
