//! A machine, and the file that describes it. What stands there is taken as hostile.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use crate::error::MachineError;
use crate::limits::{MOST_FILE_BYTES, MOST_NAME, MOST_TEXT};
use crate::names::{Notation, Notations};

/// A machine as its file has it.
///
/// ```
/// use softplug_catalogue::Machine;
///
/// let machine = Machine::parse(
///     r#"
///     name = "old-mill"
///     title = "The mill in hall 2"
///     plugin = "xon-xoff"
///     line = "4800 7E2"
///     [settings]
///     preset = "drip-feed"
///     [[control]]
///     where = "Parameter 12"
///     value = "4800"
///     "#,
/// )?;
/// assert_eq!(machine.name, "old-mill");
/// assert_eq!(machine.settings["preset"], "drip-feed");
/// # Ok::<(), softplug_catalogue::MachineError>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Machine {
    /// By which it is asked for: a-z, 0-9 and -.
    pub name: String,
    /// What people call it.
    pub title: String,
    /// Name of the plug-in that speaks to it.
    pub plugin: String,
    /// Its line as it is usually set, such as `9600 7E1`. Without one it is the plug-in's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub line: Option<String>,
    /// Others that occur.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lines: Vec<String>,
    /// How it holds whoever sends.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flow: Option<Flow>,
    /// What a program begins and ends with, if it wants that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tape: Option<String>,
    /// Settings of the plug-in that are not its defaults; `preset` names a preset of it.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub settings: BTreeMap<String, String>,
    /// How programs are named in their text.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub names: Option<ProgramNames>,
    /// What is set at the control.
    #[serde(default, rename = "control", skip_serializing_if = "Vec::is_empty")]
    pub at_control: Vec<AtControl>,
    /// What the cable must have.
    #[serde(default, rename = "cable", skip_serializing_if = "Vec::is_empty")]
    pub cable: Vec<Remark>,
    /// What no source tells for sure.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unsure: Vec<Remark>,
    /// Where the facts are from.
    #[serde(default, rename = "source", skip_serializing_if = "Vec::is_empty")]
    pub sources: Vec<Source>,
}

/// How a machine holds whoever sends.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Flow {
    /// By characters.
    XonXoff,
    /// By a line of the cable.
    RtsCts,
    /// By both.
    Both,
}

/// How programs are named in their text.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProgramNames {
    /// Such as `O{number}`, `:{number}`, `<{name}>` or `%_N_{name}_MPF`.
    pub form: String,
    /// Others in which the control sends programs, or takes them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub also: Vec<String>,
    /// Digits that a number has.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub digits: Option<u8>,
    /// Characters that a name may have.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub characters: Option<String>,
    /// Most characters of a name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub longest: Option<u16>,
}

/// Something that a person sets at the control.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AtControl {
    /// The place, as the control names it.
    #[serde(rename = "where")]
    pub place: String,
    /// What stands beside it there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// What to put in.
    pub value: String,
    /// What to know of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
}

/// A sentence.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Remark {
    /// The sentence.
    #[serde(alias = "what")]
    pub note: String,
}

/// Where facts are from.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Source {
    /// What it is.
    pub title: String,
    /// Where it was found.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub url: Option<String>,
    /// What it says, in other words.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub says: Option<String>,
}

impl Machine {
    /// Reads a machine's file.
    ///
    /// # Errors
    /// The first thing that is wrong: too long, no TOML, a key that is not known, a name that is
    /// none, a text that cannot be shown.
    pub fn parse(text: &str) -> Result<Self, MachineError> {
        if text.len() > MOST_FILE_BYTES {
            return Err(MachineError::TooLong);
        }
        let machine: Self = toml::from_str(text).map_err(|error| {
            let at = error.span().map_or(0, |span| span.start).min(text.len());
            let line = 1 + text.as_bytes()[..at].split(|byte| *byte == b'\n').skip(1).count();
            MachineError::Form { line, message: one_line(error.message()) }
        })?;
        machine.check()?;
        Ok(machine)
    }

    fn check(&self) -> Result<(), MachineError> {
        if !is_name(&self.name) {
            return Err(MachineError::Name { name: format!("{:?}", shortened(&self.name)) });
        }
        if !is_name(&self.plugin) {
            return Err(MachineError::Plugin { name: format!("{:?}", shortened(&self.plugin)) });
        }
        for (key, text) in self.texts() {
            let is_shown = (1..=MOST_TEXT).contains(&text.len()) && !text.contains(is_hidden);
            if !is_shown {
                return Err(MachineError::Text { key });
            }
        }
        for form in self.forms() {
            form.parse::<Notation>()?;
        }
        Ok(())
    }

    fn forms(&self) -> impl Iterator<Item = &String> {
        self.names.iter().flat_map(|names| std::iter::once(&names.form).chain(&names.also))
    }

    /// How its programs say their names: in its own notations, then in those that are known.
    ///
    /// ```
    /// use softplug_catalogue::Catalogue;
    ///
    /// let catalogue = Catalogue::known();
    /// let machine = catalogue.find("okuma-osp").expect("it is known");
    /// assert_eq!(machine.notations().name_in(b"$SHAFT-1.MIN%\n").as_deref(), Some("SHAFT-1"));
    /// ```
    pub fn notations(&self) -> Notations {
        // A test reads those of the machines that come with us; others were checked.
        Notations::before_known(self.forms().filter_map(|form| form.parse().ok()).collect())
    }

    /// What is to be known of how a program says its name to this machine, as a sentence without
    /// its subject; `None` if all is well.
    ///
    /// ```
    /// use softplug_catalogue::Catalogue;
    ///
    /// let catalogue = Catalogue::known();
    /// let machine = catalogue.find("haas-vf").expect("it is known");
    /// assert_eq!(machine.remark_on_name(b"%\nO12345\nM30\n%\n"), None);
    /// assert_eq!(
    ///     machine.remark_on_name(b"G0 X1\n").as_deref(),
    ///     Some("does not say its name as haas-vf wants it: O{number}")
    /// );
    /// ```
    pub fn remark_on_name(&self, text: &[u8]) -> Option<String> {
        let names = self.names.as_ref()?;
        // What does not stand in the text cannot be missed there.
        if names.form.starts_with('{') {
            return None;
        }
        let own = self.forms().filter_map(|form| form.parse::<Notation>().ok());
        let Some(said) = own.into_iter().find_map(|notation| notation.read(text)) else {
            return Some(format!(
                "does not say its name as {} wants it: {}",
                self.name, names.form
            ));
        };
        let count = said.chars().filter(char::is_ascii_digit).count();
        let digits = usize::from(names.digits.filter(|_| names.form.contains("{number}"))?);
        let is_long = count > digits;
        is_long
            .then(|| format!("is called {said}, and a number has {digits} digits on {}", self.name))
    }

    /// All that is shown, by its key.
    fn texts(&self) -> Vec<(&'static str, &str)> {
        let mut texts = vec![("title", &*self.title)];
        texts.extend(self.line.iter().map(|line| ("line", &**line)));
        texts.extend(self.lines.iter().map(|line| ("lines", &**line)));
        texts.extend(self.tape.iter().map(|tape| ("tape", &**tape)));
        for (name, value) in &self.settings {
            texts.push(("settings", name));
            // A setting may be empty.
            texts.extend((!value.is_empty()).then_some(("settings", &**value)));
        }
        if let Some(names) = &self.names {
            texts.push(("names.form", &names.form));
            texts.extend(names.also.iter().map(|form| ("names.also", &**form)));
            texts.extend(names.characters.iter().map(|text| ("names.characters", &**text)));
        }
        for set in &self.at_control {
            texts.extend([("control.where", &*set.place), ("control.value", &*set.value)]);
            texts.extend(set.name.iter().map(|name| ("control.name", &**name)));
            texts.extend(set.note.iter().map(|note| ("control.note", &**note)));
        }
        texts.extend(self.cable.iter().map(|remark| ("cable.note", &*remark.note)));
        texts.extend(self.unsure.iter().map(|remark| ("unsure.note", &*remark.note)));
        for source in &self.sources {
            texts.push(("source.title", &source.title));
            texts.extend(source.url.iter().map(|url| ("source.url", &**url)));
            texts.extend(source.says.iter().map(|says| ("source.says", &**says)));
        }
        texts
    }
}

/// What names a machine or a plug-in, and no path.
fn is_name(text: &str) -> bool {
    let is_plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    (1..=MOST_NAME).contains(&text.len()) && text.chars().all(is_plain) && !text.starts_with('-')
}

/// What moves the cursor, turns the direction of writing, or is not seen: what the standard library
/// escapes behind another character, but for quotes and backslashes.
fn is_hidden(c: char) -> bool {
    !matches!(c, '"' | '\'' | '\\')
        && ['x', c].iter().collect::<String>().escape_debug().count() > 2
}

fn shortened(text: &str) -> String {
    text.chars().take(MOST_NAME).collect()
}

fn one_line(message: &str) -> String {
    message
        .split('\n')
        .map(str::trim)
        .filter(|line| !line.is_empty())
        .collect::<Vec<_>>()
        .join(", ")
}
