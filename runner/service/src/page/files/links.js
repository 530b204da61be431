// Links at a glance.

import * as api from './api.js';
import { act } from './message.js';
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
      const waits = link.job?.awaits;
      say(word, `${link.state}${isHeld ? ', held by the machine' : waits ? ', waits for the machine' : ''}`);
      const isOdd = link.alarms.length || isHeld || waits || link.state === 'paused';
      const kind = TROUBLE.has(link.state) ? 'bad' : isOdd ? 'warn' : WORK.has(link.state) ? 'work' : 'calm';
      node.className = `badge ${kind}`;
    },
  };
}

/** What is wrong with a link, in a sentence; empty if nothing is. */
export function trouble(link) {
  return link.trouble.join('; ');
}

/** Says that somebody has seen how the jobs of a link ended that did not end well. */
export function seenButton() {
  const button = h('button', {
    class: 'seen',
    onclick: () => act(async () => store.took(await api.post(`/jobs/${button.job}/acknowledge`))),
  }, 'Seen');
  return {
    node: button,
    update(link) {
      const newest = link.unseen[0];
      button.job = newest?.id;
      button.setAttribute('aria-label', `I have seen how job ${newest?.id} ended`);
      show(button, newest);
    },
  };
}

function card(link) {
  const state = badge();
  const picture = chart();
  const what = h('p', { class: 'what' });
  const bar = h('progress', { max: 100 });
  const wrong = h('p', { class: 'wrong' });
  const facts = h('p', { class: 'facts' });
  const seen = seenButton();
  const node = h('li', { class: 'card' },
    h('a', { class: 'cover', href: `#/link/${encodeURIComponent(link.name)}` }, link.name),
    state.node, what, bar, picture.node, facts, wrong, seen.node);
  return {
    node,
    update(now) {
      state.update(now);
      const job = now.job;
      say(what, doing(now));
      show(bar, job?.size);
      bar.value = job?.percent ?? 0;
      node.classList.toggle('trouble', inTrouble(now));
      seen.update(now);
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
  if (link.job) return `${link.job.program ?? link.job.kind}: ${link.job.text}${waits}`;
  if (link.receiving) return `from the machine: ${link.receiving.name ?? 'unnamed'} ${text.bytes(link.receiving.bytes)}`;
  if (link.queued) return `${link.queued} waiting`;
  // What nobody has seen stands among the trouble.
  const isNews = link.last && link.last.id !== link.unseen[0]?.id;
  if (isNews && link.state !== 'sending') return `last ${text.time(link.last.ended_ms)}: ${link.last.program ?? link.last.kind} ${link.last.state}; ${link.last.text}`;
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
