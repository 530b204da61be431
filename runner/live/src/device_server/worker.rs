//! The thread of a simulated device server.

use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::mpsc::Receiver;
use std::time::Duration;

use rfc2217::{CommandError, PortSettings, Purge, Server, ServerEvent};
use rustix::net::sockopt;
use softplug_abi::{LineErrorKind, Micros, ModemLines};
use softplug_machines::{Partner, Signal};

use super::uart::{Heard, TRANSMIT, Uart};
use super::{Log, Seen};
use crate::error::PortError;
use crate::poll::{Interest, Poller, Source};
use crate::port::ReadOutcome;
use crate::port::rfc2217_values::{line_state, modem_state};
use crate::port::stream::Stream;

/// What a server is told by its owner.
#[derive(Debug)]
pub(super) enum Command {
    Inject(Signal),
    Suspend(bool),
    Hang(bool),
    DropClient,
    Kill,
}

#[derive(Debug)]
pub(super) struct Worker<P> {
    listener: TcpListener,
    uart: Option<Uart<P>>,
    client: Option<Client>,
    poller: Poller,
    inbox: Receiver<Command>,
    seen: Arc<Log>,
    /// The machine's outputs, our inputs: none until it drives some.
    lines: Option<ModemLines>,
    hangs: bool,
}

#[derive(Debug)]
struct Client {
    stream: Stream,
    server: Server,
    /// Read from the connection and not yet taken.
    input: Vec<u8>,
    suspend: Option<bool>,
}

/// What became of the client.
#[derive(PartialEq, Eq)]
enum Fate {
    Stays,
    Gone,
}

impl<P: Partner> Worker<P> {
    pub(super) fn new(
        listener: TcpListener,
        machine: P,
        poller: Poller,
        inbox: Receiver<Command>,
        seen: Arc<Log>,
    ) -> Self {
        let uart = Some(Uart::new(machine, PortSettings::default()));
        Self { listener, uart, client: None, poller, inbox, seen, lines: None, hangs: false }
    }

    pub(super) fn run(mut self) -> Result<P, PortError> {
        let Some(mut uart) = self.uart.take() else { unreachable!("a worker runs once") };
        loop {
            while let Ok(command) = self.inbox.try_recv() {
                match command {
                    Command::Inject(signal) => uart.inject(self.poller.clock().now(), signal),
                    Command::Suspend(on) => {
                        if let Some(client) = &mut self.client {
                            client.suspend = Some(on);
                        }
                    }
                    Command::Hang(on) => self.hangs = on,
                    Command::DropClient => uart = self.drop_client(uart),
                    Command::Kill => {
                        let uart = self.drop_client(uart);
                        return Ok(uart.partner);
                    }
                }
            }
            self.accept(&uart);
            uart.turn(self.poller.clock().now());
            if !self.hangs && self.serve(&mut uart)? == Fate::Gone {
                uart = self.drop_client(uart);
            }
            self.wait(&uart)?;
        }
    }

    fn accept(&mut self, uart: &Uart<P>) {
        while let Ok((stream, _)) = self.listener.accept() {
            if self.client.is_some() {
                self.seen.add(Seen::Busy);
                continue;
            }
            let Ok(stream) = crash_at_end(stream) else { continue };
            let server = Server::new(uart.settings()).with_signature("softplug simulated server");
            let mut client = Client { stream, server, input: Vec::new(), suspend: None };
            if let Some(on) = self.lines {
                // Before the client asks for anything it is only kept.
                let _ = client.server.try_set_modem_state(modem_state(on));
            }
            self.client = Some(client);
            self.seen.add(Seen::Connected);
        }
    }

    /// Ends the connection, and with it what the port had not sent.
    fn drop_client(&mut self, uart: Uart<P>) -> Uart<P> {
        if self.client.take().is_none() {
            return uart;
        }
        self.seen.add(Seen::Disconnected);
        uart.closed()
    }

    fn serve(&mut self, uart: &mut Uart<P>) -> Result<Fate, PortError> {
        let Some(client) = &mut self.client else { return Ok(Fate::Stays) };
        let now = self.poller.clock().now();
        loop {
            if client.flush()? == Fate::Gone {
                return Ok(Fate::Gone);
            }
            let Some(has_read) = client.take_in(uart, now, &self.seen)? else {
                return Ok(Fate::Gone);
            };
            let has_told = client.tell(uart, &mut self.lines);
            if !has_read && !has_told {
                return client.flush();
            }
        }
    }

    fn wait(&mut self, uart: &Uart<P>) -> Result<(), PortError> {
        let listener = Some((&self.listener as &dyn Source, Interest::READ));
        let client = self.client.as_ref().filter(|_| !self.hangs).map(|client| {
            let read = uart.room() > 0 && client.input.is_empty();
            (&client.stream as &dyn Source, Interest { read, write: client.server.has_output() })
        });
        self.poller.wait_both([listener, client], uart.poll_timeout())
    }
}

impl Client {
    fn flush(&mut self) -> Result<Fate, PortError> {
        while self.server.has_output() {
            match self.stream.write(self.server.output()) {
                Ok(0) => break,
                Ok(count) => self.server.consume_output(count),
                Err(PortError::Gone(_)) => return Ok(Fate::Gone),
                Err(error) => return Err(error),
            }
        }
        Ok(Fate::Stays)
    }

    /// Takes what came for the port, as far as that has room. `None`: the
    /// connection has ended.
    fn take_in<P: Partner>(
        &mut self,
        uart: &mut Uart<P>,
        now: Micros,
        seen: &Log,
    ) -> Result<Option<bool>, PortError> {
        if self.input.is_empty() && uart.room() > 0 {
            let mut buffer = [0; TRANSMIT];
            match self.stream.read(&mut buffer)? {
                ReadOutcome::Read(count) => self.input.extend_from_slice(&buffer[..count]),
                ReadOutcome::Empty => {}
                ReadOutcome::Gone(_) => return Ok(None),
            }
        }
        let mut payload = [0; TRANSMIT];
        let room = uart.room();
        if self.input.is_empty() || room == 0 {
            return Ok(Some(false));
        }
        let progress = self.server.receive_into(&self.input, &mut payload[..room]);
        self.input.drain(..progress.consumed);
        uart.send(now, &payload[..progress.payload_len]);
        while let Some(event) = self.server.poll_event() {
            apply(&event, uart, now, seen);
        }
        uart.turn(now);
        Ok(Some(progress.consumed > 0))
    }

    /// Tells what the port has heard, as far as there is room for it.
    fn tell<P: Partner>(&mut self, uart: &mut Uart<P>, lines: &mut Option<ModemLines>) -> bool {
        let mut has_told = false;
        if let Some(on) = self.suspend {
            let told =
                if on { self.server.try_suspend_flow() } else { self.server.try_resume_flow() };
            if told != Err(CommandError::OutputFull) {
                self.suspend = None;
                has_told = true;
            }
        }
        while let Some(heard) = uart.next_heard() {
            let told = match heard {
                Heard::Byte(byte) => self.server.try_write_data(&[byte]).map(drop),
                Heard::Error(kind) => self.server.try_notify_line_state(line_state(kind)),
                Heard::Lines(mask, on) => {
                    let before = lines.unwrap_or_default();
                    let now = ModemLines((before.0 & !mask.0) | (on.0 & mask.0));
                    let told = self.server.try_set_modem_state(modem_state(now));
                    if told.is_ok() {
                        *lines = Some(now);
                    }
                    told
                }
            };
            if told == Err(CommandError::OutputFull) {
                break;
            }
            uart.take_heard();
            has_told = true;
        }
        has_told
    }
}

fn apply<P: Partner>(event: &ServerEvent, uart: &mut Uart<P>, now: Micros, seen: &Log) {
    match *event {
        ServerEvent::SettingsChanged(settings) => {
            uart.set(settings);
            seen.add(Seen::Settings(settings));
        }
        ServerEvent::Purge(purge) => {
            if purge != Purge::Receive {
                uart.purge_transmit();
            }
            if purge != Purge::Transmit {
                uart.purge_receive();
            }
            seen.add(Seen::Purge(purge));
        }
        ServerEvent::Dtr(on) => {
            uart.partner.modem_lines(now, ModemLines::DTR, lines_if(on, ModemLines::DTR));
            seen.add(Seen::Dtr(on));
        }
        ServerEvent::Rts(on) => {
            uart.partner.modem_lines(now, ModemLines::RTS, lines_if(on, ModemLines::RTS));
            seen.add(Seen::Rts(on));
        }
        ServerEvent::Break(on) => {
            if on {
                uart.partner.receive_damaged(now, LineErrorKind::Break, None);
            }
            seen.add(Seen::Break(on));
        }
        _ => {}
    }
}

fn lines_if(on: bool, lines: ModemLines) -> ModemLines {
    if on { lines } else { ModemLines::default() }
}

/// A connection that is reset when it is dropped, as by a crash.
fn crash_at_end(stream: TcpStream) -> std::io::Result<Stream> {
    sockopt::set_socket_linger(&stream, Some(Duration::ZERO))?;
    Stream::over(stream)
}
