// Jobs: the queue and what became of each.

import * as api from './api.js';
import { act } from './message.js';
import { h, keyed, say, show, sureButton } from './dom.js';
import { toLink } from './address.js';
import { filtered, has, isWithin } from './filters.js';
import * as store from './store.js';
import * as text from './text.js';

const ENDED = new Set(['done', 'failed', 'aborted', 'interrupted']);

/** A table of jobs. */
export function table(list, withLink = true, none = 'No jobs yet.') {
  const body = h('tbody');
  const titles = ['Job', withLink && 'Link', 'Program', 'State', 'Progress', 'Ordered', 'Actions'].filter((title) => title !== false);
  const frame = h('div', { class: 'scroll' }, h('table', { class: 'stack' }, h('thead', {}, h('tr', {}, titles.map((title) => h('th', { scope: 'col' }, title)))), body));
  const empty = h('p', { class: 'empty' }, none);
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
    const came = await store.took(api.post(`/jobs/${job.id}/${verb}`, body));
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
    onclick: () => act(() => store.took(api.put(`/jobs/${job.id}/priority`, { priority: up.priority + 1 }))),
  }, 'Earlier');
  const node = h('tr', {},
    h('td', {}, String(job.id)),
    withLink && h('td', {}, h('a', { href: toLink(job.link) }, job.link)),
    h('td', {}, text.program(job)), state, progress, h('td', {}, text.time(job.created_ms)),
    h('td', { class: 'buttons' }, pause, resume, up, abort, seen, from, again));
  for (const button of [pause, resume, abort, seen, again, up]) button.setAttribute('aria-label', `${button.textContent} job ${job.id}`);
  return {
    node,
    update(now) {
      node.className = now.state;
      say(state, now.message && ENDED.has(now.state) && now.state !== 'done' ? `${now.state}: ${now.message}` : now.state);
      say(progress, now.text);
      const may = store.mayAct();
      show(pause, may && now.state === 'running');
      show(resume, may && now.state === 'paused');
      show(abort, may && !ENDED.has(now.state));
      show(seen, may && now.is_unseen);
      show(again, may && ENDED.has(now.state) && now.program && now.kind !== 'receive');
      up.priority = now.priority;
      show(up, may && now.state === 'queued');
      from.block = (now.last_block ?? 0) + 1;
      say(from, `From block ${from.block}`);
      show(from, may && ENDED.has(now.state) && now.state !== 'done' && now.last_block);
      if (asksForBlock && now.is_unseen && now.last_block === null && now.surely_left > now.start_byte) {
        // Where a restart can begin is in the program: the gateway looks there for one job at a time.
        asksForBlock = false;
        store.took(api.get(`/jobs/${job.id}`)).catch(() => {});
      }
    },
  };
}

const STATES = ['queued', 'running', 'paused', 'done', 'failed', 'aborted', 'interrupted'];
const KINDS = ['send', 'receive', 'read', 'write'];

const fits = (job, wish) => (!wish.link || job.link === wish.link) && (!wish.state || job.state === wish.state)
  && (!wish.kind || job.kind === wish.kind) && isWithin(job.created_ms, wish) && has(text.program(job), wish);

export function page(_, query) {
  const kinds = [...new Set([...KINDS, ...store.plugins.flatMap((of) => of.jobs.map((kind) => kind.name))])];
  const found = filtered({
    name: 'jobs', path: '/jobs', query, find: 'Find a program', numberOf: (job) => job.id,
    choices: {
      state: ['State', [['', 'all states'], ...STATES.map((state) => [state, state])]],
      kind: ['Kind', [['', 'all kinds'], ...kinds.map((kind) => [kind, kind])]],
    },
    live: () => [...store.jobs.values()], fits,
  });
  const jobs = table(found.list, true, 'No job is like this.');
  const update = () => {
    found.update();
    jobs.update();
  };
  update();
  return { node: h('section', {}, h('h1', {}, 'Jobs'), h('div', { class: 'panel' }, found.tools, jobs.node, found.more)), update };
}
