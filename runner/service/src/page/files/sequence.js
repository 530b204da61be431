// What passes on a line, as it passes: we on the left, the machine on the right.

import * as api from './api.js';
import { h, say, show } from './dom.js';
import * as text from './text.js';

const MOST_ROWS = 300;
const MOST_HEX = 512;
/** Bytes of one direction that follow each other as closely are one row. */
const TOGETHER_US = 50000;

export function sequence(path) {
  const rows = h('ol', { class: 'sequence', tabIndex: 0, 'aria-label': 'What passes on the line' });
  const start = h('button', { onclick: () => (end ? stop() : begin()) }, 'Watch the line');
  const clear = h('button', { class: 'quiet', onclick: () => { rows.replaceChildren(); last = null; } }, 'Clear');
  const hexBox = h('input', { type: 'checkbox', onchange: () => rows.classList.toggle('hex', hexBox.checked) });
  const status = h('span', { class: 'facts', role: 'status' });
  let end = null;
  let zero = null;
  let last = null;

  function begin() {
    say(start, 'Stop watching');
    end = api.listen(`${path}/watch`, {
      state: (isConnected, error) => say(status, isConnected ? 'watching' : error?.message ?? 'connecting again…'),
      seen: (list) => list.forEach(add),
      missed: (count) => note(`${count} not shown`),
    });
    show(rows, true);
  }

  function stop() {
    end?.();
    end = null;
    say(start, 'Watch the line');
    say(status, '');
  }

  function add(seen) {
    zero ??= seen.at_us;
    if (seen.dropped) note(`${text.count(seen.dropped)} not shown`);
    const direction = { received: 'in', sent: 'out' }[seen.seen];
    if (!direction) {
      last = null;
      append(seen.at_us, 'says', h('span', { class: 'data' }, sentence(seen)));
      return;
    }
    if (last?.direction === direction && seen.at_us - last.at < TOGETHER_US && last.hex.length < MOST_HEX) {
      last.hex += seen.hex;
      last.at = seen.at_us;
    } else {
      const data = h('span', { class: 'data' });
      append(seen.at_us, direction, data);
      last = { direction, at: seen.at_us, hex: seen.hex, data };
    }
    fill(last.data, last.hex);
  }

  function fill(data, hex) {
    const plain = h('span', { class: 'plain' }, text.runs(hex).map((run) => (run.code ? h('b', {}, run.code) : run.text)));
    data.replaceChildren(plain, h('span', { class: 'bytes' }, text.spaced(hex)));
  }

  function append(at, kind, data) {
    const atEnd = rows.scrollHeight - rows.scrollTop - rows.clientHeight < 40;
    const sign = { in: '← machine', out: 'machine ←', says: '' }[kind];
    const arrow = { in: '◀', out: '▶', says: '·' }[kind];
    rows.append(h('li', { class: kind },
      h('time', {}, ((at - zero) / 1e6).toFixed(3)), h('span', { class: 'arrow', title: sign }, arrow), data));
    while (rows.childElementCount > MOST_ROWS) rows.firstChild.remove();
    if (atEnd) rows.scrollTop = rows.scrollHeight;
  }

  function note(words) {
    last = null;
    append(zero ?? 0, 'says', h('span', { class: 'data wrong' }, words));
  }

  rows.hidden = true;
  return {
    node: h('div', { class: 'panel' }, h('h2', {}, 'Line'),
      h('div', { class: 'tools' }, start, clear, h('label', { class: 'inline' }, hexBox, ' hex'), status),
      h('p', { class: 'facts' }, 'Seconds; ▶ to the machine, ◀ from it'), rows),
    end: stop,
  };
}

function sentence(seen) {
  switch (seen.seen) {
    case 'line-error': return `line error: ${seen.kind}${seen.hex ? ` (${seen.hex})` : ''}`;
    case 'held': return seen.is_held ? 'the machine holds the line' : 'the line is free again';
    case 'modem-lines': return `modem lines on: ${seen.on.join(' ') || 'none'}`;
    case 'state': return `state ${seen.name}`;
    case 'note': return `${seen.level}: ${seen.text}`;
    default: return seen.text ?? seen.seen;
  }
}
