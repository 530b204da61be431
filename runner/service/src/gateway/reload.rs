//! A new configuration: what changed in it is applied, other links are not touched.

use std::collections::{BTreeMap, BTreeSet, HashSet};

use super::lanes::limits;
use super::link::{After, Lane, WantedSwap};
use super::loading::{Loader, Prepared, Unloadable};
use super::{Control, Shared};
use crate::config::{Config, ConfigError, ConfigFinding, LinkConfig};
use crate::jobs::{Note, Subject, Weight};
use crate::view::{ReloadView, RemadeLink, SwapWhen};

/// Keys that say what the loop does with a link, and nothing of its lane.
const AT_ONCE: [&str; 9] =
    ["group", "search", "names", "machine", "receive", "quota", "swap", "probation", "drop"];
/// Keys for which a swap does.
const BY_SWAP: [&str; 2] = ["plugin", "settings"];

/// A configuration with every link's plug-in.
pub(super) struct Ready {
    pub(super) config: Config,
    pub(super) plugins: BTreeMap<String, Prepared>,
}

/// A plug-in that a link's configuration asks for and that cannot be had.
pub(super) struct Missing {
    link: String,
    plugin: String,
    why: String,
}

impl Shared {
    /// Finds the plug-ins of all links and checks their settings.
    pub(super) fn make_ready(&self, config: Config) -> Result<Ready, ConfigError> {
        self.prepare_all(config).map_err(|(error, _)| error)
    }

    /// As [`make_ready`](Self::make_ready); beside what is wrong, the links whose plug-in cannot
    /// be had, and why.
    pub(super) fn prepare_all(
        &self,
        mut config: Config,
    ) -> Result<Ready, (ConfigError, Vec<Missing>)> {
        let (mut plugins, mut problems) = (BTreeMap::new(), Vec::new());
        let mut missing = Vec::new();
        for link in &mut config.links {
            match self.parts.loader.prepare(&link.plugin, &link.settings) {
                Ok(prepared) => match link.complete_line(prepared.line()) {
                    Ok(()) => {
                        plugins.insert(link.name.clone(), prepared);
                    }
                    Err(problem) => problems.push(problem),
                },
                Err(error) => {
                    missing.push(Missing {
                        link: link.name.clone(),
                        plugin: link.plugin.clone(),
                        why: error.to_string(),
                    });
                    problems.push(problem(link, &error));
                }
            }
        }
        if problems.is_empty() {
            Ok(Ready { config, plugins })
        } else {
            Err((ConfigError::Wrong(problems), missing))
        }
    }
}

/// Finds a link's plug-in, checks its settings, and takes from it what is not written of the line.
pub(super) fn prepare(loader: &Loader, link: &mut LinkConfig) -> Result<Prepared, ConfigFinding> {
    let prepared = loader.prepare(&link.plugin, &link.settings);
    let prepared = prepared.map_err(|error| problem(link, &error))?;
    link.complete_line(prepared.line())?;
    Ok(prepared)
}

/// What is wrong with a link's plug-in, where it is written.
fn problem(link: &LinkConfig, error: &Unloadable) -> ConfigFinding {
    let (place, message, hint) = match error {
        Unloadable::Setting { name, text, hint } => {
            let place = name.as_ref().and_then(|name| link.places.settings.get(name));
            (place.unwrap_or(&link.places.plugin), text.clone(), hint.clone())
        }
        error => {
            let text = error.to_string();
            let (message, hint) = match text.split_once("; ") {
                Some((message, hint)) => (message.to_owned(), hint.to_owned()),
                None => (text, "`softplug plugin list` shows what the library has".to_owned()),
            };
            (&link.places.plugin, message, hint)
        }
    };
    ConfigFinding { place: place.clone(), message, hint }
}

/// Names of what is not the same in both.
fn differing<'a, T: PartialEq>(old: &'a [T], new: &'a [T], name: fn(&T) -> &String) -> Vec<String> {
    let gone = old.iter().filter(|one| !new.contains(one));
    let came = new.iter().filter(|one| !old.contains(one));
    let names: BTreeSet<_> = gone.chain(came).map(|one| name(one).clone()).collect();
    names.into_iter().collect()
}

impl Control {
    /// Applies a configuration.
    pub(super) fn apply(&mut self, ready: Ready) -> ReloadView {
        let Ready { config, mut plugins } = ready;
        let mut view = ReloadView { needs_restart: self.fixed(&config), ..ReloadView::default() };
        view.buses = differing(&self.config.buses, &config.buses, |bus| &bus.name);
        view.cells = differing(&self.config.cells, &config.cells, |cell| &cell.name);
        self.drivers.set_buses(config.buses.clone());
        let names: HashSet<&str> = config.links.iter().map(|link| link.name.as_str()).collect();
        let gone: Vec<String> =
            self.links.keys().filter(|name| !names.contains(name.as_str())).cloned().collect();
        for name in gone {
            self.close(&name, After::Remove);
            view.removed.push(name);
        }
        for link in &config.links {
            let Some(plugin) = plugins.remove(&link.name) else { continue };
            let Some(known) = self.links.get(&link.name) else {
                self.add(link.clone(), plugin);
                view.added.push(link.name.clone());
                continue;
            };
            // What waits already is what it will be.
            let will_be = known.next.as_ref().map_or(&known.config, |next| &next.0);
            let mut keys = will_be.changed_keys(link);
            if known.unapplied.is_some() && !keys.contains(&"plugin") {
                // It was asked for before, and is tried again, unless it is what runs.
                if known.plugin.digest() != plugin.digest() {
                    keys.push("plugin");
                } else if let Some(known) = self.links.get_mut(&link.name) {
                    known.unapplied = None;
                }
            }
            if keys.is_empty() {
                view.untouched += 1;
                continue;
            }
            let waits = self.change(link, plugin, &keys);
            let keys = keys.into_iter().map(ToOwned::to_owned).collect();
            view.changed.push(RemadeLink { name: link.name.clone(), keys, waits });
        }
        view.needs_restart.extend(self.set_cells(&config.cells));
        let quotas = config.links.iter().map(|link| (link.name.clone(), link.quota)).collect();
        self.shared.parts.quotas.set(quotas);
        let limits = limits(&config.supervision);
        for link in self.links.values_mut() {
            link.supervisor.limit(limits);
        }
        let names = config.links.iter().map(|link| (link.receive.clone(), link.names.clone()));
        self.shared.parts.receptions.set_names(names.collect());
        self.set_drops(&config.links);
        self.config = config;
        view
    }

    /// A configuration that was read again is not taken: all goes on as before.
    pub(super) fn reload_refused(&mut self, why: &str, missing: Vec<Missing>) {
        let text = format!("the changed gateway.toml is not taken, all goes on as before: {why}");
        if self.config_trouble.as_ref() != Some(&text) {
            let note = Note::new(Subject::Gateway, text.as_str()).weighing(Weight::Warning);
            self.shared.parts.journal_writer.note(note);
            self.config_trouble = Some(text);
        }
        for Missing { link, plugin, why } in missing {
            if let Some(link) = self.links.get_mut(&link) {
                link.did_not_take(&plugin, &why);
            }
        }
    }

    /// Applies a configuration that was read again.
    pub(super) fn reload(&mut self, ready: Ready) -> ReloadView {
        self.config_trouble = None;
        let view = self.apply(ready);
        self.tell_reload(&view);
        view
    }

    /// Changes one link; whether the change waits.
    fn change(&mut self, config: &LinkConfig, plugin: Prepared, keys: &[&str]) -> bool {
        let name = &config.name;
        let Some(link) = self.links.get_mut(name) else { return false };
        let is_small = link.next.is_none() && matches!(link.lane, Lane::Open(_));
        if is_small && keys.iter().all(|key| AT_ONCE.contains(key)) {
            link.config = config.clone();
            return false;
        }
        if is_small && keys.iter().all(|key| AT_ONCE.contains(key) || BY_SWAP.contains(key)) {
            let wanted = WantedSwap {
                successor: plugin.clone(),
                when: SwapWhen::NowOrIdle,
                probation: None,
                waits: None,
                configured: Some(config.plugin.clone()),
            };
            if self.order_swap(name, wanted).is_ok() {
                let Some(link) = self.links.get_mut(name) else { return false };
                link.config = config.clone();
                return link.has_change_waiting();
            }
        }
        let Some(link) = self.links.get_mut(name) else { return false };
        link.next = Some(Box::new((config.clone(), plugin)));
        self.tend_change(name);
        self.links.get(name).is_some_and(|link| matches!(link.lane, Lane::Open(_)))
    }

    /// Makes a link anew whose configuration has changed, once it is idle.
    pub(super) fn tend_change(&mut self, name: &str) {
        let Some(link) = self.links.get(name) else { return };
        if link.next.is_some() && matches!(link.lane, Lane::Open(_)) && !link.is_busy() {
            self.close(name, After::Remake);
        }
    }

    pub(super) fn tend_changes(&mut self) {
        let waiting: Vec<String> = self
            .links
            .iter()
            .filter(|(_, link)| link.next.is_some())
            .map(|(name, _)| name.clone())
            .collect();
        for name in waiting {
            self.tend_change(&name);
        }
    }

    /// Keys that cannot change while the gateway runs.
    fn fixed(&self, config: &Config) -> Vec<String> {
        let (old, new) = (&self.config.gateway, &config.gateway);
        let keys = [
            ("gateway.state", old.state == new.state),
            ("gateway.library", old.library == new.library),
            ("gateway.programs", old.programs == new.programs),
            ("gateway.receptions", old.receptions == new.receptions),
            ("gateway.traces", old.traces == new.traces),
            ("gateway.threads", old.threads == new.threads),
            ("gateway.links-per-thread", old.links_per_thread == new.links_per_thread),
            ("gateway.real-time-priority", old.real_time_priority == new.real_time_priority),
            ("gateway.log", old.log == new.log),
            ("gateway.watch", old.watch == new.watch),
            ("gateway.journal", old.journal == new.journal),
            ("gateway.free-space", old.free_space == new.free_space),
            ("http", self.config.http == config.http),
        ];
        keys.into_iter().filter(|(_, same)| !same).map(|(key, _)| key.to_owned()).collect()
    }

    fn tell_reload(&self, view: &ReloadView) {
        let mut parts = Vec::new();
        let mut part = |what: &str, names: Vec<&str>| {
            if !names.is_empty() {
                parts.push(format!("{what} {}", names.join(", ")));
            }
        };
        part("added", view.added.iter().map(String::as_str).collect());
        part("removed", view.removed.iter().map(String::as_str).collect());
        part("changed", view.changed.iter().map(|link| link.name.as_str()).collect());
        part("cells:", view.cells.iter().map(String::as_str).collect());
        part("buses:", view.buses.iter().map(String::as_str).collect());
        part("only after a new start:", view.needs_restart.iter().map(String::as_str).collect());
        let text = if parts.is_empty() {
            "the configuration was read again; nothing changed".to_owned()
        } else {
            format!("the configuration was read again; {}", parts.join("; "))
        };
        self.shared.parts.journal_writer.note(Note::new(Subject::Gateway, text));
    }
}
