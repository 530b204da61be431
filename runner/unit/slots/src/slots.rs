//! The two slots of a unit: what they hold, and what is written down about it.

mod download;
mod trial;

pub use self::download::Begun;
pub use self::trial::{Boot, PassedOver, Run, Unfit};

use self::download::Download;
use crate::access;
use crate::device::{Device, LARGEST_GRANULE};
use crate::error::{Error, Fault, Refusal, SetUpError};
use crate::layout::{Layout, Place};
use crate::record::{MOST_ATTEMPTS, RECORD, Record, State};
use crate::scan::{Content, Current, scan};
use crate::slot::Slot;
use crate::trust::Trust;

/// Places that are tried for a record.
const PLACES: u8 = 3;

/// How a unit wants it.
///
/// The example of [`Slots`] shows one.
#[derive(Copy, Clone, Debug)]
pub struct Options<'k> {
    /// Whose plug-ins it takes.
    pub trust: Trust<'k>,
    /// Times that a plug-in on trial is run before it counts as failed: 1 to [`MOST_ATTEMPTS`].
    pub attempts: u8,
    /// Erasures of a slot after which no download begins there: what the memory's data sheet promises, or less.
    pub most_erases: u32,
}

/// The two slots of a unit.
///
/// Nothing is written before something is asked for that says so.
///
/// ```
/// use sha2::{Digest, Sha256};
/// use softplug_unit_slots::{Begun, Geometry, Options, Ram, Run, Slots, State, Trust};
///
/// let mut bytes = [0xFF; 64 * 1_024];
/// let ram = Ram::new(&mut bytes, Geometry { size: 65_536, erase: 4_096, granule: 4 }).unwrap();
/// let options = Options { trust: Trust::unsigned_too(&[]), attempts: 3, most_erases: 10_000 };
/// let mut slots = Slots::open(ram, options)?;
/// assert_eq!(slots.boot().run, Run::Nothing);
///
/// let module = [b'w'; 10_000];
/// let begun = slots.begin(10_000, Sha256::digest(module).into(), None)?;
/// let Begun::Fresh { slot } = begun else { panic!("{begun:?}") };
/// for (number, piece) in module.chunks(512).enumerate() {
///     slots.write(number as u32 * 512, piece)?;
/// }
/// slots.finish()?;
/// slots.start_trial()?;
///
/// // At the next start, or whenever the unit is ready for it:
/// let boot = slots.boot();
/// let Run::Trial { module, attempt: 1, of: 3 } = boot.run else { panic!("{boot:?}") };
/// assert_eq!(module.slot, slot);
/// // It does its work:
/// slots.confirm()?;
/// assert_eq!(slots.held(slot).map(|held| held.state), Some(State::Confirmed));
/// # Ok::<(), softplug_unit_slots::Error<softplug_unit_slots::Misuse>>(())
/// ```
#[derive(Debug)]
pub struct Slots<'k, D> {
    pub(crate) device: D,
    pub(crate) layout: Layout,
    pub(crate) options: Options<'k>,
    pub(crate) found: [Result<Current, Content>; 2],
    /// The slot that the last boot gave.
    pub(crate) running: Option<Slot>,
    pub(crate) download: Option<Download>,
    /// Slots that were confirmed by a write that ended, since the unit was opened.
    pub(crate) firm: [bool; 2],
}

/// A module in a slot that is whole and sound.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Module {
    /// Its slot.
    pub slot: Slot,
    /// Where its first byte lies on the device; the others follow.
    pub at: u32,
    /// Bytes.
    pub length: u32,
    /// SHA-256.
    pub digest: [u8; 32],
}

impl<'k, D: Device> Slots<'k, D> {
    /// Looks at what is on a device. Writes nothing.
    ///
    /// # Errors
    /// Options or sizes of the device cannot be, or none of the four headers can be read.
    pub fn open(mut device: D, options: Options<'k>) -> Result<Self, Error<D::Error>> {
        let layout = Layout::of(device.geometry())?;
        let attempts = options.attempts;
        if !(1..=MOST_ATTEMPTS).contains(&attempts) {
            return Err(SetUpError::Attempts { attempts }.into());
        }
        options.trust.must_be_sound()?;
        let mut failed = None;
        let mut is_readable = false;
        for slot in Slot::BOTH {
            for place in Place::BOTH {
                let mut bytes = [0; LARGEST_GRANULE as usize];
                match access::read(&mut device, layout.area(slot, place), &mut bytes) {
                    Ok(()) => is_readable = true,
                    Err(fault) => failed = Some(fault),
                }
            }
        }
        if let Some(fault) = failed
            && !is_readable
        {
            return Err(fault.into());
        }
        let found = Slot::BOTH.map(|slot| scan(&mut device, &layout, slot));
        Ok(Self { device, layout, options, found, running: None, download: None, firm: [false; 2] })
    }

    /// The device.
    pub const fn device(&self) -> &D {
        &self.device
    }

    /// Gives the device back.
    pub fn into_device(self) -> D {
        self.device
    }

    /// Bytes that a module may have.
    pub const fn room(&self) -> u32 {
        self.layout.room
    }

    /// What a slot holds.
    pub fn look(&self, slot: Slot) -> Content {
        match &self.found[slot.index()] {
            Ok(current) => Content::Module(current.held()),
            Err(content) => *content,
        }
    }

    /// The module in a slot, whole or not, if there is one.
    pub fn held(&self, slot: Slot) -> Option<crate::Held> {
        self.current(slot).map(Current::held)
    }

    /// How often a slot was erased for a download. A bound from above: an erasure that was announced and cut short
    /// counts too. Of a slot whose headers are lost, what the other one knows.
    pub fn erases(&self, slot: Slot) -> u32 {
        let own = self.current(slot).map_or(0, Current::erases);
        let others = self.current(slot.other()).map_or(0, |current| current.header.other_erases);
        own.max(others)
    }

    /// Reads bytes of a slot's module. It does not look whether they are sound; [`Slots::boot`] did, for what it gave.
    ///
    /// # Errors
    /// The slot holds no whole module, or no such bytes; or the device cannot read them.
    pub fn read(
        &mut self,
        slot: Slot,
        offset: u32,
        into: &mut [u8],
    ) -> Result<(), Error<D::Error>> {
        let refusal = Refusal::NoSuchBytes { slot };
        let held = self.held(slot).filter(|held| held.state != State::Writing).ok_or(refusal)?;
        let length = u32::try_from(into.len()).map_err(|_| refusal)?;
        if offset.checked_add(length).is_none_or(|end| end > held.length) {
            return Err(refusal.into());
        }
        let at = self.layout.module(slot);
        access::read_pieces(&mut self.device, at, offset, length, |place, bytes| {
            into[place..place + bytes.len()].copy_from_slice(bytes);
        })?;
        Ok(())
    }

    /// Erases the headers of a slot, whatever it holds: for one with another format, or with a trial that cannot be ended.
    /// The count of its erasures is lost but for what the other slot knows.
    ///
    /// # Errors
    /// The slot holds what runs, or what is confirmed and would run; or the device cannot erase.
    pub fn clear(&mut self, slot: Slot) -> Result<(), Error<D::Error>> {
        if self.running == Some(slot) || self.keeper() == Some(slot) {
            return Err(Refusal::InUse { slot }.into());
        }
        self.download = None;
        let erased = access::erase(
            &mut self.device,
            self.layout.area(slot, Place::First),
            2 * self.layout.area,
        );
        self.look_again(slot);
        Ok(erased?)
    }

    pub(crate) const fn current(&self, slot: Slot) -> Option<&Current> {
        match &self.found[slot.index()] {
            Ok(current) => Some(current),
            Err(_) => None,
        }
    }

    pub(crate) fn state(&self, slot: Slot) -> Option<State> {
        self.current(slot).map(Current::state)
    }

    pub(crate) fn look_again(&mut self, slot: Slot) {
        self.found[slot.index()] = scan(&mut self.device, &self.layout, slot);
    }

    pub(crate) fn on_trial(&self) -> Option<Slot> {
        Slot::BOTH.into_iter().find(|slot| matches!(self.state(*slot), Some(State::Trial { .. })))
    }

    /// The slot of the download that began last.
    pub(crate) fn newest(&self) -> Option<Slot> {
        let generation = |slot: Slot| self.current(slot).map(|current| current.header.generation);
        let [a, b] = Slot::BOTH.map(generation);
        let slot = if b > a { Slot::B } else { Slot::A };
        self.current(slot).map(|_| slot)
    }

    /// Slots with a confirmed module, the newest first.
    pub(crate) fn confirmed(&self) -> impl Iterator<Item = Slot> + use<D> {
        let generation = |slot| {
            self.current(slot)
                .filter(|current| current.state() == State::Confirmed)
                .map(|current| current.header.generation)
        };
        let [a, b] = Slot::BOTH.map(generation);
        let slots = if b > a { [(Slot::B, b), (Slot::A, a)] } else { [(Slot::A, a), (Slot::B, b)] };
        slots.into_iter().filter_map(|(slot, generation)| generation.map(|_| slot))
    }

    /// The slot that must not be touched: what runs now, else what would run.
    pub(crate) fn keeper(&mut self) -> Option<Slot> {
        let running = self.running.filter(|slot| self.state(*slot) == Some(State::Confirmed));
        running.into_iter().chain(self.confirmed()).find(|slot| self.inspect(*slot).is_ok())
    }

    /// Writes down what has become of a slot.
    ///
    /// A place that looks free may have been torn, and some memories refuse it then: the next ones are tried too.
    pub(crate) fn append(&mut self, slot: Slot, record: Record) -> Result<(), Fault<D::Error>> {
        let mut result = self.append_once(slot, record);
        let mut tries = 1;
        while let Err(Fault::Failed { .. } | Fault::NotKept { .. }) = result
            && tries < PLACES
        {
            if let Ok(current) = &mut self.found[slot.index()] {
                current.log.next += 1;
            }
            match self.append_once(slot, record) {
                Err(Fault::NoRecordLeft { .. }) => break,
                other => result = other,
            }
            tries += 1;
        }
        if tries > 1 || result.is_err() {
            // What failed may be there all the same, or in part.
            self.look_again(slot);
        }
        result
    }

    fn append_once(&mut self, slot: Slot, record: Record) -> Result<(), Fault<D::Error>> {
        let Ok(current) = &mut self.found[slot.index()] else {
            return Err(Fault::NoRecordLeft { slot });
        };
        let (number, place) = (current.log.next, current.place);
        if current.log.is_full() {
            return Err(Fault::NoRecordLeft { slot });
        }
        let mut bytes = [0xFF; LARGEST_GRANULE as usize];
        bytes[..RECORD].copy_from_slice(&record.write(current.header.generation, number));
        let at = self.layout.record(slot, place, number);
        access::program(&mut self.device, at, &bytes[..self.layout.stride as usize])?;
        current.log.next += 1;
        current.log.take(record);
        self.firm[slot.index()] = record == Record::Confirmed;
        Ok(())
    }
}
