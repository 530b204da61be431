//! A plug-in held to its profile's model.

use softplug_abi::Micros;
use softplug_abi::manifest::Manifest;
use softplug_link::Observed;
use softplug_models::{Broken, Effect, Model};
use std::collections::VecDeque;
use std::sync::Arc;

/// How long a model is followed where nothing happens any more.
const AT_REST: Micros = Micros::from_secs(10);

/// The model, and what it has yet to be told.
pub(crate) struct Held {
    pub(crate) model: Box<dyn Model>,
    manifest: Arc<Manifest>,
    /// Characters in the port whose start bits are still to come.
    starts: VecDeque<(Micros, u8)>,
    /// When characters in the port will have left.
    ends: VecDeque<(Micros, u8)>,
    /// Characters of this instant that are among the ends.
    taken: usize,
    now: Micros,
}

impl Held {
    pub(crate) fn new(model: Box<dyn Model>, manifest: Arc<Manifest>) -> Self {
        let (starts, ends) = (VecDeque::new(), VecDeque::new());
        Self { model, manifest, starts, ends, taken: 0, now: Micros::ZERO }
    }

    pub(crate) fn fork(&self) -> Self {
        Self {
            model: self.model.fork(),
            manifest: Arc::clone(&self.manifest),
            starts: self.starts.clone(),
            ends: self.ends.clone(),
            taken: 0,
            now: self.now,
        }
    }

    /// Lets the model go through every instant before `now`, at which the plug-in did nothing.
    pub(crate) fn catch_up(&mut self, now: Micros) -> Result<(), Broken> {
        self.taken = 0;
        while let Some(next) = self.next().filter(|next| *next < now) {
            self.due(next)?;
            self.model.settled(next)?;
        }
        self.now = now;
        Ok(())
    }

    /// What is due at `now`: characters whose bits begin or end, then the model's own.
    pub(crate) fn due(&mut self, now: Micros) -> Result<(), Broken> {
        self.now = now;
        self.progress()?;
        self.model.due(now);
        Ok(())
    }

    /// What the plug-in did at `now`; `left` are the characters of this instant with their ends.
    pub(crate) fn tell(
        &mut self,
        now: Micros,
        observed: Vec<(Micros, Observed)>,
        left: &[(Micros, u8)],
    ) -> Result<(), Broken> {
        self.ends.extend(&left[self.taken..]);
        self.taken = left.len();
        for (at, observed) in observed {
            match observed {
                Observed::Byte(byte) if at > now => self.starts.push_back((at, byte)),
                observed => {
                    if let Some(effect) = Effect::of(&observed, &self.manifest) {
                        self.model.seen(at, &effect)?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Goes on for a while in which the plug-in does nothing.
    pub(crate) fn at_rest(&mut self) -> Result<(), Broken> {
        self.catch_up(self.now + AT_REST)
    }

    fn next(&self) -> Option<Micros> {
        let first = |times: &VecDeque<(Micros, u8)>| times.front().map(|(at, _)| *at);
        let all = [first(&self.starts), first(&self.ends), self.model.next()];
        all.into_iter().flatten().min().map(|next| next.max(self.now + Micros(1)))
    }

    fn progress(&mut self) -> Result<(), Broken> {
        loop {
            let end = self.ends.front().copied().filter(|(at, _)| *at <= self.now);
            let start = self.starts.front().copied().filter(|(at, _)| *at <= self.now);
            match (end, start) {
                (Some((end, byte)), start) if start.is_none_or(|(start, _)| end <= start) => {
                    self.ends.pop_front();
                    self.model.left(end, byte);
                }
                (_, Some((start, byte))) => {
                    self.starts.pop_front();
                    self.model.seen(start, &Effect::Byte(byte))?;
                }
                _ => return Ok(()),
            }
        }
    }
}
