// A light reader of G-code: what a tool would move, as far as it is understood. What is not is counted, never guessed.
// It knows nothing of the page, so that it can be tried alone.

import { CUT, RAPID, TURN, Way } from './way.js';

/** Millimetres; no machine is larger. */
const FURTHEST = 1e7;
const MOST_WORDS = 64;
const MOST_REMARKS = 60;
const INCH = 25.4;

const LETTER = { X: 0, Y: 1, Z: 2, I: 0, J: 1, K: 2, U: 0, V: 1, W: 2 };
/** First axis, second axis, normal of a plane: seen against the normal, G3 turns from the first to the second. */
const PLANES = { 17: [0, 1, 2], 18: [2, 0, 1], 19: [1, 2, 0] };
/** Words that do not move an axis of the picture: numbers, tools, speeds, switches. */
const SILENT = new Set(['N', 'O', ':', 'S', 'T', 'M', 'F', 'D', 'H', 'P', 'Q', 'L', 'R', 'E']);
const HARMLESS = new Set([9, 15, 40, 43, 44, 49, 61, 64, 69]);
/** They set something up with axis words, and move nothing. */
const SETTERS = new Set([10, 16, 51, 52, 68, 92]);
const RETURNS = new Set([27, 28, 29, 30, 53]);
const CYCLES = new Set([73, 74, 76, 81, 82, 83, 84, 85, 86, 87, 88, 89]);

/**
 * Reads a program. `starts` has where each line begins. `options`: `isLathe` (X is a diameter, U and W
 * are steps, feeds are for a turn), `isThousandths` (numbers without a point are thousandths of a
 * millimetre, or ten-thousandths of an inch). `progress` is told how far it is, from 0 to 1.
 */
export function read(bytes, starts, options = {}, progress) {
  const reader = new Reader(bytes, options);
  let line = 0;
  for (; line < starts.length && !reader.hasEnded; line += 1) {
    reader.line(line, starts[line], starts[line + 1] ?? bytes.length);
    if (progress && line % 20_000 === 19_999) progress(line / starts.length);
  }
  if (line < starts.length && hasWords(bytes, starts[line])) reader.remark('text behind the end of the program (M30, M2, M99 or %)', line);
  return reader.result(starts.length);
}

class Reader {
  constructor(bytes, { isLathe = false, isThousandths = false }) {
    this.bytes = bytes;
    this.isLathe = isLathe;
    this.isThousandths = isThousandths;
    this.position = [0, 0, 0];
    this.path = new Way();
    this.motion = null;
    this.cycle = null;
    this.plane = isLathe ? 18 : 17;
    this.scale = 1;
    this.isIncremental = false;
    this.hasAbsoluteCentres = false;
    this.feed = null;
    this.feedOf = isLathe ? 'turn' : 'minute';
    this.speed = null;
    this.isSurfaceSpeed = false;
    this.offset = null;
    this.isLost = false;
    this.hasEnded = false;
    this.hasBegun = false;
    this.remarks = new Map();
    this.assumed = new Map();
    this.blocks = 0;
    this.letters = new Array(MOST_WORDS);
    this.values = new Float64Array(MOST_WORDS);
    this.points = new Uint8Array(MOST_WORDS);
    this.count = 0;
  }

  remark(what, line, of = this.remarks) {
    let key = what;
    if (!of.has(key) && of.size >= MOST_REMARKS) key = 'other things';
    const found = of.get(key);
    if (found) found.count += 1;
    else of.set(key, { what: key, count: 1, line });
  }

  assume(what, line) {
    this.remark(what, line, this.assumed);
  }

  /** What moves in a way that is not understood: where the tool is then, is not known. */
  lose(what, line) {
    this.remark(what, line);
    this.isLost = true;
  }

  line(line, from, to) {
    const wrong = this.words(line, from, to);
    if (wrong) this.lose(wrong, line);
    else if (this.count) this.block(line);
  }

  /** Takes a line apart into words; what is no word is named. */
  words(line, from, to) {
    const { bytes } = this;
    this.count = 0;
    let at = from;
    while (at < to) {
      const byte = bytes[at];
      if (byte <= 0x20 || byte === 0x7f) at += 1;
      else if (byte === 0x28) at = behind(bytes, at, to, 0x29);
      else if (byte === 0x3b) break;
      else if (byte === 0x25) {
        if (this.hasBegun) this.hasEnded = true;
        break;
      } else if (byte === 0x2f && this.count === 0) {
        this.assume('optional blocks (/) are read, not skipped', line);
        at += 1;
      } else {
        const next = this.word(byte, at, to);
        if (typeof next === 'string') return next;
        at = next;
      }
    }
    return null;
  }

  /** One word; gives where the next one begins, or what is wrong. */
  word(byte, at, to) {
    const { bytes } = this;
    const upper = byte >= 0x61 && byte <= 0x7a ? byte - 0x20 : byte;
    if (upper === 0x3c) return behind(bytes, at, to, 0x3e);
    if ((upper < 0x41 || upper > 0x5a) && upper !== 0x3a) return isFormula(upper) ? 'variables and formulas' : 'signs that are no words';
    at += 1;
    while (at < to && bytes[at] === 0x20) at += 1;
    let sign = 1;
    if (bytes[at] === 0x2b || bytes[at] === 0x2d) {
      sign = bytes[at] === 0x2d ? -1 : 1;
      at += 1;
    }
    let value = 0;
    let digits = 0;
    let place = 0;
    for (; at < to; at += 1) {
      const digit = bytes[at] - 0x30;
      if (digit >= 0 && digit <= 9) {
        digits += 1;
        if (place) {
          value += digit * place;
          place /= 10;
        } else value = value * 10 + digit;
      } else if (bytes[at] === 0x2e && !place) place = 0.1;
      else break;
    }
    if (!digits) {
      // O<NAME> is the name of a program.
      if (upper === 0x4f && bytes[at] === 0x3c) return behind(bytes, at, to, 0x3e);
      return isFormula(bytes[at]) ? 'variables and formulas' : 'words without a number';
    }
    if (this.count === MOST_WORDS) return `blocks of more than ${MOST_WORDS} words`;
    this.letters[this.count] = String.fromCharCode(upper);
    this.values[this.count] = sign * value;
    this.points[this.count] = place ? 1 : 0;
    this.count += 1;
    return at;
  }

  block(line) {
    this.blocks += 1;
    this.hasBegun = true;
    this.axes = [null, null, null];
    this.steps = [null, null, null];
    this.centre = [null, null, null];
    this.radius = null;
    this.hasAxes = false;
    this.dwell = null;
    this.turns = null;
    this.once = null;
    this.modes(line);
    if (this.numbers(line)) this.act(line);
  }

  /** The G and M words, which change how the rest is read. */
  modes(line) {
    const { letters, values } = this;
    for (let at = 0; at < this.count; at += 1) {
      if (letters[at] === 'M') this.switch(values[at], line);
      else if (letters[at] === 'S') this.speed = Math.abs(values[at]);
      else if (letters[at] === 'G') this.prepare(values[at], line);
    }
  }

  switch(number, line) {
    if (number === 98 || number === 97 || number === 198) this.lose(`subprograms (M${number})`, line);
    // What is in the block itself is still done.
    if (number === 2 || number === 30 || number === 99) this.hasEnded = true;
  }

  prepare(value, line) {
    const tenths = Math.round(value * 10);
    if (tenths === 901 || tenths === 911) this.hasAbsoluteCentres = tenths === 901;
    else if (tenths % 10 || value < 0 || Math.abs(value * 10 - tenths) > 1e-6) this.odd(`G${value.toFixed(1)}`);
    else this.ofGroup(tenths / 10, line);
  }

  ofGroup(code, line) {
    if (code <= 3) {
      this.motion = code;
      this.cycle = null;
    } else if (code === 4) this.once = 'dwell';
    else if (code in PLANES) this.plane = code;
    else if (code === 20 || code === 21) this.scale = code === 20 ? INCH : 1;
    else if (code === 90 || code === 91) {
      this.isIncremental = code === 91;
      if (this.isLathe && code === 90) this.assume('G90 means absolute measures, not a cycle', line);
    }
    else if (code === 93 || code === 94 || code === 95) this.feedOf = ['block', 'minute', 'turn'][code - 93];
    else if (code === 96 || code === 97) this.isSurfaceSpeed = code === 96;
    else if (code === 98 || code === 99) {
      // Of a mill it says where a cycle ends.
      if (this.isLathe) this.feedOf = code === 98 ? 'minute' : 'turn';
    } else if (code === 41 || code === 42) this.assume('the contour of the program is drawn, not the way of the tool’s centre (G41, G42)', line);
    else if (code >= 54 && code <= 59) {
      if (this.offset !== null && this.offset !== code) this.assume('all work offsets (G54 to G59) are drawn from one origin', line);
      this.offset = code;
    } else if (code === 80) {
      this.cycle = null;
    } else if (CYCLES.has(code) && !this.isLathe) {
      this.cycle = `cycles (G${code})`;
      this.isHole = true;
    } else if (RETURNS.has(code)) {
      this.once = 'return';
      this.lose(code === 53 ? 'moves in the machine’s own coordinates (G53)' : `ways over the reference point (G${code})`, line);
    } else if (SETTERS.has(code) || (code === 50 && this.isLathe)) {
      this.once = code === 92 || code === 50 ? 'place' : 'set';
      this.setter = `G${code}, drawn as if it were not there`;
    } else if (!HARMLESS.has(code) && code !== 50) this.odd(`G${code}`);
  }

  /** A G word that is not known: with axes it moves in a way of its own until another one comes. */
  odd(name) {
    this.unknown = name;
    this.once = 'unknown';
  }

  /** The words with measures. */
  numbers(line) {
    const { letters, values, points } = this;
    for (let at = 0; at < this.count; at += 1) {
      const letter = letters[at];
      if (letter === 'G') continue;
      if (letter === 'F') {
        if (this.once !== 'dwell') this.setFeed(values[at]);
        continue;
      }
      if (letter === 'P') {
        this.turns = values[at];
        if (this.once === 'dwell') this.dwell = points[at] ? values[at] : values[at] / 1000;
      }
      const axis = LETTER[letter];
      if (axis === undefined && letter !== 'R') {
        if (!SILENT.has(letter)) this.remark(`the axis or word ${letter}`, line);
        continue;
      }
      if (this.once === 'dwell') {
        if ((letter === 'X' || letter === 'U') && points[at]) this.dwell = values[at];
        continue;
      }
      const value = this.measure(values[at], points[at], line);
      if (!(Math.abs(value) <= FURTHEST)) {
        this.lose('measures beyond 10 km', line);
        return false;
      }
      if (letter === 'R') this.radius = value;
      else if (letter <= 'K') this.centre[axis] = value;
      else if (letter >= 'X') this.axes[axis] = this.isLathe && axis === 0 ? value / 2 : value;
      else if (this.isLathe && letter !== 'V') this.steps[axis] = axis === 0 ? value / 2 : value;
      else this.remark(`the axis or word ${letter}`, line);
    }
    this.hasAxes = this.axes.some((value) => value !== null) || this.steps.some((value) => value !== null);
    return true;
  }

  measure(value, hasPoint, line) {
    if (hasPoint || value === 0) return value * this.scale;
    this.assume('numbers without a point', line);
    if (!this.isThousandths) return value * this.scale;
    return value * this.scale * (this.scale === 1 ? 0.001 : 0.0001);
  }

  setFeed(value) {
    this.feed = value > 0 && value < 1e9 ? value * (this.feedOf === 'block' ? 1 : this.scale) : null;
  }

  act(line) {
    const { once } = this;
    if (once === 'dwell') {
      if (this.dwell === null || !(this.dwell >= 0 && this.dwell < 1e6)) this.remark('dwells (G4) of a time that is not known', line);
      else this.path.dwell += this.dwell;
      return;
    }
    if (once === 'set') {
      this.remark(this.setter, line);
      return;
    }
    if (once === 'place') {
      this.remark(this.setter, line);
      if (!this.hasAxes) return;
      this.position = this.target();
      this.isLost = true;
      return;
    }
    if (once === 'unknown') {
      if (this.hasAxes) [this.cycle, this.isHole] = [this.unknown, false];
      this.remark(this.hasAxes ? this.unknown : `${this.unknown}, drawn as if it were not there`, line);
      if (this.hasAxes) this.skip();
      return;
    }
    if (once === 'return') {
      if (this.hasAxes) this.skip();
      return;
    }
    if (this.cycle && this.hasAxes) {
      this.remark(this.cycle, line);
      this.skip();
      return;
    }
    if (this.motion === null && this.hasAxes) {
      this.lose('moves before the first G0 to G3', line);
      this.skip();
      return;
    }
    const isArc = this.motion >= 2;
    const hasCentre = this.centre.some((value) => value !== null);
    if (this.hasAxes && !isArc && hasCentre) this.remark('I, J or K outside of an arc', line);
    if (this.hasAxes && !isArc && this.radius !== null) this.remark('corners with R, drawn sharp', line);
    if (isArc && this.turns !== null) this.remark('arcs of several turns (P), drawn as one', line);
    if (this.hasAxes || (isArc && (hasCentre || this.radius !== null))) this.move(line);
  }

  /** Where the block leads. */
  target() {
    return this.position.map((now, axis) => {
      const [value, step] = [this.axes[axis], this.steps[axis]];
      const reached = value === null ? now : this.isIncremental ? now + value : value;
      return step === null ? reached : reached + step;
    });
  }

  /** A move that is not drawn. The depth of a cycle is not where the tool stays. */
  skip() {
    const target = this.target();
    if (this.cycle && this.isHole) target[PLANES[this.plane][2]] = this.position[PLANES[this.plane][2]];
    this.position = target;
    this.isLost = true;
  }

  move(line) {
    const target = this.target();
    if (target.some((value) => !(Math.abs(value) <= FURTHEST))) {
      this.lose('measures beyond 10 km', line);
      return;
    }
    if (this.isLost) {
      // From where, is not known: only to where.
      this.path.jump(target, line);
      this.isLost = false;
    } else if (this.motion <= 1) {
      const length = distance(this.position, target);
      this.path.straight(this.position, target, line, this.motion === 0 ? RAPID : CUT, length);
      if (this.motion === 1) this.feeds(length);
    } else if (!this.arc(target, line)) {
      this.path.jump(target, line);
    }
    this.position = target;
  }

  feeds(length) {
    const perMinute = this.perMinute();
    if (this.feedOf === 'block' && this.feed) this.path.seconds += 60 / this.feed;
    else if (perMinute > 0) this.path.seconds += (length * 60) / perMinute;
    else this.path.unfed += length;
  }

  perMinute() {
    if (this.feed === null) return 0;
    if (this.feedOf === 'minute') return this.feed;
    return this.feedOf === 'turn' && this.speed && !this.isSurfaceSpeed ? this.feed * this.speed : 0;
  }

  arc(target, line) {
    const plane = PLANES[this.plane];
    const isClockwise = this.motion === 2;
    const circle = this.radius !== null ? this.byRadius(target, plane, isClockwise, line) : this.byCentre(plane, line);
    if (!circle) return false;
    const [a, b] = plane;
    const from = [this.position[a] - circle[0], this.position[b] - circle[1]];
    const to = [target[a] - circle[0], target[b] - circle[1]];
    const radii = [Math.hypot(...from), Math.hypot(...to)];
    if (!(radii[0] > 0) || !(radii[0] <= FURTHEST)) {
      this.remark('arcs without a radius', line);
      return false;
    }
    if (Math.abs(radii[0] - radii[1]) > Math.max(0.02, radii[0] / 500)) this.remark('arcs whose end is not on their circle, drawn as spirals', line);
    const begin = Math.atan2(from[1], from[0]);
    let sweep = Math.atan2(to[1], to[0]) - begin;
    const isWhole = Math.abs(target[a] - this.position[a]) < 1e-9 && Math.abs(target[b] - this.position[b]) < 1e-9;
    if (isWhole) sweep = isClockwise ? -TURN : TURN;
    else if (isClockwise && sweep >= 0) sweep -= TURN;
    else if (!isClockwise && sweep <= 0) sweep += TURN;
    const length = this.path.arc({ from: this.position, target, plane, centre: circle, radii, begin, sweep }, line);
    this.feeds(length);
    return true;
  }

  byCentre([a, b], line) {
    const [i, j] = [this.centre[a], this.centre[b]];
    if (i === null && j === null) {
      this.remark('arcs without centre and radius', line);
      return null;
    }
    if (this.hasAbsoluteCentres) return [i ?? this.position[a], j ?? this.position[b]];
    return [this.position[a] + (i ?? 0), this.position[b] + (j ?? 0)];
  }

  /** Of the two circles the one with the shorter arc; of a negative radius the one with the longer. */
  byRadius(target, [a, b], isClockwise, line) {
    const [x, y] = [target[a] - this.position[a], target[b] - this.position[b]];
    const chord = Math.hypot(x, y);
    const radius = Math.abs(this.radius);
    if (!(chord > 1e-9) || chord / 2 > radius * 1.002 + 0.02) {
      this.remark(chord > 1e-9 ? 'arcs whose radius is too small for their ends' : 'full turns by radius, which have no centre', line);
      return null;
    }
    const height = Math.sqrt(Math.max(0, radius * radius - (chord * chord) / 4));
    const side = isClockwise === this.radius < 0 ? 1 : -1;
    return [
      this.position[a] + x / 2 - (side * height * y) / chord,
      this.position[b] + y / 2 + (side * height * x) / chord,
    ];
  }

  result(lines) {
    return {
      ...this.path.result(),
      blocks: this.blocks,
      lines,
      remarks: [...this.remarks.values()],
      assumed: [...this.assumed.values()],
    };
  }
}

function distance(one, other) {
  return Math.hypot(other[0] - one[0], other[1] - one[1], other[2] - one[2]);
}

function behind(bytes, at, to, end) {
  while (at < to && bytes[at] !== end) at += 1;
  return at + 1;
}

function isFormula(byte) {
  return byte === 0x23 || byte === 0x5b || byte === 0x5d || byte === 0x3d;
}

function hasWords(bytes, from) {
  for (let at = from; at < bytes.length; at += 1) if (bytes[at] > 0x20 && bytes[at] !== 0x25 && bytes[at] !== 0x7f) return true;
  return false;
}
