//! What of a `unit.toml` cannot be, and what to do.

use std::io;
use std::path::PathBuf;

use ed25519_dalek::pkcs8::spki;
use softplug_unit_uplink::{NoCanAddress, NoTlsKey, TlsKeyError, TlsPublicKey};
use thiserror::Error;

use super::{BLOCK, BUFFERS, DEPTHS, LONGEST_NAME, MEMORIES, MOST_LINKS};
use crate::config::shown;
use crate::mistake::Mistake;

/// What cannot be, in a sentence.
#[derive(Debug, Error)]
pub(super) enum Wrong {
    #[error("\"{}\" is no name for {what}: write up to {LONGEST_NAME} letters, digits, \"-\", \"_\" and \".\"", name.escape_debug())]
    Name { what: &'static str, name: String },
    #[error("`can = \"{}\"`: {error}, as in \"can0/17\"", text.escape_debug())]
    Can { text: String, error: NoCanAddress },
    #[error(
        "nobody could reach the unit: give `listen`, an address and a port, or `can`, such as \"can0/17\""
    )]
    NoUplink,
    #[error("there are `listen` and `can`: a unit has one uplink, take one out")]
    TwoUplinks,
    #[error("there are [tls] and `can`: TLS goes over TCP only, take one out")]
    TlsOverCan,
    #[error(transparent)]
    TlsKey(#[from] TlsKeyError),
    #[error("no gateway could ever reach the unit: name its public key in `gateways` of [tls]")]
    NoGateway,
    #[error("`gateways` of [tls], \"{}\": {error}", text.escape_debug())]
    Gateway { text: String, error: NoTlsKey },
    #[error("{0} in `gateways` of [tls] is the unit's own key: name those of its gateways")]
    OwnKey(TlsPublicKey),
    #[error("the key {}: {error}", shown(file))]
    Unreadable { file: PathBuf, error: io::Error },
    #[error(
        "{} is no Ed25519 public key, as `openssl pkey -pubout` writes it: {error}",
        shown(file)
    )]
    NoKey { file: PathBuf, error: spki::Error },
    #[error(
        "no plug-in could ever be taken: name a public key in `keys` of [signature], or set \
         `unsigned = true` there for a bus that nobody else reaches"
    )]
    NothingTaken,
    #[error("there is no [[link]]: name at least one port")]
    NoLink,
    #[error("{0} links; {MOST_LINKS} are the most")]
    TooManyLinks(usize),
    #[error("the buffer of link \"{link}\" has {bytes} bytes; give {} to {}", BUFFERS.start(), BUFFERS.end())]
    Buffer { link: String, bytes: u64 },
    #[error("`depth` of link \"{link}\" must be 1 to {}", DEPTHS.end())]
    Depth { link: String },
    #[error("link \"{link}\" needs a `line` such as \"9600 8N1\"")]
    NoLine { link: String },
    #[error(
        "`memory_size` of link \"{link}\" is {bytes}; give {} to {} bytes, a multiple of {BLOCK}",
        MEMORIES.start(),
        MEMORIES.end()
    )]
    MemorySize { link: String, bytes: u64 },
    #[error("`most_erases` of link \"{link}\" is 0: nothing could be downloaded")]
    NoErases { link: String },
    #[error("two links have the {what} \"{of}\": give each its own")]
    Twice { what: &'static str, of: String },
}

impl From<Wrong> for Mistake {
    /// No place of the file is to blame.
    fn from(wrong: Wrong) -> Self {
        Self::at(0..0)(wrong)
    }
}
