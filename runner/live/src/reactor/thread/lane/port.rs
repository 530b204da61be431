//! A lane's port: asked for, opened, lost, tried again, closed.

use mio::unix::SourceFd;
use mio::{Interest, Token};
use softplug_abi::{Instance, LinkDownReason, Micros};
use std::os::fd::AsRawFd;

use super::{Lane, Phase};
use crate::channel::Channel;
use crate::clock::Clock;
use crate::error::PortError;
use crate::port::{Port, PortOptions, PortSpec, SettingDifference};
use crate::reactor::LaneInstance;
use crate::reactor::endpoint::LineNews;
use crate::reactor::report::Report;
use crate::reactor::setup::Backoff;
use crate::reactor::status::Condition;
use crate::reactor::thread::Thread;

pub(super) struct PortSetup {
    spec: PortSpec,
    options: PortOptions,
    reopen: Backoff,
    failures: u32,
    /// When to try again; not while an attempt is under way.
    pub(super) retry_at: Option<Micros>,
    /// Registered to write as well.
    wants_write: bool,
}

impl PortSetup {
    pub(super) fn new(spec: PortSpec, options: PortOptions, reopen: Backoff) -> Self {
        Self { spec, options, reopen, failures: 0, retry_at: None, wants_write: false }
    }

    pub(super) fn register<I: Instance>(
        &mut self,
        thread: &Thread<I>,
        token: usize,
        port: &Port,
    ) -> Result<(), PortError> {
        self.wants_write = false;
        let fd = port.fd().as_raw_fd();
        thread
            .registry
            .register(&mut SourceFd(&fd), Token(token), Interest::READABLE)
            .map_err(|error| PortError::io("wait for the port", error))
    }
}

impl<I: LaneInstance> Lane<I> {
    pub(super) fn ask_for_port(&mut self, thread: &Thread<I>) {
        self.port.retry_at = None;
        thread.open(self.id, &self.port.spec, &self.port.options);
    }

    pub(super) fn retry_port(&mut self, thread: &Thread<I>) {
        if self.port.retry_at.is_some_and(|at| at <= self.clock.now()) {
            self.ask_for_port(thread);
        }
    }

    /// The opener has done its work.
    pub(in crate::reactor) fn opened(
        &mut self,
        thread: &Thread<I>,
        opened: Result<Port, PortError>,
    ) {
        match opened {
            Ok(port) if self.closing_until.is_some() => thread.opener.close(port),
            Ok(port) => self.take_port(thread, port),
            Err(error) => self.cannot_open(&error),
        }
    }

    fn cannot_open(&mut self, error: &PortError) {
        let differences = error.differences().to_vec();
        self.is_down(LinkDownReason::Failed, error.to_string(), differences);
    }

    fn take_port(&mut self, thread: &Thread<I>, port: Port) {
        if let Err(error) = self.port.register(thread, self.tokens.start, &port) {
            thread.opener.close(port);
            return self.cannot_open(&error);
        }
        self.port.failures = 0;
        self.host.own.opened += 1;
        let (path, differences) = (port.path(), port.differences().to_vec());
        self.host.tell(Report::Opened { path, differences });
        let up = LineNews::Up(port.line(), port.modem_lines());
        let began = match &mut self.phase {
            Phase::New(made) => {
                let Some(made) = made.take() else { return };
                let (instance, options) = *made;
                // The link's time begins with its first open.
                self.clock = Clock::start();
                self.began = thread.clock.now();
                let mut channel = Box::new(Channel::new(port, instance, options));
                let began = channel.open(Micros::ZERO, &mut self.host);
                self.phase = Phase::Open(channel);
                began
            }
            Phase::Open(channel) if self.is_faulted => {
                let _ = channel.attach(port, self.clock.now(), &mut self.host);
                Ok(())
            }
            Phase::Open(channel) => channel.attach(port, self.clock.now(), &mut self.host),
        };
        self.watching.restart(self.clock.now());
        if let Some(lane) = &mut self.host.endpoint {
            lane.endpoint.line_news(&up);
        }
        match began {
            Ok(()) if self.is_faulted => {}
            Ok(()) => self.host.tell(Report::Up),
            Err(error) => self.failed(thread, error),
        }
    }

    /// A port that has gone is closed at once, which frees its name, and tried
    /// again later.
    pub(super) fn look_after_port(&mut self, thread: &Thread<I>) {
        let Phase::Open(channel) = &mut self.phase else { return };
        let Some(reason) = channel.gone() else { return };
        if self.let_go(thread) {
            self.is_down(reason, PortError::Gone(reason).to_string(), Vec::new());
        }
    }

    /// Closes the port, where there is one.
    pub(super) fn let_go(&mut self, thread: &Thread<I>) -> bool {
        let Phase::Open(channel) = &mut self.phase else { return false };
        let Some(mut port) = channel.detach() else { return false };
        let fd = port.fd().as_raw_fd();
        let _ = thread.registry.deregister(&mut SourceFd(&fd));
        if self.hands_over
            && let Some(kept) = port.hand_over()
        {
            self.host.tell(Report::HandedOver(kept));
        }
        thread.opener.close(port);
        true
    }

    /// The port failed in another way than by going.
    pub(super) fn port_failed(&mut self, thread: &Thread<I>, error: &PortError) {
        self.lose_port(thread, LinkDownReason::Failed, error.to_string());
    }

    /// Closes the port and opens it again.
    pub(super) fn reopen(&mut self, thread: &Thread<I>) {
        let has_port = matches!(&self.phase, Phase::Open(channel) if channel.port().is_some());
        if has_port {
            let detail = "the port is closed and opened again, as was asked".to_owned();
            self.lose_port(thread, LinkDownReason::Disconnected, detail);
        }
        if self.port.retry_at.is_some() {
            self.port.retry_at = Some(self.clock.now());
        }
    }

    fn lose_port(&mut self, thread: &Thread<I>, reason: LinkDownReason, detail: String) {
        let Phase::Open(channel) = &mut self.phase else { return };
        let lost = channel.lose(self.clock.now(), reason, &mut self.host);
        let had_port = self.let_go(thread);
        if let Err(crate::channel::ChannelError::Plugin(fault)) = lost {
            self.plugin_failed(&fault);
        }
        if had_port {
            self.is_down(reason, detail, Vec::new());
        }
    }

    fn is_down(
        &mut self,
        reason: LinkDownReason,
        detail: String,
        differences: Vec<SettingDifference>,
    ) {
        self.port.failures += 1;
        let retry_in = self.port.reopen.after(self.port.failures);
        if self.closing_until.is_none() {
            self.port.retry_at = Some(self.clock.now() + retry_in);
        }
        if let Some(lane) = &mut self.host.endpoint {
            lane.endpoint.line_news(&LineNews::Down);
        }
        self.host.tell(Report::Down { reason, detail, differences, retry_in });
    }

    /// Waits for room to write only while there is none: on a pty each read of
    /// the other side would wake us.
    pub(super) fn want_write(&mut self, thread: &Thread<I>, wanted: bool) {
        if wanted == self.port.wants_write {
            return;
        }
        let Phase::Open(channel) = &self.phase else { return };
        let Some(port) = channel.port() else { return };
        let interest =
            if wanted { Interest::READABLE | Interest::WRITABLE } else { Interest::READABLE };
        let fd = port.fd().as_raw_fd();
        let token = Token(self.tokens.start);
        if thread.registry.reregister(&mut SourceFd(&fd), token, interest).is_ok() {
            self.port.wants_write = wanted;
        }
    }

    /// Lets what was given to the port leave, then ends.
    pub(super) fn close(&mut self, patience: Micros) {
        self.closing_until = Some(self.clock.now() + patience);
        self.port.retry_at = None;
    }

    /// Whether nothing is left to wait for.
    pub(super) fn is_closed(&self, now: Micros) -> bool {
        let Some(until) = self.closing_until else { return false };
        match &self.phase {
            Phase::Open(channel) if !self.is_faulted => now >= until || !channel.is_settling(now),
            _ => true,
        }
    }

    /// Closes all that is open and tells so.
    pub(in crate::reactor) fn end(&mut self, thread: &Thread<I>) {
        self.closing_until.get_or_insert(self.clock.now());
        self.ask(thread, |link, now, host| link.close(now, host));
        self.conclude(self.clock.now());
        self.let_go(thread);
        if let Some(lane) = &mut self.host.endpoint {
            lane.endpoint.detach(&thread.registry);
        }
        self.status.set_condition(Condition::Removed);
        self.host.tell(Report::Removed);
    }
}
