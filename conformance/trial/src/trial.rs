//! A job in virtual time, with a partner that wants it.

use std::error::Error;
use std::io::{Read, Seek};

use softplug_abi::manifest::{Manifest, SettingValues};
use softplug_abi::{Failure, Instance, LineParameters, Micros, NoteLevel};
use softplug_link::{Job, LinkFault, LinkOptions};
use softplug_machines::pulse_lathe::Lathe;

use crate::budget::{Budget, Metered, MeteredFault};
use crate::closed_loop::ClosedLoop;
use crate::error::TrialError;
use crate::exchange::{Exchange, Side};
use crate::paper::Paper;
use crate::willing::Willing;

pub(crate) const JOB: u32 = 1;
/// A plug-in that sends nothing for so long waits for a partner that is not there.
const PATIENCE: Micros = Micros::from_secs(3_600);

/// What is tried, but for the program.
#[derive(Copy, Clone, Debug)]
pub struct Setup<'a> {
    /// What the plug-in says of itself.
    pub manifest: &'a Manifest,
    /// A value for each of its settings.
    pub settings: &'a SettingValues,
    /// The line. Its rate is not 0.
    pub line: LineParameters,
    /// Characters that the port holds ahead of the wire, at most; 1 or more.
    pub depth: u32,
    /// The kind of job, by its place in the manifest.
    pub job_kind: u16,
    /// The job's fields as value records.
    pub records: &'a [u8],
    /// The same fields as texts, each with its name.
    pub fields: &'a [(&'a str, &'a str)],
}

impl<'a> Setup<'a> {
    /// The manifest's first kind of job without fields, on a port that holds one character.
    pub fn new(manifest: &'a Manifest, settings: &'a SettingValues, line: LineParameters) -> Self {
        Self { manifest, settings, line, depth: 1, job_kind: 0, records: &[], fields: &[] }
    }

    /// The fields as value records, but for those that say where in the program to begin: they
    /// belong to the program as a whole.
    pub(crate) fn records_from_its_start(&self) -> Vec<u8> {
        let fields = self.fields.iter().copied().filter(|(name, _)| !is_beginning(name));
        let kind = self.manifest.jobs.get(usize::from(self.job_kind));
        let records = kind.and_then(|kind| kind.records(fields).ok());
        records.unwrap_or_else(|| self.records.to_vec())
    }

    pub(crate) fn field(&self, name: &str) -> Option<&'a str> {
        self.fields.iter().find(|(known, _)| *known == name).map(|(_, value)| *value)
    }
}

/// Whether a field of a job says where in its program it begins, as `from_block` does.
///
/// ```
/// assert!(softplug_trial::is_beginning("from_sequence"));
/// assert!(!softplug_trial::is_beginning("preamble"));
/// ```
pub fn is_beginning(field: &str) -> bool {
    field.starts_with("from_")
}

/// A plug-in on its line with a partner that wants what it sends. It makes a new instance for each
/// run; nothing else is touched.
///
/// ```
/// use softplug_abi::LineParameters;
/// use softplug_abi::manifest::Manifest;
/// use softplug_native::NativePlugin;
/// use softplug_trial::{Budget, End, Setup, Trial};
///
/// let plugin = NativePlugin::XonXoff;
/// let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
/// let settings = manifest.resolve_settings([])?;
/// let setup = Setup::new(&manifest, &settings, LineParameters::new(9_600));
/// let instantiate = || Ok::<_, std::fmt::Error>(plugin.instantiate());
/// let trial = Trial::new(setup, instantiate, Budget::endless());
///
/// let tried = trial.run(&mut std::io::Cursor::new("G1 X1\n"), 6)?;
/// assert_eq!(tried.end, Some(End::Done));
/// assert_eq!(tried.wire, b"G1 X1\n");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Trial<'a, F> {
    pub(crate) setup: Setup<'a>,
    instantiate: F,
    pub(crate) budget: Budget,
}

/// What came of it.
#[derive(Debug)]
pub struct Tried {
    /// `None`: the plug-in waits for something that only a real partner sends.
    pub end: Option<End>,
    /// Bytes of the program that were taken.
    pub supplied: u64,
    /// What was on the wire.
    pub wire: Vec<u8>,
    /// What was said both ways; empty if the protocol is no dialogue.
    pub dialogue: Vec<(Side, Vec<u8>)>,
    /// Bytes that answered the job.
    pub answered: u64,
    /// How long it took on the line.
    pub took: Micros,
    /// What the plug-in said of it.
    pub notes: Vec<Note>,
    /// The lathe that took its pulses, if that is what the program is.
    pub lathe: Option<Box<Lathe>>,
}

/// How a job ended.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum End {
    /// All of it was sent.
    Done,
    /// The plug-in failed it.
    Failed {
        /// Why.
        failure: Failure,
        /// The protocol's own code of it; 0 without one.
        status: u16,
    },
    /// The plug-in looked at the program, and sends nothing of it.
    CheckFailed {
        /// Why.
        failure: Failure,
        /// The protocol's own code of it; 0 without one.
        status: u16,
        /// The line, counted from 1; 0 is unknown.
        line: u32,
        /// The column, counted from 1; 0 is unknown.
        column: u32,
    },
}

/// Something that a plug-in said.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Note {
    /// How grave it is.
    pub level: NoteLevel,
    /// The plug-in's own number of it.
    pub code: u16,
    /// Its text.
    pub text: String,
}

impl End {
    fn is_unanswered(&self) -> bool {
        let unanswered = [Failure::NoAnswer, Failure::AttemptsUsedUp];
        matches!(self, Self::Failed { failure, .. } if unanswered.contains(failure))
    }
}

/// What is kept of a run.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Keep {
    /// How it ended.
    Nothing,
    /// Also what was on the wire.
    Wire,
    All,
}

impl<'a, F, I, E> Trial<'a, F>
where
    F: Fn() -> Result<I, E>,
    I: Instance,
    E: Error + 'static,
{
    /// `instantiate` makes a new instance of the plug-in.
    pub fn new(setup: Setup<'a>, instantiate: F, budget: Budget) -> Self {
        Self { setup, instantiate, budget }
    }

    /// Runs the job with a program of `size` bytes, from where it stands.
    ///
    /// # Errors
    /// The plug-in fails otherwise than by failing the job, or the program cannot be read.
    pub fn run(
        &self,
        program: &mut (impl Read + Seek),
        size: u64,
    ) -> Result<Tried, TrialError<E, I::Fault>> {
        self.go(program, size, self.setup.records, Keep::All)
    }

    pub(crate) fn go(
        &self,
        program: &mut (impl Read + Seek),
        size: u64,
        records: &[u8],
        keep: Keep,
    ) -> Result<Tried, TrialError<E, I::Fault>> {
        let Setup { manifest, settings, line, depth, job_kind, .. } = self.setup;
        let exchange = if keep == Keep::All { Exchange::new(line) } else { Exchange::unheard() };
        let partner = Willing::new(&self.setup, exchange.clone())?;
        let (is_dialogue, is_nobody) = (partner.is_dialogue(), partner.is_nobody());
        let mut paper = Paper::new(program, keep, exchange, &self.budget);
        let options = LinkOptions { line, settings: settings.clone(), ..LinkOptions::default() };
        let instance = (self.instantiate)().map_err(TrialError::Instance)?;
        let instance = Metered::new(instance, &self.budget);
        let mut both = ClosedLoop::new(instance, options, depth as usize, partner);
        let (fields, check) = (records.to_vec(), manifest.needs.check_pass);
        let job = Job { id: JOB, kind: job_kind, size: Some(size), fields, check };
        let ran = (|| {
            both.line.link.open(Micros::ZERO, &mut paper)?;
            both.line.link.begin_job(Micros::ZERO, job, &mut paper)?;
            both.settle(&mut paper)?;
            while paper.end.is_none() && paper.error.is_none() && !paper.is_spent() {
                let limit = paper.last + PATIENCE;
                if !both.step(limit, &mut paper)? {
                    break;
                }
                paper.refuse(&mut both)?;
            }
            Ok(both.now())
        })();
        let took = ran.map_err(|fault| self.fault(fault))?;
        if let Some(error) = paper.error {
            return Err(TrialError::Program(error));
        }
        if paper.end.is_none() && paper.is_spent() {
            return Err(self.given_up());
        }
        // An answer that nobody gives is not missing because of the program.
        let end = paper.end.filter(|end| !(is_nobody && end.is_unanswered()));
        Ok(Tried {
            end,
            supplied: paper.supplied,
            wire: paper.wire,
            dialogue: if is_dialogue { paper.exchange.pieces() } else { Vec::new() },
            answered: paper.answered,
            took,
            notes: paper.notes,
            lathe: both.partner.into_lathe(),
        })
    }

    fn fault(&self, fault: LinkFault<MeteredFault<I::Fault>>) -> TrialError<E, I::Fault> {
        match fault {
            LinkFault::Instance { source: MeteredFault::GivenUp, .. } => self.given_up(),
            fault => TrialError::Plugin(fault),
        }
    }

    fn given_up(&self) -> TrialError<E, I::Fault> {
        if self.budget.is_stopped() { TrialError::Stopped } else { TrialError::Spent }
    }
}
