// What has happened.

import { toLink } from './address.js';
import { filtered, has, isWithin } from './filters.js';
import { h, keyed, show } from './dom.js';
import * as store from './store.js';
import * as text from './text.js';

const KINDS = ['gateway', 'port', 'job', 'cell', 'reception', 'request', 'swap', 'fault', 'alarm', 'library', 'note'];

const fits = (entry, wish) => (!wish.link || entry.link === wish.link) && (!wish.kind || entry.kind === wish.kind)
  && isWithin(entry.at_ms, wish) && has(`${entry.text}\n${entry.link ?? ''}`, wish);

function row(entry) {
  const node = h('tr', { class: { warning: 'warned', alarm: 'bad' }[entry.weight] ?? '' },
    h('td', {}, text.time(entry.at_ms)), h('td', {}, entry.kind),
    h('td', {}, entry.link ? h('a', { href: toLink(entry.link) }, entry.link) : ''),
    h('td', { class: 'text' }, entry.text));
  return { node, update() {} };
}

export function page(_, query) {
  const body = h('tbody');
  const entries = filtered({
    name: 'journal', path: '/journal', query, find: 'Find in the journal', numberOf: (entry) => entry.number,
    choices: { kind: ['About', [['', 'all subjects'], ...KINDS.map((kind) => [kind, kind])]] },
    live: () => store.journal, fits,
  });
  const titles = ['When', 'About', 'Link', 'What'].map((title) => h('th', { scope: 'col' }, title));
  const frame = h('div', { class: 'scroll' }, h('table', { class: 'stack' }, h('thead', {}, h('tr', {}, titles)), body));
  const empty = h('p', { class: 'empty' }, 'Nothing in the journal is like this.');
  function update() {
    entries.update();
    const list = entries.list();
    keyed(body, list, (entry) => entry.number, row);
    show(frame, list.length);
    show(empty, !list.length);
  }
  update();
  const node = h('section', {}, h('h1', {}, 'Journal'), h('div', { class: 'panel' }, entries.tools, frame, empty, entries.more));
  return { node, update };
}
