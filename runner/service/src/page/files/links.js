// Links at a glance: as cards, or, of many, as a table. What is looked for stands in the address.

import * as address from './address.js';
import { bulk } from './bulk.js';
import { card } from './card.js';
import { h, keyed, options, say, show } from './dom.js';
import { COLUMNS, heads, row } from './rows.js';
import { sight } from './visible.js';
import * as state from './state.js';
import * as store from './store.js';
import * as text from './text.js';

/** More links than this are a table, if nothing is said. */
const MOST_CARDS = 24;
/** So many are made before the first picture; the others a moment later. */
const FIRST = 60;
/** What is sorted by what changes by itself is sorted anew as often, in milliseconds. */
const CALM = 5000;

const TESTS = { all: () => true, working: state.isWorking, trouble: state.inTrouble, idle: (link) => link.state === 'idle' };
const CHANGES_BY_ITSELF = new Set(['state', 'program', 'done', 'rest']);

/** Links as the address asks for them. */
export function chosenBy(query) {
  const part = (query.get('find') ?? '').trim().toLowerCase();
  const group = query.get('group') ?? '';
  const test = TESTS[query.get('show')] ?? TESTS.all;
  return (link) => test(link) && (!group || link.group === group)
    && (!part || `${link.name} ${link.group ?? ''} ${state.program(link)} ${link.plugin?.name ?? ''} ${state.word(link)}`.toLowerCase().includes(part));
}

/** The page with all links. */
export function page(_, query) {
  const wish = Object.fromEntries(query);
  const chosen = new Set();
  const seen = sight();
  const ask = (changes) => {
    Object.assign(wish, changes);
    address.ask('links', wish);
    sortedAt = 0;
    update();
  };
  const search = h('input', {
    type: 'search', placeholder: 'Find a link or program', name: 'find', 'aria-label': 'Find a link or program', value: wish.find ?? '', oninput: () => ask({ find: search.value }),
  });
  const group = h('select', { 'aria-label': 'Group', onchange: () => ask({ group: group.value }) });
  const chips = Object.keys(TESTS).map((name) => [name, h('button', { class: 'chip', onclick: () => ask({ show: name === 'all' ? '' : name }) })]);
  const view = h('button', { class: 'quiet', onclick: () => ask({ view: isTable() ? 'cards' : 'table' }) });
  const wall = h('a', { class: 'button quiet' }, 'Wall');
  const isTable = () => (wish.view ? wish.view === 'table' : store.links.size > MOST_CARDS);

  const cards = h('ul', { class: 'cards' });
  const titles = heads(
    (key) => ask({ sort: key, down: wish.sort === key && !wish.down ? '1' : '' }),
    (is) => { for (const link of shown) chosen[is ? 'add' : 'delete'](link.name); update(); },
  );
  const rows = h('div', { role: 'rowgroup' });
  const table = h('div', { role: 'table', class: 'dense panel', 'aria-label': 'Links' }, h('div', { role: 'rowgroup' }, titles.node), rows);
  const many = bulk(chosen, () => update());
  const empty = h('p', { class: 'empty' });
  let shown = [];
  let sortedAt = 0;
  let key = '';
  let isWhole = false;

  /** Which links, in which order; whether that is another than before. */
  function choose() {
    const [name, , compare] = COLUMNS.find(([name]) => name === wish.sort) ?? COLUMNS[0];
    const isCalm = CHANGES_BY_ITSELF.has(name) && Date.now() - sortedAt < CALM;
    const fits = chosenBy(new URLSearchParams(wish));
    const found = store.sorted().filter(fits);
    if (isCalm) {
      const names = new Set(found.map((link) => link.name));
      const before = shown.filter((link) => names.delete(link.name)).map((link) => store.links.get(link.name));
      shown = [...before, ...[...names].map((name) => store.links.get(name))];
    } else {
      if (name !== 'name') found.sort(compare);
      if (wish.down) found.reverse();
      shown = found;
      sortedAt = Date.now();
    }
    const now = `${isTable()}\n${shown.map((link) => link.name).join('\n')}`;
    const isOther = now !== key;
    key = now;
    return isOther;
  }

  const make = (link) => {
    const part = isTable() ? row(link, chosen, () => update()) : card(link);
    seen.add(part);
    return part;
  };
  const bring = (part) => ({ ...part, update: (link) => { if (part.isVisible) part.update(link); } });
  const parts = new Map();

  /** All that was not told to have changed stays as it is. */
  function update(news = null) {
    const isOther = choose();
    if (isOther) {
      const [list, other] = isTable() ? [rows, cards] : [cards, rows];
      keyed(other, [], (link) => link.name, make);
      const first = isWhole ? shown : shown.slice(0, FIRST);
      keyed(list, first, (link) => link.name, (link) => {
        const part = make(link);
        parts.set(link.name, part);
        return bring(part);
      });
    }
    for (const name of isOther || !news ? shown.map((link) => link.name) : news) {
      const part = parts.get(name);
      const link = store.links.get(name);
      if (part?.isVisible && link) part.update(link);
    }
    tell();
    if (isWhole || shown.length <= FIRST) return;
    requestAnimationFrame(() => setTimeout(() => {
      if (isWhole) return;
      isWhole = true;
      key = '';
      update();
    }));
  }

  function tell() {
    const links = [...store.links.values()];
    for (const [name, chip] of chips) {
      const count = links.filter(TESTS[name]).length;
      say(chip, count ? `${name} ${text.count(count)}` : name);
      chip.setAttribute('aria-pressed', name === (wish.show || 'all'));
      chip.classList.toggle('bad', name === 'trouble' && count > 0);
    }
    const groups = store.groups();
    options(group, [['', 'all groups'], ...groups.map((name) => [name, name])]);
    if (group.value !== (wish.group ?? '')) group.value = wish.group ?? '';
    show(group, groups.length);
    table.classList.toggle('ungrouped', !groups.length);
    say(view, isTable() ? 'As cards' : 'As a table');
    wall.href = address.to('wall', { group: wish.group, show: wish.show });
    show(table, isTable() && shown.length);
    show(cards, !isTable() && shown.length);
    for (const name of chosen) if (!store.links.has(name)) chosen.delete(name);
    titles.update(wish.sort || 'name', Boolean(wish.down), shown.filter((link) => chosen.has(link.name)).length, shown.length);
    many.update();
    say(empty, links.length ? 'No link is like this.' : 'There are no links: gateway.toml names them.');
    show(empty, !shown.length);
  }
  update();
  const node = h('section', {},
    h('div', { class: 'title' }, h('h1', {}, 'Links'), view, wall),
    h('div', { class: 'tools' }, search, group, h('div', { class: 'chips', role: 'group', 'aria-label': 'Which links' }, chips.map(([, chip]) => chip))),
    many.node, table, cards, empty);
  const end = () => {
    seen.end();
    many.end();
  };
  return { node, update, end };
}
