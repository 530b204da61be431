//! A random session of one plug-in against a profile's model.

use crate::cover::row;
use crate::dice::Dice;
use crate::drive::{Drive, Finding, Make, Ran, Step};
use crate::model::{Conditions, Given, HostRequest, Preset, Profile};
use crate::noise::Noise;
use crate::settings::Settings;
use crate::shrink::shrink;
use softplug_abi::manifest::{Manifest, SettingValues};
use softplug_abi::{Instance, Micros};
use softplug_link::LinkOptions;

/// How long nothing is given at the end: what was under way can come to its end.
const TAIL: Micros = Micros::from_secs(30);
/// One session of so many is a long one; they are spread over the groups.
const LONG: u64 = 149;
/// Profiles whose queue may have room for some characters only.
const ANY_ROOM: &[&str] = &["heidenhain-fe"];
/// Two sessions of so many have the settings of a preset, where a profile has presets.
const PRESET: u64 = 17;
/// Most steps of a long one.
const STEPS: usize = 200_000;
/// Of so many long ones the last is long by steps: all that a line brings, and the link
/// goes and comes back again and again.
const KINDS: u64 = 5;
/// Steps of that one.
const STEPS_OF_CYCLES: usize = 40_000;

/// A session: its settings and line, and the chance by which the rest is drawn.
///
/// The [crate's page](crate) has an example.
#[derive(Clone, Debug)]
pub struct Session {
    profile: &'static Profile,
    /// Settings by name, as text.
    pub asked: Vec<(String, String)>,
    /// What it begins with.
    pub conditions: Conditions,
    values: SettingValues,
    seed: u64,
    number: u64,
}

/// What a session is filled with.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Filling {
    /// Some steps of everything.
    Usual,
    /// One thing, large or often; its number among these.
    Long(u64),
    /// The link goes and comes back.
    Cycles,
}

impl Filling {
    fn of(number: u64) -> Self {
        let long = number / LONG;
        match (number % LONG == LONG - 1, long % KINDS) {
            (false, _) => Self::Usual,
            (true, kind) if kind == KINDS - 1 => Self::Cycles,
            (true, kind) => Self::Long(long / KINDS * (KINDS - 1) + kind),
        }
    }
}

impl Session {
    /// The session with this number. `None` where the plug-in or the profile refuses
    /// the settings that were drawn.
    pub fn draw(
        profile: &'static Profile,
        manifest: &Manifest,
        seed: u64,
        number: u64,
    ) -> Option<Self> {
        let long = match Filling::of(number) {
            Filling::Long(long) => Some(long),
            Filling::Usual | Filling::Cycles => None,
        };
        let preset = if long.is_some() { None } else { preset(profile, manifest, number) };
        let asked = match preset {
            Some((name, _)) => vec![("preset".to_owned(), (*name).to_owned())],
            None => tried(profile, manifest, seed, number, long),
        };
        let named = asked.iter().map(|(name, value)| (name.as_str(), value.as_str()));
        let values = manifest.resolve_settings(named).ok()?;
        // What a preset sets is the page's, whatever the manifest says.
        let said = match preset {
            Some((_, sets)) => manifest.resolve_settings(sets.iter().copied()).ok()?,
            None => values.clone(),
        };

        let mut dice = Dice::new(seed, profile.name, number).fork();
        let mut conditions = Conditions {
            line: *dice.pick(profile.lines),
            depth: *dice.pick(&[1, 1, 1, 2, 16]),
            transmit_room: *dice.pick(&[4_096, 4_096, 4_096, 64, 257, 16_384, 65_535]),
            delivery_room: match dice.below(8) {
                0 => dice.between(64, 3_000) as u32,
                _ => *dice.pick(&[4_096, 4_096, 4_096, 300, 1_000, 16_384, 65_535]),
            },
            modem_lines: *dice.pick(profile.modem_lines),
            settings: Settings::new(manifest, &said),
            clock: clock(&mut dice),
            pieces: *dice.pick(&[usize::MAX, usize::MAX, usize::MAX, 64, 17, 1]),
            has_sizes: !dice.one_in(12),
            job_base: job_base(&mut dice),
            long,
            is_usual: Filling::of(number) == Filling::Cycles,
            is_preset: preset.is_some(),
        };
        if long.is_some() {
            // Small pieces would only make it slow.
            (conditions.transmit_room, conditions.pieces) = (4_096, usize::MAX);
        } else if ANY_ROOM.contains(&profile.name) && dice.one_in(6) {
            conditions.transmit_room = *dice.pick(&[3, 3, 3, 5, 20]);
        }
        if long.is_some_and(is_plain) {
            conditions.delivery_room = 4_096;
            conditions.has_sizes = true;
        } else if !profile.rooms.is_empty() && dice.one_in(4) {
            conditions.delivery_room = *dice.pick(profile.rooms);
        }
        (profile.start)(&conditions)?;
        Some(Self { profile, asked, conditions, values, seed, number })
    }

    /// What it was drawn from.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// Its number among those of its seed.
    pub fn number(&self) -> u64 {
        self.number
    }

    /// Runs it: the model proposes, noise is added, all is judged.
    pub fn run<I: Instance>(
        &self,
        manifest: &Manifest,
        make: &mut dyn FnMut() -> Result<I, String>,
    ) -> Ran {
        let mut dice = Dice::new(self.seed, self.profile.name, self.number);
        let filling = Filling::of(self.number);
        let is_long = matches!(filling, Filling::Long(_));
        let is_quiet = filling != Filling::Usual;
        let mut noise = Noise::draw(&mut dice, self.profile.special, is_quiet);
        let mut steps = *dice.pick(&[20, 60, 60, 200, 200, 1_000]);
        if filling == Filling::Cycles {
            steps = STEPS_OF_CYCLES;
            // It goes, it is closed, or both.
            let kind = self.number / LONG / KINDS;
            (noise.cycles, noise.closes) = (6, [0, 1, 4][kind as usize % 3]);
            if kind.is_multiple_of(2) {
                // What counts them is not saved, maybe.
                noise.swaps = 0;
            }
        } else if is_long {
            steps = 1_000;
        }
        self.drive(manifest, make, |drive| {
            let open = Step::Given(Given::Host(HostRequest::Open));
            drive.step(Micros::ZERO, open)?;
            let (mut done, mut filled) = (0, 0);
            while done < steps {
                // What is usual comes behind what fills a long one.
                if is_long && filled < STEPS && drive.model.is_filled() {
                    filled += 1;
                } else {
                    done += 1;
                }
                let proposal = drive.model.propose(drive.now, &mut dice);
                let deadline = drive.model.next();
                let (wait, step) = noise.disturb(proposal, drive.now, deadline, &mut dice);
                drive.step(drive.now + wait, step)?;
            }
            let end = drive.now + TAIL;
            drive.run_until(end)
        })
    }

    /// Runs given steps instead of drawn ones.
    pub fn repeat<I: Instance>(
        &self,
        manifest: &Manifest,
        make: &mut dyn FnMut() -> Result<I, String>,
        steps: &[(Micros, Step)],
        end: Micros,
    ) -> Ran {
        self.drive(manifest, make, |drive| {
            for (at, step) in steps {
                drive.step(*at, step.clone())?;
            }
            // What went wrong can have been at this very instant.
            drive.run_until(end + Micros(1))
        })
    }

    /// As short a session as can be found that fails in the same way as `ran`.
    pub fn shrunk<I: Instance>(
        &self,
        manifest: &Manifest,
        make: &mut dyn FnMut() -> Result<I, String>,
        ran: Ran,
    ) -> Ran {
        shrink(ran, |steps, end| self.repeat(manifest, make, steps, end))
    }

    fn drive<I: Instance>(
        &self,
        manifest: &Manifest,
        make: Make<'_, I>,
        go: impl FnOnce(&mut Drive<'_, I>) -> Result<(), Finding>,
    ) -> Ran {
        let Conditions { line, transmit_room, delivery_room, modem_lines, .. } = self.conditions;
        let settings = self.values.clone();
        let options = LinkOptions { line, transmit_room, delivery_room, modem_lines, settings };
        let Some(model) = (self.profile.start)(&self.conditions) else {
            return Ran::empty(None);
        };
        match Drive::new(manifest, make, &self.conditions, options, model) {
            Ok(mut drive) => {
                let finding = go(&mut drive).err();
                let end = drive.now;
                drive.finish(end, finding)
            }
            Err(finding) => Ran::empty(Some(finding)),
        }
    }
}

/// Whether the long session with this number has the first value of each setting: so that
/// it can get to its end.
fn is_plain(long: u64) -> bool {
    long % 4 < 2
}

/// The preset that a session is about, if it is about one.
fn preset(profile: &Profile, manifest: &Manifest, number: u64) -> Option<&'static Preset> {
    let turn = match number % PRESET {
        3 => 2 * (number / PRESET),
        11 => 2 * (number / PRESET) + 1,
        _ => return None,
    };
    let is_claimed = |name: &str| {
        let feature = |feature: &String| feature == "presets";
        manifest.profiles.iter().any(|claim| claim.features.iter().any(feature))
            && manifest.presets.iter().any(|known| known.name == name)
    };
    let place = turn.checked_rem(profile.presets.len() as u64)?;
    profile.presets.get(place as usize).filter(|(name, _)| is_claimed(name))
}

/// Values of those settings that the plug-in has. What is long has mostly what is usual, as every
/// other row has.
fn tried(
    profile: &Profile,
    manifest: &Manifest,
    seed: u64,
    number: u64,
    long: Option<u64>,
) -> Vec<(String, String)> {
    let known = |name: &str| manifest.settings.iter().any(|own| own.name == name);
    let tried: Vec<_> = profile.values.iter().filter(|(name, _)| known(name)).collect();
    let counts: Vec<usize> = tried.iter().map(|(_, values)| values.len()).collect();
    let places = match long {
        Some(long) if is_plain(long) => vec![0; counts.len()],
        Some(_) => row(&counts, seed, number & !1),
        None => row(&counts, seed, number),
    };
    let mut asked: Vec<(String, String)> = tried
        .iter()
        .zip(places)
        .map(|((name, values), place)| ((*name).to_owned(), values[place].to_owned()))
        .collect();
    if number % 2 == 1 && !long.is_some_and(is_plain) {
        round_numbers(manifest, &mut asked, &mut Dice::new(seed, "numbers", number));
    }
    asked
}

/// Mostly 0; else such that ids need two, three or all four bytes.
fn job_base(dice: &mut Dice) -> u32 {
    match dice.below(8) {
        0 => dice.between(250, 70_000) as u32,
        1 => 1 << dice.between(8, 31),
        2 => dice.between(0, i64::from(u32::MAX) - 1_000_000) as u32,
        _ => 0,
    }
}

/// Numbers that people set: small ones, round ones, and such that fill a byte or two.
fn round_numbers(manifest: &Manifest, asked: &mut [(String, String)], dice: &mut Dice) {
    for (name, value) in asked {
        let setting = manifest.settings.iter().find(|own| own.name == *name);
        let Some((min, max)) = setting.and_then(|own| Some((own.min?, own.max?))) else { continue };
        if dice.one_in(6) {
            let number = match dice.below(4) {
                0 => dice.between(1, 16),
                1 => (1 << dice.between(1, 24)) + dice.between(-1, 1),
                _ => dice.between(1, 99) * 10_i64.pow(dice.below(6) as u32),
            };
            *value = number.clamp(min, max).to_string();
        }
    }
}

/// Often 0; else any time of some hours, shortly before it passes 2³¹ µs or 2³² µs, or hours,
/// days or years later.
fn clock(dice: &mut Dice) -> Micros {
    const HOUR: i64 = Micros::from_secs(3_600).0;
    let before = Micros(dice.between(1, 60_000_000));
    match dice.below(16) {
        0 => Micros(1 << 31) - before,
        1 => Micros(1 << 32) - before,
        2 => Micros(dice.between(1, 72) * HOUR) - before,
        3 => Micros(dice.between(1, 60) * 24 * HOUR) + before,
        4 => Micros(dice.between(1, 20) * 8_766 * HOUR) + before,
        5..=8 => Micros(dice.between(1, 6 * HOUR)),
        _ => Micros::ZERO,
    }
}

impl Ran {
    fn empty(finding: Option<Finding>) -> Self {
        Self { steps: Vec::new(), end: Micros::ZERO, finding, observed: Vec::new() }
    }
}
