//! A module comes into the slot that is not needed.

use super::Slots;
use super::trial::Unfit;
use crate::access;
use crate::device::{Device, LARGEST_GRANULE};
use crate::error::{Error, Fault, Refusal, SetUpError};
use crate::header::Header;
use crate::layout::{HEADER, Place};
use crate::record::{Failure, Log, Record, State};
use crate::scan::{Content, Current};
use crate::signature::Signature;
use crate::slot::Slot;

/// How a download begins.
///
/// The example of [`Slots`] shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Begun {
    /// The slot is erased and waits for the first byte.
    Fresh {
        /// It.
        slot: Slot,
    },
    /// This download is under way already; nothing was written.
    UnderWay {
        /// Its slot.
        slot: Slot,
        /// Bytes that have come.
        received: u32,
    },
    /// This module is there already, whole and sound; nothing was written.
    AlreadyThere {
        /// Its slot.
        slot: Slot,
        /// What has become of it.
        state: State,
    },
}

#[derive(Debug)]
pub(crate) struct Download {
    slot: Slot,
    /// Bytes that have come.
    received: u32,
    /// Those behind the last whole granule, which are not on the device yet.
    rest: [u8; LARGEST_GRANULE as usize],
}

impl<D: Device> Slots<'_, D> {
    /// Begins to take a module with this length in bytes, SHA-256 and signature. What is on its way into a slot is given
    /// up. The slot of what runs, or would run, is not touched.
    ///
    /// The signature is looked at before anything is written. Erases up to the module's length, which takes
    /// as long as the device takes for that.
    ///
    /// # Errors
    /// - [`Error::Refused`]: length or signature cannot be taken, or a trial is under way.
    /// - [`Error::SetUp`]: the slot was written in another format.
    /// - [`Error::Device`]: the slot is worn, or the device failed.
    pub fn begin(
        &mut self,
        length: u32,
        digest: [u8; 32],
        signature: Option<Signature>,
    ) -> Result<Begun, Error<D::Error>> {
        let room = self.room();
        if !(1..=room).contains(&length) {
            return Err(Refusal::Length { length, room }.into());
        }
        self.options.trust.check(length, &digest, signature.as_ref())?;
        if let Some(begun) = self.known(length, digest, signature) {
            return Ok(begun);
        }
        if let Some(slot) = self.on_trial() {
            return Err(Refusal::TrialUnderWay { slot }.into());
        }
        let keeper = self.keeper();
        let slot = keeper.map_or_else(|| self.least_needed(), Slot::other);
        let (place, header) = self.next_header(slot, length, digest, signature)?;
        self.download = None;
        if let Some(keeper) = keeper {
            self.make_firm(keeper)?;
        }
        // Counts the erasure, if there is something to count it in.
        match self.append(slot, Record::Retired) {
            Ok(()) | Err(Fault::NoRecordLeft { .. }) => {}
            Err(fault) => return Err(fault.into()),
        }
        let prepared = self.prepare(slot, place, &header);
        if prepared.is_err() {
            self.look_again(slot);
        }
        prepared?;
        self.found[slot.index()] = Ok(Current { place, header, log: Log::new() });
        self.download =
            Some(Download { slot, received: 0, rest: [0xFF; LARGEST_GRANULE as usize] });
        Ok(Begun::Fresh { slot })
    }

    /// Takes the next bytes of the module, which begin at byte `offset` of it. Bytes that came before are compared and
    /// count as taken. Gives how many bytes have come.
    ///
    /// # Errors
    /// - [`Error::Refused`]: no download is under way, or the piece does not fit; the download goes on.
    /// - [`Error::Device`]: the device failed; the download has ended.
    pub fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<u32, Error<D::Error>> {
        let download = self.download.as_ref().ok_or(Refusal::NoDownload)?;
        let (slot, received) = (download.slot, download.received);
        let length = self.current(slot).ok_or(Refusal::NoDownload)?.header.length;
        if offset > received {
            return Err(Refusal::OutOfOrder { expected: received, offset }.into());
        }
        let count = u32::try_from(bytes.len()).map_err(|_| Refusal::TooMuch { length })?;
        if count > length - offset {
            return Err(Refusal::TooMuch { length }.into());
        }
        let (old, new) = bytes.split_at((received - offset).min(count) as usize);
        self.compare(offset, old)?;
        let taken = self.take(new);
        if taken.is_err() {
            self.download = None;
        }
        taken
    }

    /// Ends the download: reads the module back and looks at digest and signature. Gives its slot. Whoever missed the answer
    /// begins again, and is told that it is there already.
    ///
    /// # Errors
    /// - [`Error::Refused`]: bytes are missing, and the download goes on; or the module is not the one that was said, and
    ///   the slot has failed.
    /// - [`Error::Device`]: the device failed; the download has ended.
    pub fn finish(&mut self) -> Result<Slot, Error<D::Error>> {
        let download = self.download.as_ref().ok_or(Refusal::NoDownload)?;
        let (slot, received) = (download.slot, download.received);
        let length = self.current(slot).ok_or(Refusal::NoDownload)?.header.length;
        if received < length {
            return Err(Refusal::Incomplete { received, length }.into());
        }
        let rest = download.rest;
        self.download = None;
        let granule = self.layout.geometry.granule;
        let behind = received % granule;
        if behind != 0 {
            let at = self.layout.module(slot) + received - behind;
            access::program(&mut self.device, at, &rest[..granule as usize])?;
        }
        match self.inspect(slot) {
            Ok(()) => {}
            Err(Unfit::Digest) => {
                self.append(slot, Record::Failed(Failure::Digest))?;
                return Err(Refusal::Digest.into());
            }
            Err(Unfit::Refused(refusal)) => return Err(refusal.into()),
            Err(Unfit::Unreadable) => {
                return Err(Fault::NotKept { at: self.layout.module(slot) }.into());
            }
        }
        self.append(slot, Record::Written)?;
        Ok(slot)
    }

    /// Bytes that have come of the download that is under way.
    pub fn received(&self) -> Option<u32> {
        self.download.as_ref().map(|download| download.received)
    }

    /// What there is of this module already.
    fn known(
        &mut self,
        length: u32,
        digest: [u8; 32],
        signature: Option<Signature>,
    ) -> Option<Begun> {
        if let Some(Download { slot, received, .. }) = self.download
            && let Some(Header { length: l, digest: d, signature: s, .. }) =
                self.current(slot).map(|current| current.header)
            && (l, d, s) == (length, digest, signature)
        {
            return Some(Begun::UnderWay { slot, received });
        }
        Slot::BOTH.into_iter().find_map(|slot| {
            let held = self.held(slot)?;
            let is_kept = match held.state {
                State::Trial { .. } | State::Confirmed => true,
                State::Written => self.newest() == Some(slot),
                State::Writing | State::Failed(_) => false,
            };
            let is_it = is_kept && (held.length, held.digest) == (length, digest);
            (is_it && self.inspect(slot).is_ok())
                .then_some(Begun::AlreadyThere { slot, state: held.state })
        })
    }

    /// The slot for a download if neither can be run.
    fn least_needed(&self) -> Slot {
        let rank = |slot: Slot| {
            let kind = match self.found[slot.index()] {
                Ok(current) if current.state() == State::Confirmed => 2,
                Err(Content::OtherVersion(_) | Content::OtherGeometry) => 3,
                Err(Content::Unreadable) => 1,
                _ => 0,
            };
            (kind, self.erases(slot))
        };
        if rank(Slot::B) < rank(Slot::A) { Slot::B } else { Slot::A }
    }

    /// The header for a download into a slot, and where it goes.
    fn next_header(
        &self,
        slot: Slot,
        length: u32,
        digest: [u8; 32],
        signature: Option<Signature>,
    ) -> Result<(Place, Header), Error<D::Error>> {
        match self.found[slot.index()] {
            Err(Content::OtherVersion(found)) => {
                return Err(SetUpError::OtherVersion { slot, found }.into());
            }
            Err(Content::OtherGeometry) => return Err(SetUpError::OtherGeometry { slot }.into()),
            _ => {}
        }
        let (erases, most) = (self.erases(slot), self.options.most_erases);
        if erases >= most {
            return Err(Fault::Worn { slot, erases, most }.into());
        }
        let newest = self.newest().and_then(|slot| self.current(slot));
        let generation = newest.map_or(0, |current| current.header.generation);
        let header = Header {
            generation: generation.checked_add(1).ok_or(Fault::LastGeneration)?,
            erases: erases + 1,
            other_erases: self.erases(slot.other()),
            length,
            digest,
            signature,
        };
        let place = self.current(slot).map_or(Place::First, |current| current.place.other());
        Ok((place, header))
    }

    /// Of a record that power cut short some bits may be read now and not later, and this confirmation or what
    /// revoked it may be one. Before the other module is lost, it is written by a write that ends.
    pub(crate) fn make_firm(&mut self, slot: Slot) -> Result<(), Fault<D::Error>> {
        if self.firm[slot.index()] {
            return Ok(());
        }
        match self.append(slot, Record::Confirmed) {
            Err(Fault::NoRecordLeft { .. }) => Ok(()),
            result => result,
        }
    }

    /// The new header first: from then on the slot holds nothing that could be run.
    fn prepare(
        &mut self,
        slot: Slot,
        place: Place,
        header: &Header,
    ) -> Result<(), Fault<D::Error>> {
        let at = self.layout.area(slot, place);
        // Also what looks erased: it may be so by halves.
        access::erase(&mut self.device, at, self.layout.area)?;
        let mut bytes = [0xFF; LARGEST_GRANULE as usize];
        bytes[..HEADER].copy_from_slice(&header.write(slot, &self.layout));
        access::program(&mut self.device, at, &bytes[..self.layout.header as usize])?;
        let blocks = self.layout.blocks(header.length);
        access::erase(&mut self.device, self.layout.module(slot), blocks)
    }

    /// Compares bytes that came before with those that come again.
    fn compare(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error<D::Error>> {
        let Some(Download { slot, received, rest }) = &self.download else { return Ok(()) };
        let behind = received % self.layout.geometry.granule;
        // Where the bytes begin that are not on the device yet.
        let kept = received - behind;
        let mut different = None;
        let mut note = |place: usize, found: &[u8]| {
            let pairs = found.iter().zip(&bytes[place..]);
            if let Some(first) = pairs.clone().position(|(found, sent)| found != sent) {
                different.get_or_insert(offset + (place + first) as u32);
            }
        };
        let on_device = kept.saturating_sub(offset).min(bytes.len() as u32);
        let at = self.layout.module(*slot);
        access::read_pieces(&mut self.device, at, offset, on_device, &mut note)?;
        if (on_device as usize) < bytes.len() {
            let from = (offset + on_device - kept) as usize;
            let pending = &rest[from..behind as usize];
            note(on_device as usize, pending);
        }
        different.map_or(Ok(()), |offset| Err(Refusal::Different { offset }.into()))
    }

    /// Takes new bytes: whole granules go onto the device, the rest waits.
    fn take(&mut self, mut bytes: &[u8]) -> Result<u32, Error<D::Error>> {
        let download = self.download.as_mut().ok_or(Refusal::NoDownload)?;
        let granule = self.layout.geometry.granule as usize;
        let module = self.layout.module(download.slot);
        let behind = download.received as usize % granule;
        if behind != 0 {
            let (first, others) = bytes.split_at(bytes.len().min(granule - behind));
            download.rest[behind..behind + first.len()].copy_from_slice(first);
            bytes = others;
            if behind + first.len() == granule {
                let at = module + download.received - behind as u32;
                access::program(&mut self.device, at, &download.rest[..granule])?;
                download.rest.fill(0xFF);
            }
            download.received += first.len() as u32;
        }
        let (whole, others) = bytes.split_at(bytes.len() / granule * granule);
        access::program(&mut self.device, module + download.received, whole)?;
        download.received += whole.len() as u32;
        download.rest[..others.len()].copy_from_slice(others);
        download.received += others.len() as u32;
        Ok(download.received)
    }
}
