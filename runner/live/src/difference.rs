//! Settings that a port did not take, and which of them stand in the way.

use std::fmt;

use softplug_abi::{LineParameters, Parity};

/// How far a rate may be from the one that was asked for, in thousandths. Dividers
/// of UARTs are whole numbers, so that few rates are met exactly; two ends that
/// are both as far off in opposite directions still read the last bit of a
/// character in its time.
const RATE_TOLERANCE: u64 = 20;

/// A setting that a port did not take.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct SettingDifference {
    /// The setting's name.
    pub setting: &'static str,
    /// What was asked for.
    pub asked: String,
    /// What the port says it has.
    pub has: String,
    /// How much it matters.
    pub weight: DifferenceWeight,
}

/// How much a difference matters.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum DifferenceWeight {
    /// A rate that is met within what UARTs bear, a setting that the other side
    /// does not tell, or one that a pty does not have: worth knowing.
    Note,
    /// Bytes would be read or sent wrongly: the port is not opened.
    Refused,
}

impl SettingDifference {
    /// Whether the port must not be used so.
    pub fn is_refused(&self) -> bool {
        self.weight == DifferenceWeight::Refused
    }
}

impl fmt::Display for SettingDifference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: asked for {}, the port has {}", self.setting, self.asked, self.has)
    }
}

/// Weight of a rate that is not the one that was asked for.
pub(crate) fn weight_of_rate(asked: u32, has: u32) -> DifferenceWeight {
    let apart = u64::from(asked.abs_diff(has));
    if apart * 1_000 <= u64::from(asked) * RATE_TOLERANCE {
        DifferenceWeight::Note
    } else {
        DifferenceWeight::Refused
    }
}

/// What a line has otherwise than it was asked for.
pub(crate) fn line_differences(
    asked: LineParameters,
    has: LineParameters,
) -> Vec<SettingDifference> {
    let pairs = setting_texts(asked).into_iter().zip(setting_texts(has));
    let differing = pairs.filter(|((_, asked), (_, has))| asked != has);
    differing
        .filter_map(|((setting, asked_text), (_, has_text))| {
            let weight = match setting {
                // Without a rate, it is left to the other side.
                BAUD_RATE if asked.baud == 0 => return None,
                BAUD_RATE => weight_of_rate(asked.baud, has.baud),
                _ => DifferenceWeight::Refused,
            };
            Some(SettingDifference { setting, asked: asked_text, has: has_text, weight })
        })
        .collect()
}

/// Name of the first of [`setting_texts`].
pub(crate) const BAUD_RATE: &str = "baud rate";

/// The settings of a line by name, as people write them.
pub(crate) fn setting_texts(line: LineParameters) -> [(&'static str, String); 4] {
    [
        (BAUD_RATE, line.baud.to_string()),
        ("data bits", line.data_bits.to_string()),
        ("parity", parity_name(line.parity).to_owned()),
        ("stop bits", stop_text(line.stop_half_bits)),
    ]
}

fn stop_text(half_bits: u8) -> String {
    match half_bits {
        3 => "1.5".to_owned(),
        half_bits => (half_bits / 2).to_string(),
    }
}

fn parity_name(parity: Parity) -> &'static str {
    match parity {
        Parity::None => "none",
        Parity::Odd => "odd",
        Parity::Even => "even",
        Parity::Mark => "mark",
        Parity::Space => "space",
    }
}

/// Those of them that stand in the way, if any do.
pub(crate) fn refused(differences: &[SettingDifference]) -> Option<Vec<SettingDifference>> {
    let refused = differences.iter().filter(|difference| difference.is_refused());
    let refused: Vec<_> = refused.cloned().collect();
    (!refused.is_empty()).then_some(refused)
}

/// The differences of a port that has neither rate nor parity, a pty: none stands in
/// the way.
pub(crate) fn noted(mut differences: Vec<SettingDifference>) -> Vec<SettingDifference> {
    for difference in &mut differences {
        difference.weight = DifferenceWeight::Note;
    }
    differences
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_may_be_rounded_and_no_more() {
        // As FTDI adapters and a 16550A with a clock of 1.8432 MHz round them.
        for (asked, has) in [(115_200, 115_385), (9_600, 9_600), (76_800, 76_923), (50, 51)] {
            assert_eq!(weight_of_rate(asked, has), DifferenceWeight::Note, "{asked} {has}");
        }
        for (asked, has) in [(250_000, 9_600), (9_600, 0), (250_000, 230_400), (9_600, 9_793)] {
            assert_eq!(weight_of_rate(asked, has), DifferenceWeight::Refused, "{asked} {has}");
        }
    }
}
