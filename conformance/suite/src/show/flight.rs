//! A flight recording as a trace with a line: what came and what was asked for are in it, what the
//! plug-in sent is not.

use crate::given::case::Case;
use crate::given::lines::{damage, modem_levels};
use softplug_abi::manifest::{Manifest, OwnedValue, Setting};
use softplug_abi::{
    Event, EventKind, Failure, Malformed, MalformedReason, ModemLines, Value, Values,
};
use softplug_trace::{
    self as trace, Assignment, Entry, Exact, Given, HostRequest, Item, Level, Line, LineEvent,
    Payload, Permutations, SourceLine, Time, Trace, What, When, limits,
};

/// A flight recording as lines of a case: settings, `<`, `!` and `?` lines, at their times since
/// the link was opened. What a plug-in does then is to be [taken over](crate::bless).
///
/// ```
/// use softplug_abi::manifest::Manifest;
/// use softplug_conformance::{FlightError, FlightFault, load, record_of_flight};
/// use softplug_native::NativePlugin;
/// use softplug_trace::Trace;
///
/// let manifest = Manifest::parse(NativePlugin::XonXoff.manifest().as_bytes())?;
/// let case = &load(["../../fixtures/traces/xon-xoff/xon-xoff.tx.hold.spt"])?[0];
/// let text = case.trace.format();
/// let (front, _) = text.split_once("---").unwrap();
/// let flight = Trace::parse(&format!("{front}---\n@ 0.0 under-way job=1\n"))?;
/// // One that was kept from the middle on says nothing of what came before.
/// let reason = record_of_flight(&manifest, &case.with_trace(flight)).unwrap_err();
/// let FlightError::Line { line: _, reason } = reason else { panic!("{reason}") };
/// assert!(matches!(reason, FlightFault::BeginsInTheMiddle));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// It does not begin with the link, is for another plug-in, or holds what no case can.
pub fn record_of_flight(manifest: &Manifest, flight: &Case) -> Result<Trace, FlightError> {
    let mut reader = Flight::new(manifest);
    for entry in flight.trace.entries() {
        let What::Given(Given::Exact(exact)) = &entry.what else { continue };
        let line = entry.line.0;
        reader
            .read(entry.when.from, exact, flight)
            .map_err(|reason| FlightError::Line { line, reason })?;
    }
    reader.finish(flight)
}

/// A flight recording that is no record of a session.
///
/// The example of [`record_of_flight`] shows one.
#[derive(Debug, thiserror::Error)]
pub enum FlightError {
    /// A line of it does not fit.
    #[error("line {line}: {reason}")]
    Line {
        /// Its number, from 1.
        line: u32,
        /// Why.
        reason: FlightFault,
    },
    /// Nothing opens the link.
    #[error("the link is never opened in it")]
    NeverOpened,
    /// A request is longer than a line of a trace.
    #[error("what was asked for does not fit a line")]
    TooLong,
}

/// Why a line of a flight recording does not fit.
///
/// The example of [`record_of_flight`] shows one.
#[derive(Debug, thiserror::Error)]
pub enum FlightFault {
    /// It was kept from the middle on.
    #[error("it begins in the middle: what came before is not in it")]
    BeginsInTheMiddle,
    /// The plug-in was swapped.
    #[error("it holds a saved state: what came before is not in it")]
    HoldsState,
    /// The link was open before.
    #[error("the plug-in went on from a saved state: what came before is not in it")]
    GoesOnFromState,
    /// Something happens before the link is opened.
    #[error("\"{0}\" comes before the link is opened")]
    BeforeOpen(&'static str),
    /// The ABI has no event of this name.
    #[error("\"{0}\" is no event of the ABI")]
    UnknownEvent(String),
    /// The event is none.
    #[error("the payload of \"{name}\" is {reason}")]
    Malformed {
        /// The event's name.
        name: String,
        /// What is wrong.
        reason: MalformedReason,
    },
    /// The settings are none.
    #[error("settings: {0}")]
    MalformedSettings(Malformed),
    /// Its bytes are not there.
    #[error("{0}")]
    Payload(#[from] trace::PayloadError),
    /// Settings change while the link is open.
    #[error("settings that change in a session stand in no case")]
    SettingsChange,
    /// The plug-in has no such settings.
    #[error("settings: they are those of another plug-in")]
    OtherSettings,
    /// The plug-in has no such job.
    #[error("the job is one of another plug-in")]
    OtherJob,
}

struct Flight<'a> {
    manifest: &'a Manifest,
    config: Vec<Assignment>,
    opened: Option<Time>,
    modem: Option<(ModemLines, ModemLines)>,
    /// The lines at the start.
    at_start: trace::ModemLevels,
    entries: Vec<Entry>,
    jobs: Vec<Job>,
    /// An answer of which more is to come: where it stands.
    answer: Option<usize>,
    last: Time,
}

/// A job's data: a check reads all of it, and it is read again to be sent.
struct Job {
    id: u32,
    place: usize,
    data: Vec<u8>,
    pass: Vec<u8>,
    is_whole: bool,
}

impl<'a> Flight<'a> {
    fn new(manifest: &'a Manifest) -> Self {
        Self {
            manifest,
            config: Vec::new(),
            opened: None,
            modem: None,
            at_start: trace::ModemLevels::default(),
            entries: Vec::new(),
            jobs: Vec::new(),
            answer: None,
            last: Time::default(),
        }
    }

    fn read(&mut self, at: Time, exact: &Exact, flight: &Case) -> Result<(), FlightFault> {
        let Exact::Event { name, payload } = exact else {
            return Err(FlightFault::BeginsInTheMiddle);
        };
        let kind =
            EventKind::from_name(name).ok_or_else(|| FlightFault::UnknownEvent(name.clone()))?;
        let payload = payload.bytes(&flight.files())?;
        let event = Event::decode(kind, &payload)
            .map_err(|reason| FlightFault::Malformed { name: name.clone(), reason })?;
        self.take(at, &event)
    }

    fn take(&mut self, at: Time, event: &Event<'_>) -> Result<(), FlightFault> {
        if let Event::Settings { values, .. } = event {
            return self.settings(values.clone());
        }
        if let Event::Open { resumed, .. } = event {
            if *resumed {
                return Err(FlightFault::GoesOnFromState);
            }
            if self.opened.is_none() {
                self.opened = Some(at);
                return Ok(());
            }
        }
        let Some(opened) = self.opened else {
            return Err(FlightFault::BeforeOpen(event.kind().name()));
        };
        let at = Time(at.0.saturating_sub(opened.0));
        self.last = self.last.max(at);
        let given = match event {
            Event::Received(bytes) => Given::Receive(Payload::from_bytes(bytes)),
            Event::LineError { kind, byte, span } => match (damage(*kind), byte, span) {
                (Some(kind), Some(byte), 0) => {
                    Given::Receive(Payload::new([Item::Bad { kind, byte: *byte }]))
                }
                _ => Given::Line(LineEvent::Error { kind: *kind, byte: *byte, span: *span }),
            },
            Event::ModemLines { known, on } => {
                self.modem_lines(at, *known, *on);
                return Ok(());
            }
            Event::LinkDown(reason) => Given::Line(LineEvent::Down(*reason)),
            Event::LinkUp => Given::Line(LineEvent::Up),
            Event::JobBegin { job, kind, fields, .. } => return self.job(at, job.0, *kind, fields),
            Event::JobData { job, bytes } => {
                if let Some(job) = self.jobs.iter_mut().find(|known| known.id == job.0) {
                    job.pass.extend_from_slice(bytes);
                }
                return Ok(());
            }
            Event::JobEnd { job } => {
                if let Some(job) = self.jobs.iter_mut().find(|known| known.id == job.0) {
                    job.is_whole = true;
                }
                return Ok(());
            }
            Event::Pause { job } => Given::Host(HostRequest::Pause(job.0)),
            Event::Resume { job } => Given::Host(HostRequest::Resume(job.0)),
            Event::Abort { job } => Given::Host(HostRequest::Abort(job.0)),
            Event::ForceResume => Given::Host(HostRequest::ForceResume),
            Event::Answer { request, refused, more, bytes } => {
                return self.answer(at, request.0, *refused, *more, bytes);
            }
            Event::Open { .. } => Given::Host(HostRequest::Open),
            Event::Close => Given::Host(HostRequest::Close),
            Event::Restore { .. } => return Err(FlightFault::HoldsState),
            // These come of themselves.
            Event::Settings { .. }
            | Event::Timer { .. }
            | Event::Mark { .. }
            | Event::TransmitRoom { .. }
            | Event::Discarded { .. }
            | Event::DeliveryRoom { .. }
            | Event::Save
            | Event::Continue => return Ok(()),
        };
        self.add(at, given);
        Ok(())
    }

    fn add(&mut self, at: Time, given: Given) {
        let what = What::Given(given);
        self.entries.push(Entry { when: When::at(at), what, line: SourceLine::default() });
    }

    fn settings(&mut self, values: Values<'_>) -> Result<(), FlightFault> {
        if self.opened.is_some() {
            return Err(FlightFault::SettingsChange);
        }
        for record in values {
            let (place, value) = record.map_err(FlightFault::MalformedSettings)?;
            let known = self.manifest.settings.get(usize::from(place));
            let known = known.ok_or(FlightFault::OtherSettings)?;
            let default = known.value_from_json(&known.default).ok();
            let value = text(known, value);
            if known.value_from_text(&value).is_err() {
                return Err(FlightFault::OtherSettings);
            }
            if default.is_none_or(|default| owned(known, &default) != value) {
                self.config.push(Assignment { name: known.name.clone(), value });
            }
        }
        Ok(())
    }

    fn modem_lines(&mut self, at: Time, known: ModemLines, on: ModemLines) {
        let changed = match self.modem.replace((known, on)) {
            None if self.entries.is_empty() => {
                self.at_start = modem_levels(known, on);
                return;
            }
            None => known,
            Some((_, before)) => ModemLines((before.0 ^ on.0) & known.0),
        };
        let levels = modem_levels(changed, on);
        if !levels.0.is_empty() {
            self.add(at, Given::Line(LineEvent::Modem(levels)));
        }
    }

    fn job(
        &mut self,
        at: Time,
        id: u32,
        kind: u16,
        fields: &Values<'_>,
    ) -> Result<(), FlightFault> {
        if let Some(job) = self.jobs.iter_mut().find(|job| job.id == id) {
            job.end_pass();
            return Ok(());
        }
        let kind = self.manifest.jobs.get(usize::from(kind));
        let kind = kind.ok_or(FlightFault::OtherJob)?;
        let named = kind.assignments(fields.as_bytes()).into_iter();
        let fields = named.map(|(name, value)| Assignment { name, value }).collect();
        let (data, place) = (Payload::default(), self.entries.len());
        let request = HostRequest::Job { id, kind: kind.name.clone(), fields, data };
        self.add(at, Given::Host(request));
        let (data, pass) = (Vec::new(), Vec::new());
        self.jobs.push(Job { id, place, data, pass, is_whole: false });
        Ok(())
    }

    fn answer(
        &mut self,
        at: Time,
        id: u32,
        refused: Option<Failure>,
        more: bool,
        bytes: &[u8],
    ) -> Result<(), FlightFault> {
        let place = self.answer.take().unwrap_or_else(|| {
            let data = Payload::default();
            self.add(at, Given::Host(HostRequest::Grant { id, data }));
            self.entries.len() - 1
        });
        if let What::Given(Given::Host(request)) = &mut self.entries[place].what {
            if let Some(failure) = refused {
                *request = HostRequest::Refuse { id, failure };
            } else if let HostRequest::Grant { data, .. } = request {
                let mut all = data.bytes(&trace::NoFiles)?;
                all.extend_from_slice(bytes);
                *data = Payload::from_bytes(&all);
            }
        }
        self.answer = more.then_some(place);
        Ok(())
    }

    fn finish(mut self, flight: &Case) -> Result<Trace, FlightError> {
        if self.opened.is_none() {
            return Err(FlightError::NeverOpened);
        }
        let mut body: Vec<Line> = flight
            .trace
            .body
            .iter()
            .take_while(|line| matches!(line, Line::Comment(_)))
            .cloned()
            .collect();
        for job in &mut self.jobs {
            job.end_pass();
            let id = job.id;
            if !job.is_whole {
                let read = job.data.len();
                let text =
                    format!(" Of job {id} the plug-in had read {read} bytes, and perhaps not all.");
                body.push(Line::Comment(text));
            }
            if let What::Given(Given::Host(HostRequest::Job { data, .. })) =
                &mut self.entries[job.place].what
            {
                *data = Payload::from_bytes(&job.data);
            }
        }
        if self.entries.iter().any(|entry| entry.to_string().len() > limits::LINE_BYTES) {
            return Err(FlightError::TooLong);
        }
        body.extend(self.entries.into_iter().map(Line::Entry));
        let when = When::at(self.last);
        let quiet = Entry { when, what: What::Quiet, line: SourceLine::default() };
        body.push(Line::Entry(quiet));
        let mut front = flight.trace.front.clone();
        front.level = Level::May;
        front.permute = Permutations::default();
        (front.config, front.modem) = (self.config, self.at_start);
        Ok(Trace { front, body })
    }
}

impl Job {
    /// The data is what the longest pass has read.
    fn end_pass(&mut self) {
        let pass = std::mem::take(&mut self.pass);
        if pass.len() > self.data.len() {
            self.data = pass;
        }
    }
}

fn text(setting: &Setting, value: Value<'_>) -> String {
    match value {
        Value::Bool(value) => if value { "on" } else { "off" }.to_owned(),
        Value::Int(value) => value.to_string(),
        Value::Text(text) => text.to_owned(),
        Value::Bytes(bytes) => {
            bytes.iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>().join(" ")
        }
        Value::Choice(place) => {
            let choice = setting.choices.get(usize::from(place));
            choice.cloned().unwrap_or_else(|| place.to_string())
        }
    }
}

fn owned(setting: &Setting, value: &OwnedValue) -> String {
    text(setting, value.as_value())
}
