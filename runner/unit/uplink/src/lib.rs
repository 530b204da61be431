//! What carries frames of the unit protocol between a gateway and its units.
//!
//! An [`Uplink`] is one way between the two, at either end: a [`TcpUplink`] or a [`CanUplink`].
//! Over TCP both ends may show [keys](TlsKeys) that the other knows, and encrypt.
//! Nothing here blocks: whoever owns it polls its source and is told when to try again.
#![cfg(target_os = "linux")]
#![forbid(unsafe_code)]

mod can;
mod closed;
mod keys;
mod outbox;
mod pinned;
mod tcp;
mod tls;
mod uplink;
mod waker;

pub use can::{CanAddress, CanEnd, CanUplink, NoCanAddress};
pub use closed::{Closed, TlsError};
pub use keys::{NoTlsKey, TlsKeyError, TlsPrivateKey, TlsPublicKey};
pub use outbox::Outbox;
pub use pinned::TlsKeys;
pub use tcp::TcpUplink;
pub use uplink::Uplink;
pub use waker::waker_of;
