// Links at a glance.

import { h, keyed, say, show } from './dom.js';
import { chart } from './chart.js';
import * as store from './store.js';
import * as text from './text.js';

const SIGNS = {
  opening: '…', idle: '○', sending: '▶', receiving: '◀', paused: '❚❚', down: '✕', restarting: '↻', quarantined: '⚠',
  closing: '…',
};

const TROUBLE = new Set(['down', 'restarting', 'quarantined']);
const WORK = new Set(['sending', 'receiving', 'paused']);

export const inTrouble = (link) => TROUBLE.has(link.state) || link.trouble.length > 0;
export const errors = (link) => Object.values(link.counters.line_errors).reduce((sum, count) => sum + count, 0);

/** The state in a sign and a word; colour only adds to it. */
export function badge() {
  const sign = h('span', { 'aria-hidden': 'true', class: 'sign' });
  const word = h('span');
  const node = h('span', { class: 'badge' }, sign, word);
  return {
    node,
    update(link) {
      const isHeld = link.is_held && !TROUBLE.has(link.state);
      say(sign, isHeld ? '■' : SIGNS[link.state] ?? '?');
      say(word, isHeld ? `${link.state}, held` : link.state);
      const isOdd = link.alarms.length || isHeld || link.state === 'paused';
      const kind = TROUBLE.has(link.state) ? 'bad' : isOdd ? 'warn' : WORK.has(link.state) ? 'work' : 'calm';
      node.className = `badge ${kind}`;
    },
  };
}

/** What is wrong with a link, in a sentence; empty if nothing is. */
export function trouble(link) {
  return link.trouble.join('; ');
}

function card(link) {
  const state = badge();
  const picture = chart();
  const what = h('p', { class: 'what' });
  const bar = h('progress', { max: 100 });
  const wrong = h('p', { class: 'wrong' });
  const facts = h('p', { class: 'facts' });
  const node = h('li', { class: 'card' },
    h('a', { class: 'cover', href: `#/link/${encodeURIComponent(link.name)}` }, link.name),
    state.node, what, bar, picture.node, facts, wrong);
  return {
    node,
    update(now) {
      state.update(now);
      const job = now.job;
      say(what, doing(now));
      show(bar, job?.size);
      if (job?.size) bar.value = text.percent(job.surely_left, job.size);
      bar.setAttribute('aria-label', `Progress of ${job?.program ?? 'the job'}`);
      picture.update(now.buffer, store.levels.get(now.name));
      const parts = [`buffer ${text.bytes(now.buffer.level)}`, `errors ${text.count(errors(now))}`];
      if (now.counters.starved) parts.push(`starved ${text.count(now.counters.starved)}×`);
      if (now.counters.restarts) parts.push(`restarts ${text.count(now.counters.restarts)}`);
      say(facts, parts.join(' · '));
      say(wrong, trouble(now));
      show(wrong, trouble(now));
    },
  };
}

/** What a link does, in a few words. */
export function doing(link) {
  const waits = link.queued ? `, ${link.queued} waiting` : '';
  if (link.job) {
    const { program, kind, size, surely_left: left } = link.job;
    const name = program ?? kind;
    return size ? `${name} ${text.percent(left, size)} %${waits}` : `${name} ${text.bytes(left)}${waits}`;
  }
  if (link.receiving) return `from the machine: ${link.receiving.name ?? 'unnamed'} ${text.bytes(link.receiving.bytes)}`;
  if (link.queued) return `${link.queued} waiting`;
  return link.plugin ? text.plugin(link.plugin) : 'no plug-in';
}

/** The page with all links. */
export function page() {
  const cards = h('ul', { class: 'cards' });
  const search = h('input', { type: 'search', placeholder: 'Find a link', 'aria-label': 'Find a link', oninput: update });
  let wanted = 'all';
  const choice = (name) => h('button', {
    class: 'chip', onclick: () => { wanted = name; update(); },
  });
  const chips = { all: choice('all'), working: choice('working'), trouble: choice('trouble') };
  const tests = {
    all: () => true,
    working: (link) => WORK.has(link.state),
    trouble: inTrouble,
  };
  const empty = h('p', { class: 'empty' });

  function update() {
    const links = store.sorted();
    for (const [name, chip] of Object.entries(chips)) {
      say(chip, `${name} ${links.filter(tests[name]).length}`);
      chip.setAttribute('aria-pressed', name === wanted);
      chip.classList.toggle('bad', name === 'trouble' && links.some(inTrouble));
    }
    const part = search.value.trim().toLowerCase();
    const shown = links.filter(tests[wanted]).filter((link) => link.name.toLowerCase().includes(part));
    keyed(cards, shown, (link) => link.name, card);
    say(empty, links.length ? 'No link is like this.' : 'There are no links: gateway.toml names them.');
    show(empty, !shown.length);
  }
  update();
  const node = h('section', {},
    h('h1', {}, 'Links'),
    h('div', { class: 'tools' }, search, h('div', { class: 'chips', role: 'group', 'aria-label': 'Which links' }, Object.values(chips))),
    cards, empty);
  return { node, update };
}
