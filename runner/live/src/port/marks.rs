//! Decoder of the marks that a terminal puts between its bytes (PARMRK).
//!
//! The kernel writes `FF FF` for a byte FF, `FF 00 x` for a byte x that came
//! damaged, and `FF 00 00` for a break, which a damaged NUL looks like as
//! well. Leaders are NULs, so the difference matters: it is a break only if
//! the driver's counter of breaks rose. The same counters tell parity from
//! framing, and they alone show overruns.

use softplug_abi::{LineErrorKind, Parity};

/// What a port heard.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Input<'a> {
    /// Good bytes, at least one.
    Bytes(&'a [u8]),
    /// A damaged character or a break.
    LineError {
        /// What happened.
        kind: LineErrorKind,
        /// The character as it was read, if there is one.
        byte: Option<u8>,
        /// 0: exactly here. n: somewhere in the last n bytes.
        span: u32,
    },
}

/// Counters of a serial driver since it was loaded; they wrap.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub struct LineCounters {
    /// Stop bits that were missing.
    pub framing: u32,
    /// Parity bits that were wrong.
    pub parity: u32,
    /// Breaks.
    pub breaks: u32,
    /// Characters lost in the UART and in the kernel's buffer.
    pub overruns: u32,
}

impl LineCounters {
    fn since(self, before: Self) -> Self {
        Self {
            framing: self.framing.wrapping_sub(before.framing),
            parity: self.parity.wrapping_sub(before.parity),
            breaks: self.breaks.wrapping_sub(before.breaks),
            overruns: self.overruns.wrapping_sub(before.overruns),
        }
    }

    fn plus(self, rise: Self) -> Self {
        Self {
            framing: self.framing.wrapping_add(rise.framing),
            parity: self.parity.wrapping_add(rise.parity),
            breaks: self.breaks.wrapping_add(rise.breaks),
            overruns: self.overruns.wrapping_add(rise.overruns),
        }
    }
}

/// Decodes what is read from a terminal with INPCK and PARMRK set.
///
/// State is carried across reads: a mark may be cut anywhere.
#[derive(Debug)]
pub struct MarkDecoder {
    state: State,
    parity: Parity,
    counters: Option<LineCounters>,
    /// Counted but not yet seen as a mark: what the counters rose by at this
    /// read and at the one before. What stays unseen for longer belongs to
    /// characters that the kernel dropped.
    fresh: LineCounters,
    older: LineCounters,
}

#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum State {
    Plain,
    Escaped,
    Damaged,
}

impl MarkDecoder {
    /// A decoder for a line with this parity. `counters` are those at the
    /// start, `None` where the driver has none.
    pub fn new(parity: Parity, counters: Option<LineCounters>) -> Self {
        let none = LineCounters::default();
        Self { state: State::Plain, parity, counters, fresh: none, older: none }
    }

    /// Decodes one read. `counters` are those after it.
    pub fn decode(
        &mut self,
        raw: &[u8],
        counters: Option<LineCounters>,
        sink: &mut impl FnMut(Input<'_>),
    ) {
        let overruns = self.count(counters);
        let mut good = 0;
        let mut begin = 0;
        for (at, &byte) in raw.iter().enumerate() {
            match (self.state, byte) {
                (State::Plain, 0xFF) => {
                    good += emit(&raw[begin..at], sink);
                    begin = at + 1;
                    self.state = State::Escaped;
                }
                (State::Plain, _) => {}
                (State::Escaped, 0) => {
                    begin = at + 1;
                    self.state = State::Damaged;
                }
                (State::Escaped, 0xFF) => {
                    // The second FF stands for the byte: it opens the next run.
                    begin = at;
                    self.state = State::Plain;
                }
                (State::Escaped, _) => {
                    // No kernel writes this; losing the FF would be worse.
                    good += emit(&[0xFF], sink);
                    begin = at;
                    self.state = State::Plain;
                }
                (State::Damaged, _) => {
                    sink(self.judge(byte));
                    begin = at + 1;
                    self.state = State::Plain;
                }
            }
        }
        if self.state == State::Plain {
            good += emit(&raw[begin..], sink);
        }
        if overruns > 0 {
            // The counter does not say where: somewhere in this read.
            sink(Input::LineError { kind: LineErrorKind::Overrun, byte: None, span: good.max(1) });
        }
    }

    /// Takes the counters in and returns the overruns since the last read.
    fn count(&mut self, counters: Option<LineCounters>) -> u32 {
        let (Some(now), Some(before)) = (counters, self.counters) else {
            self.counters = counters;
            return 0;
        };
        let rise = now.since(before);
        self.counters = counters;
        if self.state == State::Plain {
            self.older = self.fresh;
            self.fresh = rise;
        } else {
            // The mark under way may have been counted before: nothing ages.
            self.fresh = self.fresh.plus(rise);
        }
        rise.overruns
    }

    fn judge(&mut self, byte: u8) -> Input<'static> {
        if byte == 0 && self.take(|counters| &mut counters.breaks) {
            return Input::LineError { kind: LineErrorKind::Break, byte: None, span: 0 };
        }
        let parity = self.fresh.parity > 0 || self.older.parity > 0;
        let framing = self.fresh.framing > 0 || self.older.framing > 0;
        let kind = match (parity, framing) {
            (true, false) => {
                self.take(|counters| &mut counters.parity);
                LineErrorKind::Parity
            }
            (false, true) => {
                self.take(|counters| &mut counters.framing);
                LineErrorKind::Framing
            }
            _ if self.parity == Parity::None => LineErrorKind::Framing,
            _ => LineErrorKind::ParityOrFraming,
        };
        Input::LineError { kind, byte: Some(byte), span: 0 }
    }

    fn take(&mut self, which: impl Fn(&mut LineCounters) -> &mut u32) -> bool {
        for counters in [&mut self.older, &mut self.fresh] {
            let count = which(counters);
            if *count > 0 {
                *count -= 1;
                return true;
            }
        }
        false
    }
}

fn emit(bytes: &[u8], sink: &mut impl FnMut(Input<'_>)) -> u32 {
    if !bytes.is_empty() {
        sink(Input::Bytes(bytes));
    }
    bytes.len() as u32
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[derive(Clone, PartialEq, Eq, Debug)]
    enum Heard {
        Byte(u8),
        Error(LineErrorKind, Option<u8>),
    }

    fn decode(
        decoder: &mut MarkDecoder,
        raw: &[u8],
        counters: Option<LineCounters>,
        heard: &mut Vec<Heard>,
    ) {
        decoder.decode(raw, counters, &mut |input| match input {
            Input::Bytes(bytes) => {
                assert!(!bytes.is_empty());
                heard.extend(bytes.iter().map(|byte| Heard::Byte(*byte)));
            }
            Input::LineError { kind, byte, .. } => heard.push(Heard::Error(kind, byte)),
        });
    }

    fn one(parity: Parity, rise: Option<LineCounters>, raw: &[u8]) -> Vec<Heard> {
        let mut heard = Vec::new();
        let start = rise.map(|_| LineCounters::default());
        decode(&mut MarkDecoder::new(parity, start), raw, rise, &mut heard);
        heard
    }

    const NONE: LineCounters = LineCounters { framing: 0, parity: 0, breaks: 0, overruns: 0 };

    #[test]
    fn a_break_is_one_only_if_it_was_counted() {
        let raw = [0xFF, 0, 0];
        let broken = Some(LineCounters { breaks: 1, ..NONE });
        let parity = Some(LineCounters { parity: 1, ..NONE });
        let break_ = vec![Heard::Error(LineErrorKind::Break, None)];
        let bad_nul = vec![Heard::Error(LineErrorKind::Parity, Some(0))];
        assert_eq!(one(Parity::Even, broken, &raw), break_);
        assert_eq!(one(Parity::Even, parity, &raw), bad_nul);
        let unknown = vec![Heard::Error(LineErrorKind::ParityOrFraming, Some(0))];
        assert_eq!(one(Parity::Even, None, &raw), unknown);
        // A counter of one break makes no break of the next bad NUL.
        let both = Some(LineCounters { breaks: 1, parity: 1, ..NONE });
        let twice = [0xFF, 0, 0, 0xFF, 0, 0];
        assert_eq!(one(Parity::Even, both, &twice), [break_, bad_nul].concat());
    }

    #[test]
    fn counters_tell_parity_from_framing() {
        let raw = [0xFF, 0, b'G'];
        let kind = |parity, rise| match one(parity, rise, &raw)[..] {
            [Heard::Error(kind, Some(b'G'))] => kind,
            ref other => panic!("{other:?}"),
        };
        let framing = Some(LineCounters { framing: 1, ..NONE });
        let both = Some(LineCounters { framing: 1, parity: 1, ..NONE });
        assert_eq!(kind(Parity::Even, framing), LineErrorKind::Framing);
        assert_eq!(kind(Parity::Even, both), LineErrorKind::ParityOrFraming);
        assert_eq!(kind(Parity::Even, Some(NONE)), LineErrorKind::ParityOrFraming);
        assert_eq!(kind(Parity::None, None), LineErrorKind::Framing);
    }

    #[test]
    fn a_count_without_a_mark_is_forgotten() {
        let mut decoder = MarkDecoder::new(Parity::Even, Some(NONE));
        let mut heard = Vec::new();
        let counted = Some(LineCounters { breaks: u32::MAX, ..NONE });
        decoder.counters = counted;
        let wrapped = Some(NONE);
        decode(&mut decoder, b"a", wrapped, &mut heard);
        // One read later the mark is still believed, two reads later not.
        decode(&mut decoder, b"b", wrapped, &mut heard);
        decode(&mut decoder, &[0xFF, 0, 0], wrapped, &mut heard);
        let bad_nul = Heard::Error(LineErrorKind::ParityOrFraming, Some(0));
        assert_eq!(heard, [Heard::Byte(b'a'), Heard::Byte(b'b'), bad_nul]);
    }

    #[test]
    fn an_overrun_spans_the_read() {
        let mut decoder = MarkDecoder::new(Parity::None, Some(NONE));
        let mut errors = Vec::new();
        let lost = Some(LineCounters { overruns: 3, ..NONE });
        decoder.decode(b"N10G1", lost, &mut |input| {
            if let Input::LineError { kind, byte, span } = input {
                errors.push((kind, byte, span));
            }
        });
        assert_eq!(errors, [(LineErrorKind::Overrun, None, 5)]);
    }

    fn heard() -> impl Strategy<Value = Heard> {
        prop_oneof![
            4 => any::<u8>().prop_map(Heard::Byte),
            2 => Just(Heard::Byte(0xFF)),
            1 => any::<u8>().prop_map(|byte| Heard::Error(LineErrorKind::Parity, Some(byte))),
        ]
    }

    fn encode(heard: &[Heard]) -> Vec<u8> {
        let mut raw = Vec::new();
        for item in heard {
            match item {
                Heard::Byte(0xFF) => raw.extend([0xFF, 0xFF]),
                Heard::Byte(byte) => raw.push(*byte),
                Heard::Error(_, byte) => raw.extend([0xFF, 0, byte.unwrap_or(0)]),
            }
        }
        raw
    }

    proptest! {
        #[test]
        fn any_cut_gives_what_was_heard(
            heard in prop::collection::vec(heard(), 0..80),
            cuts in prop::collection::vec(0_usize..200, 0..8),
        ) {
            let raw = encode(&heard);
            let parity = heard.iter().filter(|item| matches!(item, Heard::Error(..))).count() as u32;
            let mut cuts: Vec<_> = cuts.into_iter().map(|cut| cut.min(raw.len())).collect();
            cuts.extend([0, raw.len()]);
            cuts.sort_unstable();
            let mut decoder = MarkDecoder::new(Parity::Even, Some(NONE));
            let mut got = Vec::new();
            let mut rise = NONE;
            for pair in cuts.windows(2) {
                let piece = &raw[pair[0]..pair[1]];
                // Each mark is counted by the time that it is read.
                let mut probe = MarkDecoder { state: decoder.state, ..MarkDecoder::new(Parity::Even, None) };
                probe.decode(piece, None, &mut |input| {
                    rise.parity += u32::from(matches!(input, Input::LineError { .. }));
                });
                decode(&mut decoder, piece, Some(rise), &mut got);
            }
            prop_assert_eq!(rise.parity, parity);
            prop_assert_eq!(got, heard);
        }

        #[test]
        fn any_bytes_decode_alike_however_cut(
            raw in prop::collection::vec(prop_oneof![Just(0xFF_u8), Just(0), any::<u8>()], 0..60),
            cut in 0_usize..60,
        ) {
            let cut = cut.min(raw.len());
            let mut whole = Vec::new();
            decode(&mut MarkDecoder::new(Parity::Odd, None), &raw, None, &mut whole);
            let mut pieces = Vec::new();
            let mut decoder = MarkDecoder::new(Parity::Odd, None);
            decode(&mut decoder, &raw[..cut], None, &mut pieces);
            decode(&mut decoder, &raw[cut..], None, &mut pieces);
            prop_assert_eq!(whole, pieces);
        }
    }
}
