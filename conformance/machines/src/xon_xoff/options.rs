//! What a simulated control is set to, and what cannot be.

use softplug_abi::{LineParameters, Micros};

use crate::kept::Keep;

/// Settings of a [`Control`](super::Control).
///
/// ```
/// use softplug_machines::xon_xoff::{ControlOptions, ControlOptionsError};
///
/// let options = ControlOptions { buffer: 256, ..ControlOptions::default() };
/// // XON over 256 free bytes would never come.
/// let error = ControlOptionsError::HighMark { high: 256, buffer: 256 };
/// assert_eq!(options.check(), Err(error));
/// assert_eq!(ControlOptions { low: 64, high: 128, ..options }.check(), Ok(()));
/// ```
#[derive(Clone, Debug)]
pub struct ControlOptions {
    /// The line's parameters; a rate of 0 means that characters leave at once.
    pub line: LineParameters,
    /// Bytes that the receive buffer holds.
    pub buffer: usize,
    /// XOFF is sent when fewer bytes than this are free.
    pub low: usize,
    /// XON is sent when more bytes than this are free.
    pub high: usize,
    /// Bytes that the program's execution takes out of the buffer per second;
    /// 0 for as fast as they come.
    pub rate: u32,
    /// Feed holds: once so many bytes have been executed, none is for so long.
    pub pauses: Vec<(u64, Micros)>,
    /// The byte that lets the other side send.
    pub xon: u8,
    /// The byte that stops the other side.
    pub xoff: u8,
    /// How long the control takes to react: from a character's arrival to its
    /// being looked at, and from a drained buffer to XON.
    pub latency: Micros,
    /// Depth of the transmit FIFO: what is in it leaves, whatever the other
    /// side says.
    pub transmit_fifo: usize,
    /// Depth of the receive FIFO: what does not fit until it is served is lost.
    pub receive_fifo: usize,
    /// After so much silence on the line while it is open, XON is sent again.
    pub repeat_xon: Option<Micros>,
    /// After so many further characters on a held line, XOFF is sent again.
    pub repeat_xoff: Option<u32>,
    /// Whether every byte of data is sent back.
    pub echo: bool,
    /// When the control sends a first XON by itself.
    pub xon_at_start: Option<Micros>,
    /// Whether received XON and XOFF steer the control's own sending. They are
    /// data where they do not.
    pub obey: bool,
    /// What is kept of the bytes received.
    pub keep: Keep,
}

impl Default for ControlOptions {
    /// 9,600 8N1, 512 bytes of buffer, XOFF under 128 and XON over 256 free.
    fn default() -> Self {
        Self {
            line: LineParameters::new(9_600),
            buffer: 512,
            low: 128,
            high: 256,
            rate: 0,
            pauses: Vec::new(),
            xon: 0x11,
            xoff: 0x13,
            latency: Micros::ZERO,
            transmit_fifo: 1,
            receive_fifo: 16,
            repeat_xon: None,
            repeat_xoff: None,
            echo: false,
            xon_at_start: None,
            obey: true,
            keep: Keep::Bytes,
        }
    }
}

impl ControlOptions {
    /// Refuses a control that could not work.
    ///
    /// # Errors
    /// The first contradiction among the settings.
    pub fn check(&self) -> Result<(), ControlOptionsError> {
        use ControlOptionsError as E;

        let Self { buffer, low, high, .. } = *self;
        if buffer == 0 {
            return Err(E::NoBuffer);
        }
        if low == 0 || low > high {
            return Err(E::Marks { low, high });
        }
        if high >= buffer {
            return Err(E::HighMark { high, buffer });
        }
        if self.xon == self.xoff {
            return Err(E::SameControlBytes(self.xon));
        }
        if self.transmit_fifo == 0 || self.receive_fifo == 0 {
            return Err(E::NoFifo);
        }
        if self.latency < Micros::ZERO {
            return Err(E::Latency(self.latency));
        }
        if self.repeat_xon.is_some_and(|span| span <= Micros::ZERO) || self.repeat_xoff == Some(0) {
            return Err(E::Repeat);
        }
        if !self.pauses.is_sorted_by(|a, b| a.0 < b.0) {
            return Err(E::Pauses);
        }
        Ok(())
    }
}

/// A control's settings contradict each other.
///
/// ```
/// use softplug_machines::xon_xoff::ControlOptions;
///
/// let error = ControlOptions { xoff: 0x11, ..ControlOptions::default() }.check().unwrap_err();
/// assert_eq!(error.to_string(), "XON and XOFF are the same byte, 0x11: choose two");
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum ControlOptionsError {
    /// The buffer holds nothing.
    #[error("the control's buffer holds no byte: give it at least 2")]
    NoBuffer,
    /// The marks are the wrong way round.
    #[error(
        "the low mark ({low} bytes free) must be at least 1 and not over the high mark ({high})"
    )]
    Marks {
        /// XOFF under so many free bytes.
        low: usize,
        /// XON over so many free bytes.
        high: usize,
    },
    /// XON would never be sent.
    #[error(
        "the high mark ({high} bytes free) must be below the buffer's size ({buffer}), or XON never comes"
    )]
    HighMark {
        /// XON over so many free bytes.
        high: usize,
        /// Bytes of buffer.
        buffer: usize,
    },
    /// One byte cannot mean both.
    #[error("XON and XOFF are the same byte, {0:#04x}: choose two")]
    SameControlBytes(u8),
    /// A UART holds at least the character on the wire.
    #[error("a FIFO depth of 0 cannot be: the least is 1, a UART without FIFO")]
    NoFifo,
    /// Nobody reacts before the cause.
    #[error("a latency of {0} s is negative: give 0 or more")]
    Latency(Micros),
    /// It would be sent without end.
    #[error(
        "XON or XOFF repeated after nothing would never stop: give more than 0, or leave it out"
    )]
    Repeat,
    /// Each pause has its place in the program.
    #[error("the pauses must stand in the order of their positions, one at each")]
    Pauses,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contradictions_are_refused() {
        use ControlOptionsError as E;

        let good = ControlOptions::default();
        assert_eq!(good.check(), Ok(()));
        let bad = |change: fn(&mut ControlOptions)| {
            let mut options = good.clone();
            change(&mut options);
            options.check().unwrap_err()
        };
        assert_eq!(bad(|o| o.buffer = 0), E::NoBuffer);
        assert_eq!(bad(|o| o.low = 257), E::Marks { low: 257, high: 256 });
        assert_eq!(bad(|o| o.low = 0), E::Marks { low: 0, high: 256 });
        assert_eq!(bad(|o| o.high = 512), E::HighMark { high: 512, buffer: 512 });
        assert_eq!(bad(|o| o.xon = 0x13), E::SameControlBytes(0x13));
        assert_eq!(bad(|o| o.transmit_fifo = 0), E::NoFifo);
        assert_eq!(bad(|o| o.receive_fifo = 0), E::NoFifo);
        assert_eq!(bad(|o| o.latency = Micros(-1)), E::Latency(Micros(-1)));
        assert_eq!(bad(|o| o.repeat_xon = Some(Micros::ZERO)), E::Repeat);
        assert_eq!(bad(|o| o.repeat_xoff = Some(0)), E::Repeat);
        assert_eq!(bad(|o| o.pauses = vec![(5, Micros(1)), (5, Micros(1))]), E::Pauses);
    }
}
