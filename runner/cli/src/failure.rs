//! Why the command could not do it: an exit code, a sentence and a hint.

use std::error::Error;
use std::fmt::Display;

use serde::Serialize;
use softplug_host::LoadError;
use softplug_live::{BadSpec, PortError, SettingDifference};
use softplug_trial::{TrialError, WAITS};

use crate::exit::Exit;

/// An error for people and machines.
#[derive(Debug)]
pub(crate) struct Failure {
    pub(crate) exit: Exit,
    /// One clear sentence, without a full stop.
    pub(crate) message: String,
    /// What to try.
    pub(crate) hint: Option<String>,
    /// What a port has otherwise than it was asked to, if that is why.
    differences: Vec<Difference>,
}

/// A setting that a port did not take.
#[derive(Debug, Serialize)]
struct Difference {
    setting: &'static str,
    asked: String,
    has: String,
}

/// An error as `--json` prints it.
#[derive(Serialize)]
struct Json<'a> {
    error: JsonError<'a>,
}

#[derive(Serialize)]
struct JsonError<'a> {
    code: u8,
    message: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    hint: Option<&'a str>,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    differences: &'a [Difference],
}

impl Failure {
    pub(crate) fn new(exit: Exit, message: impl Display) -> Self {
        Self { exit, message: message.to_string(), hint: None, differences: Vec::new() }
    }

    /// Wrong usage, or a file that cannot be used.
    pub(crate) fn usage(message: impl Display) -> Self {
        Self::new(Exit::Usage, message)
    }

    /// A plug-in that cannot be loaded.
    pub(crate) fn plug_in(message: impl Display) -> Self {
        Self::new(Exit::PlugIn, message)
    }

    /// Why a trial of the program that is called `name` told nothing.
    pub(crate) fn trial<F: Error>(error: TrialError<LoadError, F>, name: &str) -> Self {
        match error {
            TrialError::Instance(error) => Self::plug_in(error),
            TrialError::Partner(error) => Self::usage(error),
            TrialError::Program(error) => Self::usage(format_args!("cannot read {name}: {error}")),
            TrialError::Waits => Self::new(Exit::Incomplete, WAITS),
            error @ TrialError::Plugin(_) => Self::new(Exit::Failed, error),
            // Here nobody bounds or stops it.
            error @ (TrialError::Characters { .. } | TrialError::Spent | TrialError::Stopped) => {
                Self::internal(error)
            }
        }
    }

    /// What another system than Linux cannot do.
    #[cfg(not(target_os = "linux"))]
    pub(crate) fn only_on_linux(what: &str) -> Self {
        Self::new(Exit::Port, format_args!("{what} works on Linux only so far")).hint(
            "`send`, `receive`, `record`, `simulate`, `ports`, `certify` and what needs no port work here",
        )
    }

    /// A bug of ours.
    pub(crate) fn internal(message: impl Display) -> Self {
        Self::new(Exit::Internal, message)
            .hint("please report it, with the command and the lines above")
    }

    pub(crate) fn hint(self, hint: impl Display) -> Self {
        Self { hint: Some(hint.to_string()), ..self }
    }

    pub(crate) fn json(&self) -> String {
        let error = JsonError {
            code: self.exit.code(),
            message: &self.message,
            hint: self.hint.as_deref(),
            differences: &self.differences,
        };
        serde_json::to_string(&Json { error }).expect("text and a number are JSON")
    }
}

impl From<BadSpec> for Failure {
    fn from(error: BadSpec) -> Self {
        Self::usage(error)
    }
}

impl From<PortError> for Failure {
    fn from(error: PortError) -> Self {
        let failure = match &error {
            PortError::BadSpec(_) => return Self::usage(error),
            _ => Self::new(Exit::Port, &error),
        };
        match error {
            PortError::NotTaken { found, .. } => {
                let difference = |found: SettingDifference| Difference {
                    setting: found.setting,
                    asked: found.asked,
                    has: found.has,
                };
                Self { differences: found.into_iter().map(difference).collect(), ..failure }
            }
            PortError::NotFound { .. } | PortError::NoHardware { .. } => {
                failure.hint("`softplug ports` lists the ports that there are")
            }
            PortError::Permission { path, .. } | PortError::NotATerminal { path }
                if cfg!(target_os = "linux") =>
            {
                failure.hint(format_args!("`softplug doctor {}` tells more", path.display()))
            }
            _ => failure,
        }
    }
}
