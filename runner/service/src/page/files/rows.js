// Links as a dense table: hundreds of them.

import { toLink } from './address.js';
import { h, say, show } from './dom.js';
import * as state from './state.js';
import * as store from './store.js';
import * as text from './text.js';

/** The columns, and by what each sorts. */
export const COLUMNS = [
  ['name', 'Link', (a, b) => store.inOrder(a.name, b.name)],
  ['group', 'Group', (a, b) => store.inOrder(a.group ?? '\uffff', b.group ?? '\uffff')],
  ['state', 'State', (a, b) => state.gravity(a) - state.gravity(b)],
  ['program', 'Program', (a, b) => store.inOrder(state.program(a) || '\uffff', state.program(b) || '\uffff')],
  ['done', 'Done', (a, b) => (b.job?.percent ?? -1) - (a.job?.percent ?? -1)],
  ['rest', 'Time to go', (a, b) => (a.job?.remaining_us ?? Infinity) - (b.job?.remaining_us ?? Infinity)],
  ['plugin', 'Plug-in', (a, b) => store.inOrder(text.plugin(a.plugin), text.plugin(b.plugin))],
];

/** The heads: a button for each, which sorts, and once more turns the order round. */
export function heads(onSort, onAll) {
  const all = h('input', { type: 'checkbox', 'aria-label': 'Choose all links that are shown', onchange: () => onAll(all.checked) });
  const cells = COLUMNS.map(([key, title]) => {
    const mark = h('span', { 'aria-hidden': 'true' });
    const node = h('span', { role: 'columnheader', class: key }, h('button', { class: 'sort', onclick: () => onSort(key) }, title, ' ', mark));
    return { key, node, mark };
  });
  const chooses = h('span', { role: 'columnheader', class: 'choose' }, all);
  return {
    node: h('div', { role: 'row', class: 'heads' }, chooses, cells.map((cell) => cell.node)),
    update(sort, isDown, chosen, shown) {
      for (const { key, node, mark } of cells) {
        const is = key === sort;
        const order = is ? (isDown ? 'descending' : 'ascending') : 'none';
        if (node.getAttribute('aria-sort') !== order) node.setAttribute('aria-sort', order);
        say(mark, is ? (isDown ? '▼' : '▲') : '');
      }
      all.checked = shown > 0 && chosen === shown;
      all.indeterminate = chosen > 0 && chosen < shown;
      show(all, store.mayAct());
    },
  };
}

/** Sets a text without a look at the page: what was said last is kept. */
function teller(element) {
  let last = '';
  return (words) => {
    if (words === last) return;
    last = words;
    element.textContent = words;
  };
}

/** A link's row. `chosen` is the set of names that are chosen. */
export function row(link, chosen, onChoose) {
  const box = h('input', {
    type: 'checkbox', 'aria-label': `Choose ${link.name}`,
    onchange: () => { chosen[box.checked ? 'add' : 'delete'](link.name); onChoose(); },
  });
  const cell = (name, ...children) => h('span', { role: 'cell', class: name }, ...children);
  const badge = state.badge();
  const bar = h('progress', { max: 100, value: 0, hidden: true });
  const percent = h('span');
  const wrong = h('span', { class: 'wrong' });
  const group = cell('group');
  const program = cell('program');
  const rest = cell('rest');
  const plugin = cell('plugin');
  const node = h('div', { role: 'row', class: 'row' },
    cell('choose', store.mayAct() && box),
    cell('name', h('a', { href: toLink(link.name) }, link.name)),
    group, cell('state', badge.node, wrong), program, cell('done', bar, percent), rest, plugin);
  const tellers = {
    wrong: teller(wrong), group: teller(group), program: teller(program), percent: teller(percent), rest: teller(rest), plugin: teller(plugin),
  };
  bar.setAttribute('aria-label', `Progress on ${link.name}`);
  const part = {
    node,
    isVisible: false,
    appears() {
      const now = store.links.get(link.name);
      if (now) part.update(now);
    },
    update(now) {
      const { job } = now;
      badge.update(now);
      if (box.checked !== chosen.has(now.name)) box.checked = chosen.has(now.name);
      tellers.wrong(state.trouble(now));
      tellers.group(now.group ?? '');
      tellers.program(state.program(now));
      const has = job?.percent !== null && job?.percent !== undefined;
      show(bar, has);
      if (has && bar.value !== job.percent) bar.value = job.percent;
      tellers.percent(has ? `${job.percent} %` : '');
      tellers.rest(state.remaining(job));
      tellers.plugin(text.plugin(now.plugin));
    },
  };
  return part;
}
