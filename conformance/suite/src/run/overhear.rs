//! A plug-in whose every call is written down.

use super::permute::Permutation;
use super::replay::replay;
use super::subject::{Fuel, Subject, SubjectError};
use crate::given::case::Case;
use softplug_abi::limits::INPUT_BYTES;
use softplug_abi::manifest::Manifest;
use softplug_abi::{Event, EventKind, Instance, Micros, Output, Refusal};
use softplug_host::SessionFault;
use std::cell::{Cell, RefCell};
use std::error::Error;
use std::rc::Rc;

/// One call of an instance.
///
/// The example of [`calls`] shows one.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Call {
    /// The instance, from 1: a swap makes a new one.
    pub instance: u32,
    /// On the link's clock.
    pub now: Micros,
    /// The event's kind.
    pub event: EventKind,
    /// As the ABI encodes it.
    pub payload: Vec<u8>,
    /// As they were encoded.
    pub actions: Vec<u8>,
    /// It has more to write.
    pub more: bool,
    /// Units of fuel that this call used.
    pub fuel: u64,
    /// The number by which a sandboxed plug-in refused the event.
    pub refusal: Option<Refusal>,
    /// Why it did not take the event.
    pub fault: Option<String>,
    /// Functions that were running when it trapped, the innermost first.
    pub frames: Vec<String>,
    /// Panic text and place that it left as it trapped.
    pub last_words: Option<String>,
}

/// Every call of the ABI in a run of a trace.
///
/// ```
/// use softplug_abi::manifest::Manifest;
/// use softplug_abi::{Action, Actions, EventKind, Micros};
/// use softplug_conformance::{Call, FromFn, Permutation, calls, load};
/// use softplug_native::NativePlugin;
///
/// let plugin = NativePlugin::XonXoff;
/// let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
/// let subject = FromFn::new(manifest, move || plugin.instantiate());
/// let case = &load(["../../fixtures/traces/xon-xoff/xon-xoff.tx.hold.spt"])?[0];
/// let calls = calls(&subject, case, &Permutation::Uncut);
/// // XOFF comes, and the plug-in holds its queue.
/// let xoff = calls.iter().find(|call| call.event == EventKind::Received);
/// let Call { now, payload, actions, .. } = xoff.expect("the trace has two of them");
/// assert_eq!((*now, &payload[..]), (Micros(1_500), &[0x13][..]));
/// assert!(Actions::new(actions).any(|action| action == Ok(Action::Hold)));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn calls<S: Subject>(subject: &S, case: &Case, permutation: &Permutation) -> Vec<Call> {
    let overheard = Overheard::new(subject, Most { calls: usize::MAX, bytes: usize::MAX });
    replay(&overheard, case, permutation, 0);
    overheard.take().list
}

/// What was written down.
#[derive(Clone, Debug, Default)]
pub(crate) struct Calls {
    pub(crate) list: Vec<Call>,
    /// There was more than there was room for.
    pub(crate) is_cut: bool,
    bytes: usize,
}

/// How much is written down.
#[derive(Copy, Clone, Debug)]
pub(crate) struct Most {
    pub(crate) calls: usize,
    /// Of payloads and actions.
    pub(crate) bytes: usize,
}

impl Calls {
    fn push(&mut self, call: Call, most: Most) {
        self.bytes += call.payload.len() + call.actions.len();
        self.is_cut |= self.list.len() >= most.calls || self.bytes > most.bytes;
        if !self.is_cut {
            self.list.push(call);
        }
    }
}

/// A subject whose instances write down their calls.
pub(crate) struct Overheard<'a, S: Subject> {
    subject: &'a S,
    calls: Rc<RefCell<Calls>>,
    instances: Cell<u32>,
    most: Most,
}

impl<'a, S: Subject> Overheard<'a, S> {
    pub(crate) fn new(subject: &'a S, most: Most) -> Self {
        Self { subject, calls: Rc::default(), instances: Cell::new(0), most }
    }

    /// All that was written down so far.
    pub(crate) fn take(&self) -> Calls {
        self.calls.take()
    }
}

impl<S: Subject> Subject for Overheard<'_, S> {
    type Instance = OverheardInstance<S::Instance>;

    fn instantiate(&self) -> Result<Self::Instance, SubjectError> {
        let instance = self.subject.instantiate()?;
        self.instances.set(self.instances.get() + 1);
        Ok(OverheardInstance {
            instance,
            number: self.instances.get(),
            fuel: S::fuel,
            actions: Vec::new(),
            calls: Rc::clone(&self.calls),
            most: self.most,
        })
    }

    fn manifest(&self) -> &Manifest {
        self.subject.manifest()
    }

    fn label(&self) -> &str {
        self.subject.label()
    }

    fn fuel(instance: &Self::Instance) -> Fuel {
        S::fuel(&instance.instance)
    }
}

pub(crate) struct OverheardInstance<I: Instance> {
    instance: I,
    number: u32,
    fuel: fn(&I) -> Fuel,
    /// Of the last call.
    actions: Vec<u8>,
    calls: Rc<RefCell<Calls>>,
    most: Most,
}

impl<I: Instance> Instance for OverheardInstance<I> {
    type Fault = I::Fault;

    fn input_capacity(&self) -> usize {
        self.instance.input_capacity()
    }

    fn step(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, I::Fault> {
        let mut payload = vec![0; *INPUT_BYTES.end() as usize];
        let length = event.encode(&mut payload).unwrap_or(0);
        payload.truncate(length);
        let before = (self.fuel)(&self.instance).total;
        let mut call = Call {
            instance: self.number,
            now,
            event: event.kind(),
            payload,
            actions: Vec::new(),
            more: false,
            fuel: 0,
            refusal: None,
            fault: None,
            frames: Vec::new(),
            last_words: None,
        };
        let stepped = match self.instance.step(event, now) {
            Ok(output) => {
                call.actions = output.actions.to_vec();
                call.more = output.more;
                Ok(output.more)
            }
            Err(fault) => {
                call.fault = Some(fault.to_string());
                let known: &(dyn Error + 'static) = &fault;
                let known = known.downcast_ref::<SessionFault>();
                call.refusal = known.and_then(SessionFault::refusal);
                if let Some(SessionFault::Trapped { frames, last_words, .. }) = known {
                    call.frames.clone_from(frames);
                    call.last_words.clone_from(last_words);
                }
                Err(fault)
            }
        };
        call.fuel = (self.fuel)(&self.instance).total.saturating_sub(before);
        self.actions.clone_from(&call.actions);
        self.calls.borrow_mut().push(call, self.most);
        stepped.map(|more| Output { actions: &self.actions, more })
    }
}
