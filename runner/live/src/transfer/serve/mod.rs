//! Serves a station: takes every delivery, answers requests, and sends the
//! programs that machines ask for.

mod handler;
mod host;

pub use handler::{Delivered, JobReport, News, Program, Reply, Request, ServeHandler};

use softplug_abi::Instance;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use self::host::ServeHost;
use super::{Progress, Quiet, TICK, TransferError, duration};
use crate::station::{Station, Turn};

/// When to stop serving.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub struct ServeOptions {
    /// When nothing has happened for so long, no character came, and nothing is under way.
    pub give_up_after: Option<Duration>,
    /// After so many deliveries.
    pub deliveries: Option<u64>,
}

/// Why serving ended.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum ServeEnd {
    /// It was asked to.
    Stopped,
    /// Nothing has happened for as long as was given.
    Idle,
    /// So many deliveries as were asked for.
    Enough,
    /// The port is gone.
    Gone,
}

/// What came of serving.
#[derive(Clone, Debug)]
pub struct ServeReport {
    /// Why it ended.
    pub end: ServeEnd,
    /// Complete deliveries.
    pub complete: u64,
    /// Failed ones.
    pub failed: u64,
    /// Deliveries and programs that count as failed, or as not sent, only because serving ended.
    pub aborted: u64,
    /// Programs that were asked for and sent as a whole.
    pub sent: u64,
    /// Programs that were not, although no other took their place.
    pub not_sent: u64,
    /// Requests that were refused.
    pub refused: u64,
    /// Bytes that the port brought, whatever they were.
    pub heard: u64,
}

/// Serves until `stop`, or as `options` say. What is under way at the end is
/// aborted, and told as such.
///
/// A program that is asked for while another is under way takes its place if nothing of that has left
/// (the operator has chosen again before the machine started to read); otherwise it is
/// refused as busy.
///
/// Where the handler fails, serving ends, and what the plug-in said behind that does not leave:
/// nothing is acknowledged that is nowhere.
///
/// # Errors
/// The port, the plug-in or the handler failed.
pub fn serve<I: Instance>(
    station: &mut Station<I>,
    handler: &mut impl ServeHandler,
    options: &ServeOptions,
    stop: &AtomicBool,
    progress: &mut dyn FnMut(&Progress<'_>),
) -> Result<ServeReport, TransferError<I::Fault>> {
    let mut host = ServeHost::new(handler, station.brake());
    station.open(&mut host)?;
    let mut silence = Quiet::new(station.now());
    let end = loop {
        let now = station.now();
        if stop.load(Ordering::Relaxed) || host.has_failed() {
            break ServeEnd::Stopped;
        }
        if options.deliveries.is_some_and(|most| host.deliveries() >= most) {
            break ServeEnd::Enough;
        }
        let quiet = duration(now - host.moved_at().max(silence.since(station)));
        if host.is_idle() && options.give_up_after.is_some_and(|most| quiet >= most) {
            break ServeEnd::Idle;
        }
        let counters = station.counters();
        progress(&Progress {
            bytes: host.moved(station.link().waiting() as u64),
            total: host.total(),
            elapsed: duration(host.elapsed(now)),
            held: duration(counters.held),
            is_held: counters.is_held(),
            state: host.state(),
        });
        let turn = station.turns(now + TICK, &mut host, ServeHost::has_work)?;
        host.attend(station)?;
        if let Turn::Gone(reason) = turn {
            tracing::debug!(%reason, "the port is gone");
            break ServeEnd::Gone;
        }
    };
    let heard = station.counters().bytes_in;
    host.wind_up(station)?;
    host.report(end, heard).map_err(TransferError::Sink)
}
