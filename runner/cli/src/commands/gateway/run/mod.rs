//! `softplug gateway run`, `check` and `token`.

mod takeover;

use std::path::Path;
use std::process;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::thread;
use std::time::Duration;

use serde::Serialize;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR2};
use signal_hook::iterator::Signals;
use softplug_live::PortError;
use softplug_service::config::{Config, ConfigError, ConfigFinding, FileWatch, LogFormat};
use softplug_service::gateway::{self, Gateway, StartError};
use softplug_service::http::{self, Role, ServeError};
use softplug_service::view::StopHow;
use softplug_service::{logs, systemd};

use crate::commands::gateway::{Arguments, Role as AskedRole, Token, Verb};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::global::Global;
use crate::numbers;
use crate::screen::{self, Screen};

/// How long requests may take that are under way at the end.
const GRACE: Duration = Duration::from_secs(5);

/// The first line for machines.
#[derive(Serialize)]
struct Ready<'a> {
    event: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    address: Option<String>,
    links: Vec<&'a str>,
}

/// What `check` says to machines.
#[derive(Serialize)]
struct Checked<'a> {
    result: &'static str,
    links: usize,
    problems: &'a [ConfigFinding],
    /// What works and may be meant otherwise.
    remarks: &'a [ConfigFinding],
}

pub(crate) fn run(
    arguments: &Arguments,
    global: &Global,
    screen: &Screen,
) -> Result<Exit, Failure> {
    match &arguments.verb {
        Verb::Run(configured) => serve(&configured.file, global, screen),
        Verb::Check(configured) => check(&configured.file, screen),
        Verb::Token(asked) => token(asked, screen),
    }
}

fn check(file: &Path, screen: &Screen) -> Result<Exit, Failure> {
    let checked = Config::read(file).map_err(StartError::from).and_then(|config| {
        let remarks = gateway::check(&config)?;
        Ok((config, remarks))
    });
    let (config, remarks) = match checked {
        Ok(checked) => checked,
        Err(error) => return wrong(error, screen),
    };
    let links = config.links.len();
    screen.document(&Checked { result: "right", links, problems: &[], remarks: &remarks });
    for remark in &remarks {
        screen.note(format_args!("note: {remark}"));
    }
    screen.say(format_args!(
        "{} is right: {}",
        file.display(),
        numbers::things(links as u64, "link")
    ));
    Ok(Exit::Done)
}

/// Says all that is wrong with a configuration; anything else is a failure.
fn wrong(error: StartError, screen: &Screen) -> Result<Exit, Failure> {
    match error {
        StartError::Config(ConfigError::Wrong(problems)) => {
            screen.document(&Checked {
                result: "wrong",
                links: 0,
                problems: &problems,
                remarks: &[],
            });
            for ConfigFinding { place, message, hint } in &problems {
                let failure = Failure::usage(format_args!("{place}: {message}")).hint(hint);
                screen.report_failure(&failure);
            }
            Ok(Exit::Usage)
        }
        error => Err(start_failure(&error)),
    }
}

fn start_failure(error: &StartError) -> Failure {
    match error {
        StartError::Config(_)
        | StartError::Disk(_)
        | StartError::Library(_)
        | StartError::Jobs(_)
        | StartError::Reactor(PortError::RealTime { .. }) => Failure::usage(error),
        StartError::Host(_) => Failure::plug_in(error),
        StartError::Reactor(_) => Failure::new(Exit::Port, error),
        StartError::Thread(_) => Failure::internal(error),
    }
}

fn serve_failure(error: &ServeError) -> Failure {
    match error {
        ServeError::Listen { .. } => Failure::new(Exit::Port, error),
        ServeError::Tokens(_) | ServeError::Certificate(_) => Failure::usage(error),
        ServeError::Thread(_) => Failure::internal(error),
    }
}

fn serve(file: &Path, global: &Global, screen: &Screen) -> Result<Exit, Failure> {
    let config = match Config::read(file) {
        Ok(config) => config,
        Err(error) => return wrong(error.into(), screen),
    };
    let format = if screen.is_json() { LogFormat::Json } else { config.gateway.log };
    logs::start(format, &screen::log_filter(global, "info"), screen::log_colours(global));
    // Before the first thread: a signal that comes early is not lost.
    let signals = Signals::new([SIGTERM, SIGINT, SIGHUP, SIGUSR2]).map_err(|error| {
        Failure::internal(format_args!("failed to listen for signals: {error}"))
    })?;
    // By its name now: a new command takes the old one's place under it.
    let executable = std::env::current_exe();
    let options = config.http.clone();
    let (how, watches) = (config.gateway.stop, config.gateway.watch);
    let names: Vec<String> = config.links.iter().map(|link| link.name.clone()).collect();
    let running = match gateway::start(config) {
        Ok(running) => running,
        Err(error) => return wrong(error, screen),
    };
    let handle = running.gateway().clone();
    let server = match options.map(|options| http::serve(handle.clone(), &options)).transpose() {
        Ok(server) => server,
        Err(error) => {
            handle.stop(StopHow::Park);
            running.wait();
            return Err(serve_failure(&error));
        }
    };
    let address = server.as_ref().map(|server| server.address().to_string());
    say_ready(address, &names, screen);
    let is_replaced = Arc::new(AtomicBool::new(false));
    heed(signals, handle.clone(), how, Arc::clone(&is_replaced));
    let _watch = watches.then(|| watch(file, handle.clone())).flatten();
    systemd::watchdog(handle.clone());
    systemd::ready(&numbers::things(names.len() as u64, "link"));
    takeover::let_go(handle.clone());
    drop(handle);
    running.wait_for_stop();
    let kept = running.kept();
    if let Some(server) = server {
        server.stop(GRACE);
    }
    let lost = running.lost();
    running.wait();
    if lost > 0 {
        let text = format_args!(
            "stopped; {lost} bytes that machines had sent are lost: they could not be put away"
        );
        let hint =
            "softplug journal --at-least alarm says what of which link, once the gateway runs";
        return Err(Failure::new(Exit::Incomplete, text).hint(hint));
    }
    if is_replaced.load(Ordering::Relaxed) {
        let error = match executable {
            Ok(executable) => takeover::replace(&executable, &kept),
            Err(error) => error,
        };
        let text = format_args!("the new gateway cannot be started: {error}");
        return Err(Failure::internal(text));
    }
    screen.say("stopped");
    Ok(Exit::Done)
}

fn say_ready(address: Option<String>, names: &[String], screen: &Screen) {
    let links = numbers::things(names.len() as u64, "link");
    match &address {
        Some(address) => screen.say(format_args!("{links}; the API and the page are at {address}")),
        None => screen.say(format_args!("{links}; no API, the configuration has no [http]")),
    }
    let links = names.iter().map(String::as_str).collect();
    screen.json_line(&Ready { event: "ready", address, links });
}

/// Does what signals ask for, on a thread of its own.
fn heed(mut signals: Signals, gateway: Gateway, how: StopHow, is_replaced: Arc<AtomicBool>) {
    // Reading again may take seconds, if there is something to compile: a stop does not wait for it.
    let (again, wanted) = channel();
    let to_reload = gateway.clone();
    let reloading = move || {
        while wanted.recv().is_ok() {
            while wanted.try_recv().is_ok() {}
            reload(&to_reload);
        }
    };
    if let Err(error) = thread::Builder::new().name("reload".to_owned()).spawn(reloading) {
        tracing::error!(%error, "SIGHUP is not heeded");
    }
    let heeding = move || {
        let mut stops = 0;
        for signal in signals.forever() {
            if signal == SIGHUP {
                // Nobody reloads only if there was no thread, which was told.
                let _ = again.send(());
                continue;
            }
            if signal == SIGUSR2 {
                match gateway.make_way() {
                    Ok(()) => is_replaced.store(true, Ordering::Relaxed),
                    Err(refusal) => tracing::error!("{refusal}"),
                }
                continue;
            }
            // Nobody takes its place.
            is_replaced.store(false, Ordering::Relaxed);
            stops += 1;
            match (stops, how) {
                (1, how) => {
                    systemd::stopping();
                    gateway.stop(how);
                }
                // What jobs are finished for, and then what cannot be put away, is given up in turn.
                (2, _) | (3, StopHow::Finish) => gateway.stop(StopHow::Park),
                _ => process::exit(Exit::Incomplete.code().into()),
            }
        }
    };
    if let Err(error) = thread::Builder::new().name("signals".to_owned()).spawn(heeding) {
        tracing::error!(%error, "signals are not heeded");
    }
}

fn reload(gateway: &Gateway) {
    systemd::reloading();
    if let Err(refusal) = gateway.reload() {
        tracing::error!("the configuration is not taken, all goes on as before: {refusal}");
    }
    let links = gateway.health().links.all;
    systemd::ready(&numbers::things(links.into(), "link"));
}

fn watch(file: &Path, gateway: Gateway) -> Option<FileWatch> {
    let started = FileWatch::start(file, move || reload(&gateway));
    started.map_err(|error| tracing::warn!(%error, "the configuration is not watched")).ok()
}

fn token(asked: &Token, screen: &Screen) -> Result<Exit, Failure> {
    #[derive(Serialize)]
    struct Made<'a> {
        token: &'a str,
        entry: &'a http::Entry,
    }
    let role = match asked.role {
        AskedRole::Viewer => Role::Viewer,
        AskedRole::Operator => Role::Operator,
        AskedRole::Admin => Role::Admin,
    };
    let (token, entry) = http::new_token(&asked.name, role)
        .map_err(|error| Failure::internal(format_args!("no random bytes: {error}")))?;
    screen.document(&Made { token: &token, entry: &entry });
    screen.say(entry.text());
    if !screen.is_json() {
        screen.note(format_args!("the token, shown this once: {token}"));
    }
    Ok(Exit::Done)
}
