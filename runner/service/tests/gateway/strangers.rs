//! A link changes to another protocol: state belongs to one plug-in, by its name.

use softplug_abi::JobId;
use std::collections::BTreeMap;

use softplug_service::view::{LinkState, SwapOrder, SwapState, SwapView, SwapWhen};

use crate::common::plugins::echo;
use crate::gateway::plugins::fragile;
use crate::gateway::shop::{Shop, wait_for};
use crate::gateway::{journal_says, send};

fn swap(shop: &Shop, plugin: &str, when: SwapWhen, settings: &[(&str, &str)]) -> SwapView {
    let pairs = settings.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned()));
    let settings = (!settings.is_empty()).then(|| pairs.collect::<BTreeMap<_, _>>());
    let order = SwapOrder { plugin: plugin.into(), settings, when, probation: None };
    shop.gateway().swap(&Shop::name(0), &order).unwrap()
}

fn runs(shop: &Shop) -> String {
    shop.gateway().link(&Shop::name(0)).unwrap().plugin.unwrap().name
}

#[test]
fn a_stranger_with_the_same_number_of_format_begins_as_new() {
    let shop = Shop::with(1, "plugin = \"fragile\"\nline = \"921600 8N1\"\n");
    for name in ["echo", "parrot"] {
        shop.gateway().add_plugin(&echo(name, "1.0.0", "")).unwrap();
    }
    // All three save in format 1; echo refuses four bytes of a count.
    shop.write(0, b"abc");
    wait_for("bytes", || shop.gateway().link("link-0").unwrap().counters.bytes_in == 3);
    let view = swap(&shop, "echo", SwapWhen::NowOrIdle, &[("shift", "3")]);
    assert_eq!(view.state, SwapState::Done, "{view:?}");
    shop.write(0, b"abc");
    assert_eq!(shop.read(0, 3), b"def");
    // Settings belong to a plug-in as well: this one has its defaults.
    let view = swap(&shop, "parrot", SwapWhen::Now, &[]);
    assert_eq!((view.state, runs(&shop).as_str()), (SwapState::Done, "parrot"), "{view:?}");
    shop.write(0, b"abc");
    assert_eq!(shop.read(0, 3), b"abc", "a byte of the stranger's state would be added");
    assert_eq!(shop.gateway().link("link-0").unwrap().settings, BTreeMap::new());
    wait_for("the journal", || journal_says(shop.gateway(), "in place of echo 1.0.0"));
    assert!(!journal_says(shop.gateway(), "with its state"));
    // The same name: its state goes with it, whatever the settings were.
    shop.gateway().add_plugin(&echo("parrot", "1.1.0", "")).unwrap();
    swap(&shop, "parrot@1.0.0", SwapWhen::Now, &[("shift", "2")]);
    let view = swap(&shop, "parrot@1.1.0", SwapWhen::Now, &[("shift", "1")]);
    assert!(matches!(view.state, SwapState::Done | SwapState::Probation), "{view:?}");
    wait_for("the journal", || journal_says(shop.gateway(), "with its state"));
}

#[test]
fn another_protocol_waits_until_the_job_is_over_or_is_refused() {
    let shop = Shop::with(1, "plugin = \"xon-xoff\"\nline = \"921600 8N1\"\n");
    let gateway = shop.gateway();
    shop.program("O1.nc", 100_000);
    shop.hold(0);
    let job = gateway.submit("link-0", &send("O1.nc")).unwrap();
    wait_for("the job", || gateway.link("link-0").unwrap().job.is_some());
    let refused = swap(&shop, "r3964", SwapWhen::Now, &[]);
    assert_eq!(refused.state, SwapState::Refused);
    let why = refused.message.unwrap();
    assert!(why.contains("takes over no state") && why.contains("when the link is idle"), "{why}");
    // Ordered by a person: nothing of the configuration was left undone.
    assert_eq!(gateway.link("link-0").unwrap().unapplied, None);
    assert_eq!(swap(&shop, "r3964", SwapWhen::NowOrIdle, &[]).state, SwapState::Waiting);
    assert_eq!(runs(&shop), "xon-xoff");
    gateway.abort(JobId(job.id)).unwrap();
    shop.release(0);
    shop.drain(0, || runs(&shop) == "r3964");
    assert_eq!(gateway.link("link-0").unwrap().swap.unwrap().state, SwapState::Done);
}

#[test]
fn a_changed_plug_in_of_the_configuration_is_taken_or_is_trouble() {
    let shop = Shop::with(1, "plugin = \"xon-xoff\"\nline = \"921600 8N1\"\n");
    let gateway = shop.gateway();
    let view = || gateway.link("link-0").unwrap();
    // Idle, with the same number of format.
    shop.configure(|text| text.replace("\"xon-xoff\"", "\"fanuc-rs232\""));
    assert_eq!(gateway.reload().unwrap().changed.len(), 1);
    wait_for("the other protocol", || runs(&shop) == "fanuc-rs232");
    assert_eq!((view().unapplied, view().trouble.len()), (None, 0));

    // One that is not there: the link goes on, and says so.
    shop.configure(|text| text.replace("\"fanuc-rs232\"", "\"nothing\""));
    gateway.reload().unwrap_err();
    wait_for("the trouble", || view().unapplied.is_some());
    assert_eq!(view().unapplied.unwrap().plugin, "nothing");
    assert!(view().trouble[0].contains("asks for the plug-in nothing"), "{:?}", view().trouble);
    let health = gateway.health();
    assert!(health.is_healthy, "it works: {health:?}");
    assert!(health.warnings.iter().any(|text| text.starts_with("link-0: ")), "{health:?}");
    assert!(
        health.warnings.iter().any(|text| text.contains("not taken, all goes on")),
        "{health:?}"
    );
    wait_for("the journal", || journal_says(gateway, "the changed gateway.toml is not taken"));
    assert_eq!((view().state, runs(&shop).as_str()), (LinkState::Idle, "fanuc-rs232"));

    // As it was: nothing is wrong any more.
    shop.configure(|text| text.replace("\"nothing\"", "\"fanuc-rs232\""));
    assert_eq!(gateway.reload().unwrap().untouched, 1);
    assert_eq!((view().unapplied, gateway.health().warnings), (None, Vec::new()));
}

#[test]
fn a_version_that_refuses_the_state_is_trouble_and_is_tried_again_when_asked() {
    let shop = Shop::with(1, "plugin = \"fragile@1.0.0\"\nline = \"921600 8N1\"\n");
    let gateway = shop.gateway();
    let view = || gateway.link("link-0").unwrap();
    gateway.add_plugin(&crate::gateway::plugins::refusing("2.0.0")).unwrap();
    shop.configure(|text| text.replace("fragile@1.0.0", "fragile@2.0.0"));
    gateway.reload().unwrap();
    wait_for("the trouble", || view().unapplied.is_some());
    assert_eq!(view().plugin.unwrap().version, "1.0.0", "the old one goes on");
    assert!(view().trouble[0].contains("fragile@2.0.0"), "{:?}", view().trouble);
    // The file is as it was: what it asks for is asked for again.
    assert_eq!(gateway.reload().unwrap().changed.len(), 1);
    let refusals = || {
        let journal = gateway.journal(&softplug_service::view::JournalFilter::default()).unwrap();
        journal.iter().filter(|entry| entry.text.contains("was not taken")).count()
    };
    wait_for("the second refusal", || refusals() == 2);
    assert!(view().unapplied.is_some());
    // Another version does.
    gateway.add_plugin(&fragile("3.0.0", None)).unwrap();
    shop.configure(|text| text.replace("fragile@2.0.0", "fragile@3.0.0"));
    gateway.reload().unwrap();
    wait_for("the third version", || view().plugin.unwrap().version == "3.0.0");
    assert_eq!((view().unapplied, view().trouble), (None, Vec::new()));
}

#[test]
fn a_swap_that_waited_when_the_link_was_made_anew_does_not_keep_jobs_from_it() {
    let shop = Shop::with(1, "plugin = \"xon-xoff\"\nline = \"921600 8N1\"\n");
    let gateway = shop.gateway();
    let view = || gateway.link("link-0").unwrap();
    // Held, the link is not idle; but nothing is under way that a change would break off.
    shop.hold(0);
    assert_eq!(swap(&shop, "r3964", SwapWhen::NowOrIdle, &[]).state, SwapState::Waiting);
    shop.configure(|text| text.replace("line =", "buffer = { size = 8192 }\nline ="));
    gateway.reload().unwrap();
    wait_for("the change", || view().buffer.size == 8_192 && view().state == LinkState::Idle);
    let given_up = view().swap.unwrap();
    assert_eq!((given_up.state, runs(&shop).as_str()), (SwapState::Refused, "xon-xoff"));
    assert!(given_up.message.unwrap().contains("made anew"));
    let program = shop.program("O1.nc", 2_000);
    gateway.submit("link-0", &send("O1.nc")).unwrap();
    assert_eq!(shop.read(0, program.len()), program);
}
