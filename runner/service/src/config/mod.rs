//! `gateway.toml`: read, checked as a whole, every problem told with its place.
//!
//! [`Config::read`] finds out all that can be known without a plug-in;
//! whether plug-ins exist and take their settings is checked with the library.

mod buses;
mod cells;
mod drops;
mod finding;
pub(crate) mod http;
mod link;
mod links;
mod machine;
mod service;
mod tls;
mod watch;
mod written;

pub use cells::CellConfig;
pub use finding::{ConfigError, ConfigFinding, Place};
pub(crate) use link::micros;
pub use link::{
    Buffer, DropConfig, LinkConfig, PortConfig, Probation, Reopen, SwapPolicy, Watchdogs,
};
pub use service::{GatewayConfig, LogFormat, Supervision};
pub(crate) use softplug_live::guess::of_names;
pub use watch::FileWatch;

use std::fs;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use softplug_live::units::BusSetup;

use finding::ConfigFindings;

/// A configuration of a thousand links has some 300 KiB.
const LARGEST_FILE: u64 = 8 << 20;
/// Most links of one gateway.
pub const MOST_LINKS: usize = 4_096;

/// What a gateway is to do.
#[derive(Clone, PartialEq, Debug)]
pub struct Config {
    /// The file; folders that it names are relative to its own.
    pub file: PathBuf,
    /// The gateway itself.
    pub gateway: GatewayConfig,
    /// The HTTP API; none if it is not wanted.
    pub http: Option<http::Options>,
    /// What becomes of plug-ins that fail.
    pub supervision: Supervision,
    /// Buses over which units are fed; names are distinct.
    pub buses: Vec<BusSetup>,
    /// Cells of links that work together; names are distinct, and no link is in two.
    pub cells: Vec<CellConfig>,
    /// The links, in the order of the file; names and ports are distinct.
    pub links: Vec<LinkConfig>,
}

impl Config {
    /// Reads and checks a file.
    pub fn read(file: &Path) -> Result<Self, ConfigError> {
        let text = read_text(file)
            .map_err(|error| error.to_string())
            .map_err(|reason| ConfigError::Unreadable { file: file.to_owned(), reason })?;
        Self::parse(file, &text)
    }

    /// Checks the text of a file.
    pub fn parse(file: &Path, text: &str) -> Result<Self, ConfigError> {
        let mut problems = ConfigFindings::new(file, text);
        let written: written::File = match toml::from_str(text) {
            Ok(written) => written,
            Err(error) => {
                problems.syntax(&error);
                problems.end()?;
                unreachable!("the parser's error was just added");
            }
        };
        let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new("."));
        let gateway = service::gateway(&written.gateway, folder, &mut problems);
        let http = written.http.as_ref().map(|http| http::read(http, folder, &mut problems));
        let supervision = service::supervision(&written.supervision, &mut problems);
        let buses = buses::all(&written.bus, &mut problems);
        let catalogue = machine::catalogue(&written.gateway, folder, &mut problems);
        let key = tls::GatewayKey::read(written.gateway.key.as_ref(), folder, &mut problems);
        let common = links::Common {
            defaults: &written.defaults,
            buses: &buses,
            catalogue: &catalogue,
            key: &key,
            gateway: &gateway,
            folder,
        };
        let links = links::all(written.link, &common, &mut problems);
        let cells = cells::all(&written.cell, &links, &mut problems);
        problems.end()?;
        Ok(Self { file: file.to_owned(), gateway, http, supervision, buses, cells, links })
    }
}

fn read_text(file: &Path) -> io::Result<String> {
    let mut text = String::new();
    fs::File::open(file)?.take(LARGEST_FILE + 1).read_to_string(&mut text)?;
    if text.len() as u64 > LARGEST_FILE {
        return Err(io::Error::other(format!("it is larger than {LARGEST_FILE} bytes")));
    }
    Ok(text)
}
