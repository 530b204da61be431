//! `gateway.toml` as it is written: names and types of its keys.

use std::collections::BTreeMap;

use serde::Deserialize;
use toml::{Spanned, Value};

pub(super) type Text = Spanned<String>;
type Texts = Spanned<Vec<Text>>;

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub(super) struct File {
    pub(super) gateway: Gateway,
    pub(super) http: Option<Spanned<Http>>,
    pub(super) supervision: Supervision,
    pub(super) bus: Vec<Spanned<Bus>>,
    pub(super) cell: Vec<Spanned<Cell>>,
    /// What links have in common.
    pub(super) defaults: Link,
    pub(super) link: Vec<Spanned<Link>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub(super) struct Gateway {
    pub(super) state: Option<Text>,
    pub(super) library: Option<Text>,
    pub(super) programs: Option<Vec<Text>>,
    pub(super) receptions: Option<Text>,
    pub(super) traces: Option<Text>,
    pub(super) threads: Option<Spanned<u16>>,
    pub(super) links_per_thread: Option<Spanned<u16>>,
    pub(super) real_time_priority: Option<Spanned<u8>>,
    pub(super) log: Option<Text>,
    pub(super) stop: Option<Text>,
    pub(super) stop_patience: Option<Text>,
    pub(super) watch: Option<bool>,
    pub(super) machines: Option<Text>,
    pub(super) journal: Option<Spanned<u64>>,
    pub(super) free_space: Option<Spanned<Value>>,
    pub(super) key: Option<Text>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub(super) struct Http {
    pub(super) listen: Option<Text>,
    pub(super) tokens: Option<Text>,
    pub(super) certificate: Option<Text>,
    pub(super) key: Option<Text>,
    pub(super) plain: Option<bool>,
    pub(super) names: Option<Vec<Text>>,
    pub(super) upload_bytes: Option<Spanned<Value>>,
    pub(super) connections: Option<Spanned<u32>>,
    pub(super) requests_per_second: Option<Spanned<u32>>,
    pub(super) burst: Option<Spanned<u32>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub(super) struct Supervision {
    pub(super) first_delay: Option<Text>,
    pub(super) longest_delay: Option<Text>,
    pub(super) faults: Option<Spanned<u32>>,
    pub(super) within: Option<Text>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub(super) struct Bus {
    pub(super) name: Option<Text>,
    pub(super) rate: Option<Spanned<Value>>,
    pub(super) efficiency: Option<Spanned<Value>>,
    pub(super) switch: Option<Text>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub(super) struct Cell {
    pub(super) name: Option<Text>,
    pub(super) channels: Option<Texts>,
    pub(super) axes: Vec<Text>,
    pub(super) groups: BTreeMap<Text, Vec<Text>>,
    pub(super) words: Option<Text>,
    pub(super) notations: BTreeMap<Text, Text>,
    pub(super) after_crash: Option<Text>,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub(super) struct Link {
    pub(super) name: Option<Text>,
    pub(super) group: Option<Text>,
    pub(super) port: Option<Text>,
    pub(super) unit_key: Option<Text>,
    pub(super) bus: Option<Text>,
    pub(super) line: Option<Text>,
    pub(super) flow: Option<Text>,
    pub(super) exclusive: Option<bool>,
    pub(super) connect: Option<Text>,
    pub(super) reopen: Option<Reopen>,
    pub(super) machine: Option<Text>,
    pub(super) plugin: Option<Text>,
    pub(super) settings: Option<BTreeMap<Text, Spanned<Value>>>,
    pub(super) depth: Option<Spanned<u32>>,
    pub(super) transmit_room: Option<Spanned<Value>>,
    pub(super) delivery_room: Option<Spanned<Value>>,
    pub(super) search: Option<Texts>,
    pub(super) names: Option<Texts>,
    pub(super) receive: Option<Text>,
    pub(super) quota: Option<Spanned<Quota>>,
    pub(super) buffer: Option<Spanned<Buffer>>,
    pub(super) endpoint: Option<Spanned<Endpoint>>,
    pub(super) drop: Option<Spanned<Drop>>,
    pub(super) watchdog: Option<Watchdog>,
    pub(super) swap: Option<Text>,
    pub(super) probation: Option<Probation>,
    pub(super) recorder: Option<Spanned<Value>>,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub(super) struct Reopen {
    pub(super) first: Option<Text>,
    pub(super) longest: Option<Text>,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub(super) struct Quota {
    pub(super) reception: Option<Spanned<Value>>,
    pub(super) receptions: Option<Spanned<u64>>,
    pub(super) bytes: Option<Spanned<Value>>,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub(super) struct Buffer {
    pub(super) size: Option<Spanned<Value>>,
    pub(super) low: Option<Spanned<Value>>,
    pub(super) high: Option<Spanned<Value>>,
    pub(super) packet: Option<Spanned<Value>>,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub(super) struct Endpoint {
    pub(super) listen: Option<Text>,
    pub(super) kind: Option<Text>,
    pub(super) gather: Option<Text>,
    pub(super) gap: Option<Text>,
    pub(super) line: Option<Text>,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub(super) struct Drop {
    pub(super) folder: Option<Text>,
    pub(super) settle: Option<Text>,
    pub(super) look: Option<Text>,
    pub(super) largest: Option<Spanned<Value>>,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub(super) struct Watchdog {
    pub(super) no_bytes: Option<Text>,
    pub(super) no_progress: Option<Text>,
    pub(super) stuck_held: Option<Text>,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub(super) struct Probation {
    pub(super) span: Option<Text>,
    pub(super) events: Option<Spanned<u64>>,
}

impl Link {
    /// This link, with what it does not say taken from the defaults.
    pub(super) fn or(self, defaults: &Self) -> Self {
        let defaults = defaults.clone();
        let settings = match (defaults.settings, self.settings) {
            // Settings belong to a plug-in: another one has others.
            (Some(_), own) if self.plugin.is_some() => own,
            (Some(mut common), Some(own)) => {
                common.retain(|name, _| !own.keys().any(|own| is_alike(own, name)));
                common.extend(own);
                Some(common)
            }
            (common, own) => own.or(common),
        };
        Self {
            name: self.name,
            port: self.port,
            unit_key: self.unit_key,
            endpoint: self.endpoint,
            drop: self.drop,
            group: self.group.or(defaults.group),
            bus: self.bus.or(defaults.bus),
            line: self.line.or(defaults.line),
            flow: self.flow.or(defaults.flow),
            exclusive: self.exclusive.or(defaults.exclusive),
            connect: self.connect.or(defaults.connect),
            reopen: self.reopen.or(defaults.reopen),
            machine: self.machine.or(defaults.machine),
            plugin: self.plugin.or(defaults.plugin),
            settings,
            depth: self.depth.or(defaults.depth),
            transmit_room: self.transmit_room.or(defaults.transmit_room),
            delivery_room: self.delivery_room.or(defaults.delivery_room),
            search: self.search.or(defaults.search),
            names: self.names.or(defaults.names),
            receive: self.receive,
            quota: self.quota.or(defaults.quota),
            buffer: self.buffer.or(defaults.buffer),
            watchdog: self.watchdog.or(defaults.watchdog),
            swap: self.swap.or(defaults.swap),
            probation: self.probation.or(defaults.probation),
            recorder: self.recorder.or(defaults.recorder),
        }
    }
}

/// Whether two settings are one: hyphens stand for underscores.
fn is_alike(one: &Text, other: &Text) -> bool {
    let plain = |name: &Text| name.get_ref().replace('-', "_");
    plain(one) == plain(other)
}
