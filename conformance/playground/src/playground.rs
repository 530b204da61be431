//! The state behind the page: the corpus, and the plug-in that was loaded.

use crate::request::{Answer, CaseRow, Loaded, Noisy, Ran, Refusal, Request, Run};
use softplug_conformance::{Case, Corpus, Permutation, Sandboxed, Stepper, disturb};
use softplug_host::{EngineKind, Host, HostOptions};
use softplug_trace::{Trace, reading};

/// An interpreter's units are others than those that the ABI's budget counts: a certification gives a
/// second engine ten times as many, too.
const MORE_FUEL: u64 = 10;

/// Answers one request after the other.
pub struct Playground {
    corpus: Corpus,
    host: Host,
    plugin: Option<Sandboxed>,
}

impl Default for Playground {
    fn default() -> Self {
        Self::new()
    }
}

impl Playground {
    /// With the corpus of this suite and no plug-in.
    pub fn new() -> Self {
        let budget = HostOptions::default();
        let fuel_per_event = MORE_FUEL * budget.fuel_per_event;
        let options = HostOptions { engine: EngineKind::Wasmi, fuel_per_event, ..budget };
        let host = Host::new(options).expect("an interpreter can be set up anywhere");
        Self { corpus: Corpus::embedded(), host, plugin: None }
    }

    /// A request is a line of JSON; the request `load` has the module behind that line. What is
    /// wrong with a request, a module or a trace is an answer too.
    pub fn answer(&mut self, request: &[u8]) -> Vec<u8> {
        let end = request.iter().position(|byte| *byte == b'\n').unwrap_or(request.len());
        let (line, rest) = request.split_at(end);
        let answer = match serde_json::from_slice(line) {
            Ok(Request::Begin) => Ok(self.begin()),
            Ok(Request::Load) => self.load(rest.get(1..).unwrap_or_default()),
            Ok(Request::Run(run)) => self.run(&run),
            Err(error) => Err(Refusal::new(&error)),
        };
        let answer = answer.unwrap_or_else(Answer::Refused);
        serde_json::to_vec(&answer).expect("answers are plain data")
    }

    fn begin(&self) -> Answer<'_> {
        let cases = self.corpus.cases.iter().map(|case| {
            let front = &case.trace.front;
            let (id, title, profile) = (&front.id, &front.title, &front.profile);
            CaseRow { id, title, profile, trace: case.trace.format() }
        });
        Answer::Begun {
            engine: self.host.engine().to_string(),
            names: (0..=u8::MAX).map(reading).collect(),
            cases: cases.collect(),
        }
    }

    /// The plug-in that was there stays if the module is none.
    fn load(&mut self, module: &[u8]) -> Result<Answer<'static>, Refusal> {
        let plugin = self.host.load_bytes(module).map_err(|error| Refusal::new(&error))?;
        let found = plugin.inspection();
        let manifest = &found.manifest;
        let loaded = Loaded {
            name: manifest.name.clone(),
            version: manifest.version.clone(),
            protocol: manifest.protocol.clone(),
            description: manifest.description.clone(),
            profiles: manifest.profiles.iter().map(|profile| profile.name.clone()).collect(),
            sha256: found.digest.to_string(),
            bytes: found.size,
            pages: found.memory_pages,
        };
        self.plugin = Some(Sandboxed::new(plugin));
        Ok(Answer::Loaded(loaded))
    }

    fn run(&self, asked: &Run) -> Result<Answer<'static>, Refusal> {
        let plugin = self.plugin.as_ref().ok_or_else(|| Refusal::new("load a plug-in first"))?;
        let permutation: Permutation =
            asked.permutation.parse().map_err(|error| Refusal::new(&error))?;
        let trace = Trace::parse(&asked.trace)?;
        let mut cases = self.corpus.cases.iter();
        let known = cases.find(|case| Some(&case.trace.front.id) == asked.id.as_ref());
        let mut case = match known {
            Some(known) => known.with_trace(trace),
            None => Case::new("", trace),
        };
        let mut noisy = None;
        if let Some(noise) = asked.noise.noise() {
            let disturbed =
                disturb(&case.trace, &case.files(), noise).map_err(|error| Refusal::new(&error))?;
            let text = disturbed.trace.format();
            // Lines are told as they are counted in the text that is shown.
            case.trace = Trace::parse(&text)?;
            noisy = Some(Noisy { trace: text, count: disturbed.count });
        }
        let run = Stepper::new(plugin, &case, &permutation);
        let verdict = run.failure.as_ref().map_or("passed".to_owned(), ToString::to_string);
        Ok(Answer::Ran(Box::new(Ran { run, verdict, noisy })))
    }
}
