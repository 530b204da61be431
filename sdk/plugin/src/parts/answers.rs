//! Answers that wait for room.

use super::{Part, PartEvent, move_to_front};
use crate::{Context, State, StateReader, StateWriter};
use softplug_abi::wire::copy;

/// Answers on their way to the line: they are appended to the transmit queue, and wait here, at
/// most `N` bytes of them, 255 at most, while it has no room. Nothing else may be transmitted while
/// some wait ([`owes_nothing`](Self::owes_nothing)), so an answer always leaves in one piece, and before what
/// is given after it.
///
/// Answers are bounded whatever the partner does: one that can neither be queued nor wait as a whole is not
/// sent. As a state it is a length of one byte and the bytes that wait.
///
/// ```
/// use softplug_plugin::bench::Bench;
/// use softplug_plugin::parts::Answers;
/// use softplug_plugin::{Context, Converter, parts};
///
/// /// Answers each ENQ with DLE 0, however many come and however little room there is.
/// struct Ready {
///     answers: Answers<8>,
/// }
///
/// impl Converter for Ready {
///     type Settings = ();
///     const MANIFEST: &'static str = r#"{"abi": "1.0", "name": "ready", "version": "1.0.0",
///         "licence": "MIT", "protocol": "none", "description": "Answers ENQ."}"#;
///
///     fn new((): ()) -> Self {
///         Self { answers: Answers::new() }
///     }
///
///     parts!(answers);
///
///     fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
///         for _ in bytes.iter().filter(|byte| **byte == 0x05) {
///             self.answers.say(link, &[0x10, b'0']);
///         }
///     }
/// }
///
/// let mut bench = Bench::<Ready>::new().open();
/// bench.receive(&[0x05, 0x05]);
/// bench.run_for_millis(10);
/// assert_eq!(bench.sent(), [0x10, b'0', 0x10, b'0']);
/// ```
#[derive(Copy, Clone, Debug)]
pub struct Answers<const N: usize> {
    waiting: [u8; N],
    length: u8,
}

impl<const N: usize> Answers<N> {
    /// None waits; all zeros.
    #[allow(clippy::new_without_default, reason = "it is below, and this is const")]
    pub const fn new() -> Self {
        const { assert!(N <= u8::MAX as usize, "at most 255 bytes of answers wait") };
        Self { waiting: [0; N], length: 0 }
    }

    /// Sends an answer; what finds no room waits for it. `false`: it can neither be sent nor wait as a
    /// whole, and nothing of it is sent.
    pub fn say(&mut self, link: &mut Context<'_>, answer: &[u8]) -> bool {
        let room = if self.owes_nothing() { link.transmit_room() as usize } else { 0 };
        let count = room.min(answer.len());
        let (now, later) = answer.split_at_checked(count).unwrap_or_default();
        let fits = self.keep(later);
        if fits && !now.is_empty() {
            link.transmit(now);
        }
        fits
    }

    /// Lets an answer wait until it is [paid](Self::pay): where it must not stand in the middle of a
    /// [block](super::BlockSender::is_given_in_part). `false`: it finds no place to wait as a whole.
    pub fn keep(&mut self, answer: &[u8]) -> bool {
        let used = usize::from(self.length);
        let free = self.waiting.get_mut(used..).unwrap_or_default();
        let fits = answer.len() <= free.len();
        if fits {
            copy(free, answer);
            self.length += answer.len() as u8;
        }
        fits
    }

    /// Whether none waits: only then may anything else be transmitted.
    pub fn owes_nothing(&self) -> bool {
        self.length == 0
    }

    /// Nobody waits for an answer any more.
    pub fn forget(&mut self) {
        self.length = 0;
    }

    /// Sends what waits, as far as there is room. It does so by itself where events are
    /// [passed on](crate::Converter::parts).
    pub fn pay(&mut self, link: &mut Context<'_>) {
        let used = usize::from(self.length);
        let count = used.min(link.transmit_room() as usize);
        if count > 0 {
            link.transmit(self.waiting.get(..count).unwrap_or_default());
            move_to_front(&mut self.waiting, count, used);
            self.length -= count as u8;
        }
    }
}

impl<const N: usize> Default for Answers<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Part for Answers<N> {
    #[cfg_attr(target_arch = "wasm32", inline(always))]
    fn hear(&mut self, link: &mut Context<'_>, event: &PartEvent<'_>) {
        // After a swap rooms are told anew: what has grown meanwhile is not told again.
        if matches!(
            event,
            PartEvent::Resumed | PartEvent::TransmitRoom | PartEvent::Discarded { .. }
        ) {
            self.pay(link);
        }
    }
}

impl<const N: usize> State for Answers<N> {
    fn save(&self, state: &mut StateWriter<'_>) {
        state.u8(self.length);
        state.bytes(self.waiting.get(..usize::from(self.length)).unwrap_or_default());
    }

    fn restore(&mut self, state: &mut StateReader<'_>) {
        let length = state.u8();
        let Some(place) = self.waiting.get_mut(..usize::from(length)) else {
            return state.refuse();
        };
        copy(place, state.bytes(usize::from(length)));
        self.length = length;
    }
}
