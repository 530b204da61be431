// What a link does, in signs, words and numbers.

import { h, say, show } from './dom.js';
import { act } from './message.js';
import * as api from './api.js';
import * as store from './store.js';
import * as text from './text.js';

const SIGNS = {
  opening: '…', idle: '○', sending: '▶', receiving: '◀', paused: '❚❚', down: '✕', restarting: '↻', quarantined: '⚠', closing: '…',
};
const TROUBLE = new Set(['down', 'restarting', 'quarantined']);
const WORK = new Set(['sending', 'receiving', 'paused']);
/** The gravest first. */
const GRAVITY = ['quarantined', 'down', 'restarting', 'held', 'waits', 'paused', 'sending', 'receiving', 'opening', 'closing', 'idle'];

export const inTrouble = (link) => TROUBLE.has(link.state) || link.trouble.length > 0;
export const isWorking = (link) => WORK.has(link.state);
export const isHeld = (link) => link.is_held && !TROUBLE.has(link.state);
export const isPaused = (link) => link.state === 'paused';
export const errors = (link) => Object.values(link.counters.line_errors).reduce((sum, count) => sum + count, 0);

/** What it does, in one word. */
export function situation(link) {
  if (isHeld(link)) return 'held';
  if (link.job?.awaits && link.state === 'sending') return 'waits';
  return link.state;
}

const WORDS = { held: 'held by the machine', waits: 'waits for the machine', paused: 'paused by hand' };
export const word = (link) => WORDS[situation(link)] ?? link.state;
export const sign = (link) => (isHeld(link) ? '■' : SIGNS[link.state] ?? '?');
export const gravity = (link) => (link.trouble.length ? 0 : 20) + GRAVITY.indexOf(situation(link));

/** bad, warn, work or calm. */
export function mood(link) {
  if (TROUBLE.has(link.state)) return 'bad';
  if (link.alarms.length || link.state === 'paused' || situation(link) === 'held' || situation(link) === 'waits') return 'warn';
  return WORK.has(link.state) ? 'work' : 'calm';
}

/** The state in a sign and words; colour only adds to it. */
export function badge() {
  const mark = h('span', { 'aria-hidden': 'true', class: 'sign' });
  const words = h('span');
  const node = h('span', { class: 'badge' }, mark, words);
  return {
    node,
    update(link) {
      say(mark, sign(link));
      say(words, word(link));
      const name = `badge ${mood(link)}`;
      if (node.className !== name) node.className = name;
    },
  };
}

/** What is wrong with a link, in a sentence; empty if nothing is. */
export const trouble = (link) => link.trouble.join('; ');

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

/** What is under way or came last, by name. */
export const program = (link) => link.job?.program ?? link.job?.kind ?? link.receiving?.name ?? (link.receiving ? 'unnamed' : '');

/** How long the rest takes, for people. */
export function remaining(job) {
  return job?.remaining_us ? text.rough(job.remaining_us) : '';
}

export const rate = (job) => (job?.rate ? `${text.bytes(job.rate)}/s` : '');

/** The block that is sent, with its number. */
export function block(job) {
  // Before the machine has asked for anything, none is sent.
  if (job?.awaits && job.surely_left === 0) return '';
  return job?.block ? `${text.count(job.block.number)}: ${job.block.text || '(empty)'}` : '';
}

/** Sent, confirmed, to go, rate, time, block: what is known of a job, as names and values. */
export function numbers(job) {
  // Before the machine has asked for anything, all of these would be nothing.
  if (!job || job.maybe_left === 0 || job.awaits && job.surely_left === 0) return [];
  const isSend = job.size !== null;
  const left = isSend ? Math.max(0, job.size - job.surely_left) : null;
  return [
    // A plug-in keeps some of what it was given: more than this cannot have left.
    ['Sent, at most', isSend && text.exact(job.maybe_left)],
    ['Confirmed', isSend && text.exact(job.surely_left)],
    ['To go', isSend && left > 0 && text.exact(left)],
    ['Rate', rate(job)],
    ['Time to go', remaining(job)],
    ['Block', block(job)],
  ];
}

/** Says that somebody has seen how the jobs of a link ended that did not end well. */
export function seenButton() {
  const button = h('button', {
    class: 'seen',
    onclick: () => act(() => store.took(api.post(`/jobs/${button.job}/acknowledge`))),
  }, 'Seen');
  return {
    node: button,
    update(link) {
      const newest = link.unseen[0];
      if (button.job !== newest?.id) {
        button.job = newest?.id;
        button.setAttribute('aria-label', `I have seen how job ${newest?.id} ended`);
      }
      show(button, newest && store.mayAct());
    },
  };
}
