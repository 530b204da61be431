//! A terminal's settings: raw with marks, read back and compared.

use std::os::fd::AsFd;

use rustix::termios::{
    ControlModes, InputModes, OptionalActions, SpecialCodeIndex, Termios, tcgetattr, tcsetattr,
};
use softplug_abi::{LineParameters, LinkDownReason, Parity};

use super::ioctl::{self, is_gone};
use super::spec::{Flow, PortOptions};
use crate::difference::{DifferenceWeight, SettingDifference, line_differences};
use crate::error::PortError;

/// The line settings that a terminal has now.
pub fn read_line(fd: impl AsFd) -> Result<LineParameters, PortError> {
    let termios =
        tcgetattr(fd).map_err(|error| PortError::io("read the port's settings", error))?;
    Ok(line_of(&termios))
}

/// Sets the terminal and gives what it then has, and where that differs.
pub(super) fn apply(
    fd: impl AsFd,
    before: &Termios,
    options: &PortOptions,
) -> Result<(LineParameters, Vec<SettingDifference>), PortError> {
    let failed = |error| match error {
        error if is_gone(error) => PortError::Gone(LinkDownReason::Unplugged),
        error => PortError::io("set the port", error),
    };
    turn_around(&fd, options.flow)?;
    let mut wanted = before.clone();
    prepare(&mut wanted, options).map_err(failed)?;
    tcsetattr(&fd, OptionalActions::Now, &wanted).map_err(failed)?;
    // A port takes what it can and says nothing of the rest.
    let has = tcgetattr(&fd).map_err(failed)?;
    Ok((line_of(&has), differences(&wanted, &has, options.line)))
}

/// Has the driver turn a half-duplex line around, or no longer. Each driver has its own ways, and
/// most have none.
fn turn_around(fd: impl AsFd, flow: Flow) -> Result<(), PortError> {
    let is_on = flow == Flow::Rs485;
    match ioctl::set_rs485(fd, is_on) {
        Err(error) if is_gone(error) => Err(PortError::Gone(LinkDownReason::Unplugged)),
        Err(_) if is_on => Err(PortError::NoFlow {
            what: "driver that turns an RS-485 line around with RTS",
            instead: "use an adapter that does so by itself, and take host",
        }),
        // What is not there need not be taken away.
        Ok(()) | Err(_) => Ok(()),
    }
}

fn prepare(termios: &mut Termios, options: &PortOptions) -> rustix::io::Result<()> {
    let line = &options.line;
    termios.make_raw();
    // Without PARMRK a damaged byte becomes NUL, legal blank tape; without
    // INPCK a damaged byte passes for a good one.
    termios.input_modes.insert(InputModes::INPCK | InputModes::PARMRK);
    termios.input_modes.remove(
        InputModes::IGNPAR
            | InputModes::IGNBRK
            | InputModes::BRKINT
            | InputModes::ISTRIP
            | InputModes::INLCR
            | InputModes::IGNCR
            | InputModes::ICRNL
            | InputModes::IUCLC
            | InputModes::IXON
            | InputModes::IXANY
            | InputModes::IXOFF
            | InputModes::IMAXBEL
            | InputModes::IUTF8,
    );
    if options.flow == Flow::Device {
        termios.input_modes.insert(InputModes::IXON | InputModes::IXOFF);
        termios.special_codes[SpecialCodeIndex::VSTART] = 0x11;
        termios.special_codes[SpecialCodeIndex::VSTOP] = 0x13;
    }
    // With VMIN 0 a read of nothing would look like an unplugged adapter.
    termios.special_codes[SpecialCodeIndex::VMIN] = 1;
    termios.special_codes[SpecialCodeIndex::VTIME] = 0;
    termios.control_modes.insert(ControlModes::CLOCAL | ControlModes::CREAD);
    termios.control_modes.remove(
        ControlModes::CSIZE
            | ControlModes::PARENB
            | ControlModes::PARODD
            | ControlModes::CMSPAR
            | ControlModes::CSTOPB
            | ControlModes::CRTSCTS,
    );
    if options.flow == Flow::RtsCts {
        termios.control_modes.insert(ControlModes::CRTSCTS);
    }
    termios.control_modes.insert(match line.data_bits {
        5 => ControlModes::CS5,
        6 => ControlModes::CS6,
        7 => ControlModes::CS7,
        _ => ControlModes::CS8,
    });
    termios.control_modes.insert(match line.parity {
        Parity::None => ControlModes::empty(),
        Parity::Even => ControlModes::PARENB,
        Parity::Odd => ControlModes::PARENB | ControlModes::PARODD,
        Parity::Space => ControlModes::PARENB | ControlModes::CMSPAR,
        Parity::Mark => ControlModes::PARENB | ControlModes::CMSPAR | ControlModes::PARODD,
    });
    if line.stop_half_bits > 2 {
        termios.control_modes.insert(ControlModes::CSTOPB);
    }
    // A rate of 0 would hang up.
    if line.baud == 0 { Ok(()) } else { termios.set_speed(line.baud) }
}

/// The line settings in a terminal's settings.
pub(super) fn line_of(termios: &Termios) -> LineParameters {
    let modes = termios.control_modes;
    let data_bits = match modes & ControlModes::CSIZE {
        ControlModes::CS5 => 5,
        ControlModes::CS6 => 6,
        ControlModes::CS7 => 7,
        _ => 8,
    };
    let odd = modes.contains(ControlModes::PARODD);
    let parity = match (modes.contains(ControlModes::PARENB), modes.contains(ControlModes::CMSPAR))
    {
        (false, _) => Parity::None,
        (true, true) if odd => Parity::Mark,
        (true, true) => Parity::Space,
        (true, false) if odd => Parity::Odd,
        (true, false) => Parity::Even,
    };
    // UARTs make 1.5 stop bits of 2 for characters of 5 bits, and only there.
    let stop_half_bits = match (modes.contains(ControlModes::CSTOPB), data_bits) {
        (false, _) => 2,
        (true, 5) => 3,
        (true, _) => 4,
    };
    LineParameters { baud: termios.output_speed(), data_bits, parity, stop_half_bits }
}

/// What a terminal has otherwise than it was wanted.
fn differences(wanted: &Termios, has: &Termios, asked: LineParameters) -> Vec<SettingDifference> {
    let mut differences = line_differences(asked, line_of(has));
    let mut compare = |setting, asked: String, has: String, weight| {
        if asked != has {
            differences.push(SettingDifference { setting, asked, has, weight });
        }
    };
    let flags = [
        ("parity checking", InputModes::INPCK),
        ("marks of damaged characters", InputModes::PARMRK),
        ("XON/XOFF obeyed by the port", InputModes::IXON),
        ("XON/XOFF sent by the port", InputModes::IXOFF),
    ];
    for (setting, flag) in flags {
        let text =
            |termios: &Termios| if termios.input_modes.contains(flag) { "on" } else { "off" };
        let (asked, has) = (text(wanted).to_owned(), text(has).to_owned());
        compare(setting, asked, has, DifferenceWeight::Refused);
    }
    let by_wires = |termios: &Termios| {
        let is_on = termios.control_modes.contains(ControlModes::CRTSCTS);
        if is_on { "on" } else { "off" }.to_owned()
    };
    compare("RTS/CTS", by_wires(wanted), by_wires(has), DifferenceWeight::Refused);
    differences
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::difference::refused;
    use crate::port::parse_line;
    use crate::pty::PtyPair;

    /// What is found if a port that was asked for `asked` has `has`.
    fn found(asked: &str, has: &str) -> Vec<(String, bool)> {
        let pair = PtyPair::open().unwrap();
        let mut wanted = tcgetattr(pair.as_fd()).unwrap();
        let mut taken = wanted.clone();
        let line = |text| parse_line(text, LineParameters::new(9_600)).unwrap();
        let (asked, has) = (line(asked), line(has));
        prepare(&mut wanted, &PortOptions::new(asked)).unwrap();
        prepare(&mut taken, &PortOptions::new(has)).unwrap();
        let differences = differences(&wanted, &taken, asked);
        assert_eq!(
            refused(&differences).is_some(),
            differences.iter().any(SettingDifference::is_refused)
        );
        differences.iter().map(|one| (one.to_string(), one.is_refused())).collect()
    }

    #[test]
    fn flow_by_wires_is_the_kernels_and_is_read_back() {
        let pair = PtyPair::open().unwrap();
        let before = tcgetattr(pair.as_fd()).unwrap();
        let with = |flow| {
            let options = PortOptions { flow, ..PortOptions::default() };
            let mut termios = before.clone();
            prepare(&mut termios, &options).unwrap();
            termios
        };
        let is_on = |flow| with(flow).control_modes.contains(ControlModes::CRTSCTS);
        assert_eq!(Flow::ALL.map(is_on), [false, false, true, false, false]);
        let asked = LineParameters::new(9_600);
        let texts = |wanted, has| -> Vec<_> {
            let found = differences(&with(wanted), &with(has), asked);
            found.iter().map(|one| (one.to_string(), one.is_refused())).collect()
        };
        assert_eq!(texts(Flow::RtsCts, Flow::RtsCts), []);
        assert_eq!(
            texts(Flow::RtsCts, Flow::Host),
            [("RTS/CTS: asked for on, the port has off".to_owned(), true)]
        );
    }

    #[test]
    fn only_a_rounded_rate_is_borne() {
        let rate =
            |text: &str, is_refused| vec![(format!("baud rate: asked for {text}"), is_refused)];
        assert_eq!(found("9600 7E2", "9600 7E2"), []);
        assert_eq!(found("115200", "115385"), rate("115200, the port has 115385", false));
        assert_eq!(found("250000", "9600"), rate("250000, the port has 9600", true));
        let names = |asked, has| -> Vec<bool> {
            found(asked, has).into_iter().map(|(_, is_refused)| is_refused).collect()
        };
        // Data bits, parity, stop bits.
        assert_eq!(names("7E2", "8N1"), [true, true, true]);
        assert_eq!(found("8M1", "8N1")[0].0, "parity: asked for mark, the port has none");
        // A UART makes 2 of 1.5 but for characters of five bits.
        assert_eq!(
            found("8N1.5", "8N1.5"),
            [("stop bits: asked for 1.5, the port has 2".to_owned(), true)]
        );
        assert_eq!(found("5N1.5", "5N1.5"), []);
    }
}
