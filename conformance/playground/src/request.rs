//! What the page asks for, and what it is answered, as JSON.

use serde::{Deserialize, Serialize};
use softplug_conformance::{Noise, Stepper};
use softplug_trace::ParseError;

/// The first line of a request.
#[derive(Deserialize)]
#[serde(rename_all = "kebab-case", tag = "do")]
pub(crate) enum Request {
    /// The cases of the corpus, and the names of all bytes.
    Begin,
    /// Takes the module that stands behind this line.
    Load,
    /// Runs a trace against the module.
    Run(Run),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Run {
    /// The trace.
    pub(crate) trace: String,
    /// The case of the corpus that it was made of: it has the files.
    pub(crate) id: Option<String>,
    /// How it is run, by name.
    pub(crate) permutation: String,
    #[serde(default)]
    pub(crate) noise: NoiseRequest,
}

/// In a thousand characters each.
#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct NoiseRequest {
    seed: u32,
    flip: u16,
    drop: u16,
    insert: u16,
}

impl NoiseRequest {
    /// None where nothing can be damaged.
    pub(crate) fn noise(&self) -> Option<Noise> {
        let Self { seed, flip, drop, insert } = *self;
        let is_quiet = (flip, drop, insert) == (0, 0, 0);
        (!is_quiet).then_some(Noise { seed: u64::from(seed), flip, drop, insert })
    }
}

#[derive(Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Answer<'a> {
    Begun { engine: String, names: Vec<String>, cases: Vec<CaseRow<'a>> },
    Loaded(Loaded),
    Ran(Box<Ran>),
    Refused(Refusal),
}

#[derive(Serialize)]
pub(crate) struct CaseRow<'a> {
    pub(crate) id: &'a str,
    pub(crate) title: &'a str,
    pub(crate) profile: &'a str,
    pub(crate) trace: String,
}

#[derive(Serialize)]
pub(crate) struct Loaded {
    pub(crate) name: String,
    pub(crate) version: String,
    pub(crate) protocol: String,
    pub(crate) description: String,
    pub(crate) profiles: Vec<String>,
    pub(crate) sha256: String,
    pub(crate) bytes: usize,
    pub(crate) pages: u64,
}

#[derive(Serialize)]
pub(crate) struct Ran {
    pub(crate) run: Stepper,
    /// What the run came to, in words.
    pub(crate) verdict: String,
    /// The trace as it was run, if noise has damaged it.
    pub(crate) noisy: Option<Noisy>,
}

#[derive(Serialize)]
pub(crate) struct Noisy {
    pub(crate) trace: String,
    pub(crate) count: u32,
}

/// Why a request was refused.
#[derive(Serialize)]
pub(crate) struct Refusal {
    pub(crate) text: String,
    /// Where in the trace, if it is there: line and column from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) place: Option<(u32, u32)>,
}

impl Refusal {
    pub(crate) fn new(text: &(impl ToString + ?Sized)) -> Self {
        Self { text: text.to_string(), place: None }
    }
}

impl From<ParseError> for Refusal {
    fn from(error: ParseError) -> Self {
        let place = Some((error.line, error.column));
        Self { text: error.kind.to_string(), place }
    }
}
