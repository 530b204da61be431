//! The serial ports that there are.

use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

use serialport::SerialPortType;

use crate::error::{Holder, PortError};
use crate::port::holders::holders;

/// A serial port of this machine.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct PortInfo {
    /// The device.
    pub path: PathBuf,
    /// What it is.
    pub kind: PortKind,
    /// Its name by the socket that it is plugged into. Adapters without a
    /// serial number have no other lasting name.
    pub by_path: Option<PathBuf>,
    /// Its name by maker, product and serial number.
    pub by_id: Option<PathBuf>,
    /// Who has it open, as far as we may see.
    pub holders: Vec<Holder>,
}

/// What a port hangs on.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum PortKind {
    /// A USB adapter.
    Usb {
        /// The maker's number.
        vendor: u16,
        /// The product's number.
        product: u16,
        /// Serial number, if it has one.
        serial: Option<String>,
        /// Names of maker and product.
        name: Option<String>,
    },
    /// A PCI card.
    Pci,
    /// Bluetooth.
    Bluetooth,
    /// On board, or unknown.
    Other,
}

impl fmt::Display for PortKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Usb { vendor, product, serial, name } => {
                write!(f, "USB {vendor:04x}:{product:04x}")?;
                if let Some(name) = name {
                    write!(f, " {name}")?;
                }
                match serial {
                    Some(serial) => write!(f, ", serial number {serial}"),
                    None => Ok(()),
                }
            }
            Self::Pci => f.write_str("PCI"),
            Self::Bluetooth => f.write_str("Bluetooth"),
            Self::Other => f.write_str("on board"),
        }
    }
}

/// Lists the ports, sorted by path. No port is opened.
pub fn list() -> Result<Vec<PortInfo>, PortError> {
    let found = serialport::available_ports()
        .map_err(|error| PortError::io("list the serial ports", std::io::Error::from(error)))?;
    let found = found.into_iter().filter(|port| has_hardware(Path::new(&port.port_name)));
    let mut ports: Vec<_> = found
        .map(|port| {
            let path = PathBuf::from(port.port_name);
            PortInfo {
                kind: kind(port.port_type),
                by_path: link(Path::new("/dev/serial/by-path"), &path),
                by_id: link(Path::new("/dev/serial/by-id"), &path),
                holders: holders(&path),
                path,
            }
        })
        .collect();
    ports.sort_by(|one, other| one.path.cmp(&other.path));
    Ok(ports)
}

/// The link in `folder` that leads to the device.
pub(crate) fn link(folder: &Path, device: &Path) -> Option<PathBuf> {
    let device = device.canonicalize().ok()?;
    let mut links: Vec<_> = fs::read_dir(folder)
        .ok()?
        .flatten()
        .map(|entry| entry.path())
        .filter(|link| link.canonicalize().is_ok_and(|target| target == device))
        .collect();
    // udev makes two links by path of newer kernels' ports: the first by name
    // is the one that older systems have as well.
    links.sort();
    links.into_iter().next()
}

/// A UART's driver lists more ports than there are; those have type 0.
fn has_hardware(path: &Path) -> bool {
    let Some(name) = path.file_name() else { return false };
    let kind = fs::read_to_string(Path::new("/sys/class/tty").join(name).join("type"));
    kind.map_or(true, |kind| kind.trim() != "0")
}

fn kind(kind: SerialPortType) -> PortKind {
    match kind {
        SerialPortType::UsbPort(usb) => PortKind::Usb {
            vendor: usb.vid,
            product: usb.pid,
            serial: usb.serial_number.filter(|serial| !serial.is_empty()),
            name: match (usb.manufacturer, usb.product) {
                (Some(maker), Some(product)) if !product.starts_with(&maker) => {
                    Some(format!("{maker} {product}"))
                }
                (maker, product) => product.or(maker),
            },
        },
        SerialPortType::PciPort => PortKind::Pci,
        SerialPortType::BluetoothPort => PortKind::Bluetooth,
        SerialPortType::Unknown => PortKind::Other,
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn listed_ports_exist_and_are_sorted() {
        let ports = list().unwrap();
        assert!(ports.iter().all(|port| port.path.exists()), "{ports:?}");
        assert!(ports.is_sorted_by(|one, other| one.path < other.path), "{ports:?}");
    }

    #[test]
    fn a_lasting_name_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let device = folder.path().join("ttyUSB0");
        fs::write(&device, "").unwrap();
        let names = folder.path().join("by-path");
        fs::create_dir(&names).unwrap();
        symlink("../ttyUSB1", names.join("usb-1:1.0-port0")).unwrap();
        symlink("../ttyUSB0", names.join("usb-1:2.0-port0")).unwrap();
        assert_eq!(link(&names, &device), Some(names.join("usb-1:2.0-port0")));
        assert_eq!(link(&names, &folder.path().join("ttyUSB1")), None);
    }

    #[test]
    fn kinds_read_as_people_name_them() {
        let usb = serialport::UsbPortInfo {
            vid: 0x0403,
            pid: 0x6001,
            serial_number: Some("A50285BI".to_owned()),
            manufacturer: Some("FTDI".to_owned()),
            product: Some("FT232R USB UART".to_owned()),
        };
        assert_eq!(
            kind(SerialPortType::UsbPort(usb)).to_string(),
            "USB 0403:6001 FTDI FT232R USB UART, serial number A50285BI"
        );
        assert_eq!(kind(SerialPortType::Unknown).to_string(), "on board");
    }
}
