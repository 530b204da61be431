//! What a cell consists of: channels, groups of channels, axes of which there is one.

use std::fmt;

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Most channels, axes or groups of a cell.
pub const MOST: usize = 64;

/// A channel: what runs one program at a time. Counted from 0, in the order of the setup.
#[derive(
    Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default, Serialize, Deserialize,
)]
pub struct ChannelId(pub u8);

/// An axis, or anything else of which there is one. Counted from 0, in the order of the setup.
#[derive(Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
pub struct AxisId(pub u8);

/// A mode group. Counted from 0, in the order of the setup.
#[derive(Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
pub struct GroupId(pub u8);

/// Some channels of a cell.
///
/// ```
/// use softplug_cell::{ChannelId, ChannelSet};
///
/// let set: ChannelSet = [ChannelId(3), ChannelId(1)].into_iter().collect();
/// assert!(set.has(ChannelId(1)) && !set.has(ChannelId(2)));
/// assert_eq!(set.iter().collect::<Vec<_>>(), [ChannelId(1), ChannelId(3)]);
/// ```
#[derive(
    Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default, Serialize, Deserialize,
)]
pub struct ChannelSet(u64);

/// Channels, axes and groups, by name.
///
/// ```
/// use softplug_cell::Setup;
///
/// let setup = Setup::new(
///     &["LATHE-1", "LATHE-2", "LOADER"],
///     &["GANTRY"],
///     &[("LATHES", &["LATHE-1", "LATHE-2"])],
/// )?;
/// let lathe = setup.channel("lathe-2").expect("there is one");
/// assert_eq!(setup.channel_name(lathe), "LATHE-2");
/// // A channel without a group has one of its own.
/// assert_eq!(setup.groups().count(), 2);
/// # Ok::<(), softplug_cell::SetupError>(())
/// ```
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub struct Setup {
    channels: Vec<String>,
    axes: Vec<String>,
    groups: Vec<(String, ChannelSet)>,
}

/// Why a cell cannot be set up so.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub enum SetupError {
    /// Nothing to coordinate.
    #[error("a cell has at least two channels")]
    TooFew,
    /// More than [`MOST`] of something.
    #[error("a cell has at most {MOST} {0}")]
    TooMany(&'static str),
    /// It cannot stand in a program.
    #[error(
        "\"{0}\" names no channel or axis: use 1 to 32 letters, digits, hyphens and underscores, a letter among them"
    )]
    Name(String),
    /// Channels and axes share one set of names; upper and lower case are one.
    #[error("two of the cell's channels and axes are called \"{0}\"")]
    Twice(String),
    /// Two groups have one name, or a group that of a channel which is in none.
    #[error("two of the cell's groups are called \"{0}\"")]
    GroupTwice(String),
    /// A group names what is no channel.
    #[error("the group \"{group}\" names \"{name}\", which is no channel of the cell")]
    NoChannel {
        /// The group.
        group: String,
        /// What it names.
        name: String,
    },
    /// A channel has one mode.
    #[error("the channel \"{0}\" is in two groups")]
    InTwoGroups(String),
}

impl Setup {
    /// A cell of these channels and axes; `groups`: which channels are always in one mode.
    ///
    /// # Errors
    /// Too few or too many, or names that are not distinct or not known.
    pub fn new(
        channels: &[&str],
        axes: &[&str],
        groups: &[(&str, &[&str])],
    ) -> Result<Self, SetupError> {
        if channels.len() < 2 {
            return Err(SetupError::TooFew);
        }
        for (what, count) in [("channels", channels.len()), ("axes", axes.len())] {
            if count > MOST {
                return Err(SetupError::TooMany(what));
            }
        }
        let mut names: Vec<&str> = Vec::new();
        for name in channels.iter().chain(axes) {
            if !is_name(name) {
                return Err(SetupError::Name((*name).to_owned()));
            }
            if names.iter().any(|other| other.eq_ignore_ascii_case(name)) {
                return Err(SetupError::Twice((*name).to_owned()));
            }
            names.push(name);
        }
        let owned = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        let mut setup = Self { channels: owned(channels), axes: owned(axes), groups: Vec::new() };
        setup.group(groups)?;
        Ok(setup)
    }

    fn group(&mut self, groups: &[(&str, &[&str])]) -> Result<(), SetupError> {
        let mut grouped = ChannelSet::default();
        for (group, members) in groups {
            let mut set = ChannelSet::default();
            for name in *members {
                let Some(channel) = self.channel(name) else {
                    let (group, name) = ((*group).to_owned(), (*name).to_owned());
                    return Err(SetupError::NoChannel { group, name });
                };
                if grouped.has(channel) {
                    return Err(SetupError::InTwoGroups((*name).to_owned()));
                }
                set.insert(channel);
                grouped.insert(channel);
            }
            self.add_group(group, set)?;
        }
        for channel in self.channels().filter(|channel| !grouped.has(*channel)) {
            let name = self.channel_name(channel).to_owned();
            self.add_group(&name, [channel].into_iter().collect())?;
        }
        Ok(())
    }

    fn add_group(&mut self, name: &str, set: ChannelSet) -> Result<(), SetupError> {
        if self.groups.len() == MOST {
            return Err(SetupError::TooMany("groups"));
        }
        if self.groups.iter().any(|(other, _)| other.eq_ignore_ascii_case(name)) {
            return Err(SetupError::GroupTwice(name.to_owned()));
        }
        self.groups.push((name.to_owned(), set));
        Ok(())
    }

    /// All channels.
    pub fn channels(&self) -> impl Iterator<Item = ChannelId> + use<> {
        (0..self.channels.len()).map(|at| ChannelId(at as u8))
    }

    /// All axes.
    pub fn axes(&self) -> impl Iterator<Item = AxisId> + use<> {
        (0..self.axes.len()).map(|at| AxisId(at as u8))
    }

    /// All groups, each with its channels.
    pub fn groups(&self) -> impl Iterator<Item = (GroupId, &str, ChannelSet)> {
        self.groups.iter().enumerate().map(|(at, (name, set))| (GroupId(at as u8), &**name, *set))
    }

    /// The channel of this name, in upper or lower case.
    pub fn channel(&self, name: &str) -> Option<ChannelId> {
        place(&self.channels, name).map(ChannelId)
    }

    /// The axis of this name, in upper or lower case.
    pub fn axis(&self, name: &str) -> Option<AxisId> {
        place(&self.axes, name).map(AxisId)
    }

    /// The group of this name, in upper or lower case.
    pub fn group_named(&self, name: &str) -> Option<GroupId> {
        self.groups().find(|(_, other, _)| other.eq_ignore_ascii_case(name)).map(|(id, ..)| id)
    }

    /// The group that a channel is in.
    pub fn group_of(&self, channel: ChannelId) -> GroupId {
        let found = self.groups().find(|(.., set)| set.has(channel));
        found.map_or(GroupId(0), |(id, ..)| id)
    }

    /// A channel's name; "?" for one that is not there.
    pub fn channel_name(&self, channel: ChannelId) -> &str {
        self.channels.get(usize::from(channel.0)).map_or("?", |name| name)
    }

    /// An axis' name; "?" for one that is not there.
    pub fn axis_name(&self, axis: AxisId) -> &str {
        self.axes.get(usize::from(axis.0)).map_or("?", |name| name)
    }

    /// A group's name; "?" for one that is not there.
    pub fn group_name(&self, group: GroupId) -> &str {
        self.groups.get(usize::from(group.0)).map_or("?", |(name, _)| name)
    }

    /// The names of some channels: `LATHE-1, LATHE-2 and LOADER`.
    pub fn names(&self, channels: ChannelSet) -> String {
        listed(&channels.iter().map(|channel| self.channel_name(channel)).collect::<Vec<_>>())
    }
}

impl ChannelSet {
    /// Whether it is one of them.
    pub fn has(self, channel: ChannelId) -> bool {
        self.0 & bit(channel) != 0
    }

    /// Adds one.
    pub fn insert(&mut self, channel: ChannelId) {
        self.0 |= bit(channel);
    }

    /// All but this one.
    #[must_use]
    pub fn without(self, channel: ChannelId) -> Self {
        Self(self.0 & !bit(channel))
    }

    /// How many there are.
    pub fn len(self) -> usize {
        self.0.count_ones() as usize
    }

    /// Whether there is none.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Each, in the order of the setup.
    pub fn iter(self) -> impl Iterator<Item = ChannelId> {
        (0..MOST as u8).map(ChannelId).filter(move |channel| self.has(*channel))
    }
}

impl FromIterator<ChannelId> for ChannelSet {
    fn from_iter<T: IntoIterator<Item = ChannelId>>(channels: T) -> Self {
        let mut set = Self::default();
        for channel in channels {
            set.insert(channel);
        }
        set
    }
}

impl fmt::Display for ChannelId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "channel {}", self.0 + 1)
    }
}

fn bit(channel: ChannelId) -> u64 {
    1_u64.checked_shl(u32::from(channel.0)).unwrap_or(0)
}

fn place(names: &[String], name: &str) -> Option<u8> {
    names.iter().position(|other| other.eq_ignore_ascii_case(name)).map(|at| at as u8)
}

fn is_name(name: &str) -> bool {
    (1..=32).contains(&name.len())
        && name.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-_".contains(&byte))
        // A number is a channel's place.
        && name.bytes().any(|byte| byte.is_ascii_alphabetic())
}

/// `a`, `a and b`, `a, b and c`.
pub(crate) fn listed(names: &[&str]) -> String {
    match names {
        [] => "nobody".to_owned(),
        [one] => (*one).to_owned(),
        [most @ .., last] => format!("{} and {last}", most.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_a_cell_is_refused() {
        let refused = |channels: &[&str], axes: &[&str], groups: &[(&str, &[&str])]| {
            Setup::new(channels, axes, groups).unwrap_err().to_string()
        };
        assert_eq!(refused(&["A"], &[], &[]), "a cell has at least two channels");
        assert_eq!(
            refused(&["A", "B"], &["a"], &[]),
            "two of the cell's channels and axes are called \"a\""
        );
        for name in ["B 2", "2", "", "-_"] {
            let said = refused(&["A", name], &[], &[]);
            assert!(said.contains(&format!("\"{name}\" names no channel or axis")), "{said}");
        }
        assert_eq!(
            refused(&["A", "B"], &[], &[("G", &["A"]), ("H", &["A"])]),
            "the channel \"A\" is in two groups"
        );
        assert_eq!(
            refused(&["A", "B"], &[], &[("B", &["A"])]),
            "two of the cell's groups are called \"B\""
        );
        assert_eq!(
            refused(&["A", "B"], &[], &[("G", &["C"])]),
            "the group \"G\" names \"C\", which is no channel of the cell"
        );
        let many: Vec<String> = (0..65).map(|at| format!("C{at}")).collect();
        let many: Vec<&str> = many.iter().map(String::as_str).collect();
        assert_eq!(refused(&many, &[], &[]), "a cell has at most 64 channels");
        assert!(Setup::new(&many[..64], &many[64..], &[]).is_ok());
    }
}
