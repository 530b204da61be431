//! Programs in ISO code.

use super::program::{Bad, Block, Course, Item, MOST_BLOCKS, MOST_PULSES, Motion};
use super::pulses::{End, WHOLE, arc, line, sum};
use super::rules::Rules;
use std::collections::BTreeMap;

/// A number in 0.0001, and its column.
type Number = (i64, u32);
/// A letter with its number.
type Named = (u8, Number);
/// One of a number.
const ONE: i64 = 10_000;
/// The page's unit of an arc's coordinates is as fine as half of 0.1 µm: a step has 200.
const STEP: i128 = 200;

/// What stays in force.
struct State {
    mode: i64,
    is_incremental: bool,
    /// x as a diameter and z, in 0.1 µm.
    x: i64,
    z: i64,
    speed: Option<u8>,
    tool: Option<u8>,
    feed: i64,
    pitch: i64,
    is_over: bool,
}

/// The nearest pulse, half away from 0.
fn pulses(value: i64) -> i64 {
    let size = (value.abs() * 2 + 100) / 200;
    if value < 0 { -size } else { size }
}

/// The whole part of a root.
fn root(value: i128) -> i128 {
    let mut low = 0;
    let mut high = 1_i128 << 63;
    while low < high {
        let middle = (low + high + 1) / 2;
        if middle * middle <= value { low = middle } else { high = middle - 1 }
    }
    low
}

/// The letters of a line with their numbers; `None`: it is no block.
fn letters(text: &[u8]) -> Result<Option<Vec<Named>>, (u16, u32)> {
    if text.len() > 200 {
        return Err((18, 201));
    }
    if text.first().is_some_and(|first| b"%O:".contains(first)) {
        return Ok(None);
    }
    let mut found = Vec::new();
    let mut seen = Vec::new();
    let mut codes = 0;
    let mut at = 0;
    while at < text.len() {
        let letter = text[at].to_ascii_uppercase();
        at += 1;
        let column = at as u32;
        match letter {
            b' ' | b'\t' => continue,
            b';' => break,
            b'(' => {
                let end = text[at..].iter().position(|byte| *byte == b')');
                at += end.ok_or((12, column))? + 1;
                continue;
            }
            b'A'..=b'Z' => {}
            _ => return Err((12, column)),
        }
        let (value, length) = number(&text[at..]).map_err(|status| (status, column))?;
        at += length;
        match letter {
            b'N' => continue,
            b'G' => {
                codes += 1;
                if codes > 4 {
                    return Err((17, column));
                }
            }
            _ if !b"XZUWIKRFSTMP".contains(&letter) => return Err((13, column)),
            _ if seen.contains(&letter) => return Err((17, column)),
            _ => seen.push(letter),
        }
        found.push((letter, (value, column)));
    }
    Ok(Some(found).filter(|found| !found.is_empty()))
}

/// A number and its length, or the status of why it is none.
fn number(text: &[u8]) -> Result<(i64, usize), u16> {
    let signs = usize::from(text.first().is_some_and(|sign| b"+-".contains(sign)));
    let is_minus = text.first() == Some(&b'-');
    let mut has_point = false;
    let mut length = signs;
    while length < text.len() {
        match text[length] {
            b'0'..=b'9' => {}
            b'.' if !has_point => has_point = true,
            _ => break,
        }
        length += 1;
    }
    let digits: Vec<u8> = text[signs..length].to_vec();
    let (whole, part) = match digits.iter().position(|byte| *byte == b'.') {
        Some(point) => (digits[..point].to_vec(), digits[point + 1..].to_vec()),
        None => (digits, Vec::new()),
    };
    if whole.is_empty() && part.is_empty() {
        return Err(12);
    }
    if part.len() > 4 || whole.iter().skip_while(|digit| **digit == b'0').count() > 4 {
        return Err(14);
    }
    let mut text = String::from_utf8([whole, part.clone()].concat()).unwrap_or_default();
    text += &"0".repeat(4 - part.len());
    let size: i64 = text.parse().map_err(|_| 14_u16)?;
    Ok((if is_minus { -size } else { size }, length))
}

/// The items of a program, or why it is refused.
pub(super) fn read(text: &[u8], rules: &Rules, place: (i64, i64)) -> Result<Vec<Item>, Bad> {
    let mut course = Course::new(rules, place);
    let mut state = State {
        mode: 0,
        is_incremental: false,
        x: place.0 * 100,
        z: place.1 * 100,
        speed: None,
        tool: None,
        feed: 0,
        pitch: 0,
        is_over: false,
    };
    let mut blocks = 0_u64;
    let mut rebuilt = place;
    let mut before: Option<Block> = None;
    let mut is_unknown = false;
    for (nth, text) in text.split(|byte| *byte == b'\n').enumerate() {
        if state.is_over {
            break;
        }
        let text = text.strip_suffix(b"\r").unwrap_or(text);
        let at = |(status, column)| (status, nth as u32 + 1, column);
        let Some(words) = letters(text).map_err(at)? else { continue };
        let block = block(&words, &mut state, rules).map_err(at)?;
        blocks += 1;
        if is_unknown {
            continue;
        }
        if blocks >= rules.start_block {
            if let Some(before) = before.take() {
                course.begin_at(&before, rebuilt);
            }
            course.block(&block);
        } else {
            match &block.motion {
                Motion::Nothing => {}
                Motion::Huge => course.give_up(),
                Motion::Steps(steps, _) => {
                    let (x, z) = sum(steps);
                    rebuilt = (rebuilt.0 + x, rebuilt.1 + z);
                }
                Motion::Thread { sign, pulses, .. } => rebuilt.1 += sign * *pulses as i64,
                Motion::Zero { x, z } => {
                    rebuilt = (if *x { 0 } else { rebuilt.0 }, if *z { 0 } else { rebuilt.1 });
                }
            }
            let last = before.map_or(0, |before| before.function);
            let function = if block.function == 0 { last } else { block.function };
            before = Some(Block { function, ..block });
        }
        is_unknown =
            course.is_too_long() || blocks > MOST_BLOCKS as u64 || before.is_some() && blocks > 15;
    }
    if blocks == 0 {
        return Err((10, 0, 0));
    }
    if blocks < rules.start_block {
        return Err((11, 0, 0));
    }
    if is_unknown {
        course.give_up();
    }
    Ok(course.items())
}

/// The numbers of a line by letter, as they are used up.
struct Letters(BTreeMap<u8, Number>);

impl Letters {
    fn take(&mut self, letter: u8) -> Option<Number> {
        self.0.remove(&letter)
    }

    fn whole(&mut self, letter: u8, most: i64) -> Result<Option<u8>, (u16, u32)> {
        match self.take(letter) {
            None => Ok(None),
            Some((value, column)) => {
                let fits = value % ONE == 0 && value >= 0 && value / ONE <= most;
                if fits { Ok(Some((value / ONE) as u8)) } else { Err((14, column)) }
            }
        }
    }
}

fn block(words: &[(u8, Number)], state: &mut State, rules: &Rules) -> Result<Block, (u16, u32)> {
    let mut once = 0;
    let mut modes = 0;
    let mut has_reference = false;
    for (_, (code, column)) in words.iter().filter(|(letter, _)| *letter == b'G') {
        match code / ONE {
            _ if code % ONE != 0 => return Err((13, *column)),
            mode @ (0..=3 | 33) => {
                modes += 1;
                if modes > 1 {
                    return Err((17, *column));
                }
                state.mode = mode;
            }
            4 | 28 if once != 0 => return Err((17, *column)),
            code @ (4 | 28) => once = code,
            90 | 91 if has_reference => return Err((17, *column)),
            code @ (90 | 91) => {
                has_reference = true;
                state.is_incremental = code == 91;
            }
            _ => return Err((13, *column)),
        }
    }
    let numbers = words.iter().filter(|(letter, _)| *letter != b'G').copied();
    let mut letters = Letters(numbers.collect());
    if let Some((feed, column)) = letters.take(b'F') {
        if feed <= 0 {
            return Err((14, column));
        }
        if state.mode == 33 {
            state.pitch = feed;
        } else {
            state.feed = feed;
        }
    }
    if let Some(speed) = letters.whole(b'S', 63)? {
        state.speed = Some(speed);
    }
    if let Some(tool) = letters.whole(b'T', 7)? {
        state.tool = Some(tool);
    }
    let mut block = Block {
        speed: state.speed,
        tool: state.tool,
        function: 0,
        feed: WHOLE,
        travel: WHOLE,
        with_offset: true,
        dwell: 0,
        motion: Motion::Nothing,
    };
    match letters.0.get(&b'M').copied() {
        Some((value, _)) if [2 * ONE, 30 * ONE].contains(&value) => {
            letters.take(b'M');
            state.is_over = true;
        }
        _ => block.function = letters.whole(b'M', 15)?.unwrap_or(0),
    }
    match once {
        4 => block.dwell = dwell(&mut letters)?,
        28 => block.motion = zero(&mut letters, state)?,
        _ => motion(&mut letters, state, rules, &mut block)?,
    }
    match letters.0.values().map(|(_, column)| *column).min() {
        Some(column) => Err((17, column)),
        None => Ok(block),
    }
}

fn dwell(letters: &mut Letters) -> Result<u64, (u16, u32)> {
    // In periods: 4,000 a second, 4 a millisecond.
    let given = [(b'X', 4_000), (b'U', 4_000), (b'P', 4)]
        .map(|(letter, periods)| letters.take(letter).map(|number| (number, periods)));
    let given: Vec<_> = given.into_iter().flatten().collect();
    match given[..] {
        [] => Err((13, 1)),
        [((value, column), periods)] => {
            let periods = i128::from(value) * periods / i128::from(ONE);
            u32::try_from(periods).map(u64::from).map_err(|_| (14, column))
        }
        _ => {
            let columns = given.iter().map(|((_, column), _)| *column);
            // The plug-in looks at X and U before P.
            let pair: Vec<u32> = columns.take(2).collect();
            Err((17, pair[0].max(pair[1])))
        }
    }
}

fn zero(letters: &mut Letters, state: &mut State) -> Result<Motion, (u16, u32)> {
    let mut named = |letter| match letters.take(letter) {
        Some((0, _)) => Ok(true),
        Some((_, column)) => Err((14, column)),
        None => Ok(false),
    };
    let (x, u, z, w) = (named(b'X')?, named(b'U')?, named(b'Z')?, named(b'W')?);
    let (x, z) = (x || u, z || w);
    let (x, z) = if x || z { (x, z) } else { (true, true) };
    if x {
        state.x = 0;
    }
    if z {
        state.z = 0;
    }
    Ok(Motion::Zero { x, z })
}

/// Where an axis goes.
fn target(
    letters: &mut Letters,
    (absolute, by): (u8, u8),
    here: i64,
    scale: i64,
    is_incremental: bool,
) -> Result<i64, (u16, u32)> {
    let (to, column) = match (letters.take(absolute), letters.take(by)) {
        (Some((_, one)), Some((_, other))) => return Err((17, one.max(other))),
        (Some((value, column)), None) if !is_incremental => (value * scale, column),
        (Some((value, column)), None) | (None, Some((value, column))) => {
            (here + value * scale, column)
        }
        (None, None) => (here, 1),
    };
    if to.abs() >= 20_000 * ONE { Err((14, column)) } else { Ok(to) }
}

/// `steps · F / length` in parts of a step a period.
fn rate(state: &State, steps: i128, length: i128) -> Result<u64, (u16, u32)> {
    if state.feed == 0 {
        return Err((15, 1));
    }
    let whole = i128::from(WHOLE);
    // A minute has 240,000 periods.
    let (above, below) = (steps * i128::from(state.feed) * whole, length * 240_000);
    Ok(((2 * above + below) / (2 * below)).clamp(1, whole) as u64)
}

fn motion(
    letters: &mut Letters,
    state: &mut State,
    rules: &Rules,
    block: &mut Block,
) -> Result<(), (u16, u32)> {
    let has =
        |letters: &Letters, names: &[u8]| names.iter().any(|name| letters.0.contains_key(name));
    let is_arc = state.mode == 2 || state.mode == 3;
    let moves = has(letters, b"XZUW") || is_arc && has(letters, b"IK");
    if !moves {
        return Ok(());
    }
    let scale = if rules.is_diameter { 1 } else { 2 };
    let x_to = target(letters, (b'X', b'U'), state.x, scale, state.is_incremental)?;
    let z_to = target(letters, (b'Z', b'W'), state.z, 1, state.is_incremental)?;
    let x = pulses(x_to) - pulses(state.x);
    let z = pulses(z_to) - pulses(state.z);
    let is_huge = x.unsigned_abs().max(z.unsigned_abs()) > MOST_PULSES;
    match state.mode {
        0 | 1 if is_huge => {
            if state.mode == 1 {
                rate(state, 1, 1)?;
            }
        }
        0 => block.motion = Motion::Steps(line(x, z), "pulse-lathe.iso.line"),
        1 => {
            let (dx, dz) = (i128::from(x) * 50, i128::from(z) * 100);
            let length = root(dx * dx + dz * dz).max(1);
            block.feed = rate(state, i128::from(x.abs().max(z.abs())), length)?;
            block.motion = Motion::Steps(line(x, z), "pulse-lathe.iso.line");
        }
        33 => {
            if x != 0 {
                return Err((17, 1));
            }
            if state.pitch == 0 {
                return Err((15, 1));
            }
            let pitch = state.pitch as u64;
            block.motion = Motion::Thread { sign: z.signum(), pulses: z.unsigned_abs(), pitch };
        }
        _ => {
            let steps = around(letters, state, (x_to, z_to), (x, z))?;
            block.motion = Motion::Steps(steps, "pulse-lathe.iso.arc");
            block.feed = rate(state, 1, 100)?;
        }
    }
    if is_huge {
        block.motion = Motion::Huge;
    }
    (state.x, state.z) = (x_to, z_to);
    Ok(())
}

/// A point from the centre: z, x.
type Point = (i128, i128);

/// The quadrant that is gone into at a point, or out of: where an axis is met, it is the one ahead.
fn quadrant((z, x): Point, clockwise: bool) -> u32 {
    // A hair's breadth ahead.
    let (z, x) = if clockwise {
        (z * 1_000_000 + x, x * 1_000_000 - z)
    } else {
        (z * 1_000_000 - x, x * 1_000_000 + z)
    };
    match (z > 0, x > 0) {
        (true, true) => 0,
        (false, true) => 1,
        (false, false) => 2,
        (true, false) => 3,
    }
}

fn around(
    letters: &mut Letters,
    state: &State,
    (x_to, z_to): (i64, i64),
    (x_pulses, z_pulses): (i64, i64),
) -> Result<Vec<super::pulses::Step>, (u16, u32)> {
    let clockwise = state.mode == 2;
    let chord = (2 * i128::from(z_to - state.z), i128::from(x_to - state.x));
    let (i, k, radius) = (letters.take(b'I'), letters.take(b'K'), letters.take(b'R'));
    let (centre, column) = match radius {
        Some((_, column)) if i.is_some() || k.is_some() => return Err((17, column)),
        Some((radius, column)) => {
            (beside(chord, 2 * i128::from(radius), clockwise).ok_or((16, column))?, column)
        }
        None => {
            let value = |word: Option<Number>| 2 * i128::from(word.map_or(0, |(value, _)| value));
            ((value(k), value(i)), i.or(k).map_or(1, |(_, column)| column))
        }
    };
    let begin = (-centre.0, -centre.1);
    let end = (chord.0 - centre.0, chord.1 - centre.1);
    let square = |point: Point| point.0 * point.0 + point.1 * point.1;
    let off = (root(square(begin)) - root(square(end))).abs();
    if square(begin) < 4 * STEP * STEP || off > STEP {
        return Err((16, column));
    }
    let (first, last) = (quadrant(begin, clockwise), quadrant(end, !clockwise));
    let mut changes = if clockwise { (first + 4 - last) % 4 } else { (last + 4 - first) % 4 };
    let turn = begin.0 * end.1 - begin.1 * end.0;
    let is_ahead = if clockwise { turn < 0 } else { turn > 0 };
    if changes == 0 && !is_ahead {
        changes = 4;
    }
    // The axes stand on pulses.
    let z = begin.0 + 2 * i128::from(pulses(state.z) * 100 - state.z);
    let x = begin.1 + i128::from(pulses(state.x) * 100 - state.x);
    let end = End::At {
        z: z + i128::from(z_pulses) * STEP,
        x: x + i128::from(x_pulses / 2) * STEP,
        changes,
    };
    let mut steps = arc(clockwise, first as usize, (z, x), square(begin), STEP, end);
    let (x_done, z_done) = sum(&steps);
    let missing = |by: i64, is_x: bool| {
        let one = super::pulses::Step {
            x: if is_x { by.signum() } else { 0 },
            z: if is_x { 0 } else { by.signum() },
            doubled: false,
        };
        vec![one; by.unsigned_abs() as usize]
    };
    steps.extend(missing(z_pulses - z_done, false));
    steps.extend(missing(x_pulses - x_done, true));
    Ok(steps)
}

/// The centre by the radius: beside the middle of the chord, at its left for the shorter way
/// counter-clockwise.
fn beside((z, x): Point, radius: i128, clockwise: bool) -> Option<Point> {
    let chord = z * z + x * x;
    // Ends that are a step too far apart are those of half a circle.
    if chord == 0 || chord > (2 * radius.abs() + STEP).pow(2) {
        return None;
    }
    let rest = (4 * radius * radius - chord).max(0);
    // √(rest / chord) in so fine parts that what is proposed is exact.
    let part = 1_i128 << 40;
    let aside = |along: i128| {
        let size =
            along.abs() * root(rest * (part * part / (1 << 20)) / chord) / (2 * (part >> 10));
        if along < 0 { -size } else { size }
    };
    let side = if clockwise == (radius < 0) { 1 } else { -1 };
    Some((z / 2 - side * aside(x), x / 2 + side * aside(z)))
}
