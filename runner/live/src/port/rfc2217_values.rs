//! What RFC 2217 calls what we call otherwise.

use rfc2217::{DataBits, FlowControl, LineState, ModemState, PortSettings, StopBits};
use softplug_abi::{LineErrorKind, LineParameters, ModemLines, Parity};

use super::spec::Flow;

const INPUTS: [(ModemLines, ModemState); 4] = [
    (ModemLines::CTS, ModemState::CTS),
    (ModemLines::DSR, ModemState::DSR),
    (ModemLines::DCD, ModemState::CD),
    (ModemLines::RI, ModemState::RI),
];

/// The line's settings; without flow control the plug-in sees the codes.
pub(crate) fn settings_of(line: LineParameters, flow: Flow) -> PortSettings {
    PortSettings {
        baud_rate: line.baud,
        data_bits: match line.data_bits {
            5 => DataBits::Five,
            6 => DataBits::Six,
            7 => DataBits::Seven,
            _ => DataBits::Eight,
        },
        parity: match line.parity {
            Parity::None => rfc2217::Parity::None,
            Parity::Odd => rfc2217::Parity::Odd,
            Parity::Even => rfc2217::Parity::Even,
            Parity::Mark => rfc2217::Parity::Mark,
            Parity::Space => rfc2217::Parity::Space,
        },
        stop_bits: match line.stop_half_bits {
            3 => StopBits::OnePointFive,
            4 => StopBits::Two,
            _ => StopBits::One,
        },
        flow_control: match flow {
            Flow::Host | Flow::Rs485 => FlowControl::None,
            Flow::Device => FlowControl::XonXoff,
            // Of both directions: RFC 2217 has no way to set only one by wires.
            Flow::RtsCts => FlowControl::RtsCts,
            Flow::DsrDtr => FlowControl::Dsr,
        },
    }
}

/// The line that has these settings.
#[cfg(feature = "simulate")]
pub(crate) fn line_of(settings: PortSettings) -> LineParameters {
    LineParameters {
        baud: settings.baud_rate,
        data_bits: match settings.data_bits {
            DataBits::Five => 5,
            DataBits::Six => 6,
            DataBits::Seven => 7,
            DataBits::Eight => 8,
        },
        parity: match settings.parity {
            rfc2217::Parity::None => Parity::None,
            rfc2217::Parity::Odd => Parity::Odd,
            rfc2217::Parity::Even => Parity::Even,
            rfc2217::Parity::Mark => Parity::Mark,
            rfc2217::Parity::Space => Parity::Space,
        },
        stop_half_bits: match settings.stop_bits {
            StopBits::One => 2,
            StopBits::OnePointFive => 3,
            StopBits::Two => 4,
        },
    }
}

/// The inputs that are on.
pub(crate) fn inputs_of(state: ModemState) -> ModemLines {
    let on = INPUTS.into_iter().filter(|(_, bit)| state.contains(*bit));
    on.fold(ModemLines::default(), |all, (line, _)| all.union(line))
}

/// Inputs that are on, as a server tells them.
pub(crate) fn modem_state(on: ModemLines) -> ModemState {
    let set = INPUTS.into_iter().filter(|(line, _)| on.contains(*line));
    set.fold(ModemState::default(), |all, (_, bit)| all | bit)
}

/// A line error as a server tells it.
pub(crate) fn line_state(kind: LineErrorKind) -> LineState {
    match kind {
        LineErrorKind::Parity => LineState::PARITY_ERROR,
        LineErrorKind::Framing => LineState::FRAMING_ERROR,
        LineErrorKind::ParityOrFraming => LineState::PARITY_ERROR | LineState::FRAMING_ERROR,
        LineErrorKind::Overrun => LineState::OVERRUN_ERROR,
        LineErrorKind::Break => LineState::BREAK_DETECT,
    }
}
