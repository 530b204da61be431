//! `softplug replay --step`: one run of a trace in the terminal, walked through
//! event by event, forward and back.

mod source;
mod view;
mod walk;

use std::io::{self, IsTerminal};

use ratatui::crossterm::event::{self, Event, KeyEventKind};
use softplug_conformance::{Case, Permutation, Stepper};

use self::walk::{Turn, Walk};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::plugin::Chosen;

/// Runs the case and shows it until it has been seen enough of; the exit code is that of the run.
pub(super) fn run(plugin: &Chosen, case: &Case, permutation: Permutation) -> Result<Exit, Failure> {
    if !io::stdout().is_terminal() || !io::stdin().is_terminal() {
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
            if let Event::Key(key) = event::read()?
                && key.kind != KeyEventKind::Release
                && walk.take(key) == Turn::End
            {
                return Ok(());
            }
        }
    })();
    let restored = ratatui::try_restore();
    shown.and(restored).map_err(|error: io::Error| {
        Failure::internal(format_args!("the terminal cannot be drawn on: {error}"))
    })?;
    Ok(exit)
}

fn stepper(plugin: &Chosen, case: &Case, permutation: Permutation) -> Result<Stepper, Failure> {
    let stepper = plugin.step_through(case, permutation);
    match &stepper.failure {
        // There is nothing to walk through.
        Some(failure) if stepper.moments.is_empty() => {
            Err(Failure::new(Exit::Failed, format_args!("the run did not begin\n{failure}")))
        }
        _ => Ok(stepper),
    }
}
