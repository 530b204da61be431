//! News as server-sent events.

use std::convert::Infallible;
use std::sync::mpsc::{Receiver, TryRecvError};

use axum::response::sse::{Event, KeepAlive, Sse};
use serde::Serialize;
use tokio::sync::{OwnedSemaphorePermit, mpsc, watch};
use tokio::time::{MissedTickBehavior, interval};
use tokio_stream::wrappers::ReceiverStream;

use super::options::{GATHER, HEARTBEAT};

/// Most news in one event.
const BATCH: usize = 256;
/// Events that wait for a slow client; more wait at their source, where they are counted.
const WAITING: usize = 4;

/// The answer to whoever listens.
pub(super) type Stream = Sse<axum::response::sse::KeepAliveStream<ReceiverStream<News>>>;

/// What such an answer is made of.
pub(super) type News = Result<Event, Infallible>;

/// Tells on what comes: lists of news, gathered for a short while, as JSON.
///
/// Ends when the source does, when the client is gone, or when the gateway stops.
pub(super) fn of<T>(
    source: Receiver<T>,
    name: &'static str,
    mut stopping: watch::Receiver<bool>,
    permit: OwnedSemaphorePermit,
) -> Stream
where
    T: Serialize + Send + 'static,
{
    let (sender, receiver) = mpsc::channel(WAITING);
    tokio::spawn(async move {
        let _permit = permit;
        let mut ticks = interval(GATHER);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                _ = ticks.tick() => {}
                () = sender.closed() => return,
                _ = stopping.wait_for(|stop| *stop) => return,
            }
            let mut batch = Vec::new();
            let over = loop {
                match source.try_recv() {
                    Ok(news) => batch.push(news),
                    Err(end) => break end == TryRecvError::Disconnected,
                }
                if batch.len() == BATCH {
                    break false;
                }
            };
            if !batch.is_empty() {
                let Ok(event) = Event::default().event(name).json_data(&batch) else { return };
                if sender.send(Ok(event)).await.is_err() {
                    return;
                }
            }
            if over {
                return;
            }
        }
    });
    Sse::new(ReceiverStream::new(receiver)).keep_alive(KeepAlive::new().interval(HEARTBEAT))
}
