//! The fields of the state: one list of them both saves and restores, which is
//! half the code of two.

use softplug_plugin::{Failure, Micros, StateError, StateReader, StateWriter};

/// What is done with each field.
#[derive(Debug)]
pub(crate) enum Fields<'a, 'b> {
    Save(&'a mut StateWriter<'b>),
    /// With the first fault.
    Restore(&'a mut StateReader<'b>, Result<(), StateError>),
}

impl Fields<'_, '_> {
    #[inline(never)]
    pub(crate) fn bytes(&mut self, bytes: &mut [u8]) {
        match self {
            Self::Save(writer) => writer.bytes(bytes),
            Self::Restore(reader, _) => {
                let saved = reader.bytes(bytes.len());
                for (own, byte) in bytes.iter_mut().zip(saved) {
                    *own = *byte;
                }
            }
        }
    }

    /// The lowest `count` bytes of a number.
    #[inline(never)]
    fn number(&mut self, value: u64, count: usize) -> u64 {
        let mut bytes = value.to_le_bytes();
        self.bytes(bytes.get_mut(..count).unwrap_or_default());
        u64::from_le_bytes(bytes)
    }

    #[inline(never)]
    pub(crate) fn u8(&mut self, value: &mut u8) {
        *value = self.number(u64::from(*value), 1) as u8;
    }

    #[inline(never)]
    pub(crate) fn bool(&mut self, value: &mut bool) {
        *value = self.number(u64::from(*value), 1) == 1;
    }

    #[inline(never)]
    pub(crate) fn u32(&mut self, value: &mut u32) {
        *value = self.number(u64::from(*value), 4) as u32;
    }

    #[inline(never)]
    pub(crate) fn u64(&mut self, value: &mut u64) {
        *value = self.number(*value, 8);
    }

    #[inline(never)]
    pub(crate) fn usize(&mut self, value: &mut usize) {
        *value = self.number(*value as u64, 2) as usize;
    }

    /// An instant, or that there is none.
    #[inline(never)]
    pub(crate) fn deadline(&mut self, value: &mut Option<Micros>) {
        let mut is_set = value.is_some();
        let mut at = value.unwrap_or_default().0.cast_unsigned();
        self.bool(&mut is_set);
        self.u64(&mut at);
        *value = is_set.then_some(Micros(at.cast_signed()));
    }

    #[inline(never)]
    pub(crate) fn failure(&mut self, value: &mut Option<Failure>) {
        let code = self.number(u64::from(value.map_or(0, Failure::code)), 2);
        *value = Failure::from_code(code as u16);
    }

    /// One of few values: its place among all.
    pub(crate) fn choice<T: Copy + Default>(&mut self, mut place: u8, all: &[T]) -> T {
        self.u8(&mut place);
        let value = all.get(usize::from(place)).copied();
        if let (None, Self::Restore(_, result)) = (value, self) {
            *result = Err(StateError);
        }
        value.unwrap_or_default()
    }

    /// Whether all values were such as can be.
    pub(crate) fn end(self) -> Result<(), StateError> {
        match self {
            Self::Save(_) => Ok(()),
            Self::Restore(_, result) => result,
        }
    }
}
