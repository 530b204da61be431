//! A plug-in of the library as it is shown.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Which plug-in.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize, ToSchema)]
pub struct PluginRef {
    /// Its name.
    pub name: String,
    /// Its version.
    pub version: String,
    /// SHA-256 of the module, in hex.
    pub digest: String,
}

/// A plug-in in the library.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct PluginView {
    /// Which one.
    #[serde(flatten)]
    pub plugin: PluginRef,
    /// The protocol.
    pub protocol: String,
    /// What it is for.
    pub description: String,
    /// Its licence.
    pub licence: String,
    /// Bytes of the module.
    pub bytes: u64,
    /// Its settings.
    pub settings: Vec<SettingView>,
    /// Names of its presets.
    pub presets: Vec<String>,
    /// Kinds of job that it takes.
    pub jobs: Vec<KindView>,
    /// Links that run it.
    pub links: Vec<String>,
}

/// A setting of a plug-in.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct SettingView {
    /// Its name.
    pub name: String,
    /// Type of its value: bool, int, text, bytes or choice.
    #[serde(rename = "type")]
    pub kind: String,
    /// Value if nothing is said.
    pub default: String,
    /// Smallest value, or least length.
    pub min: Option<i64>,
    /// Largest value, or greatest length.
    pub max: Option<i64>,
    /// Unit of an int.
    pub unit: String,
    /// The choices of a choice.
    pub choices: Vec<String>,
    /// What it does.
    pub text: String,
}

/// A kind of job that a link's plug-in takes, or of a request that it makes.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct KindView {
    /// Its name.
    pub name: String,
    /// What it does.
    pub text: String,
    /// Its fields.
    pub fields: Vec<FieldView>,
}

/// A field of a kind of job.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct FieldView {
    /// Its name.
    pub name: String,
    /// Type of its value: bool, int, text, bytes or choice.
    #[serde(rename = "type")]
    pub kind: String,
    /// It must be there.
    pub required: bool,
    /// What it means.
    pub text: String,
}
