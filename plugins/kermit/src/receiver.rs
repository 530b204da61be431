//! The files that are received: their data, their names, what went wrong in a row.

use crate::coding::Coding;
use crate::packet::Reader;
use crate::settings::{Mode, Settings};
use crate::terms::Terms;
use softplug_plugin::{Context, DeliveryId, Failure, JobId, State, StateReader, StateWriter, copy};

/// Bytes delivered at a time.
const PIECE: usize = 128;
/// Output that a piece and what follows the last one need.
const OUTPUT: usize = 1_024;
/// Characters of a name that are kept.
pub(crate) const TITLE: usize = 94;

#[derive(Copy, Clone, Debug, State)]
pub(crate) struct Receiver {
    delivery: DeliveryId,
    /// How often in a row something was refused.
    refusals: u32,
    /// A delivery is under way.
    pub(crate) is_open: bool,
    /// All of it has come and is acknowledged; it ends with what follows.
    pub(crate) is_whole: bool,
    /// CR has come, and may belong to LF.
    has_cr: bool,
    /// The number of the next packet.
    pub(crate) expected: u8,
    /// The type of the one before it.
    pub(crate) latest: u8,
    /// How much of the data has been delivered: characters, and bytes of the run behind them.
    run: u8,
    /// Why something was refused the last time.
    why: Option<Failure>,
    at: u16,
    pub(crate) ended: Ended,
}

impl Receiver {
    pub(crate) const fn new() -> Self {
        Self {
            delivery: DeliveryId::NONE,
            is_open: false,
            is_whole: false,
            expected: 0,
            latest: 0,
            refusals: 0,
            why: None,
            at: 0,
            run: 0,
            has_cr: false,
            ended: Ended(None),
        }
    }

    /// What was before is over.
    pub(crate) fn forget(&mut self) {
        *self = Self { delivery: self.delivery, ..Self::new() };
    }

    pub(crate) fn begin(&mut self, link: &mut Context<'_>, name: &[u8]) {
        self.is_open = true;
        self.has_cr = false;
        self.delivery = self.delivery.next();
        link.delivery_begin(self.delivery, JobId::NONE);
        if !name.is_empty() {
            link.delivery_name_ascii(self.delivery, name);
        }
    }

    /// Delivers what there is room for. Whether that was the last of the packet.
    pub(crate) fn deliver(
        &mut self,
        link: &mut Context<'_>,
        settings: &Settings,
        coding: Coding,
        reader: &Reader,
    ) -> bool {
        let data = reader.data();
        while link.output_room() >= OUTPUT {
            let room = (link.delivery_room() as usize).min(PIECE);
            let mut piece = [0; PIECE];
            let mut count = 0;
            let mut is_whole = false;
            loop {
                let rest = data.get(usize::from(self.at)..).unwrap_or_default();
                let Some((byte, run, used)) = coding.decode(rest) else {
                    is_whole = true;
                    break;
                };
                let brings_cr = self.has_cr && byte != b'\n';
                let keeps_cr = settings.mode == Mode::Text && byte == b'\r';
                if count == room && (brings_cr || !keeps_cr) {
                    break;
                }
                if brings_cr {
                    put(&mut piece, &mut count, b'\r');
                    self.has_cr = false;
                    continue;
                }
                let mut taken = 1;
                if !keeps_cr {
                    taken = usize::from(run.saturating_sub(self.run)).clamp(1, room - count);
                    if let Some(places) = piece.get_mut(count..count + taken) {
                        places.fill(byte);
                        count += taken;
                    }
                }
                self.has_cr = keeps_cr;
                self.run += taken as u8;
                if self.run >= run {
                    self.run = 0;
                    self.at += used as u16;
                }
            }
            if count > 0 {
                link.deliver(self.delivery, piece.get(..count).unwrap_or_default());
            }
            if is_whole {
                self.at = 0;
                return true;
            }
            if count == 0 {
                return false;
            }
        }
        link.again();
        false
    }

    /// The file is whole. `false`: a byte of it finds no room yet.
    pub(crate) fn deliver_rest(&mut self, link: &mut Context<'_>) -> bool {
        if self.has_cr {
            if link.delivery_room() == 0 {
                return false;
            }
            link.deliver(self.delivery, b"\r");
            self.has_cr = false;
        }
        true
    }

    /// A packet was good.
    pub(crate) fn went_well(&mut self) {
        self.refusals = 0;
    }

    /// Whether what was to come may be asked for once more.
    pub(crate) fn refuses(&mut self, most: i64, why: Failure) -> bool {
        self.refusals += 1;
        self.why = Some(why);
        i64::from(self.refusals) <= most
    }

    /// Ends the delivery; one that is whole is complete, whatever has happened since.
    pub(crate) fn end_delivery(&mut self, link: &mut Context<'_>, failure: Option<Failure>) {
        let failure = if self.is_whole { None } else { failure };
        if self.is_open {
            link.delivery_end(self.delivery, failure, 0);
        }
        (self.is_open, self.is_whole) = (false, false);
    }

    /// Something has come behind the end of a file.
    pub(crate) fn end_whole(&mut self, link: &mut Context<'_>) {
        if self.is_whole {
            self.end_delivery(link, None);
        }
    }
}

/// The end of a transfer that is acknowledged again: its number, and what was agreed on then.
#[derive(Copy, Clone, Debug)]
pub(crate) struct Ended(pub(crate) Option<(u8, Terms)>);

impl State for Ended {
    fn save(&self, state: &mut StateWriter<'_>) {
        state.bool(self.0.is_some());
        if let Some((number, terms)) = self.0 {
            state.u8(number);
            terms.save(state);
        }
    }

    fn restore(&mut self, state: &mut StateReader<'_>) {
        self.0 = state.bool().then(|| {
            let (number, mut terms) = (state.u8(), Terms::usual());
            terms.restore(state);
            (number, terms)
        });
    }
}

fn put(piece: &mut [u8; PIECE], count: &mut usize, byte: u8) {
    if let Some(place) = piece.get_mut(*count) {
        *place = byte;
        *count += 1;
    }
}

/// What a file is called here: what stands behind the last separator, of characters that can be
/// read.
pub(crate) fn title(coding: Coding, data: &[u8]) -> ([u8; TITLE], usize) {
    let mut title = [0; TITLE];
    let mut length = 0;
    let mut rest = data;
    while let Some((byte, run, used)) = coding.decode(rest) {
        rest = rest.get(used..).unwrap_or_default();
        for _ in 0..run {
            match byte {
                b'/' | b'\\' | b':' => length = 0,
                0x20..=0x7E if length < TITLE => {
                    copy(title.get_mut(length..).unwrap_or_default(), &[byte]);
                    length += 1;
                }
                _ => {}
            }
        }
    }
    (title, length)
}
