//! A plug-in that invents deliveries fills no disk, keeps nobody else from working, and is
//! stopped by a person at once.

use softplug_abi::JobId;
use std::fs;
use std::thread::sleep;
use std::time::{Duration, Instant};

use softplug_service::Refusal;
use softplug_service::view::{
    JobState, LinkState, ReceptionView, StopHow, SwapOrder, SwapState, SwapWhen,
};

use crate::gateway::shop::{Shop, wait_for};
use crate::gateway::{journal_says, send};

/// What a link may have in a delivery that is not put away, by default.
const DELIVERY_ROOM: u64 = 16_384;

/// Bytes and files in a link's folder of receptions.
fn kept(shop: &Shop, link: usize) -> (u64, usize) {
    let folder = shop.path(&format!("state/receptions/{}", Shop::name(link)));
    let Ok(entries) = fs::read_dir(folder) else { return (0, 0) };
    let sizes: Vec<u64> =
        entries.filter_map(|entry| Some(entry.ok()?.metadata().ok()?.len())).collect();
    (sizes.iter().sum(), sizes.len())
}

fn receptions(shop: &Shop, link: usize) -> Vec<ReceptionView> {
    shop.gateway().receptions(&Shop::name(link)).unwrap()
}

/// How long a call took, in order.
fn spans(mut calls: Vec<Duration>) -> (Duration, Duration) {
    calls.sort();
    (calls[calls.len() / 2], calls[calls.len() * 99 / 100])
}

const XON_XOFF: &str = "plugin = \"xon-xoff\"\nline = \"921600 8N1\"\n";

#[test]
fn a_delivery_without_an_end_takes_no_more_than_its_quota_and_is_stopped_by_hand() {
    let flood = "plugin = \"flood\"\nline = \"921600 8N1\"\nquota = { reception = \"1 MiB\" }\n";
    let shop = Shop::each("", &[flood, XON_XOFF]);
    let gateway = shop.gateway();
    let (flooded, neighbour) = (Shop::name(0), Shop::name(1));
    let began = Instant::now();
    wait_for("the quota", || journal_says(gateway, "none may have more"));
    println!("1 MiB came in {:?}", began.elapsed());
    assert!(!gateway.health().is_healthy);
    // The neighbour goes on, and so does who asks.
    let program = shop.program("O1.nc", 60_000);
    let mut calls = Vec::new();
    for _ in 0..20 {
        let at = Instant::now();
        let job = gateway.submit(&neighbour, &send("O1.nc")).unwrap().id;
        calls.push(at.elapsed());
        assert!(shop.read(1, program.len()) == program);
        wait_for("the end", || gateway.job(JobId(job)).unwrap().state == JobState::Done);
    }
    println!("submitting beside it: p50 {:?}, p99 {:?}", spans(calls.clone()).0, spans(calls).1);
    assert_eq!(kept(&shop, 0), (1 << 20, 1), "to the byte");
    // It cannot be swapped, it is never idle; it can be stopped.
    let idle = SwapOrder {
        plugin: "xon-xoff".into(),
        settings: None,
        when: SwapWhen::Idle,
        probation: None,
    };
    assert_eq!(gateway.swap(&flooded, &idle).unwrap().state, SwapState::Waiting);
    let at = Instant::now();
    assert_eq!(gateway.quarantine(&flooded).unwrap().state, LinkState::Quarantined);
    let is_kept = || receptions(&shop, 0).iter().any(|reception| reception.job.is_some());
    wait_for("what came", || is_kept() && gateway.health().is_healthy);
    println!("stopped and put away after {:?}", at.elapsed());
    let reception = &receptions(&shop, 0)[0];
    assert!(reception.failure.is_some() && reception.file.ends_with(".failed"), "{reception:?}");
    // What was in memory is put away too; nothing comes any more.
    let (bytes, files) = kept(&shop, 0);
    assert!(bytes <= (1 << 20) + DELIVERY_ROOM && files == 1, "{bytes} bytes in {files}");
    assert_eq!(gateway.job(JobId(reception.job.unwrap())).unwrap().state, JobState::Failed);
    assert!(matches!(gateway.quarantine(&flooded), Err(Refusal::Conflict(_))));
    wait_for("the journal", || journal_says(gateway, "is stopped by hand"));
    sleep(Duration::from_millis(300));
    assert_eq!(kept(&shop, 0), (bytes, 1));
    assert_eq!(gateway.link(&flooded).unwrap().state, LinkState::Quarantined);
    // Another takes its place, and works, although a swap was waiting.
    assert_eq!(gateway.swap(&flooded, &idle).unwrap().state, SwapState::Done);
    wait_for("work", || gateway.link(&flooded).unwrap().state == LinkState::Idle);
    gateway.submit(&flooded, &send("O1.nc")).unwrap();
    assert!(shop.read(0, program.len()) == program);
    assert_eq!(gateway.link(&flooded).unwrap().swap.unwrap().state, SwapState::Done);
}

#[test]
fn many_small_deliveries_stop_at_the_days_count_and_go_on_when_it_is_raised() {
    let flood = "plugin = \"flood-many\"\nline = \"921600 8N1\"\n\
                 quota = { receptions = 40, bytes = 5_000 }\n";
    let mut shop = Shop::each("", &[flood, XON_XOFF]);
    wait_for("the count", || journal_says(shop.gateway(), "40 receptions came today"));
    // It has lost its room, and is held by that.
    let events = || shop.gateway().link(&Shop::name(0)).unwrap().counters.events;
    let before = events();
    sleep(Duration::from_millis(300));
    assert_eq!((kept(&shop, 0), events()), ((40, 40), before));
    // What was taken of the machine is put away at the end, quota or not.
    shop.gateway().stop(StopHow::Park);
    shop.stopped();
    let before = kept(&shop, 0);
    assert!(before.1 > 40 && before.1 <= 40 + 100, "{before:?}");
    // A new start of the gateway begins no new day.
    shop.start();
    wait_for("the count", || !shop.gateway().health().is_healthy);
    sleep(Duration::from_millis(300));
    assert_eq!(kept(&shop, 0), before);
    // More may come: to the byte, as that is less than the count.
    let (count, bytes) = (before.1 + 1_000, before.0 + 25);
    shop.configure(|text| {
        text.replace(
            "receptions = 40, bytes = 5_000",
            &format!("receptions = {count}, bytes = {bytes}"),
        )
    });
    shop.gateway().reload().unwrap();
    wait_for("the bytes", || journal_says(shop.gateway(), "bytes came today"));
    assert_eq!(kept(&shop, 0).0, bytes);
}

#[test]
fn what_is_kept_free_is_left_to_jobs() {
    let all_of_it = format!("free-space = {}\n", 1_u64 << 50);
    let lines =
        format!("{XON_XOFF}settings = {{ preset = \"tape\", quiet-time = 300, end-quiet = 50 }}\n");
    let shop = Shop::each(&all_of_it, &[&lines, XON_XOFF]);
    let gateway = shop.gateway();
    let program = shop.program("O1.nc", 20_000);
    shop.write(0, b"%\nO7\nM30\n%\n");
    wait_for("the refusal", || journal_says(gateway, "are kept for jobs (free-space)"));
    let refused = gateway.upload("O2.nc", false, &mut &b"G1"[..]).unwrap_err();
    assert!(
        matches!(&refused, Refusal::Unavailable(text) if text.contains("make room")),
        "{refused:?}"
    );
    assert!(!shop.path("programs/O2.nc").exists());
    // Jobs go on.
    let job = gateway.submit(&Shop::name(1), &send("O1.nc")).unwrap().id;
    assert!(shop.read(1, program.len()) == program);
    wait_for("the end", || gateway.job(JobId(job)).unwrap().state == JobState::Done);
    assert_eq!(kept(&shop, 0), (0, 0));
}

#[test]
fn a_swap_at_once_overrides_one_that_waits() {
    let shop = Shop::with(1, XON_XOFF);
    let (gateway, link) = (shop.gateway(), Shop::name(0));
    let program = shop.program("O1.nc", 100_000);
    shop.hold(0);
    let job = gateway.submit(&link, &send("O1.nc")).unwrap().id;
    wait_for("the job", || gateway.link(&link).unwrap().job.is_some());
    let order = |plugin: &str, when| SwapOrder {
        plugin: plugin.into(),
        settings: None,
        when,
        probation: None,
    };
    assert_eq!(
        gateway.swap(&link, &order("r3964", SwapWhen::Idle)).unwrap().state,
        SwapState::Waiting
    );
    let again = gateway.swap(&link, &order("fragile", SwapWhen::Idle));
    assert!(matches!(again, Err(Refusal::Conflict(_))), "{again:?}");
    let view = gateway.swap(&link, &order("xon-xoff", SwapWhen::Now)).unwrap();
    assert!(matches!(view.state, SwapState::Done | SwapState::Probation), "{view:?}");
    wait_for("the journal", || journal_says(gateway, "another one was asked for at once"));
    // The job goes on where it was, and nothing waits for its end.
    shop.release(0);
    assert!(shop.read(0, program.len()) == program);
    wait_for("the end", || gateway.job(JobId(job)).unwrap().state == JobState::Done);
    assert_eq!(gateway.link(&link).unwrap().plugin.unwrap().name, "xon-xoff");
}
