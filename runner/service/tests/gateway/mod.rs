//! The gateway as a whole: real plug-ins in their sandbox, ptys, files, the
//! journal; machines are simulated partners or a pty's master.
#![cfg(target_os = "linux")]

mod cells;
mod cells_crash;
mod drops;
mod drops_crash;
mod feeds;
mod lines;
mod machine;
mod memory;
mod panel;
pub(crate) mod plugins;
mod quotas;
mod receptions;
mod results;
mod shop;
mod stopping;
mod strangers;
mod supervision;
mod units;

use softplug_abi::JobId;
use std::collections::BTreeMap;

use shop::{Shop, wait_for};
use softplug_service::jobs::BeginAt;
use softplug_service::view::{
    JobFilter, JobOrder, JobState, JournalFilter, LinkState, SwapOrder, SwapState, SwapWhen,
};
use softplug_service::{Gateway, Refusal};

fn send(program: &str) -> JobOrder {
    JobOrder { program: Some(program.to_owned()), ..JobOrder::default() }
}

/// Whether the journal has an entry with this text.
fn journal_says(gateway: &Gateway, text: &str) -> bool {
    let journal = gateway.journal(&JournalFilter::default()).unwrap();
    journal.iter().any(|entry| entry.text.contains(text))
}

#[test]
fn programs_reach_three_machines_as_they_are() {
    let shop = Shop::with(3, "plugin = \"xon-xoff\"\nline = \"921600 8N1\"\n");
    let gateway = shop.gateway();
    let mut expected = Vec::new();
    for at in 0..3 {
        let program = shop.program(&format!("O{at}.nc"), 20_000 + at * 1_000);
        gateway.submit(&Shop::name(at), &send(&format!("O{at}.nc"))).unwrap();
        expected.push(program);
    }
    for (at, program) in expected.iter().enumerate() {
        let got = shop.read(at, program.len());
        assert_eq!(got, *program, "link {at}");
    }
    for (at, program) in expected.iter().enumerate() {
        let filter = JobFilter { link: Some(Shop::name(at)), ..JobFilter::default() };
        wait_for("the job's end", || gateway.jobs(&filter).unwrap()[0].state == JobState::Done);
        let job = &gateway.jobs(&filter).unwrap()[0];
        assert_eq!(
            (job.progress.surely_left, job.progress.size),
            (job.progress.maybe_left, Some(job.progress.maybe_left))
        );
        let link = || gateway.link(&Shop::name(at)).unwrap();
        wait_for("the line's end", || link().state == LinkState::Idle);
        assert_eq!(link().queued, 0);
        assert!(link().counters.bytes_out >= program.len() as u64);
    }
    assert!(journal_says(gateway, "is done"));
    assert!(!journal_says(gateway, "was read again"), "nobody has asked for it");
}

#[test]
fn jobs_wait_in_order_and_can_be_steered() {
    let shop = Shop::with(1, "plugin = \"xon-xoff\"\nline = \"921600 8N1\"\n");
    let gateway = shop.gateway();
    shop.program("long.nc", 400_000);
    shop.program("short.nc", 100);
    let link = Shop::name(0);
    // The machine says stop before anything is sent.
    shop.hold(0);
    let long = gateway.submit(&link, &send("long.nc")).unwrap();
    let low = gateway.submit(&link, &send("short.nc")).unwrap();
    let high = gateway.submit(&link, &JobOrder { priority: 5, ..send("short.nc") }).unwrap();
    assert_eq!((low.state, high.state), (JobState::Queued, JobState::Queued));
    assert_eq!(gateway.link(&link).unwrap().queued, 2);
    assert_eq!(gateway.pause(JobId(long.id)).unwrap().state, JobState::Paused);
    assert_eq!(gateway.link(&link).unwrap().state, LinkState::Paused);
    assert_eq!(gateway.resume(JobId(long.id)).unwrap().state, JobState::Running);
    let refusal = gateway.resume(JobId(long.id)).unwrap_err();
    assert!(matches!(refusal, Refusal::Conflict(_)), "{refusal}");
    assert_eq!(gateway.prioritise(JobId(low.id), 9).unwrap().priority, 9);
    assert_eq!(gateway.abort(JobId(high.id)).unwrap().state, JobState::Aborted);
    gateway.abort(JobId(long.id)).unwrap();
    shop.release(0);
    let state = |id| gateway.job(id).unwrap().state;
    shop.drain(0, || state(JobId(low.id)) == JobState::Done);
    assert_eq!(state(JobId(long.id)), JobState::Aborted);
    let again = gateway.restart(JobId(long.id), BeginAt::Block(3)).unwrap();
    assert_eq!((again.restart_of, again.start_block), (Some(long.id), 3));
    gateway.abort(JobId(again.id)).unwrap();
    shop.drain(0, || state(JobId(again.id)) == JobState::Aborted);
}

#[test]
fn orders_that_cannot_be_carried_out_are_refused_by_their_field() {
    let shop = Shop::with(1, "plugin = \"xon-xoff\"\nline = \"921600 8N1\"\n");
    let gateway = shop.gateway();
    let link = Shop::name(0);
    shop.program("O1.nc", 100);
    let refused = |order: JobOrder| match gateway.submit(&link, &order) {
        Err(Refusal::Invalid { field, .. }) => field,
        other => format!("{other:?}"),
    };
    let kind = Some("wash".to_owned());
    assert_eq!(refused(JobOrder { kind, ..send("O1.nc") }), "kind");
    assert_eq!(refused(JobOrder::default()), "program");
    assert_eq!(refused(send("../etc/passwd")), "program");
    let fields = BTreeMap::from([("colour".to_owned(), "red".to_owned())]);
    assert_eq!(refused(JobOrder { fields, ..send("O1.nc") }), "fields");
    assert_eq!(refused(JobOrder { from_block: Some(9_999), ..send("O1.nc") }), "job");
    assert!(matches!(gateway.submit(&link, &send("none.nc")), Err(Refusal::NotFound(_))));
    assert!(matches!(gateway.submit("x", &send("O1.nc")), Err(Refusal::NotFound(_))));
    assert!(matches!(gateway.job(JobId(99)), Err(Refusal::NotFound(_))));
    assert_eq!(gateway.jobs(&JobFilter::default()).unwrap(), []);
}

#[test]
fn a_reload_touches_only_what_changed() {
    let shop = Shop::with(3, "plugin = \"xon-xoff\"\nline = \"921600 8N1\"\n");
    let gateway = shop.gateway();
    shop.program("O1.nc", 3_000_000);
    for at in 0..3 {
        gateway.submit(&Shop::name(at), &send("O1.nc")).unwrap();
    }
    let out = |at: usize| gateway.link(&Shop::name(at)).unwrap().counters.bytes_out;
    shop.drain_all(|| (0..3).all(|at| out(at) > 10_000));
    assert_eq!(gateway.reload().unwrap().untouched, 3);
    wait_for("the journal", || journal_says(gateway, "was read again; nothing changed"));

    shop.configure(|text| {
        let mut text = text.replace("name = \"link-2\"", "name = \"link-3\"");
        text = text.replacen(
            "plugin = \"xon-xoff\"",
            "plugin = \"xon-xoff\"\nbuffer = { size = 8192 }",
            1,
        );
        text.replace("name = \"link-1\"", "name = \"link-1\"\nswap = \"follow\"")
    });
    let before = [out(0), out(1)];
    let view = gateway.reload().unwrap();
    assert_eq!((view.removed, view.added), (vec!["link-2".into()], vec!["link-3".into()]));
    let changed: Vec<_> =
        view.changed.iter().map(|link| (link.name.as_str(), link.waits)).collect();
    assert_eq!(changed, [("link-0", true), ("link-1", false)], "the busy one waits");
    let jobs = gateway.jobs(&JobFilter::default()).unwrap();
    let state = |link: &str| jobs.iter().find(|job| job.link == link).unwrap().state;
    assert_eq!((state("link-0"), state("link-1")), (JobState::Running, JobState::Running));
    shop.drain_all(|| out(0) > before[0] + 10_000 && out(1) > before[1] + 10_000);
    shop.drain_all(|| gateway.links().unwrap().iter().all(|link| link.name != "link-2"));
    let jobs = gateway.jobs(&JobFilter { link: Some("link-2".into()), ..JobFilter::default() });
    assert_eq!(jobs.unwrap()[0].state, JobState::Interrupted);
    // Idle, the change that waited is made, and the counts go on.
    let link = gateway.link("link-0").unwrap();
    assert!(link.is_change_waiting && link.buffer.size != 8_192);
    gateway.abort(JobId(link.job.unwrap().id)).unwrap();
    shop.drain_all(|| gateway.link("link-0").is_ok_and(|link| link.buffer.size == 8_192));
    assert!(out(0) >= before[0]);

    shop.configure(|text| text.replace("name = \"link-1\"", "name = \"link-1\"\nswop = 1"));
    let refusal = gateway.reload().unwrap_err();
    assert!(refusal.to_string().contains("unknown field `swop`"), "{refusal}");
    assert_eq!(gateway.links().unwrap().len(), 3, "nothing changed");
}

#[test]
fn a_plug_in_is_swapped_in_the_middle_of_a_job() {
    let shop = Shop::with(1, "plugin = \"xon-xoff\"\nline = \"921600 8N1\"\n");
    let gateway = shop.gateway();
    let program = shop.program("O1.nc", 200_000);
    let link = Shop::name(0);
    let job = gateway.submit(&link, &send("O1.nc")).unwrap();
    let mut got = shop.read(0, 20_000);
    let order = SwapOrder {
        plugin: "xon-xoff".into(),
        settings: None,
        when: SwapWhen::Now,
        probation: None,
    };
    let swap = gateway.swap(&link, &order).unwrap();
    assert!(matches!(swap.state, SwapState::Done | SwapState::Probation), "{swap:?}");
    let refusal = gateway.swap(&link, &SwapOrder { plugin: "xon-xof".into(), ..order.clone() });
    assert!(refusal.unwrap_err().to_string().contains("did you mean \"xon-xoff\"?"));
    let settings = Some(BTreeMap::from([("xon".to_owned(), "999".to_owned())]));
    match gateway.swap(&link, &SwapOrder { settings, ..order }) {
        Err(Refusal::Invalid { field, .. }) => assert_eq!(field, "settings.xon"),
        other => panic!("{other:?}"),
    }
    got.extend(shop.read(0, program.len() - got.len()));
    assert_eq!(got, program);
    wait_for("the job's end", || gateway.job(JobId(job.id)).unwrap().state == JobState::Done);
    wait_for("the swap", || journal_says(gateway, "runs in place of"));
}

#[test]
fn an_empty_configuration_closes_no_link() {
    let shop = Shop::with(1, "plugin = \"xon-xoff\"\nline = \"921600 8N1\"\n");
    shop.configure(|_| String::new());
    let refused = shop.gateway().reload().unwrap_err().to_string();
    assert!(refused.contains("is empty, as if it could not be written"), "{refused}");
    assert_eq!(shop.gateway().links().unwrap().len(), 1);
    shop.configure(|_| "# no links any more\n".to_owned());
    assert_eq!(shop.gateway().reload().unwrap().removed, ["link-0"]);
}
