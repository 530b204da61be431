// One line that says how an action went.

import { say } from './dom.js';
import * as store from './store.js';
import * as text from './text.js';
import { Refused } from './api.js';

const line = document.getElementById('message');
let timer = null;
let onStranger = () => {};
/** The job that the line tells of, until something else is told. */
let followed = null;

/** Called when the gateway no longer knows our token. */
export function whenStranger(then) {
  onStranger = then;
}

export function tell(text, isBad = false) {
  followed = null;
  put(text, isBad);
  if (!isBad) vanish();
}

function put(text, isBad) {
  clearTimeout(timer);
  say(line, text);
  line.classList.toggle('bad', isBad);
  line.hidden = !text;
}

function vanish() {
  timer = setTimeout(() => { line.hidden = true; }, 6000);
}

/** Tells of a job, and again whenever it has changed: never that it runs when it has ended. */
export function follow(id) {
  followed = id;
  goOn();
}

function goOn() {
  const job = followed === null ? null : store.jobs.get(followed);
  if (!job) return;
  const isBad = text.isBad(job);
  put(text.job(job), isBad);
  if (!text.hasEnded(job)) return;
  // It stays as it is; what went wrong stays in sight.
  followed = null;
  if (!isBad) vanish();
}

store.watch(goOn);

/** Does something that may be refused, and says how it went: the text that `what` gives, or the job. */
export async function act(what) {
  try {
    const came = await what();
    if (came && typeof came === 'object' && 'progressOf' in came) follow(came.progressOf);
    else tell(typeof came === 'string' ? came : '');
  } catch (error) {
    if (error instanceof Refused && error.status === 401) onStranger();
    tell(error instanceof Refused ? error.message : `The gateway cannot be reached: ${error.message}`, true);
  }
}

line.addEventListener('click', () => tell(''));
