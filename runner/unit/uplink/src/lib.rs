//! What carries frames of the unit protocol between a gateway and its units.
//!
//! A [`TcpUplink`] is one connection, at either end. Nothing here blocks: whoever owns it polls its
//! source and is told when to try again.
#![cfg(target_os = "linux")]
#![forbid(unsafe_code)]

mod outbox;
mod tcp;
mod text;
mod waker;

pub use outbox::Outbox;
pub use tcp::{Closed, TcpUplink};
pub use text::plain_text;
pub use waker::waker_of;
