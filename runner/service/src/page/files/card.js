// A link as a card: readable at arm's length.

import { toLink } from './address.js';
import { chart } from './chart.js';
import { h, say, show } from './dom.js';
import * as state from './state.js';
import * as store from './store.js';
import * as text from './text.js';

export function card(link) {
  const badge = state.badge();
  const picture = chart();
  const group = h('span', { class: 'group' });
  const what = h('p', { class: 'what' });
  const bar = h('progress', { max: 100 });
  const block = h('p', { class: 'block' });
  const wrong = h('p', { class: 'wrong' });
  const facts = h('p', { class: 'facts' });
  const seen = state.seenButton();
  const node = h('li', { class: 'card' },
    h('p', { class: 'head' }, h('a', { class: 'cover', href: toLink(link.name) }, link.name), ' ', group),
    badge.node, what, bar, block, facts, picture.node, wrong, seen.node);
  show(picture.node, false);
  const part = {
    node,
    isVisible: false,
    appears() {
      store.recall(link.name).catch(() => {});
      const now = store.links.get(link.name);
      if (now) part.update(now);
    },
    update(now) {
      badge.update(now);
      const { job } = now;
      say(group, now.group ?? '');
      say(what, state.doing(now));
      show(bar, job?.size);
      bar.value = job?.percent ?? 0;
      node.classList.toggle('trouble', state.inTrouble(now));
      seen.update(now);
      bar.setAttribute('aria-label', `Progress of ${job?.program ?? 'the job'}`);
      say(block, `Block ${state.block(job)}`);
      show(block, state.block(job));
      const levels = store.levels.get(now.name) ?? [];
      const isUsed = now.job || levels.some((sample) => sample.level > 0);
      show(picture.node, isUsed);
      if (isUsed) picture.update(now.buffer, levels);
      const errors = state.errors(now);
      const parts = [
        state.rate(job),
        state.remaining(job) && `${state.remaining(job)} to go`,
        errors && `line errors ${text.count(errors)}`,
        now.counters.restarts && `plug-in started again ${text.count(now.counters.restarts)}×`,
      ].filter(Boolean);
      say(facts, parts.join(' · '));
      show(facts, parts.length);
      say(wrong, state.trouble(now));
      show(wrong, state.trouble(now));
    },
  };
  return part;
}
