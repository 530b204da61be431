// The buffer's level over time, as a small picture.

import { s } from './dom.js';

const WIDTH = 300;
const HEIGHT = 60;
const SAMPLES = 150;

/** A chart and what updates it. */
export function chart() {
  const area = s('polygon', { class: 'area' });
  const line = s('polyline', { class: 'line' });
  const low = s('line', { class: 'mark', x1: 0, x2: WIDTH });
  const high = s('line', { class: 'mark', x1: 0, x2: WIDTH });
  const held = s('g', { class: 'held' });
  const node = s('svg', {
    class: 'chart', viewBox: `0 0 ${WIDTH} ${HEIGHT}`, preserveAspectRatio: 'none', role: 'img',
  }, held, area, low, high, line);
  return {
    node,
    update(buffer, levels = []) {
      const size = buffer.size || 1;
      const y = (level) => HEIGHT - 1 - ((HEIGHT - 2) * Math.min(level, size)) / size;
      const x = (index) => WIDTH - ((levels.length - 1 - index) * WIDTH) / (SAMPLES - 1);
      const points = levels.map((sample, index) => `${x(index).toFixed(1)},${y(sample.level).toFixed(1)}`);
      line.setAttribute('points', points.join(' '));
      const ends = points.length ? `${x(0).toFixed(1)},${HEIGHT} ${points.join(' ')} ${WIDTH},${HEIGHT}` : '';
      area.setAttribute('points', ends);
      for (const [mark, level] of [[low, buffer.low], [high, buffer.high]]) {
        mark.setAttribute('y1', y(level));
        mark.setAttribute('y2', y(level));
      }
      held.replaceChildren(...holds(levels, x));
      node.setAttribute('aria-label', `Buffer: ${buffer.level} of ${buffer.size} bytes, marks at ${buffer.low} and ${buffer.high}`);
    },
  };
}

function holds(levels, x) {
  const found = [];
  for (let from = 0; from < levels.length; from += 1) {
    if (!levels[from].isHeld) continue;
    let to = from;
    while (levels[to + 1]?.isHeld) to += 1;
    found.push(s('rect', { x: x(from) - 1, y: 0, width: x(to) - x(from) + 2, height: HEIGHT }));
    from = to;
  }
  return found;
}
