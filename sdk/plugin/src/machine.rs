//! From encoded events to a converter's methods and back to encoded actions.

use crate::context::{Context, Rooms};
use crate::state::{StateReader, emit, measure};
use crate::{Converter, JobId, JobStart, Opening, PartEvent, SettingSet, StateError};
use softplug_abi::limits::STATE_BYTES;
use softplug_abi::wire::{Reader, copy};
use softplug_abi::{Event, EventKind, Micros, RawValue, Refusal, TakeEvent, Values};

const RECEIVED: i32 = EventKind::Received as i32;
const JOB_DATA: i32 = EventKind::JobData as i32;

/// What a step gave: length of the output and whether more is to come, or that the event
/// was not taken. [`Machine::why`] says why.
pub(crate) type Stepped = Result<(usize, bool), Refusal>;

/// As an `Option`, but all zeros where it is empty: such a static takes no space
/// in a module.
#[derive(Debug)]
#[repr(u8)]
enum Slot<T> {
    Empty = 0,
    Full(T),
}

/// A converter with all that it needs between two events.
#[derive(Debug)]
pub(crate) struct Machine<C: Converter> {
    core: Core<C>,
    rooms: Rooms,
}

impl<C: Converter> Machine<C> {
    pub(crate) const fn new() -> Self {
        Self { core: Core::new(), rooms: Rooms { transmit: 0, delivery: 0 } }
    }

    /// Why an event was not taken, and the field of a state that was the reason.
    pub(crate) fn why(&self) -> (&'static str, Option<StateError>) {
        (self.core.why.unwrap_or_default(), self.core.wrong)
    }

    /// One event. `code` and `payload` are what the host gave; `state` gathers
    /// the pieces of a state to restore.
    #[inline]
    pub(crate) fn step(
        &mut self,
        code: i32,
        payload: &[u8],
        now: Micros,
        output: &mut [u8],
        state: &mut [u8],
    ) -> Stepped {
        let Self { core, rooms } = self;
        let mut link = Context::new(output, now, rooms);
        if !core.takes_bytes(&mut link, code, payload) {
            core.step(&mut link, code, payload, state)?;
        }
        let (length, again) = link.finish();
        Ok((length, again || core.saving.is_some()))
    }
}

/// Settings and converter.
#[derive(Debug)]
struct Core<C: Converter> {
    converter: Slot<C>,
    settings: C::Settings,
    /// How many settings have come; None before the first.
    next_setting: Option<u16>,
    /// Where the next piece of a save begins.
    saving: Option<usize>,
    restored_length: usize,
    /// Why the last event was not taken, where there is more to say than its refusal.
    why: Option<&'static str>,
    /// The field of a state for which it was refused.
    wrong: Option<StateError>,
}

impl<C: Converter> Core<C> {
    const fn new() -> Self {
        Self {
            converter: Slot::Empty,
            settings: C::Settings::UNSET,
            next_setting: None,
            saving: None,
            restored_length: 0,
            why: None,
            wrong: None,
        }
    }

    #[inline(never)]
    fn refuse(&mut self, refusal: Refusal, why: &'static str) -> Result<(), Refusal> {
        self.why = Some(why);
        Err(refusal)
    }

    /// Most events carry bytes: these go straight to the converter, past the code that takes
    /// the others apart and the stack that it needs. Whether this was one.
    #[inline]
    fn takes_bytes(&mut self, link: &mut Context<'_>, code: i32, payload: &[u8]) -> bool {
        let Slot::Full(converter) = &mut self.converter else { return false };
        if code == RECEIVED && !payload.is_empty() {
            converter.received(link, payload);
        } else if code == JOB_DATA
            && let Some((job, bytes)) = payload.split_first_chunk()
            && *job != [0; 4]
            && !bytes.is_empty()
        {
            converter.parts(link, &PartEvent::JobData(bytes));
            converter.job_data(link, JobId(u32::from_le_bytes(*job)), bytes);
        } else {
            return false;
        }
        self.saving = None;
        converter.after(link);
        true
    }

    /// Any event.
    #[cfg_attr(target_arch = "wasm32", inline(never))]
    fn step(
        &mut self,
        link: &mut Context<'_>,
        code: i32,
        payload: &[u8],
        state: &mut [u8],
    ) -> Result<(), Refusal> {
        (self.why, self.wrong) = (None, None);
        let kind = u16::try_from(code).ok().and_then(EventKind::from_code);
        let kind = kind.ok_or(Refusal::UnknownEvent)?;
        let malformed = Refusal::MalformedEvent;
        let mut reader = Reader::new(payload);
        if kind != EventKind::Continue {
            self.saving = None;
        }
        // Each kind by its name: the code for the others is then left out.
        macro_rules! begin {
            ($kind:expr) => {{
                let taker = Beginning { core: self, link, state };
                return Event::read($kind, &mut reader, taker).ok_or(malformed)?;
            }};
        }
        match kind {
            EventKind::Settings => begin!(EventKind::Settings),
            EventKind::Open => begin!(EventKind::Open),
            EventKind::Restore => begin!(EventKind::Restore),
            _ => {}
        }
        let Slot::Full(converter) = &mut self.converter else { return self.is_not_open() };
        let is_saving = self.saving.is_some();
        opened(converter, link, kind, &mut reader, is_saving);
        // Bytes that `takes_bytes` has not taken are malformed.
        let is_bytes = matches!(kind, EventKind::Received | EventKind::JobData);
        if is_bytes || !reader.is_sound() {
            return Err(malformed);
        }
        match kind {
            EventKind::Close => {
                self.converter = Slot::Empty;
                return Ok(());
            }
            EventKind::Save => self.saving = Some(0),
            _ => {}
        }
        match self.saving {
            Some(offset) => self.saving = save(converter, link, offset),
            None => converter.after(link),
        }
        Ok(())
    }

    #[cold]
    #[inline(never)]
    fn is_not_open(&mut self) -> Result<(), Refusal> {
        self.refuse(Refusal::MalformedEvent, "the link is not open")
    }

    fn settings(&mut self, first: bool, last: bool, values: &Values<'_>) -> Result<(), Refusal> {
        if first {
            self.settings = C::Settings::UNSET;
            self.next_setting = Some(0);
        }
        let Some(mut next) = self.next_setting else {
            return self.refuse(Refusal::MalformedEvent, "the first settings are missing");
        };
        let mut reader = Reader::new(values.as_bytes());
        while !reader.is_empty() {
            let value = RawValue::read(&mut reader);
            if reader.has_failed() {
                return Err(Refusal::MalformedEvent);
            }
            let index = value.index;
            if index != next || !self.settings.set(index, &value) {
                return self.refuse(Refusal::Settings, "a setting is of another type or order");
            }
            next += 1;
        }
        self.next_setting = Some(next);
        if !last {
            return Ok(());
        }
        if next != C::Settings::COUNT {
            return self.refuse(Refusal::Settings, "a setting has no value");
        }
        match C::check_settings(&self.settings) {
            Ok(()) => Ok(()),
            Err(text) => self.refuse(Refusal::Settings, text),
        }
    }

    /// Makes a converter with the settings that were given, in its place: the stack
    /// of a plug-in does not hold several of them.
    #[inline(never)]
    fn begin(&mut self) -> Result<(), Refusal> {
        if self.next_setting.unwrap_or(0) != C::Settings::COUNT {
            return self.refuse(Refusal::MalformedEvent, "open came before the settings");
        }
        self.converter = Slot::Full(C::new(self.settings));
        Ok(())
    }

    fn restore(
        &mut self,
        format: u16,
        offset: u32,
        total: u32,
        bytes: &[u8],
        state: &mut [u8],
    ) -> Result<(), Refusal> {
        if offset == 0 {
            self.restored_length = 0;
        }
        if offset as usize != self.restored_length || total > STATE_BYTES {
            return self.refuse(Refusal::State, "a piece of the state is missing");
        }
        let end = self.restored_length + bytes.len();
        let Some(place) = state.get_mut(self.restored_length..end) else {
            return self.refuse(Refusal::State, "the state is too long");
        };
        copy(place, bytes);
        self.restored_length = end;
        if end < total as usize {
            return Ok(());
        }
        self.begin()?;
        let Slot::Full(converter) = &mut self.converter else { return Ok(()) };
        let mut reader = StateReader::new(format, state.get(..end).unwrap_or_default());
        let taken = converter.restore(format, &mut reader);
        let Some(error) = taken.err().or_else(|| reader.wrong()) else { return Ok(()) };
        self.converter = Slot::Empty;
        self.wrong = Some(error);
        self.refuse(Refusal::State, StateError::TEXT)
    }
}

/// Writes pieces from `offset` on; returns where the next ones begin.
fn save<C: Converter>(converter: &C, link: &mut Context<'_>, offset: usize) -> Option<usize> {
    let format = C::STATE_FORMAT?;
    let total = measure(|state| converter.save(state));
    let next = emit(link, format, total, offset, |state| converter.save(state));
    (next < total).then_some(next)
}

/// Takes the events before a link is there, and the one that it is.
struct Beginning<'m, 'l, C: Converter> {
    core: &'m mut Core<C>,
    link: &'m mut Context<'l>,
    state: &'m mut [u8],
}

impl<'a, C: Converter> TakeEvent<'a> for Beginning<'_, '_, C> {
    type Taken = Result<(), Refusal>;

    #[cfg_attr(target_arch = "wasm32", inline(always))]
    fn take(self, event: Event<'a>) -> Self::Taken {
        let Self { core, link, state } = self;
        match event {
            Event::Settings { first, last, values } => {
                let taken = core.settings(first, last, &values);
                if taken.is_err() {
                    core.next_setting = None;
                }
                taken
            }
            Event::Restore { format, offset, total, bytes } => {
                core.restore(format, offset, total, bytes, state)
            }
            Event::Open { resumed, line, transmit_room, delivery_room } => {
                if !resumed {
                    core.begin()?;
                }
                let Slot::Full(converter) = &mut core.converter else {
                    return core.is_not_open();
                };
                link.set_rooms(transmit_room, delivery_room);
                let heard = if resumed { PartEvent::Resumed } else { PartEvent::LinkUp };
                converter.parts(link, &heard);
                converter.opened(link, &Opening { resumed, line, delivery_room });
                converter.after(link);
                Ok(())
            }
            // By `Opened`.
            _ => Ok(()),
        }
    }
}

#[cfg_attr(target_arch = "wasm32", inline(never))]
fn opened<C: Converter>(
    converter: &mut C,
    link: &mut Context<'_>,
    kind: EventKind,
    reader: &mut Reader<'_>,
    is_saving: bool,
) {
    use EventKind as Kind;
    // Not those that the caller takes: their code is then left out.
    if !matches!(kind, Kind::Settings | Kind::Open | Kind::Restore | Kind::Received | Kind::JobData)
    {
        Event::read(kind, reader, Opened { converter, link, is_saving });
    }
}

/// Gives one event to the converter of a link that is open.
struct Opened<'m, 'l, C: Converter> {
    converter: &'m mut C,
    link: &'m mut Context<'l>,
    is_saving: bool,
}

impl<'a, C: Converter> TakeEvent<'a> for Opened<'_, '_, C> {
    type Taken = ();

    #[cfg_attr(target_arch = "wasm32", inline(always))]
    fn take(self, event: Event<'a>) {
        let Self { converter, link, is_saving } = self;
        if let Some(heard) = heard_by_parts(link, &event) {
            converter.parts(link, &heard);
        }
        match event {
            Event::Close => converter.closed(link),
            Event::LineError { kind, byte, span } => converter.line_error(link, kind, byte, span),
            Event::ModemLines { known, on } => converter.modem_lines(link, known, on),
            Event::LinkDown(reason) => converter.link_down(link, reason),
            Event::LinkUp => converter.link_up(link),
            Event::Timer { id, deadline } => converter.timer(link, id, deadline),
            Event::Mark { mark, state } => converter.mark(link, mark, state),
            Event::TransmitRoom { .. } => converter.transmit_room(link),
            Event::Discarded { bytes } => converter.discarded(link, bytes),
            Event::DeliveryRoom { grown } => {
                link.grow_delivery_room(grown);
                converter.delivery_room(link);
            }
            Event::JobBegin { job, kind, pass, size, fields } => {
                converter.job_begin(link, JobStart { job, kind, pass, size, fields });
            }
            Event::JobEnd { job } => converter.job_end(link, job),
            Event::Pause { job } => converter.pause(link, job),
            Event::Resume { job } => converter.resume(link, job),
            Event::Abort { job } => converter.abort(link, job),
            Event::ForceResume => converter.force_resume(link),
            Event::Answer { request, refused, more, bytes } => {
                converter.answer(link, request, refused.map_or(Ok(bytes), Err), more);
            }
            Event::Continue if !is_saving => converter.more(link),
            // A save is written by the caller; the others are taken by `Core::takes_bytes` and `Beginning`.
            Event::Save
            | Event::Continue
            | Event::Received(_)
            | Event::JobData { .. }
            | Event::Settings { .. }
            | Event::Open { .. }
            | Event::Restore { .. } => {}
        }
    }
}

/// What parts hear of an event. They find the room to transmit as it is now.
#[cfg_attr(target_arch = "wasm32", inline(always))]
fn heard_by_parts<'a>(link: &mut Context<'_>, event: &Event<'a>) -> Option<PartEvent<'a>> {
    Some(match *event {
        Event::Timer { id, .. } => PartEvent::Timer { id },
        Event::Mark { mark, state } => PartEvent::Mark { mark, state },
        Event::TransmitRoom { grown } => {
            link.grow_transmit_room(grown);
            PartEvent::TransmitRoom
        }
        Event::Discarded { bytes } => {
            link.grow_transmit_room(bytes);
            PartEvent::Discarded { bytes }
        }
        Event::JobEnd { .. } => PartEvent::JobEnd,
        Event::Pause { .. } => PartEvent::Paused(true),
        Event::Resume { .. } => PartEvent::Paused(false),
        Event::LinkDown(_) => PartEvent::LinkDown,
        Event::LinkUp => PartEvent::LinkUp,
        _ => return None,
    })
}
