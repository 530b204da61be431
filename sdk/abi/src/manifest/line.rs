//! The protocol's line: what a manifest names, and for which settings.

use super::{Manifest, ManifestError, SINCE, Setting, SettingValues, entry};
use crate::{LineParameters, Parity};
use alloc::collections::BTreeMap;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::fmt;
use core::str::FromStr;
use serde::{Deserialize, Serialize};
use serde_json::Value as Json;
use thiserror::Error;

/// Rates that a line can have, bits per second.
const RATES: core::ops::RangeInclusive<u32> = 50..=16_000_000;

/// How a protocol's line is set, as a manifest names it: `4800 7E2`, or `8E1` where the protocol
/// leaves the rate open.
///
/// ```
/// use softplug_abi::manifest::ProtocolLine;
///
/// let line: ProtocolLine = "4800 7E2".parse().unwrap();
/// assert_eq!((line.parameters.baud, line.parameters.data_bits), (4_800, 7));
/// assert_eq!(line.to_string(), "4800 7E2");
/// assert_eq!("8E1".parse::<ProtocolLine>().unwrap().parameters.baud, 0);
/// assert!("4800".parse::<ProtocolLine>().is_err());
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct ProtocolLine {
    /// The characters, and the rate; a rate of 0 is left open.
    pub parameters: LineParameters,
}

/// The text names no line.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
#[error(
    "\"{0}\" is not a line; write it as \"4800 7E2\": a rate from {min} to {max} or none, data bits, \
     parity (N, O, E, M, S) and stop bits",
    min = RATES.start(),
    max = RATES.end()
)]
pub struct BadLine(pub String);

/// Settings for which the line is another one.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LineCase {
    /// Settings by name, with values as in a setting's `default`; `preset` is the preset that was
    /// asked for. All of them together.
    pub when: BTreeMap<String, Json>,
    /// The line then.
    pub line: ProtocolLine,
}

impl FromStr for ProtocolLine {
    type Err = BadLine;

    fn from_str(text: &str) -> Result<Self, BadLine> {
        read(text)
            .map(|parameters| Self { parameters })
            .ok_or_else(|| BadLine(text.escape_debug().to_string()))
    }
}

fn read(text: &str) -> Option<LineParameters> {
    let (baud, form) = match text.split_once(' ') {
        None => (0, text),
        Some((rate, form)) => {
            let is_plain = rate.bytes().all(|byte| byte.is_ascii_digit()) && !rate.starts_with('0');
            let rate = rate.parse().ok().filter(|rate| is_plain && RATES.contains(rate))?;
            (rate, form)
        }
    };
    let mut letters = form.chars();
    let data_bits = letters.next()?.to_digit(10).filter(|bits| (5..=8).contains(bits))? as u8;
    let parity = match letters.next()? {
        'N' => Parity::None,
        'O' => Parity::Odd,
        'E' => Parity::Even,
        'M' => Parity::Mark,
        'S' => Parity::Space,
        _ => return None,
    };
    let stop_half_bits = match letters.as_str() {
        "1" => 2,
        "1.5" => 3,
        "2" => 4,
        _ => return None,
    };
    Some(LineParameters { baud, data_bits, parity, stop_half_bits })
}

impl fmt::Display for ProtocolLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let LineParameters { baud, data_bits, parity, stop_half_bits } = self.parameters;
        if baud != 0 {
            write!(f, "{baud} ")?;
        }
        let parity = match parity {
            Parity::None => 'N',
            Parity::Odd => 'O',
            Parity::Even => 'E',
            Parity::Mark => 'M',
            Parity::Space => 'S',
        };
        let stop = match stop_half_bits {
            3 => "1.5",
            4 => "2",
            _ => "1",
        };
        write!(f, "{data_bits}{parity}{stop}")
    }
}

impl TryFrom<String> for ProtocolLine {
    type Error = BadLine;

    fn try_from(text: String) -> Result<Self, BadLine> {
        text.parse()
    }
}

impl From<ProtocolLine> for String {
    fn from(line: ProtocolLine) -> Self {
        line.to_string()
    }
}

impl Manifest {
    /// The protocol's line with these settings: `asked` as they were asked for, presets among them,
    /// `values` as they were [resolved](Manifest::resolve_settings). `None`: the manifest names none.
    ///
    /// ```
    /// # use softplug_abi::manifest::Manifest;
    /// let manifest = Manifest::parse(br#"{"abi": "1.1", "name": "x", "version": "1",
    ///     "licence": "MIT", "protocol": "x", "description": "x", "settings": [
    ///     {"name": "parity", "type": "choice", "default": "port", "choices": ["port", "own"],
    ///      "text": "who makes it"}],
    ///     "line": "7E2", "line_when": [{"when": {"parity": "own"}, "line": "8N2"}]}"#)?;
    /// let line = |asked: &[(&str, &str)]| {
    ///     let values = manifest.resolve_settings(asked.iter().copied()).unwrap();
    ///     manifest.line_for(asked.iter().copied(), &values).unwrap().to_string()
    /// };
    /// assert_eq!(line(&[]), "7E2");
    /// assert_eq!(line(&[("parity", "own")]), "8N2");
    /// # Ok::<(), softplug_abi::manifest::ManifestError>(())
    /// ```
    pub fn line_for<'a>(
        &self,
        asked: impl IntoIterator<Item = (&'a str, &'a str)>,
        values: &SettingValues,
    ) -> Option<ProtocolLine> {
        let presets: Vec<&str> = asked
            .into_iter()
            .filter_map(|(name, value)| (name == "preset").then_some(value))
            .collect();
        let is_asked = |preset: &Json| presets.iter().any(|asked| preset == asked);
        let is_set = |name: &str, value: &Json| {
            let at = self.settings.iter().position(|setting| setting.name == name);
            at.is_some_and(|at| {
                let wanted = self.settings[at].value_from_json(value);
                wanted.is_ok_and(|wanted| values.as_slice().get(at) == Some(&wanted))
            })
        };
        let holds = |case: &&LineCase| {
            case.when.iter().all(|(name, value)| match name.as_str() {
                "preset" => is_asked(value),
                name => is_set(name, value),
            })
        };
        self.line_when.iter().find(holds).map(|case| case.line).or(self.line)
    }

    pub(super) fn check_line(&self) -> Result<(), ManifestError> {
        if self.line.is_none() && !self.line_when.is_empty() {
            return entry("line_when", "it needs a `line`, for all other settings");
        }
        if self.line.is_some() && self.minor() < Some(SINCE) {
            return entry("line", "it came with ABI 1.1: write that as `abi`");
        }
        for (at, case) in self.line_when.iter().enumerate() {
            let path = alloc::format!("line_when[{at}]");
            if case.when.is_empty() {
                return entry(&path, "`when` names no setting");
            }
            for (name, value) in &case.when {
                if name == "preset" {
                    if !self.presets.iter().any(|preset| *value == preset.name.as_str()) {
                        return entry(&path, "there is no such preset");
                    }
                    continue;
                }
                let is_it = |setting: &&Setting| setting.name == *name;
                let Some(setting) = self.settings.iter().find(is_it) else {
                    return entry(&path, "there is no such setting");
                };
                setting.value_from_json(value).map_err(|source| ManifestError::Value {
                    entry: alloc::format!("{path}.{name}"),
                    source,
                })?;
            }
        }
        Ok(())
    }
}
