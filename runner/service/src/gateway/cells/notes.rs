//! What the journal says of a cell.

use softplug_cell::{Cell, Change};

use crate::jobs::{Note, Subject, Weight};

pub(super) fn notes(name: &str, cell: &Cell, changes: &[Change]) -> Vec<Note> {
    let setup = cell.setup();
    let told = changes.iter().filter_map(|change| {
        let (weight, channel) = match change {
            // Each follows from another.
            Change::Goes { .. } | Change::Stands { .. } => return None,
            Change::Deadlock { .. } => (Weight::Alarm, None),
            Change::NobodyComes { .. } | Change::Stopped => (Weight::Warning, None),
            Change::NotOwned { channel, .. } => (Weight::Warning, Some(channel)),
            Change::Waits { channel, .. }
            | Change::Began { channel, .. }
            | Change::Loaded { channel, .. }
            | Change::Unloaded { channel }
            | Change::Owned { channel, .. }
            | Change::Queued { channel, .. }
            | Change::Ended { channel, .. } => (Weight::Normal, Some(channel)),
            Change::Met { .. }
            | Change::Released { .. }
            | Change::Mode { .. }
            | Change::Cleared
            | Change::Free { .. } => (Weight::Normal, None),
        };
        let mut text = format!("{name}: {}", change.told(setup));
        if matches!(change, Change::Deadlock { .. } | Change::NobodyComes { .. }) {
            for stuck in cell.stuck() {
                text.push_str("; ");
                text.push_str(&stuck.text);
            }
        }
        let note = Note::new(Subject::Cell, text).weighing(weight);
        Some(match channel {
            Some(channel) => note.of_link(setup.channel_name(*channel)),
            None => note,
        })
    });
    told.collect()
}
