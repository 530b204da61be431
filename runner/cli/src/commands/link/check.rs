//! `softplug link check`

use softplug_live::plain_text;
use softplug_service::view::{AlteredView, CheckResult, CheckView};

use super::Check;
use crate::commands::remote::client::{Client, pairs, query, segment};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::numbers;
use crate::screen::Screen;
use crate::table::Table;

pub(super) fn check(client: &Client, of: &Check, screen: &Screen) -> Result<Exit, Failure> {
    let fields = serde_json::to_string(&pairs(&of.fields)).map_err(Failure::internal)?;
    let path = format!("/links/{}/check?program={}", segment(&of.link), segment(&of.program));
    let checked: CheckView = client.get_patiently(&query(&path, [("fields", Some(&*fields))]))?;
    tell(&plain_text(&of.program), &checked, screen);
    screen.document(&checked);
    let is_bad = match checked.result {
        CheckResult::Refused => true,
        CheckResult::Altered => of.strict,
        CheckResult::Passes => false,
    };
    Ok(if is_bad { Exit::Failed } else { Exit::Done })
}

fn tell(name: &str, checked: &CheckView, screen: &Screen) {
    let CheckView { result, plugin, line, different, characters, message, remark, .. } = checked;
    let on = format!("with {} on {}", plain_text(plugin), plain_text(line));
    let all = numbers::things(*different, "character");
    if *result == CheckResult::Passes {
        screen.say(format_args!("{name} passes as it is written {on}: {all} of its own"));
    } else if !characters.is_empty() {
        let count = characters.len();
        screen.say(format_args!("{name}: {count} of {all} do not pass as they are written {on}"));
        screen.say(table(characters));
    }
    if let Some(remark) = remark {
        screen.note(plain_text(remark));
    }
    if let Some(message) = message {
        screen.error(plain_text(message));
    }
}

fn table(characters: &[AlteredView]) -> Table {
    let mut table = Table::new(["character", "count", "first at", "what happens", "instead"]);
    for of in characters {
        table.row([
            plain_text(&of.character),
            numbers::count(of.count),
            format!("{}:{}", of.line, of.column),
            plain_text(&of.what),
            plain_text(of.instead.as_deref().unwrap_or_default()),
        ]);
    }
    table
}
