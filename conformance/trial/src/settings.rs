//! Values of settings, by name.

use softplug_abi::manifest::{Manifest, OwnedValue, SettingValues, ValueType};

/// Values of settings by name; what the plug-in does not have is off.
pub(crate) struct Set<'a> {
    pub(crate) manifest: &'a Manifest,
    pub(crate) settings: &'a SettingValues,
}

impl Set<'_> {
    fn value(&self, name: &str) -> Option<&OwnedValue> {
        let at = self.manifest.settings.iter().position(|setting| setting.name == name)?;
        self.settings.as_slice().get(at)
    }

    pub(crate) fn bool(&self, name: &str) -> bool {
        matches!(self.value(name), Some(OwnedValue::Bool(true)))
    }

    pub(crate) fn int(&self, name: &str) -> Option<i64> {
        match self.value(name) {
            Some(OwnedValue::Int(value)) => Some(*value),
            _ => None,
        }
    }

    pub(crate) fn choice(&self, name: &str) -> Option<String> {
        let setting = self.manifest.settings.iter().find(|setting| setting.name == name)?;
        match (&setting.kind, self.value(name)?) {
            (ValueType::Choice, OwnedValue::Choice(at)) => {
                setting.choices.get(usize::from(*at)).map(ToString::to_string)
            }
            _ => None,
        }
    }
}
