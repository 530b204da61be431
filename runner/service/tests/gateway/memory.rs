//! Words of a memory over RK512: read and written by jobs, and asked for by the machine.

use softplug_abi::JobId;
use std::fs;
use std::io::Read;

use softplug_machines::r3964::rk512::{Area, Computer, Trouble};
use softplug_service::Gateway;
use softplug_service::view::{JobOrder, JobState, JobView};

use crate::gateway::machine::Machine;
use crate::gateway::shop::{Shop, wait_for};

const LINES: &str = "plugin = \"r3964\"\nline = \"115200 8N1\"\nsettings = { layer = \"rk512\" }\n";

fn words(count: usize) -> Vec<u8> {
    (0..count * 2).map(|at| (at * 7 % 251) as u8).collect()
}

fn order(kind: &str, block: u8, offset: usize, count: usize) -> JobOrder {
    let fields = [("area", "DB".to_owned()), ("block", block.to_string())];
    let more = [("offset", offset.to_string()), ("count", count.to_string())];
    let fields = fields.into_iter().chain(more).map(|(name, value)| (name.to_owned(), value));
    JobOrder { kind: Some(kind.to_owned()), fields: fields.collect(), ..JobOrder::default() }
}

fn ended(gateway: &Gateway, order: &JobOrder) -> JobView {
    let id = gateway.submit(&Shop::name(0), order).unwrap().id;
    wait_for("the job's end", || gateway.job(JobId(id)).unwrap().ended_ms.is_some());
    gateway.job(JobId(id)).unwrap()
}

fn received(gateway: &Gateway, file: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut download = gateway.download_reception(&Shop::name(0), file).unwrap();
    download.file.read_to_end(&mut bytes).unwrap();
    bytes
}

#[test]
fn jobs_read_and_write_the_machines_memory() {
    let machine = Machine::rk512();
    let shop = Shop::of_machine(&machine, LINES);
    read_and_write(&machine, &shop);
}

/// Whatever leads to the machine.
pub(crate) fn read_and_write(machine: &Machine<Computer>, shop: &Shop) {
    let gateway = shop.gateway();
    let memory = words(300);
    let has = memory.clone();
    machine.tell(move |_, computer: &mut Computer| {
        computer.memory.set(Area::Db(5), has);
        computer.memory.set(Area::Db(6), vec![0; 100]);
    });

    // More than one telegram takes.
    let read = ended(gateway, &order("read", 5, 10, 200));
    assert_eq!(read.state, JobState::Done, "{read:?}");
    assert_eq!(received(gateway, &read.answer.unwrap()), memory[20..420]);
    let none = ended(gateway, &order("read", 99, 0, 1));
    assert_eq!(none.state, JobState::Failed);
    assert!(none.message.is_some_and(|text| !text.is_empty()));

    shop.program("words", 0);
    fs::write(shop.path("programs/words"), &memory[..40]).unwrap();
    let program = Some("words".to_owned());
    let written = ended(gateway, &JobOrder { program, ..order("write", 6, 3, 20) });
    assert_eq!((written.state, written.progress.surely_left), (JobState::Done, 40), "{written:?}");
    let there = machine
        .tell(|_, computer: &mut Computer| computer.memory.area(Area::Db(6)).map(<[u8]>::to_vec));
    assert_eq!(there.unwrap()[6..46], memory[..40]);
}

#[test]
fn the_machine_reads_inputs_outputs_and_flags_from_files_of_their_letters() {
    let machine = Machine::rk512();
    let shop = Shop::of_machine(&machine, LINES);
    read_from_files(&machine, &shop);
}

/// Whatever leads to the machine.
pub(crate) fn read_from_files(machine: &Machine<Computer>, shop: &Shop) {
    let memory = words(20);
    let areas =
        [(Area::Inputs, "I"), (Area::Outputs, "Q"), (Area::Flags, "M"), (Area::Dx(3), "DX3")];
    for (_, file) in areas {
        shop.program_in("b", file, 0);
        fs::write(shop.path(&format!("programs/b/{file}")), &memory).unwrap();
    }
    machine.tell(move |now, computer: &mut Computer| {
        for (area, _) in areas {
            computer.fetch(now, area, 3, 8);
        }
    });
    wait_for("the reactions", || {
        machine.tell(|_, computer: &mut Computer| computer.waiting()) == 0
    });
    let outcomes = machine.tell(|_, computer: &mut Computer| computer.outcomes.clone());
    let results: Vec<_> = outcomes.into_iter().map(|outcome| outcome.result).collect();
    // The first three in bytes, a data block in words.
    let bytes = || Ok(memory[3..11].to_vec());
    assert_eq!(results, [bytes(), bytes(), bytes(), Ok(memory[6..22].to_vec())]);
}

#[test]
fn the_machine_reads_files_and_writes_receptions() {
    let machine = Machine::rk512();
    let shop = Shop::of_machine(&machine, LINES);
    let gateway = shop.gateway();
    let memory = words(200);
    shop.program_in("b", "DB7", 0);
    fs::write(shop.path("programs/b/DB7"), &memory).unwrap();
    machine.tell(|now, computer: &mut Computer| {
        computer.fetch(now, Area::Db(7), 2, 150);
        computer.fetch(now, Area::Db(8), 0, 1);
        computer.fetch(now, Area::Db(7), 190, 20);
        computer.write(now, Area::Db(16), 1, words(100));
        computer.write(now, Area::Db(16), 1, words(3));
    });
    wait_for("the reactions", || {
        machine.tell(|_, computer: &mut Computer| computer.waiting()) == 0
    });
    let outcomes = machine.tell(|_, computer: &mut Computer| computer.outcomes.clone());
    let results: Vec<_> = outcomes.into_iter().map(|outcome| outcome.result).collect();
    assert_eq!(results[0].as_deref(), Ok(&memory[4..304]));
    assert!(matches!(results[1], Err(Trouble::Reaction(_))), "no such block: {results:?}");
    assert!(matches!(results[2], Err(Trouble::Reaction(_))), "behind its end: {results:?}");
    assert_eq!((results[3].as_deref(), results[4].as_deref()), (Ok(&[][..]), Ok(&[][..])));
    // What was acknowledged is on the disk; nothing was overwritten.
    // A telegram has 64 words at most, and each is kept by itself.
    assert_eq!(received(gateway, "DB16-1"), words(100)[..128]);
    assert_eq!(received(gateway, "DB16-65"), words(100)[128..]);
    assert_eq!(received(gateway, "DB16-1-2"), words(3));
}
