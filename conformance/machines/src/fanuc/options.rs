//! What a simulated FANUC control is set to, and what cannot be.

use softplug_abi::{LineErrorKind, LineParameters, Micros};

use crate::kept::Keep;

/// Settings of a [`Control`](super::Control).
///
/// ```
/// use softplug_machines::fanuc::{Code, Options, OptionsError, eight_none_two};
///
/// let eia = Options { code: Code::Eia, ..Options::default() };
/// assert_eq!(eia.check(), Err(OptionsError::DataBits(7)));
/// assert_eq!(Options { line: eight_none_two(4_800), ..eia }.check(), Ok(()));
/// ```
#[derive(Clone, Debug)]
pub struct Options {
    /// The line's parameters; a rate of 0 means that characters leave at once.
    pub line: LineParameters,
    /// Which interface the control has.
    pub interface: Interface,
    /// Code of its programs, both ways.
    pub code: Code,
    /// Where the parity of ISO is made and checked.
    pub parity: Parity,
    /// The control's own codes carry even parity (DC3 is 93 and not 13). A line
    /// of 7 data bits cannot show the difference.
    pub codes_with_parity: bool,
    /// Each DC1 and DC3 is sent twice: the second one changes nothing.
    pub codes_twice: bool,
    /// Characters of ISO that raise no alarm.
    pub characters: CharacterSet,
    /// EIA codes of characters that have none in the standard: character, code.
    pub eia_codes: Vec<(u8, u8)>,
    /// CR ends a block in ISO, and LF means nothing.
    pub cr_ends_block: bool,
    /// The TV check; `None` where it is off.
    pub tv: Option<TvCheck>,
    /// Characters that the receive buffer holds.
    pub buffer: usize,
    /// DC3 is sent when fewer characters than this are free.
    pub reserve: usize,
    /// DC1 is sent when at least so many characters are free again.
    pub resume: usize,
    /// Characters that may come after DC3; one more is alarm 087. The remote
    /// buffer asks for nothing but that its buffer holds them.
    pub tolerance: u32,
    /// Time that a block takes to be stored or executed; 0: none.
    pub block_time: Micros,
    /// What becomes of the blocks.
    pub feeding: Feeding,
    /// After so much silence in an open reader, DC1 is sent again.
    pub repeat_dc1: Option<Micros>,
    /// From the closing `%` to the final DC3; `None`: it is not sent.
    pub final_dc3: Option<Micros>,
    /// A reset or an alarm is told: SYN or NAK after DC3 or DC4.
    pub tell_reset: bool,
    /// How it punches.
    pub punch: PunchOptions,
    /// How it speaks protocol A.
    pub remote: RemoteOptions,
    /// Number of the program that carries a request.
    pub request_program: u32,
    /// Whether the modem lines are wired, and not jumpered at the control.
    pub modem_lines: bool,
    /// From a character's arrival in an empty receive FIFO until all in it is
    /// looked at.
    pub latency: Micros,
    /// Characters that the receive FIFO holds: one more is an overrun, 085.
    pub receive_fifo: usize,
    /// What the operator does at the panel, and when; reading and punching as soon as the
    /// control is free from then on.
    pub panel: Vec<(Micros, Press)>,
    /// What is kept of the text that was read.
    pub keep: Keep,
}

/// The kind of serial interface.
///
/// ```
/// use softplug_machines::fanuc::{Interface, Options, OptionsError};
///
/// // A remote buffer wants room for what it asks for.
/// let remote = Options { interface: Interface::RemoteA, ..Options::default() };
/// assert_eq!(remote.check(), Err(OptionsError::Space { space: 1_024, buffer: 512 }));
/// assert_eq!(Options { buffer: 4_096, ..remote }.check(), Ok(()));
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Interface {
    /// A tape reader and punch under DC1 to DC4.
    ReaderPunch,
    /// Remote buffer, protocol A: packets.
    RemoteA,
    /// Remote buffer, protocol B: as the reader, but patient after DC3.
    RemoteB,
}

/// A code of the tape.
///
/// ```
/// use softplug_abi::Micros;
/// use softplug_machines::fanuc::{Code, Control, Options, Press, eight_none_two};
///
/// let (line, code) = (eight_none_two(0), Code::Eia);
/// let mut control = Control::new(Options { line, code, ..Options::default() })?;
/// control.press(Micros::ZERO, Press::Punch(b"O36\n".to_vec()));
/// let punched: Vec<u8> = std::iter::from_fn(|| control.poll_transmit(Micros::ZERO)).collect();
/// // Between DC2 and DC4: `%` is 0B, the end of a block 80, and the rest is the program.
/// assert_eq!(punched[1..9], [0x0B, 0x80, 0x46, 0x13, 0x16, 0x80, 0x0B, 0x80]);
/// # Ok::<(), softplug_machines::fanuc::OptionsError>(())
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Code {
    /// Seven bits and even parity.
    Iso,
    /// Eight channels, an odd number of holes.
    Eia,
}

/// Where the parity of ISO is.
///
/// ```
/// use softplug_abi::Micros;
/// use softplug_machines::fanuc::{Control, Options, Parity, Press, eight_none_two};
///
/// let (line, parity) = (eight_none_two(0), Parity::Software);
/// let mut control = Control::new(Options { line, parity, ..Options::default() })?;
/// control.press(Micros::ZERO, Press::Punch(b"O1\n".to_vec()));
/// let punched: Vec<u8> = std::iter::from_fn(|| control.poll_transmit(Micros::ZERO)).collect();
/// // DC2, the text, DC4: each with an even number of ones.
/// assert_eq!(punched, [0x12, 0xA5, 0x0A, 0xCF, 0xB1, 0x0A, 0xA5, 0x0A, 0x14]);
/// # Ok::<(), softplug_machines::fanuc::OptionsError>(())
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Parity {
    /// The UART makes and checks it: 7 data bits.
    Uart,
    /// Bit 7 of a character of 8 data bits.
    Software,
    /// Nobody checks any; none is made.
    None,
}

/// Characters that the control takes in ISO; others are alarm 001.
///
/// ```
/// use softplug_abi::Micros;
/// use softplug_machines::fanuc::{CharacterSet, Control, Options, Press, seven_even_two};
///
/// for (characters, alarms) in [(CharacterSet::Table, 1), (CharacterSet::Printable, 0)] {
///     let line = seven_even_two(0);
///     let mut control = Control::new(Options { line, characters, ..Options::default() })?;
///     control.press(Micros::ZERO, Press::Read);
///     for byte in b"%\nO1(lid)\n%" {
///         control.receive(Micros(1_000), *byte);
///     }
///     assert_eq!(control.report().alarms.len(), alarms);
/// }
/// # Ok::<(), softplug_machines::fanuc::OptionsError>(())
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum CharacterSet {
    /// Those of the code table.
    Table,
    /// All printable ones of ASCII.
    Printable,
}

/// What counts in the TV check.
///
/// ```
/// use softplug_abi::Micros;
/// use softplug_machines::fanuc::{
///     AlarmKind, Control, Options, Press, TvCheck, seven_even_two,
/// };
///
/// // `G1` and its end are three characters: an odd number.
/// let tv = Some(TvCheck { returns: true, comments: true });
/// let mut control = Control::new(Options { line: seven_even_two(0), tv, ..Options::default() })?;
/// control.press(Micros::ZERO, Press::Read);
/// for byte in b"%\nO12\nG1\n" {
///     control.receive(Micros(1_000), *byte);
/// }
/// assert_eq!(control.report().alarms[0].kind, AlarmKind::Tv);
/// # Ok::<(), softplug_machines::fanuc::OptionsError>(())
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct TvCheck {
    /// CRs.
    pub returns: bool,
    /// What stands between parentheses, they included.
    pub comments: bool,
}

/// What becomes of the blocks that were read.
///
/// ```
/// use softplug_abi::Micros;
/// use softplug_machines::fanuc::{
///     Control, FeedHold, Feeding, Options, Press, seven_even_two,
/// };
///
/// // The cycle starts with 10 characters; behind the first block, the feed is held for 9 s.
/// let feed_holds = vec![FeedHold { after: 1, span: Micros::from_secs(9) }];
/// let mut control = Control::new(Options {
///     line: seven_even_two(0),
///     block_time: Micros::from_millis(100),
///     feeding: Feeding::Drip { cycle_start: 10, feed_holds },
///     ..Options::default()
/// })?;
/// control.press(Micros::ZERO, Press::Read);
/// for byte in b"%\nG1X12.345\nG1X12.345\n" {
///     control.receive(Micros::from_secs(1), *byte);
/// }
/// control.advance(Micros::from_secs(5));
/// assert_eq!((control.report().blocks, control.report().starved), (1, 0));
/// control.advance(Micros::from_secs(11));
/// assert_eq!(control.report().blocks, 2);
/// # Ok::<(), softplug_machines::fanuc::OptionsError>(())
/// ```
#[derive(Clone, Debug)]
pub enum Feeding {
    /// They are stored.
    Memory,
    /// They are executed: an empty buffer stops the tool.
    Drip {
        /// The operator starts the cycle when so many characters are there.
        cycle_start: usize,
        /// Feed holds, in the order of their blocks.
        feed_holds: Vec<FeedHold>,
    },
}

/// For some time, nothing is executed.
///
/// The example of [`Feeding`] shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct FeedHold {
    /// Blocks that have been executed before.
    pub after: u64,
    /// How long.
    pub span: Micros,
}

/// The form of an end of block that the control punches in ISO.
///
/// The example of [`PunchOptions`] shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Eob {
    /// LF.
    Lf,
    /// CR LF.
    CrLf,
    /// LF CR CR.
    LfCrCr,
    /// LF CR.
    LfCr,
    /// CR.
    Cr,
}

/// How the control ends a punch.
///
/// The example of [`PunchOptions`] shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Dc4 {
    /// Directly after the trailer.
    Prompt,
    /// After so many further NULs.
    Late(u32),
    /// Not at all.
    Missing,
}

/// How a control punches.
///
/// ```
/// use softplug_abi::Micros;
/// use softplug_machines::fanuc::{
///     Control, Dc4, Eob, Options, Press, PunchOptions, seven_even_two,
/// };
///
/// let (eob, dc4) = (Eob::LfCrCr, Dc4::Late(1));
/// let punch = PunchOptions { eob, trailer: 2, dc4, ..PunchOptions::default() };
/// let mut control = Control::new(Options { line: seven_even_two(0), punch, ..Options::default() })?;
/// control.press(Micros::ZERO, Press::Punch(b"O1\n".to_vec()));
/// let punched: Vec<u8> = std::iter::from_fn(|| control.poll_transmit(Micros::ZERO)).collect();
/// assert_eq!(punched, b"\x12%\n\r\rO1\n\r\r%\n\r\r\0\0\0\x14");
/// # Ok::<(), softplug_machines::fanuc::OptionsError>(())
/// ```
#[derive(Clone, Debug)]
pub struct PunchOptions {
    /// Whether the punch begins with DC2.
    pub dc2: bool,
    /// The data waits for the host's DC1; DC2 is repeated after so long without.
    pub wait_dc1: Option<Micros>,
    /// Characters before the program, as they are on the tape (NULs, `ESC & H E :`),
    /// without parity.
    pub leader: Vec<u8>,
    /// Ends of blocks in ISO.
    pub eob: Eob,
    /// NULs after the program.
    pub trailer: u32,
    /// The end.
    pub dc4: Dc4,
    /// From DC4 to SYN or NAK.
    pub tell_after: Micros,
    /// Characters that still leave after the host's DC3.
    pub after_dc3: u32,
    /// Characters that still leave after CS has dropped (our RTS).
    pub after_cs: u32,
    /// Resume on DC2 instead of DC1.
    pub resume_on_dc2: bool,
    /// Characters that are damaged on the way: place in the output, from 0 and
    /// DC2 and repeated DC2s not counted; in ascending order.
    pub damage: Vec<(u64, LineErrorKind)>,
}

/// How a control speaks protocol A.
///
/// ```
/// use softplug_machines::fanuc::{Interface, Options, RemoteOptions};
///
/// // Asks for data when more than 256 characters are free, in messages that end with ETX.
/// let remote = RemoteOptions { space: 256, end_code: 0x03, ..RemoteOptions::default() };
/// let options = Options { interface: Interface::RemoteA, remote, ..Options::default() };
/// assert_eq!(options.check(), Ok(()));
/// ```
#[derive(Clone, Debug)]
pub struct RemoteOptions {
    /// Tp: status after so long with nothing to say; the longest silence.
    pub period: Micros,
    /// Nb: data is asked for when more characters than this are free.
    pub space: usize,
    /// End code of a message.
    pub end_code: u8,
    /// After SYN the control tells in any case that it is ready, and awaits the
    /// host's RDY; otherwise only a host that answers SYN is told so.
    pub announce_ready: bool,
    /// Which of the control's own messages get a wrong sum, from 0; repetitions
    /// count.
    pub wrong_sums: Vec<u32>,
    /// Which of the host's messages are answered by RTY as if damaged, from 0.
    pub refusals: Vec<u32>,
}

/// What the operator does.
///
/// ```
/// use softplug_abi::Micros;
/// use softplug_machines::fanuc::{Control, Options, Press, seven_even_two};
///
/// // The operator asks for a program by name: that is punched, and READ is pressed.
/// let mut control = Control::new(Options { line: seven_even_two(0), ..Options::default() })?;
/// control.press(Micros::ZERO, Press::Request("1234".to_owned()));
/// let sent: Vec<u8> = std::iter::from_fn(|| control.poll_transmit(Micros::from_secs(1))).collect();
/// assert_eq!(sent, b"\x12%\nO9999\n(SEND 1234)\n%\n\x14\x11");
/// # Ok::<(), softplug_machines::fanuc::OptionsError>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Press {
    /// READ, or the start of remote operation.
    Read,
    /// PUNCH: the text between the two `%`, ASCII with LF, leads with its `O` number.
    Punch(Vec<u8>),
    /// Punches the program that asks the host for one by name, then READ.
    Request(String),
    /// RESET.
    Reset,
    /// Something raises an alarm that has nothing to do with the line.
    Alarm,
    /// The control is switched off: ER goes off.
    Off,
    /// It is switched on again.
    On,
}

impl Press {
    /// Whether a control that reads or punches does not take it.
    pub(super) fn needs_free_control(&self) -> bool {
        matches!(self, Self::Read | Self::Punch(_) | Self::Request(_))
    }
}

impl Default for PunchOptions {
    /// DC2, `%` … `%` with LF, DC4; the most that a control may send after a stop.
    fn default() -> Self {
        Self {
            dc2: true,
            wait_dc1: None,
            leader: Vec::new(),
            eob: Eob::Lf,
            trailer: 0,
            dc4: Dc4::Prompt,
            tell_after: Micros::from_millis(50),
            after_dc3: 10,
            after_cs: 2,
            resume_on_dc2: false,
            damage: Vec::new(),
        }
    }
}

impl Default for RemoteOptions {
    /// Tp 5 s, asks when more than 1,024 characters are free, messages end with CR.
    fn default() -> Self {
        Self {
            period: Micros::from_secs(5),
            space: 1_024,
            end_code: b'\r',
            announce_ready: true,
            wrong_sums: Vec::new(),
            refusals: Vec::new(),
        }
    }
}

impl Default for Options {
    /// 4,800 7E2 in ISO, 512 characters of buffer, everything stored at once.
    fn default() -> Self {
        Self {
            line: seven_even_two(4_800),
            interface: Interface::ReaderPunch,
            code: Code::Iso,
            parity: Parity::Uart,
            codes_with_parity: true,
            codes_twice: false,
            characters: CharacterSet::Table,
            eia_codes: Vec::new(),
            cr_ends_block: false,
            tv: None,
            buffer: 512,
            reserve: 64,
            resume: 256,
            tolerance: 10,
            block_time: Micros::ZERO,
            feeding: Feeding::Memory,
            repeat_dc1: None,
            final_dc3: Some(Micros::ZERO),
            tell_reset: false,
            punch: PunchOptions::default(),
            remote: RemoteOptions::default(),
            request_program: 9_999,
            modem_lines: false,
            latency: Micros::ZERO,
            receive_fifo: 16,
            panel: Vec::new(),
            keep: Keep::Bytes,
        }
    }
}

/// The usual line of a FANUC control in ISO.
///
/// ```
/// use softplug_abi::Micros;
/// use softplug_machines::fanuc::seven_even_two;
///
/// // 11 bits.
/// assert_eq!(seven_even_two(4_800).characters(48), Micros(110_000));
/// ```
pub fn seven_even_two(baud: u32) -> LineParameters {
    LineParameters { baud, data_bits: 7, parity: softplug_abi::Parity::Even, stop_half_bits: 4 }
}

/// The line for EIA, or for ISO whose parity is made in software.
///
/// ```
/// use softplug_machines::fanuc::eight_none_two;
///
/// let line = eight_none_two(4_800);
/// assert_eq!((line.data_bits, line.stop_half_bits, line.half_bits()), (8, 4, 22));
/// ```
pub fn eight_none_two(baud: u32) -> LineParameters {
    LineParameters { stop_half_bits: 4, ..LineParameters::new(baud) }
}

impl Options {
    /// Refuses a control that could not work.
    ///
    /// # Errors
    /// The first contradiction among the settings.
    pub fn check(&self) -> Result<(), OptionsError> {
        use OptionsError as E;

        let Self { buffer, reserve, resume, .. } = *self;
        if reserve < 12 || reserve > resume || resume > buffer {
            return Err(E::Marks { reserve, resume, buffer });
        }
        if self.line.data_bits < 8 && (self.code == Code::Eia || self.parity == Parity::Software) {
            return Err(E::DataBits(self.line.data_bits));
        }
        if self.receive_fifo == 0 {
            return Err(E::NoFifo);
        }
        let spans = [self.latency, self.block_time, self.punch.tell_after];
        if spans.into_iter().chain(self.final_dc3).any(|span| span < Micros::ZERO) {
            return Err(E::Negative);
        }
        let repeats = [self.repeat_dc1, self.punch.wait_dc1, Some(self.remote.period)];
        if repeats.into_iter().flatten().any(|span| span <= Micros::ZERO) {
            return Err(E::Repeat);
        }
        if self.interface == Interface::RemoteA && self.remote.space >= buffer {
            return Err(E::Space { space: self.remote.space, buffer });
        }
        if let Feeding::Drip { feed_holds, .. } = &self.feeding
            && !feed_holds.is_sorted_by(|a, b| a.after < b.after)
        {
            return Err(E::FeedHolds);
        }
        if !self.punch.damage.is_sorted_by(|a, b| a.0 < b.0) {
            return Err(E::Damage);
        }
        if !self.panel.is_sorted_by_key(|(at, _)| *at) {
            return Err(E::Panel);
        }
        Ok(())
    }
}

/// A control's settings contradict each other.
///
/// ```
/// use softplug_machines::fanuc::{Options, OptionsError};
///
/// let error = Options { receive_fifo: 0, ..Options::default() }.check().unwrap_err();
/// assert_eq!(error, OptionsError::NoFifo);
/// assert!(error.to_string().ends_with("the least is 1, a UART without FIFO"));
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum OptionsError {
    /// The marks are the wrong way round.
    #[error(
        "the reserve ({reserve} characters free) must be at least 12 and not over the resume mark ({resume}), and that not over the buffer ({buffer})"
    )]
    Marks {
        /// DC3 under so many free characters.
        reserve: usize,
        /// DC1 from so many free characters.
        resume: usize,
        /// Characters of buffer.
        buffer: usize,
    },
    /// The eighth bit is needed.
    #[error("EIA and parity in software need 8 data bits, the line has {0}")]
    DataBits(u8),
    /// A UART holds at least the character on the wire.
    #[error("a receive FIFO of 0 characters cannot be: the least is 1, a UART without FIFO")]
    NoFifo,
    /// Time does not run backwards.
    #[error("a span of time is negative: give 0 or more")]
    Negative,
    /// It would be sent without end.
    #[error("a code repeated after no time would never stop: give more than 0, or leave it out")]
    Repeat,
    /// Data would never be asked for.
    #[error(
        "the remote buffer asks for data over {space} free characters and has only {buffer}: give less"
    )]
    Space {
        /// Nb.
        space: usize,
        /// Characters of buffer.
        buffer: usize,
    },
    /// Each hold has its place in the program.
    #[error("the feed holds must stand in the order of their blocks, one at each")]
    FeedHolds,
    /// Each damaged character has its place.
    #[error("the damaged characters must stand in the order of their places, one at each")]
    Damage,
    /// The operator does one thing after the other.
    #[error("what the operator does must stand in the order of time")]
    Panel,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contradictions_are_refused() {
        use OptionsError as E;

        assert_eq!(Options::default().check(), Ok(()));
        let bad = |change: fn(&mut Options)| {
            let mut options = Options::default();
            change(&mut options);
            options.check().unwrap_err()
        };
        let marks = |reserve, resume| E::Marks { reserve, resume, buffer: 512 };
        assert_eq!(bad(|o| o.reserve = 11), marks(11, 256));
        assert_eq!(bad(|o| o.reserve = 257), marks(257, 256));
        assert_eq!(bad(|o| o.resume = 513), marks(64, 513));
        assert_eq!(bad(|o| o.code = Code::Eia), E::DataBits(7));
        assert_eq!(bad(|o| o.parity = Parity::Software), E::DataBits(7));
        assert_eq!(bad(|o| o.receive_fifo = 0), E::NoFifo);
        assert_eq!(bad(|o| o.final_dc3 = Some(Micros(-1))), E::Negative);
        assert_eq!(bad(|o| o.repeat_dc1 = Some(Micros::ZERO)), E::Repeat);
        let space = E::Space { space: 1_024, buffer: 512 };
        assert_eq!(bad(|o| o.interface = Interface::RemoteA), space);
        let hold = FeedHold { after: 3, span: Micros(1) };
        let held = Feeding::Drip { cycle_start: 0, feed_holds: vec![hold, hold] };
        let options = Options { feeding: held, ..Options::default() };
        assert_eq!(options.check(), Err(E::FeedHolds));
        let parity = LineErrorKind::Parity;
        let punch = PunchOptions { damage: vec![(4, parity), (2, parity)], ..Default::default() };
        assert_eq!(Options { punch, ..Options::default() }.check(), Err(E::Damage));
        let panel = vec![(Micros(2), Press::Read), (Micros(1), Press::Reset)];
        assert_eq!(Options { panel, ..Options::default() }.check(), Err(E::Panel));
    }
}
