// Jobs: the queue and what became of each.

import * as api from './api.js';
import { act } from './message.js';
import { h, keyed, say, show, sureButton } from './dom.js';
import * as store from './store.js';
import * as text from './text.js';

const ENDED = new Set(['done', 'failed', 'aborted', 'interrupted']);

/** A table of jobs. */
export function table(list, withLink = true) {
  const body = h('tbody');
  const titles = ['Job', withLink && 'Link', 'Program', 'State', 'Progress', 'Ordered', ''].filter((title) => title !== false);
  const frame = h('div', { class: 'scroll' }, h('table', { class: 'stack' }, h('thead', {}, h('tr', {}, titles.map((title) => h('th', {}, title)))), body));
  const empty = h('p', { class: 'empty' }, 'No jobs yet.');
  const update = () => {
    const jobs = list();
    show(frame, jobs.length);
    show(empty, !jobs.length);
    keyed(body, jobs, (job) => job.id, (job) => row(job, withLink));
  };
  return { node: h('div', {}, frame, empty), update };
}

function row(job, withLink) {
  const state = h('td');
  const progress = h('td');
  const order = (verb, body) => () => act(async () => {
    const came = await api.post(`/jobs/${job.id}/${verb}`, body);
    store.took(came);
    return verb === 'acknowledge' ? '' : { progressOf: came.id };
  });
  let asksForBlock = true;
  const pause = h('button', { class: 'quiet', onclick: order('pause') }, 'Pause');
  const resume = h('button', { class: 'quiet', onclick: order('resume') }, 'Resume');
  const abort = sureButton('Abort', order('abort'));
  const seen = h('button', { class: 'quiet', onclick: order('acknowledge') }, 'Seen');
  const again = h('button', { class: 'quiet', onclick: order('restart', {}) }, 'Again');
  const from = h('button', { class: 'quiet', onclick: () => order('restart', { from_block: from.block })() });
  const up = h('button', {
    class: 'quiet', title: 'Before others that wait',
    onclick: () => act(async () => store.took(await api.put(`/jobs/${job.id}/priority`, { priority: up.priority + 1 }))),
  }, 'Earlier');
  const node = h('tr', {},
    h('td', {}, String(job.id)),
    withLink && h('td', {}, h('a', { href: `#/link/${encodeURIComponent(job.link)}` }, job.link)),
    h('td', {}, job.program ?? job.kind), state, progress, h('td', {}, text.time(job.created_ms)),
    h('td', { class: 'buttons' }, pause, resume, up, abort, seen, from, again));
  for (const button of [pause, resume, abort, seen, again, up]) button.setAttribute('aria-label', `${button.textContent} job ${job.id}`);
  return {
    node,
    update(now) {
      node.className = now.state;
      say(state, now.message && ENDED.has(now.state) && now.state !== 'done' ? `${now.state}: ${now.message}` : now.state);
      say(progress, now.text);
      show(pause, now.state === 'running');
      show(resume, now.state === 'paused');
      show(abort, !ENDED.has(now.state));
      show(seen, now.is_unseen);
      show(again, ENDED.has(now.state) && now.program);
      up.priority = now.priority;
      show(up, now.state === 'queued');
      from.block = (now.last_block ?? 0) + 1;
      say(from, `From block ${from.block}`);
      show(from, ENDED.has(now.state) && now.state !== 'done' && now.last_block);
      if (asksForBlock && now.is_unseen && now.last_block === null && now.surely_left > now.start_byte) {
        // Where a restart can begin is in the program: the gateway looks there for one job at a time.
        asksForBlock = false;
        api.get(`/jobs/${job.id}`).then(store.took, () => {});
      }
    },
  };
}

export function page() {
  const jobs = table(store.newestJobs);
  jobs.update();
  return { node: h('section', {}, h('h1', {}, 'Jobs'), h('div', { class: 'panel' }, jobs.node)), update: jobs.update };
}
