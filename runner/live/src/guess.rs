//! What was meant, where a name is not known, or where a parser of TOML says what it wants.

/// The known name that is so near to `name` that it was probably meant.
pub fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let likeness = |known: &str| strsim::jaro_winkler(&name.to_lowercase(), &known.to_lowercase());
    known
        .into_iter()
        .map(|known| (likeness(known), known))
        .filter(|(likeness, _)| *likeness > 0.8)
        .max_by(|(one, _), (other, _)| one.total_cmp(other))
        .map(|(_, known)| known)
}

/// "did you mean", or what there is.
///
/// ```
/// use softplug_live::guess::of_names;
///
/// assert_eq!(of_names("its jobs", "sent", ["send", "read"]), "did you mean \"send\"?");
/// assert_eq!(of_names("its jobs", "x", ["send", "read"]), "its jobs: send, read");
/// ```
pub fn of_names<'a>(what: &str, name: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let known: Vec<_> = known.into_iter().collect();
    match nearest(name, known.iter().copied()) {
        Some(meant) => format!("did you mean \"{meant}\"?"),
        None if known.is_empty() => format!("there is no {what}"),
        None => format!("{what}: {}", known.join(", ")),
    }
}

/// What to do about what the parser says; `None` where that says it itself.
///
/// ```
/// use softplug_live::guess::of_parser;
///
/// let message = "unknown field `plugn`, expected `name` or `plugin`";
/// assert_eq!(of_parser(message).as_deref(), Some("did you mean \"plugin\"?"));
/// ```
pub fn of_parser(message: &str) -> Option<String> {
    let mut names = message.split('`').skip(1).step_by(2);
    if message.starts_with("unknown field") || message.starts_with("unknown variant") {
        return names.next().map(|name| of_names("known here", name, names));
    }
    if message.starts_with("missing field") {
        let name = names.next().unwrap_or_default();
        return Some(format!("add a line `{name} = …` to this table"));
    }
    if message.starts_with("duplicate key") {
        return Some("keep one of the two".to_owned());
    }
    let (_, expected) = message.rsplit_once("expected ")?;
    Some(format!("write {expected} here"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slips_are_seen_and_strangers_are_not() {
        let known = ["area", "block", "offset", "count", "flag_byte"];
        let cases = [
            ("blok", Some("block")),
            ("Area", Some("area")),
            ("offest", Some("offset")),
            ("flagbyte", Some("flag_byte")),
            ("colour", None),
            ("x", None),
        ];
        for (name, meant) in cases {
            assert_eq!(nearest(name, known), meant, "{name}");
        }
    }

    #[test]
    fn slips_in_a_file_are_told_with_what_was_meant() {
        let told = |message| of_parser(message).unwrap_or_default();
        let message = "unknown field `plugn`, expected one of `name`, `plugin`, `port`";
        assert_eq!(told(message), "did you mean \"plugin\"?");
        let message = "unknown field `x`, expected `name` or `port`";
        assert_eq!(told(message), "known here: name, port");
        assert_eq!(told("missing field `name`"), "add a line `name = …` to this table");
        assert_eq!(told("invalid type: string \"a\", expected u16"), "write u16 here");
        assert_eq!(told("write a number of bytes"), "");
    }
}
