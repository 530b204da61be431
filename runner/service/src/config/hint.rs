//! What to do about what the parser of TOML says.

use softplug_gateway::guess::nearest;

/// "did you mean", or what there is.
pub(crate) fn of_names<'a>(
    what: &str,
    name: &str,
    known: impl IntoIterator<Item = &'a str>,
) -> String {
    let known: Vec<_> = known.into_iter().collect();
    match nearest(name, known.iter().copied()) {
        Some(meant) => format!("did you mean \"{meant}\"?"),
        None if known.is_empty() => format!("there is no {what}"),
        None => format!("{what}: {}", known.join(", ")),
    }
}

/// The hint that goes with a message of the parser.
pub(super) fn of_parser(message: &str) -> String {
    let mut names = quoted(message);
    if message.starts_with("unknown field") || message.starts_with("unknown variant") {
        let Some(name) = names.next() else { return GENERAL.to_owned() };
        return of_names("known here", name, names);
    }
    if message.starts_with("missing field") {
        let name = names.next().unwrap_or_default();
        return format!("add a line `{name} = …` to this table");
    }
    if message.starts_with("duplicate key") {
        return "keep one of the two".to_owned();
    }
    if let Some((_, expected)) = message.rsplit_once("expected ") {
        return format!("write {expected} here");
    }
    GENERAL.to_owned()
}

const GENERAL: &str = "see docs/gateway/config.md for what may stand here";

fn quoted(message: &str) -> impl Iterator<Item = &str> {
    message.split('`').skip(1).step_by(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slips_are_seen() {
        let message = "unknown field `plugn`, expected one of `name`, `plugin`, `port`";
        assert_eq!(of_parser(message), "did you mean \"plugin\"?");
        let message = "unknown field `x`, expected `name` or `port`";
        assert_eq!(of_parser(message), "known here: name, port");
        assert_eq!(of_parser("missing field `name`"), "add a line `name = …` to this table");
        assert_eq!(of_parser("invalid type: string \"a\", expected u16"), "write u16 here");
        assert_eq!(of_parser("what"), GENERAL);
    }
}
