//! From what ran to the report.

use super::baseline::{Baseline, Expected};
use super::coverage::Measured;
use super::engines::Loaded;
use super::execute::Ran;
use super::options::CertifyOptions;
use super::plan::{Fate, Plan, Planned};
use crate::corpus::Corpus;
use crate::given::ledger::Clause;
use crate::random::Sessions;
use data_encoding::HEXLOWER;
use sha2::{Digest as _, Sha256};
use softplug_report::{
    CaseResult, CaseRow, ClauseRow, Counts, Fuel, PluginInfo, ProfileInfo, Reason, Report, SCHEMA,
    Selection, SuiteInfo, verdict,
};

/// Everything that a report is made of.
pub(super) struct Results<'a> {
    pub(super) corpus: &'a Corpus,
    pub(super) options: &'a CertifyOptions,
    pub(super) loaded: &'a Loaded<'a>,
    pub(super) plan: &'a Plan<'a>,
    /// Why the plug-in cannot be judged.
    pub(super) unfit: Vec<String>,
    /// One for each case of the plan.
    pub(super) ran: Vec<Option<Ran>>,
    /// Only of a plug-in that is conformant.
    pub(super) measured: Option<Measured>,
}

impl Results<'_> {
    pub(super) fn report(&self) -> Report {
        let cases: Vec<CaseRow> =
            self.both().map(|(planned, ran)| self.case_row(planned, ran)).collect();
        let selection = self.selection();
        let clauses = self.clause_rows(&cases);
        let profile = ProfileInfo {
            name: self.plan.ledger.profile.clone(),
            revision: self.plan.revision,
            claimed: self.plan.is_claimed,
            features: self.plan.features.clone(),
        };
        let counts = Counts::of(&cases, &clauses, &profile, &selection);
        let reason = match self.unfit.first() {
            Some(why) => Reason::NotJudged(why.clone()),
            None => match (self.stale(), &self.measured) {
                (Some(why), _) => Reason::Baseline(why),
                (None, Some(Measured::Known(coverage))) => Reason::of(coverage),
                (None, Some(Measured::Unknown)) => Reason::Unmeasured,
                (None, Some(Measured::Stopped) | None) => Reason::None,
            },
        };
        let (verdict, reason) = verdict(&counts, &selection, &reason);
        Report {
            schema: SCHEMA,
            suite: self.suite(),
            plugin: self.plugin(),
            profile,
            selection,
            verdict,
            reason,
            counts,
            digest: self.digest(),
            fuel: self.fuel(),
            coverage: match &self.measured {
                Some(Measured::Known(coverage)) => Some(coverage.clone()),
                Some(Measured::Unknown | Measured::Stopped) | None => None,
            },
            explored: None,
            score: None,
            lint: self.unfit.clone(),
            clauses,
            cases,
        }
    }

    fn both(&self) -> impl Iterator<Item = (&Planned<'_>, Option<&Ran>)> {
        self.plan.cases.iter().zip(self.ran.iter().map(Option::as_ref))
    }

    fn suite(&self) -> SuiteInfo {
        let [engine, second_engine] = self.loaded.engines.clone();
        SuiteInfo {
            name: "softplug".to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            corpus: self.corpus.digest.clone(),
            engine,
            second_engine,
        }
    }

    fn plugin(&self) -> PluginInfo {
        let of = |text: fn(&softplug_abi::manifest::Manifest) -> &String| {
            self.loaded.manifest().map(text).cloned().unwrap_or_default()
        };
        PluginInfo {
            name: of(|manifest| &manifest.name),
            version: of(|manifest| &manifest.version),
            sha256: HEXLOWER.encode(&Sha256::digest(self.loaded.module)),
            bytes: self.loaded.module.len() as u64,
            abi: of(|manifest| &manifest.abi),
        }
    }

    fn selection(&self) -> Selection {
        let is_missing = |(planned, ran): (&Planned<'_>, Option<&Ran>)| {
            planned.fate == Fate::Runs && ran.is_none()
        };
        let whole = Sessions::whole(&self.plan.ledger.profile);
        // A profile without a model has none, whatever was asked for.
        let asked = if whole.count > 0 { self.options.sessions } else { whole };
        Selection {
            strict: self.options.strict,
            cases: self.options.cases.clone(),
            baseline: self.options.baseline.as_ref().map(|baseline| baseline.digest.clone()),
            interrupted: matches!(self.measured, Some(Measured::Stopped))
                || (self.unfit.is_empty() && self.both().any(is_missing)),
            sessions: asked.count,
            sessions_needed: whole.count,
            seed: asked.seed,
        }
    }

    fn case_row(&self, planned: &Planned<'_>, ran: Option<&Ran>) -> CaseRow {
        let case = &planned.case;
        let failed_runs = ran.map_or(0, |ran| ran.failed_runs);
        let failures = ran.map(|ran| ran.failures.clone()).unwrap_or_default();
        CaseRow {
            id: case.id.to_owned(),
            title: case.title.to_owned(),
            kind: case.kind,
            level: case.level,
            clauses: case.clauses.to_vec(),
            since: case.since,
            result: self.result(planned, ran),
            runs: ran.map_or(0, |ran| ran.runs),
            fuel: ran.map_or(0, |ran| ran.fuel.total),
            more_failures: failed_runs - failures.len() as u32,
            failures,
        }
    }

    fn result(&self, planned: &Planned<'_>, ran: Option<&Ran>) -> CaseResult {
        let skipped = |reason: String| CaseResult::Skipped { reason };
        let Some(ran) = ran else {
            return match &planned.fate {
                Fate::Unclaimed(feature) => {
                    skipped(format!("the feature \"{feature}\" is not claimed"))
                }
                Fate::Filtered => skipped("filtered".to_owned()),
                Fate::Runs if self.unfit.is_empty() => skipped("interrupted".to_owned()),
                Fate::Runs => skipped("the plug-in cannot be judged".to_owned()),
            };
        };
        if ran.runs == 0 {
            return skipped("no random session of it was asked for".to_owned());
        }
        if !planned.is_scored {
            return CaseResult::Unscored { passed: ran.failed_runs == 0 };
        }
        if ran.failed_runs == 0 {
            return CaseResult::Passed;
        }
        let entry = self.baseline().and_then(|baseline| baseline.of(planned.case.id));
        match entry.filter(|entry| stale(entry, planned, Some(ran)).is_none()) {
            Some(entry) => CaseResult::ExpectedFailure { reason: entry.reason.clone() },
            None => CaseResult::Failed,
        }
    }

    fn baseline(&self) -> Option<&Baseline> {
        self.options.baseline.as_ref()
    }

    /// What makes the baseline stale.
    fn stale(&self) -> Option<String> {
        let entries = &self.baseline()?.expected;
        let stale: Vec<String> = entries
            .iter()
            .filter_map(|entry| {
                let found = self.both().find(|(planned, _)| planned.case.id == entry.case);
                match found {
                    None => Some("there is no such case".to_owned()),
                    Some((planned, ran)) => stale(entry, planned, ran),
                }
                .map(|why| format!("\"{}\": {why}", entry.case))
            })
            .collect();
        let first = stale.first()?;
        Some(match stale.len() {
            1 => format!("the baseline is stale: {first}"),
            count => format!("the baseline is stale in {count} places; the first: {first}"),
        })
    }
}

impl Results<'_> {
    /// In the order of the cases, whatever the order in which they ran.
    fn digest(&self) -> String {
        let mut digest = Sha256::new();
        for ran in self.ran.iter().flatten() {
            digest.update(&ran.pure);
        }
        HEXLOWER.encode(&digest.finalize())
    }

    /// Of the required cases.
    fn fuel(&self) -> Fuel {
        let required = self
            .both()
            .filter_map(|(planned, ran)| Some((planned, ran?)))
            .filter(|(planned, _)| planned.is_scored);
        let mut fuel = Fuel::default();
        for (planned, ran) in required {
            fuel.units = fuel.units.saturating_add(ran.fuel.total);
            fuel.bytes = fuel.bytes.saturating_add(ran.bytes);
            if ran.fuel.largest > fuel.largest_event {
                fuel.largest_event = ran.fuel.largest;
                planned.case.id.clone_into(&mut fuel.largest_case);
            }
        }
        fuel.tenths_per_byte = fuel.units.saturating_mul(10).checked_div(fuel.bytes).unwrap_or(0);
        fuel
    }

    fn clause_rows(&self, cases: &[CaseRow]) -> Vec<ClauseRow> {
        let row = |clause: &Clause| {
            let citing: Vec<_> =
                cases.iter().filter(|case| case.clauses.contains(&clause.id)).collect();
            let count = |holds: fn(&CaseResult) -> bool| {
                citing.iter().filter(|case| holds(&case.result)).count() as u32
            };
            ClauseRow {
                id: clause.id.clone(),
                level: clause.level,
                sentence: clause.sentence.clone(),
                since: clause.since,
                feature: clause.feature.clone(),
                excluded: clause.excluded.clone(),
                cited: citing.len() as u32,
                executed: count(|result| !matches!(result, CaseResult::Skipped { .. })),
                failed: count(|result| {
                    matches!(
                        result,
                        CaseResult::Failed
                            | CaseResult::ExpectedFailure { .. }
                            | CaseResult::Unscored { passed: false }
                    )
                }),
                mutants: self.corpus.kills.get(&clause.id).copied().unwrap_or(0),
            }
        };
        let mut rows: Vec<_> = self.plan.ledger.clauses.iter().map(row).collect();
        rows.sort_by(|a, b| a.id.cmp(&b.id));
        rows
    }
}

/// Why an entry of the baseline does not hold; none where it does, or where nothing can be said
/// because the case did not run.
fn stale(entry: &Expected, planned: &Planned<'_>, ran: Option<&Ran>) -> Option<String> {
    if entry.reason.trim().is_empty() {
        return Some("it has no reason; write why the failure is accepted".to_owned());
    }
    let Some(ran) = ran else {
        let Fate::Unclaimed(feature) = &planned.fate else { return None };
        return Some(format!("it does not run, the feature \"{feature}\" is not claimed"));
    };
    if ran.failed_runs == 0 {
        return Some("it passes; drop the entry".to_owned());
    }
    let expected = entry.class.name();
    let is_other = |class: &&String| *class != expected;
    let other = ran.classes.iter().find(is_other)?;
    Some(format!("it fails as {other}, {expected} is expected"))
}
