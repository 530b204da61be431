//! What came of a bus in about the last minute.

/// Seconds of which figures are kept together; shown are this span and the one before.
const SPAN: f64 = 30.0;
/// Seconds before which a load says nothing.
const SHORTEST: f64 = 1.0;

/// What was measured on a bus in about the last minute; `None`: there was nothing to measure.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct BusFigures {
    /// Data bits that were sent, as a part of those that the bus is planned to carry.
    pub load: Option<f64>,
    /// Data bits of all bits.
    pub efficiency: Option<f64>,
    /// Mean seconds from the last bit of a turn to the first one of the next, where another unit
    /// waited.
    pub switch: Option<f64>,
}

#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Measured {
    this: Span,
    last: Option<Span>,
}

#[derive(Clone, Copy, PartialEq, Debug)]
struct Span {
    from: f64,
    data: f64,
    all: f64,
    switches: f64,
    switching: f64,
}

impl Span {
    const fn new(from: f64) -> Self {
        Self { from, data: 0.0, all: 0.0, switches: 0.0, switching: 0.0 }
    }
}

impl Measured {
    pub(crate) const fn new(now: f64) -> Self {
        Self { this: Span::new(now), last: None }
    }

    pub(crate) fn go_to(&mut self, now: f64) {
        if now - self.this.from >= SPAN {
            self.last = Some(core::mem::replace(&mut self.this, Span::new(now)));
        }
    }

    pub(crate) const fn sent(&mut self, bits: f64) {
        self.this.data += bits;
    }

    pub(crate) const fn carried(&mut self, bits: f64) {
        self.this.all += bits;
    }

    pub(crate) const fn switched(&mut self, seconds: f64) {
        self.this.switches += 1.0;
        self.this.switching += seconds;
    }

    pub(crate) fn figures(&self, now: f64, payload: f64) -> BusFigures {
        let sum = |of: fn(&Span) -> f64| of(&self.this) + self.last.as_ref().map_or(0.0, of);
        let seconds = now - self.last.map_or(self.this.from, |last| last.from);
        let data = sum(|span| span.data);
        let part = |part: f64, of: f64| (part > 0.0 && of > 0.0).then(|| part / of);
        BusFigures {
            load: (seconds >= SHORTEST).then(|| data / (payload * seconds)),
            // Data that is still on its way has not been counted as carried.
            efficiency: part(data, sum(|span| span.all)).map(|part| part.min(1.0)),
            switch: part(sum(|span| span.switching), sum(|span| span.switches)),
        }
    }
}
