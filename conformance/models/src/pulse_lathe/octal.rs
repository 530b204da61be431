//! Programs in octal words.

use super::program::{Bad, Block, Course, Item, MOST_BLOCKS, MOST_PULSES, Motion};
use super::pulses::{End, WHOLE, arc, sum, taper};
use super::rules::Rules;

/// A word and where it stands.
#[derive(Copy, Clone, Debug)]
struct Word {
    value: u16,
    line: u32,
    column: u32,
}

/// The rows of the page's table: clockwise and counter-clockwise arcs, lines with z and x as the
/// main axis; a column for each quadrant.
const CLOCKWISE: [u16; 4] = [0o2040, 0o3040, 0o1040, 0o0040];
const COUNTER: [u16; 4] = [0o5040, 0o4040, 0o6040, 0o7040];
const Z_MAIN: [u16; 4] = [0o7200, 0o5200, 0o4200, 0o6200];
const X_MAIN: [u16; 4] = [0o3200, 0o1200, 0o0200, 0o2200];
/// Signs of x and z in a quadrant.
const SIGNS: [(i64, i64); 4] = [(1, 1), (1, -1), (-1, -1), (-1, 1)];
const MEMORY: usize = 2_816;
/// Steps of arcs, and blocks times 50, that are gone through before the first block at once.
const AT_ONCE: u64 = 1_000;

#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Kind {
    Loop,
    Zero { x: bool },
    Axis { x: i64, z: i64 },
    Thread(i64),
    Taper { z_is_main: bool, quadrant: usize },
    Arc { clockwise: bool, quadrant: usize },
}

/// What G says, and whether STM and F are left out.
fn kind(g: u16) -> Option<(Kind, bool)> {
    let plain = match g {
        0o0000 => Kind::Loop,
        0o0004 => Kind::Zero { x: false },
        0o0002 => Kind::Zero { x: true },
        _ => return full(g).map(|kind| (kind, false)).or_else(|| short(g)),
    };
    Some((plain, false))
}

/// 0010 more than one of the table. The bit is in none of these, so it must not carry.
fn short(g: u16) -> Option<(Kind, bool)> {
    let without = g.checked_sub(0o0010).filter(|without| without & 0o0010 == 0)?;
    full(without).map(|kind| (kind, true))
}

fn full(g: u16) -> Option<Kind> {
    let place = |row: &[u16; 4]| row.iter().position(|other| *other == g);
    Some(match g {
        0o6000 => Kind::Axis { x: 0, z: 1 },
        0o4000 => Kind::Axis { x: 0, z: -1 },
        0o1000 => Kind::Axis { x: 1, z: 0 },
        0o0001 => Kind::Axis { x: -1, z: 0 },
        0o6100 => Kind::Thread(1),
        0o4100 => Kind::Thread(-1),
        _ => {
            if let Some(quadrant) = place(&CLOCKWISE) {
                Kind::Arc { clockwise: true, quadrant }
            } else if let Some(quadrant) = place(&COUNTER) {
                Kind::Arc { clockwise: false, quadrant }
            } else if let Some(quadrant) = place(&Z_MAIN) {
                Kind::Taper { z_is_main: true, quadrant }
            } else {
                Kind::Taper { z_is_main: false, quadrant: place(&X_MAIN)? }
            }
        }
    })
}

fn length(kind: Kind, is_short: bool) -> usize {
    match kind {
        Kind::Loop => 3,
        Kind::Zero { .. } => 1,
        Kind::Axis { .. } | Kind::Thread(_) => 6 - 2 * usize::from(is_short),
        Kind::Taper { .. } => 7 - 2 * usize::from(is_short),
        Kind::Arc { .. } => 10 - 2 * usize::from(is_short),
    }
}

/// Where something stands: line and column.
type Place = (u32, u32);

/// The words of a text, up to the first that is none, and that one's place; and where the last
/// word or comment begins.
fn words(text: &[u8]) -> (Vec<Word>, Option<Bad>, Place) {
    let mut last = (1, 1);
    let mut words: Vec<Word> = Vec::new();
    let (mut line, mut column) = (1, 0);
    let mut begun: Option<(String, u32, u32)> = None;
    let mut comment = None;
    for byte in text.iter().copied().chain([b' ']) {
        column += 1;
        let here = (line, column);
        if byte == b'\n' {
            line += 1;
            column = 0;
        }
        if comment.is_some() {
            if byte == b')' {
                comment = None;
            }
            continue;
        }
        if b" \t\r\n;,%(".contains(&byte) {
            if let Some((digits, line, column)) = begun.take() {
                last = (line, column);
                let value = u16::from_str_radix(&digits, 8).ok().filter(|_| digits.len() == 4);
                match value {
                    Some(value) => words.push(Word { value, line, column }),
                    None => return (words, Some((1, line, column)), last),
                }
            } else if byte == b'(' {
                last = here;
            }
            if byte == b'(' {
                comment = Some(last);
            }
            continue;
        }
        let word = begun.get_or_insert((String::new(), here.0, here.1));
        word.0.push(char::from(byte));
        if !(b'0'..=b'7').contains(&byte) || word.0.len() > 4 {
            let (_, line, column) = begun.unwrap_or_default();
            return (words, Some((1, line, column)), last);
        }
    }
    // The blank that was added is no character of a comment.
    (words, comment.map(|(line, column)| (1, line, column)), last)
}

/// A program that was read.
struct Program {
    words: Vec<u16>,
    /// Beginnings of blocks, in order.
    begins: Vec<usize>,
}

fn double(words: &[u16], at: usize) -> u64 {
    u64::from(words[at]) + 4_096 * u64::from(words[at + 1])
}

fn check(text: &[u8], rules: &Rules) -> Result<Program, Bad> {
    let (found, bad, last) = words(text);
    let words: Vec<u16> = found.iter().map(|word| word.value).collect();
    let at = |place: usize, status: u16| (status, found[place].line, found[place].column);
    let (mut begins, mut loops): (Vec<usize>, Vec<(usize, usize)>) = (Vec::new(), Vec::new());
    let mut has_stm = false;
    let mut begin = 0;
    while begin < words.len() {
        if begin >= MEMORY {
            return Err(at(begin, 9));
        }
        let (kind, is_short) = kind(words[begin]).ok_or_else(|| at(begin, 2))?;
        if !has_stm && (is_short || matches!(kind, Kind::Zero { .. })) {
            return Err(at(begin, 6));
        }
        has_stm |= kind != Kind::Loop;
        begins.push(begin);
        let end = begin + length(kind, is_short);
        for place in begin + 1..end.min(words.len()) {
            if place >= MEMORY {
                return Err(at(place, 9));
            }
            let value = words[place];
            let nth = place - begin;
            let status = match kind {
                Kind::Loop if nth == 1 => (value == 0).then_some(7),
                Kind::Loop => {
                    let entry = usize::from(value);
                    let is_inside =
                        loops.iter().any(|(first, last)| entry > *first && entry <= *last);
                    let is_entry = entry < begin && begins.contains(&entry) && !is_inside;
                    loops.push((entry, begin));
                    (!is_entry).then_some(8)
                }
                Kind::Zero { .. } => None,
                _ if nth == 1 => (![0, 0o1000, 0o4000, 0o5000].contains(&value)).then_some(3),
                Kind::Arc { .. } if [3, 5, 7].contains(&nth) && value > 0o3777 => Some(4),
                Kind::Arc { .. } if nth == 5 => {
                    let is_small = double(&words, begin + 2) < 2 && double(&words, begin + 4) < 2;
                    is_small.then_some(5)
                }
                Kind::Axis { .. } | Kind::Thread(_) | Kind::Taper { .. } if nth == 3 => {
                    (value > 0o3777).then_some(4)
                }
                _ => None,
            };
            if let Some(status) = status {
                return Err(at(place, status));
            }
        }
        begin = end;
    }
    if let Some(bad) = bad {
        return Err(bad);
    }
    if begin != words.len() || words.is_empty() {
        return Err((10, last.0, last.1));
    }
    if (begins.len() as u64) < rules.start_block {
        return Err((11, 0, 0));
    }
    Ok(Program { words, begins })
}

/// The items of a program, or why it is refused.
pub(super) fn read(text: &[u8], rules: &Rules, place: (i64, i64)) -> Result<Vec<Item>, Bad> {
    let Program { words, begins } = check(text, rules)?;
    let mut course = Course::new(rules, place);
    // How often each loop has still to go back.
    let mut left = vec![None; words.len()];
    let (mut stm, mut f) = (0, 0);
    let mut begin = 0;
    let mut first = begins[rules.start_block as usize - 1];
    let mut rebuilt = place;
    let mut before: Option<Block> = None;
    let (mut cost, mut blocks) = (0, 0);
    while begin < words.len() {
        if first != 0 && begin == first {
            if let Some(block) = &before {
                course.begin_at(block, rebuilt);
            }
            first = 0;
        }
        blocks += 1;
        if blocks > MOST_BLOCKS || course.is_too_long() || cost > AT_ONCE {
            course.give_up();
            break;
        }
        let Some((kind, is_short)) = kind(words[begin]) else { break };
        let end = begin + length(kind, is_short);
        if first != 0 {
            cost += 50;
        }
        if kind == Kind::Loop {
            let runs = words[begin + 1];
            let again = left[begin].unwrap_or(runs) - 1;
            left[begin] = (again > 0).then_some(again);
            begin = if again > 0 { usize::from(words[begin + 2]) } else { end };
            continue;
        }
        let is_zero = matches!(kind, Kind::Zero { .. });
        if !is_short && !is_zero {
            (stm, f) = (words[end - 2], words[end - 1]);
        }
        let block = block(kind, &words[begin..end], is_short || is_zero, stm, f, rules);
        if first == 0 {
            course.block(&block);
        } else {
            match &block.motion {
                Motion::Nothing => {}
                Motion::Huge => course.give_up(),
                Motion::Steps(steps, _) => {
                    if let Kind::Arc { .. } = kind {
                        cost += steps.len() as u64;
                    }
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
        begin = end;
    }
    Ok(course.items())
}

fn block(kind: Kind, words: &[u16], keeps: bool, stm: u16, f: u16, rules: &Rules) -> Block {
    let feed = (u64::from(f) + 1) * WHOLE / 4_096;
    let pulses = if words.len() > 3 { double(words, 2) } else { 0 };
    let is_huge = pulses > MOST_PULSES || words.len() >= 8 && double(words, 6) > MOST_PULSES;
    let motion = match kind {
        Kind::Axis { .. } | Kind::Taper { .. } | Kind::Arc { .. } if is_huge => Motion::Huge,
        Kind::Loop => Motion::Nothing,
        Kind::Zero { x } => Motion::Zero { x, z: !x },
        Kind::Axis { x, z } => {
            let pulses = pulses as i64;
            let steps = super::pulses::line(x * pulses, z * pulses);
            Motion::Steps(steps, "pulse-lathe.words.decode")
        }
        Kind::Thread(sign) => {
            let pitch = if f == 0 { 4_096 } else { u64::from(f) };
            Motion::Thread { sign, pulses, pitch: pitch * 100 }
        }
        Kind::Taper { z_is_main, quadrant } => {
            let steps = taper(z_is_main, SIGNS[quadrant], pulses, u64::from(words[4]));
            Motion::Steps(steps, "pulse-lathe.cut.taper")
        }
        Kind::Arc { clockwise, quadrant } => {
            let (z, x) = (i128::from(pulses), i128::from(double(words, 4)));
            let (x_sign, z_sign) = SIGNS[quadrant];
            let place = (z * i128::from(z_sign), x * i128::from(x_sign));
            let end = End::Steps(double(words, 6));
            let steps = arc(clockwise, quadrant, place, z * z + x * x, 1, end);
            Motion::Steps(steps, "pulse-lathe.cut.arc")
        }
    };
    let gn = if let Kind::Zero { .. } = kind { 0 } else { words[1] };
    Block {
        speed: Some((stm / 64) as u8),
        tool: Some((stm / 8 % 8) as u8),
        function: if keeps { 0 } else { (stm % 8) as u8 },
        feed,
        travel: feed,
        with_offset: gn == 0o4000 || gn == 0o5000,
        dwell: if gn == 0o1000 || gn == 0o5000 { rules.dwell } else { 0 },
        motion,
    }
}
