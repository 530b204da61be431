//! A plug-in that runs here: the ABI's mailbox, one event a call.

use crate::machine::{Machine, Room, StartError};
use crate::module::{Function, Module};
use crate::tables::ValueType;
use crate::trap::Trap;
use alloc::string::String;
use alloc::sync::Arc;
use core::ops::Range;
use softplug_abi::limits::{FUEL_PER_EVENT, OUTPUT_ROUNDS};
use softplug_abi::{
    EXPORT_MAILBOX, EXPORT_STEP, Event, EventKind, Instance, MORE_OUTPUT, Mailbox, MailboxError,
    Micros, Output, Refusal, Region,
};
use thiserror::Error;

/// A running plug-in.
///
/// One that traps, exhausts its budget or breaks the ABI has ended: it answers every later step with the
/// same fault, and its code does not run again. A refusal ends nothing.
///
/// ```
/// use softplug_abi::{Event, Instance, Micros};
/// use softplug_interpreter::{Module, Room, Session};
/// use std::sync::Arc;
///
/// # let wasm = wat::parse_file("../host/tests/guests/echo.wat")?;
/// let mut session = Session::start(Arc::new(Module::load(wasm)?), Room::default())?;
/// let output = session.step(&Event::Received(b"G1"), Micros(1_000))?;
/// assert_eq!(output.actions, b"\x01\0\x06\0\0\0\0\0G1");
/// assert!(session.total_fuel() > 0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Session<B> {
    machine: Machine<B>,
    step: Function,
    mailbox: Mailbox,
    total_fuel: u64,
    /// Rounds of `continue` since the last other event.
    rounds: u32,
    fault: Option<SessionFault>,
    last_words: Option<String>,
}

/// Why a plug-in did not take an event, or does not start.
///
/// ```
/// use softplug_interpreter::{Module, Room, Session, SessionFault};
/// use std::sync::Arc;
///
/// let wasm = wat::parse_str("(module (memory (export \"memory\") 1 1))")?;
/// let fault = Session::start(Arc::new(Module::load(wasm)?), Room::default()).unwrap_err();
/// assert_eq!(fault, SessionFault::MissingExport("softplug_v1"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub enum SessionFault {
    /// There is no room for it.
    #[error("the plug-in cannot be started: {0}")]
    Start(#[from] StartError),
    /// It does not export a function that the ABI asks for.
    #[error("the plug-in does not export the function \"{0}\" as the ABI has it")]
    MissingExport(&'static str),
    /// The descriptor of its mailbox lies outside its memory.
    #[error("the plug-in's mailbox descriptor at {address} lies outside its memory")]
    Descriptor {
        /// Where it says that it is.
        address: u32,
    },
    /// Its mailbox cannot be used.
    #[error("the plug-in's mailbox cannot be used: {0}")]
    Mailbox(#[from] MailboxError),
    /// It trapped as it was asked for its mailbox.
    #[error("the plug-in trapped at its start: {0}")]
    TrappedAtStart(Trap),
    /// It trapped.
    #[error("the plug-in trapped on event {event}: {trap}")]
    Trapped {
        /// The event.
        event: EventKind,
        /// Why.
        trap: Trap,
    },
    /// It computed for too long.
    #[error("the plug-in used all its fuel on event {event}")]
    BudgetExhausted {
        /// The event.
        event: EventKind,
    },
    /// What it answered is none of the ABI's answers.
    #[error("the plug-in answered event {event} with {result}, which has no meaning there")]
    Malformed {
        /// The event.
        event: EventKind,
        /// The answer.
        result: i32,
    },
    /// It had yet more output after the most rounds.
    #[error("the plug-in's output does not end")]
    TooManyRounds,
    /// It does not take the event. It goes on.
    #[error("the plug-in refuses event {event}")]
    Refused {
        /// The event.
        event: EventKind,
        /// Why.
        refusal: Refusal,
    },
    /// The event is longer than the plug-in's input buffer. It goes on.
    #[error("event {event} is longer than {capacity} bytes")]
    EventTooLarge {
        /// The event.
        event: EventKind,
        /// The buffer's size in bytes.
        capacity: usize,
    },
}

impl<B: AsRef<[u8]>> Session<B> {
    /// Starts a plug-in in this room.
    ///
    /// # Errors
    /// It has no room, it is not as the ABI says, or it trapped.
    pub fn start(module: Arc<Module<B>>, room: Room) -> Result<Self, SessionFault> {
        use ValueType::{I32, I64};
        let function = |name, parameters: &[ValueType]| {
            let found = module.exported_function(name);
            let fits = |function: &Function| module.has_signature(*function, parameters, Some(I32));
            found.filter(fits).ok_or(SessionFault::MissingExport(name))
        };
        let ask = function(EXPORT_MAILBOX, &[])?;
        let step = function(EXPORT_STEP, &[I32, I32, I64])?;
        let mut machine = Machine::new(module, room)?;
        let mut fuel = FUEL_PER_EVENT as u32;
        let address = machine.call(ask, &[], &mut fuel).map_err(SessionFault::TrappedAtStart)?;
        let address = address.unwrap_or(0) as u32;
        let memory = machine.memory();
        let descriptor = memory.get(address as usize..).and_then(<[u8]>::first_chunk);
        let descriptor = descriptor.ok_or(SessionFault::Descriptor { address })?;
        let mailbox = Mailbox::decode(*descriptor, memory.len() as u64)?;
        Ok(Self { machine, step, mailbox, total_fuel: 0, rounds: 0, fault: None, last_words: None })
    }

    /// The fault with which it ended.
    pub fn fault(&self) -> Option<&SessionFault> {
        self.fault.as_ref()
    }

    fn end(&mut self, fault: SessionFault) -> SessionFault {
        self.fault.insert(fault).clone()
    }

    /// The fault of a step without output.
    fn fault_of(&mut self, event: EventKind, result: Result<i32, Trap>) -> SessionFault {
        match result {
            Err(Trap::OutOfFuel) => self.end(SessionFault::BudgetExhausted { event }),
            Err(trap) => {
                self.last_words = self.words();
                self.end(SessionFault::Trapped { event, trap })
            }
            Ok(result) => {
                let code = u16::try_from(result.unsigned_abs()).ok().filter(|_| result < 0);
                match code.and_then(Refusal::from_code) {
                    Some(refusal) if fits(refusal, event) => {
                        SessionFault::Refused { event, refusal }
                    }
                    _ => self.end(SessionFault::Malformed { event, result }),
                }
            }
        }
    }

    /// A length, then text; a length past the region's end is cut to it.
    fn words(&self) -> Option<String> {
        let words = &self.machine.memory()[range(self.mailbox.words)];
        let (length, text) = words.split_first_chunk::<4>()?;
        let length = u32::from_le_bytes(*length) as usize;
        let text = &text[..length.min(text.len())];
        let plain = |c: char| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c };
        let text: String = String::from_utf8_lossy(text).chars().map(plain).collect();
        (!text.is_empty()).then_some(text)
    }
}

/// Whether this refusal is an answer to such an event.
fn fits(refusal: Refusal, event: EventKind) -> bool {
    match refusal {
        Refusal::Settings => event == EventKind::Settings,
        Refusal::State => event == EventKind::Restore,
        Refusal::MalformedEvent | Refusal::UnknownEvent => true,
    }
}

/// Lies inside the memory: the mailbox was checked, and a memory never shrinks.
fn range(region: Region) -> Range<usize> {
    let start = region.address as usize;
    start..start + region.capacity as usize
}

impl<B: AsRef<[u8]>> Instance for Session<B> {
    type Fault = SessionFault;

    fn input_capacity(&self) -> usize {
        self.mailbox.input.capacity as usize
    }

    fn step(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, SessionFault> {
        if let Some(fault) = &self.fault {
            return Err(fault.clone());
        }
        let kind = event.kind();
        self.rounds = if kind == EventKind::Continue { self.rounds + 1 } else { 0 };
        if self.rounds > OUTPUT_ROUNDS {
            return Err(self.end(SessionFault::TooManyRounds));
        }
        let input = &mut self.machine.memory_mut()[range(self.mailbox.input)];
        let capacity = input.len();
        let Ok(length) = event.encode(input) else {
            return Err(SessionFault::EventTooLarge { event: kind, capacity });
        };
        let arguments = [u64::from(kind.code()), length as u64, now.0 as u64];
        let mut fuel = FUEL_PER_EVENT as u32;
        let result = self.machine.call(self.step, &arguments, &mut fuel);
        self.total_fuel += FUEL_PER_EVENT - u64::from(fuel);
        let result = result.map(|bits| bits.unwrap_or(0) as u32 as i32);
        let output = range(self.mailbox.output);
        match result {
            Ok(code) if code >= 0 && (code & !MORE_OUTPUT) as usize <= output.len() => {
                let length = (code & !MORE_OUTPUT) as usize;
                let actions = &self.machine.memory()[output.start..output.start + length];
                Ok(Output { actions, more: code & MORE_OUTPUT != 0 })
            }
            result => Err(self.fault_of(kind, result)),
        }
    }

    fn total_fuel(&self) -> u64 {
        self.total_fuel
    }

    fn last_words(&self) -> Option<&str> {
        self.last_words.as_deref()
    }
}
