//! What comes besides a transfer: deliveries that nobody asked for. They are kept in a folder, or
//! counted where there is none.

use std::io;
use std::path::PathBuf;

use softplug_abi::{Action, Failure};

use crate::store::{Inbox, Mark};

/// A delivery that came besides, and was kept.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Reception {
    /// The name that the protocol found. From the line: nothing in it can be trusted.
    pub name: Option<String>,
    /// Why it is not complete, with the protocol's own code.
    pub failure: Option<(Failure, u16)>,
    /// Its length.
    pub bytes: u64,
    /// Its file; `None` for a failed one of which nothing came.
    pub path: Option<PathBuf>,
}

/// Takes what comes besides.
pub(super) struct Unasked<'a> {
    inbox: Option<&'a mut Inbox>,
    is_under_way: bool,
    name: Option<String>,
    pub(super) kept: Vec<Reception>,
    /// Bytes that were dropped for want of a folder.
    pub(super) dropped: u64,
    /// Deliveries that had no place: refused by the protocol, or dropped.
    pub(super) refused: u64,
    /// Why the folder takes no more.
    pub(super) error: Option<io::Error>,
}

impl<'a> Unasked<'a> {
    pub(super) fn new(inbox: Option<&'a mut Inbox>) -> Self {
        Self {
            inbox,
            is_under_way: false,
            name: None,
            kept: Vec::new(),
            dropped: 0,
            refused: 0,
            error: None,
        }
    }

    /// Whether one is under way that will be kept.
    pub(super) fn is_taking(&self) -> bool {
        self.is_under_way && self.inbox.is_some() && self.error.is_none()
    }

    /// An action on a delivery that came besides.
    pub(super) fn take(&mut self, action: &Action<'_>) {
        let taken = match action {
            Action::DeliveryBegin { .. } => self.begin(),
            Action::Deliver { bytes, .. } => self.put(bytes),
            Action::DeliveryName { name, .. } => {
                self.name = Some((*name).to_owned());
                Ok(())
            }
            Action::DeliveryEnd { failure, status, .. } => {
                self.end(failure.map(|failure| (failure, *status)))
            }
            _ => Ok(()),
        };
        if let Err(error) = taken {
            self.error.get_or_insert(error);
        }
    }

    /// The link is closed: what is under way has failed.
    pub(super) fn close(&mut self) {
        if self.is_under_way
            && let Err(error) = self.end(Some((Failure::Aborted, 0)))
        {
            self.error.get_or_insert(error);
        }
    }

    fn begin(&mut self) -> io::Result<()> {
        self.is_under_way = true;
        self.name = None;
        self.inbox.as_mut().map_or(Ok(()), |inbox| inbox.begin())
    }

    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        if !self.is_under_way {
            return Ok(());
        }
        match &mut self.inbox {
            Some(inbox) if self.error.is_none() => inbox.write(bytes),
            _ => {
                self.dropped += bytes.len() as u64;
                Ok(())
            }
        }
    }

    fn end(&mut self, failure: Option<(Failure, u16)>) -> io::Result<()> {
        if !std::mem::take(&mut self.is_under_way) {
            return Ok(());
        }
        let Some(inbox) = &mut self.inbox else {
            self.refused += 1;
            return Ok(());
        };
        // What could not be written is not all there.
        let failure = failure.or(self.error.as_ref().map(|_| (Failure::Internal, 0)));
        let mark = if failure.is_none() { Mark::Complete } else { Mark::Failed };
        let name = self.name.take();
        let kept = inbox.end(name.as_deref(), mark)?;
        self.kept.push(Reception { name, failure, bytes: kept.bytes, path: kept.path });
        Ok(())
    }
}
