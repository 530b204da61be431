//! What a station does wrong, and when.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use softplug_abi::Micros;

/// Something that a station does wrong on purpose.
///
/// ```
/// use softplug_machines::r3964::{Fault, Occasion};
///
/// assert_eq!(Fault::OtherAnswer(0x41).occasion(), Occasion::Answer);
/// // Three characters of a block, and nothing more.
/// assert_eq!(Fault::Cut(3).occasion(), Occasion::Block);
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Fault {
    /// An STX of the other side is not answered.
    NoAnswer,
    /// It is answered by DLE so much later.
    LateAnswer(Micros),
    /// It is answered by NAK.
    NakAnswer,
    /// It is answered by this character.
    OtherAnswer(u8),
    /// It is answered by an STX of our own, as if both had begun at once: for
    /// the next block, or an empty one where none waits.
    Conflict,
    /// There is no buffer: NAK after the wait for one.
    NoBuffer,
    /// From the STX on, the station neither hears nor says anything for so long.
    Silence(Micros),
    /// A good block is taken, but not acknowledged.
    NoAcknowledgement,
    /// It is taken, and acknowledged so much later.
    LateAcknowledgement(Micros),
    /// It is refused by NAK as if its check had been wrong.
    NakAcknowledgement,
    /// It is dropped, and answered by this character: 02, for example, which
    /// must not count as DLE.
    OtherAcknowledgement(u8),
    /// NAK after so many characters of the other side's block, which is given up.
    NakInBlock(u32),
    /// Another character after so many of its characters.
    OtherInBlock(u32, u8),
    /// A break after so many of its characters.
    BreakInBlock(u32),
    /// Our own STX goes out so much later.
    LateStart(Micros),
    /// Our own block ends with a wrong check character; without one, with a
    /// wrong character behind the last DLE.
    WrongCheck,
    /// A DLE that is followed by neither DLE nor ETX, after so many characters
    /// of our block; the check character counts it. Not without doubling, where
    /// it would be data.
    LoneDle(u32),
    /// A gap of so long after so many characters of our block.
    Gap(u32, Micros),
    /// Our block stops after so many characters.
    Cut(u32),
    /// Stray characters when the line has become idle.
    Garbage(Vec<u8>),
    /// A break when the line has become idle.
    Break,
}

/// When faults are looked for. Each occasion is counted by itself.
///
/// The example of [`Fault`] shows two.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Occasion {
    /// An STX of the other side is to be answered.
    Answer,
    /// A good block is to be acknowledged.
    Acknowledgement,
    /// A block of the other side begins.
    Reception,
    /// Our STX is to be sent.
    Start,
    /// Our block is to be sent.
    Block,
    /// The line has become idle.
    Rest,
}

impl Fault {
    /// When it can happen.
    pub fn occasion(&self) -> Occasion {
        match self {
            Self::NoAnswer
            | Self::LateAnswer(_)
            | Self::NakAnswer
            | Self::OtherAnswer(_)
            | Self::Conflict
            | Self::NoBuffer
            | Self::Silence(_) => Occasion::Answer,
            Self::NoAcknowledgement
            | Self::LateAcknowledgement(_)
            | Self::NakAcknowledgement
            | Self::OtherAcknowledgement(_) => Occasion::Acknowledgement,
            Self::NakInBlock(_) | Self::OtherInBlock(..) | Self::BreakInBlock(_) => {
                Occasion::Reception
            }
            Self::LateStart(_) => Occasion::Start,
            Self::WrongCheck | Self::LoneDle(_) | Self::Gap(..) | Self::Cut(_) => Occasion::Block,
            Self::Garbage(_) | Self::Break => Occasion::Rest,
        }
    }
}

/// When a fault happens, among the occasions of its sort.
///
/// The example of [`Faults`] shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum When {
    /// The nth time, from 1.
    Nth(u32),
    /// Each time.
    Always,
    /// So often in a thousand, at random.
    PerMille(u16),
}

/// All that a station does wrong. Of several faults that fall together the
/// first of the plan happens.
///
/// ```
/// use softplug_abi::{LineParameters, Micros};
/// use softplug_machines::r3964::{Fault, Faults, Options, Station, When};
///
/// // The first STX is answered by NAK, the second one as it should be.
/// let faults = Faults::one(When::Nth(1), Fault::NakAnswer);
/// let line = LineParameters::new(0);
/// let mut station =
///     Station::new(Options { line, faults, nak_at_start: false, ..Options::default() })?;
/// for answer in [0x15, 0x10] {
///     station.receive(Micros(1_000), 0x02);
///     assert_eq!(station.poll_transmit(Micros(1_000)), Some(answer));
/// }
/// assert_eq!(station.report().faults, [(Micros(1_000), Fault::NakAnswer)]);
/// # Ok::<(), softplug_machines::r3964::OptionsError>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Faults {
    /// Seed of those at random.
    pub seed: u64,
    /// Each fault with its time.
    pub plan: Vec<(When, Fault)>,
}

impl Faults {
    /// One fault, at one time.
    pub fn one(when: When, fault: Fault) -> Self {
        Self { seed: 0, plan: vec![(when, fault)] }
    }
}

/// Faults with the counts of their occasions.
#[derive(Debug)]
pub(super) struct Schedule {
    plan: Vec<(When, Fault)>,
    random: ChaCha8Rng,
    counts: [u32; 6],
}

impl Schedule {
    pub(super) fn new(faults: &Faults) -> Self {
        let mut seed = [0; 32];
        seed[..8].copy_from_slice(&faults.seed.to_le_bytes());
        Self { plan: faults.plan.clone(), random: ChaCha8Rng::from_seed(seed), counts: [0; 6] }
    }

    /// What goes wrong at this occasion.
    pub(super) fn at(&mut self, occasion: Occasion) -> Option<Fault> {
        let count = &mut self.counts[occasion as usize];
        *count += 1;
        for (when, fault) in self.plan.iter().filter(|(_, fault)| fault.occasion() == occasion) {
            let happens = match when {
                When::Nth(nth) => nth == count,
                When::Always => true,
                When::PerMille(often) => self.random.next_u32() % 1_000 < u32::from(*often),
            };
            if happens {
                return Some(fault.clone());
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_occasion_is_counted_by_itself() {
        let plan = vec![(When::Nth(2), Fault::NakAnswer), (When::Always, Fault::Cut(1))];
        let mut schedule = Schedule::new(&Faults { seed: 0, plan });
        assert_eq!(schedule.at(Occasion::Answer), None);
        assert_eq!(schedule.at(Occasion::Block), Some(Fault::Cut(1)));
        assert_eq!(schedule.at(Occasion::Answer), Some(Fault::NakAnswer));
        assert_eq!(schedule.at(Occasion::Answer), None);
        assert_eq!(schedule.at(Occasion::Rest), None);
    }

    #[test]
    fn chance_is_the_same_for_the_same_seed() {
        let run = |seed| {
            let faults = Faults { seed, plan: vec![(When::PerMille(300), Fault::NakAnswer)] };
            let mut schedule = Schedule::new(&faults);
            (0..1_000).map(|_| schedule.at(Occasion::Answer).is_some()).collect::<Vec<_>>()
        };
        let often = run(7).into_iter().filter(|happens| *happens).count();
        assert!((240..360).contains(&often), "{often}");
        assert_eq!(run(7), run(7));
        assert_ne!(run(7), run(8));
    }
}
