// All links on one screen in the shop: read from afar, nothing to press.

import * as address from './address.js';
import { h, keyed, say } from './dom.js';
import { chosenBy } from './links.js';
import * as state from './state.js';
import * as store from './store.js';
import * as text from './text.js';

/** Width to height of a tile. */
const SHAPE = 1.7;
/** Under this height, in pixels, a tile has no program. */
const TALL = 92;

function tile(link) {
  const mark = h('span', { class: 'sign', 'aria-hidden': 'true' });
  const words = h('span', { class: 'word' });
  const program = h('span', { class: 'program' });
  const bar = h('span', { class: 'done', 'aria-hidden': 'true' });
  const node = h('li', {}, h('a', { href: address.toLink(link.name) }, link.name), h('span', { class: 'line' }, mark, words), program, bar);
  let width = -1;
  return {
    node,
    update(now) {
      const mood = state.inTrouble(now) ? 'bad' : state.mood(now);
      if (node.className !== mood) node.className = mood;
      say(mark, state.sign(now));
      const { job } = now;
      const has = job?.percent !== null && job?.percent !== undefined;
      const rest = state.remaining(job);
      say(words, state.situation(now) === 'sending' && has ? `${job.percent} %${rest ? ` · ${rest}` : ''}` : state.word(now));
      say(program, state.program(now) || (now.trouble[0] ?? ''));
      if (width !== (has ? job.percent : 0)) {
        width = has ? job.percent : 0;
        bar.style.setProperty('--done', `${width}%`);
      }
    },
  };
}

/** The page. */
export function page(_, query) {
  const fits = chosenBy(query);
  const tiles = h('ul', { class: 'tiles' });
  const counts = h('p', { class: 'counts', role: 'status' });
  const clock = h('time');
  const leave = h('a', { href: address.to('links', Object.fromEntries(query)) }, 'Leave the wall');
  const node = h('section', { class: 'wall' },
    h('div', { class: 'title' }, h('h1', {}, query.get('group') || 'All links'), counts, clock, leave), tiles);
  const onKey = (event) => { if (event.key === 'Escape') location.hash = leave.hash; };
  document.body.classList.add('on-wall');
  document.addEventListener('keydown', onKey);
  window.addEventListener('resize', fit);
  let count = 0;
  let longest = 8;

  /** As many columns as make all tiles fit. */
  function fit() {
    const { width } = tiles.getBoundingClientRect();
    const height = innerHeight - tiles.getBoundingClientRect().top - 12;
    if (!count || height < 100) return;
    let columns = Math.max(1, Math.ceil(Math.sqrt((count * width) / (height * SHAPE))));
    columns = Math.min(columns, Math.max(1, Math.floor(width / 84)));
    const rows = Math.ceil(count / columns);
    const size = Math.max(44, Math.floor(height / rows) - 6);
    tiles.style.setProperty('--columns', columns);
    tiles.style.setProperty('--height', `${size}px`);
    const letters = Math.min(width / columns / (0.68 * longest + 1.2), size / 3.1);
    tiles.style.setProperty('--letters', `${Math.max(11, Math.min(40, Math.floor(letters)))}px`);
    tiles.classList.toggle('small', size < TALL);
  }

  function update() {
    const shown = store.sorted().filter(fits);
    keyed(tiles, shown, (link) => link.name, tile);
    const trouble = shown.filter(state.inTrouble).length;
    const working = shown.filter(state.isWorking).length;
    say(counts, [`${text.count(shown.length)} links`, `${text.count(working)} working`, trouble ? `${text.count(trouble)} in trouble` : ''].filter(Boolean).join(' · '));
    counts.classList.toggle('bad', trouble > 0);
    say(clock, new Date().toLocaleTimeString('en-GB', { hour: '2-digit', minute: '2-digit' }));
    if (count !== shown.length) {
      count = shown.length;
      longest = Math.max(8, ...shown.map((link) => link.name.length));
      requestAnimationFrame(fit);
    }
  }
  update();
  return {
    node,
    update,
    end() {
      document.body.classList.remove('on-wall');
      document.removeEventListener('keydown', onKey);
      window.removeEventListener('resize', fit);
    },
  };
}
