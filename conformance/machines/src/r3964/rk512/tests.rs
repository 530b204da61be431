//! A computer alone, against the vectors of section 11 of the protocol's page.

use softplug_abi::LineParameters;

use super::*;

const DLE: u8 = 0x10;

fn computer(faults: Vec<(u32, Fault)>) -> Computer {
    let line = LineParameters::new(0);
    let procedure = super::super::Options { line, nak_at_start: false, ..Default::default() };
    let mut computer = Computer::new(Options { procedure, faults, ..Options::default() }).unwrap();
    computer.memory.set(Area::Db(5), vec![0x12, 0x34, 0x10, 0x03]);
    computer.memory.set(Area::Db(16), vec![0; 600]);
    computer
}

/// The other side says all of this; what the computer says then.
fn say(computer: &mut Computer, at: i64, bytes: &[u8]) -> Vec<u8> {
    let now = Micros(at);
    let mut said = Vec::new();
    for byte in bytes {
        computer.receive(now, *byte);
        said.extend(std::iter::from_fn(|| computer.poll_transmit(now)));
    }
    said.extend(std::iter::from_fn(|| computer.poll_transmit(now)));
    said
}

fn block(data: &[u8]) -> Vec<u8> {
    super::super::frame::encode(data, &super::super::Options::default())
}

/// A command of the other side's, all of it; the reaction.
fn ask(computer: &mut Computer, at: i64, command: &[u8]) -> Vec<u8> {
    assert_eq!(say(computer, at, &[0x02]), [DLE]);
    assert_eq!(say(computer, at + 1, &block(command)), [DLE, 0x02]);
    let reaction = say(computer, at + 2, &[DLE]);
    say(computer, at + 3, &[DLE]);
    reaction
}

#[test]
fn a_fetch_goes_out_as_in_the_vector() {
    let mut computer = computer(Vec::new());
    computer.fetch(Micros::ZERO, Area::Db(5), 10, 7);
    assert_eq!(say(&mut computer, 0, &[]), [0x02]);
    let telegram = say(&mut computer, 1, &[DLE]);
    assert_eq!(
        telegram,
        [0x00, 0x00, 0x45, 0x44, 0x05, 0x0A, 0x00, 0x07, 0xFF, 0xFF, 0x10, 0x03, 0x1A]
    );
}

#[test]
fn a_send_goes_out_as_in_the_vector_and_its_reaction_ends_it() {
    let mut computer = computer(Vec::new());
    computer.write(Micros::ZERO, Area::Db(16), 1, vec![0x12, 0x34]);
    say(&mut computer, 0, &[]);
    let telegram = say(&mut computer, 1, &[DLE]);
    assert_eq!(
        telegram,
        [
            0x00, 0x00, 0x41, 0x44, 0x10, 0x10, 0x01, 0x00, 0x01, 0xFF, 0xFF, 0x12, 0x34, 0x10,
            0x03, 0x30
        ]
    );
    assert_eq!(say(&mut computer, 2, &[DLE]), [] as [u8; 0]);
    assert_eq!(say(&mut computer, 3, &[0x02]), [DLE]);
    say(&mut computer, 4, &[0x00, 0x00, 0x00, 0x00, 0x10, 0x03, 0x13]);
    assert_eq!(computer.outcomes[0].result, Ok(Vec::new()));
}

#[test]
fn a_fetch_is_answered_as_in_the_vector() {
    let mut computer = computer(Vec::new());
    let command = [0x00, 0x00, 0x45, 0x44, 0x05, 0x00, 0x00, 0x02, 0xFF, 0xFF];
    assert_eq!(
        ask(&mut computer, 0, &command),
        [0x00, 0x00, 0x00, 0x00, 0x12, 0x34, 0x10, 0x10, 0x03, 0x10, 0x03, 0x36]
    );
}

#[test]
fn more_than_a_telegram_goes_on_with_follow_ups() {
    let mut computer = computer(Vec::new());
    let data: Vec<u8> = (0..130).map(|n| n | 0x80).collect();
    let mut command = vec![0x00, 0x00, 0x41, 0x44, 0x10, 0x00, 0x00, 65, 0xFF, 0xFF];
    command.extend(&data[..128]);
    assert_eq!(ask(&mut computer, 0, &command), block(&[0, 0, 0, 0]));
    let follow_up = [0xFF, 0x00, 0x41, 0x44, data[128], data[129]];
    assert_eq!(ask(&mut computer, 10, &follow_up), block(&[0xFF, 0, 0, 0]));
    assert_eq!(computer.memory.area(Area::Db(16)).unwrap()[..130], data);
    // There is nothing left to follow.
    assert_eq!(ask(&mut computer, 20, &follow_up), block(&[0xFF, 0, 0, 0x36]));
}

#[test]
fn what_cannot_be_carried_out_has_its_number() {
    for (command, number) in [
        (&[0x00, 0x00, 0x45, 0x44, 0x07, 0x00, 0x00, 0x02, 0xFF, 0xFF][..], 0x14),
        (&[0x00, 0x00, 0x45, 0x44, 0x05, 0x01, 0x00, 0x02, 0xFF, 0xFF], 0x14),
        (&[0x00, 0x00, 0x45, 0x51, 0x05, 0x00, 0x00, 0x02, 0xFF, 0xFF], 0x0C),
        (&[0x00, 0x00, 0x41, 0x4D, 0x00, 0x00, 0x00, 0x02, 0xFF, 0xFF, 1, 2], 0x0C),
        (&[0x00, 0x00, 0x42, 0x44, 0x05, 0x00, 0x00, 0x02, 0xFF, 0xFF], 0x16),
        (&[0x01, 0x00, 0x45, 0x44, 0x05, 0x00, 0x00, 0x02, 0xFF, 0xFF], 0x10),
        (&[0x00, 0x00, 0x45, 0x44, 0x05, 0x00, 0x00], 0x34),
        (&[0x00, 0x00, 0x41, 0x44, 0x10, 0x00, 0x00, 0x02, 0xFF, 0xFF, 1, 2, 3], 0x34),
    ] {
        let mut computer = computer(Vec::new());
        assert_eq!(ask(&mut computer, 0, command), block(&[0, 0, 0, number]), "{command:02X?}");
    }
}

#[test]
fn reactions_are_wrong_on_demand() {
    let reaction = |fault| {
        let mut computer = computer(vec![(1, fault)]);
        let command = [0x00, 0x00, 0x45, 0x44, 0x05, 0x00, 0x00, 0x01, 0xFF, 0xFF];
        say(&mut computer, 0, &[0x02]);
        say(&mut computer, 1, &block(&command));
        say(&mut computer, 2, &[DLE])
    };
    assert_eq!(reaction(Fault::Error(0x32)), block(&[0, 0, 0, 0x32]));
    assert_eq!(reaction(Fault::NoReaction), [] as [u8; 0]);
    assert_eq!(reaction(Fault::Short), block(&[0, 0, 0, 0, 0x12]));
    assert_eq!(reaction(Fault::Long), block(&[0, 0, 0, 0, 0x12, 0x34, 0]));
    assert_eq!(reaction(Fault::Malformed), block(&[0, 0x55, 0, 0, 0x12, 0x34]));
}

#[test]
fn a_reaction_that_does_not_come_ends_the_command() {
    let mut computer = computer(Vec::new());
    computer.fetch(Micros::ZERO, Area::Db(5), 0, 1);
    say(&mut computer, 0, &[]);
    say(&mut computer, 1, &[DLE]);
    say(&mut computer, 2, &[DLE]);
    assert_eq!(computer.next_event(), Some(Micros(20_000_002)));
    computer.advance(Micros(20_000_002));
    assert_eq!(computer.outcomes[0].result, Err(Trouble::NoReaction));
}
