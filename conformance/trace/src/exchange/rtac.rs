//! The header of LINKTYPE_RTAC_SERIAL: what happened, and the modem lines then.
//! <https://www.tcpdump.org/linktypes/LINKTYPE_RTAC_SERIAL.html>

use crate::model::{ModemLevels, ModemLine};

/// The LINKTYPE.
pub(super) const LINK: u32 = 250;
/// Seconds, µs, event, modem lines, two bytes of no meaning.
pub(super) const HEADER: usize = 12;

/// What happened.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Event {
    StatusChange,
    SendStart,
    ReceiveStart,
    SendEnd,
    ReceiveEnd,
    DataLost,
    Complete,
    Framing,
    Parity,
    Break,
    Overflow,
}

impl Event {
    const ALL: [Self; 11] = [
        Self::StatusChange,
        Self::SendStart,
        Self::ReceiveStart,
        Self::SendEnd,
        Self::ReceiveEnd,
        Self::DataLost,
        Self::Complete,
        Self::Framing,
        Self::Parity,
        Self::Break,
        Self::Overflow,
    ];

    const fn number(self) -> u8 {
        self as u8
    }
}

/// The modem lines and their bits. A seventh, MBOK, is no line of the port.
const LINES: [(ModemLine, u8); 6] = [
    (ModemLine::Cts, 0x01),
    (ModemLine::Dcd, 0x02),
    (ModemLine::Dsr, 0x04),
    (ModemLine::Rts, 0x08),
    (ModemLine::Dtr, 0x10),
    (ModemLine::Ri, 0x20),
];

/// Which modem lines are on.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub(super) struct Levels(pub(super) u8);

impl Levels {
    /// With these set.
    pub(super) fn with(self, levels: &ModemLevels) -> Self {
        LINES.iter().fold(self, |Self(bits), (line, bit)| match levels.0.get(line) {
            Some(true) => Self(bits | bit),
            Some(false) => Self(bits & !bit),
            None => Self(bits),
        })
    }

    /// The lines among `lines` that are on here and off there, or the other way round.
    pub(super) fn changed_from(self, before: Self, lines: &[ModemLine]) -> ModemLevels {
        self.select(lines, self.0 ^ before.0)
    }

    /// The state of those lines among `lines` that have a bit in `mask`.
    pub(super) fn select(self, lines: &[ModemLine], mask: u8) -> ModemLevels {
        let chosen = LINES.iter().filter(|(line, bit)| lines.contains(line) && mask & bit != 0);
        ModemLevels(chosen.map(|(line, bit)| (*line, self.0 & bit != 0)).collect())
    }
}

/// The header at a time in µs.
pub(super) fn header(at: u64, event: Event, levels: Levels) -> [u8; HEADER] {
    let mut header = [0; HEADER];
    header[..4].copy_from_slice(&((at / 1_000_000) as u32).to_be_bytes());
    header[4..8].copy_from_slice(&((at % 1_000_000) as u32).to_be_bytes());
    header[8] = event.number();
    header[9] = levels.0;
    header
}

/// What stands in a packet: the event if it is known, the modem lines, the bytes.
/// The time in it is the capture's once more. `None`: it is too short.
pub(super) fn parse(packet: &[u8]) -> Option<(Option<Event>, Levels, &[u8])> {
    let (header, bytes) = packet.split_first_chunk::<HEADER>()?;
    let event = Event::ALL.into_iter().find(|event| event.number() == header[8]);
    Some((event, Levels(header[9]), bytes))
}
