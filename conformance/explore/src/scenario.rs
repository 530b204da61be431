//! What is explored: a plan with what is changed of it, for one plug-in.

use crate::ExploreError;
use crate::end::JobGiven;
use crate::partner::{Partner, Unjudged};
use crate::plans::Plan;
use crate::promise::{Ambiguous, Guard};
use softplug_abi::manifest::{Manifest, SettingValues};
use softplug_abi::{LineParameters, Micros};
use softplug_link::LinkOptions;
use softplug_models::{Conditions, Model, Profile, Settings};
use std::sync::Arc;

/// When the links are opened.
pub(crate) const BEGIN: Micros = Micros(1_000_000);

/// Settings and jobs in place of a plan's.
///
/// ```
/// use softplug_explore::Changes;
///
/// let changes = Changes { jobs: [Some(vec![b"G1".to_vec()]), None], ..Changes::default() };
/// assert!(changes.settings[0].is_empty());
/// ```
#[derive(Clone, Debug, Default)]
pub struct Changes {
    /// Settings of each end.
    pub settings: [Vec<(String, String)>; 2],
    /// Jobs of each end.
    pub jobs: [Option<Vec<Vec<u8>>>; 2],
    /// The plug-in is not held to the profile's model: only the promises count.
    pub without_model: bool,
}

/// What the plug-ins on the line are given from the start.
///
/// The example of [`Exploration`](crate::Exploration) looks at one.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Setup {
    /// Settings of each plug-in, as they were asked for.
    pub settings: [Vec<(String, String)>; 2],
    /// Jobs of each plug-in.
    pub jobs: [Vec<Vec<u8>>; 2],
    /// The characters on the line.
    pub line: LineParameters,
    /// Bytes of deliveries that the host takes before it has to put them away.
    pub delivery_room: u32,
    /// When the link was opened.
    pub begin: Micros,
}

/// What is explored.
#[derive(Clone, Debug)]
pub(crate) struct Scenario {
    pub(crate) alphabet: &'static [u8],
    pub(crate) guard: Guard,
    pub(crate) may_conflict: bool,
    pub(crate) has_pieces: bool,
    pub(crate) jobs: [Vec<JobGiven>; 2],
    pub(crate) ambiguous: [Ambiguous; 2],
    pub(crate) manifest: Arc<Manifest>,
    /// As they were asked for.
    pub(crate) asked: [Vec<(String, String)>; 2],
    line: LineParameters,
    settings: [SettingValues; 2],
    delivery_room: Option<u32>,
    model: Option<&'static Profile>,
    make_partner: Option<fn() -> Box<dyn Partner>>,
    /// The partner knows these settings.
    is_judged: bool,
}

impl Scenario {
    pub(crate) fn new(
        plan: &Plan,
        manifest: &Manifest,
        changes: &Changes,
    ) -> Result<Self, ExploreError> {
        let asked = [0, 1].map(|end| {
            let own = plan.settings.iter().chain(plan.of_each[end]);
            let own = own.map(|(name, value)| ((*name).to_owned(), (*value).to_owned()));
            let mut asked: Vec<(String, String)> = Vec::new();
            for (name, value) in own.chain(changes.settings[end].iter().cloned()) {
                asked.retain(|(known, _)| *known != name);
                asked.push((name, value));
            }
            asked
        });
        let resolve = |asked: &[(String, String)]| {
            let named = asked.iter().map(|(name, value)| (name.as_str(), value.as_str()));
            manifest
                .resolve_settings(named)
                .map_err(|error| ExploreError::Setting(error.to_string()))
        };
        let settings = [resolve(&asked[0])?, resolve(&asked[1])?];
        let kind = manifest.jobs.first().map(|kind| kind.name.clone()).unwrap_or_default();
        let check = manifest.needs.check_pass;
        let job = |data: &[u8]| JobGiven { kind: kind.clone(), place: 0, check, data: data.into() };
        let jobs: [Vec<_>; 2] = [0, 1].map(|end| match &changes.jobs[end] {
            Some(jobs) => jobs.iter().map(|data| job(data)).collect(),
            None => plan.jobs[end].iter().map(|data| job(data)).collect(),
        });
        if manifest.jobs.is_empty() && !jobs.iter().all(Vec::is_empty) {
            return Err(ExploreError::NoJob);
        }
        if plan.make_partner.is_some()
            && (changes.jobs[1].is_some() || changes.settings[1] != changes.settings[0])
        {
            return Err(ExploreError::NoPeer { name: plan.name });
        }
        Ok(Self {
            model: softplug_models::profile(plan.profile).filter(|_| !changes.without_model),
            manifest: Arc::new(manifest.clone()),
            alphabet: plan.alphabet,
            guard: plan.guard,
            may_conflict: plan.may_conflict,
            has_pieces: plan.has_pieces,
            ambiguous: [0, 1].map(|end| Ambiguous::of(jobs[end].iter().map(|job| &*job.data))),
            jobs,
            asked,
            line: plan.line,
            delivery_room: plan.delivery_room,
            settings,
            make_partner: plan.make_partner,
            is_judged: changes.settings[0].is_empty(),
        })
    }

    pub(crate) fn options(&self, end: usize) -> LinkOptions {
        let usual = LinkOptions::default();
        LinkOptions {
            line: self.line,
            settings: self.settings[end].clone(),
            delivery_room: self.delivery_room.unwrap_or(usual.delivery_room),
            ..usual
        }
    }

    /// The machine at the other end, if it is one. With other settings than the plan's it judges
    /// nothing.
    pub(crate) fn partner(&self) -> Option<Box<dyn Partner>> {
        let partner = self.make_partner?();
        Some(if self.is_judged { partner } else { Box::new(Unjudged(partner)) })
    }

    /// Whether the host may let deliveries wait.
    pub(crate) fn has_small_room(&self) -> bool {
        self.delivery_room.is_some()
    }

    /// The profile's model, if it has one for these settings.
    pub(crate) fn model(&self, end: usize) -> Option<Box<dyn Model>> {
        let LinkOptions { line, transmit_room, delivery_room, modem_lines, settings } =
            self.options(end);
        let conditions = Conditions {
            line,
            depth: 1,
            transmit_room,
            delivery_room,
            modem_lines,
            settings: Settings::new(&self.manifest, &settings),
            clock: Micros::ZERO,
            pieces: usize::MAX,
            has_sizes: true,
            job_base: 0,
            is_preset: false,
            long: None,
            is_usual: false,
        };
        (self.model?.start)(&conditions)
    }

    pub(crate) fn line(&self) -> LineParameters {
        self.line
    }

    pub(crate) fn setup(&self) -> Setup {
        let jobs_of =
            |end: usize| self.jobs[end].iter().map(|job| job.data.to_vec()).collect::<Vec<_>>();
        Setup {
            settings: self.asked.clone(),
            jobs: [jobs_of(0), jobs_of(1)],
            line: self.line,
            delivery_room: self.options(0).delivery_room,
            begin: BEGIN,
        }
    }
}
