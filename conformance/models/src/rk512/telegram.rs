//! Telegrams: the table of bytes.

/// Bytes of data in one telegram.
pub(super) const MOST: usize = 128;
/// Bytes of the largest telegram.
/// Front of a first telegram, and of a follow-up.
pub(super) const FIRST: u8 = 0x00;
pub(super) const FOLLOW_UP: u8 = 0xFF;
/// Bytes of a first header, and of a follow-up's or a reaction's.
pub(super) const HEADER: usize = 10;
pub(super) const SHORT: usize = 4;

/// Where in the partner's memory.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Area {
    Db,
    Dx,
    Inputs,
    Outputs,
    Flags,
    Timers,
    Counters,
}

impl Area {
    pub(super) const ALL: [Self; 7] = [
        Self::Db,
        Self::Dx,
        Self::Inputs,
        Self::Outputs,
        Self::Flags,
        Self::Timers,
        Self::Counters,
    ];

    /// Byte 4 of a command.
    pub(super) fn code(self) -> u8 {
        match self {
            Self::Db => 0x44,
            Self::Dx => 0x58,
            Self::Inputs => 0x45,
            Self::Outputs => 0x41,
            Self::Flags => 0x4D,
            Self::Timers => 0x54,
            Self::Counters => 0x5A,
        }
    }

    pub(super) fn of_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|area| area.code() == code)
    }

    /// As jobs and requests name it.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Db => "DB",
            Self::Dx => "DX",
            Self::Inputs => "I",
            Self::Outputs => "Q",
            Self::Flags => "M",
            Self::Timers => "T",
            Self::Counters => "C",
        }
    }

    /// Letters of German manuals mean the same.
    pub(super) fn of_name(name: &str) -> Option<Self> {
        let name = match name {
            "E" => "I",
            "A" => "Q",
            "Z" => "C",
            other => other,
        };
        Self::ALL.into_iter().find(|area| area.name() == name)
    }

    /// It is one of those with numbers.
    pub(super) fn is_block(self) -> bool {
        matches!(self, Self::Db | Self::Dx)
    }

    /// Bytes of one that is counted: a word or a byte.
    pub(super) fn unit(self) -> usize {
        match self {
            Self::Db | Self::Dx | Self::Timers | Self::Counters => 2,
            Self::Inputs | Self::Outputs | Self::Flags => 1,
        }
    }
}

/// What is to be done there.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Kind {
    Send,
    Fetch,
}

/// Byte 3 of a command.
pub(super) fn command_code(kind: Kind, area: Area) -> u8 {
    match (kind, area) {
        (Kind::Fetch, _) => 0x45,
        (Kind::Send, Area::Dx) => 0x4F,
        (Kind::Send, _) => 0x41,
    }
}

/// A command: bytes 3 to 10 of its first telegram.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) struct Command {
    pub(super) kind: Kind,
    pub(super) area: Area,
    pub(super) block: u8,
    pub(super) offset: u8,
    pub(super) count: u16,
    /// Bytes 9 and 10.
    pub(super) flag: [u8; 2],
}

impl Command {
    /// Bytes of data of the whole.
    pub(super) fn bytes(self) -> usize {
        usize::from(self.count) * self.area.unit()
    }

    /// Header of the first telegram.
    pub(super) fn first(self) -> Vec<u8> {
        let [high, low] = self.count.to_be_bytes();
        let code = command_code(self.kind, self.area);
        let [flag, rest] = self.flag;
        vec![FIRST, 0, code, self.area.code(), self.block, self.offset, high, low, flag, rest]
    }

    /// Header of those that follow.
    pub(super) fn follow_up(self) -> Vec<u8> {
        vec![FOLLOW_UP, 0, command_code(self.kind, self.area), self.area.code()]
    }
}

/// A reaction without data.
pub(super) fn reaction(front: u8, number: u8) -> Vec<u8> {
    vec![front, 0, 0, number]
}
