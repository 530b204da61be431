//! A plug-in and a simulated partner on one line, in virtual time.

use std::collections::VecDeque;

use softplug_abi::{Action, Instance, JobId, Micros, ModemLines};
use softplug_link::{LinkFault, LinkHost, LinkOptions, Supply, VirtualLine, WireHost};
use softplug_machines::{Partner, Signal};

/// Both ends of a line. Time goes from one instant at which something happens
/// to the next; nothing is ever late.
///
/// ```
/// use softplug_abi::manifest::Manifest;
/// use softplug_abi::{JobId, Micros};
/// use softplug_trial::ClosedLoop;
/// use softplug_machines::xon_xoff::{Control, ControlOptions};
/// use softplug_link::{Job, LinkOptions, Recorder};
/// use softplug_native::NativePlugin;
///
/// let plugin = NativePlugin::XonXoff;
/// let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
/// let settings = manifest.resolve_settings([])?;
/// let options = LinkOptions { settings, ..LinkOptions::default() };
/// let control = Control::new(ControlOptions::default())?;
/// let mut both = ClosedLoop::new(plugin.instantiate(), options, 16, control);
///
/// let mut host = Recorder::default();
/// host.add_source(JobId(1), b"N10 G1 X100\n".to_vec());
/// both.line.link.open(both.now(), &mut host)?;
/// let check = manifest.needs.check_pass;
/// let job = Job { id: JobId(1), kind: 0, size: Some(12), fields: Vec::new(), check };
/// both.line.link.begin_job(both.now(), job, &mut host)?;
/// both.settle(&mut host)?;
/// both.wait_until(Micros::from_secs(1), &mut host)?;
/// assert!(both.partner.report().received.matches(b"N10 G1 X100\n"));
/// assert_eq!(both.next(), None);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct ClosedLoop<I: Instance, P> {
    /// The plug-in's end.
    pub line: VirtualLine<I>,
    /// The machine's end.
    pub partner: P,
    /// From the end of what the machine sends until the plug-in is told.
    pub reaction: Micros,
    /// Characters on the wire: when their stop bit ends.
    in_flight: VecDeque<(Micros, u8)>,
    /// What the machine has sent, and when the plug-in is told.
    untold: VecDeque<(Micros, Signal)>,
    /// The lines of the plug-in's port, and those that are on.
    modem_lines: Option<(ModemLines, ModemLines)>,
    now: Micros,
}

impl<I: Instance, P: Partner> ClosedLoop<I, P> {
    /// A line on which the plug-in's port holds at most `depth` characters. The
    /// link is not open yet.
    pub fn new(instance: I, options: LinkOptions, depth: usize, partner: P) -> Self {
        let modem_lines = options.modem_lines;
        Self {
            line: VirtualLine::new(instance, options, depth),
            partner,
            reaction: Micros::ZERO,
            in_flight: VecDeque::new(),
            untold: VecDeque::new(),
            modem_lines,
            now: Micros::ZERO,
        }
    }

    /// Time on the line.
    pub fn now(&self) -> Micros {
        self.now
    }

    /// When something happens next; `None` if all is at rest.
    pub fn next(&self) -> Option<Micros> {
        let arrival = self.in_flight.front().map(|(end, _)| *end);
        let told = self.untold.front().map(|(at, _)| *at);
        [self.line.poll_timeout(), arrival, told, self.partner.next_event()]
            .into_iter()
            .flatten()
            .min()
    }

    /// Does all that happens at the next instant. `false` if all is at rest, or
    /// nothing happens up to `until`.
    ///
    /// # Errors
    /// The plug-in fails.
    pub fn step(
        &mut self,
        until: Micros,
        host: &mut dyn WireHost,
    ) -> Result<bool, LinkFault<I::Fault>> {
        let Some(next) = self.next().filter(|next| *next <= until) else { return Ok(false) };
        self.now = self.now.max(next);
        let now = self.now;
        while let Some((_, byte)) = self.in_flight.pop_front_if(|(end, _)| *end <= now) {
            self.partner.receive(now, byte);
        }
        self.partner.advance(now);
        while let Some(signal) = self.partner.poll_signal(now) {
            self.untold.push_back((now + self.reaction, signal));
        }
        while let Some((_, signal)) = self.untold.pop_front_if(|(at, _)| *at <= now) {
            self.tell(signal, host)?;
        }
        self.settle(host)?;
        Ok(true)
    }

    /// Lets time come to `until`, whether anything happens then or not.
    ///
    /// # Errors
    /// The plug-in fails.
    pub fn wait_until(
        &mut self,
        until: Micros,
        host: &mut dyn WireHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        while self.step(until, host)? {}
        self.now = self.now.max(until);
        self.partner.advance(self.now);
        self.settle(host)
    }

    fn tell(&mut self, signal: Signal, host: &mut dyn WireHost) -> Result<(), LinkFault<I::Fault>> {
        let now = self.now;
        let mut host = Watch { host, in_flight: &mut self.in_flight, set: Vec::new() };
        let link = &mut self.line.link;
        match signal {
            Signal::Character(byte) => link.received(now, &[byte], &mut host)?,
            Signal::LineError { kind, byte } => {
                link.line_error(now, kind, byte, 0, &mut host)?;
            }
            Signal::ModemLines { lines, on } => {
                // A port without modem lines sees none.
                if let Some((known, before)) = self.modem_lines {
                    let now_on = ModemLines((before.0 & !lines.0 | on.0) & known.0);
                    self.modem_lines = Some((known, now_on));
                    link.modem_lines(now, known, now_on, &mut host)?;
                }
            }
        }
        let set = host.set;
        self.set_outputs(&set);
        Ok(())
    }

    /// The machine sees what the plug-in has done to its outputs.
    fn set_outputs(&mut self, set: &[(ModemLines, ModemLines)]) {
        for &(mask, on) in set {
            let Some((known, before)) = self.modem_lines else { return };
            let mask = ModemLines(mask.0 & known.0);
            let on = ModemLines(on.0 & mask.0);
            self.modem_lines = Some((known, ModemLines(before.0 & !mask.0 | on.0)));
            self.partner.modem_lines(self.now, mask, on);
        }
    }

    /// Delivers what is due now and lets the transmitter take what it may; to
    /// be called after a request of the host.
    ///
    /// # Errors
    /// The plug-in fails.
    pub fn settle(&mut self, host: &mut dyn WireHost) -> Result<(), LinkFault<I::Fault>> {
        let mut watch = Watch { host, in_flight: &mut self.in_flight, set: Vec::new() };
        self.line.transmit(self.now, &mut watch)?;
        let set = watch.set;
        self.set_outputs(&set);
        Ok(())
    }

    /// Steps until `is_done`, all is at rest, or time has come to `until`.
    ///
    /// # Errors
    /// The plug-in fails.
    pub fn run_until<O: WireHost>(
        &mut self,
        until: Micros,
        host: &mut O,
        is_done: impl Fn(&O) -> bool,
    ) -> Result<(), LinkFault<I::Fault>> {
        while !is_done(host) && self.step(until, host)? {}
        Ok(())
    }
}

/// Sees what goes onto the wire.
struct Watch<'a> {
    host: &'a mut dyn WireHost,
    in_flight: &'a mut VecDeque<(Micros, u8)>,
    /// Outputs that the plug-in has set, and which of them on.
    set: Vec<(ModemLines, ModemLines)>,
}

impl LinkHost for Watch<'_> {
    fn handle(&mut self, now: Micros, action: &Action<'_>) {
        if let Action::ModemLines { mask, on } = action {
            self.set.push((*mask, *on));
        }
        self.host.handle(now, action);
    }

    fn supply(&mut self, job: JobId, buffer: &mut [u8]) -> Supply {
        self.host.supply(job, buffer)
    }

    fn rewind(&mut self, job: JobId) {
        self.host.rewind(job);
    }

    fn drained(&mut self) -> u32 {
        self.host.drained()
    }
}

impl WireHost for Watch<'_> {
    fn on_wire(&mut self, start: Micros, byte: u8) {
        self.host.on_wire(start, byte);
    }

    fn off_wire(&mut self, end: Micros, byte: u8) {
        self.in_flight.push_back((end, byte));
        self.host.off_wire(end, byte);
    }
}
