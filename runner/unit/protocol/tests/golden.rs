//! Freezes the bytes of version 1. The hex in `fixtures/unit` was written from
//! `docs/unit/protocol.md`, not by this crate. None of it may change within version 1.

use softplug_unit_protocol::{
    Decode, Encode, Frame, FrameKind, LONGEST, Messages, ToServer, ToUnit,
};
use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;

fn read(file: &str) -> String {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../..").join(file);
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn bytes(hex: &str) -> Vec<u8> {
    let digits: Vec<u8> = hex.bytes().map(|c| (c as char).to_digit(16).unwrap() as u8).collect();
    digits.chunks(2).map(|two| two[0] << 4 | two[1]).collect()
}

/// Lines that are no comment, each with the comment above it.
fn lines(text: &str) -> impl Iterator<Item = (&str, &str)> {
    let mut comment = "";
    text.lines().filter_map(move |line| {
        if let Some(said) = line.strip_prefix("# ") {
            comment = said;
            return None;
        }
        (!line.is_empty() && !line.starts_with('#')).then_some((comment, line))
    })
}

/// Whether what was read is what the comment says, value by value, as far as both say numbers.
fn says_the_same(comment: &str, debug: &str) -> Result<(), String> {
    for part in comment.split(", ") {
        let Some((name, value)) = part.split_once(' ') else { continue };
        let value = value.split(' ').next().unwrap_or_default();
        let number = match value.strip_prefix("0x") {
            Some(hex) => u64::from_str_radix(hex, 16).ok(),
            None => value.parse().ok(),
        };
        let is_code = ["state", "when", "outcome", "reason", "level", "failure", "refused"];
        let Some(number) = number.filter(|_| !is_code.contains(&name)) else { continue };
        let shown = [format!("{name}: {number}"), format!("{name}: {}", number == 1)];
        if !shown.iter().any(|shown| debug.contains(shown.as_str())) {
            return Err(format!("{part} is not in {debug}"));
        }
    }
    Ok(())
}

fn check<'a, M>(kinds: &[(u8, &str, &[&str])], name: &str, comment: &str, bytes: &'a [u8])
where
    M: Decode<'a> + Encode + std::fmt::Debug,
{
    let plain = name.split('/').next().unwrap_or(name);
    let (kind, ..) = kinds.iter().find(|(_, known, _)| *known == plain).expect(name);
    assert_eq!(bytes[0], *kind, "{name}");
    let read: Vec<M> = Messages::new(bytes)
        .collect::<Result<_, _>>()
        .unwrap_or_else(|error| panic!("{name}: {error}"));
    let [message] = &read[..] else { panic!("{name}: {read:?}") };
    says_the_same(comment, &format!("{message:?}"))
        .unwrap_or_else(|error| panic!("{name}: {error}"));
    let mut again = [0; 2_048];
    let length = message.encode(&mut again).unwrap();
    assert_eq!(&again[..length], bytes, "{name}");
}

#[test]
fn messages_are_as_they_were_written_from_the_page() {
    let text = read("fixtures/unit/messages.txt");
    let mut seen = BTreeSet::new();
    for (comment, line) in lines(&text) {
        let [to, name, hex] = line.split(' ').collect::<Vec<_>>()[..] else { panic!("{line}") };
        let bytes = bytes(hex);
        match to {
            "to-unit" => check::<ToUnit>(ToUnit::TABLE, name, comment, &bytes),
            "to-server" => check::<ToServer>(ToServer::TABLE, name, comment, &bytes),
            to => panic!("{to}"),
        }
        seen.insert((to.to_owned(), name.split('/').next().unwrap_or(name).to_owned()));
    }
    assert_eq!(seen.len(), ToUnit::TABLE.len() + ToServer::TABLE.len(), "each at least once");
}

#[test]
fn frames_are_as_they_were_written_from_the_page() {
    let text = read("fixtures/unit/frames.txt");
    let mut kinds = Vec::new();
    for (comment, line) in lines(&text) {
        let (name, hex) = line.split_once(' ').unwrap();
        let bytes = bytes(hex);
        let frame = Frame::decode(&bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(format!("{:?}", frame.kind) == name.split('/').next().unwrap(), "{name}");
        let values = comment.split([':', ';']).nth(1).unwrap().trim_start();
        says_the_same(values, &format!("{frame:?}")).unwrap_or_else(|error| panic!("{error}"));
        let mut again = [0; LONGEST];
        let length = frame.encode(&mut again).unwrap();
        assert_eq!(&again[..length], bytes, "{name}");
        kinds.push(frame.kind);
    }
    for kind in [FrameKind::Hello, FrameKind::Welcome, FrameKind::Refuse, FrameKind::Data] {
        assert!(kinds.contains(&kind), "{kind:?}");
    }
}

/// The tables of the page are those of the code: type, name, and the fields in their order.
#[test]
fn the_page_has_every_message() {
    let page = read("docs/unit/protocol.md");
    for (heading, table) in [
        ("### From the server to the unit", ToUnit::TABLE),
        ("### From the unit to the server", ToServer::TABLE),
    ] {
        let (_, part) = page.split_once(heading).expect(heading);
        let part = part.split("\n#").next().unwrap_or(part);
        let rows: Vec<(u8, &str, Vec<&str>)> = part
            .lines()
            .filter_map(|line| {
                let cells: Vec<&str> = line.split('|').map(str::trim).collect();
                let kind = cells.get(1)?.parse().ok()?;
                let name = cells.get(2)?.trim_matches('*');
                let fields = cells.get(3)?.split(", ").filter(|field| !field.is_empty());
                let names = fields.filter_map(|field| field.split('`').nth(1));
                Some((kind, name, names.collect()))
            })
            .collect();
        let known: Vec<(u8, &str, Vec<&str>)> =
            table.iter().map(|(kind, name, fields)| (*kind, *name, fields.to_vec())).collect();
        assert_eq!(rows, known);
    }
}
