//! A unit with a simulated machine, and a gateway's end of the unit protocol, over loopback.

mod answers;
mod bus;
mod cable;
mod machine;
mod raw_server;
mod shop;
mod tls;

use machine::Machine;
use raw_server::RawServer;
use shop::{Shop, ended, program};
use softplug_abi::{Failure, JobId};
use softplug_live::reactor::{JobOutcome, Probation, Report, SwapReport, When};
use softplug_live::units::{UnitCommand, UnitPlugin};
use softplug_unit_protocol::ToUnit;

#[test]
fn a_plug_in_is_downloaded_and_a_program_arrives() {
    let mut shop = Shop::new(Machine::fast());
    shop.until_up();
    let program = program(20_000);
    let end = shop.send(1, &program);
    assert_eq!(end.outcome, JobOutcome::Done);
    assert_eq!((end.taken, end.bytes_maybe_left), (20_000, 20_000));
    shop.until_received(&program);
}

#[test]
fn the_cable_is_out_five_times_in_mid_job_and_nothing_is_lost_or_doubled() {
    let mut shop = Shop::new(Machine::at(115_200));
    shop.until_up();
    let program = program(60_000);
    shop.begin(1, &program);
    for cut in 1..=5_usize {
        shop.until(|shop| shop.received().len() >= cut * 10_000);
        shop.cable.cut();
    }
    let end = shop.until_report(ended);
    assert_eq!(end.outcome, JobOutcome::Done);
    shop.until_received(&program);
}

#[test]
fn the_machine_goes_on_from_the_buffer_while_the_cable_is_out() {
    let mut shop = Shop::new(Machine::at(115_200));
    shop.until_up();
    let program = program(8_000);
    shop.begin(1, &program);
    shop.until(|shop| shop.received().len() >= 1_000);
    shop.cable.hold(true);
    // All of it is in the unit by now, or comes out of what is.
    shop.until(|shop| shop.received() == program);
    shop.cable.hold(false);
    assert_eq!(shop.until_report(ended).outcome, JobOutcome::Done);
}

#[test]
fn a_unit_that_is_started_anew_runs_what_it_has_and_its_job_is_told_as_it_was() {
    let mut shop = Shop::new(Machine::at(9_600));
    shop.until_up();
    let program = program(30_000);
    shop.begin(1, &program);
    shop.until(|shop| shop.received().len() >= 1_000);
    shop.restart_unit();
    let end = shop.until_report(ended);
    assert_eq!(end.outcome, JobOutcome::Failed { failure: Failure::Interrupted, status: 0 });
    let left = shop.received().len() as u64;
    assert!(end.bytes_surely_left <= left && left <= end.bytes_maybe_left, "{end:?}, {left}");
    // It has the plug-in: nothing is downloaded.
    shop.until_up();
    assert_eq!(shop.erases(), [1, 0]);
    assert_eq!(shop.send(2, b"G1 X2\n").outcome, JobOutcome::Done);
}

#[test]
fn a_gateway_that_is_started_anew_ends_what_it_does_not_know() {
    let mut shop = Shop::new(Machine::at(9_600));
    shop.until_up();
    shop.begin(1, &program(30_000));
    shop.until(|shop| shop.received().len() >= 500);
    shop.restart_gateway();
    shop.until_up();
    let before = shop.received();
    assert!(before.len() < 30_000);
    assert_eq!(shop.send(2, b"G1 X2\n").outcome, JobOutcome::Done);
    shop.until_received(&[&before[..], b"G1 X2\n"].concat());
}

#[test]
fn a_swap_in_mid_job_costs_no_byte() {
    let mut shop = Shop::new(Machine::at(57_600));
    shop.until_up();
    let program = program(40_000);
    shop.begin(1, &program);
    shop.until(|shop| shop.received().len() >= 5_000);
    let plugin = Shop::another_plugin();
    let probation = Probation { events: 50, ..Probation::default() };
    shop.tell(UnitCommand::Swap { plugin, when: When::Now, probation });
    let done = shop.until_report(shop::swapped);
    assert!(
        matches!(done, SwapReport::Done { with_state: true, on_probation: true, .. }),
        "{done:?}"
    );
    assert_eq!(shop.until_report(shop::swapped), SwapReport::Kept);
    assert_eq!(shop.until_report(ended).outcome, JobOutcome::Done);
    shop.until_received(&program);
    assert_eq!(shop.erases(), [1, 1]);
    // It is what runs after a start, too.
    shop.restart_unit();
    shop.until_up();
    assert_eq!(shop.erases(), [1, 1]);
}

#[test]
fn what_the_machine_sends_arrives_once_whatever_the_cable_does() {
    let mut shop = Shop::new(Machine::at(57_600));
    shop.until_up();
    let program = program(20_000);
    let punched = program.clone();
    shop.machine.tell(move |now, control| control.punch(now, punched));
    for cut in 1..=3_usize {
        shop.until(|shop| shop.arrived().len() >= cut * 4_000);
        shop.cable.cut();
    }
    shop.until(|shop| shop.arrived().len() >= 20_000);
    shop.until_report(shop::delivered);
    assert_eq!(shop.arrived(), program);
}

#[test]
fn an_abort_while_the_cable_is_out_ends_the_job_when_it_is_back() {
    let mut shop = Shop::new(Machine::at(9_600));
    shop.until_up();
    shop.begin(1, &program(30_000));
    shop.until(|shop| shop.received().len() >= 500);
    shop.cable.hold(true);
    shop.tell(UnitCommand::Abort(JobId(1)));
    shop.cable.hold(false);
    let end = shop.until_report(ended);
    assert_eq!(end.outcome, JobOutcome::Failed { failure: Failure::Aborted, status: 0 });
    let left = shop.received().len() as u64;
    assert!(left < 30_000 && left <= end.bytes_maybe_left, "{end:?}, {left}");
}

#[test]
fn a_pause_holds_over_a_cable_that_was_out() {
    let mut shop = Shop::new(Machine::at(9_600));
    shop.until_up();
    let program = program(3_000);
    shop.begin(1, &program);
    shop.until(|shop| shop.received().len() >= 500);
    shop.tell(UnitCommand::Pause(JobId(1)));
    shop.cable.cut();
    shop.until_up();
    shop.tell(UnitCommand::Resume(JobId(1)));
    assert_eq!(shop.until_report(ended).outcome, JobOutcome::Done);
    shop.until_received(&program);
}

#[test]
fn a_plug_in_that_is_not_signed_is_refused_where_signatures_are_wanted() {
    let mut shop = Shop::that_wants_signatures(Machine::fast());
    let why = shop.until_report(shop::down);
    assert!(why.contains("without a signature"), "{why}");
    assert_eq!(shop.erases(), [0, 0]);
}

/// Frames that are lost, doubled, late, delayed and damaged, connections that end, units and gateways that
/// are started anew in mid-job, one after the other until there were enough: `SOFTPLUG_BUS_FAULTS`, 100 without.
#[test]
fn whatever_a_bad_bus_does_no_byte_is_lost_doubled_or_altered_unannounced() {
    let enough = std::env::var("SOFTPLUG_BUS_FAULTS").map_or(100, |text| text.parse().unwrap());
    let mut shop = Shop::new(Machine::fast());
    shop.until_up();
    shop.cable.is_bad(7, 60);
    let (mut sent, mut punched) = (Vec::new(), Vec::new());
    let mut restarts = 0;
    for job in 1.. {
        if shop.cable.faults() >= enough {
            break;
        }
        let program = program(40_000 + 37 * job as usize);
        let is_reset = job % 5 == 0;
        let back = format!("({job})\n").into_bytes().repeat(if is_reset { 0 } else { 200 });
        let punch = back.clone();
        shop.machine.tell(move |now, control| control.punch(now, punch));
        shop.begin(job, &program);
        if is_reset {
            let begin = sent.len();
            shop.until(|shop| shop.received().len() > begin + 1_000);
            restarts += 1;
            shop.restart_unit();
        }
        let end = shop.until_report(ended);
        // What has left is in the pty by now, and the machine reads it when it comes to that.
        let sure = if end.outcome == JobOutcome::Done { end.taken } else { end.bytes_surely_left };
        let before = sent.len();
        shop.until(|shop| (shop.received().len() - before) as u64 >= sure);
        let got = shop.received().split_off(before);
        if end.outcome == JobOutcome::Done {
            assert!(got == program, "job {job}: {} of {} bytes", got.len(), program.len());
        } else {
            assert!(is_reset, "job {job} failed: {end:?}");
            let count = got.len() as u64;
            assert!(program.starts_with(&got), "job {job}");
            assert!(
                end.bytes_surely_left <= count && count <= end.bytes_maybe_left,
                "{end:?}, {count}"
            );
        }
        sent.extend(got);
        if is_reset {
            shop.until_up();
        }
        punched.extend(back);
        shop.until(|shop| shop.arrived().len() >= punched.len());
        assert!(shop.arrived() == punched, "job {job}: what came from the machine");
    }
    assert!(shop.cable.faults() >= enough && restarts > 0);
}

#[test]
fn a_plug_in_that_ends_in_mid_job_ends_the_job_and_the_next_one_is_taken() {
    let mut shop = Shop::new(Machine::at(9_600));
    shop.until_up();
    let program = program(30_000);
    shop.begin(1, &program);
    shop.until(|shop| shop.received().len() >= 1_000);
    shop.tell(UnitCommand::Halt("it was stopped by hand".to_owned()));
    let end = shop.until_report(ended);
    assert_eq!(end.outcome, JobOutcome::Failed { failure: Failure::Interrupted, status: 0 });
    let got = shop.received();
    let count = got.len() as u64;
    assert!(program.starts_with(&got));
    assert!(end.bytes_surely_left <= count && count <= end.bytes_maybe_left, "{end:?}, {count}");
    shop.tell(UnitCommand::Replace(Shop::first_plugin()));
    shop.until_up();
    assert_eq!(shop.send(2, b"G1\n").outcome, JobOutcome::Done);
    shop.until_received(&[&got[..], b"G1\n"].concat());
}

/// What the machine was sending then ends as interrupted, and what it sends next is not held up by it.
#[test]
fn a_plug_in_that_ends_in_mid_delivery_does_not_hold_up_the_next_one() {
    let mut shop = Shop::new(Machine::at(57_600));
    shop.until_up();
    let text = program(20_000);
    let punched = text.clone();
    shop.machine.tell(move |now, control| control.punch(now, punched));
    shop.until(|shop| shop.arrived().len() >= 2_000);
    shop.tell(UnitCommand::Halt("it was stopped by hand".to_owned()));
    shop.until_report(shop::broken_off);
    let first = shop.arrived();
    assert!(text.starts_with(&first));
    shop.tell(UnitCommand::Replace(Shop::first_plugin()));
    shop.until_up();
    let again = b"N1 G1 X1\n".to_vec();
    let punched = again.clone();
    shop.machine.tell(move |now, control| control.punch(now, punched));
    shop.until_report(shop::delivered);
    assert!(shop.arrived().ends_with(&again));
}

/// Power failed while a plug-in was on trial, and it cannot even be compiled.
#[test]
fn a_trial_that_cannot_run_gives_way_to_the_plug_in_before_it() {
    let mut shop = Shop::new(Machine::fast());
    shop.until_up();
    // Nobody tells it what to run.
    shop.stop_gateway();
    shop.restart_unit_with(|slots| {
        let module = b"no plug-in at all";
        let digest = *softplug_host::Digest::of(module).as_bytes();
        slots.boot();
        slots.begin(module.len() as u32, digest, None).unwrap();
        slots.write(0, module).unwrap();
        slots.finish().unwrap();
        slots.start_trial().unwrap();
    });
    let mut server = RawServer::connect(shop.cable.address());
    server.ask_until(|heard| heard.iter().any(|message| message.starts_with("Up")));
}

/// A job whose answer comes is not over before that: nor is it where both came about while nobody
/// listened.
#[test]
fn the_answer_of_a_job_is_told_before_its_end() {
    let shop = answers::Shop::new();
    let mut server = RawServer::connect(shop.unit());
    answers::Shop::begin_to_read(&mut server);
    drop(server);
    shop.until_it_was_read();
    let mut server = RawServer::connect(shop.unit());
    server.ask_until(|heard| heard.iter().any(|message| message.starts_with("Ended")));
    let at = |name: &str| server.heard.iter().position(|message| message.starts_with(name));
    assert!(
        at("DeliveryEnded").is_some_and(|at_delivery| at("Ended") > Some(at_delivery)),
        "{:?}",
        server.heard
    );
}

#[test]
fn a_server_that_asks_without_end_is_left_and_the_next_one_is_served() {
    let mut shop = Shop::new(Machine::fast());
    shop.until_up();
    shop.stop_gateway();
    RawServer::connect(shop.cable.address()).ask_without_end();
    let mut server = RawServer::connect(shop.cable.address());
    server.ask_until(|heard| heard.iter().any(|message| message.starts_with("Up")));
}

/// Whatever an earlier session left open: a server is told nothing before it has asked.
#[test]
fn the_first_that_a_server_hears_is_what_the_unit_is() {
    let mut shop = Shop::new(Machine::fast());
    shop.until_up();
    shop.stop_gateway();
    let text = program(3_000);
    shop.machine.tell(move |now, control| control.punch(now, text));
    let mut server = RawServer::connect(shop.cable.address());
    shop.machine.until(|control| control.report().punch_waiting == 0);
    server.turn_for_a_heartbeat();
    assert!(server.heard.is_empty(), "{:?}", server.heard);
    server.say(&ToUnit::Query {});
    server.until(|heard| heard.iter().any(|message| message.starts_with("Delivered")));
    assert!(server.heard[0].starts_with("Unit"), "{:?}", server.heard);
    let at = |name: &str| server.heard.iter().position(|message| message.starts_with(name));
    assert!(at("Told") < at("Delivery"), "{:?}", server.heard);
}

/// A gateway that stops during a trial, or one that stops the plug-in by hand, must not shut the link.
#[test]
fn a_trial_that_is_cut_short_leaves_a_link_that_can_be_opened() {
    let mut shop = Shop::new(Machine::fast());
    shop.until_up();
    let plugin = Shop::another_plugin();
    let probation = Probation { events: 1_000_000, ..Probation::default() };
    shop.tell(UnitCommand::Swap { plugin: plugin.clone(), when: When::Now, probation });
    let done = shop.until_report(shop::swapped);
    assert!(matches!(done, SwapReport::Done { on_probation: true, .. }), "{done:?}");
    shop.tell(UnitCommand::Halt("it was stopped by hand".to_owned()));
    shop.until_report(shop::faulted);
    shop.tell(UnitCommand::Replace(plugin.clone()));
    shop.until_up();
    assert_eq!(shop.send(1, b"G1\n").outcome, JobOutcome::Done);
    // And one that knows nothing of the trial.
    let probation = Probation { events: 1_000_000, ..Probation::default() };
    let other =
        UnitPlugin { settings: vec![("quiet_time".to_owned(), "701".to_owned())], ..plugin };
    shop.tell(UnitCommand::Swap { plugin: other, when: When::Now, probation });
    shop.until_report(shop::swapped);
    shop.restart_gateway();
    shop.until_up();
    assert_eq!(shop.send(2, b"G2\n").outcome, JobOutcome::Done);
}

#[test]
fn settings_that_the_plug_in_refuses_leave_what_runs_as_it_is() {
    let mut shop = Shop::new(Machine::fast());
    shop.until_up();
    // XON and XOFF would be one character: only the plug-in knows that this cannot be.
    let settings = vec![("xon".to_owned(), "19".to_owned())];
    let refused = UnitPlugin { settings, ..Shop::first_plugin() };
    shop.tell(UnitCommand::Replace(refused));
    let detail = shop.until_report(|report| match report {
        Report::Down { detail, .. } => Some(detail.clone()),
        _ => None,
    });
    assert!(detail.contains("does not take its settings"), "{detail}");
    // The port was never closed, and after a start the unit runs with the settings before.
    shop.restart_unit();
    shop.restart_gateway();
    shop.until_up();
    assert_eq!(shop.send(1, b"G1\n").outcome, JobOutcome::Done);
}

#[test]
fn a_swap_that_waits_is_told_as_such_when_the_cable_was_out() {
    let mut shop = Shop::new(Machine::at(115_200));
    shop.until_up();
    let program = program(20_000);
    shop.begin(1, &program);
    shop.until(|shop| shop.received().len() >= 1_000);
    let (plugin, probation) = (Shop::another_plugin(), Probation::default());
    shop.tell(UnitCommand::Swap { plugin, when: When::Idle, probation });
    assert_eq!(shop.until_report(shop::swapped), SwapReport::Waiting);
    shop.cable.cut();
    assert_eq!(shop.until_report(shop::swapped), SwapReport::Waiting);
    // The job's end and that of the swap are told in either order.
    let (mut end, mut done) = (None, None);
    while end.is_none() || done.is_none() {
        let either = |report: &Report| {
            let told = (ended(report), shop::swapped(report));
            (told.0.is_some() || told.1.is_some()).then_some(told)
        };
        let told = shop.until_report(either);
        (end, done) = (told.0.or(end), told.1.or(done));
    }
    assert_eq!(end.map(|end| end.outcome), Some(JobOutcome::Done));
    assert!(matches!(done, Some(SwapReport::Done { .. })), "{done:?}");
    shop.until_received(&program);
}
