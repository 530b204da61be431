//! What systemd is told, where it has started the gateway.

use std::thread;

use sd_notify::NotifyState;

use crate::Gateway;

/// The gateway takes work; `status` is shown by `systemctl status`.
pub fn ready(status: &str) {
    tell(&[NotifyState::Ready, NotifyState::Status(status)]);
}

/// A new configuration is about to be read; [`ready`] follows.
pub fn reloading() {
    match NotifyState::monotonic_usec_now() {
        Ok(now) => tell(&[NotifyState::Reloading, now]),
        Err(error) => tracing::warn!(%error, "systemd is not told of the reload"),
    }
}

/// The gateway stops. What takes long, such as jobs that are finished, is waited for.
pub fn stopping() {
    tell(&[NotifyState::Stopping, NotifyState::Status("stopping; jobs are ended first")]);
}

/// Tells the watchdog that the gateway lives, as long as its control loop answers.
/// Does nothing where the unit has no `WatchdogSec=`.
pub fn watchdog(gateway: Gateway) {
    let Some(span) = sd_notify::watchdog_enabled() else { return };
    let tend = move || {
        loop {
            // Twice as often as it must be.
            thread::sleep(span / 2);
            if gateway.is_alive() {
                tell(&[NotifyState::Watchdog]);
            }
        }
    };
    if let Err(error) = thread::Builder::new().name("watchdog".to_owned()).spawn(tend) {
        tracing::warn!(%error, "systemd's watchdog is not tended");
    }
}

fn tell(states: &[NotifyState<'_>]) {
    if let Err(error) = sd_notify::notify(states) {
        tracing::warn!(%error, "systemd cannot be told");
    }
}
