//! RK512: the plug-in against a simulated computer, and against itself.

use std::collections::BTreeMap;

use rand_chacha::rand_core::Rng;
use softplug_abi::{Failure, LineParameters, Micros, Value, ValueWriter, Values};
use softplug_machines::r3964::rk512::{
    Area, Command, Computer, Fault, Memory, Options, TELEGRAM_BYTES, Trouble,
};
use softplug_machines::r3964::{Noise, Noisy};

use super::{LONG, blocks, plugin, random};
use crate::common::pair::{Asked, Pair, PluginEnd};

const WRITE: u16 = 1;
const READ: u16 = 2;
const RK512: (&str, &str) = ("layer", "rk512");

fn fields(command: &Command) -> Vec<u8> {
    let mut buffer = [0; 200];
    let mut writer = ValueWriter::new(&mut buffer);
    let mut push = |index, value| writer.push(index, value).expect("it fits");
    let (name, block) = match command.area {
        Area::Db(block) => ("DB", block),
        Area::Dx(block) => ("DX", block),
        Area::Inputs => ("I", 0),
        Area::Outputs => ("Q", 0),
        Area::Flags => ("M", 0),
        Area::Timers => ("T", 0),
        Area::Counters => ("C", 0),
    };
    push(0, Value::Text(name));
    push(1, Value::Int(block.into()));
    push(2, Value::Int(command.offset.into()));
    if command.data.is_none() {
        push(3, Value::Int(command.count.into()));
    }
    if let Some((byte, bit)) = command.flag {
        push(4, Value::Int(byte.into()));
        push(5, Value::Int(bit.into()));
    }
    writer.written().to_vec()
}

/// A host's own memory, by the names that requests use.
type Areas = BTreeMap<(String, i64), Vec<u8>>;

/// What a host answers from its memory.
fn serve(memory: &mut Areas, asked: &Asked) -> Result<Vec<u8>, Failure> {
    let values = Values::new(&asked.fields);
    let number = |index| match values.find(index) {
        Some(Value::Int(number)) => number,
        _ => 0,
    };
    let name = match values.find(0) {
        Some(Value::Text(name)) => name.to_owned(),
        other => panic!("the area is {other:?}"),
    };
    let unit = if ["DB", "DX", "T", "C"].contains(&name.as_str()) { 2 } else { 1 };
    let area = memory.get_mut(&(name, number(1))).ok_or(Failure::NotFound)?;
    let at = number(2) as usize * unit;
    let bytes = number(3) as usize * unit;
    let place = area.get_mut(at..at + bytes).ok_or(Failure::NotFound)?;
    if asked.kind == 1 {
        return Ok(place.to_vec());
    }
    let Some(Value::Bytes(data)) = values.find(7) else { panic!("a write without data") };
    assert_eq!(data.len(), bytes, "as many bytes as the count says");
    place.copy_from_slice(data);
    Ok(Vec::new())
}

fn serve_all(end: &mut PluginEnd, memory: &mut Areas) {
    for asked in std::mem::take(&mut end.host.asked) {
        let answer = serve(memory, &asked);
        end.answer(asked.request, answer);
    }
}

/// A command for an area of 600 bytes, DB 5 or DX 6 for writing, and others.
fn command(random: &mut impl Rng) -> Command {
    let mut below = |limit: u32| random.next_u32() % limit;
    let is_write = below(2) == 0;
    let areas = [
        Area::Db(5),
        Area::Dx(6),
        Area::Inputs,
        Area::Outputs,
        Area::Flags,
        Area::Timers,
        Area::Counters,
    ];
    let area = areas[below(if is_write { 2 } else { 7 }) as usize];
    let offset = below(40) as u8;
    let longest = below(2) * 170 + 20;
    let count = (1 + below(longest)) as u16;
    let data = is_write.then(|| (0..usize::from(count) * 2).map(|_| below(256) as u8).collect());
    Command { area, offset, data, count, flag: None }
}

/// What both kinds of memory hold.
fn content(area: Area) -> Vec<u8> {
    (0..600_u32).map(|n| (n * 7 + u32::from(area.letter())) as u8).collect()
}

fn areas() -> Areas {
    [
        (("DB", 5), Area::Db(5)),
        (("DX", 6), Area::Dx(6)),
        (("I", 0), Area::Inputs),
        (("Q", 0), Area::Outputs),
        (("M", 0), Area::Flags),
        (("T", 0), Area::Timers),
        (("C", 0), Area::Counters),
    ]
    .into_iter()
    .map(|((name, block), area)| ((name.to_owned(), block), content(area)))
    .collect()
}

fn memory() -> Memory {
    let mut memory = Memory::default();
    let areas = [
        Area::Db(5),
        Area::Dx(6),
        Area::Inputs,
        Area::Outputs,
        Area::Flags,
        Area::Timers,
        Area::Counters,
    ];
    for area in areas {
        memory.set(area, content(area));
    }
    memory
}

/// What a command must read, and does to a memory that only it changes.
fn apply(memory: &mut Memory, command: &Command) -> Vec<u8> {
    let unit = command.area.unit();
    let at = usize::from(command.offset) * unit;
    let end = at + usize::from(command.count) * unit;
    let mut bytes = memory.area(command.area).expect("it is there").to_vec();
    let Some(data) = &command.data else { return bytes[at..end].to_vec() };
    bytes[at..end].copy_from_slice(data);
    memory.set(command.area, bytes);
    Vec::new()
}

/// Holds the ends of a plug-in's jobs against what its commands must read.
fn assert_done(end: &PluginEnd, commands: &[Command], mut memory: Memory) {
    assert!(end.is_at_rest());
    assert_eq!(end.host.jobs.len(), commands.len());
    for (place, command) in commands.iter().enumerate() {
        let job = &end.host.jobs[place];
        assert!(matches!(job.result, Some(Ok(_))), "{command:?}: {:?}", job.result);
        let read = apply(&mut memory, command);
        let id = place as u32 + 1;
        let mut delivered = end.host.delivered.iter().filter(|delivered| delivered.job == id);
        if command.data.is_none() {
            let delivered = delivered.next().expect("a read delivers");
            assert_eq!((delivered.result, &delivered.data), (Ok(()), &read), "{command:?}");
        }
        assert!(delivered.next().is_none());
    }
}

#[test]
fn the_plugin_and_a_computer_read_and_write_each_other() {
    let mut random = random(11);
    let options = Options::default();
    let mut near = plugin(options.procedure.line, &[RK512, ("priority", "low")]);
    let near_commands: Vec<_> = (0..150).map(|_| command(&mut random)).collect();
    let far_commands: Vec<_> = (0..150).map(|_| command(&mut random)).collect();
    for (command, (at, _)) in near_commands.iter().zip(blocks(12, 150)) {
        let kind = if command.data.is_some() { WRITE } else { READ };
        near.job(at, kind, fields(command), command.data.clone().unwrap_or_default());
    }
    let mut computer = Computer::new(options).expect("sound options");
    computer.memory = memory();
    let mut pair = Pair::new(near, computer);
    let mut own = areas();
    for (command, (at, _)) in far_commands.iter().zip(blocks(13, 150)) {
        while pair.step(at) {
            serve_all(&mut pair.a, &mut own);
        }
        pair.b.command(at, command.clone());
    }
    while pair.step(LONG) {
        serve_all(&mut pair.a, &mut own);
    }
    assert_done(&pair.a, &near_commands, memory());
    assert_eq!(pair.b.waiting(), 0);
    assert_eq!(pair.b.outcomes.len(), far_commands.len());
    let mut expected = memory();
    for (outcome, command) in pair.b.outcomes.iter().zip(&far_commands) {
        assert_eq!(outcome.command, *command);
        assert_eq!(outcome.result, Ok(apply(&mut expected, command)), "{command:?}");
    }
    assert_eq!(pair.b.stray_reactions, 0);
    assert!(pair.b.served.iter().all(|served| served.error == 0));
}

/// Damaged characters cost repetitions, and a repeated telegram may have a
/// second reaction, which nobody can tell from the next command's. As long as
/// no telegram came twice all is as on a sound line; and all comes to rest.
#[test]
fn on_a_line_with_parity_errors_no_command_goes_wrong_unseen() {
    let mut clean = 0;
    for seed in 0..60 {
        let mut random = random(1_000 + seed);
        let options = Options::default();
        let line = options.procedure.line;
        let mut near = plugin(line, &[RK512, ("priority", "low")]);
        let commands: Vec<_> = (0..12).map(|_| command(&mut random)).collect();
        for (command, (at, _)) in commands.iter().zip(blocks(2_000 + seed, 12)) {
            let kind = if command.data.is_some() { WRITE } else { READ };
            near.job(at, kind, fields(command), command.data.clone().unwrap_or_default());
        }
        let mut computer = Computer::new(options).expect("sound options");
        computer.memory = memory();
        let noise = Noise { seed, flip_one: 1, framing: 1, ..Noise::default() };
        let mut pair = Pair::new(near, Noisy::new(computer, line, noise));
        let mut own = areas();
        for (at, _) in blocks(3_000 + seed, 12) {
            while pair.step(at) {
                serve_all(&mut pair.a, &mut own);
            }
            pair.b.inner.command(at, command(&mut random));
        }
        while pair.step(LONG) {
            serve_all(&mut pair.a, &mut own);
        }
        assert!(pair.a.is_at_rest(), "seed {seed}");
        assert!(pair.a.host.jobs.iter().all(|job| job.result.is_some()), "seed {seed}");
        let computer = &pair.b.inner;
        assert_eq!((computer.waiting(), computer.outcomes.len()), (0, 12), "seed {seed}");
        let telegrams = |command: &Command| {
            (usize::from(command.count) * command.area.unit()).div_ceil(TELEGRAM_BYTES)
        };
        let expected: usize = commands.iter().map(telegrams).sum();
        let is_failed = pair.a.host.jobs.iter().any(|job| !matches!(job.result, Some(Ok(_))));
        if computer.served.len() == expected && !is_failed {
            clean += 1;
            assert_done(&pair.a, &commands, memory());
        }
    }
    assert!(clean >= 10, "only {clean} of 60 runs went without a repeated command");
}

#[test]
fn two_plugins_read_and_write_each_other() {
    let mut random = random(21);
    let line = LineParameters::new(115_200);
    let mut ends =
        [plugin(line, &[RK512, ("priority", "low")]), plugin(line, &[RK512, ("priority", "high")])];
    let mut commands = [Vec::new(), Vec::new()];
    for (side, end) in ends.iter_mut().enumerate() {
        for (at, _) in blocks(22 + side as u64, 150) {
            let command = command(&mut random);
            let kind = if command.data.is_some() { WRITE } else { READ };
            end.job(at, kind, fields(&command), command.data.clone().unwrap_or_default());
            commands[side].push(command);
        }
    }
    let [one, other] = ends;
    let mut pair = Pair::new(one, other);
    let mut memories = [areas(), areas()];
    while pair.step(LONG) {
        serve_all(&mut pair.a, &mut memories[0]);
        serve_all(&mut pair.b, &mut memories[1]);
    }
    assert_done(&pair.a, &commands[0], memory());
    assert_done(&pair.b, &commands[1], memory());
}

/// Each wrong reaction on demand, and how the plug-in's job then ends.
#[test]
fn wrong_reactions_fail_the_job_with_their_number() {
    for (fault, failure, status) in [
        (Fault::Error(0x0A), Failure::BadJob, 0x0A),
        (Fault::Error(0x0C), Failure::BadJob, 0x0C),
        (Fault::Error(0x12), Failure::BadJob, 0x12),
        (Fault::Error(0x34), Failure::BadJob, 0x34),
        (Fault::Error(0x14), Failure::NotFound, 0x14),
        (Fault::Error(0x10), Failure::NotSupported, 0x10),
        (Fault::Error(0x16), Failure::NotSupported, 0x16),
        (Fault::Error(0x2A), Failure::Refused, 0x2A),
        (Fault::Error(0x32), Failure::Refused, 0x32),
        (Fault::Error(0x36), Failure::Protocol, 0x36),
        (Fault::Short, Failure::Protocol, 0),
        (Fault::Long, Failure::Protocol, 0),
        (Fault::Malformed, Failure::Protocol, 0),
        (Fault::NoReaction, Failure::NoAnswer, 0),
    ] {
        let options = Options { faults: vec![(1, fault)], ..Options::default() };
        let mut near = plugin(options.procedure.line, &[RK512, ("priority", "low")]);
        let command = Command { area: Area::Db(5), offset: 0, data: None, count: 3, flag: None };
        near.job(Micros::from_secs(1), READ, fields(&command), Vec::new());
        near.job(Micros::from_secs(60), READ, fields(&command), Vec::new());
        let mut computer = Computer::new(options).expect("sound options");
        computer.memory = memory();
        let mut pair = Pair::new(near, computer);
        pair.run_until(LONG);
        let results: Vec<_> = pair.a.host.jobs.iter().map(|job| job.result).collect();
        assert_eq!(results[0], Some(Err((failure, status))), "{fault:?}");
        assert!(matches!(results[1], Some(Ok(_))), "{fault:?}: {results:?}");
        assert!(pair.a.is_at_rest());
    }
}

/// What the host refuses comes back to the computer as its number.
#[test]
fn refusals_of_the_host_become_reactions() {
    for (failure, number) in [
        (Failure::NotFound, 0x14),
        (Failure::Denied, 0x0A),
        (Failure::Busy, 0x32),
        (Failure::NotSupported, 0x10),
        (Failure::BadJob, 0x34),
        (Failure::TooLong, 0x34),
        (Failure::Internal, 0x2A),
    ] {
        let options = Options::default();
        let near = plugin(options.procedure.line, &[RK512, ("priority", "low")]);
        let mut pair = Pair::new(near, Computer::new(options).expect("sound options"));
        pair.b.fetch(Micros::from_secs(1), Area::Db(5), 0, 4);
        while pair.step(LONG) {
            for asked in std::mem::take(&mut pair.a.host.asked) {
                pair.a.answer(asked.request, Err(failure));
            }
        }
        let results: Vec<_> =
            pair.b.outcomes.iter().map(|outcome| outcome.result.clone()).collect();
        assert_eq!(results, [Err(Trouble::Reaction(number))], "{failure:?}");
    }
}

/// Nobody answers the request: it is withdrawn, and the reaction says so.
#[test]
fn a_silent_host_is_a_partner_in_stop() {
    let options = Options { reaction_timeout: Micros::from_secs(60), ..Options::default() };
    let near = plugin(options.procedure.line, &[RK512, ("priority", "low")]);
    let mut pair = Pair::new(near, Computer::new(options).expect("sound options"));
    pair.b.fetch(Micros::from_secs(1), Area::Db(5), 0, 4);
    pair.run_until(LONG);
    assert_eq!(pair.b.outcomes.len(), 1);
    assert_eq!(pair.b.outcomes[0].result, Err(Trouble::Reaction(0x2A)));
    assert!(pair.a.host.asked.is_empty(), "the request is withdrawn");
}

#[test]
fn two_computers_read_and_write_each_other() {
    let mut random = random(31);
    let mut ends: Vec<_> = (0..2)
        .map(|side| {
            let mut options = Options::default();
            if side == 0 {
                options.procedure.priority = softplug_machines::r3964::Priority::Low;
            }
            let mut computer = Computer::new(options).expect("sound options");
            computer.memory = memory();
            computer
        })
        .collect();
    let (other, one) = (ends.remove(1), ends.remove(0));
    let mut pair = Pair::new(one, other);
    let mut at = Micros::from_secs(1);
    for _ in 0..100 {
        pair.run_until(at);
        pair.a.command(at, command(&mut random));
        pair.b.command(at, command(&mut random));
        at = at + Micros(i64::from(random.next_u32() % 2_000_000));
    }
    pair.run_until(LONG);
    for computer in [&pair.a, &pair.b] {
        assert_eq!(computer.outcomes.len(), 100);
        let mut expected = memory();
        for outcome in &computer.outcomes {
            assert_eq!(outcome.result, Ok(apply(&mut expected, &outcome.command)));
        }
    }
}
