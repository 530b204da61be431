//! A bench for a converter: a line in virtual time, with a UART.

use crate::{Converter, JobId, Native, NativeFault};
use softplug_abi::manifest::{Manifest, SettingError, StateFormats};
use softplug_abi::{LineErrorKind, LineParameters, Micros, ModemLines, Refusal};
pub use softplug_link::{Delivery, Observed, Taken};
use softplug_link::{Job, LinkFault, LinkOptions, Recorder, VirtualLine};
use std::error::Error;
use std::fmt;

/// A converter on a line in virtual time.
///
/// ```
/// use softplug_plugin::bench::Bench;
/// use softplug_plugin::{Context, Converter};
///
/// struct Echo;
///
/// impl Converter for Echo {
///     type Settings = ();
///     const MANIFEST: &'static str = r#"{"abi": "1.0", "name": "echo", "version": "1.0.0",
///         "licence": "MIT", "protocol": "none", "description": "Sends back what it receives."}"#;
///
///     fn new((): ()) -> Self {
///         Self
///     }
///
///     fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
///         link.transmit(bytes);
///     }
/// }
///
/// let mut bench = Bench::<Echo>::new().open();
/// bench.receive(b"G1 X10");
/// bench.run_for_millis(10);
/// assert_eq!(bench.sent(), b"G1 X10");
/// ```
#[derive(Debug)]
pub struct Bench<C: Converter> {
    line: VirtualLine<Native<C>>,
    recorder: Recorder,
    now: Micros,
    next_job: JobId,
    check_pass: bool,
    /// What the manifest says of states.
    said: StateFormats,
    source_rate: Option<usize>,
}

/// What a bench is opened with.
///
/// ```
/// use softplug_plugin::LineParameters;
/// use softplug_plugin::bench::Bench;
/// # struct Echo;
/// # impl softplug_plugin::Converter for Echo {
/// #     type Settings = ();
/// #     const MANIFEST: &'static str = r#"{"abi": "1.0", "name": "echo", "version": "1.0.0",
/// #         "licence": "MIT", "protocol": "none", "description": "Sends back."}"#;
/// #     fn new((): ()) -> Self { Self }
/// #     fn received(&mut self, link: &mut softplug_plugin::Context<'_>, bytes: &[u8]) {
/// #         link.transmit(bytes);
/// #     }
/// # }
///
/// let mut bench = Bench::<Echo>::new().line(LineParameters::new(300)).depth(1).open();
/// bench.receive(b"AB");
/// // At 300 baud a character takes 33 ms.
/// bench.run_for_millis(30);
/// assert_eq!(bench.sent(), b"A");
/// ```
#[derive(Debug)]
pub struct BenchOptions<C: Converter> {
    manifest: Manifest,
    settings: Vec<(String, String)>,
    options: LinkOptions,
    depth: usize,
    drain_by_hand: bool,
    source_rate: Option<usize>,
    converter: std::marker::PhantomData<C>,
}

/// A converter cannot be put on the bench.
///
/// ```
/// use softplug_plugin::bench::{Bench, BenchError};
/// # struct Echo;
/// # impl softplug_plugin::Converter for Echo {
/// #     type Settings = ();
/// #     const MANIFEST: &'static str = r#"{"abi": "1.0", "name": "echo", "version": "1.0.0",
/// #         "licence": "MIT", "protocol": "none", "description": "Sends back."}"#;
/// #     fn new((): ()) -> Self { Self }
/// # }
///
/// let opened = Bench::<Echo>::new().set("baud", "9600").try_open();
/// assert!(matches!(opened, Err(BenchError::Setting(_))));
/// ```
#[derive(Clone, PartialEq, Debug)]
pub enum BenchError {
    /// A setting does not exist or has a wrong value.
    Setting(SettingError),
    /// The converter itself refuses its settings, in these words.
    Refused(&'static str),
}

impl fmt::Display for BenchError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Setting(error) => error.fmt(f),
            Self::Refused(words) => write!(f, "the converter refuses its settings: {words}"),
        }
    }
}

impl Error for BenchError {}

impl<C: Converter> Bench<C> {
    /// 9600 8N1, one character in flight, every setting at its default.
    ///
    /// # Panics
    /// The manifest is wrong: a test should say so at once.
    #[allow(clippy::new_ret_no_self, reason = "options come first, as in a builder")]
    pub fn new() -> BenchOptions<C> {
        let manifest = Manifest::parse(C::MANIFEST.as_bytes())
            .unwrap_or_else(|error| panic!("the converter's manifest is wrong: {error}"));
        BenchOptions {
            manifest,
            settings: Vec::new(),
            options: LinkOptions::default(),
            depth: 1,
            drain_by_hand: false,
            source_rate: None,
            converter: std::marker::PhantomData,
        }
    }

    /// Time on the bench.
    pub fn now(&self) -> Micros {
        self.now
    }

    /// Bytes reach the converter now, all at once.
    pub fn receive(&mut self, bytes: &[u8]) {
        let received = self.line.link.received(self.now, bytes, &mut self.recorder);
        self.went_well(received);
        self.settle();
    }

    /// A damaged character or a break arrives now.
    pub fn line_error(&mut self, kind: LineErrorKind, byte: Option<u8>) {
        let told = self.line.link.line_error(self.now, kind, byte, 0, &mut self.recorder);
        self.went_well(told);
        self.settle();
    }

    /// The modem lines change.
    pub fn modem_lines(&mut self, known: ModemLines, on: ModemLines) {
        let told = self.line.link.modem_lines(self.now, known, on, &mut self.recorder);
        self.went_well(told);
        self.settle();
    }

    /// Begins a job of the first kind with this data; returns its id.
    pub fn send(&mut self, data: &[u8]) -> JobId {
        self.begin_job(0, Vec::new(), data)
    }

    /// Begins a job; `fields` are value records. Returns its id.
    pub fn begin_job(&mut self, kind: u16, fields: Vec<u8>, data: &[u8]) -> JobId {
        let id = self.next_job;
        self.next_job = id.next();
        self.recorder.add_source(id, data.to_vec());
        let check = self.check_pass;
        let job = Job { id, kind, size: Some(data.len() as u64), fields, check };
        let begun = self.line.link.begin_job(self.now, job, &mut self.recorder);
        self.went_well(begun);
        self.settle();
        id
    }

    /// Anything else that the host may do, such as
    /// `|link, now, host| link.abort(now, JobId(1), host)`.
    pub fn host(
        &mut self,
        act: impl FnOnce(
            &mut softplug_link::Link<Native<C>>,
            Micros,
            &mut Recorder,
        ) -> Result<(), LinkFault<NativeFault>>,
    ) {
        let done = act(&mut self.line.link, self.now, &mut self.recorder);
        self.went_well(done);
        self.settle();
    }

    /// Puts so many bytes of what was delivered away.
    pub fn drain(&mut self, bytes: u32) {
        self.recorder.drain(bytes);
        self.settle();
    }

    /// Lets time go on to `until`.
    pub fn run_until(&mut self, until: Micros) {
        while let Some(rate) = self.source_rate.filter(|_| self.now < until) {
            self.go_on_until(until.min(self.now + Micros::from_millis(1)));
            self.recorder.source_has = Some(rate);
            self.settle();
        }
        self.go_on_until(until);
    }

    fn go_on_until(&mut self, until: Micros) {
        let run = self.line.run_until(until, &mut self.recorder);
        self.went_well(run);
        self.now = self.now.max(until);
    }

    /// Lets so many ms go by.
    pub fn run_for_millis(&mut self, millis: i64) {
        self.run_until(self.now + Micros::from_millis(millis));
    }

    /// Saves the state and goes on with a new converter that was given it. Its format must be the one
    /// that the manifest says is saved, and accepts.
    pub fn swap(&mut self) {
        let recorder = &mut self.recorder;
        let swapped = self.line.link.swap_as_said(self.now, Native::new(), &self.said, recorder);
        if let Err(error) = swapped {
            panic!("at {}: {error}", self.now);
        }
        self.settle();
    }

    /// Every byte on the wire so far, the one whose start bit leaves just now included.
    pub fn sent(&self) -> Vec<u8> {
        let byte = |(at, observed): &(Micros, Observed)| match observed {
            Observed::Byte(byte) if *at <= self.now => Some(*byte),
            _ => None,
        };
        self.recorder.observed.iter().filter_map(byte).collect()
    }

    /// All that the converter was seen to do, with times.
    pub fn observed(&self) -> &[(Micros, Observed)] {
        &self.recorder.observed
    }

    /// Deliveries that have ended.
    pub fn deliveries(&self) -> Vec<&Delivery> {
        self.recorder.deliveries()
    }

    /// The link, to look at.
    pub fn link(&self) -> &softplug_link::Link<Native<C>> {
        &self.line.link
    }

    fn settle(&mut self) {
        let settled = self.line.transmit(self.now, &mut self.recorder);
        self.went_well(settled);
    }

    /// A converter that breaks the ABI ends the test with the reason.
    #[track_caller]
    fn went_well(&self, result: Result<(), LinkFault<NativeFault>>) {
        if let Err(fault) = result {
            panic!("at {}: {fault}", self.now);
        }
    }
}

impl<C: Converter> BenchOptions<C> {
    /// Sets a setting from text, as on the command line.
    #[must_use]
    pub fn set(mut self, name: &str, value: &str) -> Self {
        self.settings.push((name.to_owned(), value.to_owned()));
        self
    }

    /// Sets several of them.
    #[must_use]
    pub fn set_all(self, settings: &[(&str, &str)]) -> Self {
        settings.iter().fold(self, |options, (name, value)| options.set(name, value))
    }

    /// The characters on the line.
    #[must_use]
    pub fn line(mut self, line: LineParameters) -> Self {
        self.options.line = line;
        self
    }

    /// At most so many characters in flight.
    #[must_use]
    pub fn depth(mut self, depth: usize) -> Self {
        self.depth = depth;
        self
    }

    /// Room for transmitting and for deliveries, in bytes.
    #[must_use]
    pub fn room(mut self, transmit: u32, delivery: u32) -> Self {
        self.options.transmit_room = transmit;
        self.options.delivery_room = delivery;
        self
    }

    /// Deliveries stay until [`Bench::drain`] puts them away.
    #[must_use]
    pub fn drain_by_hand(mut self) -> Self {
        self.drain_by_hand = true;
        self
    }

    /// The data of a job comes slowly, at most so many bytes each ms, however much is
    /// asked for.
    #[must_use]
    pub fn source_rate(mut self, bytes_each_milli: usize) -> Self {
        self.source_rate = Some(bytes_each_milli);
        self
    }

    /// Opens the link at time 0.
    ///
    /// # Panics
    /// A setting is wrong, the converter refuses its settings, or it breaks the ABI.
    pub fn open(self) -> Bench<C> {
        self.try_open().unwrap_or_else(|error| panic!("{error}"))
    }

    /// Opens the link at time 0.
    ///
    /// # Errors
    /// A setting is wrong, or the converter refuses its settings.
    ///
    /// # Panics
    /// The converter breaks the ABI.
    pub fn try_open(mut self) -> Result<Bench<C>, BenchError> {
        let asked = self.settings.iter().map(|(name, value)| (name.as_str(), value.as_str()));
        self.options.settings =
            self.manifest.resolve_settings(asked).map_err(BenchError::Setting)?;
        let check_pass = self.manifest.needs.check_pass;
        let mut recorder = Recorder::default();
        recorder.drain_by_hand = self.drain_by_hand;
        recorder.source_has = self.source_rate.map(|_| 0);
        let line = VirtualLine::new(Native::new(), self.options, self.depth);
        let mut bench = Bench {
            line,
            recorder,
            now: Micros::ZERO,
            next_job: JobId(1),
            check_pass,
            said: self.manifest.state,
            source_rate: self.source_rate,
        };
        let opened = bench.line.link.open(Micros::ZERO, &mut bench.recorder);
        match opened {
            Err(LinkFault::Instance { source, .. }) if source.refusal == Refusal::Settings => {
                return Err(BenchError::Refused(source.words));
            }
            opened => bench.went_well(opened),
        }
        bench.settle();
        Ok(bench)
    }
}
