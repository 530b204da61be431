//! News as server-sent events.

use std::convert::Infallible;
use std::time::Duration;

use axum::response::sse::{Event, KeepAlive, KeepAliveStream, Sse};
use serde::Serialize;
use tokio::sync::{OwnedSemaphorePermit, mpsc, watch};
use tokio::time::{Instant, MissedTickBehavior, interval};
use tokio_stream::wrappers::ReceiverStream;

use super::limits::HEARTBEAT;

/// Most news at one look.
const BATCH: usize = 4_096;
/// Events that wait for a slow client; more wait at their source, where they are counted.
const WAITING: usize = 4;

/// The answer to whoever listens.
pub(super) type Stream = Sse<KeepAliveStream<ReceiverStream<Result<Event, Infallible>>>>;

/// What a look at a source brought.
#[derive(Debug)]
pub(super) enum Polled<T> {
    /// The next of its news.
    News(T),
    /// So many were dropped, because they were not taken in time.
    Missed(u64),
    /// None at the moment.
    Nothing,
    /// None ever again.
    End,
}

/// How news are told.
#[derive(Debug)]
pub(super) struct Telling<T> {
    /// Name of the events, each a list of news.
    pub(super) name: &'static str,
    /// News are looked for as often.
    pub(super) gather: Duration,
    /// They are told as often at most: what is superfluous by then is left out.
    pub(super) apart: Duration,
    /// Takes out of a list what later news in it make superfluous.
    pub(super) thin: fn(Vec<T>) -> Vec<T>,
}

/// Tells on what a source brings, until it ends, the client is gone, or the gateway stops.
///
/// The source is looked at without waiting.
pub(super) fn of<T>(
    mut source: impl FnMut() -> Polled<T> + Send + 'static,
    telling: Telling<T>,
    mut stopping: watch::Receiver<bool>,
    permit: OwnedSemaphorePermit,
) -> Stream
where
    T: Serialize + Send + 'static,
{
    let (sender, receiver) = mpsc::channel(WAITING);
    tokio::spawn(async move {
        let _permit = permit;
        let mut ticks = interval(telling.gather);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut waiting: Vec<T> = Vec::new();
        let mut next = Instant::now();
        loop {
            tokio::select! {
                _ = ticks.tick() => {}
                () = sender.closed() => return,
                _ = stopping.wait_for(|stop| *stop) => return,
            }
            let gathered = gather(&mut source);
            let ended = gathered.ended;
            waiting.extend(gathered.news);
            let is_time = ended || Instant::now() >= next;
            let news = if is_time { std::mem::take(&mut waiting) } else { Vec::new() };
            if is_time {
                next = Instant::now() + telling.apart;
            } else if waiting.len() > BATCH {
                waiting = (telling.thin)(waiting);
            }
            for event in events(&telling, gathered.missed, news) {
                if sender.send(Ok(event)).await.is_err() {
                    return;
                }
            }
            if ended {
                return;
            }
        }
    });
    Sse::new(ReceiverStream::new(receiver)).keep_alive(KeepAlive::new().interval(HEARTBEAT))
}

struct Gathered<T> {
    news: Vec<T>,
    missed: u64,
    ended: bool,
}

fn gather<T>(source: &mut impl FnMut() -> Polled<T>) -> Gathered<T> {
    let mut gathered = Gathered { news: Vec::new(), missed: 0, ended: false };
    while gathered.news.len() < BATCH {
        match source() {
            Polled::News(news) => gathered.news.push(news),
            Polled::Missed(count) => gathered.missed += count,
            Polled::Nothing => break,
            Polled::End => {
                gathered.ended = true;
                break;
            }
        }
    }
    gathered
}

fn events<T: Serialize>(telling: &Telling<T>, missed: u64, news: Vec<T>) -> Vec<Event> {
    let mut events = Vec::new();
    if missed > 0 {
        events.push(Event::default().event("missed").data(missed.to_string()));
    }
    let news = (telling.thin)(news);
    if !news.is_empty() {
        // Views are plain data, which is always JSON.
        events.extend(Event::default().event(telling.name).json_data(news).ok());
    }
    events
}
