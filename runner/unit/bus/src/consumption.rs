//! What one machine takes.

/// Seconds over which a rate is taken: a control takes its data in gulps.
const SPAN: f64 = 30.0;

/// How many data bits per second a machine takes, measured over spans of 30 s. The span in which a
/// job begins does not count: there the control's own buffer is filled.
///
/// ```
/// use softplug_unit_bus::Consumption;
///
/// let mut consumption = Consumption::default();
/// for second in 0..=90 {
///     consumption.taken(f64::from(second), 8.0 * 250.0 * f64::from(second));
/// }
/// assert_eq!(consumption.most(), Some(2_000.0));
/// ```
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Consumption {
    /// When the span began, and what had been taken by then.
    from: Option<(f64, f64)>,
    has_begun: bool,
    latest: Option<f64>,
    most: Option<f64>,
}

impl Consumption {
    /// So many bits of the job under way have been taken in all. Fewer than before: it is another.
    pub fn taken(&mut self, now: f64, bits: f64) {
        let Some((from, before)) = self.from.filter(|(_, before)| bits >= *before) else {
            (self.from, self.has_begun) = (Some((now, bits)), false);
            return;
        };
        if now - from < SPAN {
            return;
        }
        if self.has_begun {
            let rate = (bits - before) / (now - from);
            self.latest = Some(rate);
            self.most = Some(self.most.map_or(rate, |most| most.max(rate)));
        }
        (self.from, self.has_begun) = (Some((now, bits)), true);
    }

    /// The job has ended.
    pub const fn ended(&mut self) {
        (self.from, self.has_begun) = (None, false);
    }

    /// In the latest span.
    pub const fn latest(&self) -> Option<f64> {
        self.latest
    }

    /// In the span in which it was most.
    pub const fn most(&self) -> Option<f64> {
        self.most
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_span_of_a_job_does_not_count_and_the_most_is_kept() {
        let mut consumption = Consumption::default();
        let mut taken = |at: f64, bits: f64| {
            consumption.taken(at, bits);
            (consumption.latest(), consumption.most())
        };
        assert_eq!(taken(0.0, 0.0), (None, None));
        assert_eq!(taken(30.0, 9_000.0), (None, None));
        assert_eq!(taken(60.0, 12_000.0), (Some(100.0), Some(100.0)));
        assert_eq!(taken(89.0, 60_000.0), (Some(100.0), Some(100.0)));
        assert_eq!(taken(90.0, 18_000.0), (Some(200.0), Some(200.0)));
        assert_eq!(taken(120.0, 19_500.0), (Some(50.0), Some(200.0)));
        // Another job.
        assert_eq!(taken(121.0, 0.0), (Some(50.0), Some(200.0)));
        assert_eq!(taken(151.0, 90_000.0), (Some(50.0), Some(200.0)));
        assert_eq!(taken(181.0, 99_000.0), (Some(300.0), Some(300.0)));
    }
}
