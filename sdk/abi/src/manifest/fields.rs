//! Fields of jobs and requests: from text to value records and back.

use super::{Field, Kind, OwnedValue, Setting, SettingError, ValueType, list};
use crate::limits::VALUE_BYTES;
use crate::value::{Value, ValueWriter, Values};
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::fmt::Write;
use thiserror::Error;

/// Bytes of a record before its value.
const RECORD_HEAD: usize = 6;

/// Why fields cannot be given with a job.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub enum FieldError {
    /// The kind has no such field.
    #[error("\"{kind}\" has no field \"{name}\"; it has: {known}")]
    Unknown {
        /// The kind of job or request.
        kind: String,
        /// As it was asked for.
        name: String,
        /// The fields there are.
        known: String,
    },
    /// A field is given more than once.
    #[error("field \"{name}\" is given twice")]
    Twice {
        /// The field.
        name: String,
    },
    /// A field without which the kind means nothing.
    #[error("\"{kind}\" needs the field \"{name}\": {text}")]
    Missing {
        /// The kind of job or request.
        kind: String,
        /// The field.
        name: String,
        /// What it is.
        text: String,
    },
    /// The value is not of the field's type.
    #[error("field \"{name}\": \"{value}\" is not {expected}")]
    Type {
        /// The field.
        name: String,
        /// As it was given.
        value: String,
        /// What it should be.
        expected: String,
    },
    /// The value is longer than a record takes.
    #[error("field \"{name}\" has {bytes} bytes, {VALUE_BYTES} are allowed")]
    TooLong {
        /// The field.
        name: String,
        /// Bytes of the value.
        bytes: String,
    },
}

impl Kind {
    /// Fields given as text, `name` and `value`, as the value records of a
    /// `job-begin` or a `request`: in the manifest's order. Values are written as
    /// in settings; a field of type choice carries a number.
    ///
    /// Whether required fields are there is [`require`](Self::require)'s to say.
    pub fn records<'a>(
        &self,
        given: impl IntoIterator<Item = (&'a str, &'a str)>,
    ) -> Result<Vec<u8>, FieldError> {
        let mut values: Vec<(usize, OwnedValue)> = Vec::new();
        for (name, text) in given {
            let place = self.place(name)?;
            if values.iter().any(|(taken, _)| *taken == place) {
                return Err(FieldError::Twice { name: name.to_string() });
            }
            values.push((place, self.fields[place].value_from_text(text)?));
        }
        values.sort_by_key(|(place, _)| *place);
        let mut buffer = alloc::vec![0; values.len() * (RECORD_HEAD + VALUE_BYTES)];
        let mut writer = ValueWriter::new(&mut buffer);
        for (place, value) in &values {
            let pushed = writer.push(*place as u16, value.as_value());
            pushed.expect("each value was measured, and there is room for all");
        }
        Ok(writer.written().to_vec())
    }

    /// Whether all required fields are among these records.
    pub fn require(&self, records: &[u8]) -> Result<(), FieldError> {
        let values = Values::new(records);
        let missing = |(place, field): &(usize, &Field)| {
            field.required && values.find(*place as u16).is_none()
        };
        match self.fields.iter().enumerate().find(missing) {
            None => Ok(()),
            Some((_, field)) => Err(FieldError::Missing {
                kind: self.name.clone(),
                name: field.name.clone(),
                text: field.text.clone(),
            }),
        }
    }

    /// The other way round: name and value of each field, as text, as far as
    /// the records can be read.
    pub fn assignments(&self, records: &[u8]) -> Vec<(String, String)> {
        let known = Values::new(records).map_while(Result::ok);
        let named = known.filter_map(|(place, value)| {
            Some((self.fields.get(usize::from(place))?.name.clone(), text(value)))
        });
        named.collect()
    }

    fn place(&self, name: &str) -> Result<usize, FieldError> {
        let place = self.fields.iter().position(|known| known.name == name);
        place.ok_or_else(|| FieldError::Unknown {
            kind: self.name.clone(),
            name: name.to_string(),
            known: list(self.fields.iter().map(|field| field.name.as_str())),
        })
    }
}

impl Field {
    /// The field's value from a person's text.
    pub fn value_from_text(&self, text: &str) -> Result<OwnedValue, FieldError> {
        if self.kind == ValueType::Choice {
            return text.parse().map(OwnedValue::Choice).map_err(|_| FieldError::Type {
                name: self.name.clone(),
                value: text.to_string(),
                expected: "a number".to_string(),
            });
        }
        let like_a_setting = Setting {
            name: self.name.clone(),
            kind: self.kind,
            default: serde_json::Value::Null,
            min: None,
            max: None,
            unit: String::new(),
            choices: Vec::new(),
            text: String::new(),
        };
        like_a_setting.value_from_text(text).map_err(|error| match error {
            SettingError::Type { name, value, expected } => {
                FieldError::Type { name, value, expected }
            }
            SettingError::Range { name, value, .. } => FieldError::TooLong { name, bytes: value },
            SettingError::Unknown { .. } | SettingError::UnknownPreset { .. } => {
                unreachable!("a single value asks for no name")
            }
        })
    }
}

fn text(value: Value<'_>) -> String {
    match value {
        Value::Bool(value) => if value { "on" } else { "off" }.to_string(),
        Value::Int(value) => value.to_string(),
        Value::Text(text) => text.to_string(),
        Value::Bytes(bytes) => {
            let mut text = String::with_capacity(bytes.len() * 3);
            for byte in bytes {
                let gap = if text.is_empty() { "" } else { " " };
                let _ = write!(text, "{gap}{byte:02X}");
            }
            text
        }
        Value::Choice(value) => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kind() -> Kind {
        let field = |name: &str, kind, required| Field {
            name: name.to_string(),
            kind,
            required,
            text: "which one".to_string(),
        };
        Kind {
            name: "program".to_string(),
            text: String::new(),
            fields: alloc::vec![
                field("number", ValueType::Int, true),
                field("title", ValueType::Text, false),
                field("head", ValueType::Bytes, false),
                field("last", ValueType::Bool, false),
                field("side", ValueType::Choice, false),
            ],
        }
    }

    #[test]
    fn every_type_comes_back_in_the_manifests_order() {
        let given =
            [("side", "2"), ("last", "yes"), ("head", "0aFF"), ("title", "a b"), ("number", "-7")];
        let records = kind().records(given).unwrap();
        let back = kind().assignments(&records);
        let back: Vec<_> =
            back.iter().map(|(name, value)| (name.as_str(), value.as_str())).collect();
        assert_eq!(
            back,
            [("number", "-7"), ("title", "a b"), ("head", "0A FF"), ("last", "on"), ("side", "2")]
        );
        assert_eq!(kind().require(&records), Ok(()));
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let message =
            |given: &[(&str, &str)]| kind().records(given.iter().copied()).unwrap_err().to_string();
        assert_eq!(
            message(&[("colour", "red")]),
            "\"program\" has no field \"colour\"; it has: number, title, head, last, side"
        );
        assert_eq!(message(&[("side", "left")]), "field \"side\": \"left\" is not a number");
        assert_eq!(
            message(&[("number", "many")]),
            "field \"number\": \"many\" is not a whole number"
        );
        let long = "x".repeat(401);
        assert_eq!(message(&[("title", &long)]), "field \"title\" has 401 bytes, 400 are allowed");
        assert_eq!(message(&[("last", "on"), ("last", "on")]), "field \"last\" is given twice");
    }

    #[test]
    fn a_required_field_is_missed() {
        let records = kind().records([("title", "a")]).unwrap();
        let error = kind().require(&records).unwrap_err();
        assert_eq!(error.to_string(), "\"program\" needs the field \"number\": which one");
    }
}
