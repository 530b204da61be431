//! One run of a flight recording: the plug-in is given exactly the events that
//! another instance of it was given on a live line.

use super::fault::{Fault, FaultClass};
use super::outcome::Outcome;
use super::subject::{Fuel, Subject};
use super::watched::{Meter, Watched};
use crate::given::case::Case;
use crate::given::timeline::micros;
use softplug_abi::{DeliveryId, Event, EventKind, JobId, Micros, Pass, RequestId};
use softplug_link::{Recorder, Rerun, UnderWay};
use softplug_trace::{Assignment, Entry, Exact, Given, PayloadError, What};
use std::rc::Rc;

/// Nothing is demanded of the plug-in but that it does not fail.
pub(crate) fn rerun<S: Subject>(subject: &S, case: &Case) -> Outcome {
    let meter = Rc::new(Meter::default());
    let mut bytes = 0;
    let fault = run(subject, case, &meter, &mut bytes).err();
    let fuel: Fuel = meter.fuel.get();
    let (seen, began) = (Vec::new(), Micros::ZERO);
    Outcome { seen, fault, began, swap_places: 0, is_delivering: false, fuel, bytes }
}

fn run<S: Subject>(
    subject: &S,
    case: &Case,
    meter: &Rc<Meter>,
    bytes: &mut u64,
) -> Result<(), Fault> {
    let instance = Watched::start(subject, Rc::clone(meter))
        .map_err(|error| Fault::new(FaultClass::NotStarted, Micros::ZERO, &error))?;
    let mut entries = case.trace.entries().filter(|entry| entry.what != What::Quiet).peekable();
    let under_way = match entries.peek().map(|entry| &entry.what) {
        Some(What::Given(Given::Exact(Exact::UnderWay(facts)))) => {
            let known = under_way(facts).map_err(|error| unfit(&error.to_string()))?;
            entries.next();
            known
        }
        _ => UnderWay::default(),
    };
    let mut rerun = Rerun::new(instance, &under_way);
    let mut out = Recorder::default();
    for entry in entries {
        let (kind, payload) = event(case, entry)
            .map_err(|reason| unfit(&format!("line {}: {reason}", entry.line.0)))?;
        let event = Event::decode(kind, &payload).map_err(|reason| {
            unfit(&format!("line {}: the payload of \"{kind}\" is {reason}", entry.line.0))
        })?;
        if let Event::Received(received) = &event {
            *bytes += received.len() as u64;
        }
        let at = micros(entry.when.from);
        rerun.give(at, &event, &mut out).map_err(|fault| Fault::of_link(at, &fault))?;
        out.observed.clear();
        out.drain(u32::MAX);
    }
    Ok(())
}

/// What of a flight recording cannot be given again.
#[derive(Debug, thiserror::Error)]
enum Unfit {
    #[error("a flight recording holds `@` and `.` lines only, under-way first")]
    Line,
    #[error("\"{0}\" is no event of the ABI")]
    Event(String),
    #[error(transparent)]
    Payload(#[from] PayloadError),
    #[error("under-way: {name} is no number: \"{value}\"")]
    Number { name: String, value: String },
    #[error("under-way: pass is run or check")]
    Pass,
    #[error("under-way: requests are numbers with commas between, not \"{0}\"")]
    Requests(String),
    #[error("under-way: \"{0}\" is not known")]
    Fact(String),
}

fn unfit(reason: &str) -> Fault {
    Fault::new(FaultClass::NotApplicable, Micros::ZERO, reason)
}

fn event(case: &Case, entry: &Entry) -> Result<(EventKind, Vec<u8>), Unfit> {
    let What::Given(Given::Exact(Exact::Event { name, payload })) = &entry.what else {
        return Err(Unfit::Line);
    };
    let kind = EventKind::from_name(name).ok_or_else(|| Unfit::Event(name.clone()))?;
    Ok((kind, payload.bytes(&case.files())?))
}

fn under_way(facts: &[Assignment]) -> Result<UnderWay, Unfit> {
    let mut known = UnderWay::default();
    let mut pass = Pass::Run;
    for Assignment { name, value } in facts {
        let number = || {
            let wrong = |_| Unfit::Number { name: name.clone(), value: value.clone() };
            value.parse::<u32>().map_err(wrong)
        };
        match name.as_str() {
            "job" => known.job = Some((JobId(number()?), pass)),
            "pass" => {
                pass = match value.as_str() {
                    "run" => Pass::Run,
                    "check" => Pass::Check,
                    _ => return Err(Unfit::Pass),
                };
                known.job = known.job.map(|(job, _)| (job, pass));
            }
            "delivery" => known.delivery = Some(DeliveryId(number()?)),
            "marks" => known.marks = number()?,
            "requests" => {
                let ids: Result<_, _> =
                    value.split(',').map(|id| id.parse().map(RequestId)).collect();
                known.requests = ids.map_err(|_| Unfit::Requests(value.clone()))?;
            }
            _ => return Err(Unfit::Fact(name.clone())),
        }
    }
    Ok(known)
}
