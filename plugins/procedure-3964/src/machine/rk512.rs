//! RK512: telegrams to and from a partner's memory, each a block with a reaction
//! as a block of its own in the other direction.

mod active;
mod fields;
mod header;
mod passive;

pub(crate) use header::timeout_at;

use super::NEVER;
use header::Header;
use softplug_plugin::parts::Block;
use softplug_plugin::{Context, DeliveryId, Micros, RequestId, State};

/// Most data bytes of one telegram.
pub(crate) const LARGEST_DATA: u8 = 128;
/// Bytes of a command before its data.
const HEADER: usize = 10;
/// Bytes of a reaction, and of a follow-up, before its data.
const SHORT_HEADER: usize = 4;
/// Most bytes of a telegram.
pub(crate) const LARGEST_TELEGRAM: u16 = HEADER as u16 + LARGEST_DATA as u16;
/// Most bytes of a reaction.
const LARGEST_REACTION: usize = SHORT_HEADER + LARGEST_DATA as usize;

/// Whose turn it is in a command of several telegrams.
#[derive(Copy, Clone, PartialEq, Eq, Debug, State)]
enum Turn {
    /// The partner has our reaction: a follow-up is the next one.
    Acknowledged,
    /// Our reaction has not left: a follow-up can only be the same once more.
    Ours,
    /// Whether the partner has our reaction is not known. What comes may be the same or
    /// the next one, and data in the wrong place would not be noticed.
    Unsure,
}

/// What the layer knows.
#[derive(Debug, State)]
pub(crate) struct Rk512 {
    // Active: our job.
    /// Data bytes that are still to be transferred, this telegram's included; 0:
    /// not known yet.
    to_do: u32,
    /// Id of the delivery of what is read; 0: not begun.
    reading: DeliveryId,
    pub(crate) reaction_until: Micros,
    // Passive: the partner's commands.
    asked: Header,
    /// First word or byte of this telegram's data.
    offset: u32,
    /// Data bytes of its command that are still to come, and of this telegram.
    left: u32,
    piece: u8,
    /// The telegram was a follow-up.
    is_next: bool,
    /// How far the reaction is.
    turn: Turn,
    last_request: RequestId,
    /// The last request is to be answered until then; `NEVER`: it was.
    pub(crate) answer_until: Micros,
    pub(crate) reaction: Block<LARGEST_REACTION>,
    pub(crate) reaction_ready: bool,
}

impl Rk512 {
    pub(crate) const fn new() -> Self {
        Self {
            to_do: 0,
            reading: DeliveryId::NONE,
            reaction_until: NEVER,
            asked: Header([0; HEADER]),
            offset: 0,
            left: 0,
            piece: 0,
            is_next: false,
            turn: Turn::Acknowledged,
            last_request: RequestId::NONE,
            answer_until: NEVER,
            reaction: Block::new(),
            reaction_ready: false,
        }
    }

    /// Whether a delivery is under way: one of what a job reads.
    pub(crate) fn is_delivering(&self) -> bool {
        self.reading != DeliveryId::NONE
    }

    /// The partner is gone: what it asked for no longer matters.
    pub(crate) fn forget_partner(&mut self, link: &mut Context<'_>) {
        self.forget_request(link);
        self.reaction_ready = false;
        self.left = 0;
    }

    fn forget_request(&mut self, link: &mut Context<'_>) {
        if self.answer_until != NEVER {
            self.answer_until = NEVER;
            link.withdraw(self.last_request);
        }
    }
}
