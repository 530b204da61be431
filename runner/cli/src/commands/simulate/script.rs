//! `softplug simulate script`.

use std::path::PathBuf;

use clap::Args;
use softplug_abi::Micros;
use softplug_conformance::{bad_kind, line_parameters, load};
use softplug_machines::Signal;
use softplug_machines::script::Line;
use softplug_trace::{
    Entry, Expected, Given, LineSettings, NoFiles, Payload, PayloadError, Piece, What,
};
use thiserror::Error;

use super::{Common, RunOptions};
use crate::failure::Failure;

/// A partner that plays a trace: it says what is received there, and expects what is sent.
///
/// Prints the path to connect to. Each line of the trace that begins with < is said once all lines
/// with > before it have come, as long behind them as it stands there. What the host asks for (?)
/// and what comes of it (=) is not the partner's matter. Ends with 1 if something else came than the
/// trace has, or not all of it.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug simulate script partner.spt
  softplug simulate script traces/my-machine/my-machine.tx.line.spt --once
  softplug simulate script partner.spt --listen 127.0.0.1:4001 --once --quiet-time 10")]
pub(super) struct Script {
    /// The trace to play
    #[arg(value_name = "TRACE")]
    trace: PathBuf,
    #[command(flatten)]
    common: Common,
}

/// A simulation that was checked.
pub(crate) struct ScriptSimulation {
    /// What the other side is to send, with the line of the trace that has it.
    pub(crate) expected: Vec<(u8, u32)>,
    pub(crate) lines: Vec<Line>,
    pub(crate) run: RunOptions,
}

impl Script {
    pub(super) fn prepare(self) -> Result<ScriptSimulation, Failure> {
        let cases = load([&self.trace]).map_err(Failure::usage)?;
        let [case] = &cases[..] else {
            return Err(Failure::usage(format_args!(
                "{} holds {} traces; name the one to play",
                self.trace.display(),
                cases.len()
            )));
        };
        if case.trace.alternatives().next().is_some() {
            return Err(Failure::usage(format_args!(
                "{} has alternatives, and a partner does one thing; write the one that is to be \
                 played into a file of its own",
                self.trace.display()
            )));
        }
        let mut script = Reading::new(&case.trace.front.line);
        for entry in case.trace.entries() {
            script.read(entry).map_err(|why| {
                Failure::usage(format_args!("{}:{}: {why}", self.trace.display(), entry.line.0))
            })?;
        }
        let Reading { expected, lines, .. } = script;
        if expected.is_empty() && lines.is_empty() {
            let file = self.trace.display();
            return Err(Failure::usage(format_args!("nothing passes on the line of {file}")));
        }
        let sends = !lines.is_empty();
        Ok(ScriptSimulation { expected, lines, run: self.common.run_options(sends)? })
    }
}

/// What of a trace a partner of bytes cannot do.
#[derive(Debug, Error)]
enum NotSimulated {
    #[error(transparent)]
    Payload(#[from] PayloadError),
    #[error("a partner of bytes alone has no breaks, modem lines and ports that go")]
    NoBytes,
}

/// A trace, as far as it was read.
struct Reading {
    expected: Vec<(u8, u32)>,
    lines: Vec<Line>,
    /// When the latest character was on the line.
    latest: Micros,
    character: Micros,
}

impl Reading {
    fn new(line: &LineSettings) -> Self {
        let character = line_parameters(line).characters(1);
        Self { expected: Vec::new(), lines: Vec::new(), latest: Micros::ZERO, character }
    }

    fn read(&mut self, entry: &Entry) -> Result<(), NotSimulated> {
        let at = Micros(i64::try_from(entry.when.from.0).unwrap_or(i64::MAX));
        match &entry.what {
            What::Given(Given::Receive(payload)) => self.says(at, Micros::ZERO, payload),
            What::Given(Given::Burst(payload)) => self.says(at, self.character, payload),
            What::Expected(Expected::Send(payload)) => {
                let bytes = payload.bytes(&NoFiles)?;
                let count = i64::try_from(bytes.len()).unwrap_or(i64::MAX);
                self.latest = at + Micros(self.character.0.saturating_mul(count));
                self.expected.extend(bytes.into_iter().map(|byte| (byte, entry.line.0)));
                Ok(())
            }
            What::Given(Given::Line(_))
            | What::Expected(Expected::SetLines(_) | Expected::SendBreak(_)) => {
                Err(NotSimulated::NoBytes)
            }
            What::Given(Given::Host(_) | Given::Exact(_)) | What::Expected(_) | What::Quiet => {
                Ok(())
            }
        }
    }

    fn says(&mut self, at: Micros, apart: Micros, payload: &Payload) -> Result<(), NotSimulated> {
        let pieces = payload.pieces(&NoFiles)?;
        let mut signals = Vec::new();
        for piece in pieces {
            match piece {
                Piece::Bytes(bytes) => signals.extend(bytes.into_iter().map(Signal::Character)),
                Piece::Bad { kind, byte } => {
                    signals.push(Signal::LineError { kind: bad_kind(kind), byte: Some(byte) });
                }
            }
        }
        let gap = Micros((at.0 - self.latest.0).max(0));
        let more = i64::try_from(signals.len()).unwrap_or(i64::MAX) - 1;
        self.latest = at + Micros(apart.0.saturating_mul(more.max(0)));
        self.lines.push(Line { behind: self.expected.len(), gap, apart, signals });
        Ok(())
    }
}
