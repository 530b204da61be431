// The page's frame: who is there, which part is shown.

import * as address from './address.js';
import * as api from './api.js';
import { field, h, say, show } from './dom.js';
import { tell, whenStranger } from './message.js';
import * as store from './store.js';
import * as buses from './buses.js';
import * as cells from './cells.js';
import * as compare from './compare.js';
import * as journal from './journal.js';
import * as jobs from './jobs.js';
import * as link from './link.js';
import * as links from './links.js';
import * as plugins from './plugins.js';
import * as program from './program.js';
import * as programs from './programs.js';
import * as wall from './wall.js';

/** Pages of one thing, and the list that they belong to. */
const LISTS = { link: 'links', wall: 'links', program: 'programs', compare: 'links' };

const main = document.getElementById('main');
const nav = document.getElementById('nav');
const connection = document.getElementById('connection');
const leave = document.getElementById('leave');

const pages = {
  links: links.page, buses: buses.page, cells: cells.page, jobs: jobs.page, programs: programs.page, plugins: plugins.page, journal: journal.page,
  link: link.page, wall: wall.page, program: (name) => (name ? program.page(name) : programs.page()), compare: (name) => (name ? compare.page(name) : links.page()),
};

let shown = null;
let unfollow = null;

function route() {
  if (!unfollow) return;
  const { name, argument, query } = address.read();
  const make = pages[name] ?? pages.links;
  shown?.end?.();
  shown = make(argument, query);
  main.replaceChildren(shown.node);
  for (const one of nav.children) {
    const isThis = one.hash === `#/${LISTS[name] ?? name}`;
    if (isThis) one.setAttribute('aria-current', 'page');
    else one.removeAttribute('aria-current');
  }
  document.title = `${shown.node.querySelector('h1')?.textContent ?? 'Softplug'} – Softplug`;
  window.scrollTo(0, 0);
}

async function enter() {
  await store.load();
  show(nav, true);
  show(leave, true);
  unfollow = store.follow((isConnected, error) => {
    say(connection, isConnected ? `live, ${store.role}` : 'not connected');
    connection.classList.toggle('off', !isConnected);
    if (error instanceof api.Refused && error.status === 401) signOut('The gateway no longer knows this token.');
  });
  route();
  performance.mark('links');
  // The frame after the next one has shown them.
  requestAnimationFrame(() => requestAnimationFrame(() => performance.mark('links-in-sight')));
}

function signOut(why) {
  unfollow?.();
  unfollow = null;
  shown?.end?.();
  shown = null;
  api.forgetToken();
  show(nav, false);
  show(leave, false);
  say(connection, '');
  askForToken(why);
}

function askForToken(why) {
  const token = h('input', { type: 'password', name: 'token', required: true, autocomplete: 'current-password', spellcheck: false });
  const keep = h('input', { type: 'checkbox', name: 'keep' });
  const wrong = h('p', { class: 'wrong', role: 'alert' }, why ?? '');
  const form = h('form', {
    class: 'panel token',
    onsubmit: async (event) => {
      event.preventDefault();
      api.keepToken(token.value, keep.checked);
      try {
        await enter();
      } catch (error) {
        api.forgetToken();
        say(wrong, error.message);
        show(wrong, true);
        token.select();
      }
    },
  }, h('h1', {}, 'Sign in'), wrong, h('input', { type: 'text', name: 'username', autocomplete: 'username', hidden: true }), field('Token', token, 'An admin of the gateway has it from: softplug gateway token'),
  h('label', { class: 'check' }, keep, ' keep it on this device'), h('button', { class: 'main' }, 'Sign in'));
  show(wrong, why);
  main.replaceChildren(form);
  token.focus();
}

window.addEventListener('hashchange', () => { route(); main.focus({ preventScroll: true }); });
leave.addEventListener('click', () => signOut());
whenStranger(() => unfollow && signOut('The gateway no longer knows this token.'));
store.watch((news) => {
  for (const one of nav.children) {
    const name = one.hash.slice(2);
    if (name in store.has) show(one, store.has[name] || one.hasAttribute('aria-current'));
  }
  shown?.update(news);
});

if (api.hasToken()) {
  enter().catch((error) => {
    if (error instanceof api.Refused && error.status === 401) return signOut(error.message);
    tell(`The gateway cannot be reached: ${error.message}`, true);
    return setTimeout(() => location.reload(), 5000);
  });
} else askForToken();
