//! Plug-ins that do not end, that wait for a partner, or that break: a trial of each ends, and says
//! why it told nothing.

use std::convert::Infallible;
use std::io::Cursor;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use softplug_abi::manifest::Manifest;
use softplug_abi::{
    Action, ActionWriter, Event, Failure, Instance, JobId, LineParameters, Micros, NoSpace, Output,
};
use softplug_trial::{Budget, CheckResult, Checked, Fate, Setup, Trial, TrialError, WAITS};

/// What a plug-in does at each event. It sees the bytes of its job so far.
type Act = fn(&Event<'_>, Micros, &[u8], &mut ActionWriter<'_>) -> Result<(), NoSpace>;

struct Plugin {
    act: Act,
    data: Vec<u8>,
    output: Vec<u8>,
    fuel: u64,
}

impl Plugin {
    fn new(act: Act) -> Self {
        Self { act, data: Vec::new(), output: vec![0; 4_096], fuel: 0 }
    }
}

impl Instance for Plugin {
    type Fault = NoSpace;

    fn input_capacity(&self) -> usize {
        512
    }

    fn step(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, NoSpace> {
        self.fuel += 500;
        if let Event::JobData { bytes, .. } = event {
            self.data.extend_from_slice(bytes);
        }
        let mut actions = ActionWriter::new(&mut self.output);
        (self.act)(event, now, &self.data, &mut actions)?;
        let length = actions.len();
        Ok(Output { actions: &self.output[..length], more: false })
    }

    fn total_fuel(&self) -> u64 {
        self.fuel
    }
}

fn manifest() -> Manifest {
    let text = r#"{"abi":"1.1","name":"x","version":"1","licence":"MIT","protocol":"x",
        "description":"x","jobs":[{"name":"send","text":"x"}]}"#;
    Manifest::parse(text.as_bytes()).unwrap()
}

fn check(
    act: Act,
    program: &[u8],
    budget: Budget,
) -> Result<Checked, TrialError<Infallible, NoSpace>> {
    let manifest = manifest();
    let settings = manifest.resolve_settings([]).unwrap();
    let setup = Setup::new(&manifest, &settings, LineParameters::new(9_600));
    let trial = Trial::new(setup, || Ok(Plugin::new(act)), budget);
    trial.check(&mut Cursor::new(program), program.len() as u64)
}

/// Sets a timer again and again, and sends nothing.
fn ticking(
    event: &Event<'_>,
    now: Micros,
    _: &[u8],
    actions: &mut ActionWriter<'_>,
) -> Result<(), NoSpace> {
    match event {
        Event::JobBegin { .. } | Event::Timer { .. } => actions.set_timer(0, now + Micros(1)),
        _ => Ok(()),
    }
}

/// Asks, and gives up when no answer has come for a second.
fn asking(
    event: &Event<'_>,
    now: Micros,
    _: &[u8],
    actions: &mut ActionWriter<'_>,
) -> Result<(), NoSpace> {
    match event {
        Event::JobBegin { .. } => {
            actions.transmit(&[0x05])?;
            actions.set_timer(0, now + Micros::from_secs(1))
        }
        Event::Timer { .. } => {
            let failure = Failure::NoAnswer;
            actions.push(&Action::JobFailed { job: JobId(1), failure, status: 0, sent: 0 })
        }
        _ => Ok(()),
    }
}

#[test]
fn an_answer_of_a_protocol_without_a_known_partner_is_no_fault_of_the_program() {
    let error = check(asking, b"G1 X1\n", Budget::units(50_000_000)).unwrap_err();
    assert_eq!(error.to_string(), WAITS);
}

/// Sends without end.
fn babbling(
    event: &Event<'_>,
    now: Micros,
    _: &[u8],
    actions: &mut ActionWriter<'_>,
) -> Result<(), NoSpace> {
    match event {
        Event::JobBegin { .. } | Event::Timer { .. } => {
            actions.transmit(b"babble")?;
            actions.set_timer(0, now + Micros(10_000))
        }
        _ => Ok(()),
    }
}

#[test]
fn what_never_ends_is_given_up() {
    for (name, act) in [("ticking", ticking as Act), ("babbling", babbling)] {
        let error = check(act, b"G1\n", Budget::units(50_000_000)).unwrap_err();
        assert!(matches!(error, TrialError::Spent), "{name}: {error}");
    }
}

#[test]
fn whoever_has_asked_may_stop_it() {
    let stop = Arc::new(AtomicBool::new(true));
    let budget = || Budget::units(u64::MAX - 1).stopped_by(Arc::clone(&stop));
    for act in [ticking as Act, babbling] {
        let error = check(act, b"G1\n", budget()).unwrap_err();
        assert!(matches!(error, TrialError::Stopped), "{error}");
    }
    stop.store(false, Ordering::Relaxed);
    assert_eq!(check(refusing, b"G1\n", budget()).unwrap().result(), CheckResult::Refused);
}

/// Refuses every job that it is given.
fn refusing(
    event: &Event<'_>,
    _: Micros,
    _: &[u8],
    actions: &mut ActionWriter<'_>,
) -> Result<(), NoSpace> {
    match event {
        Event::JobBegin { job, .. } => {
            let failure = Failure::UnsupportedCharacter;
            actions.push(&Action::JobFailed { job: *job, failure, status: 0, sent: 0 })
        }
        _ => Ok(()),
    }
}

#[test]
fn what_waits_for_a_partner_is_told() {
    let error = check(|_, _, _, _| Ok(()), b"G1\n", Budget::units(50_000_000)).unwrap_err();
    assert!(matches!(error, TrialError::Waits), "{error}");
}

/// Takes all of the job, and is at fault where a ! is in it.
fn breaking(
    event: &Event<'_>,
    _: Micros,
    data: &[u8],
    actions: &mut ActionWriter<'_>,
) -> Result<(), NoSpace> {
    match event {
        Event::JobData { .. } if data.contains(&b'!') => Err(NoSpace),
        Event::JobBegin { job, .. } | Event::JobData { job, .. } => actions.want(*job, 512),
        Event::JobEnd { job } => actions.push(&Action::JobDone { job: *job, sent: 0 }),
        _ => Ok(()),
    }
}

#[test]
fn a_plug_in_that_breaks_is_no_refusal() {
    let error = check(breaking, b"G1!\n", Budget::endless()).unwrap_err();
    assert!(matches!(error, TrialError::Plugin(_)), "{error}");
    assert!(error.to_string().starts_with("the plug-in cannot go on: the plug-in failed on"));
}

#[test]
fn a_program_in_too_many_characters_is_not_tried() {
    let dropping: Act = |event, _, _, actions| match event {
        Event::JobBegin { job, .. } | Event::JobData { job, .. } => actions.want(*job, 512),
        Event::JobEnd { job } => actions.push(&Action::JobDone { job: *job, sent: 0 }),
        _ => Ok(()),
    };
    let budget = || Budget::endless().characters(3);
    let error = check(dropping, b"G1X\n", budget()).unwrap_err();
    assert_eq!(error.to_string(), "it has more than 3 different characters");
    let checked = check(dropping, b"G1\n", budget()).unwrap();
    assert_eq!((checked.result(), checked.characters), (CheckResult::Altered, 3));
    assert!(checked.altered.iter().all(|altered| altered.fate == Fate::Dropped));
}
