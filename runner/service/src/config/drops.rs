//! The table `drop` of a link, read and checked.

use std::collections::HashMap;
use std::path::{Component, Path, PathBuf};
use std::time::Duration;

use toml::Spanned;

use super::finding::ConfigFindings;
use super::link::DropConfig;
use super::service::{GatewayConfig, bytes, span};
use super::written;

/// In milliseconds: as long as a copy over a network may stand still, as a rule.
const SETTLE: u64 = 5_000;
/// In milliseconds.
const LOOK: u64 = 2_000;
/// A share is not to be asked all the time, nor once a day.
const LOOKS: std::ops::RangeInclusive<Duration> =
    Duration::from_millis(100)..=Duration::from_hours(1);
const LONGEST_SETTLE: Duration = Duration::from_hours(24);
/// In bytes; as of an upload.
const LARGEST: u64 = 64 << 20;
/// In bytes: programs of this size are none.
const MOST: u64 = 1 << 40;

/// Folders that are something else already, and what.
pub(super) fn taken(gateway: &GatewayConfig) -> HashMap<PathBuf, String> {
    let own = [
        (&gateway.state, "the gateway's state"),
        (&gateway.library, "the library"),
        (&gateway.receptions, "that of the receptions"),
        (&gateway.traces, "that of the traces"),
    ];
    let programs = gateway.programs.iter().map(|folder| (folder, "a folder of programs"));
    let all = own.into_iter().chain(programs);
    all.map(|(folder, what)| (plain(folder), what.to_owned())).collect()
}

/// The drop folder of one link; `taken`: folders that are something else, and what.
pub(super) fn one(
    written: &Spanned<written::Drop>,
    link: &str,
    base: &Path,
    taken: &mut HashMap<PathBuf, String>,
    problems: &mut ConfigFindings<'_>,
) -> Option<DropConfig> {
    let (at, written) = (written.span(), written.get_ref());
    let settle = span(written.settle.as_ref(), SETTLE, problems);
    if let Some(text) = written.settle.as_ref().filter(|_| settle > LONGEST_SETTLE) {
        problems.add(text.span(), "a file would settle for more than a day", "give at most 24h");
    }
    let poll = span(written.look.as_ref(), LOOK, problems);
    if let Some(text) = written.look.as_ref().filter(|_| !LOOKS.contains(&poll)) {
        problems.add(text.span(), "a folder is not looked into so often", "give 100ms to 1h");
    }
    let largest = written.largest.as_ref();
    let largest = largest.map_or(Some(LARGEST), |value| bytes(value, 1, MOST, problems));
    let Some(text) = &written.folder else {
        let hint = "add folder = \"drop/lathe-1\"";
        problems.add(at, "the drop folder is not named", hint);
        return None;
    };
    if text.get_ref().trim().is_empty() || text.get_ref().contains('\0') {
        problems.add(text.span(), "this cannot name a folder", "name one: \"drop/lathe-1\"");
        return None;
    }
    let folder = plain(&base.join(text.get_ref()));
    let near =
        |(other, _): &(&PathBuf, &String)| folder.starts_with(other) || other.starts_with(&folder);
    if let Some((other, whose)) = taken.iter().find(near) {
        let message = format!("the folder {} is {whose} already", other.display());
        let hint = "give each drop folder a place of its own, within no other and around none";
        problems.add(text.span(), message, hint);
    }
    taken.insert(folder.clone(), format!("the drop folder of \"{link}\""));
    Some(DropConfig { folder, settle, poll, largest: largest? })
}

/// Without `.` and, where that can be known, `..`.
fn plain(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir
                if matches!(plain.components().next_back(), Some(Component::Normal(_))) =>
            {
                plain.pop();
            }
            part => plain.push(part),
        }
    }
    plain
}
