//! Another plug-in begins as new on a link: after a fault, or while nothing is
//! under way.

use super::Link;
use crate::LinkHost;
use crate::fault::LinkFault;
use softplug_abi::manifest::SettingValues;
use softplug_abi::{Instance, Micros};

impl<I: Instance> Link<I> {
    /// Puts `successor` in the place of the plug-in, which is closed if it has
    /// not ended, and opens it as new. What was under way is interrupted, and what
    /// waits to be sent is dropped; the clock, the port and its modem lines
    /// stay. A port that is gone is told of again. Returns the plug-in that was
    /// there.
    ///
    /// # Errors
    /// A fault of the successor. The link then waits for yet another one.
    pub fn replace(
        &mut self,
        now: Micros,
        successor: I,
        settings: SettingValues,
        host: &mut dyn LinkHost,
    ) -> Result<I, LinkFault<I::Fault>> {
        let down = self.down;
        // What the old one does wrong on its last event no longer matters.
        let _ = self.close(now, host);
        let old = self.put(successor);
        self.options.settings = settings;
        self.open(now, host)?;
        if let Some(reason) = down {
            self.link_down(now, reason, host)?;
            self.handle_timeout(now, host)?;
        }
        Ok(old)
    }
}
