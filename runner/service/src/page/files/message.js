// One line that says how an action went.

import { say } from './dom.js';
import { Refused } from './api.js';

const line = document.getElementById('message');
let timer = null;
let onStranger = () => {};

/** Called when the gateway no longer knows our token. */
export function whenStranger(then) {
  onStranger = then;
}

export function tell(text, isBad = false) {
  clearTimeout(timer);
  say(line, text);
  line.classList.toggle('bad', isBad);
  line.hidden = !text;
  if (!isBad) timer = setTimeout(() => { line.hidden = true; }, 6000);
}

/** Does something that may be refused, and says how it went. */
export async function act(what) {
  try {
    const text = await what();
    tell(typeof text === 'string' ? text : '');
  } catch (error) {
    if (error instanceof Refused && error.status === 401) onStranger();
    tell(error instanceof Refused ? error.message : `The gateway cannot be reached: ${error.message}`, true);
  }
}

line.addEventListener('click', () => tell(''));
