//! Random sessions: sound plug-ins hold to their models, unsound ones are found, and what
//! was found runs again the same.

use crate::common::native;
use softplug_abi::{Action, ActionWriter, Actions, Event, Instance, Micros, Output};
use softplug_conformance::{Class, Corpus, FromFn, Judge, SessionGroup, Sessions};
use softplug_models::Session;
use softplug_native::{NativeInstance, NativePlugin};
use softplug_trace::Trace;

fn groups(profile: &str) -> Vec<SessionGroup> {
    let all = Corpus::embedded().sessions.into_iter();
    all.filter(|group| group.profile == profile).collect()
}

#[test]
fn reference_plug_ins_hold_to_their_models() {
    for plugin in NativePlugin::ALL {
        let subject = native(plugin.name());
        for profile in &subject.manifest().profiles {
            let few = Sessions { count: 160, seed: 20 };
            for group in groups(&profile.name) {
                let run = subject.run_sessions(&group, few, &profile.features, &|| false);
                let run = run.expect("nothing stops it");
                let failures: Vec<_> = run.failures.iter().map(|failed| &failed.message).collect();
                assert!(failures.is_empty(), "{} of {}: {failures:?}", group.id, plugin.name());
                assert!(run.runs > 0 && run.effects > 0, "{} has run nothing", group.id);
            }
        }
    }
}

/// Sessions in which a model asked for more than its page says: profile, seed and number.
const LEFT_OPEN: [(&str, u64, u64); 1] = [
    // An ACK that comes with the one behind which a byte cannot be sent, on a line with seven bits.
    ("kermit", 2, 1_506),
];

#[test]
fn what_a_page_leaves_open_is_not_judged() {
    for (name, seed, number) in LEFT_OPEN {
        let plugin = NativePlugin::ALL.iter().find(|plugin| plugin.name() == name);
        let plugin = plugin.expect("the profile has the plug-in's name");
        let profile = softplug_models::profile(name).expect("it has a model");
        let subject = native(name);
        let session = Session::draw(profile, subject.manifest(), seed, number);
        let session = session.expect("its settings fit");
        let ran = session.run(subject.manifest(), &mut || Ok(plugin.instantiate()));
        assert_eq!(ran.finding, None, "{name}, session {number} of seed {seed}");
    }
}

/// The profile that no model describes.
const WITHOUT_MODEL: [&str; 1] = ["abi"];

#[test]
fn the_other_profiles_have_models_whose_clauses_the_ledgers_have() {
    let corpus = Corpus::embedded();
    for ledger in &corpus.ledgers {
        let model = softplug_models::profile(&ledger.profile);
        let is_without = WITHOUT_MODEL.contains(&ledger.profile.as_str());
        assert_eq!(model.is_none(), is_without, "{}", ledger.profile);
        let Some(model) = model else { continue };
        assert_eq!(groups(&ledger.profile).len(), 8, "{}", ledger.profile);
        let unknown: Vec<_> =
            model.clauses.iter().filter(|id| ledger.clause(id).is_none()).collect();
        assert!(unknown.is_empty(), "{}: {unknown:?}", ledger.profile);
    }
}

/// XON/XOFF that drops one byte of what it delivers, the 300th of each instance.
#[derive(Debug)]
struct Lossy {
    inner: NativeInstance,
    received: usize,
    output: Vec<u8>,
}

impl Instance for Lossy {
    type Fault = <NativeInstance as Instance>::Fault;

    fn input_capacity(&self) -> usize {
        self.inner.input_capacity()
    }

    fn step(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, Self::Fault> {
        let Output { actions, more } = self.inner.step(event, now)?;
        self.output.resize(2 * actions.len() + 64, 0);
        let mut writer = ActionWriter::new(&mut self.output);
        for action in Actions::new(actions).map_while(Result::ok) {
            let kept = match action {
                Action::Deliver { delivery, bytes } => {
                    let before = self.received;
                    self.received += bytes.len();
                    let is_lost = before < 300 && self.received >= 300;
                    let bytes = if is_lost { &bytes[..bytes.len() - 1] } else { bytes };
                    if bytes.is_empty() {
                        continue;
                    }
                    Action::Deliver { delivery, bytes }
                }
                other => other,
            };
            writer.push(&kept).expect("there is room for what there was room for");
        }
        let length = writer.len();
        Ok(Output { actions: &self.output[..length], more })
    }
}

#[test]
fn a_byte_that_is_lost_once_is_found_and_shown_as_a_short_trace() {
    let sound = native("xon-xoff");
    let subject = FromFn::new(sound.manifest().clone(), || Lossy {
        inner: NativePlugin::XonXoff.instantiate(),
        received: 0,
        output: Vec::new(),
    });
    let group = &groups("xon-xoff")[0];
    let many = Sessions { count: 400, seed: 1 };
    let run = subject.run_sessions(group, many, &[], &|| false).expect("nothing stops it");
    let failed = run.failures.first().expect("it is found");
    assert_eq!(failed.class, Class::Diverged);
    assert!(failed.message.starts_with("xon-xoff.rx."), "{}", failed.message);
    let text = failed.trace.format();
    assert_eq!(Trace::parse(&text).expect("it is a trace").format(), text);
    assert!(failed.trace.inputs().count() <= 12, "{text}");

    let again = subject.run_sessions(group, many, &[], &|| false).expect("nothing stops it");
    assert_eq!(again.pure, run.pure);
    assert_eq!(again.failures[0].trace, failed.trace);
}

#[test]
fn sessions_that_are_ended_give_nothing() {
    let subject = native("xon-xoff");
    let few = Sessions { count: 80, seed: 1 };
    assert!(subject.run_sessions(&groups("xon-xoff")[0], few, &[], &|| true).is_none());
}
