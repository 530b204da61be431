// Two programs line by line: which lines belong together, and in what they differ. It knows nothing of the page.

import { index } from './lines.js';

/** Rows that are kept to be shown; all are counted. */
const MOST_ROWS = 3000;
/** Lines around a difference. */
const AROUND = 2;
/** So many lines may have come and gone between two that belong together, before whole stretches count as others. */
const MOST_EDITS = 400;

/** How two lines differ that belong together. */
export const KINDS = ['same', 'ends', 'controls', 'spaces', 'case', 'number', 'changed', 'missing', 'added'];

/**
 * Compares what was sent with what was received. Lines belong together if they are the same but for
 * spaces, control characters, small letters, the ends of lines and block numbers. Gives `counts` by
 * kind, `leaders` and `trailers` of both (what cannot be seen at their ends, by code), `ends` (which
 * line ends there are) and `rows`: `{kind, a, b}` with the numbers of the lines, counted from 0, or
 * `{alike}` for a stretch that is left out. Lines that differ in their ends only are alike there.
 */
export function compare(sent, received) {
  const sides = [sent, received].map(taken);
  const [one, other] = sides;
  const pairs = together(one.keys, other.keys);
  const counts = Object.fromEntries(KINDS.map((kind) => [kind, 0]));
  const rows = new Rows();
  for (let at = 0; at < pairs.count; at += 1) {
    const [a, b] = [pairs.one[at], pairs.other[at]];
    const kind = a < 0 ? 'added' : b < 0 ? 'missing' : kindOf(one, a, other, b);
    counts[kind] += 1;
    rows.add(kind, a < 0 ? -1 : a + one.first, b < 0 ? -1 : b + other.first);
  }
  return {
    counts,
    rows: rows.end(),
    more: rows.more,
    leaders: sides.map(({ leader }) => leader),
    trailers: sides.map(({ trailer }) => trailer),
    ends: sides.map(({ ends }) => ends),
    lines: sides.map(({ keys }) => keys.length),
    isSame: sent.length === received.length && sent.every((byte, at) => byte === received[at]),
  };
}

/** Lines of a side with the keys by which they belong together; what stands before and behind them apart. */
function taken(bytes) {
  const starts = index(bytes);
  const text = new TextDecoder('latin1').decode(bytes);
  let from = 0;
  while (from < bytes.length && isBlank(bytes[from])) from += 1;
  let to = bytes.length;
  while (to > from && isBlank(bytes[to - 1])) to -= 1;
  const lines = [];
  const keys = [];
  const ends = { 'CR LF': 0, LF: 0, CR: 0, other: 0 };
  let first = -1;
  for (let line = 0; line < starts.length; line += 1) {
    const [begin, behind] = [starts[line], starts[line + 1] ?? bytes.length];
    if (behind <= from || begin >= to) continue;
    if (first < 0) first = line;
    const whole = text.slice(Math.max(begin, from), Math.min(behind, to));
    lines.push(whole);
    keys.push(keyOf(whole));
    const end = endOf(whole);
    if (end && behind < to) ends[end in ends ? end : 'other'] += 1;
  }
  return { lines, keys, first: Math.max(0, first), leader: codes(bytes.subarray(0, from)), trailer: codes(bytes.subarray(to)), ends };
}

const isBlank = (byte) => byte <= 0x20 || byte === 0x7f;
const keyOf = (line) => line.replace(/[\u0000- \u007f]/g, '').toUpperCase().replace(/^(\/?)N\d+(?=.)/, '$1');
const bare = (line) => line.replace(/[\r\n]+$/, '');

function endOf(line) {
  return line.slice(bare(line).length).replaceAll('\r', 'CR ').replaceAll('\n', 'LF ').trim();
}

/** What cannot be seen: [code, count] by code, but for spaces and line ends. */
function codes(bytes) {
  const found = new Map();
  for (const byte of bytes) if (byte !== 0x20 && byte !== 10 && byte !== 13) found.set(byte, (found.get(byte) ?? 0) + 1);
  return [...found];
}

/** The smallest thing that makes them the same tells what they differ in. */
function kindOf(one, a, other, b) {
  let [left, right] = [one.lines[a], other.lines[b]];
  if (left === right) return 'same';
  // The last line of a side has no end: it stands with what comes behind the program.
  const haveEnds = endOf(left) && endOf(right);
  [left, right] = [bare(left), bare(right)];
  if (left === right) return haveEnds ? 'ends' : 'same';
  if (one.keys[a] !== other.keys[b]) return 'changed';
  const steps = [['controls', (line) => line.replace(/[\u0000-\u0008\u000a-\u001f\u007f]/g, '')], ['spaces', (line) => line.replace(/[\t ]/g, '')], ['case', (line) => line.toUpperCase()]];
  for (const [kind, step] of steps) {
    [left, right] = [step(left), step(right)];
    if (left === right) return kind;
  }
  return 'number';
}

/** Pairs of lines, -1 for none. */
class Pairs {
  constructor() {
    this.one = new Int32Array(1024);
    this.other = new Int32Array(1024);
    this.count = 0;
  }

  push(a, b) {
    if (this.count === this.one.length) {
      for (const side of ['one', 'other']) {
        const larger = new Int32Array(2 * this.count);
        larger.set(this[side]);
        this[side] = larger;
      }
    }
    this.one[this.count] = a;
    this.other[this.count] = b;
    this.count += 1;
  }
}

/** Which lines belong together, in order. */
function together(one, other) {
  const pairs = new Pairs();
  const todo = [[0, one.length, 0, other.length]];
  while (todo.length) {
    let [a, aEnd, b, bEnd] = todo.pop();
    if (a < 0) {
      // A tail that was put aside: lines that are the same.
      for (let step = 0; step < aEnd; step += 1) pairs.push(b + step, bEnd + step);
      continue;
    }
    while (a < aEnd && b < bEnd && one[a] === other[b]) pairs.push(a++, b++);
    let tail = 0;
    while (aEnd > a && bEnd > b && one[aEnd - 1] === other[bEnd - 1]) [aEnd, bEnd, tail] = [aEnd - 1, bEnd - 1, tail + 1];
    if (tail) todo.push([-1, tail, aEnd, bEnd]);
    if (a === aEnd || b === bEnd) {
      replace(pairs, a, aEnd, b, bEnd);
      continue;
    }
    const anchors = unique(one, a, aEnd, other, b, bEnd);
    if (!anchors.length) {
      edits(pairs, one, a, aEnd, other, b, bEnd);
      continue;
    }
    const parts = [];
    let [fromA, fromB] = [a, b];
    for (const [atA, atB, length] of anchors) {
      if (atA > fromA || atB > fromB) parts.push([fromA, atA, fromB, atB]);
      parts.push([-1, length, atA, atB]);
      [fromA, fromB] = [atA + length, atB + length];
    }
    parts.push([fromA, aEnd, fromB, bEnd]);
    for (const part of parts.reverse()) todo.push(part);
  }
  return pairs;
}

/** A stretch for another one: line by line as far as both go. */
function replace(pairs, a, aEnd, b, bEnd) {
  while (a < aEnd && b < bEnd) pairs.push(a++, b++);
  while (a < aEnd) pairs.push(a++, -1);
  while (b < bEnd) pairs.push(-1, b++);
}

/** Lines that are there once on both sides, as many as follow each other in the same order: [a, b, how many]. */
function unique(one, a, aEnd, other, b, bEnd) {
  const seen = new Map();
  for (let at = a; at < aEnd; at += 1) {
    const of = seen.get(one[at]);
    if (of) of.isTwice = true;
    else seen.set(one[at], { a: at, b: -1, isTwice: false });
  }
  for (let at = b; at < bEnd; at += 1) {
    const of = seen.get(other[at]);
    if (!of) continue;
    if (of.b >= 0) of.isTwice = true;
    of.b = at;
  }
  const once = [...seen.values()].filter((of) => of.b >= 0 && !of.isTwice);
  // The longest run that rises, by patience.
  const piles = [];
  for (const of of once) {
    let [low, high] = [0, piles.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (piles[middle].b < of.b) low = middle + 1;
      else high = middle;
    }
    of.before = piles[low - 1];
    piles[low] = of;
  }
  const run = [];
  for (let of = piles.at(-1); of; of = of.before) {
    const next = run.at(-1);
    if (next && next[0] === of.a + 1 && next[1] === of.b + 1) {
      next[0] = of.a;
      next[1] = of.b;
      next[2] += 1;
    } else run.push([of.a, of.b, 1]);
  }
  return run.reverse();
}

/** The fewest lines that came and went (Myers); with too many of them, a stretch for another one. */
function edits(pairs, one, a, aEnd, other, b, bEnd) {
  const [n, m] = [aEnd - a, bEnd - b];
  const most = Math.min(n + m, MOST_EDITS);
  const reach = new Int32Array(2 * most + 3);
  const zero = most + 1;
  const steps = [];
  for (let edit = 0; edit <= most; edit += 1) {
    steps.push(reach.slice(zero - edit - 1, zero + edit + 2));
    for (let k = -edit; k <= edit; k += 2) {
      const isDown = k === -edit || (k !== edit && reach[zero + k - 1] < reach[zero + k + 1]);
      let x = isDown ? reach[zero + k + 1] : reach[zero + k - 1] + 1;
      while (x < n && x - k < m && one[a + x] === other[b + x - k]) x += 1;
      reach[zero + k] = x;
      if (x >= n && x - k >= m) {
        walk(pairs, steps, edit, a, n, b, m);
        return;
      }
    }
  }
  replace(pairs, a, aEnd, b, bEnd);
}

/** Back through the steps, then forward through the stretches. */
function walk(pairs, steps, edit, a, n, b, m) {
  const found = [];
  let [x, y] = [n, m];
  for (let d = edit; d >= 0; d -= 1) {
    const at = (k) => steps[d][k + d + 1];
    const k = x - y;
    const isDown = k === -d || (k !== d && at(k - 1) < at(k + 1));
    const beforeX = d === 0 ? 0 : isDown ? at(k + 1) : at(k - 1);
    const beforeY = d === 0 ? 0 : beforeX - (isDown ? k + 1 : k - 1);
    while (x > beforeX && y > beforeY) found.push([--x, --y]);
    if (d === 0) break;
    if (isDown) found.push([-1, --y]);
    else found.push([--x, -1]);
  }
  let [left, right] = [[], []];
  const flush = () => {
    const common = Math.min(left.length, right.length);
    for (let at = 0; at < common; at += 1) pairs.push(left[at], right[at]);
    for (const at of left.slice(common)) pairs.push(at, -1);
    for (const at of right.slice(common)) pairs.push(-1, at);
    [left, right] = [[], []];
  };
  for (const [atA, atB] of found.reverse()) {
    if (atA >= 0 && atB >= 0) {
      flush();
      pairs.push(a + atA, b + atB);
    } else if (atA >= 0) left.push(a + atA);
    else right.push(b + atB);
  }
  flush();
}

/** Differences with some lines around them. */
class Rows {
  constructor() {
    this.rows = [];
    this.before = [];
    this.behind = 0;
    this.alike = 0;
    this.more = 0;
  }

  add(kind, a, b) {
    const row = { kind, a, b };
    // Ends of lines cannot be seen, and often all of them differ: they are only counted.
    if (kind !== 'same' && kind !== 'ends') {
      if (this.rows.length >= MOST_ROWS) {
        this.more += 1;
        return;
      }
      this.gap();
      this.rows.push(...this.before, row);
      this.before = [];
      this.behind = AROUND;
    } else if (this.behind > 0) {
      this.rows.push(row);
      this.behind -= 1;
    } else {
      this.before.push(row);
      if (this.before.length > AROUND) {
        this.before.shift();
        this.alike += 1;
      }
    }
  }

  gap() {
    if (this.alike) this.rows.push({ alike: this.alike });
    this.alike = 0;
  }

  end() {
    this.alike += this.before.length;
    if (this.rows.length) this.gap();
    return this.rows;
  }
}
