//! A session: one running plug-in that takes events.

use crate::engine::{Running, Stepped, Stop};
use crate::{LoadError, Misbehaviour, Plugin, SessionFault, words};
use softplug_abi::limits::OUTPUT_ROUNDS;
use softplug_abi::{
    Event, EventKind, Instance, MORE_OUTPUT, Mailbox, Micros, Output, Refusal, Region,
};
use std::ops::Range;

/// One instance of a plug-in.
///
/// A session that traps, exhausts its budget or breaks the ABI has ended: it
/// answers every later step with the same fault, and the plug-in's code does not
/// run again. A refusal ends nothing.
///
/// ```
/// use softplug_abi::{Event, Instance, LineErrorKind, Micros};
/// use softplug_host::{Host, HostOptions};
///
/// # let wasm = wat::parse_file("tests/guests/echo.wat")?;
/// let plugin = Host::new(HostOptions::default())?.load_bytes(&wasm)?;
/// let mut session = plugin.instantiate()?;
/// session.configure(&plugin.manifest().resolve_settings([])?, Micros::ZERO)?;
/// session.step(&Event::Received(b"N10 G1 X100 Y100"), Micros(1_000))?;
/// session.step(&Event::Received(b"\n"), Micros(2_000))?;
/// assert!(session.fuel_used() < session.largest_fuel());
/// assert!(session.largest_fuel() < session.total_fuel());
/// assert_eq!(session.fault(), None);
///
/// // This plug-in panics on a break.
/// let a_break = Event::LineError { kind: LineErrorKind::Break, byte: None, span: 0 };
/// let fault = session.step(&a_break, Micros(3_000)).unwrap_err();
/// assert_eq!(session.fault(), Some(&fault));
/// assert_eq!(session.last_words(), Some("no breaks, please"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Session {
    plugin: Plugin,
    running: Box<dyn Running>,
    mailbox: Mailbox,
    fuel_per_event: u64,
    fuel: Fuel,
    /// Rounds of `continue` since the last other event.
    rounds: u32,
    fault: Option<SessionFault>,
}

/// Fuel so far, in units.
#[derive(Copy, Clone, Default)]
struct Fuel {
    last: u64,
    total: u64,
    largest: u64,
}

impl Plugin {
    /// A new instance with its own memory. Takes microseconds.
    ///
    /// # Errors
    /// The plug-in cannot be instantiated, or its mailbox is not as the ABI says.
    pub fn instantiate(&self) -> Result<Session, LoadError> {
        let (running, mailbox) = self.start()?;
        Ok(Session {
            plugin: self.clone(),
            running,
            mailbox,
            fuel_per_event: self.fuel_per_event(),
            fuel: Fuel::default(),
            rounds: 0,
            fault: None,
        })
    }
}

impl Session {
    /// The plug-in of which this is an instance.
    pub fn plugin(&self) -> &Plugin {
        &self.plugin
    }

    /// The fault with which the session ended.
    pub fn fault(&self) -> Option<&SessionFault> {
        self.fault.as_ref()
    }

    /// Panic text and place that a trapped plug-in left.
    pub fn last_words(&self) -> Option<&str> {
        match &self.fault {
            Some(SessionFault::Trapped { last_words, .. }) => last_words.as_deref(),
            _ => None,
        }
    }

    /// Units of fuel that the last step used.
    pub fn fuel_used(&self) -> u64 {
        self.fuel.last
    }

    /// Units of fuel that all steps used.
    pub fn total_fuel(&self) -> u64 {
        self.fuel.total
    }

    /// The most units of fuel that one step used.
    pub fn largest_fuel(&self) -> u64 {
        self.fuel.largest
    }

    /// What stands in a global of 32 or 64 bits that the module exports: one that is
    /// [instrumented](crate::Host::load_instrumented) does.
    pub fn global(&mut self, name: &str) -> Option<i64> {
        self.running.global(name)
    }

    /// Writes such a global; whether there is one that can be written.
    pub fn set_global(&mut self, name: &str, value: i64) -> bool {
        self.running.set_global(name, value)
    }

    /// The plug-in's memory, to look at.
    pub fn memory(&self) -> &[u8] {
        self.running.memory()
    }

    /// The plug-in's memory. With the [globals](Self::global) that can change it is all of a
    /// plug-in's state: whoever writes back what was read before goes back to then.
    ///
    /// ```
    /// use softplug_abi::{Event, Instance, Micros};
    /// use softplug_host::{Host, HostOptions};
    ///
    /// # let wasm = wat::parse_file("tests/guests/echo.wat")?;
    /// let plugin = Host::new(HostOptions::default())?.load_bytes(&wasm)?;
    /// let mut session = plugin.instantiate()?;
    /// let before = session.memory().to_vec();
    /// session.step(&Event::Received(b"G1"), Micros(1_000))?;
    /// assert!(session.memory() != before);
    /// session.memory_mut().copy_from_slice(&before);
    /// // What came is in the input of the mailbox.
    /// let input = session.mailbox().input;
    /// assert!(session.memory()[input.address as usize..].len() >= input.capacity as usize);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn memory_mut(&mut self) -> &mut [u8] {
        self.running.memory_mut()
    }

    /// Where events and answers lie in the plug-in's memory.
    pub fn mailbox(&self) -> Mailbox {
        self.mailbox
    }

    /// Ends the session with a fault of the plug-in.
    pub(crate) fn end(&mut self, event: EventKind, reason: Misbehaviour) -> SessionFault {
        let fault = SessionFault::Malformed { event, reason };
        poison(&mut self.fault, &self.plugin, fault)
    }

    fn count_rounds(&mut self, event: EventKind) -> Result<(), SessionFault> {
        if event != EventKind::Continue {
            self.rounds = 0;
            return Ok(());
        }
        self.rounds += 1;
        if self.rounds > OUTPUT_ROUNDS {
            return Err(self.end(event, Misbehaviour::TooManyRounds));
        }
        Ok(())
    }
}

impl Fuel {
    #[inline]
    fn count(&mut self, used: u64) {
        self.last = used;
        self.total = self.total.saturating_add(used);
        self.largest = self.largest.max(used);
    }
}

#[cold]
fn poison(place: &mut Option<SessionFault>, plugin: &Plugin, fault: SessionFault) -> SessionFault {
    tracing::debug!(%fault, plugin = plugin.manifest().name, "a session has ended");
    place.insert(fault).clone()
}

/// The fault of a step without output, and whether it ends the session.
#[cold]
fn fault_of(
    event: EventKind,
    result: Result<i32, Box<Stop>>,
    fuel: u64,
    memory: &mut [u8],
    mailbox: &Mailbox,
) -> (SessionFault, bool) {
    let result = match result {
        Ok(result) => result,
        Err(stop) => {
            let fault = match *stop {
                Stop::OutOfFuel => SessionFault::BudgetExhausted { event, fuel },
                Stop::Trap { reason, frames } => {
                    let last_words = words::read(memory, mailbox.words);
                    SessionFault::Trapped { event, reason, frames, last_words }
                }
            };
            return (fault, true);
        }
    };
    let malformed = |reason| (SessionFault::Malformed { event, reason }, true);
    if result >= 0 {
        let Region { capacity, .. } = mailbox.output;
        return malformed(Misbehaviour::Length { length: length_of(result), capacity });
    }
    let code = u16::try_from(result.unsigned_abs()).ok();
    let Some(refusal) = code.and_then(Refusal::from_code) else {
        return malformed(Misbehaviour::UnknownResult(result));
    };
    let out_of_place = match refusal {
        Refusal::Settings => event != EventKind::Settings,
        Refusal::State => event != EventKind::Restore,
        Refusal::MalformedEvent | Refusal::UnknownEvent => false,
    };
    if out_of_place {
        return malformed(Misbehaviour::Refusal(refusal));
    }
    let words = words::read(memory, mailbox.words);
    words::clear(memory, mailbox.words);
    (SessionFault::Refused { event, refusal, words }, false)
}

/// Bytes of output that a result tells of.
fn length_of(result: i32) -> u32 {
    (result & !MORE_OUTPUT) as u32
}

impl Instance for Session {
    type Fault = SessionFault;

    fn input_capacity(&self) -> usize {
        self.mailbox.input.capacity as usize
    }

    /// The event's payload is written straight into the plug-in's memory, and the
    /// actions are a slice of it: nothing is copied or allocated in between.
    fn step(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, SessionFault> {
        if let Some(fault) = &self.fault {
            return Err(fault.clone());
        }
        let kind = event.kind();
        self.count_rounds(kind)?;
        let Self { plugin, running, mailbox, fuel_per_event, fuel, fault, .. } = self;
        let input = range(mailbox.input);
        let capacity = input.len();
        let Ok(stepped) = running.step(event, input, now, *fuel_per_event) else {
            return Err(SessionFault::EventTooLarge { event: kind, capacity });
        };
        let Stepped { result, fuel_used, memory } = stepped;
        fuel.count(fuel_used);
        let Region { address, capacity } = mailbox.output;
        match result {
            Ok(result) if result >= 0 && length_of(result) <= capacity => {
                let start = address as usize;
                let actions = &memory[start..start + length_of(result) as usize];
                Ok(Output { actions, more: result & MORE_OUTPUT != 0 })
            }
            result => {
                let (why, ends) = fault_of(kind, result, *fuel_per_event, memory, mailbox);
                Err(if ends { poison(fault, plugin, why) } else { why })
            }
        }
    }

    fn total_fuel(&self) -> u64 {
        Self::total_fuel(self)
    }

    fn last_words(&self) -> Option<&str> {
        Self::last_words(self)
    }
}

/// Lies inside the memory: the mailbox was checked, and a memory never shrinks.
fn range(region: Region) -> Range<usize> {
    let start = region.address as usize;
    start..start + region.capacity as usize
}

impl std::fmt::Debug for Session {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Session")
            .field("plugin", &self.plugin)
            .field("fault", &self.fault)
            .finish_non_exhaustive()
    }
}
