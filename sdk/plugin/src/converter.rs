//! What the author of a plug-in implements.

use crate::{
    Context, Failure, JobId, LineErrorKind, LineParameters, LinkDownReason, MarkId, MarkState,
    Micros, ModemLines, PartEvent, Pass, RequestId, SettingSet, StateError, StateReader,
    StateWriter, Values,
};

/// The link at its opening.
///
/// ```
/// use softplug_plugin::{LineParameters, Opening};
///
/// let opening =
///     Opening { resumed: false, line: LineParameters::new(9_600), delivery_room: 16_384 };
/// assert_eq!(opening.line.characters(960).to_string(), "1.000000");
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Opening {
    /// The converter was restored: it goes on where it was, and sets its timers
    /// again.
    pub resumed: bool,
    /// The characters on the line.
    pub line: LineParameters,
    /// The whole room for deliveries in bytes.
    pub delivery_room: u32,
}

/// A job at its beginning.
///
/// ```
/// use softplug_plugin::{JobId, JobStart, Pass, Values};
///
/// let start =
///     JobStart { job: JobId(1), kind: 0, pass: Pass::Run, size: Some(40_000), fields: Values::new(&[]) };
/// assert_eq!(start.fields.find(0), None);
/// ```
#[derive(Clone, Debug)]
pub struct JobStart<'a> {
    /// Its id, for all that concerns it.
    pub job: JobId,
    /// Place of its kind in the manifest.
    pub kind: u16,
    /// Check the data only, or carry the job out.
    pub pass: Pass,
    /// Bytes of data, if known.
    pub size: Option<u64>,
    /// The job's fields.
    pub fields: Values<'a>,
}

/// A protocol converter: one method for each event. What it does not implement
/// is ignored, but for jobs, which fail as not supported.
///
/// All calls of one instance come one after the other, with a time that never
/// goes back ([`Context::now`]).
///
/// ```
/// use softplug_plugin::bench::Bench;
/// use softplug_plugin::{Context, Converter, Micros, StateError, StateReader, StateWriter};
///
/// /// Answers each line with ACK, and half a second of silence within one with NAK.
/// #[derive(Default)]
/// struct Lines {
///     in_line: bool,
/// }
///
/// const SILENCE: u8 = 0;
///
/// impl Converter for Lines {
///     type Settings = ();
///     const MANIFEST: &'static str = r#"{"abi": "1.0", "name": "lines", "version": "1.0.0",
///         "licence": "MIT", "protocol": "lines", "description": "Acknowledges lines.",
///         "state": {"saves": 1, "accepts": [1]}}"#;
///     const STATE_FORMAT: Option<u16> = Some(1);
///
///     fn new((): ()) -> Self {
///         Self::default()
///     }
///
///     fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
///         for byte in bytes {
///             self.in_line = *byte != b'\n';
///             if !self.in_line {
///                 link.transmit(&[0x06]);
///             }
///         }
///         if self.in_line {
///             link.set_timer_after(SILENCE, Micros::from_millis(500));
///         } else {
///             link.cancel_timer(SILENCE);
///         }
///     }
///
///     fn timer(&mut self, link: &mut Context<'_>, _id: u8, _deadline: Micros) {
///         self.in_line = false;
///         link.transmit(&[0x15]);
///     }
///
///     fn save(&self, state: &mut StateWriter<'_>) {
///         state.bool(self.in_line);
///     }
///
///     fn restore(&mut self, _format: u16, state: &mut StateReader<'_>) -> Result<(), StateError> {
///         self.in_line = state.bool();
///         Ok(())
///     }
/// }
///
/// let mut bench = Bench::<Lines>::new().open();
/// bench.receive(b"G1 X10\nG1");
/// bench.run_for_millis(600);
/// assert_eq!(bench.sent(), [0x06, 0x15]);
/// ```
#[allow(unused_variables, reason = "the names are the documentation of what may be ignored")]
pub trait Converter: Sized {
    /// The settings, declared with [`settings!`](crate::settings); `()` without.
    type Settings: SettingSet;
    /// The manifest as JSON; see [`manifest!`](crate::manifest!).
    const MANIFEST: &'static str;
    /// Format of the state that [`save`](Self::save) writes; `None`: it saves nothing.
    const STATE_FORMAT: Option<u16> = None;
    /// Largest state in bytes that can be restored; a plug-in's memory holds as much beside the
    /// converter.
    const STATE_CAPACITY: usize = 4_096;

    /// Looks at the settings before the link opens.
    ///
    /// # Errors
    /// One sentence on what is wrong with them; the link then does not open.
    fn check_settings(settings: &Self::Settings) -> Result<(), &'static str> {
        Ok(())
    }

    /// A converter as at the opening of a link.
    fn new(settings: Self::Settings) -> Self;

    /// The link is open.
    fn opened(&mut self, link: &mut Context<'_>, opening: &Opening) {}
    /// The link closes; the converter is dropped after this.
    fn closed(&mut self, link: &mut Context<'_>) {}
    /// Bytes from the line, all at this time.
    fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {}
    /// A damaged character, an overrun or a break. `span` 0: exactly here; n: one
    /// of the last n bytes.
    fn line_error(
        &mut self,
        link: &mut Context<'_>,
        kind: LineErrorKind,
        byte: Option<u8>,
        span: u32,
    ) {
    }
    /// The modem lines, at the opening and at each change.
    fn modem_lines(&mut self, link: &mut Context<'_>, known: ModemLines, on: ModemLines) {}
    /// The port is gone.
    fn link_down(&mut self, link: &mut Context<'_>, reason: LinkDownReason) {}
    /// The port is back.
    fn link_up(&mut self, link: &mut Context<'_>) {}
    /// A timer has run out.
    fn timer(&mut self, link: &mut Context<'_>, id: u8, deadline: Micros) {}
    /// News of a marked byte.
    fn mark(&mut self, link: &mut Context<'_>, mark: MarkId, state: MarkState) {}
    /// The transmit queue has more room; [`Context::transmit_room`] says how much.
    fn transmit_room(&mut self, link: &mut Context<'_>) {}
    /// A discard dropped so many bytes.
    fn discarded(&mut self, link: &mut Context<'_>, bytes: u32) {}
    /// There is more room for deliveries; [`Context::delivery_room`] says how much.
    fn delivery_room(&mut self, link: &mut Context<'_>) {}
    /// A job begins.
    fn job_begin(&mut self, link: &mut Context<'_>, job: JobStart<'_>) {
        link.job_failed(job.job, Failure::NotSupported, 0, 0);
    }
    /// Data of the job, at most as much as was asked for.
    fn job_data(&mut self, link: &mut Context<'_>, job: JobId, bytes: &[u8]) {}
    /// All data of the job was given.
    fn job_end(&mut self, link: &mut Context<'_>, job: JobId) {}
    /// Pause the job where the protocol allows it.
    fn pause(&mut self, link: &mut Context<'_>, job: JobId) {}
    /// Go on with the job.
    fn resume(&mut self, link: &mut Context<'_>, job: JobId) {}
    /// Abort the job; 0: the delivery under way.
    fn abort(&mut self, link: &mut Context<'_>, job: JobId) {}
    /// Go on although the partner holds the line.
    fn force_resume(&mut self, link: &mut Context<'_>) {}
    /// A piece of the answer to a request, or why it is refused.
    fn answer(
        &mut self,
        link: &mut Context<'_>,
        request: RequestId,
        answer: Result<&[u8], Failure>,
        more: bool,
    ) {
    }
    /// Write what did not fit; called after [`Context::again`], at the same time.
    fn more(&mut self, link: &mut Context<'_>) {}

    /// An event of which [parts](mod@crate::parts) have to hear, before its own method is called:
    /// [`parts!`](crate::parts!) passes it on to each.
    fn parts(&mut self, link: &mut Context<'_>, event: &PartEvent<'_>) {}
    /// An event was handled: the place to go on with what it made possible, and to tell the
    /// state's name. Called after every method above but [`closed`](Self::closed), also where the
    /// method is not implemented.
    fn after(&mut self, link: &mut Context<'_>) {}

    /// Writes the state. Called more than once for one save: it must write the
    /// same each time.
    fn save(&self, state: &mut StateWriter<'_>) {}
    /// Takes a state that was saved in `format`, into a new converter.
    ///
    /// # Errors
    /// The format or the content cannot be taken.
    fn restore(&mut self, format: u16, state: &mut StateReader<'_>) -> Result<(), StateError> {
        Err(StateError::FORMAT)
    }
}
