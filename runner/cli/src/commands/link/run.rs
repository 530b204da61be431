//! `softplug link …`

use std::path::Path;

use softplug_live::plain_text;
use softplug_service::view::{
    LinkView, PluginView, ReceptionView, Seen, SwapOrder, SwapState, SwapView, SwapWhen,
};

use super::check;
use super::{Arguments, Received, Swap, Verb, Watch, When};
use crate::assignment::Assignment;
use crate::commands::remote::Remote;
use crate::commands::remote::client::{Client, pairs, segment};
use crate::commands::remote::show;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::numbers;
use crate::screen::Screen;
use crate::table::Table;

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    let client = Client::new(&arguments.remote)?;
    match &arguments.verb {
        Verb::List => list(&client, screen),
        Verb::Show(of) => {
            let link: LinkView = client.get(&format!("/links/{}", segment(&of.link)))?;
            tell(&link, screen);
            Ok(Exit::Done)
        }
        Verb::Reopen(of) => order(&client, &of.link, "reopen", screen),
        Verb::ForceResume(of) => order(&client, &of.link, "force-resume", screen),
        Verb::Quarantine(of) => order(&client, &of.link, "quarantine", screen),
        Verb::Release(of) => order(&client, &of.link, "release", screen),
        Verb::Check(of) => check::check(&client, of, screen),
        Verb::Swap(of) => swap(&client, of, screen),
        Verb::Watch(of) => watch(&client, of, screen),
        Verb::Received(of) => received(&client, of, screen),
    }
}

fn list(client: &Client, screen: &Screen) -> Result<Exit, Failure> {
    let links: Vec<LinkView> = client.get("/links")?;
    let mut table = Table::new(["link", "state", "plug-in", "job", "buffer", "trouble"]);
    for link in &links {
        table.row([
            plain_text(&link.name),
            show::state(link),
            show::plugin(link.plugin.as_ref()),
            show::doing(link),
            numbers::count(link.buffer.level),
            show::trouble(link),
        ]);
    }
    screen.say(table);
    screen.document(&links);
    Ok(Exit::Done)
}

fn order(client: &Client, link: &str, verb: &str, screen: &Screen) -> Result<Exit, Failure> {
    let path = format!("/links/{}/{verb}", segment(link));
    let link: LinkView = client.post(&path, None::<&()>)?;
    screen.say(format_args!("{}: {}", plain_text(&link.name), show::state(&link)));
    screen.document(&link);
    Ok(Exit::Done)
}

fn tell(link: &LinkView, screen: &Screen) {
    let counters = &link.counters;
    let errors: u64 = counters.line_errors.values().sum();
    let buffer = &link.buffer;
    let number = numbers::count;
    let mut table = Table::new(["link", ""]);
    let rows = [
        ("name", plain_text(&link.name)),
        ("state", show::state(link)),
        (
            "port",
            plain_text(&format!("{} {} flow {}", link.port.spec, link.port.line, link.port.flow)),
        ),
        ("other side", plain_text(link.port.other_side.as_deref().unwrap_or_default())),
        ("plug-in", show::plugin(link.plugin.as_ref())),
        ("says", plain_text(link.condition.as_deref().unwrap_or_default())),
        ("job", show::doing(link)),
        ("drop", link.drop.as_ref().map(show::drop).unwrap_or_default()),
        ("trouble", show::trouble(link)),
        ("buffer", format!("{} of {} bytes", number(buffer.level), number(buffer.size))),
        ("received", format!("{} bytes, {} damaged", number(counters.bytes_in), number(errors))),
        ("sent", format!("{} bytes", number(counters.bytes_out))),
        ("held", format!("{} times, {:.1} s", counters.holds, counters.held_us as f64 / 1e6)),
        ("starved", format!("{} times", number(counters.starved))),
        ("restarts", number(counters.restarts)),
        ("last swap", link.swap.as_ref().map(show::swap).unwrap_or_default()),
    ];
    for (name, value) in rows {
        if !value.is_empty() {
            table.row([name.to_owned(), value]);
        }
    }
    screen.say(table);
    screen.document(link);
}

fn swap(client: &Client, of: &Swap, screen: &Screen) -> Result<Exit, Failure> {
    let when = match of.when {
        When::Now => SwapWhen::Now,
        When::Idle => SwapWhen::Idle,
        When::NowOrIdle => SwapWhen::NowOrIdle,
    };
    let swap = order_swap(client, &of.link, &of.plugin, &of.settings, when)?;
    screen.say(show::swap(&swap));
    screen.document(&swap);
    Ok(if is_refused(&swap) { Exit::Failed } else { Exit::Done })
}

/// Adds a module to the gateway's library and swaps it into a link; says what came of it.
pub(crate) fn swap_in(
    remote: &Remote,
    link: &str,
    plugin: &str,
    module: &[u8],
    settings: &[Assignment],
) -> Result<String, Failure> {
    let client = Client::new(remote)?;
    let _: PluginView = client.send("POST", "/plugins", module)?;
    let swap = order_swap(&client, link, plugin, settings, SwapWhen::NowOrIdle)?;
    let text = show::swap(&swap);
    if is_refused(&swap) { Err(Failure::new(Exit::Failed, text)) } else { Ok(text) }
}

fn order_swap(
    client: &Client,
    link: &str,
    plugin: &str,
    settings: &[Assignment],
    when: SwapWhen,
) -> Result<SwapView, Failure> {
    let settings = pairs(settings);
    let order = SwapOrder {
        plugin: plugin.to_owned(),
        settings: (!settings.is_empty()).then_some(settings),
        when,
        probation: None,
    };
    client.post(&format!("/links/{}/swap", segment(link)), Some(&order))
}

fn is_refused(swap: &SwapView) -> bool {
    match swap.state {
        SwapState::Refused | SwapState::Reverted => true,
        SwapState::Ordered | SwapState::Waiting | SwapState::Probation | SwapState::Done => false,
    }
}

fn watch(client: &Client, of: &Watch, screen: &Screen) -> Result<Exit, Failure> {
    let mut left = of.count.unwrap_or(u64::MAX);
    client.events(&format!("/links/{}/watch", segment(&of.link)), |name, data| {
        if name != "seen" {
            return Ok(true);
        }
        let list: Vec<Seen> = serde_json::from_str(data).map_err(|error| {
            Failure::new(Exit::Port, format_args!("the gateway sent something else: {error}"))
        })?;
        for seen in list.iter().take(usize::try_from(left).unwrap_or(usize::MAX)) {
            if seen.dropped > 0 {
                screen.note(format_args!("{} not shown", numbers::count(seen.dropped)));
            }
            screen.say(show::seen(seen));
            screen.json_line(seen);
            left -= 1;
        }
        Ok(left > 0)
    })?;
    Ok(Exit::Done)
}

fn received(client: &Client, of: &Received, screen: &Screen) -> Result<Exit, Failure> {
    let path = format!("/links/{}/receptions", segment(&of.link));
    if let Some(file) = &of.file {
        let out = of.out.clone().unwrap_or_else(|| Path::new(file).to_owned());
        if of.out.is_none() && out.components().count() != 1 {
            return Err(Failure::usage(format_args!("\"{}\" is no file's name", plain_text(file))));
        }
        let kept = client.fetch(&format!("{path}/{}", segment(file)), &out, of.force)?;
        screen.say(format_args!("{}", kept.display()));
        return Ok(Exit::Done);
    }
    let receptions: Vec<ReceptionView> = client.get(&path)?;
    let mut table = Table::new(["file", "bytes", "compared", "failure"]);
    for of in &receptions {
        let compared = of.compared.as_ref().map_or("", |compared| {
            if compared.is_same { "same as sent" } else { "differs from what was sent" }
        });
        table.row([
            plain_text(&of.file),
            numbers::count(of.bytes),
            compared.to_owned(),
            plain_text(of.failure.as_deref().unwrap_or_default()),
        ]);
    }
    screen.say(table);
    screen.document(&receptions);
    Ok(Exit::Done)
}
