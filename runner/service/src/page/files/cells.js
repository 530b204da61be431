// Cells: channels that work together, as a chart over time. Looked at each second while they are shown.

import * as api from './api.js';
import { h, keyed, s, say, show, sureButton } from './dom.js';
import { act } from './message.js';
import * as text from './text.js';

/** What the chart can show, in seconds. */
const WINDOWS = [[60, 'last minute'], [600, 'last 10 minutes'], [3600, 'last hour']];
const WIDTH = 600;
const ROW = 28;
const MODES = { auto: 'AUTO', 'jog-in-auto': 'JOG in AUTO', mda: 'MDA', jog: 'JOG' };

/** What a channel does, in words that need no colour. */
function doing(channel) {
  if (channel.state === 'idle') return 'no program';
  if (channel.state === 'runs') return `runs ${channel.program}`;
  return channel.text;
}

/** Who ran and who waited, over the last seconds. */
function chart() {
  const rows = s('g');
  const node = s('svg', { class: 'spans', viewBox: `0 0 ${WIDTH} ${ROW}`, preserveAspectRatio: 'none', role: 'img' });
  node.append(rows);
  return {
    node,
    update(cell, seconds) {
      const from = cell.now_ms - seconds * 1000;
      const x = (time) => ((Math.max(time, from) - from) * WIDTH) / (seconds * 1000);
      node.setAttribute('viewBox', `0 0 ${WIDTH} ${ROW * cell.channels.length}`);
      node.style.height = `${ROW * cell.channels.length}px`;
      rows.replaceChildren(...cell.channels.flatMap((channel, row) => channel.spans
        .filter((span) => (span.to_ms ?? cell.now_ms) > from && span.state !== 'idle')
        .map((span) => {
          const rect = s('rect', {
            class: span.state, x: x(span.from_ms).toFixed(2), y: row * ROW + 4, height: ROW - 8,
            width: Math.max(1, x(span.to_ms ?? cell.now_ms) - x(span.from_ms)).toFixed(2),
          });
          const title = s('title');
          title.textContent = `${channel.link}: ${span.text}`;
          rect.append(title);
          return rect;
        })));
      node.setAttribute('aria-label', cell.channels.map((channel) => `${channel.link}: ${doing(channel)}`).join('; '));
    },
  };
}

function channelRow(of) {
  const does = h('td');
  const since = h('td');
  const words = h('td');
  const loaded = h('td');
  const link = h('a', { href: `#/link/${encodeURIComponent(of.link)}` }, of.link);
  return {
    node: h('tr', {}, h('th', { scope: 'row' }, link), does, since, words, loaded),
    update(now) {
      say(does, doing(now));
      does.className = now.state;
      say(since, now.since_ms ? text.span((now.now_ms - now.since_ms) * 1000) : '');
      say(words, now.words ? `${now.words_passed} of ${now.words}` : '');
      say(loaded, now.loaded ? `${now.loaded} is loaded` : '');
    },
  };
}

function axisRow(of) {
  const owner = h('td');
  const queue = h('td');
  const channel = h('select', { 'aria-label': `Channel that gets ${of.name}` });
  const release = sureButton('Release', () => act(() => api.post(`${of.path}/release`)));
  const force = sureButton('Give to', () => act(() => api.post(`${of.path}/force`, { channel: channel.value })));
  return {
    node: h('tr', {}, h('th', { scope: 'row' }, of.name), owner, queue, h('td', { class: 'actions' }, release, force, channel)),
    update(now) {
      say(owner, now.owner ?? 'neutral');
      say(queue, now.queue.join(', ') || '–');
      release.disabled = !now.owner;
      const names = now.running.filter((name) => name !== now.owner);
      force.disabled = !names.length;
      if ([...channel.options].map((option) => option.value).join() !== names.join()) {
        channel.replaceChildren(...names.map((name) => h('option', { value: name }, name)));
      }
      show(channel, names.length);
    },
  };
}

function groupRow(of) {
  const mode = h('select', {
    'aria-label': `Mode of ${of.name}`,
    onchange: () => act(() => api.post(`${of.path}/mode`, { mode: mode.value })),
  }, Object.entries(MODES).map(([value, name]) => h('option', { value }, name)));
  return {
    node: h('tr', {}, h('th', { scope: 'row' }, of.name), h('td', {}, of.channels.join(', ')), h('td', {}, mode)),
    update(now) { if (document.activeElement !== mode) mode.value = now.mode; },
  };
}

function stuckItem() {
  const node = h('li');
  return { node, update(now) { say(node, `${now.is_deadlock ? 'Deadlock' : 'Nobody comes'}: ${now.text}`); } };
}

const heads = (titles) => h('thead', {}, h('tr', {}, titles.map((title) => h('th', {}, title))));

function table(titles, body) {
  return h('div', { class: 'scroll' }, h('table', { class: 'stack' }, heads(titles), body));
}

function item(cell) {
  const path = `/cells/${encodeURIComponent(cell.name)}`;
  const drawn = chart();
  const channels = h('tbody');
  const axes = h('tbody');
  const groups = h('tbody');
  const stuck = h('ul', { class: 'stuck', role: 'alert' });
  const window = h('select', { 'aria-label': `Time that the chart of ${cell.name} shows` },
    WINDOWS.map(([seconds, name]) => h('option', { value: seconds }, name)));
  const stopped = h('p', { class: 'wrong', role: 'alert' },
    'Stopped: the gateway was ended in the middle of its work. Look at the machines, then ',
    sureButton('Let programs begin again', () => act(() => api.post(`${path}/clear`))));
  const allAxes = table(['Axis', 'Has it', 'Wait for it', 'Actions'], axes);
  const node = h('li', { class: 'panel' }, h('h2', {}, cell.name), stopped, stuck,
    h('p', { class: 'legend' }, h('span', { class: 'runs' }, 'runs'), h('span', { class: 'waits' }, 'waits'), h('span', { class: 'stands' }, 'stands'), window),
    h('div', { class: 'timeline' }, h('div', { class: 'names', 'aria-hidden': 'true' }, cell.channels.map((of) => h('span', {}, of.link))), drawn.node),
    table(['Channel', 'Does', 'For', 'Words', 'Next'], channels), allAxes, table(['Group', 'Channels', 'Mode'], groups));
  return {
    node,
    update(now) {
      const running = now.channels.filter((channel) => channel.program !== null).map((channel) => channel.link);
      drawn.update(now, Number(window.value));
      show(stopped, now.is_stopped);
      show(stuck, now.stuck.length);
      keyed(stuck, now.stuck, (of) => of.link, stuckItem);
      keyed(channels, now.channels.map((of) => ({ ...of, now_ms: now.now_ms })), (of) => of.link, channelRow);
      show(allAxes, now.axes.length);
      keyed(axes, now.axes.map((of) => ({ ...of, running, path: `${path}/axes/${encodeURIComponent(of.name)}` })), (of) => of.name, axisRow);
      keyed(groups, now.groups.map((of) => ({ ...of, path: `${path}/groups/${encodeURIComponent(of.name)}` })), (of) => of.name, groupRow);
    },
  };
}

/** The page with all cells. */
export function page() {
  const list = h('ul', { class: 'plugins' });
  const empty = h('p', { class: 'empty' });
  async function look() {
    try {
      const cells = await api.get('/cells');
      say(empty, 'There are no cells: gateway.toml names links that work together.');
      show(empty, !cells.length);
      keyed(list, cells, (cell) => cell.name, item);
    } catch (error) {
      say(empty, `The cells cannot be had: ${error.message}`);
      show(empty, true);
    }
  }
  const timer = setInterval(look, 1000);
  look();
  return { node: h('section', {}, h('h1', {}, 'Cells'), list, empty), update() {}, end: () => clearInterval(timer) };
}
