//! Codes that stand in messages.

macro_rules! codes {
    ($( $(#[$doc:meta])* pub enum $name:ident { $( $(#[$of:meta])* $code:literal $variant:ident, )* } )*) => {
        $(
            $(#[$doc])*
            #[derive(Copy, Clone, PartialEq, Eq, Debug)]
            pub enum $name { $( $(#[$of])* $variant = $code, )* }

            impl $name {
                /// All there are, in the order of their codes.
                pub const ALL: &'static [Self] = &[$( Self::$variant, )*];

                /// Its number in a message.
                pub const fn code(self) -> u8 {
                    self as u8
                }

                /// The one with this number.
                pub fn from_code(code: u8) -> Option<Self> {
                    Self::ALL.iter().copied().find(|known| known.code() == code)
                }
            }
        )*
    };
}

codes! {
    /// What a slot of the unit's memory holds.
    pub enum SlotState {
        /// Nothing that can be run.
        0 Empty,
        /// A plug-in that is being written.
        1 Writing,
        /// A plug-in that was written and verified, and has not run.
        2 Written,
        /// A plug-in that runs on trial.
        3 OnTrial,
        /// A plug-in that has proved itself.
        4 Confirmed,
        /// A plug-in that failed its trial.
        5 Failed,
    }

    /// When a swap takes place.
    pub enum WhenCode {
        /// At once, with the running one's state, or not at all.
        0 Now,
        /// When nothing is under way.
        1 Idle,
        /// At once if the state can be carried over, else when nothing is under way.
        2 NowOrIdle,
    }

    /// What came of a swap.
    pub enum SwapOutcome {
        /// It waits until nothing is under way.
        0 Waiting,
        /// The new plug-in runs, with the state of the old one.
        1 DoneWithState,
        /// The new plug-in runs, as new.
        2 Done,
        /// The old plug-in goes on.
        3 Refused,
        /// The trial is over, the new plug-in stays.
        4 Kept,
        /// The new plug-in failed on trial: the old one goes on.
        5 Reverted,
    }

    /// How a job ended.
    pub enum Outcome {
        /// The last bit has left.
        0 Done,
        /// It was given up, or aborted.
        1 Failed,
        /// The program cannot be sent; nothing was.
        2 CheckFailed,
        /// Its data did not come to the end.
        3 SourceFailed,
    }
}
