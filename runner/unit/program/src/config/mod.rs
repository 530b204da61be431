//! `unit.toml`.

mod written;

use std::collections::BTreeMap;
use std::fmt;
use std::fs::File;
use std::io::{self, Read};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use softplug_live::{PortSpec, plain_text};
use softplug_unit_uplink::{CanAddress, TlsKeys};
use thiserror::Error;

use crate::error::UnitError;
use crate::paths;

/// The largest `unit.toml`, in bytes.
const LARGEST_FILE: u64 = 1 << 20;

/// What a unit is to do.
#[derive(Clone, Debug)]
pub struct UnitConfig {
    /// Its name.
    pub name: String,
    /// A number that stays the same; of the computer if none is written.
    pub serial: u64,
    /// Where its gateway reaches it.
    pub reach: Reach,
    /// Its key and those of its gateways; `None`: whoever reaches it may drive it.
    pub tls: Option<TlsKeys>,
    /// Whose plug-ins it takes.
    pub signature: SignatureConfig,
    /// Its links, in the order of the file. Their names are distinct, and so are their memories.
    pub links: Vec<LinkConfig>,
}

/// Where a gateway reaches a unit.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Reach {
    /// It listens there.
    Tcp(SocketAddr),
    /// It has this number on a CAN bus.
    Can(CanAddress),
}

impl fmt::Display for Reach {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tcp(address) => address.fmt(f),
            Self::Can(address) => address.fmt(f),
        }
    }
}

/// Whose plug-ins a unit takes.
#[derive(Clone, Debug, Default)]
pub struct SignatureConfig {
    /// Ed25519 public keys.
    pub keys: Vec<[u8; 32]>,
    /// Plug-ins without a signature are taken too.
    pub unsigned: bool,
}

/// A link of a unit.
#[derive(Clone, Debug)]
pub struct LinkConfig {
    /// Its name.
    pub name: String,
    /// Its port.
    pub port: PortSpec,
    /// The line as it is written; what that does not say is the plug-in's.
    pub line: Option<String>,
    /// The memory of its plug-in.
    pub memory: MemoryConfig,
    /// Settings that hold until a gateway sends others, as `--set` takes them.
    pub settings: BTreeMap<String, String>,
    /// Bytes between the bus and the machine.
    pub buffer: usize,
    /// Characters that may be in flight on the line; by its rate if `None`.
    pub depth: Option<u32>,
    /// Where what must outlive a start is kept, beside the memory.
    pub state: PathBuf,
}

/// Where a link's two slots are.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct MemoryConfig {
    /// A character device of MTD, or a file.
    pub path: PathBuf,
    /// Bytes of a file that is made; of a device it is what the device has.
    pub size: u32,
    /// Erasures of a slot after which it takes no more.
    pub most_erases: u32,
}

/// Why a unit is not started: its set-up.
#[derive(Debug, Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("{} cannot be read: {reason}", shown(file))]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// Why.
        reason: String,
    },
    /// It says what cannot be.
    #[error("{}:{line}:{column}: {reason}", shown(file))]
    Wrong {
        /// The file.
        file: PathBuf,
        /// Line, counted from 1.
        line: usize,
        /// Column in characters, counted from 1.
        column: usize,
        /// What, and what to do, in one line.
        reason: String,
    },
}

fn shown(file: &Path) -> String {
    plain_text(&file.display().to_string())
}

impl UnitConfig {
    /// Reads and checks a file. Paths in it are relative to its folder.
    ///
    /// # Errors
    /// It cannot be read, or says what cannot be.
    pub fn read(file: &Path) -> Result<Self, ConfigError> {
        let text = read_text(file, LARGEST_FILE).map_err(|error| ConfigError::Unreadable {
            file: file.to_owned(),
            reason: error.to_string(),
        })?;
        let folder = file.parent().unwrap_or(Path::new("."));
        Self::parse(&text, folder).map_err(|mistake| {
            let (line, column) = mistake.place(&text);
            ConfigError::Wrong { file: file.to_owned(), line, column, reason: mistake.sentence }
        })
    }

    /// What should not stay as it is, a sentence each.
    pub fn remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        if let Reach::Tcp(address) = &self.reach
            && self.tls.is_none()
            && !address.ip().is_loopback()
        {
            remarks.push(format!(
                "whoever reaches {address} can feed the machines, and nothing is encrypted: give the unit \
                 [tls] with a key, or a network that nobody else is on"
            ));
        }
        remarks
    }

    /// Whether memories and settings can be where they are to be, as far as that can be found out
    /// without writing.
    ///
    /// # Errors
    /// The first that cannot.
    pub fn look(&self) -> Result<(), UnitError> {
        for link in &self.links {
            let wrong = |path: &Path, error: paths::NoPlace| UnitError::Memory {
                link: link.name.clone(),
                path: path.to_owned(),
                reason: error.to_string(),
            };
            let memory = &link.memory;
            paths::hold_memory(&memory.path, memory.size)
                .map_err(|error| wrong(&memory.path, error))?;
            let state = link.state.parent().unwrap_or(Path::new("."));
            paths::hold_files(state).map_err(|error| UnitError::State {
                path: state.to_owned(),
                reason: error.to_string(),
            })?;
        }
        Ok(())
    }
}

/// All of a file that is no longer than this.
fn read_text(file: &Path, most: u64) -> io::Result<String> {
    let mut text = String::new();
    File::open(file)?.take(most + 1).read_to_string(&mut text)?;
    if text.len() as u64 > most {
        return Err(io::Error::other(format!("it is larger than {most} bytes")));
    }
    Ok(text)
}
