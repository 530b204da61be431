//! Each test has a computer of its own.

mod blocks;
mod closing;
mod gateway;
mod held;
mod line_errors;
mod ports;
mod receptions;
mod station;
mod unit;
mod unplugged;
mod wires;

use softplug_emulated::{Machine, Wire};

const XON: u8 = 0x11;
const XOFF: u8 = 0x13;

/// Where the guest has its ports.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Device {
    /// A 16550A.
    Uart,
    /// An FTDI adapter, which has to be plugged in.
    Usb,
}

impl Device {
    const BOTH: [Self; 2] = [Self::Uart, Self::Usb];

    fn path(self) -> &'static str {
        match self {
            Self::Uart => "/dev/ttyS1",
            Self::Usb => "/dev/ttyUSB0",
        }
    }

    /// Whether the shell finds low latency asked for. That is the last that the command does to a
    /// port when it opens it: from then on nothing that comes is lost.
    fn has_low_latency(self) -> &'static str {
        match self {
            // `ASYNC_LOW_LATENCY` is bit 13.
            Self::Uart => "[ $(($(cat /sys/class/tty/ttyS1/flags) >> 13 & 1)) = 1 ]",
            Self::Usb => "[ $(cat /sys/bus/usb-serial/devices/ttyUSB0/latency_timer) = 1 ]",
        }
    }

    /// Waits until the command has opened and set it.
    fn until_set(self, machine: &mut Machine) {
        machine.until(&format!("{self:?}, open and set"), self.has_low_latency());
    }

    /// A computer that has it.
    fn machine(self) -> Machine {
        let mut machine = Machine::start();
        if self == Self::Usb {
            machine.plug();
        }
        machine
    }

    fn wire(self, machine: &Machine) -> &Wire {
        match self {
            Self::Uart => machine.uart(),
            Self::Usb => machine.usb(),
        }
    }
}

/// A program of so many lines of 13 bytes, which are all different.
fn program(lines: u32) -> String {
    let lines: Vec<_> = (1..=lines).map(|line| format!("N{line:05}G1X1Y2\n")).collect();
    lines.concat()
}

/// Options of `softplug` for a device and a plug-in.
fn link(device: Device, line: &str, plugin: &str) -> String {
    let port = device.path();
    format!("--port {port} --line '{line}' --plugin /plugins/{plugin}.wasm")
}
