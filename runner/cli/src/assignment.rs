//! Settings and fields as they are asked for, NAME=VALUE.

use std::str::FromStr;

/// A setting as it was asked for.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Assignment {
    pub(crate) name: String,
    pub(crate) value: String,
}

impl FromStr for Assignment {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::parse(text).ok_or_else(|| "a setting is written NAME=VALUE".to_owned())
    }
}

impl Assignment {
    fn parse(text: &str) -> Option<Self> {
        let (name, value) = text.split_once('=').filter(|(name, _)| !name.trim().is_empty())?;
        Some(Self { name: name.trim().to_owned(), value: value.to_owned() })
    }

    pub(crate) fn as_pair(&self) -> (&str, &str) {
        (&self.name, &self.value)
    }
}

/// A field of a job as it was asked for.
pub(crate) fn field(text: &str) -> Result<Assignment, String> {
    Assignment::parse(text).ok_or_else(|| "a field is written NAME=VALUE".to_owned())
}
