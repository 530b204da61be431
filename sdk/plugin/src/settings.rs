//! Settings as typed fields, with their part of the manifest.

use softplug_abi::RawValue;
use softplug_abi::wire::copy;

/// The settings of a converter. Made by [`settings!`](crate::settings).
///
/// ```
/// use softplug_plugin::{RawValue, SettingSet, Values};
///
/// softplug_plugin::settings! {
///     struct Settings { echo: bool = false, "Send back what is received."; }
/// }
/// # fn main() {
/// let mut settings = Settings::UNSET;
/// let on: RawValue<'_> = Values::new(&[0, 0, 1, 0, 1, 0, 1]).raw().next().unwrap().unwrap();
/// assert!(settings.set(on.index, &on));
/// assert!(settings.echo);
/// assert_eq!(Settings::COUNT, 1);
/// # }
/// ```
pub trait SettingSet: Copy + core::fmt::Debug {
    /// How many there are.
    const COUNT: u16;
    /// The manifest's list of settings, in pieces to be joined.
    const JSON: &'static [&'static [&'static str]];

    /// All settings before any value has come: of a plug-in that is small, all zeros.
    const UNSET: Self;

    /// Takes the value at `index`; `false` if it is not of the setting's type.
    fn set(&mut self, index: u16, value: &RawValue<'_>) -> bool;
}

impl SettingSet for () {
    const COUNT: u16 = 0;
    const JSON: &'static [&'static [&'static str]] = &[];

    const UNSET: Self = ();

    fn set(&mut self, _index: u16, _value: &RawValue<'_>) -> bool {
        false
    }
}

/// The type of one setting.
///
/// ```
/// use softplug_plugin::{SettingType, Values};
///
/// let number = Values::new(&[0, 0, 2, 0, 8, 0, 0x80, 0x25, 0, 0, 0, 0, 0, 0]);
/// let number = number.raw().next().unwrap().unwrap();
/// assert_eq!(i64::from_value(&number), Some(9_600));
/// assert_eq!(bool::from_value(&number), None);
/// ```
pub trait SettingType: Copy {
    /// Its type in the manifest.
    const TYPE: &'static str;
    /// What else the manifest says of it, beginning with a comma.
    const MORE: &'static [&'static str];
    /// Quotes around its default, if it needs them.
    const QUOTE: &'static str;

    /// Before a value has come.
    const UNSET: Self;

    /// Takes a value; `false` if it is not of this type.
    fn assign(&mut self, value: &RawValue<'_>) -> bool;

    /// From a value of its type.
    fn from_value(value: &RawValue<'_>) -> Option<Self> {
        let mut own = Self::UNSET;
        own.assign(value).then_some(own)
    }
}

impl SettingType for bool {
    const TYPE: &'static str = "bool";
    const MORE: &'static [&'static str] = &[];
    const QUOTE: &'static str = "";

    const UNSET: Self = false;

    #[inline(never)]
    fn assign(&mut self, value: &RawValue<'_>) -> bool {
        put(self, value.bool())
    }
}

impl SettingType for i64 {
    const TYPE: &'static str = "int";
    const MORE: &'static [&'static str] = &[];
    const QUOTE: &'static str = "";

    const UNSET: Self = 0;

    #[inline(never)]
    fn assign(&mut self, value: &RawValue<'_>) -> bool {
        put(self, value.int())
    }
}

fn put<T>(own: &mut T, value: Option<T>) -> bool {
    let is_there = value.is_some();
    if let Some(value) = value {
        *own = value;
    }
    is_there
}

/// Up to `N` bytes.
///
/// ```
/// use softplug_plugin::{Bytes, SettingType, Values};
///
/// let value = Values::new(&[0, 0, 4, 0, 2, 0, 13, 10]).raw().next().unwrap().unwrap();
/// let trailer = Bytes::<8>::from_value(&value).unwrap();
/// assert_eq!(trailer.as_slice(), b"\r\n");
/// assert!(trailer.contains(b'\n'));
/// // Two bytes do not fit one.
/// assert_eq!(Bytes::<1>::from_value(&value), None);
/// ```
#[derive(Copy, Clone, Debug)]
pub struct Bytes<const N: usize> {
    bytes: [u8; N],
    length: usize,
}

impl<const N: usize> Bytes<N> {
    /// The bytes.
    pub fn as_slice(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }

    /// Whether `byte` is one of them.
    #[allow(clippy::manual_contains, reason = "`contains` brings a search of 400 bytes of code")]
    pub fn contains(&self, byte: u8) -> bool {
        self.as_slice().iter().any(|own| *own == byte)
    }
}

impl<const N: usize> PartialEq for Bytes<N> {
    fn eq(&self, other: &Self) -> bool {
        self.as_slice() == other.as_slice()
    }
}

impl<const N: usize> Eq for Bytes<N> {}

/// Takes bytes, if there are any and they fit: once for all lengths.
#[inline(never)]
fn put_bytes(own: &mut [u8], length: &mut usize, bytes: Option<&[u8]>) -> bool {
    let Some(bytes) = bytes.filter(|bytes| bytes.len() <= own.len()) else { return false };
    copy(own, bytes);
    *length = bytes.len();
    true
}

impl<const N: usize> SettingType for Bytes<N> {
    const TYPE: &'static str = "bytes";
    const MORE: &'static [&'static str] = &[",\"max\":", Decimal::<N>::TEXT];
    const QUOTE: &'static str = "\"";

    const UNSET: Self = Self { bytes: [0; N], length: 0 };

    fn assign(&mut self, value: &RawValue<'_>) -> bool {
        put_bytes(&mut self.bytes, &mut self.length, value.bytes())
    }
}

/// UTF-8 text of up to `N` bytes.
///
/// ```
/// use softplug_plugin::{SettingType, Text, Values};
///
/// let value = Values::new(&[0, 0, 3, 0, 2, 0, b'O', b'1']).raw().next().unwrap().unwrap();
/// assert_eq!(Text::<40>::from_value(&value).unwrap().as_str(), "O1");
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Text<const N: usize>(Bytes<N>);

impl<const N: usize> Text<N> {
    /// The text as bytes. Without [`as_str`](Self::as_str) a plug-in needs no check of UTF-8.
    pub fn as_bytes(&self) -> &[u8] {
        self.0.as_slice()
    }

    /// The text.
    pub fn as_str(&self) -> &str {
        core::str::from_utf8(self.0.as_slice()).unwrap_or_default()
    }
}

impl<const N: usize> SettingType for Text<N> {
    const TYPE: &'static str = "text";
    const MORE: &'static [&'static str] = <Bytes<N> as SettingType>::MORE;
    const QUOTE: &'static str = "\"";

    const UNSET: Self = Self(Bytes::UNSET);

    fn assign(&mut self, value: &RawValue<'_>) -> bool {
        put_bytes(&mut self.0.bytes, &mut self.0.length, value.text_bytes())
    }
}

/// A number of up to three digits as JSON, with leading blanks.
struct Decimal<const N: usize>;

impl<const N: usize> Decimal<N> {
    const DIGITS: [u8; 3] = {
        assert!(N < 1_000, "a setting holds at most 400 bytes");
        let mut digits = *b"  0";
        let mut rest = N;
        let mut at = 3;
        while rest > 0 {
            at -= 1;
            digits[at] = b'0' + (rest % 10) as u8;
            rest /= 10;
        }
        digits
    };
    const TEXT: &'static str = match core::str::from_utf8(&Self::DIGITS) {
        Ok(text) => text,
        Err(_) => unreachable!(),
    };
}

/// One of a list of names. Made by [`choice!`](crate::choice).
///
/// ```
/// use softplug_plugin::Choice;
///
/// softplug_plugin::choice! {
///     /// Which way lines end.
///     pub enum LineEnd { Lf = "lf", CrLf = "crlf" }
/// }
/// # fn main() {
/// assert!(matches!(LineEnd::from_index(1), Some(LineEnd::CrLf)));
/// assert!(LineEnd::from_index(2).is_none());
/// # }
/// ```
pub trait Choice: Copy {
    /// The manifest's list of names, beginning with a comma.
    const JSON: &'static [&'static str];
    /// The first choice.
    const FIRST: Self;

    /// The choice with this number.
    fn from_index(index: u16) -> Option<Self>;
}

impl<T: Choice> SettingType for T {
    const TYPE: &'static str = "choice";
    const MORE: &'static [&'static str] = T::JSON;
    const QUOTE: &'static str = "\"";

    const UNSET: Self = T::FIRST;

    #[inline(never)]
    fn assign(&mut self, value: &RawValue<'_>) -> bool {
        put(self, value.choice().and_then(T::from_index))
    }
}
