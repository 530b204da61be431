//! What can go wrong with a port, grouped by who can mend it.

use std::fmt;
use std::io;
use std::path::PathBuf;

use softplug_abi::LinkDownReason;

use crate::difference::SettingDifference;

/// Who can mend a [`PortError`].
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Blame {
    /// Whoever set the port up: name, rights, another program.
    Setup,
    /// The cable or the other side.
    Line,
    /// The operating system or its driver.
    System,
}

/// Why a port could not be opened, read, written or set.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    /// The port or its settings cannot be understood.
    #[error(transparent)]
    BadSpec(#[from] BadSpec),
    /// There is no such device.
    #[error("there is no {}; plug the adapter in, or list the ports that there are", path.display())]
    NotFound {
        /// The device that was asked for.
        path: PathBuf,
    },
    /// The device's rights keep us out.
    #[error("{} may not be opened by this user; {}", path.display(), advice(group.as_deref()))]
    Permission {
        /// The device that was asked for.
        path: PathBuf,
        /// The group that may open it, if one may.
        group: Option<String>,
    },
    /// Another program, or this one, has the port.
    #[error("{} is in use by {}; end that program or choose another port", path.display(), list(holders))]
    InUse {
        /// The device that was asked for.
        path: PathBuf,
        /// Who has it open, as far as we may see.
        holders: Vec<Holder>,
    },
    /// The path is no serial port.
    #[error("{} is not a serial port; give a device such as /dev/ttyUSB0", path.display())]
    NotATerminal {
        /// The path that was asked for.
        path: PathBuf,
    },
    /// The name exists, but nothing answers behind it.
    #[error("{} has no hardware behind it; choose another port", path.display())]
    NoHardware {
        /// The device that was asked for.
        path: PathBuf,
    },
    /// The device server cannot be reached.
    #[error(
        "no connection to {address}: {source}; check the address and that the device server is on"
    )]
    Connect {
        /// Host and port.
        address: String,
        /// What the system said.
        source: io::Error,
    },
    /// The other side of the connection is no device server of RFC 2217.
    #[error(
        "{address} does not speak RFC 2217: {reason}; choose the device server's RFC 2217 port, or write tcp:// for a raw one"
    )]
    NotRfc2217 {
        /// Host and port.
        address: String,
        /// What it did instead.
        reason: &'static str,
    },
    /// The port has taken what was asked of it otherwise than it was asked.
    #[error(
        "{port} does not do what was asked of it: {}; choose settings that it has, or a port that has these",
        differences(found)
    )]
    NotTaken {
        /// The device, or host and port.
        port: String,
        /// What it has instead; at least one.
        found: Vec<SettingDifference>,
    },
    /// The port was there and is gone.
    #[error("the port is lost: {}; check the cable", .0.text())]
    Gone(LinkDownReason),
    /// This kind of port cannot do it.
    #[error("this port cannot {what}; use a serial adapter that can")]
    Unsupported {
        /// Completes "this port cannot …".
        what: &'static str,
    },
    /// The port cannot be stopped, or turned around, by these lines.
    #[error("this port has no {what}; {instead}")]
    NoFlow {
        /// Completes "this port has no …".
        what: &'static str,
        /// What to do.
        instead: &'static str,
    },
    /// Threads that drive links may not run at real-time priority.
    #[error(
        "the I/O threads may not have real-time priority {priority}: {reason}; allow it to this user (LimitRTPRIO={priority} in the service's unit, `ulimit -r {priority}`), or leave it out"
    )]
    RealTime {
        /// The priority that was asked for.
        priority: u8,
        /// What the system said.
        reason: String,
    },
    /// There are no ptys on this system.
    #[error("this system has no ptys; give a serial port, tcp://host:port or rfc2217://host:port")]
    NoPty,
    /// The address is not to be had.
    #[error("{address} cannot be listened on: {source}; choose another address or port")]
    Listen {
        /// What was asked for.
        address: String,
        /// Why not.
        source: io::Error,
    },
    /// The system refused.
    #[error("failed to {what}: {source}")]
    Io {
        /// Completes "failed to …".
        what: &'static str,
        /// What the system said.
        source: io::Error,
    },
}

impl PortError {
    /// Who can mend it.
    pub fn blame(&self) -> Blame {
        match self {
            Self::BadSpec(_)
            | Self::NotFound { .. }
            | Self::Permission { .. }
            | Self::InUse { .. }
            | Self::NotATerminal { .. }
            | Self::NoHardware { .. }
            | Self::NotRfc2217 { .. }
            | Self::NotTaken { .. }
            | Self::RealTime { .. }
            | Self::NoFlow { .. }
            | Self::Listen { .. }
            | Self::NoPty
            | Self::Unsupported { .. } => Blame::Setup,
            Self::Connect { .. } | Self::Gone(_) => Blame::Line,
            Self::Io { .. } => Blame::System,
        }
    }

    /// What the port has otherwise than it was asked to, if that is why.
    pub fn differences(&self) -> &[SettingDifference] {
        match self {
            Self::NotTaken { found, .. } => found,
            _ => &[],
        }
    }

    /// An error of the system while doing `what` ("read from the port").
    pub(crate) fn io(what: &'static str, source: impl Into<io::Error>) -> Self {
        Self::Io { what, source: source.into() }
    }
}

/// Why the name or the settings of a port cannot be understood.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum BadSpec {
    /// Neither a device, nor an address, nor a pty.
    #[error(
        "`{0}` names no port; give a device such as /dev/ttyUSB0, tcp://host:port, rfc2217://host:port, or pty:"
    )]
    Form(String),
    /// The address of a device server is incomplete.
    #[error("`{0}` is not a host and port; write it as tcp://host:4001 or rfc2217://host:4001")]
    Address(String),
    /// No unit, or no link of one.
    #[error(
        "`{0}` names no unit; write it as host:7640 or can0/17, and a link of it as unit://host:7640/link or unit://can0/17/link"
    )]
    Unit(String),
    /// The number is not a rate that a line can have.
    #[error("`{0}` is not a baud rate; give a number from 50 to 16000000, such as 9600")]
    Baud(String),
    /// The characters' form is wrong.
    #[error(
        "`{0}` is not a form of characters; give data bits, parity and stop bits, such as 8N1 or 7E2"
    )]
    Format(String),
    /// A setting is given twice.
    #[error(
        "`{0}` is given twice in the line's settings; give the baud rate and the form once, such as `9600 7E2`"
    )]
    Twice(String),
    /// The terminal's settings need a rate.
    #[error("{} needs a baud rate; give one such as 9600", .0.display())]
    BaudMissing(PathBuf),
}

/// A process that has a port open.
#[derive(Clone, PartialEq, Eq, Debug, PartialOrd, Ord)]
pub struct Holder {
    /// Its process id.
    pub pid: u32,
    /// Its name.
    pub command: String,
}

impl fmt::Display for Holder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} (process {})", self.command, self.pid)
    }
}

fn advice(group: Option<&str>) -> String {
    match group {
        Some(group) => format!("run `sudo usermod -aG {group} \"$USER\"` and log in again"),
        None => "no group may open it: ask the administrator for a udev rule".to_owned(),
    }
}

/// The differences in one phrase.
fn differences(found: &[SettingDifference]) -> String {
    let texts: Vec<_> = found.iter().map(SettingDifference::to_string).collect();
    texts.join(", and ")
}

/// The holders in one phrase.
fn list(holders: &[Holder]) -> String {
    if holders.is_empty() {
        return "a program of another user".to_owned();
    }
    let names: Vec<_> = holders.iter().map(Holder::to_string).collect();
    names.join(" and ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::difference::DifferenceWeight;

    #[test]
    fn messages_say_what_where_and_what_to_do() {
        let path = PathBuf::from("/dev/ttyUSB0");
        let holders = vec![Holder { pid: 42, command: "minicom".to_owned() }];
        assert_eq!(
            PortError::InUse { path: path.clone(), holders }.to_string(),
            "/dev/ttyUSB0 is in use by minicom (process 42); end that program or choose another port"
        );
        let group = Some("dialout".to_owned());
        assert_eq!(
            PortError::Permission { path, group }.to_string(),
            "/dev/ttyUSB0 may not be opened by this user; run `sudo usermod -aG dialout \"$USER\"` \
             and log in again"
        );
        let found = vec![SettingDifference {
            setting: "baud rate",
            asked: "250000".to_owned(),
            has: "9600".to_owned(),
            weight: DifferenceWeight::Refused,
        }];
        let not_taken = PortError::NotTaken { port: "/dev/ttyS0".to_owned(), found };
        assert_eq!(
            not_taken.to_string(),
            "/dev/ttyS0 does not do what was asked of it: baud rate: asked for 250000, the port \
             has 9600; choose settings that it has, or a port that has these"
        );
        assert_eq!(not_taken.blame(), Blame::Setup);
        let gone = PortError::Gone(LinkDownReason::Unplugged);
        assert_eq!(gone.to_string(), "the port is lost: the device is gone; check the cable");
        assert_eq!(gone.blame(), Blame::Line);
    }
}
