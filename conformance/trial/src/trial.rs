//! A job in virtual time, with a partner that wants it.

use std::error::Error;
use std::io::{Read, Seek};

use softplug_abi::{Instance, JobId, Micros};
use softplug_link::{Job, LinkFault, LinkOptions};

use crate::budget::{Budget, Metered, MeteredFault};
use crate::closed_loop::ClosedLoop;
use crate::error::TrialError;
use crate::exchange::Exchange;
use crate::paper::{Keep, Paper};
use crate::setup::Setup;
use crate::tried::Tried;
use crate::willing::Willing;

pub(crate) const JOB: u32 = 1;
/// A plug-in that sends nothing for so long waits for a partner that is not there.
const PATIENCE: Micros = Micros::from_secs(3_600);

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
        let job = Job { id: JobId(JOB), kind: job_kind, size: Some(size), fields, check };
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
