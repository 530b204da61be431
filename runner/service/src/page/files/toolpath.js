// The way of a tool as a picture: seen along an axis or aslant, to be moved and enlarged by mouse, touch and keys.

import { h, say } from './dom.js';
import { JUMP, RAPID } from './way.js';

const [S2, S6] = [Math.SQRT1_2, 1 / Math.sqrt(6)];
/** What goes to the right and what goes up, of x, y and z. */
const VIEWS = {
  XY: { right: [1, 0, 0], up: [0, 1, 0], words: 'from above' },
  XZ: { right: [1, 0, 0], up: [0, 0, 1], words: 'from the front' },
  YZ: { right: [0, 1, 0], up: [0, 0, 1], words: 'from the right' },
  ZX: { right: [0, 0, 1], up: [1, 0, 0], words: 'as on a lathe: Z to the right, X up' },
  '3D': { right: [S2, S2, 0], up: [-S6, S6, 2 * S6], words: 'aslant' },
};
/** Points of one slice: behind it the page has its turn. */
const SLICE = 15_000;
const SLICE_MS = 10;
/** Beyond this a point is far outside of every picture. */
const FAR = 30_000;
const DASH = 4;
/** A picture of more points has thinner lines. */
const DENSE = 50_000;

/** `onPick` is told the line of the point that was clicked on. */
export function toolpath(onPick) {
  const base = h('canvas', { 'aria-hidden': 'true' });
  const over = h('canvas', {
    class: 'over', tabIndex: 0, role: 'img', 'aria-label': 'Tool path', 'aria-describedby': 'toolpath-keys',
    onkeydown: pressed, onwheel: turned, onpointerdown: down, onpointermove: moved, onpointerup: up, onpointercancel: up, ondblclick: fit,
  });
  const frame = h('div', { class: 'canvas' }, base, over);
  const views = Object.entries(VIEWS).map(([name, { words }]) =>
    h('button', { class: 'chip', title: `Seen ${words}`, 'aria-label': `${name}: seen ${words}`, onclick: () => see(name) }, name));
  const zoomIn = h('button', { 'aria-label': 'Larger', title: 'Larger (+)', onclick: () => zoom(1.4) }, '+');
  const zoomOut = h('button', { 'aria-label': 'Smaller', title: 'Smaller (-)', onclick: () => zoom(1 / 1.4) }, '−');
  const whole = h('button', { title: 'All of it (0)', onclick: () => fit() }, 'Fit');
  const hint = h('p', { class: 'facts', id: 'toolpath-keys' });
  const node = h('div', { class: 'toolpath' },
    h('div', { class: 'tools' }, h('div', { class: 'chips', role: 'group', 'aria-label': 'View' }, views), zoomIn, zoomOut, whole), frame,
    h('p', { class: 'legend-path' }, h('span', { class: 'cut' }, 'cut'), h('span', { class: 'rapid' }, 'rapid'), h('span', { class: 'done' }, 'has left'), h('span', { class: 'here' }, 'leaves now'), h('span', { class: 'picked' }, 'chosen line')),
    hint);

  let path = null;
  let view = 'XY';
  let scale = 1;
  let middle = [0, 0];
  let here = -1;
  let chosen = -1;
  let drawnTo = 0;
  let doneTo = 0;
  let turn = 0;
  let isFitted = true;
  const pointers = new Map();
  let gesture = null;
  const watch = new ResizeObserver(() => {
    size();
    if (isFitted) fit();
    else redraw();
  });
  watch.observe(frame);
  const scheme = matchMedia('(prefers-color-scheme: dark)');
  scheme.addEventListener('change', redraw);

  const colour = (name) => getComputedStyle(node).getPropertyValue(`--${name}`).trim();
  const wide = () => frame.clientWidth;
  const high = () => frame.clientHeight;

  function size() {
    const dots = Math.min(devicePixelRatio || 1, 2);
    for (const canvas of [base, over]) {
      canvas.width = Math.max(1, Math.round(wide() * dots));
      canvas.height = Math.max(1, Math.round(high() * dots));
      canvas.getContext('2d').setTransform(dots, 0, 0, dots, 0, 0);
    }
  }

  /** A point of space on the picture's plane, in millimetres. */
  function flat(x, y, z) {
    const { right, up: above } = VIEWS[view];
    return [right[0] * x + right[1] * y + right[2] * z, above[0] * x + above[1] * y + above[2] * z];
  }

  function see(name) {
    view = name;
    for (const button of views) button.setAttribute('aria-pressed', String(button.textContent === name));
    fit();
  }

  /** Shows all that is cut; if nothing is, all ways. */
  function fit() {
    isFitted = true;
    const box = path && (path.size ?? bounds(path.points));
    if (box && wide()) {
      const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((corner) =>
        flat(...[0, 1, 2].map((axis) => ((corner >> axis) & 1 ? box.most[axis] : box.least[axis]))));
      const [us, vs] = [0, 1].map((of) => corners.map((point) => point[of]));
      const [left, most, low, top] = [Math.min(...us), Math.max(...us), Math.min(...vs), Math.max(...vs)];
      middle = [(left + most) / 2, (low + top) / 2];
      const fits = 0.86 * Math.min(wide() / (most - left), high() / (top - low));
      scale = Number.isFinite(fits) ? limited(fits) : 10;
    }
    redraw();
  }

  function zoom(by, at = [wide() / 2, high() / 2]) {
    isFitted = false;
    const before = inSpace(at);
    scale = limited(scale * by);
    const after = inSpace(at);
    middle = [middle[0] + before[0] - after[0], middle[1] + before[1] - after[1]];
    redraw();
  }

  function pan(right, downwards) {
    isFitted = false;
    middle = [middle[0] - right / scale, middle[1] + downwards / scale];
    redraw();
  }

  const inSpace = ([x, y]) => [middle[0] + (x - wide() / 2) / scale, middle[1] - (y - high() / 2) / scale];

  function pressed(event) {
    const step = 40;
    const keys = {
      '+': () => zoom(1.25), '=': () => zoom(1.25), '-': () => zoom(0.8), 0: fit, Home: fit,
      ArrowLeft: () => pan(step, 0), ArrowRight: () => pan(-step, 0), ArrowUp: () => pan(0, step), ArrowDown: () => pan(0, -step),
    };
    const name = Object.keys(VIEWS)[Number(event.key) - 1];
    const act = keys[event.key] ?? (name && (() => see(name)));
    if (!act || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    act();
  }

  function turned(event) {
    event.preventDefault();
    zoom(Math.exp(-Math.max(-200, Math.min(200, event.deltaY)) / 300), [event.offsetX, event.offsetY]);
  }

  function down(event) {
    over.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
    gesture = { moved: 0, at: [event.offsetX, event.offsetY] };
  }

  function moved(event) {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const now = [event.offsetX, event.offsetY];
    if (gesture) gesture.moved += Math.hypot(now[0] - before[0], now[1] - before[1]);
    const others = [...pointers].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
    pointers.set(event.pointerId, now);
    if (!others.length) {
      pan(now[0] - before[0], now[1] - before[1]);
      return;
    }
    const apart = (place) => Math.max(1, Math.hypot(place[0] - others[0][0], place[1] - others[0][1]));
    zoom(apart(now) / apart(before), [(now[0] + others[0][0]) / 2, (now[1] + others[0][1]) / 2]);
  }

  function up(event) {
    const isClick = event.type === 'pointerup' && pointers.size === 1 && gesture?.moved < 4;
    pointers.delete(event.pointerId);
    if (!isClick) return;
    const line = nearest(gesture.at);
    if (line >= 0) onPick(line);
  }

  /** The line whose way passes closest, within a finger's breadth. */
  function nearest([x, y]) {
    let [best, line] = [20 * 20, -1];
    let before = null;
    for (let at = 0; path && at < path.kinds.length; at += 1) {
      const point = onPicture(at);
      const is = before && path.kinds[at] !== JUMP ? away(x, y, before, point) : Infinity;
      if (is < best) [best, line] = [is, path.pointLines[at]];
      before = point;
    }
    return line;
  }

  function onPicture(at) {
    const { points } = path;
    const [u, v] = flat(points[3 * at], points[3 * at + 1], points[3 * at + 2]);
    return [wide() / 2 + (u - middle[0]) * scale, high() / 2 - (v - middle[1]) * scale];
  }

  /** Points that belong to lines before this one. */
  function before(line) {
    if (line < 0 || !path) return 0;
    let [low, most] = [0, path.pointLines.length];
    while (low < most) {
      const half = (low + most) >> 1;
      if (path.pointLines[half] < line) low = half + 1;
      else most = half;
    }
    return low;
  }

  function redraw() {
    turn += 1;
    drawnTo = 0;
    doneTo = 0;
    base.getContext('2d').clearRect(0, 0, wide(), high());
    goOn(turn);
    overlay();
  }

  /** Draws in slices, until all is drawn or somebody wants something else. */
  function goOn(mine) {
    if (mine !== turn || !path) return;
    const began = performance.now();
    const done = before(here);
    const count = path.kinds.length;
    const thick = count > DENSE ? 0.6 : 1.6;
    while (drawnTo < count && performance.now() - began < SLICE_MS) {
      const to = Math.min(count, drawnTo + SLICE);
      stroke(drawnTo, to, { [RAPID]: [colour('soft'), 0.7], 2: [colour('accent'), thick] });
      drawnTo = to;
    }
    while (drawnTo >= count && doneTo < done && performance.now() - began < SLICE_MS) {
      const to = Math.min(done, doneTo + SLICE);
      stroke(doneTo, to, { 2: [colour('good'), thick + 1] });
      doneTo = to;
    }
    if (drawnTo < count || doneTo < done) requestAnimationFrame(() => goOn(mine));
  }

  /** The ways to the points from one to another, each kind in its colour and width. */
  function stroke(from, to, looks, context = base.getContext('2d')) {
    const ways = { 1: new Path2D(), 2: new Path2D() };
    const pens = { 1: null, 2: null };
    let last = from > 0 ? onPicture(from - 1) : null;
    for (let at = from; at < to; at += 1) {
      const kind = path.kinds[at];
      const point = onPicture(at);
      if (kind !== JUMP && looks[kind] && last) draw(ways[kind], pens, kind, last, point);
      last = point;
    }
    for (const [kind, [style, width]] of Object.entries(looks)) {
      context.strokeStyle = style;
      context.lineWidth = width;
      context.stroke(ways[kind]);
    }
  }

  function draw(way, pens, kind, one, other) {
    if (isOutside(one, other)) return;
    const line = Math.abs(one[0]) + Math.abs(one[1]) + Math.abs(other[0]) + Math.abs(other[1]) > FAR ? clipped(one, other) : [one, other];
    if (!line) return;
    // What is smaller than a dot waits for the next point.
    if (pens[kind] !== one) way.moveTo(...line[0]);
    way.lineTo(...line[1]);
    pens[kind] = other;
  }

  function isOutside(one, other) {
    return (one[0] < 0 && other[0] < 0) || (one[1] < 0 && other[1] < 0)
      || (one[0] > wide() && other[0] > wide()) || (one[1] > high() && other[1] > high());
  }

  /** The part of a line that is near the picture. */
  function clipped(one, other) {
    let [from, to] = [0, 1];
    for (const [axis, most] of [[0, wide()], [1, high()]]) {
      const step = other[axis] - one[axis];
      if (step === 0) continue;
      const [enter, leave] = [(-10 - one[axis]) / step, (most + 10 - one[axis]) / step].sort((a, b) => a - b);
      from = Math.max(from, enter);
      to = Math.min(to, leave);
    }
    const at = (part) => [one[0] + (other[0] - one[0]) * part, one[1] + (other[1] - one[1]) * part];
    return from < to ? [at(from), at(to)] : null;
  }

  /** Axes, a measure, the line that was chosen, and where the cut is. */
  function overlay() {
    const context = over.getContext('2d');
    context.clearRect(0, 0, wide(), high());
    if (!path) return;
    axes(context);
    measure(context);
    for (const [line, style] of [[chosen, colour('warn')], [here, colour('bad')]]) {
      const [from, to] = [before(line), before(line + 1)];
      if (from < to) stroke(from, to, { [RAPID]: [style, 2], 2: [style, 4] }, context);
    }
    // Also of a line that moves nothing: where the tool is then.
    const [at, to] = [before(here + 1), path.kinds.length];
    if (here < 0 || !to) return;
    const [x, y] = onPicture(Math.max(0, at - 1));
    context.beginPath();
    context.arc(x, y, 7, 0, 2 * Math.PI);
    context.lineWidth = 3;
    context.strokeStyle = colour('panel');
    context.fillStyle = colour('bad');
    context.fill();
    context.stroke();
  }

  function axes(context) {
    const origin = [wide() / 2 - middle[0] * scale, high() / 2 + middle[1] * scale];
    context.lineWidth = 1.2;
    context.font = '600 13px system-ui, sans-serif';
    for (const [axis, name] of ['X', 'Y', 'Z'].entries()) {
      const unit = flat(...[0, 1, 2].map((of) => (of === axis ? 1 : 0)));
      if (Math.hypot(...unit) < 0.01) continue;
      const end = [origin[0] + unit[0] * 38, origin[1] - unit[1] * 38];
      context.strokeStyle = colour('text');
      context.fillStyle = colour('text');
      context.beginPath();
      context.moveTo(...origin);
      context.lineTo(...end);
      context.stroke();
      context.fillText(name, end[0] + unit[0] * 10 - 4, end[1] - unit[1] * 10 + 5);
    }
  }

  /** A round number of millimetres, drawn. */
  function measure(context) {
    const wanted = 90 / scale;
    const power = 10 ** Math.floor(Math.log10(wanted));
    const length = [5, 2, 1].find((step) => step * power <= wanted) * power;
    const [x, y, dots] = [12, high() - 12, length * scale];
    context.strokeStyle = colour('text');
    context.fillStyle = colour('text');
    context.lineWidth = 1.5;
    context.beginPath();
    context.moveTo(x, y - DASH);
    context.lineTo(x, y);
    context.lineTo(x + dots, y);
    context.lineTo(x + dots, y - DASH);
    context.stroke();
    context.fillText(`${Number(length.toPrecision(2))} mm`, x + 4, y - 6);
  }

  return {
    node,
    /** Another path; `first` is the view to begin with. */
    set(some, first) {
      path = some;
      size();
      see(first);
      const isCut = some.kinds.length > 1;
      say(hint, isCut ? 'Move by dragging or with the arrow keys, enlarge with the wheel, two fingers, + and −; 0 shows all, 1 to 5 turn it. A click finds the line.' : 'Nothing to draw: no move was understood.');
    },
    describe: (text) => over.setAttribute('aria-label', text),
    /** The line that leaves now; -1 if none. */
    mark(line) {
      if (line === here) return;
      const isBack = line < here;
      here = line;
      if (isBack) redraw();
      else {
        turn += 1;
        goOn(turn);
        overlay();
      }
    },
    choose(line) {
      chosen = line;
      overlay();
    },
    end() {
      turn += 1;
      watch.disconnect();
      scheme.removeEventListener('change', redraw);
    },
  };
}

function limited(scale) {
  return Math.max(1e-6, Math.min(1e5, scale));
}

function bounds(points) {
  const [least, most] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
  for (let at = 0; at < points.length; at += 1) {
    least[at % 3] = Math.min(least[at % 3], points[at]);
    most[at % 3] = Math.max(most[at % 3], points[at]);
  }
  return points.length ? { least, most } : null;
}

/** The square of how far a place is from a line. */
function away(x, y, [x1, y1], [x2, y2]) {
  const [dx, dy] = [x2 - x1, y2 - y1];
  const square = dx * dx + dy * dy;
  const part = square > 0 ? Math.max(0, Math.min(1, ((x - x1) * dx + (y - y1) * dy) / square)) : 0;
  return (x - x1 - part * dx) ** 2 + (y - y1 - part * dy) ** 2;
}
