//! Frames over a CAN bus, by the kernel's ISO-TP (ISO 15765-2): each frame is one message.
//!
//! Addresses are those of ISO 15765-2's normal fixed addressing, with 29-bit identifiers: the
//! gateway has F1, which is that of an external tester, and each unit its number. Where the
//! interface is set up for CAN FD, frames of 64 bytes leave; both kinds are taken.

use std::fmt;
use std::fs;
use std::io;
use std::os::fd::AsRawFd;
use std::str::FromStr;

use libc::{EBADMSG, ECOMM, EILSEQ, EMSGSIZE, ENOBUFS, ETIMEDOUT};
use mio::event::Source;
use mio::unix::SourceFd;
use mio::{Interest, Registry, Token};
use socketcan_isotp::{
    ExtendedId, FlowControlOptions, IsoTpOptions, IsoTpSocket, LinkLayerOptions, TxFlags,
};
use thiserror::Error;

use crate::closed::Closed;

/// The gateway's address on a bus.
const GATEWAY: u8 = 0xF1;
/// Units have numbers from 1 to this.
const MOST_UNITS: u8 = 239;
/// Physical addressing, priority 6: target and source follow.
const IDENTIFIER: u32 = 0x18DA_0000;
/// The longest name of an interface, in bytes.
const LONGEST_INTERFACE: usize = 15;
/// An interface that carries CAN FD has this `mtu`, and its frames this many bytes.
const FD: (u8, u8) = (72, 64);
/// Bits around the bytes of a frame, by ISO 11898-1: of a classical one, and of one of CAN FD with the
/// longer of its two checks.
const AROUND: usize = 67;
const FD_AROUND: usize = 81;
/// The kernel says this of a frame that did not get through, or did not come whole: the session
/// sends it again.
const LOST: [i32; 5] = [ECOMM, EILSEQ, EBADMSG, ETIMEDOUT, EMSGSIZE];

/// A unit on a CAN bus: `can0/17`.
///
/// ```
/// use softplug_unit_uplink::CanAddress;
///
/// let address: CanAddress = "can0/17".parse().unwrap();
/// assert_eq!((address.interface(), address.node()), ("can0", 17));
/// assert!("can0/0".parse::<CanAddress>().is_err());
/// ```
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub struct CanAddress {
    interface: String,
    node: u8,
}

/// A text that names no unit on a CAN bus.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Error)]
#[error("a unit on a CAN bus has an interface such as can0 and a number from 1 to {MOST_UNITS}")]
pub struct NoCanAddress;

impl CanAddress {
    /// The unit with a number from 1 to 239 on the bus of a network interface.
    ///
    /// # Errors
    /// It is none.
    pub fn new(interface: &str, node: u8) -> Result<Self, NoCanAddress> {
        let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
        let is_good = (1..=LONGEST_INTERFACE).contains(&interface.len())
            && interface.chars().all(is_plain)
            && !interface.starts_with('.')
            && (1..=MOST_UNITS).contains(&node);
        is_good.then(|| Self { interface: interface.to_owned(), node }).ok_or(NoCanAddress)
    }

    /// The network interface.
    pub fn interface(&self) -> &str {
        &self.interface
    }

    /// The unit's number.
    pub fn node(&self) -> u8 {
        self.node
    }
}

impl FromStr for CanAddress {
    type Err = NoCanAddress;

    fn from_str(text: &str) -> Result<Self, NoCanAddress> {
        let (interface, node) = text.split_once('/').ok_or(NoCanAddress)?;
        Self::new(interface, node.parse().map_err(|_| NoCanAddress)?)
    }
}

impl fmt::Display for CanAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.interface, self.node)
    }
}

/// Which end of an uplink this is.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum CanEnd {
    /// The gateway's.
    Gateway,
    /// The unit's.
    Unit,
}

/// A way between gateway and unit over a CAN bus. Needs the kernel's module `can_isotp`.
///
/// ```no_run
/// use softplug_unit_uplink::{CanAddress, CanEnd, CanUplink};
///
/// let unit = CanAddress::new("can0", 17).unwrap();
/// let mut uplink = CanUplink::open(&unit, CanEnd::Gateway)?;
/// while let Some(frame) = uplink.receive()? {
///     println!("{} bytes", frame.len());
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct CanUplink {
    /// It has room for the longest message.
    socket: Box<IsoTpSocket>,
    came: Vec<u8>,
    /// A frame that the bus has not taken yet.
    leaves: Option<Box<[u8]>>,
    is_fd: bool,
    bits: u64,
}

impl CanUplink {
    /// Opens it. Nobody needs to be at the other end yet.
    ///
    /// # Errors
    /// There is no such interface, or no ISO-TP.
    pub fn open(unit: &CanAddress, end: CanEnd) -> io::Result<Self> {
        let CanAddress { interface, node } = unit;
        let (target, source) = match end {
            CanEnd::Gateway => (*node, GATEWAY),
            CanEnd::Unit => (GATEWAY, *node),
        };
        let is_fd = is_fd(interface);
        let socket = IsoTpSocket::open_with_opts(
            interface,
            identifier(source, target),
            identifier(target, source),
            Some(IsoTpOptions::default()),
            Some(FlowControlOptions::default()),
            is_fd.then(|| LinkLayerOptions::new(FD.0, FD.1, TxFlags::CANFD_BRS)),
        )
        .map_err(|error| match error {
            socketcan_isotp::Error::Lookup { source } => source.into(),
            socketcan_isotp::Error::Io { source } => source,
        })?;
        socket.set_nonblocking(true)?;
        Ok(Self { socket: Box::new(socket), came: Vec::new(), leaves: None, is_fd, bits: 0 })
    }

    /// The next frame that has come; `None`: not before the source is readable again.
    ///
    /// # Errors
    /// The interface is down or gone.
    pub fn receive(&mut self) -> Result<Option<&[u8]>, Closed> {
        loop {
            match self.socket.read() {
                Ok(frame) => {
                    self.came.clear();
                    self.came.extend_from_slice(frame);
                    self.bits += bits_of(frame.len(), self.is_fd);
                    return Ok(Some(&self.came));
                }
                Err(error) if is_lost(&error) => {}
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(None),
                Err(error) => return Err(error.into()),
            }
        }
    }

    /// Bits that went over the bus for all frames that were sent or have come since it was asked
    /// last: CAN frames, ISO-TP's flow control with them, without stuff bits.
    pub fn take_bits(&mut self) -> u64 {
        std::mem::take(&mut self.bits)
    }

    /// Whether another frame would leave soon.
    pub fn has_room(&self) -> bool {
        self.leaves.is_none()
    }

    /// Sends a frame, or keeps it until the one before has left. A third one is lost.
    ///
    /// # Errors
    /// The interface is down or gone.
    pub fn send(&mut self, frame: &[u8]) -> Result<(), Closed> {
        if self.flush()? {
            self.leaves = Some(frame.into());
            self.flush()?;
        }
        Ok(())
    }

    /// Sends what waits. `false`: it still does; again when the source is writable.
    ///
    /// # Errors
    /// The interface is down or gone.
    pub fn flush(&mut self) -> Result<bool, Closed> {
        while let Some(frame) = &self.leaves {
            match self.socket.write(frame) {
                Ok(()) => {
                    self.bits += bits_of(frame.len(), self.is_fd);
                    self.leaves = None;
                }
                Err(error) if is_lost(&error) => self.leaves = None,
                Err(error) if is_for_later(&error) => return Ok(false),
                Err(error) => return Err(error.into()),
            }
        }
        Ok(true)
    }
}

fn identifier(source: u8, target: u8) -> ExtendedId {
    let raw = IDENTIFIER | u32::from(target) << 8 | u32::from(source);
    ExtendedId::new(raw).unwrap_or(ExtendedId::ZERO)
}

fn is_fd(interface: &str) -> bool {
    let mtu = fs::read_to_string(format!("/sys/class/net/{interface}/mtu")).unwrap_or_default();
    mtu.trim().parse() == Ok(FD.0)
}

/// Bits on the bus for a message of so many bytes.
fn bits_of(bytes: usize, is_fd: bool) -> u64 {
    // ISO 11898-1: a frame with a 29-bit identifier, from its start to the space behind it.
    let (around, most) = if is_fd { (FD_AROUND, usize::from(FD.1)) } else { (AROUND, 8) };
    let frame = |bytes: usize| (around + 8 * bytes) as u64;
    // ISO 15765-2: the first byte of a frame says how it goes on; a single one of more than 7
    // bytes and the first of several have two.
    let header = if bytes < 8 { 1 } else { 2 };
    if bytes + header <= most {
        return frame(bytes + header);
    }
    let rest = bytes + 2 - most;
    let (whole, last) = (rest / (most - 1), rest % (most - 1));
    let flow_control = frame(3);
    let tail = if last > 0 { frame(last + 1) } else { 0 };
    frame(most) + flow_control + whole as u64 * frame(most) + tail
}

fn is_lost(error: &io::Error) -> bool {
    error.raw_os_error().is_some_and(|code| LOST.contains(&code))
}

fn is_for_later(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted)
        || error.raw_os_error() == Some(ENOBUFS)
}

/// Edge-triggered: after it was told readable, [`CanUplink::receive`] until `None`.
impl Source for CanUplink {
    fn register(
        &mut self,
        registry: &Registry,
        token: Token,
        interests: Interest,
    ) -> io::Result<()> {
        SourceFd(&self.socket.as_raw_fd()).register(registry, token, interests)
    }

    fn reregister(
        &mut self,
        registry: &Registry,
        token: Token,
        interests: Interest,
    ) -> io::Result<()> {
        SourceFd(&self.socket.as_raw_fd()).reregister(registry, token, interests)
    }

    fn deregister(&mut self, registry: &Registry) -> io::Result<()> {
        SourceFd(&self.socket.as_raw_fd()).deregister(registry)
    }
}

impl fmt::Debug for CanUplink {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("CanUplink").field("has_room", &self.has_room()).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand from the frames' layout.
    #[test]
    fn the_bits_of_a_message_are_those_of_its_frames() {
        // One frame of 1 + 7 bytes; 2 + 6, flow control, 1 + 2; 2 + 6, flow control, three of 1 + 7.
        assert_eq!(bits_of(7, false), 67 + 64);
        assert_eq!(bits_of(8, false), (67 + 64) + (67 + 24) + (67 + 24));
        assert_eq!(bits_of(27, false), (67 + 64) + (67 + 24) + 3 * (67 + 64));
        // One frame of 2 + 62 bytes; 2 + 62, flow control, 1 + 1.
        assert_eq!(bits_of(62, true), 81 + 512);
        assert_eq!(bits_of(63, true), (81 + 512) + (81 + 24) + (81 + 16));
    }
}
