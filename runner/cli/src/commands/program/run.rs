//! `softplug program …`

use std::fs::File;
use std::path::Path;

use softplug_live::plain_text;
use softplug_service::view::ProgramView;

use super::{Arguments, Download, Upload, Verb};
use crate::commands::remote::client::{Client, segment};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::screen::Screen;
use crate::table::Table;
use crate::{files, numbers};

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    let client = Client::new(&arguments.remote)?;
    match &arguments.verb {
        Verb::List => list(&client, screen),
        Verb::Upload(of) => upload(&client, of, screen),
        Verb::Download(of) => download(&client, of, screen),
        Verb::Delete(of) => {
            client.delete(&format!("/programs/{}", segment(&of.name)))?;
            screen.say(format_args!("deleted {}", plain_text(&of.name)));
            Ok(Exit::Done)
        }
    }
}

fn list(client: &Client, screen: &Screen) -> Result<Exit, Failure> {
    let programs: Vec<ProgramView> = client.get("/programs")?;
    let mut table = Table::new(["program", "bytes"]);
    for program in &programs {
        table.row([plain_text(&program.name), numbers::count(program.bytes)]);
    }
    screen.say(table);
    screen.document(&programs);
    Ok(Exit::Done)
}

fn upload(client: &Client, of: &Upload, screen: &Screen) -> Result<Exit, Failure> {
    let mut stored: Vec<ProgramView> = Vec::new();
    for path in &of.files {
        let name = path.file_name().and_then(|name| name.to_str()).ok_or_else(|| {
            Failure::usage(format_args!("{} has no name that can be sent", path.display()))
        })?;
        let name = match &of.folder {
            Some(folder) => format!("{folder}/{name}"),
            None => name.to_owned(),
        };
        let file = File::open(path).map_err(|error| files::unreadable(path, &error))?;
        let to = format!("/programs/{}?overwrite={}", segment(&name), of.overwrite);
        let program: ProgramView = client.send("PUT", &to, file)?;
        let bytes = numbers::count(program.bytes);
        screen.say(format_args!("{}: {bytes} bytes", plain_text(&program.name)));
        stored.push(program);
    }
    screen.document(&stored);
    Ok(Exit::Done)
}

fn download(client: &Client, of: &Download, screen: &Screen) -> Result<Exit, Failure> {
    let own = || Path::new(of.name.rsplit('/').next().unwrap_or(&of.name)).to_owned();
    let out = of.out.clone().unwrap_or_else(own);
    let kept = client.fetch(&format!("/programs/{}", segment(&of.name)), &out, of.force)?;
    screen.say(kept.display());
    Ok(Exit::Done)
}
