//! Which of the library's versions a link takes by itself.

use std::collections::BTreeSet;

/// What a link does about a version that has come into the library.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Taking {
    /// It is to be taken.
    Take,
    /// It runs already, or is about to.
    Known,
    /// It has failed here before. Only a person can ask for it again.
    Rejected,
}

/// What a link that follows the library has tried. `K` names a plug-in by its
/// content.
#[derive(Clone, Debug)]
pub struct Follow<K> {
    running: K,
    /// Ordered, and nothing heard of it yet.
    ordered: Option<K>,
    rejected: BTreeSet<K>,
}

impl<K: Ord + Clone> Follow<K> {
    /// For a link with this plug-in.
    pub fn new(running: K) -> Self {
        Self { running, ordered: None, rejected: BTreeSet::new() }
    }

    /// The plug-in that runs.
    pub fn running(&self) -> &K {
        &self.running
    }

    /// Whether to take this one, the newest that fits the link's wish.
    pub fn asks(&self, newest: &K) -> Taking {
        if *newest == self.running || self.ordered.as_ref() == Some(newest) {
            Taking::Known
        } else if self.rejected.contains(newest) {
            Taking::Rejected
        } else {
            Taking::Take
        }
    }

    /// A swap to this one was ordered, by the link's policy or by a person.
    pub fn ordered(&mut self, plugin: K) {
        self.rejected.remove(&plugin);
        self.ordered = Some(plugin);
    }

    /// It runs, be it on probation.
    pub fn runs(&mut self, plugin: K) {
        self.ordered = None;
        self.running = plugin;
    }

    /// It was refused, or taken back; `running` runs.
    pub fn rejected(&mut self, plugin: K, running: K) {
        self.ordered = None;
        self.running = running;
        self.rejected.insert(plugin);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_failed_is_not_taken_again_by_itself() {
        let mut follow = Follow::new("one");
        assert_eq!(follow.asks(&"one"), Taking::Known);
        assert_eq!(follow.asks(&"two"), Taking::Take);
        follow.ordered("two");
        assert_eq!(follow.asks(&"two"), Taking::Known);
        follow.runs("two");
        assert_eq!((follow.running(), follow.asks(&"two")), (&"two", Taking::Known));
        follow.rejected("two", "one");
        assert_eq!(follow.asks(&"two"), Taking::Rejected);
        assert_eq!(follow.asks(&"three"), Taking::Take);
        // A person insists, and it works.
        follow.ordered("two");
        follow.runs("two");
        assert_eq!((follow.asks(&"two"), follow.asks(&"one")), (Taking::Known, Taking::Take));
    }
}
