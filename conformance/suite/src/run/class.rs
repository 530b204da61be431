//! How a run can fail, by class: wrong behaviour, and faults.

use super::fault::FaultClass;
use serde::Serialize;

/// Kinds of failure.
///
/// ```
/// use softplug_conformance::{Class, FaultClass};
///
/// assert_eq!(Class::from_name("depends-on-cuts"), Some(Class::DependsOnCuts));
/// assert_eq!(Class::from_name("trapped"), Some(Class::Fault(FaultClass::Trapped)));
/// assert!(Class::Diverged.is_wrong_behaviour());
/// assert!(!Class::Fault(FaultClass::Trapped).is_wrong_behaviour());
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Class {
    /// The plug-in did not do what the trace demands.
    Diverged,
    /// It did as the trace is written, but not with its bytes cut differently.
    DependsOnCuts,
    /// It did in one instance, but not when swapped in the middle.
    DependsOnSwap,
    /// It did once, but not behind something else, or itself.
    DependsOnPast,
    /// It did, but not at a later time of the link's clock.
    DependsOnClock,
    /// It did, but not with other rooms of the host.
    DependsOnRooms,
    /// The run ended before its time.
    #[serde(untagged)]
    Fault(FaultClass),
}

impl Class {
    /// Kinds of wrong behaviour: all but faults.
    pub const WRONG: [Self; 6] = [
        Self::Diverged,
        Self::DependsOnCuts,
        Self::DependsOnSwap,
        Self::DependsOnPast,
        Self::DependsOnClock,
        Self::DependsOnRooms,
    ];

    /// All of them.
    pub fn all() -> impl Iterator<Item = Self> {
        Self::WRONG.into_iter().chain(FaultClass::ALL.map(Self::Fault))
    }

    /// The name in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Diverged => "diverged",
            Self::DependsOnCuts => "depends-on-cuts",
            Self::DependsOnSwap => "depends-on-swap",
            Self::DependsOnPast => "depends-on-past",
            Self::DependsOnClock => "depends-on-clock",
            Self::DependsOnRooms => "depends-on-rooms",
            Self::Fault(class) => class.name(),
        }
    }

    /// The other way round.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::all().find(|class| class.name() == name)
    }

    /// Whether the plug-in did the wrong thing, as opposed to nothing more: a trap says nothing
    /// about a clause.
    pub fn is_wrong_behaviour(self) -> bool {
        !matches!(self, Self::Fault(_))
    }

    /// In words, as the end of "the plug-in …".
    pub const fn text(self) -> &'static str {
        match self {
            Self::Diverged => "does not do what the trace demands",
            Self::DependsOnCuts => "does something else when the same bytes are cut differently",
            Self::DependsOnSwap => "does something else when it is saved and restored",
            Self::DependsOnPast => "does something else behind what was before on the link",
            Self::DependsOnClock => "does something else at a later time of its clock",
            Self::DependsOnRooms => "does something else where the host has other rooms",
            Self::Fault(class) => class.text(),
        }
    }
}
