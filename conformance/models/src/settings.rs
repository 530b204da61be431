//! Settings of a session, by name.

use softplug_abi::manifest::{Manifest, OwnedValue, SettingValues};
use std::collections::BTreeMap;

/// Settings by name. One that the plug-in does not have is as the profile's page
/// says, which is what each question names.
///
/// ```
/// use softplug_models::Settings;
///
/// assert_eq!(Settings::default().int("quiet_time", 3_000), 3_000);
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Settings(BTreeMap<String, Value>);

#[derive(Clone, PartialEq, Eq, Debug)]
enum Value {
    Bool(bool),
    Int(i64),
    Bytes(Vec<u8>),
    Name(String),
}

impl Settings {
    /// Those of a plug-in.
    pub fn new(manifest: &Manifest, values: &SettingValues) -> Self {
        let named = manifest.settings.iter().zip(values.as_slice());
        let value = named.map(|(setting, value)| {
            let value = match value {
                OwnedValue::Bool(on) => Value::Bool(*on),
                OwnedValue::Int(number) => Value::Int(*number),
                OwnedValue::Bytes(bytes) => Value::Bytes(bytes.clone()),
                OwnedValue::Text(text) => Value::Name(text.clone()),
                OwnedValue::Choice(place) => {
                    let name = setting.choices.get(usize::from(*place));
                    Value::Name(name.cloned().unwrap_or_default())
                }
            };
            (setting.name.clone(), value)
        });
        Self(value.collect())
    }

    /// A setting that is on or off.
    pub fn is_on(&self, name: &str, otherwise: bool) -> bool {
        match self.0.get(name) {
            Some(Value::Bool(on)) => *on,
            _ => otherwise,
        }
    }

    /// A number.
    pub fn int(&self, name: &str, otherwise: i64) -> i64 {
        match self.0.get(name) {
            Some(Value::Int(number)) => *number,
            _ => otherwise,
        }
    }

    /// Bytes.
    pub fn bytes(&self, name: &str, otherwise: &[u8]) -> Vec<u8> {
        match self.0.get(name) {
            Some(Value::Bytes(bytes)) => bytes.clone(),
            _ => otherwise.to_vec(),
        }
    }

    /// A choice, or a text.
    pub fn name<'a>(&'a self, name: &str, otherwise: &'a str) -> &'a str {
        match self.0.get(name) {
            Some(Value::Name(chosen)) => chosen,
            _ => otherwise,
        }
    }
}
