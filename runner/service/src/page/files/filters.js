// Lists that the gateway keeps, the newest first: filtered as the address says, a page at a time.

import * as address from './address.js';
import * as api from './api.js';
import { h, options, show } from './dom.js';
import * as store from './store.js';

const PAGE = 100;
/** What is typed is asked for when nothing more was typed for as long, in milliseconds. */
const TYPING = 300;

/** A time of day for a field of the page, in the zone of whoever looks. */
function local(ms) {
  if (!ms) return '';
  const date = new Date(Number(ms));
  return new Date(date.getTime() - date.getTimezoneOffset() * 60000).toISOString().slice(0, 16);
}

/**
 * The filters and the list of a page. `choices` has further selects: {key: [label, [[value, text]]]}; `numberOf` gives an
 * item's number, by which the next page is asked for; `fits(item, wish)` says whether news belong to what is asked for.
 */
export function filtered({ name, path, query, choices, find, numberOf, live, fits }) {
  const wish = Object.fromEntries(query);
  const found = new Map();
  let isAll = true;
  let asked = 0;
  let timer = null;
  const failure = h('p', { class: 'wrong', role: 'alert', hidden: true });
  const ask = (changes, wait = 0) => {
    Object.assign(wish, changes);
    address.ask(name, wish);
    clearTimeout(timer);
    timer = setTimeout(begin, wait);
  };
  const link = h('select', { name: 'link', 'aria-label': 'Link', onchange: () => ask({ link: link.value }) });
  const selects = Object.entries(choices).map(([key, [label, values]]) => {
    const node = h('select', { name: key, 'aria-label': label, onchange: () => ask({ [key]: node.value }) }, values.map(([value, text]) => h('option', { value }, text)));
    node.value = wish[key] ?? '';
    return node;
  });
  const search = h('input', { type: 'search', placeholder: find, 'aria-label': find, value: wish.find ?? '', oninput: () => ask({ find: search.value.trim() }, TYPING) });
  const time = (key, label) => {
    const node = h('input', { type: 'datetime-local', value: local(wish[key]), onchange: () => ask({ [key]: node.value ? String(new Date(node.value).getTime()) : '' }) });
    return h('label', { class: 'inline' }, `${label} `, node);
  };
  const times = h('details', { open: Boolean(wish.since_ms || wish.until_ms) }, h('summary', {}, 'Time'),
    h('div', { class: 'row' }, time('since_ms', 'from'), time('until_ms', 'to')));
  const more = h('button', { onclick: () => fetchPage(Math.min(...found.keys())) }, 'Show older');
  const tools = h('div', {}, h('div', { class: 'tools' }, search, link, selects, times), failure);

  async function fetchPage(before) {
    const mine = (asked += 1);
    const values = Object.entries({ ...wish, limit: PAGE, before }).filter(([, value]) => value);
    try {
      const list = await api.get(`${path}?${new URLSearchParams(values)}`);
      if (mine !== asked) return;
      if (!before) found.clear();
      for (const item of list) found.set(numberOf(item), item);
      isAll = list.length < PAGE;
      show(failure, false);
    } catch (error) {
      failure.textContent = error.message;
      show(failure, true);
    }
    store.changed();
  }
  const begin = () => fetchPage();
  begin();
  return {
    tools,
    more,
    /** All that fits, the newest first. */
    list() {
      for (const item of live()) if (fits(item, wish) && (isAll || numberOf(item) >= Math.min(...found.keys()))) found.set(numberOf(item), item);
        else if (found.has(numberOf(item))) found.delete(numberOf(item));
      return [...found.values()].sort((a, b) => numberOf(b) - numberOf(a));
    },
    update() {
      options(link, [['', 'all links'], ...store.sorted().map((one) => [one.name, one.name])]);
      if (link.value !== (wish.link ?? '')) link.value = wish.link ?? '';
      show(more, !isAll && found.size);
    },
  };
}

/** Whether a time is between those that are asked for. */
export const isWithin = (ms, wish) => (!wish.since_ms || ms >= Number(wish.since_ms)) && (!wish.until_ms || ms < Number(wish.until_ms));

/** Whether a text has what is looked for. */
export const has = (text, wish) => !wish.find || text.toLowerCase().includes(wish.find.toLowerCase());
