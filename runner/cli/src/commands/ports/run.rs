//! `softplug ports`.

use serde::Serialize;
use softplug_live::Holder;
use softplug_live::ports::{self, PortInfo, PortKind};

use crate::exit::Exit;
use crate::failure::Failure;
use crate::screen::Screen;
use crate::table::Table;

#[derive(Serialize)]
struct Document {
    ports: Vec<Entry>,
}

#[derive(Serialize)]
struct Entry {
    path: String,
    kind: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    vendor: Option<u16>,
    #[serde(skip_serializing_if = "Option::is_none")]
    product: Option<u16>,
    #[serde(skip_serializing_if = "Option::is_none")]
    serial: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    name: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    by_path: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    by_id: Option<String>,
    holders: Vec<HolderEntry>,
}

#[derive(Serialize)]
pub(crate) struct HolderEntry {
    pid: u32,
    command: String,
}

impl From<&Holder> for HolderEntry {
    fn from(holder: &Holder) -> Self {
        Self { pid: holder.pid, command: holder.command.clone() }
    }
}

pub(crate) fn run(screen: &Screen) -> Result<Exit, Failure> {
    let ports = ports::list()?;
    screen.document(&Document { ports: ports.iter().map(entry).collect() });
    if ports.is_empty() {
        screen.say("there is no serial port on this machine");
        return Ok(Exit::Done);
    }
    let mut table = Table::new(["PORT", "WHAT", "LASTING NAME", "IN USE BY"]);
    for port in &ports {
        let holders: Vec<_> = port.holders.iter().map(Holder::to_string).collect();
        let lasting = port.by_path.as_ref().or(port.by_id.as_ref());
        table.row([
            port.path.display().to_string(),
            port.kind.to_string(),
            lasting.map_or_else(|| "-".to_owned(), |name| name.display().to_string()),
            if holders.is_empty() { "-".to_owned() } else { holders.join(", ") },
        ]);
    }
    screen.say(table);
    Ok(Exit::Done)
}

fn entry(port: &PortInfo) -> Entry {
    let text = |path: &std::path::PathBuf| path.display().to_string();
    let mut entry = Entry {
        path: text(&port.path),
        kind: "other",
        vendor: None,
        product: None,
        serial: None,
        name: None,
        by_path: port.by_path.as_ref().map(text),
        by_id: port.by_id.as_ref().map(text),
        holders: port.holders.iter().map(HolderEntry::from).collect(),
    };
    match &port.kind {
        PortKind::Usb { vendor, product, serial, name } => {
            entry.kind = "usb";
            entry.vendor = Some(*vendor);
            entry.product = Some(*product);
            entry.serial.clone_from(serial);
            entry.name.clone_from(name);
        }
        PortKind::Pci => entry.kind = "pci",
        PortKind::Bluetooth => entry.kind = "bluetooth",
        PortKind::Other => {}
    }
    entry
}
