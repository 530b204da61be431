//! A small plug-in that counts what it receives, saves the count, and may trap.

/// `fragile` of this version; it traps when it receives the letter, with last words.
pub(crate) fn fragile(version: &str, traps_at: Option<char>) -> Vec<u8> {
    let letter = traps_at.map_or(0, u32::from);
    let text = include_str!("fragile.wat").replace("VERSION", version);
    wat::parse_str(text.replace("LETTER", &letter.to_string())).unwrap()
}

/// `fragile` of this version, which traps when it is given a state.
pub(crate) fn refusing(version: &str) -> Vec<u8> {
    let takes = "(then (global.set $count (i32.load (i32.const 1036))))";
    let text = include_str!("fragile.wat").replace("VERSION", version).replace("LETTER", "0");
    assert!(text.contains(takes), "where it takes a state");
    wat::parse_str(text.replace(takes, "(then unreachable)")).unwrap()
}

/// One that invents deliveries without end: a single one, or many of one byte each.
pub(crate) fn flood(is_many: bool) -> Vec<u8> {
    let (name, how) = if is_many { ("flood-many", "$many") } else { ("flood", "$one") };
    wat::parse_str(include_str!("flood.wat").replace("NAME", name).replace("$HOW", how)).unwrap()
}
