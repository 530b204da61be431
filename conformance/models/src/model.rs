//! What a model is: it is told what a plug-in is given and what it does, and
//! says what breaks its protocol.

use crate::dice::Dice;
use crate::settings::Settings;
use softplug_abi::manifest::Manifest;
use softplug_abi::{
    Failure, LineErrorKind, LineParameters, LinkDownReason, Micros, ModemLines, Parity,
};
use softplug_link::Observed;

/// An executable specification of one profile: slow and obvious.
///
/// Time never runs backwards. At each instant the calls come in the order of the
/// ABI: what comes from the line ([`line`](Self::line)), characters of ours that
/// begin or end by themselves ([`seen`](Self::seen), [`left`](Self::left)),
/// [`due`](Self::due), requests of the host ([`host`](Self::host)), and at last
/// [`settled`](Self::settled). What the plug-in does in answer to one of these comes
/// through `seen` before the next of them.
pub trait Model: Send {
    /// Something came from the line, or happened to it.
    fn line(&mut self, at: Micros, input: &LineInput);

    /// The last bit of a character of ours has left. It comes behind line input of
    /// the same instant.
    fn left(&mut self, at: Micros, byte: u8);

    /// Timers of this instant and before are due now: what came from the line up to
    /// here was in time, what the host asks from here on finds them run out.
    fn due(&mut self, at: Micros);

    /// The host asked for something.
    fn host(&mut self, at: Micros, request: &HostRequest);

    /// The plug-in did something.
    ///
    /// # Errors
    /// It may not do that now.
    fn seen(&mut self, at: Micros, effect: &Effect) -> Result<(), Broken>;

    /// Nothing more happens at this instant.
    ///
    /// # Errors
    /// Something had to happen by now and did not.
    fn settled(&mut self, at: Micros) -> Result<(), Broken>;

    /// When something is due next: the model is called at that instant.
    fn next(&self) -> Option<Micros>;

    /// What a partner and a host could do next: mostly what makes sense in this
    /// state, now and then what is rare.
    fn propose(&self, now: Micros, dice: &mut Dice) -> Proposal;

    /// A second one in the same state.
    fn fork(&self) -> Box<dyn Model>;

    /// Whether that with which a long session is filled goes on.
    fn is_filled(&self) -> bool {
        false
    }
}

/// What comes from the line.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum LineInput {
    /// Characters that have come by now, in one event.
    Bytes(Vec<u8>),
    /// A damaged character, lost ones, with the one that came behind them or without, or a
    /// break (without a byte).
    Damaged {
        /// What the port says of it.
        kind: LineErrorKind,
        /// The character as it was read.
        byte: Option<u8>,
        /// 0: exactly here; n: it is one of the last n characters, which were given already.
        span: u32,
    },
    /// Inputs of our port change: which, and those of them that are on.
    ModemLines(ModemLines, ModemLines),
    /// The port is gone.
    Down(LinkDownReason),
    /// The port is back.
    Up,
}

/// What the host does.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum HostRequest {
    /// The link is opened. The first thing of each session.
    Open,
    /// The link is closed; it may be opened again.
    Close,
    /// A job begins.
    Job {
        /// Its id: 1, 2, 3 …, never used twice on a link.
        id: u32,
        /// Name of its kind, as in the manifest.
        kind: String,
        /// Its fields by name, as text.
        fields: Vec<(String, String)>,
        /// All its data.
        data: Vec<u8>,
    },
    /// The job is paused.
    Pause(u32),
    /// The pause ends.
    Resume(u32),
    /// The job is aborted; with 0 the delivery under way.
    Abort(u32),
    /// A hold by the partner is overridden.
    ForceResume,
    /// From here on the host puts nothing of what is delivered away by itself.
    Keep,
    /// The host puts so many bytes away.
    PutAway(u32),
    /// The host puts everything away at once again.
    PutAllAway,
    /// A request of the plug-in is answered: data, or a failure.
    Answer(u32, Result<Vec<u8>, Failure>),
}

/// What a plug-in does that can be seen from outside, in the words of a protocol's page:
/// a model knows no manifest, and so none of the numbers by which it calls requests and fields.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Effect {
    /// The start bit of a character.
    Byte(u8),
    /// A break of so many µs begins.
    Break(u32),
    /// Outputs of our port are set: which, and those of them that are on.
    ModemLines(ModemLines, ModemLines),
    /// A delivery has ended.
    Delivered {
        /// The plug-in's id for it.
        id: u32,
        /// All its bytes.
        bytes: Vec<u8>,
        /// The name that was found.
        name: Option<String>,
        /// `None`: complete.
        failure: Option<Failure>,
        /// The protocol's own code.
        status: u16,
    },
    /// A job is done, or its check pass found it good: see `Checked`.
    Done {
        /// The job.
        job: u32,
        /// Bytes that left for it.
        sent: u64,
    },
    /// A job has failed.
    Failed {
        /// The job.
        job: u32,
        /// Why.
        failure: Failure,
        /// The protocol's own code.
        status: u16,
        /// Bytes that left for it.
        sent: u64,
    },
    /// The check pass of a job has ended: plug-ins whose manifest needs one are
    /// given the data twice. A job that it refused has ended.
    Checked {
        /// The job.
        job: u32,
        /// `None`: good.
        failure: Option<Failure>,
        /// The protocol's own code.
        status: u16,
        /// Line of the fault, from 1; 0 without.
        line: u32,
        /// Column of the fault, from 1; 0 without.
        column: u32,
    },
    /// The plug-in asks the host for something.
    Requested {
        /// The request's id.
        id: u32,
        /// Name of its kind, as in the manifest.
        kind: String,
        /// Its fields by name, as text.
        fields: Vec<(String, String)>,
    },
    /// It withdraws a request.
    Withdrawn(u32),
}

impl Effect {
    /// As a model sees it; notes, state names and what the link does itself are not seen.
    ///
    /// ```
    /// use softplug_abi::manifest::Manifest;
    /// use softplug_link::Observed;
    /// use softplug_models::Effect;
    /// use softplug_native::NativePlugin;
    ///
    /// let manifest = Manifest::parse(NativePlugin::XonXoff.manifest().as_bytes())?;
    /// assert_eq!(Effect::of(&Observed::Byte(0x13), &manifest), Some(Effect::Byte(0x13)));
    /// assert_eq!(Effect::of(&Observed::Hold, &manifest), None);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn of(observed: &Observed, manifest: &Manifest) -> Option<Self> {
        Some(match observed {
            Observed::Byte(byte) => Self::Byte(*byte),
            Observed::Break(micros) => Self::Break(*micros),
            Observed::ModemLines(mask, on) => Self::ModemLines(*mask, *on),
            Observed::Delivery(delivery) => Self::Delivered {
                id: delivery.id.0,
                bytes: delivery.bytes.clone(),
                name: delivery.name.clone(),
                failure: delivery.failure,
                status: delivery.status,
            },
            Observed::Done { job, sent } => Self::Done { job: job.0, sent: *sent },
            Observed::Failed { job, failure, status, sent } => {
                Self::Failed { job: job.0, failure: *failure, status: *status, sent: *sent }
            }
            Observed::Checked { job, failure, status, line, column } => {
                let (job, failure, status) = (job.0, *failure, *status);
                Self::Checked { job, failure, status, line: *line, column: *column }
            }
            Observed::Request { request, kind, fields } => {
                let kind = manifest.requests.get(usize::from(*kind));
                let named = kind.map(|kind| kind.assignments(fields)).unwrap_or_default();
                let kind = kind.map(|kind| kind.name.clone()).unwrap_or_default();
                Self::Requested { id: request.0, kind, fields: named }
            }
            Observed::Withdraw(request) => Self::Withdrawn(request.0),
            Observed::Hold | Observed::Release | Observed::Note(..) | Observed::State(_) => {
                return None;
            }
        })
    }
}

/// A rule of a profile that a plug-in has broken.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Broken {
    /// The clause of the ledger.
    pub clause: &'static str,
    /// What had to be, and what was.
    pub message: String,
}

impl Broken {
    /// A clause and what happened.
    pub fn new(clause: &'static str, message: impl Into<String>) -> Self {
        Self { clause, message: message.into() }
    }
}

/// What comes next in a random session.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Proposal {
    /// After so many µs.
    pub wait: Micros,
    /// What is given then.
    pub given: Given,
}

/// What a plug-in is given.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Given {
    /// From the line.
    Line(LineInput),
    /// By the host.
    Host(HostRequest),
    /// Time goes by.
    Nothing,
}

/// What a session begins with.
#[derive(Clone, Debug)]
pub struct Conditions {
    /// The characters on the line.
    pub line: LineParameters,
    /// Characters that the port holds, the one on the wire included.
    pub depth: usize,
    /// Bytes that the transmit queue takes.
    pub transmit_room: u32,
    /// Bytes of deliveries that the host takes before it has to put them away.
    pub delivery_room: u32,
    /// Modem lines of the port and those that are on; `None`: it has none.
    pub modem_lines: Option<(ModemLines, ModemLines)>,
    /// A value for each setting of the plug-in.
    pub settings: Settings,
    /// What the link's clock shows as the session begins. Only the plug-in sees it.
    pub clock: Micros,
    /// Bytes of a job that the host has ready at a time, at one instant.
    pub pieces: usize,
    /// Whether the host knows a job's size as it begins.
    pub has_sizes: bool,
    /// The link's id of the job that is 0 here: ids need not be small. Only the plug-in sees it.
    pub job_base: u32,
    /// The settings are those of a preset: its timers and counts are brought to their ends.
    pub is_preset: bool,
    /// A long session brings jobs or deliveries by the thousand, or one of megabytes; this is its
    /// number among the long ones.
    pub long: Option<u64>,
    /// The session is about nothing in particular: all that a line brings.
    pub is_usual: bool,
}

/// A line, for tables of them.
pub(crate) const fn line(
    baud: u32,
    data_bits: u8,
    parity: Parity,
    stop_half_bits: u8,
) -> LineParameters {
    LineParameters { baud, data_bits, parity, stop_half_bits }
}

/// A preset's name, and the settings that it sets.
pub type Preset = (&'static str, &'static [(&'static str, &'static str)]);

/// A profile and its model.
#[derive(Copy, Clone, Debug)]
pub struct Profile {
    /// Its name.
    pub name: &'static str,
    /// Clauses of its ledger that the model judges.
    pub clauses: &'static [&'static str],
    /// Values of settings that are worth trying, as text; the first of each is
    /// tried most.
    pub values: &'static [(&'static str, &'static [&'static str])],
    /// Presets, and the settings that the profile's page says they set, as text.
    pub presets: &'static [Preset],
    /// Line parameters that are worth trying: baud rates and formats.
    pub lines: &'static [LineParameters],
    /// Room for deliveries, in bytes, that is worth trying besides what any profile has.
    pub rooms: &'static [u32],
    /// Modem lines that are worth trying.
    pub modem_lines: &'static [Option<(ModemLines, ModemLines)>],
    /// Bytes that mean something in the protocol.
    pub special: &'static [u8],
    /// The model, or `None` where the profile refuses these settings.
    pub start: fn(&Conditions) -> Option<Box<dyn Model>>,
}
