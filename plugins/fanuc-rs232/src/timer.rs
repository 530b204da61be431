//! A timer of the link, as far as it is part of the state.

use softplug_plugin::{Context, Micros};
use zerocopy::{FromZeros, Immutable, IntoBytes};

/// One more than when the timer runs out, in µs on the link's clock; 0: it does not run.
#[derive(Copy, Clone, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(transparent)]
pub(crate) struct Timer(i64);

impl Timer {
    /// Sets the timer to so long from now, where that is news.
    #[inline(never)]
    pub(crate) fn start(&mut self, link: &mut Context<'_>, id: u8, millis: i64) {
        let known = self.0;
        self.start_silently(link, millis);
        if self.0 != known {
            self.resume(link, id);
        }
    }

    /// For a time that is only compared.
    #[inline(never)]
    pub(crate) fn start_silently(&mut self, link: &Context<'_>, millis: i64) {
        self.0 = link.now().0 + millis * 1_000 + 1;
    }

    #[inline(never)]
    pub(crate) fn stop(&mut self, link: &mut Context<'_>, id: u8) {
        if self.0 != 0 {
            self.0 = 0;
            link.cancel_timer(id);
        }
    }

    /// The timer has run out.
    pub(crate) fn has_run_out(&mut self) {
        self.0 = 0;
    }

    pub(crate) fn is_over(self, link: &Context<'_>) -> bool {
        link.now().0 >= self.0 - 1
    }

    /// Sets the timer again, if it runs: after a restore.
    #[inline(never)]
    pub(crate) fn resume(self, link: &mut Context<'_>, id: u8) {
        if self.0 != 0 {
            link.set_timer(id, Micros(self.0 - 1));
        }
    }
}
