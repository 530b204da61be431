//! The unit protocol, version 1: what a gateway and a front-end unit say to each other, over TCP
//! or CAN. `docs/unit/protocol.md` specifies it byte by byte; both ends use this crate.
//!
//! - [`Frame`]: what goes over the uplink at once, with a check.
//! - [`Session`]: frames that are lost, doubled, late or out of order become messages that
//!   arrive once and in order, or a session that has ended and says so.
//! - [`ToUnit`] and [`ToServer`]: the messages.
//! - [`Feeding`] and [`Fed`]: a job's data by credit, at both ends. They outlive a session: the
//!   next one goes on at the byte at which the last one ended.
//!
//! Nothing here has I/O, a clock or an allocator: whoever owns the uplink gives what came and the
//! time, and takes what is to leave.
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

mod credit;
mod frame;
mod message;
mod session;

pub use credit::{CREDIT_PARTS, CreditError, Fed, Feeding};
pub use frame::{
    Frame, FrameError, FrameKind, HEADER, LONGEST, PAYLOAD, TRAILER, VERSION, length_of_frame,
};
pub use message::{
    Decode, Digest, Encode, Encoded, KEPT_SETTINGS, MessageError, Messages, Outcome, SlotState,
    SwapOutcome, ToServer, ToUnit, WhenCode,
};
pub use session::{EndReason, Identity, RefuseReason, Role, Session, SessionError, SessionEvent};
