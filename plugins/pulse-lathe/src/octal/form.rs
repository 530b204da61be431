//! The forms of a block, by its first word.

/// The bit of G that says: S, T, M and F as before.
const AS_BEFORE: u16 = 0o0010;

/// What a block is.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Form {
    Loop,
    Zero { x: bool, z: bool },
    Axis { is_z: bool, is_minus: bool },
    Thread { is_minus: bool },
    Taper { z_is_main: bool, x_minus: bool, z_minus: bool },
    Arc { clockwise: bool, quadrant: u8 },
}

impl Form {
    /// The form that G stands for, and whether S, T, M and F are as before; `None`: it is not in
    /// the table.
    pub(crate) fn of(g: u16) -> Option<(Self, bool)> {
        let as_before = g & AS_BEFORE != 0;
        let form = match g & !AS_BEFORE {
            0o0000 | 0o0002 | 0o0004 if as_before => return None,
            0o0000 => Self::Loop,
            0o0002 => Self::Zero { x: true, z: false },
            0o0004 => Self::Zero { x: false, z: true },
            0o6000 => Self::Axis { is_z: true, is_minus: false },
            0o4000 => Self::Axis { is_z: true, is_minus: true },
            0o1000 => Self::Axis { is_z: false, is_minus: false },
            0o0001 => Self::Axis { is_z: false, is_minus: true },
            0o6100 => Self::Thread { is_minus: false },
            0o4100 => Self::Thread { is_minus: true },
            g => Self::on_two_axes(g)?,
        };
        Some((form, as_before))
    }

    /// In these words 2000 is z+ and 1000 is x+, for an arc at its beginning.
    fn on_two_axes(g: u16) -> Option<Self> {
        let (z_minus, x_minus) = (g & 0o2000 == 0, g & 0o1000 == 0);
        match g & 0o0777 {
            0o200 => Some(Self::Taper { z_is_main: g & 0o4000 != 0, x_minus, z_minus }),
            0o040 => {
                let clockwise = g & 0o4000 == 0;
                let quadrant = match (z_minus != clockwise, x_minus != clockwise) {
                    (true, false) => 0,
                    (true, true) => 1,
                    (false, true) => 2,
                    (false, false) => 3,
                };
                Some(Self::Arc { clockwise, quadrant })
            }
            _ => None,
        }
    }

    /// Words of the form, without STM and F.
    fn own_words(self) -> u16 {
        match self {
            Self::Loop => 3,
            Self::Zero { .. } => 1,
            Self::Axis { .. } | Self::Thread { .. } => 4,
            Self::Taper { .. } => 5,
            Self::Arc { .. } => 8,
        }
    }

    /// Words of a block.
    pub(crate) fn words(self, as_before: bool) -> u16 {
        let has_more = !as_before && !matches!(self, Self::Loop | Self::Zero { .. });
        self.own_words() + if has_more { 2 } else { 0 }
    }

    /// Whether the word at this place of the block is the high one of a double.
    pub(crate) fn is_high(self, place: u16) -> bool {
        match self {
            Self::Loop | Self::Zero { .. } => false,
            Self::Axis { .. } | Self::Thread { .. } | Self::Taper { .. } => place == 3,
            Self::Arc { .. } => matches!(place, 3 | 5 | 7),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Form;

    /// The table of the page: clockwise, counter-clockwise, z main, x main.
    const TABLE: [[u16; 4]; 4] = [
        [0o2040, 0o5040, 0o7200, 0o3200],
        [0o3040, 0o4040, 0o5200, 0o1200],
        [0o1040, 0o6040, 0o4200, 0o0200],
        [0o0040, 0o7040, 0o6200, 0o2200],
    ];

    #[test]
    fn every_g_of_the_table_has_its_form_and_no_other_word_has_one() {
        let mut known = vec![0o0000, 0o0002, 0o0004];
        for (quadrant, row) in TABLE.iter().enumerate() {
            let q = quadrant as u8;
            let (z_minus, x_minus) = (matches!(q, 1 | 2), matches!(q, 2 | 3));
            let forms = [
                Form::Arc { clockwise: true, quadrant: q },
                Form::Arc { clockwise: false, quadrant: q },
                Form::Taper { z_is_main: true, x_minus, z_minus },
                Form::Taper { z_is_main: false, x_minus, z_minus },
            ];
            for (g, form) in row.iter().zip(forms) {
                assert_eq!(Form::of(*g), Some((form, false)), "{g:04o}");
                assert_eq!(Form::of(g + 0o10), Some((form, true)), "{g:04o}");
                known.extend([*g, g + 0o10]);
            }
        }
        for (g, form) in [
            (0o6000, Form::Axis { is_z: true, is_minus: false }),
            (0o4000, Form::Axis { is_z: true, is_minus: true }),
            (0o1000, Form::Axis { is_z: false, is_minus: false }),
            (0o0001, Form::Axis { is_z: false, is_minus: true }),
            (0o6100, Form::Thread { is_minus: false }),
            (0o4100, Form::Thread { is_minus: true }),
        ] {
            assert_eq!(Form::of(g), Some((form, false)), "{g:04o}");
            assert_eq!(Form::of(g + 0o10), Some((form, true)), "{g:04o}");
            known.extend([g, g + 0o10]);
        }
        assert_eq!(Form::of(0o0000), Some((Form::Loop, false)));
        assert_eq!(Form::of(0o0004), Some((Form::Zero { x: false, z: true }, false)));
        assert_eq!(Form::of(0o0002), Some((Form::Zero { x: true, z: false }, false)));
        for g in 0..=0o7777 {
            assert_eq!(Form::of(g).is_some(), known.contains(&g), "{g:04o}");
        }
    }
}
