//! Parts of which protocols are made: what most of them need and every author would write again.
//!
//! | part | what it does |
//! |---|---|
//! | [`Block`] | bytes that are gathered, at most so many |
//! | [`Timers`] | timers with names, set again after a swap |
//! | [`Answers`] | answers that wait for room, and go before all else |
//! | [`BlockSender`] | a job in blocks: its data, pieces, marks and repeats |
//! | [`StateName`] | tells the state's name when it is another one |
//! | [`checks`] | BCC, sums and CRCs |
//!
//! Parts hear of events before the converter's own methods if [`parts!`](crate::parts!) names them; then no
//! method is needed only to pass something on. Each part is a [`State`](crate::State): a converter that is made of them saves
//! itself with `#[derive(State)]`.
//!
//! **Answers in the middle of a frame.** A protocol that puts a DLE before each DLE of its data, and
//! answers by DLE ACK while its own frame is on the line, must never have an answer between a DLE
//! and its twin. [`Context::transmit_urgent`](crate::Context::transmit_urgent) knows nothing of frames.
//! [`BlockSender::give_symbols`] does: it gives the link short pieces of the frame, each of whole symbols, so
//! that an answer that is appended to the queue always stands between two symbols, and waits for at most two
//! pieces. Nothing has to be dropped when such a frame is [cut short](BlockSender::cut): the few
//! bytes that the link has leave, and the answers with them.

mod answers;
mod block;
pub mod checks;
mod name;
mod sender;
mod timers;

pub use answers::Answers;
pub use block::Block;
pub use name::StateName;
pub use sender::{BlockSender, OWN_MARKS};
pub use timers::{TimerName, Timers};

use crate::{Context, MarkId, MarkState};
use softplug_abi::wire::copy;

/// Inside of `impl Converter`: these parts hear of [events](PartEvent) before the converter's own methods, in
/// this order.
///
/// ```
/// use softplug_plugin::parts::{Answers, Timers};
/// use softplug_plugin::{Converter, parts, timers};
///
/// timers! {
///     enum Timer { Patience }
/// }
///
/// struct Sides {
///     answers: Answers<8>,
/// }
///
/// struct Talk {
///     timers: Timers<Timer, 1>,
///     sides: Sides,
/// }
///
/// impl Converter for Talk {
///     type Settings = ();
///     const MANIFEST: &'static str = r#"{"abi": "1.0", "name": "talk", "version": "1.0.0",
///         "licence": "MIT", "protocol": "none", "description": "Says nothing."}"#;
///
///     fn new((): ()) -> Self {
///         Self { timers: Timers::new(), sides: Sides { answers: Answers::new() } }
///     }
///
///     parts!(timers, sides.answers);
/// }
/// ```
#[macro_export]
macro_rules! parts {
    ($($($part:ident).+),+ $(,)?) => {
        // For each event the compiler then leaves only what a part does at it.
        #[cfg_attr(target_arch = "wasm32", inline(always))]
        fn parts(
            &mut self,
            link: &mut $crate::Context<'_>,
            event: &$crate::parts::PartEvent<'_>,
        ) {
            $($crate::parts::Part::hear(&mut self.$($part).+, link, event);)+
        }
    };
}

/// Something that hears of events before the converter's own methods.
///
/// ```
/// use softplug_plugin::parts::{Part, PartEvent};
/// use softplug_plugin::{Context, MarkState};
///
/// /// How many marks are under way.
/// struct UnderWay(u32);
///
/// impl Part for UnderWay {
///     fn hear(&mut self, _link: &mut Context<'_>, event: &PartEvent<'_>) {
///         if let PartEvent::Mark { state: MarkState::SurelyLeft | MarkState::Dropped, .. } = event {
///             self.0 -= 1;
///         }
///     }
/// }
/// ```
pub trait Part {
    /// An event; most are none of the part's business.
    fn hear(&mut self, link: &mut Context<'_>, event: &PartEvent<'_>);
}

/// The events of which parts hear.
///
/// The example of [`Part`] shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum PartEvent<'a> {
    /// The link is open, and the converter goes on where another one was.
    Resumed,
    /// A timer has run out.
    Timer {
        /// Which.
        id: u8,
    },
    /// A marked byte has left, or was dropped.
    Mark {
        /// Which.
        mark: MarkId,
        /// What became of it.
        state: MarkState,
    },
    /// There is more room to transmit.
    TransmitRoom,
    /// What waited to be sent was dropped.
    Discarded {
        /// So many bytes.
        bytes: u32,
    },
    /// Data of the job.
    JobData(&'a [u8]),
    /// All data of the job was given.
    JobEnd,
    /// The job pauses, or goes on.
    Paused(bool),
    /// The port or the connection is gone.
    LinkDown,
    /// It is there: the link was opened anew, or has it back.
    LinkUp,
}

/// Moves what stands behind the first `count` of `length` bytes to the front. Without the texts of panics
/// and the `memmove` that `copy_within` brings: 4 KB of a module.
fn move_to_front(bytes: &mut [u8], count: usize, length: usize) {
    let mut to = 0;
    while count > 0 && to + count < length {
        let from = to + count;
        let Some((front, rest)) = bytes.split_at_mut_checked(from) else { return };
        let most = count.min(length - from);
        copy(front.get_mut(to..).unwrap_or_default(), rest.get(..most).unwrap_or_default());
        to += count;
    }
}
