//! What can be saved and taken back: numbers, times, arrays, and what `#[derive(State)]` makes of them.

use crate::{DeliveryId, Failure, JobId, MarkId, Micros, RequestId, StateReader, StateWriter};

/// A part of a converter's state: it writes itself, and takes itself back in place.
///
/// `#[derive(State)]` makes it for structures and for enums without fields. A structure's fields are
/// written in the order in which they are declared, each as its own type says, without anything in
/// between; an enum is one byte. A field that cannot be what it is gets refused by its name:
/// [`StateError`](crate::StateError) says `Lines.refusals`.
///
/// | attribute | where | what it does |
/// |---|---|---|
/// | `#[state(skip)]` | field | it is no part of the state, and stays as it is |
/// | `#[state(since = 2)]` | field | the states of formats before 2 do not have it; it stays as it is then |
/// | `#[state(within = 0..=9)]` | field | a value outside of this range is refused |
/// | `#[state(check = Self::is_sound)]` | structure | this function of `&Self` says whether all of it together can be |
/// | `#[state(code = 7)]` | variant | its byte; without, one more than that of the variant before |
///
/// [`state_format!`](crate::state_format!) makes of it what a [`Converter`](crate::Converter) has to
/// have.
///
/// | type | bytes |
/// |---|---|
/// | `bool`, `u8`, an enum | 1 |
/// | `u16` | 2 |
/// | `u32`, `usize`, ids | 4 |
/// | `u64`, [`Micros`] | 8 |
/// | `Option<Micros>` | 9 |
/// | `Option<Failure>` | 2 |
/// | `[T; N]` | those of all entries |
///
/// All numbers are little-endian. A converter's settings are no part of its state: the host gives
/// them again.
///
/// ```
/// use softplug_plugin::bench::Bench;
/// use softplug_plugin::{Context, Converter, State};
///
/// #[derive(Copy, Clone, PartialEq, Eq, Default, State)]
/// enum Stage {
///     #[default]
///     Idle,
///     Inside,
/// }
///
/// /// Counts lines, and answers each fifth with ENQ.
/// #[derive(Default, State)]
/// #[state(check = Self::is_sound)]
/// struct Lines {
///     stage: Stage,
///     #[state(within = 0..=4)]
///     lines: u8,
///     // Format 1 did not count them.
///     #[state(since = 2)]
///     characters: u32,
///     #[state(skip)]
///     longest: u32,
/// }
///
/// impl Lines {
///     fn is_sound(&self) -> bool {
///         self.stage == Stage::Inside || self.characters == 0
///     }
/// }
///
/// impl Converter for Lines {
///     type Settings = ();
///     const MANIFEST: &'static str = r#"{"abi": "1.0", "name": "lines", "version": "1.0.0",
///         "licence": "MIT", "protocol": "lines", "description": "Counts lines.",
///         "state": {"saves": 2, "accepts": [2, 1]}}"#;
///
///     fn new((): ()) -> Self {
///         Self::default()
///     }
///
///     fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
///         for byte in bytes {
///             let is_end = *byte == b'\n';
///             self.stage = if is_end { Stage::Idle } else { Stage::Inside };
///             self.characters = if is_end { 0 } else { self.characters + 1 };
///             self.longest = self.longest.max(self.characters);
///             self.lines += u8::from(is_end);
///             if self.lines == 5 {
///                 self.lines = 0;
///                 link.transmit(&[0x05]);
///             }
///         }
///     }
///
///     softplug_plugin::state_format!(2, accepts 1..=2);
/// }
///
/// let mut bench = Bench::<Lines>::new().open();
/// bench.receive(b"G1\nG2\nG3\n");
/// bench.swap();
/// bench.receive(b"G4\nG5\n");
/// bench.run_for_millis(10);
/// assert_eq!(bench.sent(), [0x05]);
/// ```
pub trait State {
    /// Writes it. Writes the same each time, until something happens.
    fn save(&self, state: &mut StateWriter<'_>);
    /// Takes what [`save`](Self::save) wrote. What cannot be is [refused](StateReader::refuse); what
    /// is in place then does not matter, but it must be safe to read on.
    fn restore(&mut self, state: &mut StateReader<'_>);
}

/// Inside of `impl Converter`: the state is what [`State`] of the converter says, in this format. With
/// `accepts` a range of formats is taken, else this one alone; the manifest must say the same.
///
/// The example stands at [`State`].
#[macro_export]
macro_rules! state_format {
    ($format:literal) => {
        $crate::state_format!($format, accepts $format..=$format);
    };
    ($format:literal, accepts $formats:expr) => {
        const STATE_FORMAT: Option<u16> = Some($format);

        fn save(&self, state: &mut $crate::StateWriter<'_>) {
            $crate::State::save(self, state);
        }

        fn restore(
            &mut self,
            format: u16,
            state: &mut $crate::StateReader<'_>,
        ) -> Result<(), $crate::StateError> {
            state.field(&"its format");
            if ($formats).contains(&format) {
                $crate::State::restore(self, state);
                state.field(&"its end");
            } else {
                state.refuse();
            }
            Ok(())
        }
    };
}

macro_rules! plain {
    ($($type:ty: $method:ident,)*) => {
        $(
            impl State for $type {
                fn save(&self, state: &mut StateWriter<'_>) {
                    state.$method(*self);
                }

                fn restore(&mut self, state: &mut StateReader<'_>) {
                    *self = state.$method();
                }
            }
        )*
    };
}

plain! {
    bool: bool,
    u8: u8,
    u16: u16,
    u32: u32,
    u64: u64,
    Micros: micros,
    Option<Micros>: deadline,
}

macro_rules! ids {
    ($($id:ident)*) => {
        $(
            impl State for $id {
                fn save(&self, state: &mut StateWriter<'_>) {
                    state.u32(self.0);
                }

                fn restore(&mut self, state: &mut StateReader<'_>) {
                    *self = $id(state.u32());
                }
            }
        )*
    };
}

ids!(DeliveryId JobId MarkId RequestId);

/// A count of bytes: plug-ins have less than 4 GB.
impl State for usize {
    fn save(&self, state: &mut StateWriter<'_>) {
        state.u32(*self as u32);
    }

    fn restore(&mut self, state: &mut StateReader<'_>) {
        *self = state.u32() as usize;
    }
}

impl State for Option<Failure> {
    fn save(&self, state: &mut StateWriter<'_>) {
        state.failure(*self);
    }

    fn restore(&mut self, state: &mut StateReader<'_>) {
        let code = state.u16();
        *self = Failure::from_code(code);
        if self.is_none() && code != 0 {
            state.refuse();
        }
    }
}

impl<T: State, const N: usize> State for [T; N] {
    fn save(&self, state: &mut StateWriter<'_>) {
        for entry in self {
            entry.save(state);
        }
    }

    fn restore(&mut self, state: &mut StateReader<'_>) {
        for entry in self {
            entry.restore(state);
        }
    }
}
