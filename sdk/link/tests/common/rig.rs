//! A scripted plug-in on a virtual line, with all that happens on record.

use super::{Plugin, Refused, Script};
use softplug_abi::{Action, JobId, Micros};
use softplug_link::{
    Job, Link, LinkFault, LinkOptions, Observed, Recorder, RuleBroken, VirtualLine,
};

/// The byte at which the plug-in does what it was told last.
const CUE: &[u8] = b"!";

/// What a call on the link gives.
pub(crate) type Done = Result<(), LinkFault<Refused>>;

#[derive(Debug)]
pub(crate) struct Rig {
    pub(crate) line: VirtualLine<Plugin>,
    pub(crate) out: Recorder,
    pub(crate) script: Script,
}

impl Rig {
    /// Opened at 0, with at most `depth` characters in flight; what the plug-in
    /// was given so far is not looked at.
    pub(crate) fn new(options: LinkOptions, depth: usize) -> Self {
        Self::with(Script::default(), options, depth)
    }

    /// Opened at 0 with a script that knows what to do at the opening.
    pub(crate) fn with(script: Script, options: LinkOptions, depth: usize) -> Self {
        let mut rig = Self::closed(script, options, depth);
        rig.line.link.open(Micros::ZERO, &mut rig.out).expect("the link opens");
        rig.tick(0);
        rig.script.take();
        rig
    }

    /// Not opened yet.
    pub(crate) fn closed(script: Script, options: LinkOptions, depth: usize) -> Self {
        let line = VirtualLine::new(script.plugin(), options, depth);
        Self { line, out: Recorder::default(), script }
    }

    /// Time goes on to just before `at`; then the plug-in does this, in answer to a byte.
    pub(crate) fn does(&mut self, at: i64, actions: &[Action<'_>]) {
        let done = self.tries(at, actions);
        done.expect("what the plug-in does follows the rules");
    }

    /// Like [`does`](Self::does), where a rule may be broken.
    pub(crate) fn tries(&mut self, at: i64, actions: &[Action<'_>]) -> Done {
        self.script.once("received \"!\"", actions);
        self.receive(at, &[CUE])
    }

    /// The rule that doing so breaks.
    pub(crate) fn breaks(&mut self, at: i64, actions: &[Action<'_>]) -> RuleBroken {
        match self.tries(at, actions) {
            Err(LinkFault::Rule { source, .. }) => source,
            other => panic!("no rule was broken: {other:?}"),
        }
    }

    /// Time goes on to just before `at`; then these arrive, each as an event of
    /// its own.
    pub(crate) fn receive(&mut self, at: i64, pieces: &[&[u8]]) -> Done {
        self.before(at);
        for piece in pieces {
            self.line.link.received(Micros(at), piece, &mut self.out)?;
        }
        self.line.transmit(Micros(at), &mut self.out)
    }

    /// A call on the link at `at`, after what is due then.
    pub(crate) fn host(
        &mut self,
        at: i64,
        act: impl FnOnce(&mut Link<Plugin>, &mut Recorder) -> Done,
    ) {
        self.until(at);
        act(&mut self.line.link, &mut self.out).expect("the host may do so");
        self.tick(at);
    }

    /// Begins a job with this data at `at`.
    pub(crate) fn begin(&mut self, at: i64, id: u32, data: &[u8], check: bool) {
        self.out.add_source(JobId(id), data.to_vec());
        let size = Some(data.len() as u64);
        let job = Job { id: JobId(id), kind: 0, size, fields: Vec::new(), check };
        self.host(at, |link, out| link.begin_job(Micros(at), job, out));
    }

    /// Time goes on to just before `at`.
    pub(crate) fn before(&mut self, at: i64) {
        if at > self.line.link.now().0 {
            self.until(at - 1);
        }
    }

    /// Time goes on to `until`, with all that happens then.
    pub(crate) fn until(&mut self, until: i64) {
        self.line.run_until(Micros(until), &mut self.out).expect("nothing goes wrong by itself");
    }

    pub(crate) fn tick(&mut self, at: i64) {
        self.line.transmit(Micros(at), &mut self.out).expect("nothing goes wrong by itself");
    }

    /// What the plug-in was given since the last look, without the cues.
    pub(crate) fn given(&self) -> Vec<(i64, String)> {
        let mut given = self.script.take();
        given.retain(|(_, event)| event != "received \"!\"");
        given
    }

    /// What the plug-in was given, without times.
    pub(crate) fn events(&self) -> Vec<String> {
        self.given().into_iter().map(|(_, event)| event).collect()
    }

    /// What was on the wire, with the times of the start bits.
    pub(crate) fn wire(&self) -> Vec<(i64, u8)> {
        let byte = |(at, observed): &(Micros, Observed)| match observed {
            Observed::Byte(byte) => Some((at.0, *byte)),
            _ => None,
        };
        self.out.observed.iter().filter_map(byte).collect()
    }

    /// All that was observed but bytes, with times.
    pub(crate) fn observed(&self) -> Vec<(i64, Observed)> {
        let other = |(_, observed): &&(Micros, Observed)| !matches!(observed, Observed::Byte(_));
        self.out.observed.iter().filter(other).map(|(at, seen)| (at.0, seen.clone())).collect()
    }
}

/// Compares what the plug-in was given since the last look, with times.
#[macro_export]
macro_rules! assert_given {
    ($rig:expr, [$(($at:expr, $event:expr)),* $(,)?]) => {{
        let expected: Vec<(i64, String)> = vec![$(($at, String::from($event))),*];
        assert_eq!($rig.given(), expected);
    }};
}

/// Compares what the plug-in was given since the last look, without times.
#[macro_export]
macro_rules! assert_events {
    ($rig:expr, [$($event:expr),* $(,)?]) => {{
        let expected: Vec<String> = vec![$(String::from($event)),*];
        assert_eq!($rig.events(), expected);
    }};
}
