//! One table for each set of codes: enum, number, name and text from one place.

/// Declares an enum whose variants have a code on the wire, a name for
/// machines and a text for people.
macro_rules! codes {
    (
        $(#[$attr:meta])*
        pub enum $name:ident: $repr:ty {
            $( $code:literal $label:literal $variant:ident $text:literal, )*
        }
    ) => {
        $(#[$attr])*
        ///
        /// Each has its number on the wire, its name in reports and traces, and a text
        /// for people.
        ///
        /// ```
        #[doc = concat!("use softplug_abi::", stringify!($name), ";")]
        ///
        #[doc = concat!("for known in ", stringify!($name), "::ALL {")]
        #[doc = concat!("    assert_eq!(", stringify!($name), "::from_code(known.code()), Some(*known));")]
        #[doc = concat!("    assert_eq!(", stringify!($name), "::from_name(known.name()), Some(*known));")]
        /// }
        /// ```
        #[derive(Copy, Clone, PartialEq, Eq, Hash, Debug, PartialOrd, Ord)]
        #[repr($repr)]
        pub enum $name {
            $( #[doc = $text] $variant = $code, )*
        }

        impl $name {
            /// Every code there is, in ascending order.
            pub const ALL: &'static [Self] = &[ $( Self::$variant, )* ];

            /// The code on the wire.
            pub const fn code(self) -> $repr {
                self as $repr
            }

            /// The code's meaning; `None` if this version knows none.
            pub const fn from_code(code: $repr) -> Option<Self> {
                match code {
                    $( $code => Some(Self::$variant), )*
                    _ => None,
                }
            }

            /// The name that reports and traces use.
            pub const fn name(self) -> &'static str {
                match self { $( Self::$variant => $label, )* }
            }

            /// The code with this name.
            pub fn from_name(name: &str) -> Option<Self> {
                match name {
                    $( $label => Some(Self::$variant), )*
                    _ => None,
                }
            }

            /// What it means, for people.
            pub const fn text(self) -> &'static str {
                match self { $( Self::$variant => $text, )* }
            }
        }

        impl core::fmt::Display for $name {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                f.write_str(self.name())
            }
        }
    };
}

pub(crate) use codes;
