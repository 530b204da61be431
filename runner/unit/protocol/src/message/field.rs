//! The fields of messages: what each type of them is on the wire.

use softplug_abi::wire::{Reader, Writer};
use softplug_abi::{Failure, LinkDownReason, NoteLevel};

use super::Digest;
use super::codes::{Outcome, SlotState, SwapOutcome, WhenCode};

/// A field's bytes.
pub(super) trait Field<'a>: Sized {
    fn read(reader: &mut Reader<'a>, name: &'static str) -> Self;
    fn write(&self, writer: &mut Writer<'_>);
}

macro_rules! numbers {
    ($($number:ident)*) => {$(
        impl Field<'_> for $number {
            fn read(reader: &mut Reader<'_>, _: &'static str) -> Self {
                reader.$number()
            }
            fn write(&self, writer: &mut Writer<'_>) {
                writer.$number(*self);
            }
        }
    )*};
}

numbers! { u8 u16 u32 u64 }

impl Field<'_> for bool {
    fn read(reader: &mut Reader<'_>, name: &'static str) -> Self {
        let flag = reader.u8();
        reader.require(name, flag <= 1);
        flag == 1
    }
    fn write(&self, writer: &mut Writer<'_>) {
        writer.u8(u8::from(*self));
    }
}

impl Field<'_> for Digest {
    fn read(reader: &mut Reader<'_>, _: &'static str) -> Self {
        let mut digest = [0; 32];
        digest.iter_mut().zip(reader.bytes(32)).for_each(|(to, from)| *to = *from);
        digest
    }
    fn write(&self, writer: &mut Writer<'_>) {
        writer.bytes(self);
    }
}

/// All that is left of the body. Only a message's last field can be this.
impl<'a> Field<'a> for &'a [u8] {
    fn read(reader: &mut Reader<'a>, _: &'static str) -> Self {
        reader.rest()
    }
    fn write(&self, writer: &mut Writer<'_>) {
        writer.bytes(self);
    }
}

/// All that is left of the body, as UTF-8. Only a message's last field can be this.
impl<'a> Field<'a> for &'a str {
    fn read(reader: &mut Reader<'a>, name: &'static str) -> Self {
        reader.text(name, usize::from(u16::MAX))
    }
    fn write(&self, writer: &mut Writer<'_>) {
        writer.bytes(self.as_bytes());
    }
}

/// 0 is none.
impl Field<'_> for Option<Failure> {
    fn read(reader: &mut Reader<'_>, name: &'static str) -> Self {
        let code = reader.u16();
        let known = Failure::from_code(code);
        reader.require(name, code == 0 || known.is_some());
        known
    }
    fn write(&self, writer: &mut Writer<'_>) {
        writer.u16(self.map_or(0, Failure::code));
    }
}

macro_rules! codes {
    ($($code:ident otherwise $otherwise:ident;)*) => {$(
        impl Field<'_> for $code {
            fn read(reader: &mut Reader<'_>, name: &'static str) -> Self {
                let known = Self::from_code(reader.u8());
                reader.known(name, known, Self::$otherwise)
            }
            fn write(&self, writer: &mut Writer<'_>) {
                writer.u8(self.code());
            }
        }
    )*};
}

codes! {
    SlotState otherwise Empty;
    WhenCode otherwise Idle;
    SwapOutcome otherwise Refused;
    Outcome otherwise Failed;
    LinkDownReason otherwise Failed;
    NoteLevel otherwise Info;
}
