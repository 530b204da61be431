//! `machine = "…"` of a link: what the catalogue says of it, as if it were written there.

use softplug_catalogue::{Catalogue, Machine};
use softplug_live::guess::nearest;
use toml::{Spanned, Value};

use super::finding::ConfigFindings;
use super::written::{Gateway, Link, Text};

/// The machines that are known, and those of the folder that the file names.
pub(super) fn catalogue(
    written: &Gateway,
    folder: &std::path::Path,
    problems: &mut ConfigFindings<'_>,
) -> Catalogue {
    let mut catalogue = Catalogue::known();
    if let Some(text) = &written.machines
        && let Err(error) = catalogue.add_folder(&folder.join(text.get_ref()))
    {
        problems.add(text.span(), error, "`softplug machine list --machines DIR` reads it too");
    }
    catalogue
}

impl Link {
    /// This link, with what it does not say taken from its machine, if it names one.
    pub(super) fn or_machine(
        mut self,
        defaults: &Self,
        catalogue: &Catalogue,
        problems: &mut ConfigFindings<'_>,
    ) -> Self {
        let Some(text) = self.machine.clone().or_else(|| defaults.machine.clone()) else {
            return self;
        };
        let Some(machine) = catalogue.find(text.get_ref()) else {
            let message = format!("there is no machine \"{}\"", text.get_ref().escape_debug());
            let names = catalogue.machines().iter().map(|machine| &*machine.name);
            let hint = match nearest(text.get_ref(), names) {
                Some(meant) => format!("did you mean \"{meant}\"?"),
                None => "`softplug machine list` lists them".to_owned(),
            };
            problems.add(text.span(), message, hint);
            return self;
        };
        let plugin = self.plugin.take();
        if let Some(plugin) = plugin.as_ref().filter(|plugin| is_other(plugin, machine)) {
            let Machine { name, plugin: spoken, .. } = machine;
            let message = format!("the machine {name} is spoken to with {spoken}");
            problems.add(plugin.span(), message, "leave out `plugin`, or `machine`");
        }
        let mut link = self.or(&written(machine, &text));
        link.plugin = plugin.or(link.plugin);
        link
    }
}

/// Whether a link's plug-in, with its version or digest behind it, is another than the machine's.
fn is_other(plugin: &Text, machine: &Machine) -> bool {
    plugin.get_ref().split('@').next() != Some(&machine.plugin)
}

/// A machine as a link that says nothing else; all of it stands where its name does.
fn written(machine: &Machine, at: &Text) -> Link {
    let text = |text: &str| Spanned::new(at.span(), text.to_owned());
    let value = |text: &str| Spanned::new(at.span(), Value::String(text.to_owned()));
    let settings = machine.settings.iter().map(|(name, set)| (text(name), value(set)));
    Link {
        plugin: Some(text(&machine.plugin)),
        line: machine.line.as_deref().map(text),
        settings: Some(settings.collect()),
        names: machine.names.as_ref().map(|names| {
            let forms = std::iter::once(&names.form).chain(&names.also);
            Spanned::new(at.span(), forms.map(|form| text(form)).collect())
        }),
        ..Link::default()
    }
}
