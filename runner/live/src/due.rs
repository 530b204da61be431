//! When somebody is to be called, and how much later does no harm.

use softplug_abi::Micros;

/// A call that is wanted at a time and does no harm a little later, so that
/// calls for many can be made together.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Due {
    /// Not before this.
    pub at: Micros,
    /// From here on lateness costs something.
    pub by: Micros,
}

impl Due {
    /// At this time, not later.
    pub fn exactly(at: Micros) -> Self {
        Self { at, by: at }
    }

    /// The one that matters first.
    pub fn first(dues: impl IntoIterator<Item = Option<Self>>) -> Option<Self> {
        dues.into_iter().flatten().min_by_key(|due| due.by)
    }

    /// This time on a clock that read `began` when this one's clock began.
    pub(crate) fn on_clock_since(self, began: Micros) -> Self {
        Self { at: self.at + began, by: self.by + began }
    }

    /// A time within the bounds that others choose as well: the one that is a
    /// multiple of the largest power of two.
    pub(crate) fn gathered(self) -> Micros {
        let (at, by) = (self.at.0, self.by.0);
        if by <= at {
            return self.at;
        }
        // The highest bit in which they differ is set in `by`: all below it go.
        let below = (1 << (at ^ by).ilog2()) - 1;
        Micros(by & !below)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn calls_that_may_be_late_are_made_together() {
        let gathered = |at, by| Due { at: Micros(at), by: Micros(by) }.gathered().0;
        assert_eq!(gathered(1_000_100, 1_000_900), 1_000_448);
        assert_eq!(gathered(1_000_400, 1_000_700), 1_000_448);
        assert_eq!(gathered(1_000_448, 1_000_449), 1_000_449);
        assert_eq!(gathered(7, 7), 7);
        let first =
            [None, Some(Due::exactly(Micros(5))), Some(Due { at: Micros(1), by: Micros(9) })];
        assert_eq!(Due::first(first), Some(Due::exactly(Micros(5))));
    }

    proptest! {
        #[test]
        fn a_gathered_call_is_never_early_and_never_too_late(at in 0_i64..1 << 50, slack in 0_i64..5_000) {
            let due = Due { at: Micros(at), by: Micros(at + slack) };
            prop_assert!((due.at..=due.by).contains(&due.gathered()));
        }
    }
}
