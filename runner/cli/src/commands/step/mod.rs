//! `softplug replay --step`: one run of a trace in the terminal, walked through
//! event by event, forward and back.

mod source;
mod view;
mod walk;

use std::io;
use std::time::Duration;

use crossterm::event::{self, Event, KeyEventKind};
#[cfg(target_os = "linux")]
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use softplug_conformance::{Case, Permutation, Stepper};

use self::walk::{Turn, Walk};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::plugin::Chosen;
use crate::screen::Screen;

/// How often it is looked whether there still is a terminal.
const LOOK_AGAIN: Duration = Duration::from_millis(500);

/// Runs the case and shows it until it has been seen enough of; the exit code is that of the run.
pub(super) fn run(
    plugin: &Chosen,
    case: &Case,
    permutation: &Permutation,
) -> Result<Exit, Failure> {
    if !Screen::is_attended() {
        return Err(Failure::usage("--step shows the run on a terminal, and here is none")
            .hint("leave --step out, or take --calls FILE for every call as JSON"));
    }
    let stepper = stepper(plugin, case, permutation)?;
    let exit = if stepper.failure.is_none() { Exit::Done } else { Exit::Failed };
    let title = format!("{}/{permutation}  {}", case.trace.front.id, plugin.manifest().name);
    let mut walk = Walk::new(stepper, title, source::near(std::env::current_dir().ok()));
    let shown = (|| {
        let mut terminal = ratatui::try_init()?;
        loop {
            terminal.draw(|frame| view::draw(frame, &walk))?;
            if let Event::Key(key) = next_event()?
                && key.kind != KeyEventKind::Release
                && walk.take(key) == Turn::End
            {
                return Ok(());
            }
        }
    })();
    let restored = ratatui::try_restore();
    shown.and(restored).map_err(|error: io::Error| {
        if is_gone() {
            Failure::new(Exit::Incomplete, "the terminal is gone")
        } else {
            Failure::internal(format_args!("the terminal cannot be drawn on: {error}"))
        }
    })?;
    Ok(exit)
}

/// Waits for a key or another size. A terminal that has gone is an error: crossterm
/// takes it for one where nothing was typed yet.
fn next_event() -> io::Result<Event> {
    loop {
        if event::poll(LOOK_AGAIN)? {
            return event::read();
        }
        if is_gone() {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
    }
}

#[cfg(target_os = "linux")]
fn is_gone() -> bool {
    let stdin = io::stdin();
    let mut stdin = [PollFd::new(&stdin, PollFlags::IN)];
    let at_once = Timespec { tv_sec: 0, tv_nsec: 0 };
    poll(&mut stdin, Some(&at_once)).is_ok() && stdin[0].revents().contains(PollFlags::HUP)
}

/// A console that goes ends the process by itself.
#[cfg(not(target_os = "linux"))]
fn is_gone() -> bool {
    false
}

fn stepper(plugin: &Chosen, case: &Case, permutation: &Permutation) -> Result<Stepper, Failure> {
    let stepper = plugin.step_through(case, permutation);
    match &stepper.failure {
        // There is nothing to walk through.
        Some(failure) if stepper.moments.is_empty() => {
            Err(Failure::new(Exit::Failed, format_args!("the run did not begin\n{failure}")))
        }
        _ => Ok(stepper),
    }
}
