//! What the procedure does differently from one partner to the next.

use crate::{Layer, Priority};
use softplug_plugin::Micros;

/// The settings in the units in which they are used.
#[derive(Copy, Clone, Debug)]
pub struct Options {
    /// A block ends with a block check character (3964R).
    pub bcc: bool,
    /// STX is answered by DLE before the block is sent.
    pub handshake: bool,
    /// DLE in data is doubled.
    pub doubling: bool,
    /// Who withdraws in an initialisation conflict.
    pub priority: Priority,
    /// Acknowledgement delay.
    pub qvz: Micros,
    /// Character delay.
    pub zvz: Micros,
    /// Block wait; 0: no repetition is expected.
    pub bwz: Micros,
    /// How long STX may wait for a free buffer.
    pub buffer_wait: Micros,
    /// STX tries.
    pub setup_attempts: u8,
    /// Tries of a whole block, sending and receiving.
    pub transmission_attempts: u8,
    /// Most data bytes of a block.
    pub block_size: u16,
    /// A job that is longer goes as several blocks.
    pub split: bool,
    /// One NAK when the link opens.
    pub nak_at_start: bool,
    /// Idle garbage is answered by NAK after a silence of ZVZ.
    pub nak_on_garbage: bool,
    /// What is spoken on top.
    pub layer: Layer,
    /// How long RK512 waits for a reaction; 0: by the line rate.
    pub reaction_timeout: Micros,
}
