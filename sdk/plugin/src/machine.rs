//! From encoded events to a converter's methods and back to encoded actions.

use crate::context::{Context, Rooms};
use crate::state::{StateReader, emit, measure};
use crate::{Converter, JobStart, Opening, PartEvent, SettingSet, StateError};
use softplug_abi::limits::STATE_BYTES;
use softplug_abi::wire::copy;
use softplug_abi::{Event, EventKind, Micros, Refusal, TakeEvent};

const RECEIVED: i32 = EventKind::Received as i32;
const JOB_DATA: i32 = EventKind::JobData as i32;

/// What a step gave: length of the output and whether more is to come, or why
/// the event was not taken. Behind that stands [`Machine::wrong`].
pub(crate) type Stepped = Result<(usize, bool), (Refusal, &'static str)>;

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

    /// Why a state was refused; it follows the text.
    pub(crate) fn wrong(&self) -> Option<StateError> {
        self.core.wrong
    }

    /// One event. `code` and `payload` are what the host gave; `state` gathers
    /// the pieces of a state to restore.
    ///
    /// Most events carry bytes: these go straight to the converter, past the code that takes
    /// the others apart and the stack that it needs.
    #[inline]
    pub(crate) fn step(
        &mut self,
        code: i32,
        payload: &[u8],
        now: Micros,
        output: &mut [u8],
        state: &mut [u8],
    ) -> Stepped {
        if let Slot::Full(converter) = &mut self.core.converter {
            if code == RECEIVED && !payload.is_empty() {
                self.core.saving = None;
                let mut link = Context::new(output, now, &mut self.rooms);
                converter.received(&mut link, payload);
                converter.after(&mut link);
                return Ok(link.finish());
            }
            if code == JOB_DATA
                && let Some((job, bytes)) = payload.split_first_chunk()
                && *job != [0; 4]
                && !bytes.is_empty()
            {
                self.core.saving = None;
                let mut link = Context::new(output, now, &mut self.rooms);
                converter.parts(&mut link, &PartEvent::JobData(bytes));
                converter.job_data(&mut link, u32::from_le_bytes(*job), bytes);
                converter.after(&mut link);
                return Ok(link.finish());
            }
        }
        self.step_any(code, payload, now, output, state)
    }

    /// Any event.
    #[cfg_attr(target_arch = "wasm32", inline(never))]
    fn step_any(
        &mut self,
        code: i32,
        payload: &[u8],
        now: Micros,
        output: &mut [u8],
        state: &mut [u8],
    ) -> Stepped {
        let kind = u16::try_from(code).ok().and_then(EventKind::from_code);
        let kind = kind.ok_or((Refusal::UnknownEvent, ""))?;
        let core = &mut self.core;
        if kind != EventKind::Continue {
            core.saving = None;
        }
        let mut link = Context::new(output, now, &mut self.rooms);
        let taker = Step { core, link: &mut link, state };
        let taken = Event::decode_for(kind, payload, taker);
        taken.map_err(|_| (Refusal::MalformedEvent, ""))??;
        if let Some(offset) = core.saving
            && let Slot::Full(converter) = &core.converter
        {
            let more = save(converter, &mut link, offset);
            core.saving = more;
            let (length, _) = link.finish();
            return Ok((length, more.is_some()));
        }
        Ok(link.finish())
    }
}

/// Settings and converter.
#[derive(Debug)]
struct Core<C: Converter> {
    converter: Slot<C>,
    settings: Slot<C::Settings>,
    next_setting: u16,
    /// Where the next piece of a save begins.
    saving: Option<usize>,
    restored_length: usize,
    /// Why a state was refused.
    wrong: Option<StateError>,
}

impl<C: Converter> Core<C> {
    const fn new() -> Self {
        Self {
            converter: Slot::Empty,
            settings: Slot::Empty,
            next_setting: 0,
            saving: None,
            restored_length: 0,
            wrong: None,
        }
    }

    fn settings(
        &mut self,
        first: bool,
        last: bool,
        values: softplug_abi::Values<'_>,
    ) -> Result<(), (Refusal, &'static str)> {
        if first {
            self.settings = Slot::Full(C::Settings::unset());
            self.next_setting = 0;
        }
        let Slot::Full(settings) = &mut self.settings else {
            return Err((Refusal::MalformedEvent, "the first settings are missing"));
        };
        for value in values.raw() {
            let value = value.map_err(|_| (Refusal::MalformedEvent, ""))?;
            let index = value.index;
            if index != self.next_setting || !settings.set(index, &value) {
                return Err((Refusal::Settings, "a setting is of another type or order"));
            }
            self.next_setting += 1;
        }
        if !last {
            return Ok(());
        }
        if self.next_setting != C::Settings::COUNT {
            return Err((Refusal::Settings, "a setting has no value"));
        }
        C::check_settings(settings).map_err(|text| (Refusal::Settings, text))
    }

    /// Makes a converter with the settings that were given, in its place: the stack
    /// of a plug-in does not hold several of them.
    #[inline(never)]
    fn begin(&mut self) -> Result<&mut C, (Refusal, &'static str)> {
        let settings = match &self.settings {
            Slot::Full(settings) if self.next_setting == C::Settings::COUNT => *settings,
            Slot::Empty if C::Settings::COUNT == 0 => C::Settings::unset(),
            _ => return Err((Refusal::MalformedEvent, "open came before the settings")),
        };
        self.converter = Slot::Full(C::new(settings));
        match &mut self.converter {
            Slot::Full(converter) => Ok(converter),
            Slot::Empty => unreachable!(),
        }
    }

    fn restore(
        &mut self,
        format: u16,
        offset: u32,
        total: u32,
        bytes: &[u8],
        state: &mut [u8],
    ) -> Result<(), (Refusal, &'static str)> {
        let refused = |text| Err((Refusal::State, text));
        if offset == 0 {
            self.restored_length = 0;
        }
        if offset as usize != self.restored_length || total > STATE_BYTES {
            return refused("a piece of the state is missing");
        }
        let end = self.restored_length + bytes.len();
        let Some(place) = state.get_mut(self.restored_length..end) else {
            return refused("the state is too long");
        };
        copy(place, bytes);
        self.restored_length = end;
        if end < total as usize {
            return Ok(());
        }
        let converter = self.begin()?;
        let mut reader = StateReader::new(format, state.get(..end).unwrap_or_default());
        let taken = converter.restore(format, &mut reader).and_then(|()| reader.end());
        if let Err(error) = taken {
            self.converter = Slot::Empty;
            self.wrong = Some(error);
            return refused(StateError::TEXT);
        }
        Ok(())
    }
}

/// Writes pieces from `offset` on; returns where the next ones begin.
fn save<C: Converter>(converter: &C, link: &mut Context<'_>, offset: usize) -> Option<usize> {
    let format = C::STATE_FORMAT?;
    let total = measure(|state| converter.save(state));
    let next = emit(link, format, total, offset, |state| converter.save(state));
    (next < total).then_some(next)
}

/// Gives one event to the converter.
struct Step<'m, 'l, C: Converter> {
    core: &'m mut Core<C>,
    link: &'m mut Context<'l>,
    state: &'m mut [u8],
}

impl<'a, C: Converter> TakeEvent<'a> for Step<'_, '_, C> {
    type Taken = Result<(), (Refusal, &'static str)>;

    #[cfg_attr(target_arch = "wasm32", inline(always))]
    fn take(self, event: Event<'a>) -> Self::Taken {
        let Self { core, link, state } = self;
        match event {
            Event::Settings { first, last, values } => {
                let taken = core.settings(first, last, values);
                if taken.is_err() {
                    core.settings = Slot::Empty;
                }
                return taken;
            }
            Event::Restore { format, offset, total, bytes } => {
                return core.restore(format, offset, total, bytes, state);
            }
            Event::Open { resumed: false, .. } => _ = core.begin()?,
            _ => {}
        }
        let Slot::Full(converter) = &mut core.converter else {
            return Err((Refusal::MalformedEvent, "the link is not open"));
        };
        if let Some(heard) = heard_by_parts(link, &event) {
            converter.parts(link, &heard);
        }
        match event {
            Event::Open { resumed, line, delivery_room, .. } => {
                converter.opened(link, &Opening { resumed, line, delivery_room });
            }
            Event::Close => {
                converter.closed(link);
                core.converter = Slot::Empty;
                return Ok(());
            }
            Event::LineError { kind, byte, span } => converter.line_error(link, kind, byte, span),
            Event::ModemLines { known, on } => converter.modem_lines(link, known, on),
            Event::LinkDown(reason) => converter.link_down(link, reason),
            Event::LinkUp => converter.link_up(link),
            Event::Timer { id, deadline } => {
                converter.timer(link, id, deadline);
            }
            Event::Mark { mark, state } => {
                converter.mark(link, mark, state);
            }
            Event::TransmitRoom { .. } => {
                converter.transmit_room(link);
            }
            Event::Discarded { bytes } => {
                converter.discarded(link, bytes);
            }
            Event::DeliveryRoom { grown } => {
                link.grow_delivery_room(grown);
                converter.delivery_room(link);
            }
            Event::JobBegin { job, kind, pass, size, fields } => {
                converter.job_begin(link, JobStart { job, kind, pass, size, fields });
            }
            Event::JobEnd { job } => {
                converter.job_end(link, job);
            }
            Event::Pause { job } => {
                converter.pause(link, job);
            }
            Event::Resume { job } => {
                converter.resume(link, job);
            }
            Event::Abort { job } => converter.abort(link, job),
            Event::ForceResume => converter.force_resume(link),
            Event::Answer { request, refused, more, bytes } => {
                converter.answer(link, request, refused.map_or(Ok(bytes), Err), more);
            }
            Event::Save => {
                core.saving = Some(0);
                return Ok(());
            }
            // Of a save, if one is under way: the caller writes the rest.
            Event::Continue if core.saving.is_some() => return Ok(()),
            Event::Continue => converter.more(link),
            // The first two above; the others by `Machine::step`, if there is a converter.
            Event::Settings { .. }
            | Event::Restore { .. }
            | Event::Received(_)
            | Event::JobData { .. } => {}
        }
        converter.after(link);
        Ok(())
    }
}

/// What parts hear of an event. They find the room to transmit as it is now.
#[cfg_attr(target_arch = "wasm32", inline(always))]
fn heard_by_parts<'a>(link: &mut Context<'_>, event: &Event<'a>) -> Option<PartEvent<'a>> {
    Some(match *event {
        Event::Open { resumed, transmit_room, delivery_room, .. } => {
            link.set_rooms(transmit_room, delivery_room);
            if resumed { PartEvent::Resumed } else { PartEvent::LinkUp }
        }
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
