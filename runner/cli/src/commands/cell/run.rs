//! `softplug cell …`

use softplug_live::plain_text;
use softplug_service::view::{CellChannelView, CellMode, CellView, ForceOrder, ModeOrder};

use super::{Arguments, GroupMode, Verb};
use crate::commands::remote::client::{Client, segment};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::screen::Screen;
use crate::table::Table;

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    let client = Client::new(&arguments.remote)?;
    let cell: CellView = match &arguments.verb {
        Verb::List => return list(&client, screen),
        Verb::Show(of) => client.get(&path(&of.cell, &[]))?,
        Verb::Clear(of) => client.post(&path(&of.cell, &["clear"]), None::<&()>)?,
        Verb::Release(of) => {
            client.post(&path(&of.cell, &["axes", &of.axis, "release"]), None::<&()>)?
        }
        Verb::Force(of) => {
            let order = ForceOrder { channel: of.channel.clone() };
            client.post(&path(&of.cell, &["axes", &of.axis, "force"]), Some(&order))?
        }
        Verb::Mode(of) => {
            let order = ModeOrder { mode: mode(of.mode) };
            client.post(&path(&of.cell, &["groups", &of.group, "mode"]), Some(&order))?
        }
    };
    tell(&cell, screen);
    screen.document(&cell);
    Ok(Exit::Done)
}

fn path(cell: &str, rest: &[&str]) -> String {
    let mut path = format!("/cells/{}", segment(cell));
    for part in rest {
        path.push('/');
        path.push_str(&segment(part));
    }
    path
}

fn list(client: &Client, screen: &Screen) -> Result<Exit, Failure> {
    let cells: Vec<CellView> = client.get("/cells")?;
    let mut table = Table::new(["cell", "channels", "runs", "waits", "stuck"]);
    for cell in &cells {
        let count = |of: &dyn Fn(&CellChannelView) -> bool| {
            cell.channels.iter().filter(|channel| of(channel)).count().to_string()
        };
        table.row([
            plain_text(&cell.name),
            cell.channels.len().to_string(),
            count(&|channel| channel.program.is_some()),
            count(&|channel| !channel.waits_for.is_empty()),
            match (cell.is_stopped, cell.stuck.len()) {
                (true, _) => "stopped".to_owned(),
                (false, 0) => String::new(),
                (false, stuck) => stuck.to_string(),
            },
        ]);
    }
    screen.say(table);
    screen.document(&cells);
    Ok(Exit::Done)
}

fn tell(cell: &CellView, screen: &Screen) {
    let mut channels = Table::new(["channel", "program", "does", "words", "loaded"]);
    for channel in &cell.channels {
        channels.row([
            plain_text(&channel.link),
            plain_text(channel.program.as_deref().unwrap_or_default()),
            does(channel),
            match channel.words {
                0 => String::new(),
                words => format!("{} of {words}", channel.words_passed),
            },
            plain_text(channel.loaded.as_deref().unwrap_or_default()),
        ]);
    }
    screen.say(channels);
    if !cell.axes.is_empty() {
        let mut axes = Table::new(["axis", "owner", "queue"]);
        for axis in &cell.axes {
            let owner = axis.owner.as_deref().unwrap_or("neutral");
            axes.row([
                plain_text(&axis.name),
                plain_text(owner),
                plain_text(&axis.queue.join(", ")),
            ]);
        }
        screen.say(axes);
    }
    let mut groups = Table::new(["group", "mode", "channels"]);
    for group in &cell.groups {
        let channels = plain_text(&group.channels.join(", "));
        groups.row([plain_text(&group.name), mode_name(group.mode).to_owned(), channels]);
    }
    screen.say(groups);
    for stuck in &cell.stuck {
        let what = if stuck.is_deadlock { "deadlock" } else { "nobody comes" };
        screen.say(format_args!("{what}: {}", plain_text(&stuck.text)));
    }
    if cell.is_stopped {
        screen.say("stopped: look at the machines, then `softplug cell clear`");
    }
}

fn does(channel: &CellChannelView) -> String {
    use softplug_service::view::CellChannelState as State;
    match channel.state {
        State::Idle => "nothing".to_owned(),
        State::Runs => "runs".to_owned(),
        State::Waits => plain_text(&channel.text),
        State::Stands => format!("stands: {}", plain_text(&channel.text)),
    }
}

fn mode(mode: GroupMode) -> CellMode {
    match mode {
        GroupMode::Auto => CellMode::Auto,
        GroupMode::JogInAuto => CellMode::JogInAuto,
        GroupMode::Mda => CellMode::Mda,
        GroupMode::Jog => CellMode::Jog,
    }
}

fn mode_name(mode: CellMode) -> &'static str {
    match mode {
        CellMode::Auto => "AUTO",
        CellMode::JogInAuto => "JOG in AUTO",
        CellMode::Mda => "MDA",
        CellMode::Jog => "JOG",
    }
}
