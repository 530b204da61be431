//! What a program cannot say on a link's line, found out beside the link: with an instance of its
//! own, in virtual time.

use std::error::Error;
use std::io::{Cursor, Read, Seek};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use softplug_abi::LineParameters;
use softplug_abi::manifest::Manifest;
use softplug_catalogue::HEAD_BYTES;
use softplug_host::LoadError;
use softplug_live::pacer::default_depth;
use softplug_live::port::line_text;
use softplug_trial::{Altered, Budget, Setup, Trial, TrialError};

use super::loading::Prepared;
use super::{Gateway, calls};
use crate::Refusal;
use crate::config::LinkConfig;
use crate::disk::Moment;
use crate::programs::ProgramError;
use crate::view::{AlteredView, CheckResult, CheckView, JobOrder};

/// Bytes of the largest program that is checked.
const LARGEST: u64 = 64 << 20;
/// What one check may cost, in units of a trial of about a nanosecond of computing each: for the
/// characters, and for each byte of the program.
const UNITS: u64 = 3_000_000_000;
const UNITS_A_BYTE: u64 = 1_000;
/// Most different characters of a program that are tried.
const CHARACTERS: usize = 1_000;
/// The rate of a line that has none of its own: what is sent does not depend on it.
const USUAL_RATE: u32 = 9_600;

/// What a link would send it with.
struct Way {
    config: LinkConfig,
    plugin: Prepared,
}

/// Checks.
impl Gateway {
    /// What becomes of a program on a link's line, as it would be sent by this order. Nothing is
    /// sent, and neither the link nor its machine notices; whoever sets `stop` ends it.
    pub fn check(
        &self,
        link: &str,
        order: &JobOrder,
        stop: &Arc<AtomicBool>,
    ) -> Result<CheckView, Refusal> {
        let Some(name) = &order.program else {
            return Err(Refusal::invalid("program", "only a program can be checked: name one"));
        };
        let known = link.to_owned();
        let way = self.shared.ask(move |control| {
            let link = control.link(&known)?;
            Ok(Way { config: link.config.clone(), plugin: link.plugin.clone() })
        })?;
        let job = calls::order(link, order, &way.plugin.plugin)?;
        let (mut file, program) = self.shared.parts.programs.download(&name.parse()?)?;
        if program.size == 0 {
            return Err(ProgramError::Empty(name.clone()).into());
        }
        if program.size > LARGEST {
            let (most, has) = (LARGEST >> 20, program.size);
            let text =
                format!("{name} has {has} bytes; programs of at most {most} MiB are checked");
            return Err(Refusal::TooLarge(text));
        }
        let unread = |error: std::io::Error| Refusal::Unavailable(format!("{name}: {error}"));
        let budget = Budget::units(UNITS + UNITS_A_BYTE * program.size)
            .characters(CHARACTERS)
            .stopped_by(Arc::clone(stop));
        let before = Moment::of(&file).map_err(unread)?;
        let mut read = (&mut file).take(before.size);
        let checked = match self.channel_of(link)? {
            Some(channel) => {
                let mut bytes = Vec::new();
                read.read_to_end(&mut bytes).map_err(unread)?;
                let sent = channel.sent(&bytes)?;
                let size = sent.len() as u64;
                way.check(name, &job.job_kind, order, &mut Cursor::new(sent), size, budget)
            }
            None => way.check(name, &job.job_kind, order, &mut read, before.size, budget),
        };
        if Moment::of(&file).map_err(unread)? == before {
            return checked;
        }
        let text = format!("{name} was written to while it was checked; check it again");
        Err(Refusal::Conflict(text))
    }
}

impl Way {
    fn check(
        &self,
        name: &str,
        kind: &str,
        order: &JobOrder,
        program: &mut (impl Read + Seek),
        size: u64,
        budget: Budget,
    ) -> Result<CheckView, Refusal> {
        let manifest = self.plugin.plugin.manifest();
        let job_kind = manifest.job_kind(kind).unwrap_or_default();
        let fields: Vec<_> = order.fields.iter().map(|(name, value)| (&**name, &**value)).collect();
        let records = manifest.jobs[usize::from(job_kind)].records(fields.iter().copied());
        let records = records.map_err(|error| Refusal::invalid("fields", error))?;
        let line = match self.config.line {
            LineParameters { baud: 0, .. } => {
                LineParameters { baud: USUAL_RATE, ..self.config.line }
            }
            line => line,
        };
        let depth = self.config.depth.unwrap_or_else(|| default_depth(line.baud));
        let (records, fields) = (&*records, &*fields);
        let setup = Setup {
            depth,
            job_kind,
            records,
            fields,
            ..Setup::new(manifest, &self.plugin.values, line)
        };
        let trial = Trial::new(setup, || self.plugin.plugin.instantiate(), budget);
        let checked = trial.check(program, size);
        let checked = checked.map_err(|error| refusal(&error, name, &self.plugin.which.name))?;
        let mut head = Vec::new();
        let read =
            program.rewind().and_then(|()| program.take(HEAD_BYTES as u64).read_to_end(&mut head));
        read.map_err(|error| Refusal::Unavailable(format!("{name}: {error}")))?;
        let machine = self.config.machine.as_ref();
        let remark = machine.and_then(|machine| machine.remark_on_name(&head));
        let altered = |altered: &Altered| altered_view(altered, manifest);
        Ok(CheckView {
            result: checked.result().into(),
            plugin: format!("{} {}", self.plugin.which.name, self.plugin.which.version),
            line: line_text(&self.config.line),
            bytes: size,
            different: checked.characters,
            characters: checked.altered.iter().map(altered).collect(),
            message: checked.refused.map(|refused| refused.message(manifest, name)),
            remark: remark.map(|remark| format!("{name} {remark}")),
        })
    }
}

impl From<softplug_trial::CheckResult> for CheckResult {
    fn from(result: softplug_trial::CheckResult) -> Self {
        match result {
            softplug_trial::CheckResult::Passes => Self::Passes,
            softplug_trial::CheckResult::Altered => Self::Altered,
            softplug_trial::CheckResult::Refused => Self::Refused,
        }
    }
}

fn altered_view(altered: &Altered, manifest: &Manifest) -> AlteredView {
    let Altered { found, fate } = altered;
    AlteredView {
        character: found.written.shown(),
        bytes: found.written.hex(),
        count: found.count,
        line: found.line,
        column: found.column,
        fate: fate.name().unwrap_or_default().to_owned(),
        what: fate.what(manifest),
        instead: found.written.instead().map(ToOwned::to_owned),
    }
}

/// Why nothing was found out.
fn refusal<F: Error>(error: &TrialError<LoadError, F>, name: &str, plugin: &str) -> Refusal {
    let text = format!("{name} cannot be tried with {plugin}: {error}");
    match error {
        TrialError::Plugin(_) | TrialError::Partner(_) | TrialError::Waits => {
            Refusal::Conflict(text)
        }
        TrialError::Characters { .. } | TrialError::Spent => Refusal::TooLarge(text),
        TrialError::Instance(_) | TrialError::Program(_) | TrialError::Stopped => {
            Refusal::Unavailable(text)
        }
    }
}
