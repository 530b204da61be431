// What has happened.

import { h, keyed } from './dom.js';
import * as store from './store.js';
import * as text from './text.js';

export function page() {
  const body = h('tbody');
  const search = h('input', { type: 'search', placeholder: 'Find in the journal', 'aria-label': 'Find in the journal', oninput: update });
  function row(entry) {
    const node = h('tr', { class: entry.kind === 'fault' || entry.kind === 'alarm' ? 'bad' : '' },
      h('td', {}, text.time(entry.at_ms)), h('td', {}, entry.kind),
      h('td', {}, entry.link ? h('a', { href: `#/link/${encodeURIComponent(entry.link)}` }, entry.link) : ''),
      h('td', { class: 'text' }, entry.text));
    return { node, update() {} };
  }
  function update() {
    const part = search.value.trim().toLowerCase();
    const fits = (entry) => `${entry.kind} ${entry.link ?? ''} ${entry.text}`.toLowerCase().includes(part);
    keyed(body, store.journal.filter(fits), (entry) => entry.number, row);
  }
  update();
  const node = h('section', {}, h('h1', {}, 'Journal'), h('div', { class: 'panel' }, h('div', { class: 'tools' }, search),
    h('div', { class: 'scroll' }, h('table', { class: 'stack' }, h('thead', {}, h('tr', {}, ['When', 'About', 'Link', 'What'].map((title) => h('th', {}, title)))), body))));
  return { node, update };
}
