//! The reference plug-ins with one thing wrong about them.

use crate::common::native;
use softplug_abi::{
    Action, ActionWriter, Actions, Event, EventKind, Instance, MarkId, Micros, Output,
};
use softplug_conformance::script::Script;
use softplug_conformance::{Class, FaultClass, FromFn, Subject};

/// What is wrong.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Wrong {
    /// Nothing is sent.
    Mute,
    /// All that is sent is sent twice.
    Doubled,
    /// Of each transmit the last byte is another.
    Altered,
    /// A byte of each delivery is another.
    Misdelivered,
    /// Each third received byte is not heard.
    Deaf,
    /// Every timer runs out late.
    Late,
    /// It traps at the fifth event.
    Traps,
    /// After a restore or a save it is as deaf as a new one.
    Forgetful,
    /// The size of each piece of the line counts.
    CountsPieces,
    /// It does less after it was opened again.
    Tired,
    /// It takes any settings, and does nothing with those that make no sense.
    Lenient,
    /// Settings make it panic.
    Touchy,
    /// It sends more than there is room.
    Greedy,
}

impl Wrong {
    pub(crate) const ALL: &[Self] = &[
        Self::Mute,
        Self::Doubled,
        Self::Altered,
        Self::Misdelivered,
        Self::Deaf,
        Self::Late,
        Self::Lenient,
    ];
    pub(crate) const OF_THE_ABI: &[Self] = &[
        Self::Traps,
        Self::Forgetful,
        Self::CountsPieces,
        Self::Tired,
        Self::Touchy,
        Self::Greedy,
    ];
}

/// Whether the script fails on the plug-in that is wrong in this way: by its behaviour,
/// or, where it is the ABI that is judged, by the fault that is meant.
pub(crate) fn caught(script: &Script, plugin: &str, wrong: Wrong) -> bool {
    let right = native(plugin);
    let manifest = Subject::manifest(&right).clone();
    let subject =
        FromFn::new(manifest, || Spoilt::new(right.instantiate().expect("it starts"), wrong));
    let Some(failure) = script.run(&subject).failure else { return false };
    match failure.class {
        Class::Fault(FaultClass::Trapped) => matches!(wrong, Wrong::Traps | Wrong::Touchy),
        Class::Fault(FaultClass::RuleBroken) => wrong == Wrong::Greedy,
        Class::Fault(_) => false,
        _ => true,
    }
}

struct Spoilt<I> {
    inner: I,
    wrong: Wrong,
    output: Vec<u8>,
    events: u32,
    heard: u32,
    opened: u32,
    is_deaf: bool,
}

impl<I: Instance> Spoilt<I> {
    fn new(inner: I, wrong: Wrong) -> Self {
        let output = vec![0; 1 << 17];
        Self { inner, wrong, output, events: 0, heard: 0, opened: 0, is_deaf: false }
    }

    /// What the plug-in is given in the place of some bytes; `None`: nothing.
    fn heard(&mut self, bytes: &[u8]) -> Option<Vec<u8>> {
        self.heard += 1;
        let is_lost = match self.wrong {
            Wrong::Deaf => self.heard.is_multiple_of(3),
            Wrong::Forgetful => self.is_deaf,
            Wrong::CountsPieces => bytes.len() > 3 || self.heard.is_multiple_of(4),
            Wrong::Tired => self.opened > 1,
            _ => false,
        };
        (!is_lost).then(|| bytes.to_vec())
    }

    fn look(&mut self, event: &Event<'_>) {
        self.events += 1;
        match event.kind() {
            EventKind::Open => self.opened += 1,
            EventKind::Save | EventKind::Restore => self.is_deaf = true,
            EventKind::Settings => assert!(self.wrong != Wrong::Touchy, "it cannot bear settings"),
            _ => {}
        }
        assert!(self.wrong != Wrong::Traps || self.events < 5, "it has had enough");
    }
}

impl<I: Instance> Instance for Spoilt<I> {
    type Fault = I::Fault;

    fn input_capacity(&self) -> usize {
        self.inner.input_capacity()
    }

    fn step(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, I::Fault> {
        self.look(event);
        let wrong = self.wrong;
        if wrong == Wrong::Lenient {
            let is_refused =
                event.kind() == EventKind::Settings && self.inner.step(event, now).is_err();
            self.is_deaf |= is_refused;
            if self.is_deaf || event.kind() == EventKind::Settings {
                return Ok(Output { actions: &[], more: false });
            }
        }
        let stepped = match *event {
            Event::Received(bytes) => match self.heard(bytes) {
                Some(bytes) => self.inner.step(&Event::Received(&bytes), now)?,
                None => return Ok(Output { actions: &[], more: false }),
            },
            _ => self.inner.step(event, now)?,
        };
        let mut writer = ActionWriter::new(&mut self.output);
        for action in Actions::new(stepped.actions) {
            let action = action.expect("the reference plug-in keeps the rules");
            spoil(wrong, &action, &mut writer);
        }
        let length = writer.len();
        Ok(Output { actions: &self.output[..length], more: stepped.more })
    }
}

fn spoil(wrong: Wrong, action: &Action<'_>, writer: &mut ActionWriter<'_>) {
    let mut push = |action: &Action<'_>| writer.push(action).expect("the buffer is large");
    match *action {
        Action::Transmit { mark, .. } if wrong == Wrong::Mute => {
            push(&Action::Transmit { mark, bytes: &[] });
        }
        Action::TransmitUrgent { .. } if wrong == Wrong::Mute => {}
        Action::Transmit { mark, bytes } if wrong == Wrong::Doubled => {
            push(&Action::Transmit { mark: MarkId::NONE, bytes });
            push(&Action::Transmit { mark, bytes });
        }
        Action::Transmit { mark, bytes } if wrong == Wrong::Altered => {
            push(&Action::Transmit { mark, bytes: &altered(bytes) });
        }
        Action::Transmit { mark, .. } if wrong == Wrong::Greedy => {
            for _ in 0..40 {
                push(&Action::Transmit { mark: MarkId::NONE, bytes: &[b'X'; 2_000] });
            }
            push(&Action::Transmit { mark, bytes: &[] });
        }
        Action::Deliver { delivery, bytes } if wrong == Wrong::Misdelivered => {
            push(&Action::Deliver { delivery, bytes: &altered(bytes) });
        }
        Action::SetTimer { id, deadline } if wrong == Wrong::Late => {
            push(&Action::SetTimer { id, deadline: deadline + Micros::from_secs(5) });
        }
        _ => push(action),
    }
}

fn altered(bytes: &[u8]) -> Vec<u8> {
    let mut altered = bytes.to_vec();
    if let Some(last) = altered.last_mut() {
        *last ^= 0x20;
    }
    altered
}
