//! What is explored of a profile: settings, jobs, and what can stand in a character's place.

use crate::ExploreError;
use crate::end::JobGiven;
use crate::partner::{Partner, Reader};
use crate::promise::Guard;
use softplug_abi::{LineParameters, Micros};
use softplug_abi::manifest::{Manifest, SettingValues};
use softplug_link::LinkOptions;
use softplug_models::{Conditions, Model, Profile, Settings};
use std::sync::Arc;

/// How a profile is explored by default.
///
/// ```
/// let plan = softplug_explore::plan("r3964")?;
/// assert_eq!((plan.partner, plan.jobs[0]), ("a second plug-in", &[&b"A\x10"[..]][..]));
/// # Ok::<(), softplug_explore::ExploreError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// The profile.
    pub profile: &'static str,
    /// What stands at the other end.
    pub partner: &'static str,
    /// Settings that are not as the manifest says.
    pub settings: &'static [(&'static str, &'static str)],
    /// The same, of each end.
    pub of_each: [&'static [(&'static str, &'static str)]; 2],
    /// The jobs of each end, one after the other.
    pub jobs: [&'static [&'static [u8]]; 2],
    /// Characters that come in place of another, or out of nothing: one of each class that the
    /// protocol tells apart.
    pub alphabet: &'static [u8],
    /// The characters on the line: each takes a whole ms, so that no rounding tells states apart.
    pub line: LineParameters,
    pub(crate) guard: Guard,
    pub(crate) make_partner: Option<fn() -> Box<dyn Partner>>,
}

/// Short waits, of which none is another's multiple.
const SHORT: &[(&str, &str)] = &[("qvz", "60"), ("zvz", "35"), ("bwz", "170")];
const SHORT_WITHOUT_CHECK: &[(&str, &str)] =
    &[("bcc", "off"), ("qvz", "60"), ("zvz", "35"), ("bwz", "170")];
const FEW_LOW: &[(&str, &str)] =
    &[("priority", "low"), ("setup_attempts", "2"), ("transmission_attempts", "2")];
const FEW_HIGH: &[(&str, &str)] =
    &[("priority", "high"), ("setup_attempts", "2"), ("transmission_attempts", "2")];

/// Eight bits, one of start and one of stop.
const TEN_BITS: LineParameters = LineParameters::new(10_000);

const R3964: Plan = Plan {
    profile: "r3964",
    partner: "a second plug-in",
    settings: SHORT,
    of_each: [FEW_LOW, FEW_HIGH],
    jobs: [&[b"A\x10"], &[]],
    // STX, DLE, ETX, NAK, and a character that is none of them.
    alphabet: &[0x02, 0x10, 0x03, 0x15, 0x41],
    line: TEN_BITS,
    guard: Guard::Checked,
    make_partner: None,
};

/// Every profile that can be explored.
pub const PLANS: &[Plan] = &[
    R3964,
    Plan { profile: "3964", settings: SHORT_WITHOUT_CHECK, guard: Guard::Unchecked, ..R3964 },
    Plan { profile: "r3964-simplified", of_each: [&[], &[]], ..R3964 },
    Plan {
        profile: "xon-xoff",
        partner: "a machine that holds and sends",
        settings: &[("quiet_time", "50"), ("held_timeout", "200")],
        of_each: [&[], &[]],
        jobs: [&[b"G1X2\n"], &[]],
        // XON, XOFF, and a character that is neither.
        alphabet: &[0x11, 0x13, 0x41],
        line: TEN_BITS,
        guard: Guard::Open,
        make_partner: Some(|| Box::new(Reader::new())),
    },
];

/// How this profile is explored by default.
///
/// # Errors
/// It cannot be.
pub fn plan(profile: &str) -> Result<Plan, ExploreError> {
    PLANS.iter().find(|plan| plan.profile == profile).copied().ok_or_else(|| {
        let known = PLANS.iter().map(|plan| plan.profile).collect::<Vec<_>>().join(", ");
        ExploreError::NoPlan { profile: profile.to_owned(), known }
    })
}

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

/// What is explored.
#[derive(Clone, Debug)]
pub(crate) struct Scenario {
    pub(crate) alphabet: &'static [u8],
    pub(crate) guard: Guard,
    pub(crate) jobs: [Vec<JobGiven>; 2],
    pub(crate) manifest: Arc<Manifest>,
    /// As they were asked for.
    pub(crate) asked: [Vec<(String, String)>; 2],
    line: LineParameters,
    settings: [SettingValues; 2],
    model: Option<&'static Profile>,
    pub(crate) make_partner: Option<fn() -> Box<dyn Partner>>,
}

impl Scenario {
    pub(crate) fn new(
        plan: &Plan,
        manifest: &Manifest,
        changes: &Changes,
    ) -> Result<Self, ExploreError> {
        let asked = [0, 1].map(|end| {
            let changed = &changes.settings[end];
            let own = plan.settings.iter().chain(plan.of_each[end]).copied();
            let kept = own.filter(|(name, _)| !changed.iter().any(|(other, _)| other == name));
            let mut asked: Vec<(String, String)> =
                kept.map(|(name, value)| (name.to_owned(), value.to_owned())).collect();
            asked.extend_from_slice(changed);
            asked
        });
        let resolve = |asked: &[(String, String)]| {
            let named = asked.iter().map(|(name, value)| (name.as_str(), value.as_str()));
            manifest
                .resolve_settings(named)
                .map_err(|error| ExploreError::Setting(error.to_string()))
        };
        let settings = [resolve(&asked[0])?, resolve(&asked[1])?];
        let kind = manifest.jobs.first().map_or_else(String::new, |kind| kind.name.clone());
        let check = manifest.needs.check_pass;
        let job =
            |data: &[u8]| JobGiven { kind: kind.clone(), place: 0, check, data: data.into() };
        let jobs = [0, 1].map(|end| match &changes.jobs[end] {
            Some(jobs) => jobs.iter().map(|data| job(data)).collect(),
            None => plan.jobs[end].iter().map(|data| job(data)).collect(),
        });
        Ok(Self {
            model: softplug_models::profile(plan.profile).filter(|_| !changes.without_model),
            manifest: Arc::new(manifest.clone()),
            alphabet: plan.alphabet,
            guard: plan.guard,
            jobs,
            asked,
            line: plan.line,
            settings,
            make_partner: plan.make_partner,
        })
    }

    pub(crate) fn options(&self, end: usize) -> LinkOptions {
        LinkOptions {
            line: self.line,
            settings: self.settings[end].clone(),
            ..LinkOptions::default()
        }
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
}
