//! A simulated lathe without a control: it takes every pulse from its line, a byte a period, turns
//! its spindle and tells the angle, does S, T and M, and has limit switches.
//!
//! ```
//! use softplug_abi::Micros;
//! use softplug_machines::Partner;
//! use softplug_machines::pulse_lathe::{Lathe, LatheOptions};
//!
//! let mut lathe = Lathe::new(LatheOptions::default())?;
//! // Two pulses of z in a cut; the period between them is missing.
//! lathe.receive(Micros(250), 0x44);
//! lathe.receive(Micros(750), 0x04);
//! let report = lathe.report();
//! assert_eq!((report.z, report.gaps, report.missing_periods), (2, 1, 1));
//! # Ok::<(), softplug_machines::pulse_lathe::LatheOptionsError>(())
//! ```

mod options;
mod picture;
mod report;
mod spindle;
#[cfg(test)]
mod tests;

pub use options::{LatheOptions, LatheOptionsError};
pub use report::LatheReport;

use crate::Partner;
use softplug_abi::Micros;
use spindle::Spindle;
use std::collections::VecDeque;

/// A period, in which one byte leaves at most.
pub const PERIOD: Micros = Micros(250);
/// Places of the tool that are kept for the picture.
const PLACES: usize = 1_000_000;

/// The lathe. Time never runs backwards; after every call, ask
/// [`next_event`](Partner::next_event) again.
///
/// The [module](self) has an example.
#[derive(Debug)]
pub struct Lathe {
    options: LatheOptions,
    report: LatheReport,
    spindle: Spindle,
    /// What is done later, and the echo that then leaves.
    works: VecDeque<(Micros, u8)>,
    /// Characters on their way, and when each has left.
    out: VecDeque<(Micros, u8)>,
    out_until: Micros,
    /// When the last byte of a cut came that another one had to follow.
    follows: Option<Micros>,
    /// The limit switches that were told of.
    told: u8,
    /// Where the tool was, in pulses of x and z: corners of its way.
    places: Vec<(i64, i64)>,
    /// The radius of what is left of the blank, in pulses of x, for each pulse of z from its face
    /// on to the left.
    contour: Vec<i64>,
}

impl Lathe {
    /// A lathe with a blank, and the tool at its start.
    ///
    /// # Errors
    /// The options contradict each other.
    pub fn new(options: LatheOptions) -> Result<Self, LatheOptionsError> {
        options.check()?;
        Ok(Self {
            report: LatheReport::default(),
            spindle: Spindle::new(options.increments),
            works: VecDeque::new(),
            out: VecDeque::new(),
            out_until: Micros::ZERO,
            follows: None,
            told: 0,
            places: vec![(0, 0)],
            contour: vec![options.blank_radius; options.blank_length as usize],
            options,
        })
    }

    /// What has happened so far.
    pub fn report(&self) -> &LatheReport {
        &self.report
    }

    /// Whether S, T or M is being done.
    pub fn is_busy(&self) -> bool {
        !self.works.is_empty()
    }

    /// The radius of what is left of the blank, in pulses of x (0.005 mm), for each pulse of z
    /// (0.01 mm) from its face on.
    pub fn contour(&self) -> &[i64] {
        &self.contour
    }

    /// The tool's way and what is left of the blank, as an SVG document.
    pub fn picture(&self) -> String {
        picture::draw(&self.options, &self.contour, &self.places)
    }

    fn say(&mut self, now: Micros, byte: u8) {
        self.out_until = self.out_until.max(now) + PERIOD;
        self.out.push_back((self.out_until, byte));
    }

    fn pulses(&mut self, now: Micros, byte: u8) {
        if let Some(before) = self.follows {
            let late = now - before - PERIOD;
            if late > Micros::ZERO {
                self.report.gaps += 1;
                self.report.missing_periods +=
                    late.0.unsigned_abs().div_ceil(PERIOD.0.unsigned_abs());
                self.report.longest_gap = self.report.longest_gap.max(late);
            }
        }
        self.follows = (byte & 0x40 != 0).then_some(now);
        let x = direction(byte, 0x01, 0x02);
        let z = direction(byte, 0x04, 0x08);
        if (x, z) == (0, 0) {
            return;
        }
        self.report.x_pulses += x.unsigned_abs();
        self.report.z_pulses += z.unsigned_abs();
        let (x_limits, z_limits) = (self.options.x_limits, self.options.z_limits);
        let mut at = 0;
        let mut moved = |place: &mut i64, by: i64, limits: (i64, i64), switch: u8| {
            let to = *place + by;
            if by == 0 {
                return;
            }
            if to < limits.0 || to > limits.1 {
                at |= switch;
            } else {
                *place = to;
            }
        };
        moved(&mut self.report.x, x, x_limits, 1);
        moved(&mut self.report.z, z, z_limits, 2);
        self.switches(now, at);
        self.cuts();
    }

    /// An axis that is at its switch goes no farther: the pulse is lost. Each is told once.
    fn switches(&mut self, now: Micros, at: u8) {
        self.report.lost_pulses += u64::from(at.count_ones());
        let new = at & !self.told;
        if new != 0 {
            self.say(now, 0xF4 + new);
        }
        self.told = at;
    }

    /// The tool's tip takes away what is outside of it.
    fn cuts(&mut self) {
        let place = (self.report.x, self.report.z);
        if self.places.len() < PLACES {
            corner(&mut self.places, place);
        }
        let (x, z) = (self.options.start_x + place.0, self.options.start_z + place.1);
        let Ok(depth) = usize::try_from(-z) else { return };
        if let Some(radius) = self.contour.get_mut(depth)
            && x < *radius
        {
            *radius = x.max(0);
            self.report.cut_while_still += u64::from(!self.spindle.turns());
        }
    }

    fn command(&mut self, now: Micros, byte: u8) {
        self.follows = None;
        self.report.commands.push(byte);
        match byte {
            0xE0 => self.report.holds += 1,
            0xE1 => self.report.stops += 1,
            0xE2 => self.report.programs += 1,
            _ => self.works.push_back((now + self.options.work_time, byte)),
        }
    }

    /// S, T or M is done.
    fn done(&mut self, now: Micros, byte: u8) {
        if byte < 0xC0 {
            self.spindle.set_speed(now, u64::from(byte & 0x3F) * self.options.turns_a_step);
        }
        self.say(now, byte);
    }
}

/// A pulse as +1, −1 or none.
fn direction(byte: u8, there: u8, minus: u8) -> i64 {
    match (byte & there != 0, byte & minus != 0) {
        (false, _) => 0,
        (true, false) => 1,
        (true, true) => -1,
    }
}

/// Puts a place behind the others; one in the middle of a straight way falls away.
fn corner(places: &mut Vec<(i64, i64)>, place: (i64, i64)) {
    if let [.., a, b] = places.as_slice() {
        let (one, other) = ((b.0 - a.0, b.1 - a.1), (place.0 - b.0, place.1 - b.1));
        let is_straight = one.0 * other.1 == one.1 * other.0;
        if is_straight && one.0 * other.0 + one.1 * other.1 > 0 {
            places.pop();
        }
    }
    places.push(place);
}

impl Partner for Lathe {
    fn receive(&mut self, now: Micros, byte: u8) {
        self.advance(now);
        self.report.bytes += 1;
        if byte < 0x80 {
            self.pulses(now, byte);
        } else {
            self.command(now, byte);
        }
    }

    fn next_event(&self) -> Option<Micros> {
        let work = self.works.front().map(|(at, _)| *at);
        let out = self.out.front().map(|(at, _)| *at);
        [work, out, self.spindle.next()].into_iter().flatten().min()
    }

    fn advance(&mut self, now: Micros) {
        while let Some((at, byte)) = self.works.pop_front_if(|(at, _)| *at <= now) {
            self.done(at, byte);
        }
        while let Some((at, characters)) = self.spindle.turned(now) {
            for byte in characters {
                self.say(at, byte);
            }
        }
    }

    fn poll_transmit(&mut self, now: Micros) -> Option<u8> {
        self.out.pop_front_if(|(at, _)| *at <= now).map(|(_, byte)| byte)
    }
}
