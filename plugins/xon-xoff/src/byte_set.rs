//! A set of bytes that is asked as quickly whether it has many or few.

#[derive(Copy, Clone, Debug, Default)]
pub(crate) struct ByteSet([u32; 8]);

impl ByteSet {
    pub(crate) fn of(bytes: &[u8]) -> Self {
        let mut set = Self::default();
        for byte in bytes {
            set.0[usize::from(byte / 32)] |= 1 << (byte % 32);
        }
        set
    }

    #[inline]
    pub(crate) fn has(&self, byte: u8) -> bool {
        self.0[usize::from(byte / 32)] >> (byte % 32) & 1 == 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_has_what_it_was_made_of() {
        let bytes = [0x00, 0x1F, 0x20, 0x7F, 0x80, 0xFF];
        let set = ByteSet::of(&bytes);
        let all: Vec<u8> = (0..=255).filter(|byte| set.has(*byte)).collect();
        assert_eq!(all, bytes);
    }
}
