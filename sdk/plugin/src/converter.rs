//! What the author of a plug-in implements.

use crate::{
    Context, Failure, LineErrorKind, LineParameters, LinkDownReason, MarkState, Micros, ModemLines,
    Pass, SettingSet, StateError, StateReader, StateWriter, Values,
};

/// The link at its opening.
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
#[derive(Clone, Debug)]
pub struct JobStart<'a> {
    /// Its id, for all that concerns it.
    pub job: u32,
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
#[allow(unused_variables, reason = "the names are the documentation of what may be ignored")]
pub trait Converter: Sized {
    /// The settings, declared with [`settings!`](crate::settings); `()` without.
    type Settings: SettingSet;
    /// The manifest as JSON; see [`manifest!`](crate::manifest!).
    const MANIFEST: &'static str;
    /// Format of the state that [`save`](Self::save) writes; `None`: it saves nothing.
    const STATE_FORMAT: Option<u16> = None;

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
    fn mark(&mut self, link: &mut Context<'_>, mark: u32, state: MarkState) {}
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
    fn job_data(&mut self, link: &mut Context<'_>, job: u32, bytes: &[u8]) {}
    /// All data of the job was given.
    fn job_end(&mut self, link: &mut Context<'_>, job: u32) {}
    /// Pause the job where the protocol allows it.
    fn pause(&mut self, link: &mut Context<'_>, job: u32) {}
    /// Go on with the job.
    fn resume(&mut self, link: &mut Context<'_>, job: u32) {}
    /// Abort the job; 0: the delivery under way.
    fn abort(&mut self, link: &mut Context<'_>, job: u32) {}
    /// Go on although the partner holds the line.
    fn force_resume(&mut self, link: &mut Context<'_>) {}
    /// A piece of the answer to a request, or why it is refused.
    fn answer(
        &mut self,
        link: &mut Context<'_>,
        request: u32,
        answer: Result<&[u8], Failure>,
        more: bool,
    ) {
    }
    /// Write what did not fit; called after [`Context::again`], at the same time.
    fn more(&mut self, link: &mut Context<'_>) {}

    /// Writes the state. Called more than once for one save: it must write the
    /// same each time.
    fn save(&self, state: &mut StateWriter<'_>) {}
    /// Takes a state that was saved in `format`, into a new converter.
    ///
    /// # Errors
    /// The format or the content cannot be taken.
    fn restore(&mut self, format: u16, state: &mut StateReader<'_>) -> Result<(), StateError> {
        Err(StateError)
    }
}
