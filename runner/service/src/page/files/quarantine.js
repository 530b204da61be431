// A link in quarantine: the fault once, how often it was, and the ways out.

import * as api from './api.js';
import { act } from './message.js';
import { h, keyed, say, show } from './dom.js';
import * as store from './store.js';
import * as text from './text.js';

/** Faults that are the same, told once: the newest of each, with how often and since when. */
export function told(faults) {
  const found = new Map();
  for (const fault of faults) {
    const key = JSON.stringify([fault.text, fault.event, fault.plugin.digest]);
    const known = found.get(key);
    found.set(key, { key, fault, count: (known?.count ?? 0) + 1, first: known?.first ?? fault.at_ms });
  }
  return [...found.values()].sort((a, b) => b.fault.at_ms - a.fault.at_ms);
}

export function quarantine(path) {
  const why = h('p', { class: 'large' });
  const list = h('ol', { class: 'faults' });
  const back = h('button', {
    class: 'main',
    onclick: () => act(async () => {
      const view = await api.post(`${path}/swap`, { plugin: text.pluginKey(back.to), when: 'now' });
      return `Back to ${text.plugin(view.to)}: ${view.state}`;
    }),
  });
  const release = h('button', { onclick: () => act(() => store.took(api.post(`${path}/release`))) }, 'Release');
  const hint = h('p', { class: 'facts' });
  const node = h('div', { class: 'panel bad' }, h('h2', {}, 'Quarantine'), why, h('div', { class: 'buttons' }, back, release), hint, list);
  return {
    node,
    update(link) {
      show(node, link.quarantine);
      if (!link.quarantine) return;
      const { since_ms: since, faults, ran_well: former } = link.quarantine;
      const isKept = former && store.plugins.some((of) => of.digest === former.digest);
      back.to = former;
      say(back, former ? `Back to ${text.plugin(former)}` : '');
      show(back, isKept && store.isAdmin());
      show(release, store.mayAct());
      release.classList.toggle('main', !(isKept && store.isAdmin()));
      say(why, `Since ${text.time(since)} the plug-in ${text.plugin(link.plugin)} is not started again. The line is silent; other links see nothing of it.`);
      const parts = [
        isKept && `${text.plugin(former)} ran well on this link before.`,
        former && !isKept && `${text.plugin(former)} ran well on this link before, but is no longer in the library.`,
        isKept && !store.isAdmin() && 'An admin may go back to it.',
        store.mayAct() && 'Release starts the same plug-in again.',
      ].filter(Boolean);
      say(hint, parts.join(' '));
      keyed(list, told(faults), (one) => one.key, (one) => item(path, one));
    },
  };
}

function item(path, { fault }) {
  const often = h('p', { class: 'facts' });
  const words = h('pre', { tabIndex: 0, 'aria-label': 'Last words of the plug-in' });
  const save = h('button', { class: 'quiet', onclick: () => act(() => api.save(`${path}/traces/${api.part(save.trace)}`, save.trace)) }, 'Save the trace');
  return {
    node: h('li', {}, h('p', {}, h('strong', {}, fault.text)), often, words, save),
    update({ fault: now, count, first }) {
      const times = count === 1 ? `Once, ${text.time(now.at_ms)}` : `${count} times, from ${text.time(first)} to ${text.time(now.at_ms)}`;
      const event = now.event === 'none' || now.text.includes(`"${now.event}"`) ? '' : `, at the event ${now.event}`;
      say(often, `${times}; ${text.plugin(now.plugin)}${event}`);
      say(words, now.last_words ?? '');
      show(words, now.last_words && !now.text.includes(now.last_words));
      save.trace = now.trace;
      show(save, now.trace);
      if (now.trace) save.title = now.trace;
    },
  };
}
