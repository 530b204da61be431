// The way of a tool: points to be drawn, and what is measured of it.

/** So many points are kept to be drawn; lengths and sizes go on behind them. */
const MOST_POINTS = 2_000_000;
/** Chords of a full circle. */
const CHORDS = 96;
export const TURN = 2 * Math.PI;

/** Of a point: how it was come to. */
export const JUMP = 0;
export const RAPID = 1;
export const CUT = 2;

/** Points, lengths and size; times are added by who knows the feeds. */
export class Way {
  constructor() {
    this.points = new Float64Array(3 * 4096);
    this.lines = new Uint32Array(4096);
    this.kinds = new Uint8Array(4096);
    this.count = 0;
    this.lost = 0;
    this.seconds = 0;
    this.dwell = 0;
    this.unfed = 0;
    this.rapid = 0;
    this.cut = 0;
    this.moves = { rapid: 0, straight: 0, arc: 0 };
    this.jumps = 0;
    this.least = [Infinity, Infinity, Infinity];
    this.most = [-Infinity, -Infinity, -Infinity];
  }

  add(x, y, z, line, kind) {
    const at = this.count;
    if (at >= MOST_POINTS) {
      this.lost += 1;
      return;
    }
    if (at === this.lines.length) this.grow();
    this.points[3 * at] = x;
    this.points[3 * at + 1] = y;
    this.points[3 * at + 2] = z;
    this.lines[at] = line;
    this.kinds[at] = kind;
    this.count += 1;
  }

  grow() {
    const room = Math.min(2 * this.lines.length, MOST_POINTS);
    const larger = (old, length) => {
      const made = new old.constructor(length);
      made.set(old);
      return made;
    };
    this.points = larger(this.points, 3 * room);
    this.lines = larger(this.lines, room);
    this.kinds = larger(this.kinds, room);
  }

  /** The size is that of what is cut: ways through the air lead far beyond it. */
  reach(point) {
    for (let axis = 0; axis < 3; axis += 1) {
      if (point[axis] < this.least[axis]) this.least[axis] = point[axis];
      if (point[axis] > this.most[axis]) this.most[axis] = point[axis];
    }
  }

  jump(to, line) {
    this.jumps += 1;
    this.add(to[0], to[1], to[2], line, JUMP);
  }

  start(from, line) {
    if (!this.count) this.add(from[0], from[1], from[2], line, JUMP);
  }

  straight(from, to, line, kind, length) {
    this.start(from, line);
    this.add(to[0], to[1], to[2], line, kind);
    if (kind === RAPID) {
      this.rapid += length;
      this.moves.rapid += 1;
      return;
    }
    this.cut += length;
    this.moves.straight += 1;
    this.reach(from);
    this.reach(to);
  }

  /** Gives its length. */
  arc({ from, target, plane, centre, radii, begin, sweep }, line) {
    const [a, b, c] = plane;
    this.start(from, line);
    this.reach(from);
    this.reach(target);
    const radiusAt = (part) => radii[0] + (radii[1] - radii[0]) * part;
    const at = (part) => {
      const point = [0, 0, 0];
      point[a] = centre[0] + radiusAt(part) * Math.cos(begin + sweep * part);
      point[b] = centre[1] + radiusAt(part) * Math.sin(begin + sweep * part);
      point[c] = from[c] + (target[c] - from[c]) * part;
      return point;
    };
    // The outermost points are where a quarter ends.
    const quarter = TURN / 4;
    const [first, last] = sweep > 0 ? [begin, begin + sweep] : [begin + sweep, begin];
    for (let turn = Math.ceil(first / quarter); turn * quarter <= last; turn += 1) this.reach(at((turn * quarter - begin) / sweep));
    const chords = Math.max(1, Math.ceil((Math.abs(sweep) / TURN) * CHORDS));
    for (let chord = 1; chord < chords; chord += 1) {
      const point = at(chord / chords);
      this.add(point[0], point[1], point[2], line, CUT);
    }
    this.add(target[0], target[1], target[2], line, CUT);
    const length = Math.hypot(((radii[0] + radii[1]) / 2) * sweep, target[c] - from[c]);
    this.cut += length;
    this.moves.arc += 1;
    return length;
  }

  result() {
    const { count } = this;
    return {
      points: this.points.slice(0, 3 * count),
      pointLines: this.lines.slice(0, count),
      kinds: this.kinds.slice(0, count),
      notDrawn: this.lost,
      size: this.least[0] <= this.most[0] ? { least: this.least, most: this.most } : null,
      length: { rapid: this.rapid, cut: this.cut, unfed: this.unfed },
      seconds: { cut: this.seconds, dwell: this.dwell },
      moves: this.moves,
      jumps: this.jumps,
    };
  }
}
