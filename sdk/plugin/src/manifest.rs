//! Manifests without drift: the settings are declared once, as a struct, and
//! their part of the manifest follows from it at compile time.

/// Declares the settings of a converter: a struct, and its part of the manifest.
///
/// Each line is: name, type, default, for a number its range and unit, and a
/// sentence for people. Types: `bool`, `i64`, [`Bytes<N>`](crate::Bytes) (the default is a string of
/// hex pairs), [`Text<N>`](crate::Text), or a [`choice!`](crate::choice) (the default is its name).
///
/// ```
/// use softplug_plugin::Bytes;
///
/// softplug_plugin::choice! {
///     /// Which way lines end.
///     pub enum LineEnd { Lf = "lf", CrLf = "crlf" }
/// }
///
/// softplug_plugin::settings! {
///     /// Settings of the example.
///     pub struct Settings {
///         quiet: i64 = 3000 in 0..=600000 "ms", "Silence that ends a reception.";
///         echo: bool = false, "Send back what is received.";
///         trailer: Bytes<32> = "0d 0a", "Sent after the program.";
///         line_end: LineEnd = "lf", "How lines end.";
///     }
/// }
/// # fn main() {}
/// ```
#[macro_export]
macro_rules! settings {
    (
        $(#[$attr:meta])*
        $vis:vis struct $name:ident {
            $( $field:ident: $kind:ty = $default:literal
               $(in $min:literal ..= $max:literal $unit:literal)?, $text:literal; )*
        }
    ) => {
        $(#[$attr])*
        #[derive(Copy, Clone, Debug)]
        $vis struct $name {
            $( #[doc = $text] pub $field: $kind, )*
        }

        const _: () = {
            use $crate::{RawValue, SettingSet, SettingType};

            impl SettingSet for $name {
                const COUNT: u16 = [$( stringify!($field), )*].len() as u16;
                const JSON: &'static [&'static [&'static str]] = &[
                    $(
                        &[
                            concat!(",{\"name\":\"", stringify!($field), "\",\"type\":\""),
                            <$kind as SettingType>::TYPE,
                            "\",\"default\":",
                            <$kind as SettingType>::QUOTE,
                            concat!($default),
                            <$kind as SettingType>::QUOTE,
                            concat!($( ",\"min\":", $min, ",\"max\":", $max )?),
                            $( $crate::manifest::unit($unit, concat!(",\"unit\":\"", $unit, "\"")) )?
                        ],
                        <$kind as SettingType>::MORE,
                        &[concat!(",\"text\":\"", $text, "\"}")],
                    )*
                ];

                const UNSET: Self = Self { $( $field: <$kind as SettingType>::UNSET, )* };

                fn set(&mut self, index: u16, value: &RawValue<'_>) -> bool {
                    let mut at = 0;
                    $(
                        if index == at {
                            return self.$field.assign(value);
                        }
                        at += 1;
                    )*
                    let _ = (at, value);
                    false
                }
            }
        };
    };
}

/// Declares a choice for [`settings!`](crate::settings): an enum whose variants have names.
#[macro_export]
macro_rules! choice {
    (
        $(#[$attr:meta])*
        $vis:vis enum $name:ident {
            $( #[$first_attr:meta] )* $first:ident = $first_text:literal
            $(, $( #[$variant_attr:meta] )* $variant:ident = $text:literal )* $(,)?
        }
    ) => {
        $(#[$attr])*
        #[derive(Copy, Clone, PartialEq, Eq, Debug)]
        $vis enum $name {
            $( #[$first_attr] )*
            #[doc = concat!("`", $first_text, "`")]
            $first,
            $(
                $( #[$variant_attr] )*
                #[doc = concat!("`", $text, "`")]
                $variant,
            )*
        }

        impl $crate::Choice for $name {
            const JSON: &'static [&'static str] = &[
                concat!(",\"choices\":[\"", $first_text, "\""),
                $( concat!(",\"", $text, "\""), )*
                "]",
            ];
            const FIRST: Self = Self::$first;

            fn from_index(index: u16) -> Option<Self> {
                [Self::$first $(, Self::$variant)*].get(usize::from(index)).copied()
            }
        }
    };
}

/// A manifest as a `&'static str`: fixed entries, with the settings' part in.
///
/// `head` and `tail` are JSON members without braces around them; `tail` may be left out.
///
/// ```
/// # softplug_plugin::settings! { pub struct Settings { echo: bool = false, "Send back."; } }
/// const MANIFEST: &str = softplug_plugin::manifest! {
///     head: r#""abi": "1.0", "name": "example", "version": "1.0.0", "licence": "MIT",
///         "protocol": "none", "description": "An example.""#,
///     settings: Settings,
///     tail: r#""jobs": [{"name": "send", "text": "Sends."}]"#,
/// };
/// assert!(softplug_abi::manifest::Manifest::parse(MANIFEST.as_bytes()).is_ok());
/// ```
#[macro_export]
macro_rules! manifest {
    (head: $head:expr, settings: $settings:ty $(, tail: $tail:expr)? $(,)?) => {{
        const PARTS: &[&[&str]] = <$settings as $crate::SettingSet>::JSON;
        const HEAD: &str = $head;
        const TAIL: &str = concat!($( ",", $tail )?);
        const LENGTH: usize = $crate::manifest::length(HEAD, PARTS, TAIL);
        const BYTES: [u8; LENGTH] = $crate::manifest::join(HEAD, PARTS, TAIL);
        match core::str::from_utf8(&BYTES) {
            Ok(manifest) => manifest,
            Err(_) => unreachable!(),
        }
    }};
}

/// A number without a unit has no entry for it.
#[doc(hidden)]
pub const fn unit(unit: &'static str, entry: &'static str) -> &'static str {
    if unit.is_empty() { "" } else { entry }
}

const OPEN: &str = "{";
const SETTINGS: &str = ",\"settings\":[";
const END_SETTINGS: &str = "]";
const CLOSE: &str = "}";

/// Length of a manifest in bytes; for [`manifest!`](crate::manifest!).
#[doc(hidden)]
pub const fn length(head: &str, parts: &[&[&str]], tail: &str) -> usize {
    let mut length =
        OPEN.len() + head.len() + SETTINGS.len() + END_SETTINGS.len() + tail.len() + CLOSE.len();
    let mut outer = 0;
    while outer < parts.len() {
        let mut inner = 0;
        while inner < parts[outer].len() {
            length += parts[outer][inner].len();
            inner += 1;
        }
        outer += 1;
    }
    // The comma before the first setting falls away.
    if parts.is_empty() { length } else { length - 1 }
}

/// A manifest from its parts; for [`manifest!`](crate::manifest!).
#[doc(hidden)]
pub const fn join<const N: usize>(head: &str, parts: &[&[&str]], tail: &str) -> [u8; N] {
    let mut out = [0; N];
    let mut at = put(&mut out, 0, OPEN, 0);
    at = put(&mut out, at, head, 0);
    at = put(&mut out, at, SETTINGS, 0);
    let mut outer = 0;
    while outer < parts.len() {
        let mut inner = 0;
        while inner < parts[outer].len() {
            let is_first = outer == 0 && inner == 0;
            at = put(&mut out, at, parts[outer][inner], is_first as usize);
            inner += 1;
        }
        outer += 1;
    }
    at = put(&mut out, at, END_SETTINGS, 0);
    at = put(&mut out, at, tail, 0);
    put(&mut out, at, CLOSE, 0);
    out
}

const fn put(out: &mut [u8], mut at: usize, text: &str, skip: usize) -> usize {
    let bytes = text.as_bytes();
    let mut from = skip;
    while from < bytes.len() {
        out[at] = bytes[from];
        at += 1;
        from += 1;
    }
    at
}
