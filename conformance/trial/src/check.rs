//! What a program cannot say on a line.

use std::error::Error;
use std::io::{Read, Seek};

use softplug_abi::manifest::Manifest;
use softplug_abi::{Failure, Instance};

use crate::characters::{Found, characters};
use crate::error::TrialError;
use crate::fate::{Fate, Probe};
use crate::paper::Keep;
use crate::reason::reason;
use crate::trial::Trial;
use crate::tried::End;

/// What becomes of a program on its way; [`Trial::check`] finds it out.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Checked {
    /// Different characters that it has.
    pub characters: u64,
    /// Those that do not pass as they are written, in the order in which they come first.
    pub altered: Vec<Altered>,
    /// Why the plug-in refuses the program as a whole, if it does.
    pub refused: Option<Refused>,
}

/// A character that does not pass as it is written.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Altered {
    /// Which, how often and where first.
    pub found: Found,
    /// What becomes of it: never [`Fate::Passes`].
    pub fate: Fate,
}

/// Why a plug-in refuses a program.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Refused {
    /// Why.
    pub failure: Failure,
    /// The protocol's own code of it; 0 without one.
    pub status: u16,
    /// Where, if the plug-in looked at the program before it sent any of it: line and column,
    /// counted from 1; 0 is unknown.
    pub place: Option<(u32, u32)>,
}

/// What becomes of a program, in a word.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum CheckResult {
    /// All of it arrives as it is written.
    Passes,
    /// It is sent, and some of its characters arrive otherwise or not at all.
    Altered,
    /// The plug-in does not send it.
    Refused,
}

impl CheckResult {
    /// Its name: `passes`, `altered` or `refused`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Passes => "passes",
            Self::Altered => "altered",
            Self::Refused => "refused",
        }
    }
}

impl Checked {
    /// All of it in a word.
    pub fn result(&self) -> CheckResult {
        match (&self.refused, self.altered.is_empty()) {
            (Some(_), _) => CheckResult::Refused,
            (None, false) => CheckResult::Altered,
            (None, true) => CheckResult::Passes,
        }
    }
}

impl Refused {
    /// It in a sentence; `name` is what people call the program.
    pub fn message(&self, manifest: &Manifest, name: &str) -> String {
        let place = match self.place {
            None | Some((0, _)) => String::new(),
            Some((line, 0)) => format!(", line {line}"),
            Some((line, column)) => format!(", line {line}, column {column}"),
        };
        let reason = reason(manifest, self.failure, self.status);
        format!("{name}{place} cannot be sent: {reason}")
    }
}

impl<F, I, E> Trial<'_, F>
where
    F: Fn() -> Result<I, E>,
    I: Instance,
    E: Error + 'static,
{
    /// What becomes of a program of `size` bytes: of all of it, then of each of its characters in a
    /// small program.
    ///
    /// # Errors
    /// It cannot be found out: the plug-in fails otherwise than by refusing the job, waits for a
    /// partner that is not there, or needs more than the budget.
    ///
    /// ```
    /// use softplug_abi::LineParameters;
    /// use softplug_abi::manifest::Manifest;
    /// use softplug_native::NativePlugin;
    /// use softplug_trial::{Budget, CheckResult, Fate, Setup, Trial};
    ///
    /// let plugin = NativePlugin::FanucRs232;
    /// let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
    /// let settings = manifest.resolve_settings([])?;
    /// let line: LineParameters = LineParameters { data_bits: 7, ..LineParameters::new(4_800) };
    /// let setup = Setup::new(&manifest, &settings, line);
    /// let instantiate = || Ok::<_, std::fmt::Error>(plugin.instantiate());
    /// let trial = Trial::new(setup, instantiate, Budget::endless());
    ///
    /// let mut program = std::io::Cursor::new("%\nO1(ROHR a)\nM30\n%\n");
    /// let checked = trial.check(&mut program, 20)?;
    /// assert_eq!(checked.result(), CheckResult::Altered);
    /// let altered = &checked.altered[0];
    /// assert_eq!(altered.fate, Fate::Replaced("A".to_owned()));
    /// assert_eq!((altered.found.line, altered.found.column), (2, 9));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn check(
        &self,
        program: &mut (impl Read + Seek),
        size: u64,
    ) -> Result<Checked, TrialError<E, I::Fault>> {
        let refused = match self.go(program, size, self.setup.records, Keep::Nothing)?.end {
            Some(End::Done) => None,
            Some(End::Failed { failure, status }) => Some(Refused { failure, status, place: None }),
            Some(End::CheckFailed { failure, status, line, column }) => {
                Some(Refused { failure, status, place: Some((line, column)) })
            }
            None => return Err(TrialError::Waits),
        };
        program.rewind().map_err(TrialError::Program)?;
        let most = self.budget.most_characters();
        let found = characters(program, most).map_err(TrialError::Program)?;
        let found = found.ok_or(TrialError::Characters { most })?;
        let mut altered = Vec::new();
        if let Some(probe) = Probe::new(self)? {
            for found in &found {
                let fate = probe.fate(found.written)?;
                // What is refused in a small program and sent in this one stands in another place.
                let is_sent = refused.is_none() && matches!(fate, Fate::Refused(..));
                if fate != Fate::Passes && !is_sent {
                    altered.push(Altered { found: *found, fate });
                }
            }
        }
        Ok(Checked { characters: found.len() as u64, altered, refused })
    }
}
