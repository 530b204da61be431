//! From a manifest's settings and what a person asked for to the values that a
//! plug-in is given.

use super::{Manifest, Setting, ValueType};
use crate::Event;
use crate::limits::VALUE_BYTES;
use crate::value::{Value, ValueWriter, Values};
use crate::wire::NoSpace;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use serde_json::Value as Json;
use thiserror::Error;

/// Every plug-in takes events of this many bytes.
const SMALLEST_INPUT: usize = *crate::limits::INPUT_BYTES.start() as usize;

/// A settings event with one value of the greatest length: flags, the record's
/// header, the value. A smaller piece could never hold it.
const SMALLEST_PIECE: usize = 1 + 6 + VALUE_BYTES;

/// A value that owns its text or bytes.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum OwnedValue {
    /// Yes or no.
    Bool(bool),
    /// A number in the setting's unit.
    Int(i64),
    /// Text.
    Text(String),
    /// Bytes.
    Bytes(Vec<u8>),
    /// One of the choices, counted from 0.
    Choice(u16),
}

impl OwnedValue {
    /// This value, borrowed.
    pub fn as_value(&self) -> Value<'_> {
        match self {
            Self::Bool(value) => Value::Bool(*value),
            Self::Int(value) => Value::Int(*value),
            Self::Text(text) => Value::Text(text),
            Self::Bytes(bytes) => Value::Bytes(bytes),
            Self::Choice(value) => Value::Choice(*value),
        }
    }
}

/// Why a setting cannot be given to the plug-in. `text()` of a person's input
/// is part of the message.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub enum SettingError {
    /// The plug-in has no such setting.
    #[error("unknown setting \"{name}\"; this plug-in has: {known}")]
    Unknown {
        /// As it was asked for.
        name: String,
        /// The settings there are.
        known: String,
    },
    /// The plug-in has no such preset.
    #[error("unknown preset \"{name}\"; this plug-in has: {known}")]
    UnknownPreset {
        /// As it was asked for.
        name: String,
        /// The presets there are.
        known: String,
    },
    /// The value is not of the setting's type.
    #[error("setting \"{name}\": \"{value}\" is not {expected}")]
    Type {
        /// The setting.
        name: String,
        /// As it was given.
        value: String,
        /// What it should be.
        expected: String,
    },
    /// The value is outside the setting's range.
    #[error("setting \"{name}\": {value} is outside {range}")]
    Range {
        /// The setting.
        name: String,
        /// As it was given.
        value: String,
        /// The range, with its unit.
        range: String,
    },
}

/// A value for every setting of a manifest, in its order.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct SettingValues {
    values: Vec<OwnedValue>,
}

impl Manifest {
    /// Resolves what was asked for, as `name=value` pairs of text: defaults,
    /// then the preset (the name `preset`), then explicit values.
    ///
    /// Bool takes `on`, `off`, `true`, `false`, `yes`, `no`; int takes decimal or
    /// `0x` hex; bytes take hex pairs, spaces allowed; a choice takes its name.
    ///
    /// ```
    /// # use softplug_abi::manifest::{Manifest, OwnedValue};
    /// # let manifest = Manifest::parse(br#"{"abi": "1.0", "name": "x", "version": "1",
    /// #   "licence": "MIT", "protocol": "x", "description": "x", "settings": [
    /// #   {"name": "xon", "type": "int", "default": 17, "min": 0, "max": 255, "text": "XON"}]}"#)?;
    /// let values = manifest.resolve_settings([("xon", "0x91")]).unwrap();
    /// assert_eq!(values.as_slice(), [OwnedValue::Int(0x91)]);
    /// assert!(manifest.resolve_settings([("xon", "300")]).is_err());
    /// # Ok::<(), softplug_abi::manifest::ManifestError>(())
    /// ```
    pub fn resolve_settings<'a>(
        &self,
        asked: impl IntoIterator<Item = (&'a str, &'a str)> + Clone,
    ) -> Result<SettingValues, SettingError> {
        let mut values = Vec::with_capacity(self.settings.len());
        for setting in &self.settings {
            values.push(setting.value_from_json(&setting.default)?);
        }
        for (_, preset) in asked.clone().into_iter().filter(|(name, _)| *name == "preset") {
            self.apply_preset(preset, &mut values)?;
        }
        for (name, text) in asked.into_iter().filter(|(name, _)| *name != "preset") {
            let at = self.setting_place(name)?;
            values[at] = self.settings[at].value_from_text(text)?;
        }
        Ok(SettingValues { values })
    }

    fn apply_preset(&self, name: &str, values: &mut [OwnedValue]) -> Result<(), SettingError> {
        let Some(preset) = self.presets.iter().find(|preset| preset.name == name) else {
            let known = list(self.presets.iter().map(|preset| preset.name.as_str()));
            return Err(SettingError::UnknownPreset { name: name.to_string(), known });
        };
        for (setting, json) in &preset.values {
            let at = self.setting_place(setting)?;
            values[at] = self.settings[at].value_from_json(json)?;
        }
        Ok(())
    }

    fn setting_place(&self, name: &str) -> Result<usize, SettingError> {
        self.settings.iter().position(|setting| setting.name == name).ok_or_else(|| {
            let known = list(self.settings.iter().map(|setting| setting.name.as_str()));
            SettingError::Unknown { name: name.to_string(), known }
        })
    }
}

impl SettingValues {
    /// The values in the manifest's order.
    pub fn as_slice(&self) -> &[OwnedValue] {
        &self.values
    }

    /// Calls `give` with settings events of at most `capacity` bytes each, at
    /// least one, and stops at its first error. A `capacity` under what one value
    /// can take (the ABI allows none so small) counts as that much.
    pub fn pieces<E>(
        &self,
        capacity: usize,
        mut give: impl FnMut(&Event<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut buffer = [0; SMALLEST_INPUT];
        let room = capacity.clamp(SMALLEST_PIECE, buffer.len()) - 1;
        let mut first = true;
        let mut at = 0;
        loop {
            let mut writer = ValueWriter::new(&mut buffer[..room]);
            while let Some(value) = self.values.get(at) {
                let Err(NoSpace) = writer.push(at as u16, value.as_value()) else {
                    at += 1;
                    continue;
                };
                break;
            }
            let last = at == self.values.len();
            give(&Event::Settings { first, last, values: Values::new(writer.written()) })?;
            if last {
                return Ok(());
            }
            first = false;
        }
    }
}

impl Setting {
    /// The setting's value from the JSON of a default or a preset.
    pub fn value_from_json(&self, json: &Json) -> Result<OwnedValue, SettingError> {
        let value = match (self.kind, json) {
            (ValueType::Bool, Json::Bool(value)) => OwnedValue::Bool(*value),
            (ValueType::Int, Json::Number(number)) => match number.as_i64() {
                Some(value) => OwnedValue::Int(value),
                None => return Err(self.type_error(&number.to_string())),
            },
            (ValueType::Text, Json::String(text)) => OwnedValue::Text(text.clone()),
            (ValueType::Bytes | ValueType::Choice, Json::String(text)) => {
                return self.value_from_text(text);
            }
            _ => return Err(self.type_error(&json.to_string())),
        };
        self.in_range(value)
    }

    /// The setting's value from a person's text.
    pub fn value_from_text(&self, text: &str) -> Result<OwnedValue, SettingError> {
        let value = match self.kind {
            ValueType::Bool => match text {
                "on" | "true" | "yes" => Some(OwnedValue::Bool(true)),
                "off" | "false" | "no" => Some(OwnedValue::Bool(false)),
                _ => None,
            },
            ValueType::Int => match text.strip_prefix("0x") {
                Some(hex) if hex.starts_with(['+', '-']) => None,
                Some(hex) => i64::from_str_radix(hex, 16).ok(),
                None => text.parse().ok(),
            }
            .map(OwnedValue::Int),
            ValueType::Text => Some(OwnedValue::Text(text.to_string())),
            ValueType::Bytes => bytes_from_hex(text).map(OwnedValue::Bytes),
            ValueType::Choice => self
                .choices
                .iter()
                .position(|choice| choice == text)
                .map(|at| OwnedValue::Choice(at as u16)),
        };
        self.in_range(value.ok_or_else(|| self.type_error(text))?)
    }

    fn in_range(&self, value: OwnedValue) -> Result<OwnedValue, SettingError> {
        let (measure, floor, ceiling) = match &value {
            OwnedValue::Int(value) => (*value, i64::MIN, i64::MAX),
            OwnedValue::Text(text) => (text.len() as i64, 0, VALUE_BYTES as i64),
            OwnedValue::Bytes(bytes) => (bytes.len() as i64, 0, VALUE_BYTES as i64),
            OwnedValue::Bool(_) | OwnedValue::Choice(_) => return Ok(value),
        };
        let (min, max) = (self.min.unwrap_or(floor), self.max.unwrap_or(ceiling));
        if (min..=max).contains(&measure) {
            return Ok(value);
        }
        let is_number = matches!(value, OwnedValue::Int(_));
        let unit = if is_number { self.unit.as_str() } else { "bytes" };
        let shown = measure.to_string();
        let range = alloc::format!("{min} to {max} {unit}").trim_end().to_string();
        Err(SettingError::Range { name: self.name.clone(), value: shown, range })
    }

    fn type_error(&self, value: &str) -> SettingError {
        let expected = match self.kind {
            ValueType::Bool => "on or off".to_string(),
            ValueType::Int => "a whole number".to_string(),
            ValueType::Text => "text".to_string(),
            ValueType::Bytes => "hex pairs such as \"11 13\"".to_string(),
            ValueType::Choice => {
                alloc::format!("one of {}", list(self.choices.iter().map(String::as_str)))
            }
        };
        SettingError::Type { name: self.name.clone(), value: value.to_string(), expected }
    }
}

pub(super) fn list<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let joined = names.collect::<Vec<_>>().join(", ");
    if joined.is_empty() { "none".to_string() } else { joined }
}

fn bytes_from_hex(text: &str) -> Option<Vec<u8>> {
    let digits: Vec<u8> = text
        .chars()
        .filter(|c| *c != ' ')
        .map(|c| c.to_digit(16).map(|digit| digit as u8))
        .collect::<Option<_>>()?;
    let (pairs, rest) = digits.as_chunks::<2>();
    rest.is_empty().then(|| pairs.iter().map(|[high, low]| high << 4 | low).collect())
}
