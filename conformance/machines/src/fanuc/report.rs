//! What a simulated FANUC control saw: the text, the alarms, the holds.

use softplug_abi::Micros;

use crate::kept::{Counts, Received};

/// A control's account of all that it did.
///
/// ```
/// use softplug_abi::Micros;
/// use softplug_machines::fanuc::{
///     Control, Feeding, Options, Press, Starvation, seven_even_two,
/// };
///
/// // Two blocks of 100 ms each, and then nothing for half a second.
/// let mut control = Control::new(Options {
///     line: seven_even_two(0),
///     block_time: Micros::from_millis(100),
///     feeding: Feeding::Drip { cycle_start: 20, feed_holds: Vec::new() },
///     ..Options::default()
/// })?;
/// control.press(Micros::ZERO, Press::Read);
/// for byte in b"%\nG1X12.345\nG1X12.345\n" {
///     control.receive(Micros::from_secs(1), *byte);
/// }
/// control.advance(Micros::from_millis(1_700));
/// let report = control.report();
/// let (at, span) = (Micros::from_millis(1_200), Micros::from_millis(500));
/// assert_eq!(report.starvations, [Starvation { at, block: 2, span }]);
/// assert_eq!((report.blocks, report.starved, report.starved_for), (2, 1, span));
/// # Ok::<(), softplug_machines::fanuc::OptionsError>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Report {
    /// The text that was read: what follows the first end of block up to the
    /// closing `%`, as ASCII with LF, of all readings one after the other.
    pub received: Received,
    /// Characters that arrived while the reader was open or held.
    pub arrived: u64,
    /// Characters that arrived in a reading before DC1 had left: they are lost.
    pub before_dc1: u64,
    /// Characters that arrived while the control was neither reading nor
    /// punching, for instance after the closing `%`: they mean nothing.
    pub ignored: u64,
    /// Readings that came to their closing `%` (protocol A: and to EOD).
    pub programs: u32,
    /// Blocks that were stored or executed.
    pub blocks: u64,
    /// What the control complained of.
    pub alarms: Vec<Alarm>,
    /// How often DC3 held the host in mid-program.
    pub holds: u32,
    /// How long it was held, from the last bit of DC3 to that of DC1.
    pub held: Micros,
    /// For each hold, the characters that ended after DC3 had left.
    pub characters_after_dc3: Counts,
    /// How often execution waited for a block on an open line.
    pub starved: u32,
    /// How long it waited then; time in which the host was held is left out.
    pub starved_for: Micros,
    /// The first hundred of these moments.
    pub starvations: Vec<Starvation>,
    /// The most characters that stood in the buffer.
    pub largest_level: usize,
    /// DC1s that have left, repetitions included.
    pub dc1s: u32,
    /// DC3s that have left, final ones included.
    pub dc3s: u32,
    /// Punches whose last character has left.
    pub punches: u32,
    /// Characters of punches that have left, DC2 and DC4 included.
    pub punched: u64,
    /// For each stop by the host's DC3, the characters that still left.
    pub punched_after_dc3: Counts,
    /// For each drop of CS, the characters that still left.
    pub punched_after_cs: Counts,
    /// Protocol A.
    pub remote: RemoteReport,
    /// The largest lateness of the control itself: how long after an event was
    /// due it was handled. Zero in virtual time.
    pub late: Micros,
}

/// The remote buffer's account of protocol A.
///
/// ```
/// use softplug_abi::Micros;
/// use softplug_machines::fanuc::{
///     Control, Interface, Options, Press, eight_none_two,
/// };
///
/// // A host that never answers.
/// let (interface, line) = (Interface::RemoteA, eight_none_two(9_600));
/// let mut control =
///     Control::new(Options { interface, line, buffer: 4_096, ..Options::default() })?;
/// control.press(Micros::ZERO, Press::Read);
/// control.advance(Micros::from_secs(20));
/// let remote = control.report().remote;
/// assert!(remote.sent > 0 && remote.silences > 0);
/// assert_eq!(remote.received, 0);
/// # Ok::<(), softplug_machines::fanuc::OptionsError>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct RemoteReport {
    /// Messages that have left, repetitions included.
    pub sent: u32,
    /// Sound messages that came.
    pub received: u32,
    /// DATs among them that were taken.
    pub data: u32,
    /// WATs among them.
    pub waits: u32,
    /// RTYs that the control sent.
    pub retries_asked: u32,
    /// RTYs that came.
    pub retries_heard: u32,
    /// Resets and alarms that the host has acknowledged.
    pub acknowledged: u32,
    /// Messages that came after longer than Tp, or not at all.
    pub silences: u32,
    /// What the host did against the protocol, in words.
    pub faults: Vec<String>,
}

/// The control complains.
///
/// ```
/// use softplug_abi::Micros;
/// use softplug_machines::fanuc::{Alarm, Control, Options, Press, seven_even_two};
///
/// let mut control = Control::new(Options { line: seven_even_two(0), ..Options::default() })?;
/// control.press(Micros::ZERO, Press::Read);
/// for byte in b"%\nO1" {
///     control.receive(Micros(1_000), *byte);
/// }
/// control.receive_damaged(Micros(2_000));
/// let Alarm { at, position, kind, .. } = control.report().alarms[0];
/// assert_eq!((at, position, kind.number()), (Micros(2_000), 5, 85));
/// # Ok::<(), softplug_machines::fanuc::OptionsError>(())
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Alarm {
    /// When.
    pub at: Micros,
    /// Characters that had arrived in this reading, this one included, or had
    /// left in this punch.
    pub position: u64,
    /// Why.
    pub kind: AlarmKind,
    /// The control's own largest lateness up to then: an alarm in real time
    /// proves nothing against the host when this is large.
    pub late: Micros,
}

/// Why a control complains.
///
/// ```
/// use softplug_machines::fanuc::AlarmKind;
///
/// assert_eq!(AlarmKind::BufferOverflow.number(), 87);
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum AlarmKind {
    /// 001: a character's parity, or one that the control does not know.
    Th,
    /// 002: an odd number of characters in a block.
    Tv,
    /// 085: overrun, parity or framing in the UART.
    LineError,
    /// 086: DR went off in a transfer.
    NotReady,
    /// 087: more characters after DC3 than are tolerated, or than fit.
    BufferOverflow,
}

impl AlarmKind {
    /// The number that the control shows.
    pub const fn number(self) -> u16 {
        match self {
            Self::Th => 1,
            Self::Tv => 2,
            Self::LineError => 85,
            Self::NotReady => 86,
            Self::BufferOverflow => 87,
        }
    }
}

/// Execution had to wait for a block.
///
/// The example of [`Report`] shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Starvation {
    /// When it began.
    pub at: Micros,
    /// Blocks executed before.
    pub block: u64,
    /// How long the host was free to send and did not.
    pub span: Micros,
}
