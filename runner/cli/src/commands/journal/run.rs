//! `softplug journal …`

use softplug_live::plain_text;
use softplug_service::view::{JournalEntry, JournalWeight, utc};

use super::Arguments;
use crate::commands::remote::client::{Client, query, times};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::screen::Screen;
use crate::table::Table;

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    let client = Client::new(&arguments.remote)?;
    let [since, until] = times(&arguments.within);
    let job = arguments.job.map(|job| job.to_string());
    let path = query(
        &format!("/journal?limit={}", arguments.limit),
        [
            ("link", arguments.link.as_deref()),
            ("kind", arguments.kind.as_deref()),
            ("at_least", arguments.at_least.as_deref()),
            ("job", job.as_deref()),
            ("find", arguments.find.as_deref()),
            ("since_ms", since.as_deref()),
            ("until_ms", until.as_deref()),
        ],
    );
    let mut entries: Vec<JournalEntry> = client.get(&path)?;
    entries.reverse();
    let mut table = Table::new(["time", "link", "job", "", "what"]);
    for entry in &entries {
        table.row([
            utc(entry.at_ms),
            plain_text(entry.link.as_deref().unwrap_or_default()),
            entry.job.map_or_else(String::new, |job| job.to_string()),
            match entry.weight {
                JournalWeight::Normal => "",
                JournalWeight::Warning => "warning",
                JournalWeight::Alarm => "ALARM",
            }
            .to_owned(),
            plain_text(&entry.text),
        ]);
    }
    screen.say(table);
    screen.document(&entries);
    Ok(Exit::Done)
}
