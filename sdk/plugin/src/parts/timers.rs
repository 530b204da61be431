//! Timers with names.

use super::{Part, PartEvent};
use crate::{Context, Micros, State, StateReader, StateWriter};
use core::marker::PhantomData;

/// The names of a plug-in's timers: an enum that [`timers!`](crate::timers!) declares.
///
/// The example stands at [`Timers`].
pub trait TimerName: Copy {
    /// How many there are, at most 16.
    const COUNT: usize;
    /// The number on the link, from 0 on.
    fn id(self) -> u8;
    /// The name of a number.
    fn from_id(id: u8) -> Option<Self>;
}

/// Declares the names of a plug-in's timers, in the order of their numbers on the link.
///
/// ```
/// softplug_plugin::timers! {
///     /// What time is kept for.
///     enum Timer {
///         /// The answer to a block.
///         Answer,
///         /// Silence inside a block.
///         Character,
///     }
/// }
///
/// use softplug_plugin::parts::TimerName;
/// assert_eq!((Timer::COUNT, Timer::Character.id()), (2, 1));
/// ```
#[macro_export]
macro_rules! timers {
    ($(#[$about:meta])* $visible:vis enum $name:ident {
        $($(#[$what:meta])* $timer:ident),+ $(,)?
    }) => {
        $(#[$about])*
        #[derive(Copy, Clone, PartialEq, Eq, Debug)]
        #[repr(u8)]
        $visible enum $name {
            $($(#[$what])* $timer,)+
        }

        impl $crate::parts::TimerName for $name {
            const COUNT: usize = [$(Self::$timer),+].len();

            fn id(self) -> u8 {
                self as u8
            }

            fn from_id(id: u8) -> Option<Self> {
                [$(Self::$timer),+].get(usize::from(id)).copied()
            }
        }
    };
}

/// Timers with names, and when they run out. What is set is kept, so that they can be set
/// again when another instance goes on: pass [events](crate::Converter::parts) on to it.
///
/// `N` is how many names there are; another number does not compile. Times of settings are in ms, those of the link in µs.
/// As a state it is nine bytes a timer.
///
/// ```
/// use softplug_plugin::bench::Bench;
/// use softplug_plugin::parts::{TimerName, Timers};
/// use softplug_plugin::{Context, Converter, Micros, State, parts};
///
/// softplug_plugin::timers! {
///     enum Timer { Reminder, Patience }
/// }
///
/// /// Sends ENQ after 100 ms of silence, and EOT after a second.
/// #[derive(State)]
/// struct Watch {
///     timers: Timers<Timer, 2>,
/// }
///
/// impl Converter for Watch {
///     type Settings = ();
///     const MANIFEST: &'static str = r#"{"abi": "1.0", "name": "watch", "version": "1.0.0",
///         "licence": "MIT", "protocol": "none", "description": "Asks and gives up.",
///         "state": {"saves": 1, "accepts": [1]}}"#;
///
///     fn new((): ()) -> Self {
///         Self { timers: Timers::new() }
///     }
///
///     parts!(timers);
///
///     fn received(&mut self, link: &mut Context<'_>, _bytes: &[u8]) {
///         self.timers.set_after(link, Timer::Reminder, 100);
///         self.timers.set_after(link, Timer::Patience, 1_000);
///     }
///
///     fn timer(&mut self, link: &mut Context<'_>, id: u8, _deadline: Micros) {
///         match Timer::from_id(id) {
///             Some(Timer::Reminder) => link.transmit(&[0x05]),
///             Some(Timer::Patience) => link.transmit(&[0x04]),
///             None => {}
///         }
///     }
///
///     softplug_plugin::state_format!(1);
/// }
///
/// let mut bench = Bench::<Watch>::new().open();
/// bench.receive(b"?");
/// bench.run_for_millis(500);
/// bench.swap();
/// bench.run_for_millis(600);
/// assert_eq!(bench.sent(), [0x05, 0x04]);
/// ```
#[derive(Copy, Clone, Debug)]
pub struct Timers<T, const N: usize> {
    deadlines: [Option<Micros>; N],
    names: PhantomData<T>,
}

impl<T: TimerName, const N: usize> Timers<T, N> {
    /// None is set.
    #[allow(clippy::new_without_default, reason = "it is below, and this is const")]
    pub const fn new() -> Self {
        const { assert!(N == T::COUNT && N <= 16, "as many timers as there are names, at most 16") };
        Self { deadlines: [None; N], names: PhantomData }
    }

    /// Sets a timer to so many ms from now, 0 to 2^40 (34 years).
    pub fn set_after(&mut self, link: &mut Context<'_>, timer: T, millis: i64) {
        // So the product fits: what saturates takes more of a module.
        let span = Micros(millis.clamp(0, 1 << 40) * 1_000);
        self.set(link, timer, Some(link.now() + span));
    }

    /// Cancels a timer; one that is not set is left as it is.
    pub fn cancel(&mut self, link: &mut Context<'_>, timer: T) {
        self.set(link, timer, None);
    }

    /// Whether a timer is set.
    pub fn is_set(&self, timer: T) -> bool {
        self.deadlines.get(usize::from(timer.id())).is_some_and(Option::is_some)
    }

    /// Sets a timer to a time on the link's clock, or cancels it.
    #[inline]
    pub fn set(&mut self, link: &mut Context<'_>, timer: T, at: Option<Micros>) {
        let Some(known) = self.deadlines.get_mut(usize::from(timer.id())) else { return };
        if *known == at {
            return;
        }
        *known = at;
        match at {
            Some(at) => link.set_timer(timer.id(), at),
            None => link.cancel_timer(timer.id()),
        }
    }
}

impl<T: TimerName, const N: usize> Default for Timers<T, N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T, const N: usize> Part for Timers<T, N> {
    #[cfg_attr(target_arch = "wasm32", inline(always))]
    fn hear(&mut self, link: &mut Context<'_>, event: &PartEvent<'_>) {
        match event {
            PartEvent::Timer { id } => {
                if let Some(known) = self.deadlines.get_mut(usize::from(*id)) {
                    *known = None;
                }
            }
            PartEvent::Resumed => {
                for (id, at) in (0..).zip(&self.deadlines) {
                    if let Some(at) = at {
                        link.set_timer(id, *at);
                    }
                }
            }
            _ => {}
        }
    }
}

impl<T, const N: usize> State for Timers<T, N> {
    fn save(&self, state: &mut StateWriter<'_>) {
        self.deadlines.save(state);
    }

    fn restore(&mut self, state: &mut StateReader<'_>) {
        self.deadlines.restore(state);
    }
}
