//! Looking at what passes on a line, by any number of people at one time.

use std::collections::HashMap;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::thread;
use std::time::Duration;

use data_encoding::HEXUPPER;
use softplug_abi::ModemLines;
use softplug_live::reactor::{Command, LaneId, Seen as LaneSeen, Watch, WatchEvent};

use super::{Control, Shared};
use crate::Refusal;
use crate::view::{Seen, SeenWhat};

/// Things seen that a watcher may fall behind.
const BEHIND: usize = 1_024;
/// How often it is looked whether anybody still watches.
const LOOK: Duration = Duration::from_millis(500);

/// What passes on a link's line. Dropping it ends the watch.
#[derive(Debug)]
pub struct Watching {
    seen: Receiver<Seen>,
    /// Tells by its end that nobody looks any more.
    _looks: Arc<()>,
}

/// What a wait for the next thing seen brought.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Next {
    /// Something was seen.
    Seen(Seen),
    /// Nothing in the time given.
    Nothing,
    /// The link is gone, or was made anew: watch again.
    End,
}

impl Watching {
    /// The next that is seen; waits for it at most so long.
    pub fn next(&mut self, patience: Duration) -> Next {
        match self.seen.recv_timeout(patience) {
            Ok(seen) => Next::Seen(seen),
            Err(RecvTimeoutError::Timeout) => Next::Nothing,
            Err(RecvTimeoutError::Disconnected) => Next::End,
        }
    }
}

/// Those who watch one lane.
#[derive(Clone, Debug, Default)]
pub(crate) struct Audience(Arc<Mutex<Vec<Watcher>>>);

#[derive(Debug)]
struct Watcher {
    to: SyncSender<Seen>,
    looks: Weak<()>,
    /// What it had no room for.
    dropped: u64,
}

impl Audience {
    fn watchers(&self) -> MutexGuard<'_, Vec<Watcher>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn admit(&self) -> Watching {
        let (to, seen) = sync_channel(BEHIND);
        let looks = Arc::new(());
        self.watchers().push(Watcher { to, looks: Arc::downgrade(&looks), dropped: 0 });
        Watching { seen, _looks: looks }
    }

    /// Shows it to all; whether anybody is there.
    fn show(&self, seen: &Seen) -> bool {
        let mut watchers = self.watchers();
        watchers.retain_mut(|watcher| {
            let seen = Seen { dropped: watcher.dropped, ..seen.clone() };
            match watcher.to.try_send(seen) {
                Ok(()) => watcher.dropped = 0,
                Err(TrySendError::Full(_)) => watcher.dropped += 1,
                Err(TrySendError::Disconnected(_)) => return false,
            }
            true
        });
        !watchers.is_empty()
    }

    fn is_empty(&self) -> bool {
        let mut watchers = self.watchers();
        watchers.retain(|watcher| watcher.looks.strong_count() > 0);
        watchers.is_empty()
    }
}

impl Control {
    /// Somebody wants to see what passes on a line.
    pub(super) fn watch(&mut self, name: &str) -> Result<Watching, Refusal> {
        let lane = self.link(name)?.lane_id();
        if let Some(audience) = self.audiences.get(&lane) {
            return Ok(audience.admit());
        }
        let audience = Audience::default();
        let watching = audience.admit();
        let (to, seen) = sync_channel(BEHIND);
        let (shared, showing) = (Arc::clone(&self.shared), audience.clone());
        thread::Builder::new()
            .name("softplug-watch".to_owned())
            .spawn(move || show(&shared, lane, &showing, &seen))
            .map_err(|error| Refusal::Unavailable(format!("no thread can be started: {error}")))?;
        self.audiences.insert(lane, audience);
        self.drivers.tell(lane, Command::Watch(Some(Watch { to })));
        Ok(watching)
    }

    /// Ends a watch that nobody looks at.
    fn unwatch(&mut self, lane: LaneId) {
        if self.audiences.get(&lane).is_some_and(Audience::is_empty) {
            self.audiences.remove(&lane);
            self.drivers.tell(lane, Command::Watch(None));
        }
    }
}

/// Passes on what a lane shows, until the lane shows no more.
fn show(shared: &Shared, lane: LaneId, audience: &Audience, seen: &Receiver<LaneSeen>) {
    loop {
        let is_watched = match seen.recv_timeout(LOOK) {
            Ok(seen) => audience.show(&shown(seen)),
            Err(RecvTimeoutError::Timeout) => !audience.is_empty(),
            Err(RecvTimeoutError::Disconnected) => break,
        };
        if !is_watched {
            shared.tell(move |control| control.unwatch(lane));
        }
    }
    shared.tell(move |control: &mut Control| {
        control.audiences.remove(&lane);
    });
}

fn shown(LaneSeen { at, what }: LaneSeen) -> Seen {
    let what = match what {
        WatchEvent::Heard(bytes) => SeenWhat::Received { hex: HEXUPPER.encode(&bytes) },
        WatchEvent::Sent(bytes) => SeenWhat::Sent { hex: HEXUPPER.encode(&bytes) },
        WatchEvent::LineError { kind, byte } => SeenWhat::LineError {
            kind: kind.name().to_owned(),
            hex: byte.map(|byte| HEXUPPER.encode(&[byte])),
        },
        WatchEvent::ModemLines(_, on) => SeenWhat::ModemLines { on: names(on) },
        WatchEvent::Held => SeenWhat::Held { is_held: true },
        WatchEvent::Released => SeenWhat::Held { is_held: false },
        WatchEvent::State(name) => SeenWhat::State { name },
    };
    Seen { at_us: at.0, what, dropped: 0 }
}

fn names(lines: ModemLines) -> Vec<String> {
    const NAMES: [(ModemLines, &str); 6] = [
        (ModemLines::CTS, "CTS"),
        (ModemLines::DSR, "DSR"),
        (ModemLines::DCD, "DCD"),
        (ModemLines::RI, "RI"),
        (ModemLines::RTS, "RTS"),
        (ModemLines::DTR, "DTR"),
    ];
    let on = NAMES.into_iter().filter(|(line, _)| lines.contains(*line));
    on.map(|(_, name)| name.to_owned()).collect()
}

/// Audiences by lane.
pub(crate) type Audiences = HashMap<LaneId, Audience>;
