//! The procedure as a converter.

use crate::Options;
use crate::machine::Machine;
use core::fmt::Debug;
use core::marker::PhantomData;
use softplug_plugin::{
    Context, Converter, Failure, JobId, JobStart, LineErrorKind, LinkDownReason, MarkId, MarkState,
    Micros, Opening, RawValue, RequestId, SettingSet, State, parts, state_format,
};

/// What one plug-in of the family adds: its settings with their defaults, and its manifest.
pub trait Variant: Debug {
    /// Its settings, as its manifest tells them.
    type Settings: SettingSet;
    /// The manifest as JSON.
    const MANIFEST: &'static str;
}

/// The settings of one plug-in: its own defaults in the manifest, one struct for
/// all plug-ins behind it.
#[derive(Debug)]
pub struct Configured<V> {
    options: Options,
    variant: PhantomData<V>,
}

impl<V> Clone for Configured<V> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<V> Copy for Configured<V> {}

impl<V: Variant> SettingSet for Configured<V> {
    const COUNT: u16 = Options::COUNT;
    const JSON: &'static [&'static [&'static str]] = V::Settings::JSON;

    const UNSET: Self = Self { options: Options::UNSET, variant: PhantomData };

    fn set(&mut self, index: u16, value: &RawValue<'_>) -> bool {
        self.options.set(index, value)
    }
}

/// A converter of the family.
#[derive(Debug, State)]
pub struct Procedure<V> {
    machine: Machine,
    #[state(skip)]
    variant: PhantomData<V>,
}

impl<V: Variant> Converter for Procedure<V> {
    type Settings = Configured<V>;
    const MANIFEST: &'static str = V::MANIFEST;
    // Two blocks, and all that waits.
    const STATE_CAPACITY: usize = 8_192;

    fn new(settings: Configured<V>) -> Self {
        Self { machine: Machine::new(settings.options), variant: PhantomData }
    }

    parts!(machine.timers);

    fn opened(&mut self, link: &mut Context<'_>, opening: &Opening) {
        self.machine.opened(link, opening);
    }

    fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        self.machine.received(link, bytes);
    }

    fn line_error(
        &mut self,
        link: &mut Context<'_>,
        kind: LineErrorKind,
        byte: Option<u8>,
        span: u32,
    ) {
        self.machine.line_error(link, kind, byte, span);
    }

    fn link_down(&mut self, link: &mut Context<'_>, _reason: LinkDownReason) {
        self.machine.link_down(link);
    }

    fn timer(&mut self, link: &mut Context<'_>, id: u8, _deadline: Micros) {
        self.machine.timer(link, id);
    }

    fn mark(&mut self, link: &mut Context<'_>, mark: MarkId, state: MarkState) {
        self.machine.mark(link, mark, state);
    }

    fn discarded(&mut self, link: &mut Context<'_>, bytes: u32) {
        self.machine.discarded(link, bytes);
    }

    fn job_begin(&mut self, link: &mut Context<'_>, job: JobStart<'_>) {
        self.machine.job_begin(link, &job);
    }

    fn job_data(&mut self, link: &mut Context<'_>, _job: JobId, bytes: &[u8]) {
        self.machine.job_data(link, bytes);
    }

    fn job_end(&mut self, link: &mut Context<'_>, _job: JobId) {
        self.machine.job_end(link);
    }

    fn pause(&mut self, link: &mut Context<'_>, _job: JobId) {
        self.machine.set_paused(link, true);
    }

    fn resume(&mut self, link: &mut Context<'_>, _job: JobId) {
        self.machine.set_paused(link, false);
    }

    fn abort(&mut self, link: &mut Context<'_>, job: JobId) {
        self.machine.abort(link, job);
    }

    fn answer(
        &mut self,
        link: &mut Context<'_>,
        request: RequestId,
        answer: Result<&[u8], Failure>,
        more: bool,
    ) {
        self.machine.answer(link, request, answer, more);
    }

    fn more(&mut self, link: &mut Context<'_>) {
        self.machine.more(link);
    }

    fn after(&mut self, link: &mut Context<'_>) {
        self.machine.finish(link);
    }

    state_format!(2);
}
