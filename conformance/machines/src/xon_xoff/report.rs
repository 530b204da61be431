//! What a simulated control saw: the bytes, the alarms, the holds.

use softplug_abi::Micros;

use crate::kept::{Counts, Received};

/// A control's account of a transfer.
///
/// ```
/// use softplug_abi::Micros;
/// use softplug_machines::xon_xoff::{Alarm, AlarmKind, Control, ControlOptions};
///
/// // 8 bytes of buffer, and nothing is executed for a second: the ninth byte is lost.
/// let pauses = vec![(0, Micros::from_secs(1))];
/// let options = ControlOptions { buffer: 8, low: 4, high: 6, pauses, ..Default::default() };
/// let mut control = Control::new(options)?;
/// for n in 1..=9 {
///     control.receive(Micros(n * 1_042), b'G');
/// }
/// let report = control.report();
/// assert_eq!((report.arrived, report.received.count(), report.holds), (9, 8, 1));
/// let Alarm { at, position, kind, .. } = report.alarms[0];
/// assert_eq!((at, position, kind), (Micros(9_378), 8, AlarmKind::BufferOverflow));
/// # Ok::<(), softplug_machines::xon_xoff::ControlOptionsError>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct ControlReport {
    /// The data that reached the buffer, executed or not.
    pub received: Received,
    /// Bytes of data that arrived on the line, lost ones included.
    pub arrived: u64,
    /// Bytes that the program's execution took out of the buffer.
    pub consumed: u64,
    /// Every lost byte.
    pub alarms: Vec<Alarm>,
    /// How often the line was held: repeated XOFFs count once.
    pub holds: u32,
    /// How long the line was held, from the last bit of XOFF to that of XON.
    pub held: Micros,
    /// For each hold, the characters that ended after XOFF had left.
    pub characters_after_xoff: Counts,
    /// Time from the start of the first byte of data to the end of the last,
    /// without that in which the line was held.
    pub allowed: Micros,
    /// How often the buffer ran empty in mid-program on an open line. Always 0
    /// where the rate of execution is 0: an empty buffer is then the rule.
    pub starved: u32,
    /// How long it was empty then.
    pub starved_for: Micros,
    /// The most bytes that stood in the buffer.
    pub largest_level: usize,
    /// The largest lateness of the control itself: how long after an event was
    /// due it was handled. Zero in virtual time.
    pub late: Micros,
    /// XONs that have left.
    pub xons: u32,
    /// XOFFs that have left.
    pub xoffs: u32,
    /// Bytes of its own program, or of its echo, that have left.
    pub punched: u64,
    /// Bytes of it that have not.
    pub punch_waiting: u64,
    /// For each time the other side stopped the control, the characters that
    /// still left.
    pub punched_after_xoff: Counts,
}

impl ControlReport {
    /// Bytes of data per second of the time in which sending was allowed; those
    /// that ended after XOFF are left out.
    pub fn rate_while_allowed(&self) -> f64 {
        if self.allowed <= Micros::ZERO {
            return 0.0;
        }
        let late: u64 = self.characters_after_xoff.0.iter().copied().map(u64::from).sum();
        self.arrived.saturating_sub(late) as f64 / self.allowed.as_secs_f64()
    }
}

/// A byte was lost in the control: its alarm.
///
/// The example of [`ControlReport`] shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Alarm {
    /// When.
    pub at: Micros,
    /// Which byte of the data, from 0.
    pub position: u64,
    /// Where it was lost.
    pub kind: AlarmKind,
    /// The control's own largest lateness up to then: an alarm in real time
    /// proves nothing against the sender when this is large.
    pub late: Micros,
}

/// Where a byte was lost.
///
/// The example of [`ControlReport`] shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum AlarmKind {
    /// The receive buffer was full: the sender did not stop in time.
    BufferOverflow,
    /// The receive FIFO was full: the control reacts too slowly for the line.
    Overrun,
}
