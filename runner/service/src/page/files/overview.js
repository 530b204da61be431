// What a link does now, and what can be done about it.

import * as api from './api.js';
import { act } from './message.js';
import { h, keyed, say, show, sureButton } from './dom.js';
import * as state from './state.js';
import * as store from './store.js';

/** What a situation means, and what goes on by itself. */
const MEANS = {
  held: 'The machine has said stop. It goes on by itself when the machine asks for more; overriding the hold sends although it has not.',
  paused: 'Somebody has paused it here. The machine waits; it goes on when somebody resumes it.',
};

export function overview(name, path) {
  const badge = state.badge();
  const what = h('p', { class: 'what large' });
  const bar = h('progress', { max: 100, 'aria-label': 'Progress' });
  const wrong = h('p', { class: 'wrong' });
  const means = h('p', { class: 'facts' });
  const numbers = h('dl', { class: 'numbers' });
  const order = (verb) => async () => {
    const link = store.links.get(name);
    if (link?.job) await act(async () => {
      const job = await store.took(api.post(`/jobs/${link.job.id}/${verb}`));
      return { progressOf: job.id };
    });
  };
  const onLink = (verb) => () => act(() => store.took(api.post(`${path}/${verb}`)));
  const seen = state.seenButton();
  const pause = h('button', { class: 'steady', onclick: order('pause') }, 'Pause');
  const resume = h('button', { class: 'main steady', onclick: order('resume') }, 'Resume');
  const abort = sureButton('Abort', order('abort'));
  const override = sureButton('Override hold', onLink('force-resume'));
  const force = sureButton('Send without waiting', onLink('force-resume'));
  const reopen = h('button', { onclick: onLink('reopen') }, 'Open the port again');
  const buttons = h('div', { class: 'buttons' }, seen.node, resume, pause, abort, override, force, reopen);
  const node = h('div', { class: 'panel' }, h('div', { class: 'row' }, badge.node, what), bar, wrong, buttons, means, numbers);
  return {
    node,
    update(link) {
      const { job } = link;
      const now = state.situation(link);
      badge.update(link);
      say(what, state.doing(link));
      show(bar, job?.size);
      bar.value = job?.percent ?? 0;
      // The fault of a quarantine stands above, once.
      const troubles = link.trouble.slice(link.quarantine ? 1 : 0).join('; ');
      say(wrong, troubles);
      show(wrong, troubles);
      say(means, MEANS[now] ?? '');
      show(means, MEANS[now]);
      seen.update(link);
      const may = store.mayAct();
      show(pause, may && job?.state === 'running');
      show(resume, may && job?.state === 'paused');
      show(abort, may && job);
      // A pause is not the machine's, and ends otherwise; a hold is not ours.
      show(override, may && now === 'held');
      show(force, may && now === 'waits');
      show(reopen, may && link.state === 'down');
      show(buttons, [...buttons.children].some((button) => !button.hidden));
      const values = state.numbers(job).filter(([, value]) => value);
      show(numbers, values.length);
      keyed(numbers, values, ([title]) => title, ([title]) => {
        const value = h('dd');
        return { node: h('div', { class: title === 'Block' ? 'block' : '' }, h('dt', {}, title), value), update: ([, text]) => say(value, text) };
      });
    },
  };
}
