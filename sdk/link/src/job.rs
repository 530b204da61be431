//! The job under way.

use alloc::vec::Vec;
use softplug_abi::{JobId, Pass, limits};

/// A job to begin.
///
/// ```
/// use softplug_abi::{Event, JobId, Micros};
/// # use softplug_abi::{ActionWriter, Instance, NoSpace, Output};
/// use softplug_abi::Action;
/// use softplug_link::{Job, LinkOptions, Observed, Recorder, VirtualLine};
///
/// # type Act = fn(&Event<'_>, &mut ActionWriter<'_>) -> Result<(), NoSpace>;
/// # struct Plugin(Act, Vec<u8>);
/// # impl Instance for Plugin {
/// #     type Fault = NoSpace;
/// #     fn input_capacity(&self) -> usize {
/// #         512
/// #     }
/// #     fn step(&mut self, event: &Event<'_>, _now: Micros) -> Result<Output<'_>, NoSpace> {
/// #         self.1.resize(1_024, 0);
/// #         let mut actions = ActionWriter::new(&mut self.1);
/// #         (self.0)(event, &mut actions)?;
/// #         let length = actions.len();
/// #         Ok(Output { actions: &self.1[..length], more: false })
/// #     }
/// # }
/// # fn plugin(act: Act) -> Plugin {
/// #     Plugin(act, Vec::new())
/// # }
/// let sender = plugin(|event, actions| match event {
///     Event::JobBegin { job, .. } => actions.push(&Action::Want { job: *job, bytes: 1_000 }),
///     Event::JobData { bytes, .. } => actions.transmit(bytes),
///     Event::JobEnd { job } => actions.push(&Action::JobDone { job: *job, sent: 4 }),
///     _ => Ok(()),
/// });
/// let mut line = VirtualLine::new(sender, LinkOptions::default(), 16);
/// let mut host = Recorder::default();
/// line.link.open(Micros(0), &mut host)?;
/// host.add_source(JobId(7), b"G1X2".to_vec());
/// let job = Job { id: JobId(7), kind: 0, size: Some(4), fields: Vec::new(), check: false };
/// line.link.begin_job(Micros(0), job, &mut host)?;
/// line.transmit(Micros(0), &mut host)?;
/// assert_eq!(host.sent(), b"G1X2");
/// assert!(host.observed.contains(&(Micros(0), Observed::Done { job: JobId(7), sent: 4 })));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Hash, Debug)]
pub struct Job {
    /// Its id, not 0 and not used before on this link.
    pub id: JobId,
    /// Place of its kind in the manifest.
    pub kind: u16,
    /// Bytes of data, if known.
    pub size: Option<u64>,
    /// Its fields as value records.
    pub fields: Vec<u8>,
    /// Feed the data once as a check before carrying the job out.
    pub check: bool,
}

/// A job that the plug-in knows of.
#[derive(Clone, Hash, Debug)]
pub(crate) struct ActiveJob {
    pub(crate) job: Job,
    pub(crate) pass: Pass,
    /// The check was good: begin it for good.
    pub(crate) run_next: bool,
    /// Bytes asked for and not yet given.
    wanted: u64,
    data_ended: bool,
}

impl ActiveJob {
    pub(crate) fn new(job: Job) -> Self {
        let pass = if job.check { Pass::Check } else { Pass::Run };
        Self { job, pass, run_next: false, wanted: 0, data_ended: false }
    }

    /// From the check to the run.
    pub(crate) fn start_run(&mut self) {
        self.pass = Pass::Run;
        self.run_next = false;
        self.wanted = 0;
        self.data_ended = false;
    }

    pub(crate) fn want(&mut self, bytes: u32) {
        self.wanted = self.wanted.saturating_add(u64::from(bytes));
    }

    /// How many bytes may be given in one event; `None` if none were asked for.
    pub(crate) fn hungry(&self, input_capacity: usize) -> Option<usize> {
        if self.wanted == 0 || self.data_ended || self.run_next {
            return None;
        }
        let capacity = (input_capacity - 4).min(limits::RECORD_BYTES);
        Some(usize::try_from(self.wanted).unwrap_or(capacity).min(capacity))
    }

    pub(crate) fn given(&mut self, bytes: usize) {
        self.wanted = self.wanted.saturating_sub(bytes as u64);
    }

    pub(crate) fn end_data(&mut self) {
        self.data_ended = true;
    }
}
