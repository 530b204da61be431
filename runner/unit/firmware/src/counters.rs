//! What is counted of a link since the start.

use softplug_abi::Micros;
use softplug_unit_protocol::ToServer;

/// Sums, and since when what is being counted lasts.
#[derive(Copy, Clone, PartialEq, Eq, Default)]
pub(crate) struct Counters {
    pub(crate) bytes_in: u64,
    pub(crate) bytes_out: u64,
    pub(crate) line_errors: u64,
    pub(crate) holds: Spells,
    pub(crate) starved: Spells,
}

/// Stretches of time in which something is so.
#[derive(Copy, Clone, PartialEq, Eq, Default)]
pub(crate) struct Spells {
    count: u64,
    micros: u64,
    since: Option<Micros>,
}

impl Spells {
    pub(crate) fn set(&mut self, now: Micros, is_so: bool) {
        if let Some(since) = self.since {
            self.micros += (now - since).0.max(0) as u64;
        } else if is_so {
            self.count += 1;
        }
        self.since = is_so.then_some(now);
    }

    pub(crate) fn is_so(&self) -> bool {
        self.since.is_some()
    }
}

impl Counters {
    pub(crate) fn message(&self, link: u8) -> ToServer<'static> {
        let Self { bytes_in, bytes_out, line_errors, holds, starved } = *self;
        ToServer::Counters {
            link,
            bytes_in,
            bytes_out,
            holds: holds.count,
            held: holds.micros,
            starved: starved.count,
            starved_for: starved.micros,
            line_errors,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spells_are_counted_once_and_summed() {
        let mut spells = Spells::default();
        for (now, is_so) in [(0, false), (10, true), (15, true), (25, false), (40, true)] {
            spells.set(Micros(now), is_so);
        }
        assert_eq!((spells.count, spells.micros, spells.is_so()), (2, 15, true));
    }
}
