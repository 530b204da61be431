//! The FANUC plug-in and a simulated control on one line, in virtual time.

use softplug_abi::manifest::{Manifest, SettingValues};
use softplug_abi::{Failure, JobId, Micros, ModemLines};
use softplug_link::{Delivery, Job, LinkOptions, Observed, Recorder};
use softplug_machines::fanuc::{
    Code, Control, Options, Parity, Press, Report, eight_none_two, seven_even_two,
};
use softplug_machines::kept::Received;
use softplug_native::{NativeInstance, NativePlugin};
use softplug_trial::ClosedLoop;
use std::fmt::Write;

/// Settings of the plug-in as a person gives them.
pub(crate) type Settings<'a> = &'a [(&'a str, &'a str)];

/// A value for every setting.
pub(crate) fn resolve(settings: Settings<'_>) -> SettingValues {
    let manifest = Manifest::parse(NativePlugin::FanucRs232.manifest().as_bytes()).unwrap();
    manifest.resolve_settings(settings.iter().copied()).unwrap()
}

/// The ways in which ISO and EIA come over a line: settings of the plug-in, and
/// a control that fits them.
pub(crate) fn codings(baud: u32) -> [(Vec<(&'static str, &'static str)>, Options); 4] {
    let eight = Options { line: eight_none_two(baud), ..Options::default() };
    [
        (vec![], Options { line: seven_even_two(baud), ..Options::default() }),
        (vec![("parity", "software")], Options { parity: Parity::Software, ..eight.clone() }),
        (
            vec![("parity", "none")],
            Options { parity: Parity::None, codes_with_parity: false, ..eight.clone() },
        ),
        (vec![("code", "eia"), ("receive_code", "eia")], Options { code: Code::Eia, ..eight }),
    ]
}

/// The plug-in, a control, and a host that keeps all.
pub(crate) struct Bench {
    pub(crate) line: ClosedLoop<NativeInstance, Control>,
    pub(crate) host: Recorder,
    jobs: u32,
}

impl Bench {
    /// An open link on which nothing has happened yet.
    pub(crate) fn new(settings: Settings<'_>, control: Options) -> Self {
        Self::with_depth(settings, control, 1)
    }

    /// A line whose port holds up to `depth` characters.
    pub(crate) fn with_depth(settings: Settings<'_>, control: Options, depth: usize) -> Self {
        let inputs = ModemLines::DSR.union(ModemLines::DCD).union(ModemLines::CTS);
        let known = inputs.union(ModemLines::OUTPUTS);
        let options = LinkOptions {
            line: control.line,
            settings: resolve(settings),
            modem_lines: control.modem_lines.then_some((known, ModemLines::OUTPUTS)),
            ..LinkOptions::default()
        };
        let control = Control::new(control).unwrap();
        let instance = NativePlugin::FanucRs232.instantiate();
        let mut line = ClosedLoop::new(instance, options, depth, control);
        let mut host = Recorder::default();
        line.line.link.open(Micros::ZERO, &mut host).unwrap();
        line.settle(&mut host).unwrap();
        Self { line, host, jobs: 0 }
    }

    /// Begins a job that sends `program`; its id.
    pub(crate) fn send(&mut self, program: &str) -> u32 {
        self.jobs += 1;
        let id = self.jobs;
        self.host.add_source(JobId(id), program.into());
        let size = Some(program.len() as u64);
        let job = Job { id: JobId(id), kind: 0, size, fields: Vec::new(), check: true };
        self.line.line.link.begin_job(self.line.now(), job, &mut self.host).unwrap();
        self.line.settle(&mut self.host).unwrap();
        id
    }

    /// The operator does something.
    pub(crate) fn press(&mut self, press: Press) {
        self.line.partner.press(self.line.now(), press);
    }

    /// Lets time pass.
    pub(crate) fn run(&mut self, span: Micros) {
        let until = self.line.now() + span;
        self.line.wait_until(until, &mut self.host).unwrap();
    }

    /// Runs until the control has taken so many characters.
    pub(crate) fn run_to(&mut self, arrived: u64) {
        let until = self.line.now() + Micros::from_secs(3_600);
        while self.report().arrived < arrived {
            assert!(self.line.step(until, &mut self.host).unwrap(), "the feed has stopped");
        }
    }

    /// Runs until the job has ended, a day at most; how.
    pub(crate) fn end_of(&mut self, job: u32) -> Result<u64, (Failure, u64)> {
        let until = self.line.now() + Micros::from_secs(86_400);
        loop {
            if let Some(end) = self.ended(job) {
                return end;
            }
            let goes_on = self.line.step(until, &mut self.host).unwrap();
            assert!(goes_on, "job {job} never ends: {}", self.account());
        }
    }

    fn ended(&self, wanted: u32) -> Option<Result<u64, (Failure, u64)>> {
        self.host.observed.iter().rev().find_map(|(_, observed)| match observed {
            Observed::Done { job, sent } if *job == JobId(wanted) => Some(Ok(*sent)),
            Observed::Failed { job, failure, sent, .. } if *job == JobId(wanted) => {
                Some(Err((*failure, *sent)))
            }
            Observed::Checked { job, failure: Some(failure), .. } if *job == JobId(wanted) => {
                Some(Err((*failure, 0)))
            }
            _ => None,
        })
    }

    /// The control's account.
    pub(crate) fn report(&self) -> Report {
        self.line.partner.report()
    }

    /// The report without the text, and what the plug-in said.
    pub(crate) fn account(&self) -> String {
        let received = Received::Bytes(Vec::new());
        let is_said = |observed: &&(Micros, Observed)| {
            matches!(observed.1, Observed::Note(..) | Observed::State(_) | Observed::Delivery(_))
        };
        let said: Vec<_> = self.host.observed.iter().filter(is_said).collect();
        format!("{:#?}\n{said:#?}", Report { received, ..self.report() })
    }

    /// The deliveries that have ended.
    pub(crate) fn deliveries(&self) -> Vec<Delivery> {
        self.host.deliveries().into_iter().cloned().collect()
    }
}

/// What a control keeps of a program: all behind the first line, up to the
/// closing `%`.
pub(crate) fn text_of(program: &str) -> &str {
    let start = program.find('\n').unwrap() + 1;
    &program[start..=program.rfind('%').unwrap()]
}

/// A program of so many blocks, with every character that EIA has too.
pub(crate) fn program(blocks: usize) -> String {
    let mut program = "%\nO1234(PLATE 35/6, REV 2 - A+B&C)\nG90G21\n".to_owned();
    for n in 1..=blocks {
        let (x, y, z) = (n * 7 % 400, n * 13 % 1_000, n % 7);
        let f = 100 + n % 900;
        writeln!(program, "N{n}G1X{x}.{y:03}Y-{y}.5Z+{z}.F{f}").expect("a string takes all");
    }
    program + "/M99\nHIJKLPQRSTUVW\nM30\n%\n"
}
