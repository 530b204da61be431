//! Captures, pcapng and classic pcap, as far as they hold packets: of both byte
//! orders, with every resolution of time. Blocks of other kinds are skipped.

use super::Source;
use super::error::{ImportError, ImportFault, Place};
use super::note::{Left, Notes};
use super::text::LATEST;
use crate::limits::INTERFACES;

pub(super) const SECTION: u32 = 0x0A0D_0D0A;
pub(super) const INTERFACE: u32 = 1;
pub(super) const ENHANCED_PACKET: u32 = 6;
pub(super) const BYTE_ORDER: u32 = 0x1A2B_3C4D;
pub(super) const OPTION_FLAGS: u16 = 2;
pub(super) const OPTION_RESOLUTION: u16 = 9;
/// An obsolete block that old tools still write.
const PACKET: u32 = 2;
const SIMPLE_PACKET: u32 = 3;
const OPTION_OFFSET: u16 = 14;

/// A packet.
pub(super) struct Packet<'a> {
    /// In µs since 1970.
    pub(super) at: i64,
    /// The LINKTYPE of its interface.
    pub(super) link: u32,
    /// Which interface, counted over the whole file.
    pub(super) interface: usize,
    /// Whether it was received, if it says so.
    pub(super) received: Option<bool>,
    pub(super) bytes: &'a [u8],
    /// From 1.
    pub(super) number: u32,
    /// Where its bytes begin in the file.
    pub(super) offset: usize,
}

/// Gives each packet to `take`.
pub(super) fn packets<'a>(
    source: Source<'a>,
    notes: &mut Notes,
    take: impl FnMut(Packet<'a>, &mut Notes) -> Result<(), ImportError>,
) -> Result<(), ImportError> {
    let mut reader = Reader { file: source.name, bytes: source.bytes, at: 0, big: false };
    let magic = source.bytes.first_chunk::<4>().map(|bytes| u32::from_le_bytes(*bytes));
    let (big, parts) = match magic {
        Some(SECTION) => return sections(reader, notes, take),
        Some(0xA1B2_C3D4) => (false, 1_000_000),
        Some(0xA1B2_3C4D) => (false, 1_000_000_000),
        Some(0xD4C3_B2A1) => (true, 1_000_000),
        Some(0x4D3C_B2A1) => (true, 1_000_000_000),
        _ => return Err(reader.fault(ImportFault::NotCapture)),
    };
    reader.big = big;
    classic(reader, parts, notes, take)
}

/// A file of classic pcap: a header, then records.
fn classic<'a>(
    mut file: Reader<'a>,
    parts: u32,
    notes: &mut Notes,
    mut take: impl FnMut(Packet<'a>, &mut Notes) -> Result<(), ImportError>,
) -> Result<(), ImportError> {
    const HEADER: &str = "the header of the capture";
    file.take(20, HEADER)?;
    // The upper bits hold the length of a check sum behind each packet.
    let link = file.u32(HEADER)? & 0x03FF_FFFF;
    let mut number = 0;
    while !file.is_at_end() {
        const RECORD: &str = "a packet";
        number += 1;
        let (seconds, fraction) = (file.u32(RECORD)?, file.u32(RECORD)?);
        let (held, length) = (file.u32(RECORD)?, file.u32(RECORD)?);
        let offset = file.at;
        let bytes = file.take(held as usize, RECORD)?;
        if length > held {
            notes.add(Left::CutPackets, number);
        }
        let micros = u64::from(fraction) * 1_000_000;
        let micros = (micros + u64::from(parts) / 2) / u64::from(parts);
        let at = i64::from(seconds) * 1_000_000 + micros as i64;
        take(Packet { at, link, interface: 0, received: None, bytes, number, offset }, notes)?;
    }
    Ok(())
}

/// An interface as its block describes it.
struct Interface {
    link: u32,
    /// Ticks of its clock in a second.
    ticks: u128,
    /// Seconds that are added.
    offset: i64,
}

impl Interface {
    /// A time of its clock in µs.
    fn micros(&self, ticks: u64) -> Option<i64> {
        let micros = (u128::from(ticks) * 1_000_000 + self.ticks / 2) / self.ticks;
        let micros = i128::try_from(micros).ok()? + i128::from(self.offset) * 1_000_000;
        i64::try_from(micros).ok().filter(|micros| micros.unsigned_abs() <= LATEST as u64)
    }
}

/// A file of pcapng: blocks, each with its type and its length at both ends.
fn sections<'a>(
    mut file: Reader<'a>,
    notes: &mut Notes,
    mut take: impl FnMut(Packet<'a>, &mut Notes) -> Result<(), ImportError>,
) -> Result<(), ImportError> {
    // Interfaces of the section, and how many there were before it.
    let mut interfaces: Vec<Interface> = Vec::new();
    let mut before = 0;
    let mut number = 0;
    while !file.is_at_end() {
        const BLOCK: &str = "a block";
        let begin = file;
        let kind = file.u32(BLOCK)?;
        if kind == SECTION {
            // Its length is in the byte order that only now is told.
            let mut ahead = file;
            ahead.take(4, BLOCK)?;
            ahead.big = false;
            file.big = match ahead.u32(BLOCK)? {
                BYTE_ORDER => false,
                order if order.swap_bytes() == BYTE_ORDER => true,
                _ => return Err(begin.fault(ImportFault::NotCapture)),
            };
            before += interfaces.len();
            interfaces.clear();
        }
        let length = file.u32(BLOCK)?;
        let impossible = ImportFault::Length { what: BLOCK, length: u64::from(length) };
        if length < 12 || length % 4 != 0 {
            return Err(begin.fault(impossible));
        }
        let mut block = Reader { bytes: &file.bytes[..file.at], ..file };
        file.take(length as usize - 12, BLOCK)?;
        block.bytes = &file.bytes[..file.at];
        if file.u32(BLOCK)? != length {
            return Err(begin.fault(impossible));
        }
        match kind {
            INTERFACE => {
                if before + interfaces.len() == INTERFACES {
                    return Err(begin.fault(ImportFault::TooManyInterfaces));
                }
                interfaces.push(interface(block)?);
            }
            ENHANCED_PACKET | PACKET => {
                number += 1;
                let packet = packet(block, kind, &interfaces, before, number, notes)?;
                take(packet, notes)?;
            }
            SIMPLE_PACKET => {
                number += 1;
                notes.add(Left::TimelessPackets, number);
            }
            _ => {}
        }
    }
    Ok(())
}

fn interface(mut block: Reader<'_>) -> Result<Interface, ImportError> {
    const WHAT: &str = "the description of an interface";
    let link = u32::from(block.u16(WHAT)?);
    block.take(6, WHAT)?;
    let mut interface = Interface { link, ticks: 1_000_000, offset: 0 };
    while let Some((option, mut value)) = block.option(WHAT)? {
        match option {
            OPTION_RESOLUTION => {
                let here = value;
                let resolution = value.take(1, WHAT)?[0];
                let exponent = u32::from(resolution & 0x7F);
                let base: u128 = if resolution & 0x80 == 0 { 10 } else { 2 };
                // The product with 64 bits of time and with µs must have room.
                interface.ticks = base
                    .checked_pow(exponent)
                    .filter(|ticks| *ticks <= u128::from(u64::MAX))
                    .ok_or_else(|| here.fault(ImportFault::Resolution(resolution)))?;
            }
            OPTION_OFFSET => interface.offset = value.u64(WHAT)? as i64,
            _ => {}
        }
    }
    Ok(interface)
}

fn packet<'a>(
    mut block: Reader<'a>,
    kind: u32,
    interfaces: &[Interface],
    before: usize,
    number: u32,
    notes: &mut Notes,
) -> Result<Packet<'a>, ImportError> {
    const WHAT: &str = "a packet";
    let begin = block;
    let index = if kind == PACKET {
        let index = u32::from(block.u16(WHAT)?);
        block.take(2, WHAT)?;
        index
    } else {
        block.u32(WHAT)?
    };
    let Some(interface) = interfaces.get(index as usize) else {
        return Err(begin.fault(ImportFault::NoInterface(index)));
    };
    let time = block;
    let (high, low) = (block.u32(WHAT)?, block.u32(WHAT)?);
    let at = interface
        .micros(u64::from(high) << 32 | u64::from(low))
        .ok_or_else(|| time.fault(ImportFault::Time))?;
    let (held, length) = (block.u32(WHAT)?, block.u32(WHAT)?);
    let offset = block.at;
    let bytes = block.take(held as usize, WHAT)?;
    block.align();
    if length > held {
        notes.add(Left::CutPackets, number);
    }
    let mut received = None;
    while let Some((option, mut value)) = block.option(WHAT)? {
        if option == OPTION_FLAGS {
            received = match value.u32(WHAT)? & 3 {
                1 => Some(true),
                2 => Some(false),
                _ => None,
            };
        }
    }
    let interface_number = before + index as usize;
    let link = interface.link;
    Ok(Packet { at, link, interface: interface_number, received, bytes, number, offset })
}

/// Bytes and how far they are read.
#[derive(Copy, Clone)]
pub(super) struct Reader<'a> {
    file: &'a str,
    /// From the start of the file, to the end of what may be read.
    bytes: &'a [u8],
    at: usize,
    /// Whether numbers have their highest byte first.
    big: bool,
}

impl<'a> Reader<'a> {
    fn is_at_end(&self) -> bool {
        self.at == self.bytes.len()
    }

    fn fault(&self, fault: ImportFault) -> ImportError {
        ImportError { file: self.file.to_owned(), place: Place::Byte(self.at), fault }
    }

    fn take(&mut self, count: usize, what: &'static str) -> Result<&'a [u8], ImportError> {
        let end = self.at.checked_add(count).filter(|end| *end <= self.bytes.len());
        let Some(end) = end else { return Err(self.fault(ImportFault::CutShort(what))) };
        let taken = &self.bytes[self.at..end];
        self.at = end;
        Ok(taken)
    }

    /// Skips what fills up to four bytes.
    fn align(&mut self) {
        self.at = self.at.next_multiple_of(4).min(self.bytes.len());
    }

    fn u16(&mut self, what: &'static str) -> Result<u16, ImportError> {
        let bytes = self.take(2, what)?.try_into().expect("two bytes were taken");
        Ok(if self.big { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) })
    }

    fn u32(&mut self, what: &'static str) -> Result<u32, ImportError> {
        let bytes = self.take(4, what)?.try_into().expect("four bytes were taken");
        Ok(if self.big { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
    }

    fn u64(&mut self, what: &'static str) -> Result<u64, ImportError> {
        let bytes = self.take(8, what)?.try_into().expect("eight bytes were taken");
        Ok(if self.big { u64::from_be_bytes(bytes) } else { u64::from_le_bytes(bytes) })
    }

    /// The next option: its code and a reader of its value. The end of the block ends
    /// the options too.
    fn option(&mut self, what: &'static str) -> Result<Option<(u16, Self)>, ImportError> {
        if self.is_at_end() {
            return Ok(None);
        }
        let (code, length) = (self.u16(what)?, self.u16(what)?);
        if code == 0 {
            return Ok(None);
        }
        let mut value = *self;
        self.take(usize::from(length), what)?;
        value.bytes = &self.bytes[..self.at];
        self.align();
        Ok(Some((code, value)))
    }
}
