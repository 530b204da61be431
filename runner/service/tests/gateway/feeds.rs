//! Data that comes from a connection instead of a file: fed by whoever asks, and what a client of the
//! endpoint sends.

use softplug_abi::JobId;
use std::io::Write;
use std::net::{TcpListener, TcpStream};

use softplug_service::view::{JobOrder, JobState};

use crate::gateway::shop::{Shop, wait_for};

fn named(name: &str) -> JobOrder {
    JobOrder { program: Some(name.to_owned()), ..JobOrder::default() }
}

#[test]
fn what_was_fed_to_its_end_has_surely_left() {
    let shop = Shop::simulated("r3964", "plugin = \"r3964\"\nline = \"9600 8N1\"\n");
    let (gateway, link) = (shop.gateway(), Shop::name(0));
    let data = vec![b'G'; 600];
    let id = gateway.feed(&link, &named("O1"), None, &mut &data[..]).unwrap().id;
    wait_for("the job's end", || gateway.job(JobId(id)).unwrap().ended_ms.is_some());
    let job = gateway.job(JobId(id)).unwrap();
    assert_eq!((job.state, job.progress.taken), (JobState::Done, 600), "{job:?}");
    assert_eq!((job.progress.surely_left, job.progress.maybe_left), (600, 600));
}

#[test]
fn a_plug_in_that_looks_at_programs_first_gets_all_that_is_fed_first() {
    let shop = Shop::with(1, "plugin = \"xon-xoff\"\nline = \"921600 8N1\"\n");
    let (gateway, link) = (shop.gateway(), Shop::name(0));
    let program = shop.program("unused", 20_000);
    let job = gateway.feed(&link, &named("O1"), None, &mut &program[..]).unwrap();
    assert_eq!(shop.read(0, program.len()), program);
    wait_for("the job's end", || gateway.job(JobId(job.id)).unwrap().state == JobState::Done);
    assert_eq!(gateway.job(JobId(job.id)).unwrap().progress.size, Some(program.len() as u64));
    // What it refuses never began to leave.
    let bad = [&program[..], b"\x13"].concat();
    let id = gateway.feed(&link, &named("O2"), None, &mut &bad[..]).unwrap().id;
    wait_for("the refusal", || gateway.job(JobId(id)).unwrap().state == JobState::Failed);
    let job = gateway.job(JobId(id)).unwrap();
    assert_eq!((job.progress.maybe_left, job.check.is_some()), (0, true), "{job:?}");
    assert_eq!(gateway.link(&link).unwrap().counters.bytes_out, program.len() as u64);
}

#[test]
fn what_an_endpoints_client_sends_is_counted() {
    let free = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let lines = "plugin = \"xon-xoff\"\nline = \"921600 8N1\"\n";
    let lines = format!("{lines}endpoint = {{ listen = \"{free}\", gap = \"50ms\" }}\n");
    let shop = Shop::with(1, &lines);
    let (gateway, link) = (shop.gateway(), Shop::name(0));
    let mut client = TcpStream::connect(free).unwrap();
    for count in 1..=2 {
        client.write_all(b"G0 X1\n").unwrap();
        assert_eq!(shop.read(0, 6), b"G0 X1\n");
        let counters = || gateway.link(&link).unwrap().counters;
        wait_for("the job's end", || counters().endpoint_jobs == count);
        wait_for("its bytes", || counters().endpoint_bytes == 6 * count);
        assert_eq!(counters().endpoint_failed, 0);
    }
}
