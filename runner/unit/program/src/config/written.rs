//! `unit.toml` as it is written, and what of it cannot be.

mod wrong;

use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use ed25519_dalek::VerifyingKey;
use ed25519_dalek::pkcs8::DecodePublicKey;
use serde::Deserialize;
use sha2::{Digest, Sha256};
use softplug_abi::LineParameters;
use softplug_live::port::parse_line;
use softplug_live::{BadSpec, PortSpec, plain_text, quantity};
use softplug_unit_uplink::{TlsKeys, TlsPrivateKey, TlsPublicKey};
use toml::{Spanned, Value};

use self::wrong::Wrong;
use super::{LinkConfig, MemoryConfig, Reach, SignatureConfig, UnitConfig, read_text};
use crate::mistake::Mistake;
use crate::paths;

/// The largest file with a public key, in bytes.
const LARGEST_KEY: u64 = 64 << 10;
/// Most links of a unit: their numbers have a byte in a message, and 255 means none.
const MOST_LINKS: usize = 64;
/// Bytes of a link's buffer.
const BUFFERS: std::ops::RangeInclusive<u64> = 512..=64 << 20;
/// Bytes of a memory that is a file, and of its erase blocks.
const MEMORIES: std::ops::RangeInclusive<u64> = 32 << 10..=64 << 20;
const BLOCK: u64 = 4_096;
/// Characters in flight.
const DEPTHS: std::ops::RangeInclusive<u32> = 1..=4_096;
/// The longest name of a unit or a link, in bytes.
const LONGEST_NAME: usize = 64;

impl UnitConfig {
    /// Relative paths are those of the folder.
    pub(super) fn parse(text: &str, folder: &Path) -> Result<Self, Mistake> {
        let written: WrittenUnit = toml::from_str(text).map_err(|error| Mistake::of(&error))?;
        let name = match written.name {
            Some(name) => {
                named("the unit", name.as_ref()).map_err(Mistake::at(name.span()))?;
                name.into_inner()
            }
            None => host_name(),
        };
        let span = written.can.as_ref().map_or(0..0, Spanned::span);
        let can = written.can.as_ref().map(|can| can.as_ref().as_str());
        let reach = reach(written.listen, can).map_err(Mistake::at(span))?;
        let tls = match (written.tls, &reach) {
            (Some(tls), Reach::Tcp(_)) => {
                let span = tls.span();
                Some(tls.into_inner().checked(folder).map_err(Mistake::at(span))?)
            }
            (Some(tls), Reach::Can(_)) => {
                return Err(Mistake::at(tls.span())(Wrong::TlsOverCan));
            }
            (None, _) => None,
        };
        let keys = written
            .signature
            .keys
            .iter()
            .map(|file| key(&folder.join(file.as_ref())).map_err(Mistake::at(file.span())));
        let keys = keys.collect::<Result<Vec<_>, _>>()?;
        let unsigned = written.signature.unsigned;
        if keys.is_empty() && !unsigned {
            return Err(Wrong::NothingTaken.into());
        }
        if written.link.is_empty() {
            return Err(Wrong::NoLink.into());
        }
        if written.link.len() > MOST_LINKS {
            return Err(Wrong::TooManyLinks(written.link.len()).into());
        }
        let state = folder.join(written.state);
        let mut links: Vec<LinkConfig> = Vec::new();
        for link in written.link {
            let span = link.span();
            let link = link.into_inner().checked(folder, &state);
            let link = link.map_err(Mistake::at(span.clone()))?;
            links.iter().try_for_each(|other| apart(&link, other)).map_err(Mistake::at(span))?;
            links.push(link);
        }
        let serial = written.serial.unwrap_or_else(|| serial_of(&name));
        let signature = SignatureConfig { keys, unsigned };
        Ok(Self { name, serial, reach, tls, signature, links })
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenUnit {
    name: Option<Spanned<String>>,
    serial: Option<u64>,
    listen: Option<SocketAddr>,
    can: Option<Spanned<String>>,
    #[serde(default = "default_state")]
    state: PathBuf,
    tls: Option<Spanned<WrittenTls>>,
    #[serde(default)]
    signature: WrittenSignature,
    #[serde(default)]
    link: Vec<Spanned<WrittenLink>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenTls {
    key: PathBuf,
    gateways: Vec<String>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenSignature {
    #[serde(default)]
    keys: Vec<Spanned<PathBuf>>,
    #[serde(default)]
    unsigned: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenLink {
    name: String,
    port: Port,
    line: Option<Line>,
    memory: Option<PathBuf>,
    #[serde(default = "default_memory")]
    memory_size: Bytes,
    #[serde(default = "default_erases")]
    most_erases: u32,
    #[serde(default)]
    settings: BTreeMap<String, String>,
    #[serde(default = "default_buffer")]
    buffer: Bytes,
    depth: Option<u32>,
}

fn default_state() -> PathBuf {
    PathBuf::from("/var/lib/softplug-unit")
}

fn default_memory() -> Bytes {
    Bytes(1 << 20)
}

fn default_erases() -> u32 {
    10_000
}

fn default_buffer() -> Bytes {
    Bytes(64 << 10)
}

#[derive(Deserialize)]
#[serde(try_from = "String")]
struct Port(PortSpec);

impl TryFrom<String> for Port {
    type Error = BadSpec;

    fn try_from(text: String) -> Result<Self, BadSpec> {
        text.parse().map(Self)
    }
}

#[derive(Deserialize)]
#[serde(try_from = "String")]
struct Line(String);

impl TryFrom<String> for Line {
    type Error = BadSpec;

    fn try_from(text: String) -> Result<Self, BadSpec> {
        parse_line(&text, LineParameters::new(0))?;
        Ok(Self(text))
    }
}

#[derive(Copy, Clone, Deserialize)]
#[serde(try_from = "Value")]
struct Bytes(u64);

impl TryFrom<Value> for Bytes {
    type Error = &'static str;

    fn try_from(written: Value) -> Result<Self, &'static str> {
        const FORM: &str = "write a number of bytes: 512, \"16KiB\" or \"64MiB\"";
        match written {
            Value::Integer(number) => number.try_into().map(Self).map_err(|_| FORM),
            Value::String(text) => quantity::bytes(&text).map(Self).map_err(|_| FORM),
            _ => Err(FORM),
        }
    }
}

impl WrittenTls {
    fn checked(self, folder: &Path) -> Result<TlsKeys, Wrong> {
        let key = TlsPrivateKey::read(&folder.join(self.key))?;
        if self.gateways.is_empty() {
            return Err(Wrong::NoGateway);
        }
        let gateways = self.gateways.iter().map(|text| {
            let wrong = |error| Wrong::Gateway { text: text.clone(), error };
            text.parse::<TlsPublicKey>().map_err(wrong)
        });
        let gateways = gateways.collect::<Result<Vec<_>, _>>()?;
        if gateways.contains(&key.public()) {
            return Err(Wrong::OwnKey(key.public()));
        }
        Ok(TlsKeys::of_unit(&key, &gateways))
    }
}

impl WrittenLink {
    fn checked(self, folder: &Path, state: &Path) -> Result<LinkConfig, Wrong> {
        let Self { name, .. } = self;
        named("a link", &name)?;
        let Bytes(buffer) = self.buffer;
        if !BUFFERS.contains(&buffer) {
            return Err(Wrong::Buffer { link: name, bytes: buffer });
        }
        if self.depth.is_some_and(|depth| !DEPTHS.contains(&depth)) {
            return Err(Wrong::Depth { link: name });
        }
        if self.port.0.needs_rate() && self.line.is_none() {
            return Err(Wrong::NoLine { link: name });
        }
        let path = match self.memory {
            Some(path) => folder.join(path),
            None => state.join(format!("{name}.slots")),
        };
        let size = self.memory_size.0;
        if !MEMORIES.contains(&size) || !size.is_multiple_of(BLOCK) {
            return Err(Wrong::MemorySize { link: name, bytes: size });
        }
        if self.most_erases == 0 {
            return Err(Wrong::NoErases { link: name });
        }
        let size = size as u32;
        let memory = MemoryConfig { path, size, most_erases: self.most_erases };
        Ok(LinkConfig {
            state: state.join(format!("{name}.settings")),
            port: self.port.0,
            line: self.line.map(|Line(text)| text),
            memory,
            settings: self.settings,
            buffer: buffer as usize,
            depth: self.depth,
            name,
        })
    }
}

fn reach(listen: Option<SocketAddr>, can: Option<&str>) -> Result<Reach, Wrong> {
    match (listen, can) {
        (Some(address), None) => Ok(Reach::Tcp(address)),
        (None, Some(text)) => {
            let wrong = |error| Wrong::Can { text: text.to_owned(), error };
            text.parse().map(Reach::Can).map_err(wrong)
        }
        (None, None) => Err(Wrong::NoUplink),
        (Some(_), Some(_)) => Err(Wrong::TwoUplinks),
    }
}

/// Names become names of files and are shown.
fn named(what: &'static str, name: &str) -> Result<(), Wrong> {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
    let is_good = !name.is_empty()
        && name.len() <= LONGEST_NAME
        && name.chars().all(is_plain)
        && !name.starts_with('.');
    if is_good {
        return Ok(());
    }
    Err(Wrong::Name { what, name: name.to_owned() })
}

/// Whether two links have nothing in common that each must have to itself.
fn apart(one: &LinkConfig, other: &LinkConfig) -> Result<(), Wrong> {
    let twice =
        |what, of: &dyn fmt::Display| Err(Wrong::Twice { what, of: plain_text(&of.to_string()) });
    if one.name.eq_ignore_ascii_case(&other.name) {
        return twice("name", &one.name);
    }
    if paths::is_same(&one.memory.path, &other.memory.path) {
        return twice("memory", &one.memory.path.display());
    }
    for (memory, settings) in [(one, other), (other, one), (one, one), (other, other)] {
        if paths::is_same(&memory.memory.path, &settings.state) {
            return twice("file", &settings.state.display());
        }
    }
    let is_one_port = match (&one.port, &other.port) {
        (PortSpec::Device(one), PortSpec::Device(other)) => paths::is_same(one, other),
        (port, other) => port.is_exclusive() && port == other,
    };
    if is_one_port {
        return twice("port", &one.port);
    }
    Ok(())
}

fn key(file: &Path) -> Result<[u8; 32], Wrong> {
    let text = read_text(file, LARGEST_KEY)
        .map_err(|error| Wrong::Unreadable { file: file.to_owned(), error })?;
    let key = VerifyingKey::from_public_key_pem(&text)
        .map_err(|error| Wrong::NoKey { file: file.to_owned(), error })?;
    Ok(key.to_bytes())
}

fn host_name() -> String {
    let name = fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    let name = name.trim();
    if named("the unit", name).is_ok() { name.to_owned() } else { "unit".to_owned() }
}

/// A number of this computer, with the unit's name: the computer's own id is not given away.
fn serial_of(name: &str) -> u64 {
    let machine = fs::read("/etc/machine-id").unwrap_or_default();
    let digest = Sha256::new().chain_update(machine).chain_update(name).finalize();
    let (first, _) = digest.split_first_chunk::<8>().expect("SHA-256 has 32 bytes");
    u64::from_le_bytes(*first)
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt as _;

    use super::*;

    const LEAST: &str = "listen = \"127.0.0.1:7640\"\n[signature]\nunsigned = true\n\
                         [[link]]\nname = \"mill\"\nport = \"/dev/ttyS0\"\nline = \"19200 8N1\"\n";

    fn refused(text: &str) -> String {
        UnitConfig::parse(text, Path::new("/etc/unit")).expect_err("it is wrong").sentence
    }

    #[test]
    fn the_least_that_can_be_written_is_enough() {
        let config = UnitConfig::parse(LEAST, Path::new("/etc/unit")).unwrap();
        let link = &config.links[0];
        assert_eq!(link.memory.path, Path::new("/var/lib/softplug-unit/mill.slots"));
        assert_eq!((link.buffer, link.memory.size), (65_536, 1 << 20));
    }

    #[test]
    fn keys_for_tls_that_cannot_be_are_said_in_a_sentence() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("unit.key");
        let own = TlsPrivateKey::make(&file).unwrap().public();
        let with =
            |gateways: &str| format!("{LEAST}[tls]\nkey = \"unit.key\"\ngateways = [{gateways}]\n");
        let refused = |gateways: &str| {
            UnitConfig::parse(&with(gateways), folder.path()).unwrap_err().sentence
        };
        assert!(refused("").contains("no gateway could ever reach the unit"));
        assert!(refused("\"gateway.pub\"").contains("\"gateway.pub\": this is no public key"));
        assert!(refused(&format!("\"{own}\"")).contains("is the unit's own key"));
        let other = "\"MCowBQYDK2VwAyEAGb9ECWmEzf6FQbrBZ9w7lshQhqowtrbLDFw4rXAxZuE=\"";
        let config = UnitConfig::parse(&with(other), folder.path()).unwrap();
        assert_eq!(config.tls.unwrap().own(), own);
        fs::set_permissions(&file, fs::Permissions::from_mode(0o640)).unwrap();
        let said = refused(other);
        assert!(
            said.contains("can be read or written by others than its owner (mode 640)"),
            "{said}"
        );
    }

    #[test]
    fn whoever_may_reach_the_unit_is_remarked_on_where_nothing_keeps_them_out() {
        let of = |text: &str| UnitConfig::parse(text, Path::new("/etc/unit")).unwrap().remarks();
        assert!(of(LEAST).is_empty());
        let open = of(&LEAST.replace("127.0.0.1:7640", "0.0.0.0:7640"));
        assert!(
            open[0].starts_with("whoever reaches 0.0.0.0:7640 can feed the machines"),
            "{open:?}"
        );
    }

    #[test]
    fn what_cannot_be_is_said_in_a_sentence() {
        let with = |line: &str| format!("{LEAST}{line}\n");
        let again = LEAST.split_once("[[link]]").unwrap().1;
        let cases = [
            (LEAST.replace("true", "false"), "no plug-in could ever be taken"),
            (with("baud = 9600"), "unknown field `baud`"),
            (with("buffer = \"3B\""), "give 512 to"),
            (with("buffer = \"many\""), "write a number of bytes"),
            (with("depth = 0"), "must be 1 to"),
            (with("memory_size = 100"), "a multiple of 4096"),
            (LEAST.replace("listen = \"127.0.0.1:7640\"\n", ""), "nobody could reach the unit"),
            (format!("can = \"can0/17\"\n{LEAST}"), "a unit has one uplink"),
            (LEAST.replace("listen = \"127.0.0.1:7640\"", "can = \"can0/240\""), "1 to 239"),
            (with("most_erases = 0"), "nothing could be downloaded"),
            (LEAST.replace("19200 8N1", "fast"), "fast"),
            (LEAST.replace("\"mill\"", "\"../mill\""), "is no name for a link"),
            (LEAST.replace("/dev/ttyS0", "COM1"), "COM1"),
            (LEAST.replace("line = \"19200 8N1\"\n", ""), "needs a `line`"),
            (format!("{LEAST}[[link]]{again}"), "two links have the name"),
            (
                format!("{LEAST}[[link]]{}", again.replace("mill", "lathe")),
                "two links have the port",
            ),
            (LEAST.replace("unsigned = true", "keys = [\"none.pem\"]"), "none.pem"),
            (
                format!("{LEAST}[tls]\nkey = \"none.key\"\ngateways = []\n"),
                "none.key cannot be read",
            ),
            (format!("{LEAST}[tls]\nkey = \"none.key\"\n"), "missing field `gateways`"),
            (
                LEAST.replace("listen = \"127.0.0.1:7640\"", "can = \"can0/17\"")
                    + "[tls]\nkey = \"none.key\"\ngateways = []\n",
                "TLS goes over TCP only",
            ),
            (LEAST.split_once("[[link]]").unwrap().0.to_owned(), "there is no [[link]]"),
        ];
        for (text, part) in cases {
            let said = refused(&text);
            assert!(said.contains(part), "{said}");
        }
    }
}
