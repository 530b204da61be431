//! A state: two ends, and what is on its way between them.

mod choices;
mod judge;

use crate::choice::{Choice, Damage};
use crate::course::Course;
use crate::end::{Did, Ended, JobGiven, PlugIn};
use crate::hash::Hash128;
use crate::held::Held;
use crate::instance::Shared;
use crate::log::Log;
use crate::partner::Partner;
use crate::promise::{Breach, STX, Wrong};
use crate::scenario::{BEGIN, Scenario};
use softplug_abi::{LineErrorKind, LinkDownReason, Micros};
use softplug_models::{Given, HostRequest, LineInput, Step};
use std::collections::VecDeque;
use std::hash::Hash;
use std::sync::Arc;

/// How long a character that comes too late comes after the timer; what the host asks for, and a
/// character that nobody sent, behind what happened; and a second copy behind the first. Within one
/// instant there would be an order that no trace can say.
const BEHIND: Micros = Micros(1);

/// Two ends and the line between them.
pub(crate) struct World {
    pub(crate) now: Micros,
    ends: [End; 2],
    /// Characters on their way to each end, in the order of their arrival.
    ways: [VecDeque<Arriving>; 2],
    courses: [Course; 2],
    wrong: Wrong,
    faults_left: u8,
    scenario: Arc<Scenario>,
}

/// What stands at an end of the line.
enum End {
    PlugIn(Box<PlugIn>),
    Partner(Box<dyn Partner>),
}

#[derive(Copy, Clone, Hash, Debug)]
struct Arriving {
    at: Micros,
    byte: u8,
    damage: Option<LineErrorKind>,
    /// It is read a character later than it came, together with what has come then.
    is_late: bool,
}

/// What a choice led to, besides another state.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(crate) struct Outcome {
    /// What must never be.
    pub(crate) breach: Option<Breach>,
    /// Why the plug-in cannot be explored.
    pub(crate) unexplorable: Option<String>,
    /// What the protocol cannot keep from happening.
    pub(crate) unavoidable: Vec<&'static str>,
}

impl World {
    /// Both ends, open, and what must never be and came of that. With `is_logged` all that is
    /// given and done is written down.
    pub(crate) fn open(
        scenario: &Arc<Scenario>,
        sandboxes: &[Shared],
        faults: u8,
        is_logged: bool,
    ) -> Result<(Self, Option<Breach>), Ended> {
        let partner = scenario.partner();
        let now = BEGIN;
        let plugin = |end: usize| {
            let options = scenario.options(end);
            let model = scenario.model(end);
            let held = model.map(|model| Held::new(model, Arc::clone(&scenario.manifest)));
            PlugIn::new(&sandboxes[end], options, scenario.jobs[end].clone(), held, is_logged)
        };
        let first = End::PlugIn(Box::new(plugin(0)));
        let second = partner.map_or_else(|| End::PlugIn(Box::new(plugin(1))), End::Partner);
        let mut world = Self {
            now,
            ends: [first, second],
            ways: [VecDeque::new(), VecDeque::new()],
            courses: [Course::default(), Course::default()],
            wrong: Wrong::default(),
            faults_left: faults,
            scenario: Arc::clone(scenario),
        };
        let open = Step::Given(Given::Host(HostRequest::Open));
        let mut outcome = Outcome::default();
        for end in 0..2 {
            world.ask(end, &mut outcome, &open)?;
        }
        world.settle()?;
        Ok((world, outcome.breach))
    }

    /// A second world in the same state.
    pub(crate) fn fork(&self) -> Self {
        let fork = |end: &End| match end {
            End::PlugIn(plugin) => End::PlugIn(Box::new(plugin.fork())),
            End::Partner(partner) => End::Partner(partner.fork()),
        };
        Self {
            now: self.now,
            ends: [fork(&self.ends[0]), fork(&self.ends[1])],
            ways: self.ways.clone(),
            courses: self.courses.clone(),
            wrong: self.wrong,
            faults_left: self.faults_left,
            scenario: Arc::clone(&self.scenario),
        }
    }

    /// Goes on in these sandboxes.
    pub(crate) fn move_to(&mut self, sandboxes: &[Shared]) {
        for (end, sandbox) in self.ends.iter_mut().zip(sandboxes) {
            if let End::PlugIn(plugin) = end {
                plugin.move_to(sandbox);
            }
        }
    }

    /// Equal for worlds of which the same can come.
    pub(crate) fn hash(&self) -> u128 {
        let mut state = Hash128::new();
        for end in &self.ends {
            match end {
                End::PlugIn(plugin) => plugin.hash(self.now, &mut state),
                End::Partner(partner) => partner.hash(self.now, &mut state),
            }
        }
        for way in &self.ways {
            way.len().hash(&mut state);
            for Arriving { at, byte, damage, is_late } in way {
                (at.0 - self.now.0, byte, damage, is_late).hash(&mut state);
            }
        }
        (&self.courses, self.wrong, self.faults_left).hash(&mut state);
        state.finish_128()
    }

    /// Makes a choice that is among the [choices](Self::choices).
    pub(crate) fn make(&mut self, choice: Choice) -> Outcome {
        let mut outcome = Outcome::default();
        if choice.is_fault() {
            self.faults_left -= 1;
            self.wrong.count += 1;
        }
        if let Some(end) = choice.way() {
            self.wrong.towards[end].any = true;
            if matches!(choice, Choice::Altered(..) | Choice::Inserted(..) | Choice::Doubled(_)) {
                self.wrong.towards[end].forged = true;
            }
            self.wrong.towards[end].begun_anew |=
                matches!(choice, Choice::Altered(_, STX) | Choice::Inserted(_, STX));
            self.wrong.towards[end].broken |= matches!(choice, Choice::Damaged(_, Damage::Break));
        }
        if let Some(end) = choice.asked() {
            self.wrong.asked[end] = true;
            self.wrong.forced[end] |= matches!(choice, Choice::Force(_));
        }
        let made = self.happens(choice, &mut outcome).and_then(|()| self.settle());
        match made {
            Err(Ended::Fault(message)) => outcome.breach = Some(Breach::Fault { message }),
            Err(Ended::Unexplorable(why)) => outcome.unexplorable = Some(why),
            Ok(()) if outcome.breach.is_none() && self.next().is_none() => {
                outcome.breach = self.at_rest();
            }
            Ok(()) => {}
        }
        outcome
    }

    /// When a choice happens.
    pub(crate) fn time_of(&self, choice: Choice) -> Micros {
        if choice.of_what_is_due() {
            self.next().map_or(self.now, |(at, _)| at)
        } else {
            self.now + BEHIND
        }
    }

    fn happens(&mut self, choice: Choice, outcome: &mut Outcome) -> Result<(), Ended> {
        // Of a character that is lost or late nothing happens when it would have arrived.
        if !matches!(
            choice,
            Choice::Lost(_) | Choice::AtTimer(_) | Choice::AfterTimer(_) | Choice::Late(_)
        ) {
            self.now = self.time_of(choice);
        }
        match choice {
            Choice::Next => match self.next() {
                Some((_, due)) => self.happens_as_due(due, outcome),
                None => Ok(()),
            },
            Choice::Lost(end) => {
                self.ways[end].pop_front();
                Ok(())
            }
            Choice::Doubled(end) => {
                if let Some(coming) = self.ways[end].front().copied() {
                    let again = Arriving { at: self.now + BEHIND, ..coming };
                    self.ways[end].insert(1, again);
                }
                self.arrival(end, outcome)
            }
            Choice::Altered(end, byte) => {
                self.ways[end].iter_mut().take(1).for_each(|coming| coming.byte = byte);
                self.arrival(end, outcome)
            }
            Choice::Damaged(end, damage) => {
                let damage = Some(damage.kind());
                self.ways[end].iter_mut().take(1).for_each(|coming| coming.damage = damage);
                self.arrival(end, outcome)
            }
            Choice::AtTimer(end) => {
                self.delay(end, Micros::ZERO);
                Ok(())
            }
            Choice::AfterTimer(end) => {
                self.delay(end, BEHIND);
                Ok(())
            }
            Choice::Late(end) => {
                let character = self.scenario.line().characters(1);
                self.ways[end].iter_mut().take(1).for_each(|coming| {
                    coming.at = coming.at + character;
                    coming.is_late = true;
                });
                Ok(())
            }
            Choice::Inserted(end, byte) => {
                let coming = Arriving { at: self.now, byte, damage: None, is_late: false };
                self.ways[end].push_front(coming);
                self.arrival(end, outcome)
            }
            Choice::Begin(end) => {
                self.courses[end].begin();
                self.tell_partner_of_job(end);
                self.request(end, outcome, PlugIn::begin_job)
            }
            Choice::Abort(end) => {
                self.request(end, outcome, |plugin| plugin.job().map(HostRequest::Abort))
            }
            Choice::AbortDelivery(end) => {
                self.request(end, outcome, |_| Some(HostRequest::Abort(0)))
            }
            Choice::Pause(end) => {
                self.request(end, outcome, |plugin| plugin.job().map(HostRequest::Pause))
            }
            Choice::Resume(end) => {
                self.request(end, outcome, |plugin| plugin.job().map(HostRequest::Resume))
            }
            Choice::Force(end) => {
                if let End::Partner(partner) = &mut self.ends[1 - end] {
                    partner.is_forced();
                }
                self.request(end, outcome, |_| Some(HostRequest::ForceResume))
            }
            Choice::Down(end) => {
                let input = LineInput::Down(LinkDownReason::Unplugged);
                self.ask(end, outcome, &Step::Given(Given::Line(input)))
            }
            Choice::Up(end) => {
                if let End::Partner(partner) = &mut self.ends[1 - end] {
                    partner.port_is_back();
                }
                self.ask(end, outcome, &Step::Given(Given::Line(LineInput::Up)))
            }
            Choice::Swap(end) => self.ask(end, outcome, &Step::Swap),
            Choice::Keep(end) => self.request(end, outcome, |_| Some(HostRequest::Keep)),
            Choice::PutAway(end) => self.request(end, outcome, |_| Some(HostRequest::PutAllAway)),
        }
    }

    fn request(
        &mut self,
        end: usize,
        outcome: &mut Outcome,
        request: impl FnOnce(&PlugIn) -> Option<HostRequest>,
    ) -> Result<(), Ended> {
        let End::PlugIn(plugin) = &self.ends[end] else { return Ok(()) };
        let Some(request) = request(plugin) else { return Ok(()) };
        self.ask(end, outcome, &Step::Given(Given::Host(request)))
    }

    /// Everything on the way to this end comes later, the first one with or after its timer.
    fn delay(&mut self, end: usize, after: Micros) {
        let timer = self.timer_of(end);
        if let (Some(timer), Some(first)) = (timer, self.ways[end].front().copied()) {
            let later = timer + after - first.at;
            self.ways[end].iter_mut().for_each(|coming| coming.at = coming.at + later);
        }
    }

    fn tell_partner_of_job(&mut self, end: usize) {
        let [first, second] = &mut self.ends;
        let (own, other) = if end == 0 { (first, second) } else { (second, first) };
        if let (End::PlugIn(plugin), End::Partner(partner)) = (own, other)
            && let Some(JobGiven { data, .. }) = plugin.next_job()
        {
            partner.begins(data);
        }
    }

    fn timer_of(&self, end: usize) -> Option<Micros> {
        match &self.ends[end] {
            End::PlugIn(plugin) => plugin.next_timer(),
            End::Partner(partner) => partner.next(),
        }
    }

    /// Something happens at an end where a plug-in is.
    fn ask(&mut self, end: usize, outcome: &mut Outcome, step: &Step) -> Result<(), Ended> {
        let End::PlugIn(plugin) = &mut self.ends[end] else { return Ok(()) };
        let cut = match step {
            Step::Given(Given::Line(LineInput::Bytes(bytes))) if bytes.len() > 1 => {
                Some(plugin.in_single_bytes(self.now, step)?)
            }
            _ => None,
        };
        let did = plugin.instant(self.now, step)?;
        let is_same = cut.is_none_or(|cut| cut == did);
        self.take(end, did, outcome);
        if !is_same && outcome.breach.is_none() {
            outcome.breach = Some(Breach::Cut);
        }
        Ok(())
    }

    fn arrival(&mut self, end: usize, outcome: &mut Outcome) -> Result<(), Ended> {
        let Some(Arriving { byte, damage, is_late, .. }) = self.ways[end].pop_front() else {
            return Ok(());
        };
        let mut bytes = vec![byte];
        if is_late {
            let now = self.now;
            let is_with_it = |coming: &mut Arriving| coming.at <= now && coming.damage.is_none();
            let behind = std::iter::from_fn(|| self.ways[end].pop_front_if(is_with_it));
            bytes.extend(behind.map(|coming| coming.byte));
        }
        let is_down = matches!(&self.ends[end], End::PlugIn(plugin) if plugin.is_down());
        if let End::Partner(partner) = &mut self.ends[1 - end]
            && !is_down
        {
            for byte in &bytes {
                partner.arrives(self.now, *byte, damage);
            }
        }
        match &mut self.ends[end] {
            // What arrives at a port that is gone is lost.
            End::PlugIn(_) if is_down => {}
            End::PlugIn(_) => {
                let input = match damage {
                    None => LineInput::Bytes(bytes),
                    // A break has no character.
                    Some(kind @ LineErrorKind::Break) => {
                        LineInput::Damaged { kind, byte: None, span: 0 }
                    }
                    Some(kind) => LineInput::Damaged { kind, byte: Some(byte), span: 0 },
                };
                self.ask(end, outcome, &Step::Given(Given::Line(input)))?;
            }
            End::Partner(partner) => {
                let sent = partner.receive(self.now, byte, damage);
                self.put_on_way(end, sent.left);
            }
        }
        Ok(())
    }

    fn tick(&mut self, end: usize, outcome: &mut Outcome) -> Result<(), Ended> {
        match &mut self.ends[end] {
            End::PlugIn(_) => self.ask(end, outcome, &Step::Given(Given::Nothing))?,
            End::Partner(partner) => {
                let sent = partner.tick(self.now);
                self.put_on_way(end, sent.left);
            }
        }
        Ok(())
    }

    /// What a plug-in did goes on its way.
    fn take(&mut self, end: usize, did: Did, outcome: &mut Outcome) {
        let now = self.now;
        if let End::Partner(partner) = &mut self.ends[1 - end] {
            partner.timers_ran(now);
        }
        // At one instant the transmitter runs last.
        for told in &did.told {
            let breach = self.told(end, told);
            self.judge(breach, outcome);
        }
        if let End::Partner(partner) = &mut self.ends[1 - end] {
            let breaches = did.left.iter().map(|(at, byte)| partner.leaves(*at, *byte));
            let breach = breaches.flatten().next();
            self.judge(breach.map(|breach| (breach, end)), outcome);
        }
        self.put_on_way(end, did.left);
        if outcome.breach.is_none() {
            outcome.breach = did.broken.map(Breach::from);
        }
    }

    fn put_on_way(&mut self, from: usize, left: Vec<(Micros, u8)>) {
        let character = self.scenario.line().characters(1);
        let way = &mut self.ways[1 - from];
        for (at, byte) in left {
            // None overtakes another that comes late.
            let at = match way.back() {
                Some(before) if before.is_late => at.max(before.at),
                Some(before) => at.max(before.at + character),
                None => at,
            };
            way.push_back(Arriving { at, byte, damage: None, is_late: false });
        }
    }

    /// Whether a job or a delivery is under way.
    pub(crate) fn is_under_way(&self) -> bool {
        self.plugins().any(|(_, plugin)| plugin.job().is_some() || plugin.has_delivery())
    }

    fn plugins(&self) -> impl Iterator<Item = (usize, &PlugIn)> {
        self.ends.iter().enumerate().filter_map(|(at, end)| match end {
            End::PlugIn(plugin) => Some((at, &**plugin)),
            End::Partner(_) => None,
        })
    }

    /// What is due next: at one time, what comes from the line goes first.
    fn next(&self) -> Option<(Micros, Due)> {
        self.due().min()
    }

    /// The next of each kind.
    fn due(&self) -> impl Iterator<Item = (Micros, Due)> {
        let arrival = |end: usize| {
            self.ways[end].front().map(|coming| (coming.at.max(self.now), Due::Arrival(end)))
        };
        let tick = |end: usize| {
            let next = match &self.ends[end] {
                End::PlugIn(plugin) => plugin.next(),
                End::Partner(partner) => partner.next(),
            };
            next.map(|at| (at.max(self.now), Due::Tick(end)))
        };
        [arrival(0), arrival(1), tick(0), tick(1)].into_iter().flatten()
    }

    fn happens_as_due(&mut self, due: Due, outcome: &mut Outcome) -> Result<(), Ended> {
        match due {
            Due::Arrival(end) => self.arrival(end, outcome),
            Due::Tick(end) => self.tick(end, outcome),
        }
    }

    fn settle(&mut self) -> Result<(), Ended> {
        for end in &mut self.ends {
            if let End::PlugIn(plugin) = end {
                plugin.settle(self.now)?;
            }
        }
        Ok(())
    }

    pub(crate) fn into_logs(self) -> Vec<Log> {
        let logs = self.ends.into_iter().filter_map(|end| match end {
            End::PlugIn(plugin) => plugin.into_log(),
            End::Partner(_) => None,
        });
        logs.collect()
    }
}

#[derive(Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
enum Due {
    Arrival(usize),
    Tick(usize),
}

impl Due {
    #[cfg(test)]
    fn end(self) -> usize {
        match self {
            Self::Arrival(end) | Self::Tick(end) => end,
        }
    }
}

#[cfg(test)]
impl World {
    /// What comes of two things that are due at one instant at different ends, in the order in which
    /// they are tried, and in the other one.
    pub(crate) fn in_both_orders(&self) -> Option<[u128; 2]> {
        let mut due: Vec<_> = self.due().collect();
        due.sort();
        let (at, first) = *due.first()?;
        let (_, second) =
            *due.iter().find(|(time, due)| *time == at && due.end() != first.end())?;
        Some([[first, second], [second, first]].map(|order| {
            let mut world = self.fork();
            world.now = at;
            for due in order {
                world.happens_as_due(due, &mut Outcome::default()).unwrap();
                world.settle().unwrap();
            }
            world.hash()
        }))
    }
}
