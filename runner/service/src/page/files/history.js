// What a link did over the last minutes and the last day, as the gateway kept it: it is there after a reload, too.

import * as api from './api.js';
import { h, s, say } from './dom.js';
import * as text from './text.js';

const WIDTH = 600;
const HEIGHT = 120;
/** What can be shown: the title, which of the spans, how many samples of it, and when it is asked for again. */
const SPANS = {
  minutes: ['last 10 minutes', 'seconds', 600, 5000],
  day: ['last 24 hours', 'minutes', 1440, 30000],
};
const WHAT = {
  level: ['Buffer', (sample) => text.bytes(sample)],
  sent: ['To the machine', (sample, step) => `${text.bytes(Math.round((sample * 1000) / step))}/s`],
  received: ['From the machine', (sample, step) => `${text.bytes(Math.round((sample * 1000) / step))}/s`],
};

/** The panel of a link. */
export function history(path) {
  const what = h('select', { 'aria-label': 'What the chart shows' }, Object.entries(WHAT).map(([value, [title]]) => h('option', { value }, title)));
  const span = h('select', { 'aria-label': 'Time that the chart shows' }, Object.entries(SPANS).map(([value, [title]]) => h('option', { value }, title)));
  const area = s('path', { class: 'area' });
  const line = s('path', { class: 'line' });
  const held = s('path', { class: 'held' });
  const faults = s('path', { class: 'faults' });
  const low = s('line', { class: 'mark', x1: 0, x2: WIDTH });
  const high = s('line', { class: 'mark', x1: 0, x2: WIDTH });
  const picture = s('svg', { class: 'chart', viewBox: `0 0 ${WIDTH} ${HEIGHT}`, preserveAspectRatio: 'none', role: 'img', 'aria-label': 'Nothing is known yet' }, held, area, low, high, line, faults);
  const from = h('span');
  const legend = h('p', { class: 'facts' });
  const node = h('div', { class: 'panel history' },
    h('div', { class: 'title' }, h('h2', {}, 'History'), what, span),
    h('div', { class: 'wide' }, picture), h('p', { class: 'axis facts' }, from, h('span', {}, 'now')), legend);
  let timer = null;
  let known = null;
  let buffer = null;
  const look = async () => {
    if (document.hidden) return;
    try {
      known = await api.get(`${path}/history`);
      draw();
    } catch {
      // The connection is told of elsewhere.
    }
  };
  const begin = () => {
    clearInterval(timer);
    timer = setInterval(look, SPANS[span.value][3]);
    look();
  };
  span.addEventListener('change', begin);
  what.addEventListener('change', () => draw());

  function draw() {
    if (!known) return;
    const [, of, most] = SPANS[span.value];
    const { step_ms: step, ...lists } = known[of];
    const samples = lists[what.value];
    const [title, words] = WHAT[what.value];
    const largest = Math.max(1, ...samples);
    const top = what.value === 'level' && buffer ? Math.max(buffer.size, largest) : largest;
    const y = (value) => HEIGHT - 1 - ((HEIGHT - 3) * value) / top;
    const x = (index) => WIDTH - ((samples.length - 1 - index) * WIDTH) / (most - 1);
    const points = samples.map((value, index) => `${x(index).toFixed(1)} ${y(value).toFixed(1)}`).join('L');
    line.setAttribute('d', points ? `M${points}` : '');
    area.setAttribute('d', points ? `M${x(0).toFixed(1)} ${HEIGHT}L${points}L${WIDTH} ${HEIGHT}Z` : '');
    const width = Math.max(1, WIDTH / most);
    const bars = (list, height) => list.map((value, index) => (value ? `M${(x(index) - width / 2).toFixed(1)} ${height}V${HEIGHT}h${width.toFixed(2)}V${height}Z` : '')).join('');
    held.setAttribute('d', bars(lists.held_ms, 0));
    faults.setAttribute('d', bars(lists.line_errors, HEIGHT - 12));
    for (const [mark, level] of [[low, buffer?.low], [high, buffer?.high]]) {
      mark.style.display = what.value === 'level' && level ? '' : 'none';
      if (level) for (const end of ['y1', 'y2']) mark.setAttribute(end, y(level).toFixed(1));
    }
    const sum = (list) => list.reduce((all, value) => all + value, 0);
    const errors = sum(lists.line_errors);
    const heldFor = sum(lists.held_ms);
    say(from, `${text.span(most * step * 1000)} ago`);
    const parts = [
      `${title}: ${words(largest > 1 ? largest : samples.at(-1) ?? 0, step)} at most`,
      what.value === 'level' && buffer && `dashed: the marks at ${text.bytes(buffer.low)} and ${text.bytes(buffer.high)}`,
      heldFor > 0 && `shaded: held by the machine, ${text.span(heldFor * 1000)} in all`,
      errors > 0 && `red at the foot: ${text.count(errors)} line errors`,
    ].filter(Boolean);
    say(legend, parts.join('; '));
    picture.setAttribute('aria-label', `${parts.join('; ')}; ${text.span(samples.length * step * 1000)}`);
  }
  return {
    node,
    update(link) {
      buffer = link.buffer;
      if (timer === null) begin();
    },
    end: () => clearInterval(timer),
  };
}
