//! How much of something may be told in a second.

use softplug_abi::Micros;

/// So many in a second, and so many at once.
#[derive(Debug)]
pub(crate) struct Allowance {
    a_second: i64,
    /// Up to when all is used up; earlier than a second before now is as good as
    /// that.
    used_to: Micros,
}

impl Allowance {
    pub(crate) fn new(a_second: i64) -> Self {
        Self { a_second, used_to: Micros(-1_000_000) }
    }

    pub(crate) fn take(&mut self, now: Micros) -> bool {
        if self.next() > now {
            return false;
        }
        let from = self.used_to.max(now - Micros(1_000_000));
        self.used_to = from + Micros(1_000_000 / self.a_second);
        true
    }

    /// When one may be taken.
    pub(crate) fn next(&self) -> Micros {
        self.used_to + Micros(1_000_000 / self.a_second)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_allowance_is_a_burst_and_then_a_rate() {
        let mut words = Allowance::new(20);
        let taken =
            |words: &mut Allowance, now: i64| (0..100).filter(|_| words.take(Micros(now))).count();
        assert_eq!(taken(&mut words, 0), 20);
        assert_eq!(taken(&mut words, 49_999), 0);
        assert_eq!(words.next(), Micros(50_000));
        assert_eq!(taken(&mut words, 150_000), 3);
        assert_eq!(taken(&mut words, 100_000_000), 20);
    }
}
