//! The suite proves that it bites: converters with one fault each are caught,
//! with the right class and at the right place.

use softplug_abi::manifest::Manifest;
use softplug_abi::{
    Action, ActionWriter, DeliveryId, Event, EventKind, Instance, JobId, MarkId, MarkState, Micros,
    Output, Pass,
};
use softplug_conformance::{
    Case, Class, FaultClass, Filter, FromFn, Permutation, Summary, Verdict, bless, calls, replay,
    run_all,
};
use softplug_trace::Trace;

/// What a scripted converter does wrong.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Flaw {
    None,
    IgnoresXoff,
    LosesLastOfBurst,
    DependsOnCuts,
    ForgetsOnSwap,
    KeepsPast,
    Panics,
    /// When it has heard a line more than the trace has.
    PanicsLater,
    PanicsAtStart,
    RefusesSettings,
    BreaksARule,
    Garbles,
    NeverStops,
}

/// Sends a job at once, obeys XOFF and XON, and delivers each line that ends in
/// LF. Just enough of a converter to be wrong in each way.
#[derive(Clone, Debug)]
struct Scripted {
    flaw: Flaw,
    job: u32,
    held: bool,
    line: Vec<u8>,
    delivery: u32,
    /// Bytes ever received, also before the link was closed.
    heard: u32,
    output: Vec<u8>,
}

#[derive(Debug, thiserror::Error)]
#[error("it does not like them")]
struct Refused;

impl Scripted {
    fn new(flaw: Flaw) -> Self {
        let output = vec![0; 8_192];
        Self { flaw, job: 0, held: false, line: Vec::new(), delivery: 0, heard: 0, output }
    }

    fn received(&mut self, bytes: &[u8], actions: &mut Vec<OwnedAction>) {
        for (place, byte) in bytes.iter().enumerate() {
            self.heard += 1;
            let is_last = place + 1 == bytes.len();
            match byte {
                0x13 if self.flaw != Flaw::IgnoresXoff => {
                    self.held = true;
                    actions.push(OwnedAction::Hold);
                }
                0x11 => {
                    self.held = false;
                    actions.push(OwnedAction::Release);
                }
                b'!' if self.flaw == Flaw::Panics => panic!("the converter met '!'"),
                _ if self.flaw == Flaw::LosesLastOfBurst && is_last && bytes.len() > 1 => {}
                b'\n' if self.flaw == Flaw::PanicsLater && self.heard > 10 => {
                    panic!("the converter met a second line")
                }
                b'\n' => {
                    self.delivery += 1;
                    let mut line = std::mem::take(&mut self.line);
                    if self.flaw == Flaw::KeepsPast && self.heard > 10 {
                        line.push(b'?');
                    }
                    actions.push(OwnedAction::Line(self.delivery, line));
                }
                _ => self.line.push(*byte),
            }
        }
        if self.flaw == Flaw::DependsOnCuts && bytes.len() == 1 && bytes[0] == b'C' {
            self.line.push(b'c');
        }
    }
}

/// The few actions that it takes.
enum OwnedAction {
    Hold,
    Release,
    Want(u32),
    Send(Vec<u8>),
    Mark,
    Done(u32),
    Line(u32, Vec<u8>),
    Saved(Vec<u8>),
}

impl OwnedAction {
    fn write(&self, writer: &mut ActionWriter<'_>) {
        let mut push =
            |action: Action<'_>| writer.push(&action).expect("the output is long enough");
        match self {
            Self::Hold => push(Action::Hold),
            Self::Release => push(Action::Release),
            Self::Want(job) => push(Action::Want { job: JobId(*job), bytes: 1_000 }),
            Self::Send(bytes) => push(Action::Transmit { mark: MarkId::NONE, bytes }),
            Self::Mark => push(Action::Transmit { mark: MarkId(1), bytes: &[] }),
            Self::Done(job) => push(Action::JobDone { job: JobId(*job), sent: 0 }),
            Self::Line(delivery, bytes) => {
                push(Action::DeliveryBegin { delivery: DeliveryId(*delivery), job: JobId::NONE });
                if !bytes.is_empty() {
                    push(Action::Deliver { delivery: DeliveryId(*delivery), bytes });
                }
                push(Action::DeliveryEnd {
                    delivery: DeliveryId(*delivery),
                    failure: None,
                    status: 0,
                });
            }
            Self::Saved(bytes) => {
                let total = bytes.len() as u32;
                push(Action::Saved { format: 1, offset: 0, total, bytes });
            }
        }
    }
}

impl Instance for Scripted {
    type Fault = Refused;

    fn input_capacity(&self) -> usize {
        1_024
    }

    fn step(&mut self, event: &Event<'_>, _now: Micros) -> Result<Output<'_>, Refused> {
        let mut actions = Vec::new();
        match event {
            Event::Settings { .. } if self.flaw == Flaw::RefusesSettings => return Err(Refused),
            Event::Open { resumed: false, .. } => {
                assert!(self.flaw != Flaw::PanicsAtStart, "the converter does not open");
                let heard = self.heard;
                *self = Self { heard, ..Self::new(self.flaw) };
            }
            Event::Received(bytes) => self.received(bytes, &mut actions),
            Event::JobBegin { job, pass: Pass::Run, .. } => {
                self.job = job.0;
                actions.push(OwnedAction::Want(job.0));
            }
            Event::JobData { bytes, .. } => {
                let lost = usize::from(self.flaw == Flaw::LosesLastOfBurst);
                actions.push(OwnedAction::Send(bytes[..bytes.len() - lost].to_vec()));
            }
            Event::JobEnd { .. } => actions.push(OwnedAction::Mark),
            Event::Mark { state: MarkState::SurelyLeft, .. } => {
                actions.push(OwnedAction::Done(self.job));
            }
            Event::Save => {
                let mut state = vec![u8::from(self.held), self.job as u8, self.delivery as u8];
                if self.flaw != Flaw::ForgetsOnSwap {
                    state.extend(&self.line);
                }
                actions.push(OwnedAction::Saved(state));
            }
            Event::Restore { bytes: [held, job, delivery, line @ ..], .. } => {
                self.held = *held != 0;
                self.job = u32::from(*job);
                self.delivery = u32::from(*delivery);
                self.line = line.to_vec();
            }
            _ => {}
        }
        if let (Flaw::BreaksARule, Event::Received(_)) = (self.flaw, event) {
            actions.push(OwnedAction::Done(77));
        }
        let mut writer = ActionWriter::new(&mut self.output);
        for action in &actions {
            action.write(&mut writer);
        }
        let length = writer.len();
        if let (Flaw::Garbles, Event::Received(_)) = (self.flaw, event) {
            self.output[..4].fill(0xFF);
            return Ok(Output { actions: &self.output[..4], more: false });
        }
        let more =
            self.flaw == Flaw::NeverStops && matches!(event, Event::Received(_) | Event::Continue);
        Ok(Output { actions: &self.output[..length], more })
    }
}

const TRACE: &str = "\
id: scripted.both-ways
title: A job under a hold, and two lines
profile: scripted
clauses: scripted.all
level: must
line: 9600 8N1 depth=1 reaction=0
since: 1
origin: hand-written
---
? 0.000000 send 1 \"ABCD\"
> 0.000000 41 42
< 0.001500 13
< 0.500000 \"GCOD\"
< 0.600000 \"E!\\n\"
= 0.600000 deliver 1 \"GCODE!\" complete
< 1.000000 11
> 1.000000 43 44
= 1.002084 done 1
. 2.000000
";

fn case() -> Case {
    Case::new("scripted/scripted.both-ways.spt", Trace::parse(TRACE).expect("it is a trace"))
}

fn subject(flaw: Flaw) -> FromFn<impl Fn() -> Scripted> {
    let manifest = br#"{"abi": "1.0", "name": "scripted", "version": "1.0.0", "licence": "MIT",
        "protocol": "none", "description": "For the suite's own tests.",
        "jobs": [{"name": "send", "text": "sends"}], "state": {"saves": 1, "accepts": [1]}}"#;
    FromFn::new(Manifest::parse(manifest).expect("it is valid"), move || Scripted::new(flaw))
}

fn judged(flaw: Flaw) -> Summary {
    run_all(&[&subject(flaw)], &[case()], &Filter::default())
}

fn verdict<'a>(summary: &'a Summary, permutation: &str) -> &'a Verdict {
    let name = format!("scripted.both-ways/{permutation}");
    let found = summary.cases.iter().find(|verdict| verdict.case == name);
    found.unwrap_or_else(|| panic!("{name} was not run"))
}

fn class(summary: &Summary, permutation: &str) -> Option<Class> {
    verdict(summary, permutation).failure.as_ref().map(|failure| failure.class)
}

#[test]
fn the_flawless_one_passes() {
    let summary = judged(Flaw::None);
    let failed: Vec<_> = summary.cases.iter().filter(|case| !case.is_passed()).collect();
    assert!(failed.is_empty(), "{}", failed[0]);
    assert!(summary.total > 40 && summary.passed == summary.total && summary.failed == 0);
}

#[test]
fn one_that_ignores_xoff_diverges_at_the_next_byte() {
    let summary = judged(Flaw::IgnoresXoff);
    assert_eq!(class(&summary, "uncut"), Some(Class::Diverged));
    assert_eq!(summary.passed, 0);
    insta::assert_snapshot!(verdict(&summary, "uncut"));
}

#[test]
fn one_that_loses_the_last_byte_of_a_burst_diverges() {
    let summary = judged(Flaw::LosesLastOfBurst);
    assert_eq!(class(&summary, "uncut"), Some(Class::Diverged));
    insta::assert_snapshot!(verdict(&summary, "uncut"));
}

#[test]
fn one_that_depends_on_cuts_passes_uncut_only() {
    let summary = judged(Flaw::DependsOnCuts);
    assert_eq!(class(&summary, "uncut"), None);
    assert_eq!(class(&summary, "cut:1"), Some(Class::DependsOnCuts));
    assert_eq!(class(&summary, "twice"), None);
    insta::assert_snapshot!(verdict(&summary, "cut:1"));
}

#[test]
fn one_that_forgets_in_a_swap_is_found_where_it_does() {
    let summary = judged(Flaw::ForgetsOnSwap);
    assert_eq!(class(&summary, "uncut"), None);
    assert_eq!(class(&summary, "swap:all"), Some(Class::DependsOnSwap));
    let bad = summary.cases.iter().filter(|case| !case.is_passed()).count();
    assert_eq!(bad, 2, "one place in the middle of a line, and all places");
    assert_eq!(class(&summary, "swap:1"), None);
}

#[test]
fn one_that_keeps_its_past_fails_the_second_time() {
    let summary = judged(Flaw::KeepsPast);
    assert_eq!(class(&summary, "uncut"), None);
    assert_eq!(class(&summary, "twice"), Some(Class::DependsOnPast));
    insta::assert_snapshot!(verdict(&summary, "twice"));
}

#[test]
fn one_that_panics_has_trapped() {
    let summary = judged(Flaw::Panics);
    assert_eq!(class(&summary, "uncut"), Some(Class::Fault(FaultClass::Trapped)));
    assert_eq!(summary.passed, 0);
    insta::assert_snapshot!(verdict(&summary, "uncut"));
}

#[test]
fn faults_have_their_own_classes_and_never_pass() {
    let faults = [
        (Flaw::PanicsAtStart, FaultClass::Trapped),
        (Flaw::RefusesSettings, FaultClass::SettingsRefused),
        (Flaw::BreaksARule, FaultClass::RuleBroken),
        (Flaw::Garbles, FaultClass::RuleBroken),
        (Flaw::NeverStops, FaultClass::RuleBroken),
    ];
    for (flaw, fault) in faults {
        let summary = judged(flaw);
        assert_eq!(class(&summary, "uncut"), Some(Class::Fault(fault)), "{flaw:?}");
        assert_eq!((summary.passed, summary.failed), (0, summary.total), "{flaw:?}");
    }
}

#[test]
fn what_the_plug_in_lacks_is_no_pass() {
    let text = TRACE.replace("since: 1", "config: speed=9\nsince: 1");
    let case = Case::new("x.spt", Trace::parse(&text).expect("it is a trace"));
    let summary = run_all(&[&subject(Flaw::None)], &[case], &Filter::default());
    assert_eq!(summary.passed, 0);
    assert_eq!(class(&summary, "uncut"), Some(Class::Fault(FaultClass::NotApplicable)));
    let shown = verdict(&summary, "uncut").to_string();
    assert!(shown.contains("unknown setting \"speed\""), "{shown}");
}

#[test]
fn a_filter_takes_a_trace_or_one_case() {
    let run = |name: &str| run_all(&[&subject(Flaw::None)], &[case()], &Filter::only([name])).total;
    assert!(run("scripted.both-ways") > 40);
    assert_eq!(run("scripted.both-ways/cut:1"), 1);
    assert_eq!(run("scripted.both-ways/uncut"), 1);
    assert_eq!(run("scripted.both"), 0);
    assert_eq!(run("scripted.both-ways/cut:2"), 0);
}

#[test]
fn the_digest_holds_what_was_done_and_not_who_did_it() {
    let uncut = Filter::only(["scripted.both-ways/uncut"]);
    let digest = |flaw| run_all(&[&subject(flaw)], &[case()], &uncut).digest;
    assert_eq!(digest(Flaw::None).len(), 64);
    assert_eq!(digest(Flaw::None), digest(Flaw::DependsOnCuts), "uncut they are the same");
    assert_ne!(digest(Flaw::None), digest(Flaw::IgnoresXoff));
}

#[test]
fn blessing_takes_over_what_was_seen() {
    let blessed = bless(&subject(Flaw::IgnoresXoff), &case()).expect("it can be blessed").format();
    assert!(blessed.contains("> 0.002084 43 44"), "{blessed}");
    let case = Case::new("x.spt", Trace::parse(&blessed).expect("it is a trace"));
    let summary = run_all(&[&subject(Flaw::IgnoresXoff)], &[case], &Filter::default());
    assert_eq!(summary.failed, 0);
    // What holds stays as it was written, to the byte.
    let same = bless(&subject(Flaw::None), &self::case()).expect("it can be blessed");
    assert_eq!(same.format(), self::case().trace.format());
    assert!(bless(&subject(Flaw::Panics), &self::case()).is_err());
}

#[test]
fn alternatives_and_windows_leave_the_choice_they_name_and_no_other() {
    let choice = |first: &str, second: &str| {
        let block = format!("{{ alt scripted.choice\n{first}|\n{second}}}\n");
        let text = TRACE.replace("> 1.000000 43 44\n", &block);
        let case = Case::new("x.spt", Trace::parse(&text).expect("it is a trace"));
        run_all(&[&subject(Flaw::None)], &[case], &Filter::default()).failed
    };
    assert_eq!(choice("> 1.000000 99\n", "> 1.000000 43 44\n"), 0);
    assert_eq!(choice("> 1.000000 43 44\n", ""), 0);
    assert!(choice("> 1.000000 99\n", "> 1.000001 43 44\n") > 0);
    let window = |when: &str| {
        let text = TRACE.replace("> 1.000000 43 44\n", &format!("> {when} 43 44\n"));
        let case = Case::new("x.spt", Trace::parse(&text).expect("it is a trace"));
        run_all(&[&subject(Flaw::None)], &[case], &Filter::default()).failed
    };
    assert_eq!(window("1.000000~1.000500"), 0);
    assert!(window("1.000001~1.000500") > 0);
}

#[test]
fn a_summary_is_json_with_classes_by_name() {
    let json = |flaw| serde_json::to_value(judged(flaw)).expect("it is plain data");
    let uncut = |flaw| json(flaw)["cases"][0].clone();
    assert_eq!(uncut(Flaw::None)["case"], "scripted.both-ways/uncut");
    assert_eq!(uncut(Flaw::None)["failure"], serde_json::Value::Null);
    let diverged = &uncut(Flaw::IgnoresXoff)["failure"];
    assert_eq!(diverged["class"], "diverged");
    assert_eq!(diverged["divergence"]["at_us"], 2_084);
    assert_eq!(diverged["divergence"]["line"], 17);
    assert_eq!(uncut(Flaw::Panics)["failure"]["class"], "trapped");
    assert_eq!(json(Flaw::Panics)["failed"], json(Flaw::Panics)["total"]);
}

#[test]
fn a_replay_ends_with_its_trace() {
    let text = TRACE.replace("= 1.002084 done 1\n. 2.000000\n", "");
    let case = Case::new("x.spt", Trace::parse(&text).expect("it is a trace"));
    let outcome = replay(&subject(Flaw::None), &case, &Permutation::Uncut, 0);
    // D begins behind the last line of the trace, and the job ends later still.
    assert_eq!(outcome.seen.len(), 4);
    assert_eq!(outcome.seen.last().map(|seen| seen.at), Some(Micros(1_000_000)));
}

#[test]
fn late_inputs_come_at_the_end_of_their_windows() {
    let text = TRACE.replace("< 0.500000 ", "< 0.500000~0.550000 ");
    let text = text.replace("< 0.600000 ", "< 0.600000~0.650000 ");
    let case = Case::new("x.spt", Trace::parse(&text).expect("it is a trace"));
    let received = |permutation| {
        let calls = calls(&subject(Flaw::None), &case, permutation).into_iter();
        let received = calls.filter(|call| call.event == EventKind::Received);
        received.map(|call| call.now.0).collect::<Vec<_>>()
    };
    assert_eq!(received(&Permutation::Uncut), [1_500, 500_000, 600_000, 1_000_000]);
    assert_eq!(received(&Permutation::Late(None)), [1_500, 550_000, 650_000, 1_000_000]);
    assert_eq!(received(&Permutation::Late(Some(2))), [1_500, 500_000, 650_000, 1_000_000]);
}

#[test]
fn bytes_that_came_left_and_were_delivered_are_counted_once_each() {
    // One read, and character by character.
    for how in ["< 0.500000 ", "<< 0.500000 "] {
        let trace = Trace::parse(&TRACE.replace("< 0.500000 ", how)).expect("it is a trace");
        let case = Case::new("x.spt", trace);
        let outcome = replay(&subject(Flaw::None), &case, &Permutation::Uncut, 0);
        // XOFF, seven of a message, XON; four sent; six delivered.
        assert_eq!(outcome.bytes, 9 + 4 + 6, "{how}");
    }
}

#[test]
fn a_second_run_begins_a_second_after_the_first_and_counts_its_own_time() {
    let twice = |flaw| replay(&subject(flaw), &case(), &Permutation::Twice, 0);
    // The line is quiet one microsecond behind the end of the trace.
    assert_eq!(twice(Flaw::None).began, Micros(2_000_001 + 1_000_000));
    let fault = twice(Flaw::PanicsLater).fault.expect("it panics");
    assert_eq!(fault.at_us, 600_000);
}
