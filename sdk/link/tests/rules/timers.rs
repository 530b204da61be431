//! Timers and the clock.

use crate::common::{Rig, Script, rooms};
use crate::{assert_events, assert_given};
use softplug_abi::{Action, JobId, LinkDownReason, Micros};
use softplug_link::{LinkFault, RuleBroken};

fn set(id: u8, deadline: i64) -> Action<'static> {
    Action::SetTimer { id, deadline: Micros(deadline) }
}

#[test]
fn timers_superseded() {
    let mut rig = Rig::new(rooms(64, 64), 1);
    rig.does(0, &[set(1, 500), set(2, 500), set(1, 700), Action::CancelTimer { id: 2 }]);
    rig.until(2_000);
    assert_given!(rig, [(700, "timer 1 set for 700")]);

    // Reached at this instant, and not given yet.
    rig.does(2_000, &[set(1, 3_000), set(2, 3_000), set(3, 3_000), set(4, 3_000)]);
    rig.script.once("received \"x\"", &[Action::CancelTimer { id: 1 }]);
    rig.script.once("timer 2", &[Action::CancelTimer { id: 3 }, set(4, 3_500)]);
    rig.receive(3_000, &[b"x"]).unwrap();
    rig.until(9_000);
    assert_given!(
        rig,
        [
            (3_000, "received \"x\""),
            (3_000, "timer 2 set for 3000"),
            (3_500, "timer 4 set for 3500"),
        ]
    );
}

#[test]
fn timers_once() {
    let mut rig = Rig::new(rooms(64, 64), 1);
    rig.does(100, &[set(15, 400), set(0, 99), set(7, -5), set(8, i64::MAX)]);
    rig.until(400);
    rig.until(100_000);
    assert_given!(
        rig,
        [(100, "timer 7 set for -5"), (100, "timer 0 set for 99"), (400, "timer 15 set for 400"),]
    );
}

#[test]
fn timers_order() {
    let mut rig = Rig::new(rooms(64, 64), 1);
    rig.does(0, &[set(2, 500), set(9, 400), set(1, 500), set(0, 501), set(15, 400)]);
    // Late: all are due at one instant.
    rig.line.link.handle_timeout(Micros(600), &mut rig.out).unwrap();
    assert_given!(
        rig,
        [
            (600, "timer 9 set for 400"),
            (600, "timer 15 set for 400"),
            (600, "timer 1 set for 500"),
            (600, "timer 2 set for 500"),
            (600, "timer 0 set for 501"),
        ]
    );
}

#[test]
fn timers_step_limit() {
    // The cue and 999 timers are 1,000 events.
    let chain = |rig: &Rig, length: usize| {
        for _ in 1..length {
            rig.script.once("timer 0", &[set(0, 0)]);
        }
    };
    let mut rig = Rig::new(rooms(64, 2_000), 1);
    chain(&rig, 999);
    rig.does(100, &[set(0, 0)]);
    assert_eq!(rig.events().len(), 999);

    // Line input, a request and data begin the count anew, at the same instant.
    chain(&rig, 999);
    rig.does(100, &[set(0, 0)]);
    rig.script.once("job-begin", &[set(0, 0)]);
    chain(&rig, 900);
    rig.begin(100, 1, &[b'x'; 1_500], false);
    assert_eq!(rig.events().len(), 999 + 1 + 900);
    rig.script.on("job-data", &[Action::Want { job: JobId(1), bytes: 1 }]);
    rig.does(100, &[Action::Want { job: JobId(1), bytes: 1 }]);
    assert_eq!(rig.events().len(), 1_500 + 1);

    // Rounds of `continue` do not count.
    for _ in 0..700 {
        rig.script.once_more("timer 1", &[]);
        rig.script.once("continue", &[set(1, 0)]);
    }
    rig.does(200, &[set(1, 0)]);
    assert_eq!(rig.events().len(), 1_401);

    // One more, by the plug-in's doing alone.
    chain(&rig, 1_000);
    let fault = rig.tries(300, &[set(0, 0)]).unwrap_err();
    let source = RuleBroken::TimeStandsStill;
    assert!(matches!(fault, LinkFault::Rule { source: broken, .. } if broken == source));
    assert_eq!(rig.events().len(), 999);
}

#[test]
fn clock_from_open() {
    let script = Script::default();
    let mut rig = Rig::closed(script, rooms(64, 64), 1);
    rig.line.link.open(Micros::ZERO, &mut rig.out).unwrap();
    assert_given!(
        rig,
        [(0, "settings first=true last=true"), (0, "open new transmit=64 delivery=64")]
    );

    // It never goes back, whatever the host's clock says.
    rig.receive(500, &[b"a"]).unwrap();
    rig.line.link.received(Micros(300), b"b", &mut rig.out).unwrap();
    rig.script.once("timer 1", &[]);
    rig.script.once("received \"c\"", &[set(1, 400)]);
    rig.line.link.received(Micros(500), b"c", &mut rig.out).unwrap();
    rig.line.link.handle_timeout(Micros(499), &mut rig.out).unwrap();
    assert_eq!(rig.line.link.now(), Micros(500));
    assert_given!(
        rig,
        [
            (500, "received \"a\""),
            (500, "received \"b\""),
            (500, "received \"c\""),
            (500, "timer 1 set for 400"),
        ]
    );
}

#[test]
fn clock_goes_on() {
    let mut rig = Rig::new(rooms(64, 64), 1);
    // Over a lost link: timers run meanwhile.
    rig.does(50, &[set(1, 150)]);
    rig.host(100, |link, out| link.link_down(Micros(100), LinkDownReason::Unplugged, out));
    rig.until(200);
    rig.host(200, |link, out| link.link_up(Micros(200), out));
    // Over close and open.
    rig.host(300, |link, out| link.close(Micros(300), out));
    rig.until(400);
    rig.host(400, |link, out| link.open(Micros(400), out));
    rig.does(500, &[set(2, 600)]);
    rig.until(600);
    assert_given!(
        rig,
        [
            (100, "link-down unplugged"),
            (150, "timer 1 set for 150"),
            (200, "link-up"),
            (300, "close"),
            (400, "settings first=true last=true"),
            (400, "open new transmit=64 delivery=64"),
            (600, "timer 2 set for 600"),
        ]
    );
    // Over a swap.
    let saved = Action::Saved { format: 1, offset: 0, total: 0, bytes: b"" };
    rig.script.on("save", &[saved]);
    let next = Script::default();
    next.once("open resumed", &[set(3, 800)]);
    rig.line.link.swap(Micros(700), next.plugin(), &mut rig.out).unwrap();
    rig.until(900);
    let expected = [
        (700, "settings first=true last=true"),
        (700, "restore 1 0+0/0"),
        (700, "open resumed transmit=64 delivery=64"),
        (800, "timer 3 set for 800"),
    ];
    assert_eq!(next.take(), expected.map(|(at, event)| (at, event.to_owned())));
    assert_events!(rig, ["save"]);
}
