//! The tables `[[cell]]`, read and checked.

use std::collections::HashSet;

use softplug_cell::{AfterCrash, ChannelId, Notation, Setup, SetupError};
use toml::Spanned;

use super::finding::ConfigFindings;
use super::link::{LinkConfig, is_name};
use super::of_names;
use super::service::choice;
use super::written::{self, Text};

/// Most cells of one gateway.
const MOST: usize = 256;

/// Links that work together.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct CellConfig {
    /// Its name.
    pub name: String,
    /// Its channels, which are links of the same name, with axes and groups.
    pub setup: Setup,
    /// How each channel's programs are written, in the order of the channels.
    pub notations: Vec<Notation>,
    /// What becomes of it when the gateway was ended in the middle of its work.
    pub after_crash: AfterCrash,
}

impl CellConfig {
    /// How a channel's programs are written.
    pub fn notation(&self, channel: ChannelId) -> Notation {
        self.notations.get(usize::from(channel.0)).copied().unwrap_or_default()
    }
}

/// All cells. One with something wrong is left out: the problem is told.
pub(super) fn all(
    written: &[Spanned<written::Cell>],
    links: &[LinkConfig],
    problems: &mut ConfigFindings<'_>,
) -> Vec<CellConfig> {
    if let Some(cell) = written.get(MOST) {
        let message = format!("there are more than {MOST} cells");
        problems.add(cell.span(), message, "run a second gateway for the rest");
    }
    let mut cells: Vec<CellConfig> = Vec::new();
    let mut taken: HashSet<&str> = HashSet::new();
    for cell in written.iter().take(MOST) {
        let at = cell.span().start..cell.span().start;
        let Some(name) = &cell.get_ref().name else {
            problems.add(at, "this cell has no name", "add a line such as `name = \"shafts\"`");
            continue;
        };
        let text = name.get_ref();
        if !is_name(text) {
            let message = format!("\"{}\" cannot name a cell", text.escape_debug());
            let hint = "use 1 to 64 letters, digits, dots, spaces, hyphens and underscores";
            problems.add(name.span(), message, hint);
        } else if cells.iter().any(|cell| cell.name == *text) {
            let message = format!("there are two cells \"{text}\"");
            problems.add(name.span(), message, "give each a name of its own");
        }
        for channel in cell.get_ref().channels.iter().flat_map(toml::Spanned::get_ref) {
            let text: &str = channel.get_ref();
            let name = text.escape_debug();
            if !links.iter().any(|link| link.name == text) {
                let known = links.iter().map(|link| link.name.as_str());
                let message = format!("there is no link \"{name}\"");
                problems.add(channel.span(), message, of_names("the links", text, known));
            } else if links.iter().any(|link| link.name == text && link.endpoint.is_some()) {
                let message = format!("the link \"{name}\" has an endpoint and is a channel");
                let hint = "take the endpoint away: what its client sends waits for nobody";
                problems.add(channel.span(), message, hint);
            } else if !taken.insert(text) {
                let message = format!("the link \"{name}\" is a channel already");
                problems.add(channel.span(), message, "name it once: a link is in one cell");
            }
        }
        cells.extend(one(text, cell, problems));
    }
    cells
}

fn one(
    name: &str,
    cell: &Spanned<written::Cell>,
    problems: &mut ConfigFindings<'_>,
) -> Option<CellConfig> {
    let at = cell.span().start..cell.span().start;
    let written::Cell { channels, axes, groups, words, notations, after_crash, .. } =
        cell.get_ref();
    let Some(channels) = channels else {
        let message = format!("the cell \"{}\" has no channels", name.escape_debug());
        problems.add(at, message, "add a line such as `channels = [\"lathe-1\", \"lathe-2\"]`");
        return None;
    };
    let names: Vec<&str> = channels.get_ref().iter().map(|name| name.get_ref().as_str()).collect();
    let axes: Vec<&str> = axes.iter().map(|name| name.get_ref().as_str()).collect();
    let groups: Vec<(&str, Vec<&str>)> = groups
        .iter()
        .map(|(name, members)| {
            let members = members.iter().map(|name| name.get_ref().as_str()).collect();
            (name.get_ref().as_str(), members)
        })
        .collect();
    let groups: Vec<(&str, &[&str])> =
        groups.iter().map(|(name, members)| (*name, &members[..])).collect();
    let setup = match Setup::new(&names, &axes, &groups) {
        Ok(setup) => setup,
        Err(error) => {
            let hint = match error {
                SetupError::Name(_) => "programs name channels and axes",
                _ => "channels, axes and groups are told apart by their names",
            };
            problems.add(channels.span(), error.to_string(), hint);
            return None;
        }
    };
    let common = words.as_ref().map_or(Notation::Comment, |words| notation(words, problems));
    let mut all = vec![common; names.len()];
    for (channel, words) in notations {
        let read = notation(words, problems);
        let Some(known) = setup.channel(channel.get_ref()) else {
            let text = channel.get_ref();
            let message = format!("the cell has no channel \"{}\"", text.escape_debug());
            let hint = of_names("it has", text, names.iter().copied());
            problems.add(channel.span(), message, hint);
            continue;
        };
        all[usize::from(known.0)] = read;
    }
    let choices = [("stop", AfterCrash::Stop), ("resume", AfterCrash::Resume)];
    let after_crash = choice(after_crash.as_ref(), &choices, problems);
    Some(CellConfig { name: name.to_owned(), setup, notations: all, after_crash })
}

fn notation(text: &Text, problems: &mut ConfigFindings<'_>) -> Notation {
    text.get_ref().parse().unwrap_or_else(|error: softplug_cell::NoNotation| {
        let message = format!("\"{}\" is no notation", text.get_ref().escape_debug());
        let hint = error.to_string();
        let hint = hint.split_once("; ").map_or(&*hint, |(_, hint)| hint);
        let hint = hint.split_once(": ").map_or(hint, |(_, hint)| hint);
        problems.add(text.span(), message, hint);
        Notation::Comment
    })
}
