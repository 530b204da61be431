//! Ctrl-C, SIGTERM and SIGHUP: the first asks for a clean end, a second Ctrl-C or SIGTERM ends at
//! once.

#[cfg(not(unix))]
mod elsewhere;
#[cfg(unix)]
mod unix;

#[cfg(not(unix))]
pub(crate) use elsewhere::on_signals;
#[cfg(unix)]
pub(crate) use unix::on_signals;
