//! Requests to serial drivers and sockets for which rustix has no function.
//!
//! Unsafe, because each request's number must be paired with the type that the
//! kernel reads or writes. What keeps it sound: every pair stands in this file
//! once, as declared in Linux's `asm-generic/ioctls.h`, `linux/serial.h` and
//! `linux/tcp.h`, all types are `repr(C)` and valid for any bits, and
//! descriptors are borrowed.
#![allow(unsafe_code)]

use std::os::fd::{AsFd, AsRawFd};

use rustix::io::{Errno, Result};
use rustix::ioctl::{Getter, NoArg, Opcode, Setter, Updater, ioctl};
use softplug_abi::ModemLines;

use super::marks::LineCounters;

const MODEM_GET: Opcode = libc::TIOCMGET as Opcode;
const MODEM_ON: Opcode = libc::TIOCMBIS as Opcode;
const MODEM_OFF: Opcode = libc::TIOCMBIC as Opcode;
const COUNTERS: Opcode = libc::TIOCGICOUNT as Opcode;
const OUTPUT_QUEUE: Opcode = libc::TIOCOUTQ as Opcode;
const BREAK_ON: Opcode = libc::TIOCSBRK as Opcode;
const BREAK_OFF: Opcode = libc::TIOCCBRK as Opcode;
const SERIAL_GET: Opcode = libc::TIOCGSERIAL as Opcode;
const SERIAL_SET: Opcode = libc::TIOCSSERIAL as Opcode;
/// Of `asm-generic/ioctls.h`.
const RS485_GET: Opcode = 0x542E;
const RS485_SET: Opcode = 0x542F;
/// Of `linux/serial.h`.
const RS485_ENABLED: u32 = 1;
const RS485_RTS_ON_SEND: u32 = 1 << 1;
const RS485_RTS_AFTER_SEND: u32 = 1 << 2;
const LINE_STATUS: Opcode = libc::TIOCSERGETLSR as Opcode;

/// `ASYNC_LOW_LATENCY` of `linux/tty_flags.h`.
const LOW_LATENCY: i32 = 1 << 13;
/// `TIOCSER_TEMT` of `asm-generic/ioctls.h`.
const TRANSMITTER_EMPTY: u32 = 1;

const LINES: [(i32, ModemLines); 6] = [
    (libc::TIOCM_CTS, ModemLines::CTS),
    (libc::TIOCM_DSR, ModemLines::DSR),
    (libc::TIOCM_CAR, ModemLines::DCD),
    (libc::TIOCM_RNG, ModemLines::RI),
    (libc::TIOCM_RTS, ModemLines::RTS),
    (libc::TIOCM_DTR, ModemLines::DTR),
];

/// `struct serial_icounter_struct`.
#[repr(C)]
#[derive(Copy, Clone)]
struct SerialCounters {
    modem: [i32; 4],
    received: i32,
    sent: i32,
    framing: i32,
    overrun: i32,
    parity: i32,
    breaks: i32,
    buffer_overrun: i32,
    reserved: [i32; 9],
}

/// `struct serial_rs485` of `linux/serial.h`, of which only the flags are used here: the rest is
/// delays and an address.
#[repr(C)]
#[derive(Copy, Clone)]
struct Rs485 {
    flags: u32,
    delays: [u32; 2],
    reserved: [u32; 5],
}

/// `struct serial_struct`.
#[repr(C)]
#[derive(Copy, Clone)]
struct SerialSettings {
    kind: i32,
    line: i32,
    port: u32,
    irq: i32,
    flags: i32,
    transmit_fifo: i32,
    custom_divisor: i32,
    baud_base: i32,
    close_delay: u16,
    io_type: i8,
    reserved: i8,
    hub6: i32,
    closing_wait: u16,
    closing_wait2: u16,
    memory: usize,
    register_shift: u16,
    port_high: u32,
    map_base: libc::c_ulong,
}

/// Modem lines that are on.
pub(crate) fn modem_lines(fd: impl AsFd) -> Result<ModemLines> {
    // SAFETY: TIOCMGET writes one int.
    let bits: i32 = unsafe { ioctl(fd, Getter::<MODEM_GET, i32>::new())? };
    let on = LINES.iter().filter(|(bit, _)| bits & bit != 0);
    Ok(on.fold(ModemLines::default(), |all, (_, line)| all.union(*line)))
}

/// Sets the lines of `mask`: on as in `on`, the others off.
pub(crate) fn set_modem_lines(fd: impl AsFd, mask: ModemLines, on: ModemLines) -> Result<()> {
    let bits = |wanted: u8| {
        LINES.iter().filter(|(_, line)| wanted & line.0 != 0).fold(0, |all, (bit, _)| all | bit)
    };
    let (set, clear) = (bits(mask.0 & on.0), bits(mask.0 & !on.0));
    if set != 0 {
        // SAFETY: TIOCMBIS reads one int.
        unsafe { ioctl(&fd, Setter::<MODEM_ON, i32>::new(set))? };
    }
    if clear != 0 {
        // SAFETY: TIOCMBIC reads one int.
        unsafe { ioctl(&fd, Setter::<MODEM_OFF, i32>::new(clear))? };
    }
    Ok(())
}

/// Has the driver turn the line around with RTS, on while it sends, or no longer.
pub(crate) fn set_rs485(fd: impl AsFd, is_on: bool) -> Result<()> {
    // SAFETY: TIOCGRS485 writes one serial_rs485.
    let before: Rs485 = unsafe { ioctl(&fd, Getter::<RS485_GET, Rs485>::new())? };
    let by_rts = RS485_ENABLED | RS485_RTS_ON_SEND;
    let flags = match (is_on, before.flags & RS485_ENABLED != 0) {
        (true, _) => (before.flags & !RS485_RTS_AFTER_SEND) | by_rts,
        (false, true) => before.flags & !RS485_ENABLED,
        (false, false) => return Ok(()),
    };
    // SAFETY: TIOCSRS485 reads one serial_rs485, and writes back what the driver made of it.
    unsafe { ioctl(&fd, Updater::<RS485_SET, Rs485>::new(&mut Rs485 { flags, ..before }))? };
    // A driver takes what it can.
    // SAFETY: as above.
    let has: Rs485 = unsafe { ioctl(&fd, Getter::<RS485_GET, Rs485>::new())? };
    if is_on && has.flags & by_rts != by_rts { Err(Errno::OPNOTSUPP) } else { Ok(()) }
}

/// The driver's counters of line errors.
pub(crate) fn counters(fd: impl AsFd) -> Result<LineCounters> {
    // SAFETY: TIOCGICOUNT writes one serial_icounter_struct.
    let counters = unsafe { ioctl(fd, Getter::<COUNTERS, SerialCounters>::new())? };
    Ok(LineCounters {
        framing: counters.framing as u32,
        parity: counters.parity as u32,
        breaks: counters.breaks as u32,
        overruns: (counters.overrun as u32).wrapping_add(counters.buffer_overrun as u32),
    })
}

/// Bytes in the kernel's output queue: of a terminal not yet given to the
/// UART or adapter, of a TCP connection not yet acknowledged.
pub(crate) fn output_queue(fd: impl AsFd) -> Result<usize> {
    // SAFETY: TIOCOUTQ, which is SIOCOUTQ as well, writes one int.
    let bytes: i32 = unsafe { ioctl(fd, Getter::<OUTPUT_QUEUE, i32>::new())? };
    Ok(usize::try_from(bytes).unwrap_or(0))
}

/// How often the oldest bytes of a TCP connection were sent again, and how
/// many questions for room in a row had no answer.
pub(crate) fn unanswered(fd: impl AsFd) -> Result<(u8, u8)> {
    let mut info = [0_u8; 8];
    let mut length = info.len() as libc::socklen_t;
    // SAFETY: TCP_INFO writes at most `length` bytes of a tcp_info, whose first
    // eight are single bytes (linux/tcp.h).
    let asked = unsafe {
        libc::getsockopt(
            fd.as_fd().as_raw_fd(),
            libc::IPPROTO_TCP,
            libc::TCP_INFO,
            info.as_mut_ptr().cast(),
            &raw mut length,
        )
    };
    let [_state, _congestion, retransmits, probes, ..] = info;
    if asked == 0 { Ok((retransmits, probes)) } else { Err(last_error()) }
}

fn last_error() -> Errno {
    std::io::Error::last_os_error().raw_os_error().map_or(Errno::IO, Errno::from_raw_os_error)
}

/// Whether the UART has sent everything, its shift register included.
pub(crate) fn transmitter_empty(fd: impl AsFd) -> Result<bool> {
    // SAFETY: TIOCSERGETLSR writes one unsigned int.
    let status: u32 = unsafe { ioctl(fd, Getter::<LINE_STATUS, u32>::new())? };
    Ok(status & TRANSMITTER_EMPTY != 0)
}

/// Characters that a UART takes from the kernel at once.
pub(crate) fn uart_fifo(fd: impl AsFd) -> Result<u32> {
    let fifo = serial_settings(fd)?.transmit_fifo;
    Ok(u32::try_from(fifo).unwrap_or(0).max(1))
}

/// Holds the line low, or no longer.
pub(crate) fn set_break(fd: impl AsFd, on: bool) -> Result<()> {
    if on {
        // SAFETY: TIOCSBRK has no argument.
        unsafe { ioctl(fd, NoArg::<BREAK_ON>::new()) }
    } else {
        // SAFETY: TIOCCBRK has no argument.
        unsafe { ioctl(fd, NoArg::<BREAK_OFF>::new()) }
    }
}

/// Asks the driver to hand bytes on at once (FTDI: a latency timer of 1 ms), or
/// no longer. Gives what was set before.
pub(crate) fn set_low_latency(fd: impl AsFd, on: bool) -> Result<bool> {
    let mut settings = serial_settings(&fd)?;
    let before = settings.flags & LOW_LATENCY != 0;
    if before == on {
        return Ok(before);
    }
    settings.flags ^= LOW_LATENCY;
    // SAFETY: TIOCSSERIAL reads one serial_struct; the pointer in it is the
    // kernel's own cookie, given back unchanged.
    unsafe { ioctl(&fd, Setter::<SERIAL_SET, SerialSettings>::new(settings))? };
    // Some drivers take the request and change nothing.
    let now = serial_settings(&fd)?.flags & LOW_LATENCY != 0;
    if now == on { Ok(before) } else { Err(Errno::OPNOTSUPP) }
}

fn serial_settings(fd: impl AsFd) -> Result<SerialSettings> {
    // SAFETY: TIOCGSERIAL writes one serial_struct.
    unsafe { ioctl(fd, Getter::<SERIAL_GET, SerialSettings>::new()) }
}

/// What a driver says when its device is not there any more.
pub(super) fn is_gone(error: Errno) -> bool {
    matches!(error, Errno::IO | Errno::NXIO | Errno::NODEV)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn structures_are_as_long_as_the_kernels() {
        assert_eq!(size_of::<SerialCounters>(), 80);
        if cfg!(target_pointer_width = "64") {
            assert_eq!(size_of::<SerialSettings>(), 72);
        }
    }
}
