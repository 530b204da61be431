//! A flash memory that loses power when it is told to, and refuses what a real one must not be asked for.

use softplug_unit_slots::{Device, Geometry};
use std::cell::RefCell;
use std::rc::Rc;

/// What is left of the operation in which power fails.
#[derive(Copy, Clone, Debug)]
pub(crate) enum Tear {
    /// Nothing happened.
    Nothing,
    /// All of it, but nobody was told.
    All,
    /// So many granules or blocks, and nothing of the others.
    Prefix(usize),
    /// So many granules or blocks, and of the next one each bit or not.
    Torn(usize, u64),
    /// Each bit of all or not: a page that is programmed at once.
    Page(u64),
    /// All of it, but it reads so at one time and as before at another, until it is erased.
    Marginal(u64),
}

#[derive(Copy, Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub(crate) enum Lost {
    #[error("the power is off")]
    Power,
    #[error("the device is broken")]
    Broken,
}

/// One operation: what it was, and in how many units.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Did {
    Erase { at: u32, blocks: usize },
    Program { at: u32, granules: usize },
}

#[derive(Clone, Debug)]
pub(crate) struct Flash {
    pub(crate) bytes: Vec<u8>,
    geometry: Geometry,
    /// Granules that must be erased before they are programmed.
    used: Vec<bool>,
    pub(crate) done: Vec<Did>,
    /// After so many operations power fails, like this.
    cut: Option<(usize, Tear)>,
    is_off: bool,
    /// Where, what it was before, and what chooses.
    marginal: Option<(usize, Vec<u8>, Dice)>,
    /// Addresses that cannot be read.
    pub(crate) unreadable: Vec<std::ops::Range<u32>>,
    /// Reads of these that fail.
    pub(crate) failing_reads: u32,
    /// Addresses that keep nothing.
    pub(crate) stuck: Option<std::ops::Range<u32>>,
}

/// Gives the same for a seed on every machine (splitmix64).
#[derive(Clone, Debug)]
pub(crate) struct Dice(pub(crate) u64);

impl Dice {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub(crate) fn below(&mut self, most: usize) -> usize {
        (self.next() % most as u64) as usize
    }

    pub(crate) fn byte(&mut self) -> u8 {
        (self.next() >> 40) as u8
    }
}

impl Flash {
    pub(crate) fn new(geometry: Geometry) -> Self {
        Self::with(geometry, vec![0xFF; geometry.size as usize])
    }

    /// A device with something on it that nobody may program over.
    pub(crate) fn with(geometry: Geometry, bytes: Vec<u8>) -> Self {
        assert!(geometry.is_sound(), "{geometry:?}");
        assert_eq!(bytes.len(), geometry.size as usize);
        let used = bytes
            .chunks(geometry.granule as usize)
            .map(|granule| granule.iter().any(|byte| *byte != 0xFF));
        Self {
            used: used.collect(),
            bytes,
            geometry,
            done: Vec::new(),
            cut: None,
            is_off: false,
            marginal: None,
            unreadable: Vec::new(),
            failing_reads: 0,
            stuck: None,
        }
    }

    /// Power fails in the operation with this number, counted from here.
    pub(crate) fn cut(&mut self, at: usize, tear: Tear) {
        self.done.clear();
        self.cut = Some((at, tear));
    }

    pub(crate) fn power_on(&mut self) {
        self.done.clear();
        self.cut = None;
        self.is_off = false;
    }

    pub(crate) const fn is_off(&self) -> bool {
        self.is_off
    }

    /// How this operation ends, if power fails in it.
    fn begin(&mut self, did: Did) -> Result<Option<Tear>, Lost> {
        if self.is_off {
            return Err(Lost::Power);
        }
        let number = self.done.len();
        self.done.push(did);
        let tear = self.cut.filter(|(at, _)| *at == number).map(|(_, tear)| tear);
        self.is_off = tear.is_some();
        Ok(tear)
    }

    /// Lets an operation come as far as the tear says.
    fn change(
        &mut self,
        from: usize,
        new: &[u8],
        unit: usize,
        tear: Option<Tear>,
        is_erasure: bool,
    ) -> Result<(), Lost> {
        let granule = self.geometry.granule as usize;
        let (whole, torn, seed) = match tear {
            None | Some(Tear::All | Tear::Marginal(_)) => (new.len(), 0, 0),
            Some(Tear::Nothing) => (0, 0, 0),
            Some(Tear::Prefix(units)) => ((units * unit).min(new.len()), 0, 0),
            Some(Tear::Torn(units, seed)) => ((units * unit).min(new.len()), unit, seed),
            Some(Tear::Page(seed)) => (0, new.len(), seed),
        };
        if let Some(Tear::Marginal(seed)) = tear {
            let before = self.bytes[from..from + new.len()].to_vec();
            self.marginal = Some((from, before, Dice(seed)));
        } else if let Some((at, before, _)) = &self.marginal {
            // Whatever is erased or programmed by force is firm again.
            if from <= *at && at + before.len() <= from + new.len() {
                self.marginal = None;
            }
        }
        let mut dice = Dice(seed);
        let torn = (whole + torn).min(new.len());
        for (place, new) in new.iter().enumerate().take(torn) {
            let byte = &mut self.bytes[from + place];
            let mask = if place < whole { 0xFF } else { dice.byte() };
            *byte = (*byte & !mask) | (new & mask);
            self.used[(from + place) / granule] = !is_erasure || place >= whole;
        }
        if tear.is_some() { Err(Lost::Power) } else { Ok(()) }
    }

    fn is_marginal(&self, at: u32, length: usize) -> bool {
        let at = at as usize;
        self.marginal
            .as_ref()
            .is_some_and(|(from, before, _)| *from < at + length && at < from + before.len())
    }

    fn must_fit(&self, at: u32, length: usize, unit: u32) {
        let end = at as usize + length;
        assert!(
            at.is_multiple_of(unit) && length.is_multiple_of(unit as usize),
            "{at:#x} {length} in {unit}"
        );
        assert!(end <= self.bytes.len(), "{at:#x} {length} is outside");
    }
}

impl Device for Flash {
    type Error = Lost;

    fn geometry(&self) -> Geometry {
        self.geometry
    }

    fn read(&mut self, at: u32, into: &mut [u8]) -> Result<(), Lost> {
        self.must_fit(at, into.len(), self.geometry.granule);
        if self.is_off {
            return Err(Lost::Power);
        }
        let end = at + into.len() as u32;
        if self.unreadable.iter().any(|range| range.start < end && at < range.end) {
            return Err(Lost::Broken);
        }
        if self.failing_reads > 0 {
            self.failing_reads -= 1;
            return Err(Lost::Broken);
        }
        into.copy_from_slice(&self.bytes[at as usize..end as usize]);
        if let Some((from, before, dice)) = &mut self.marginal
            && dice.next() % 2 == 0
        {
            for (place, byte) in before.iter().enumerate() {
                if let Some(read) =
                    (*from + place).checked_sub(at as usize).and_then(|place| into.get_mut(place))
                {
                    *read = *byte;
                }
            }
        }
        Ok(())
    }

    fn erase(&mut self, at: u32, length: u32) -> Result<(), Lost> {
        let unit = self.geometry.erase;
        self.must_fit(at, length as usize, unit);
        let tear = self.begin(Did::Erase { at, blocks: (length / unit) as usize })?;
        self.unreadable.retain(|range| range.end <= at || at + length <= range.start);
        self.change(at as usize, &vec![0xFF; length as usize], unit as usize, tear, true)
    }

    fn program(&mut self, at: u32, bytes: &[u8]) -> Result<(), Lost> {
        let unit = self.geometry.granule;
        self.must_fit(at, bytes.len(), unit);
        let granules = bytes.len() / unit as usize;
        let first = at as usize / unit as usize;
        let is_used = self.used[first..first + granules].iter().any(|used| *used);
        let reads_erased =
            self.bytes[at as usize..at as usize + bytes.len()].iter().all(|byte| *byte == 0xFF);
        if is_used && (reads_erased || self.is_marginal(at, bytes.len())) {
            // Nobody can see that it was torn; memories with an error correction refuse it.
            return Err(Lost::Broken);
        }
        assert!(!is_used, "{at:#x} is programmed twice, or not wholly erased");
        let tear = self.begin(Did::Program { at, granules })?;
        let stuck = self.stuck.clone();
        let kept: Vec<u8> =
            (at..)
                .zip(bytes)
                .map(|(at, byte)| {
                    if stuck.as_ref().is_some_and(|stuck| stuck.contains(&at)) {
                        0xFF
                    } else {
                        *byte
                    }
                })
                .collect();
        self.change(at as usize, &kept, unit as usize, tear, false)
    }
}

/// A flash memory that the test can still reach while a unit has it.
#[derive(Clone, Debug)]
pub(crate) struct Shared(pub(crate) Rc<RefCell<Flash>>);

impl Device for Shared {
    type Error = Lost;

    fn geometry(&self) -> Geometry {
        self.0.borrow().geometry()
    }

    fn read(&mut self, at: u32, into: &mut [u8]) -> Result<(), Lost> {
        self.0.borrow_mut().read(at, into)
    }

    fn erase(&mut self, at: u32, length: u32) -> Result<(), Lost> {
        self.0.borrow_mut().erase(at, length)
    }

    fn program(&mut self, at: u32, bytes: &[u8]) -> Result<(), Lost> {
        self.0.borrow_mut().program(at, bytes)
    }
}
