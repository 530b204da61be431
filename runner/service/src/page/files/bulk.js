// Something for many links at once: what will happen is shown before it does.

import * as api from './api.js';
import { asker, gravity, inShort, worst } from './check.js';
import { field, h, keyed, options, say, show } from './dom.js';
import * as store from './store.js';
import * as text from './text.js';

/** So many requests are under way at once. */
const AT_ONCE = 6;
/** So many links are named of those to which the same happens. */
const NAMED = 6;

const named = (names) => (names.length > NAMED ? `${names.slice(0, NAMED).join(', ')} and ${text.count(names.length - NAMED)} more` : names.join(', '));
const links = (count) => (count === 1 ? '1 link' : `${text.count(count)} links`);

/** What becomes of a program that is sent to a link: a sentence, and whether it is sent. */
export function sendFate(link) {
  if (link.state === 'quarantined') return ['waits until the link is released from quarantine', true];
  if (link.state === 'down' || link.state === 'opening') return ['waits until the port is there', true];
  if (link.job || link.queued || link.receiving) return ['waits for its turn: something is under way there', true];
  return ['begins at once', true];
}

/** What becomes of a swap: a sentence, and whether it is ordered. */
export function swapFate(link, to, when) {
  if (link.plugin?.digest === to.digest) return ['left out: it runs this plug-in already', false];
  const isSame = link.plugin?.name === to.name;
  const settings = isSame ? '' : `; it ran ${link.plugin?.name}, so all settings are the defaults then`;
  if (link.state === 'quarantined') return [`is released from quarantine with it${settings}`, true];
  if (!link.job && !link.receiving) return [`at once${settings}`, true];
  if (when === 'now') return isSame ? ['in the middle of its job if the states fit, else not at all', true] : ['left out: something is under way there', false];
  if (when === 'idle' || !isSame) return [`when it is idle: something is under way there${settings}`, true];
  return ['in the middle of its job if the states fit, else when it is idle', true];
}

/** When to swap. */
export function whenSelect() {
  return h('select', { name: 'when' },
    h('option', { value: 'now-or-idle' }, 'at once if the state fits, else when idle'),
    h('option', { value: 'now' }, 'at once or not at all'),
    h('option', { value: 'idle' }, 'when idle'));
}

/** Links by what becomes of them, the gravest first: [[sentence, whether anything is done, names]]. */
function byFate(all, fate) {
  const groups = new Map();
  for (const link of all) {
    const [sentence, isDone, grave = 0] = fate(link);
    const group = groups.get(sentence) ?? [sentence, isDone, [], grave];
    group[2].push(link.name);
    groups.set(sentence, group);
  }
  return [...groups.values()].sort((one, other) => other[3] - one[3]);
}

/** The panel that comes up when links are chosen. */
export function bulk(chosen, onChange) {
  const count = h('strong');
  const clear = h('button', { type: 'button', class: 'quiet', onclick: () => { chosen.clear(); begin(); onChange(); } }, 'Choose none');
  const program = h('select', { name: 'bulk-program', onchange: () => begin(program) });
  const plugin = h('select', { name: 'bulk-plugin', onchange: () => begin(plugin) });
  const when = whenSelect();
  when.addEventListener('change', () => update());
  const swapping = [field('Swap to the plug-in', plugin), field('When', when)];
  const fates = h('tbody');
  const summary = h('table', { class: 'fate' }, h('caption', {}, 'What will happen'),
    h('thead', {}, h('tr', {}, ['Links', 'What', 'Which'].map((name) => h('th', { scope: 'col' }, name)))), fates);
  const go = h('button', { class: 'main' });
  const status = h('p', { role: 'status' });
  const arrives = h('p', { role: 'status', class: 'worst' });
  const checks = asker(() => update(), () => store.has.cells);
  const failed = h('ul', { class: 'wrong' });
  const node = h('form', {
    class: 'panel chosen', 'aria-label': 'Chosen links',
    onsubmit: (event) => {
      event.preventDefault();
      if (!isUnderWay && what()) order();
    },
  }, h('div', { class: 'tools' }, count, clear), h('div', { class: 'fields' }, field('Send the program', program), swapping), arrives, summary, go, status, failed);
  let isUnderWay = false;
  let answerOf = () => undefined;

  /** One thing at a time: what is chosen last. */
  function begin(select) {
    for (const other of [program, plugin]) if (other !== select) other.value = '';
    say(status, '');
    keyed(failed, [], ([name]) => name);
    update();
  }

  function what() {
    if (program.value) {
      return {
        verb: (number) => `Send ${program.value} to ${links(number)}`,
        fate: (link) => {
          const [sentence, isDone] = sendFate(link);
          const answer = answerOf(link);
          return [`${sentence}; ${inShort(answer)}`, isDone, gravity(answer)];
        },
        order: (name) => store.took(api.post(`/links/${api.part(name)}/jobs`, { program: program.value })),
      };
    }
    const to = store.plugins.find((of) => text.pluginKey(of) === plugin.value);
    if (!to) return null;
    return {
      verb: (number) => `Swap ${links(number)} to ${text.plugin(to)}`,
      fate: (link) => swapFate(link, to, when.value),
      order: async (name) => {
        const view = await api.post(`/links/${api.part(name)}/swap`, { plugin: text.pluginKey(to), when: when.value });
        if (view.state === 'refused') throw new Error(view.message ?? 'refused');
      },
    };
  }

  const groups = () => {
    const wanted = what();
    return wanted ? byFate(store.sorted().filter((link) => chosen.has(link.name)), wanted.fate) : [];
  };

  async function order() {
    const wanted = what();
    const names = groups().filter(([, isDone]) => isDone).flatMap(([, , all]) => all);
    isUnderWay = true;
    update();
    await inTurn(names, wanted.order, (done, refused) => {
      say(status, `${text.count(done)} of ${links(names.length)} ordered${refused.length ? `, ${text.count(refused.length)} refused` : ''}`);
      keyed(failed, refused, ([name]) => name, ([name, why]) => ({ node: h('li', {}, `${name}: ${why}`), update() {} }));
    });
    isUnderWay = false;
    [program.value, plugin.value] = ['', ''];
    update();
  }

  function update() {
    show(node, chosen.size && store.mayAct());
    if (!chosen.size) {
      checks.end();
      return;
    }
    say(count, chosen.size === 1 ? '1 link is chosen' : `${text.count(chosen.size)} links are chosen`);
    options(program, [['', 'which?'], ...store.programs.map(({ name, bytes }) => [name, `${name} (${text.bytes(bytes)})`])]);
    options(plugin, [['', 'which?'], ...store.plugins.map((of) => [text.pluginKey(of), `${text.plugin(of)} (${of.digest.slice(0, 8)})`])]);
    for (const one of swapping) show(one, store.isAdmin());
    const picked = store.sorted().filter((link) => chosen.has(link.name));
    answerOf = checks.want(isUnderWay ? [] : picked, program.value);
    const tried = isUnderWay || !program.value ? [] : picked.map((link) => [link.name, answerOf(link)]);
    say(arrives, tried.length ? worst(tried) : '');
    show(arrives, tried.length);
    arrives.classList.toggle('wrong', tried.some(([, answer]) => gravity(answer) === 2));
    const all = isUnderWay ? [] : groups();
    keyed(fates, all, ([sentence]) => sentence, ([sentence]) => {
      const number = h('td');
      const which = h('td');
      return {
        node: h('tr', {}, number, h('td', {}, sentence), which),
        update([, , names]) { say(number, text.count(names.length)); say(which, named(names)); },
      };
    });
    const number = all.filter(([, isDone]) => isDone).reduce((sum, [, , names]) => sum + names.length, 0);
    show(summary, all.length);
    show(go, all.length);
    say(go, what()?.verb(number) ?? '');
    go.disabled = !number;
  }
  return { node, update, end: checks.end };
}

/** Does something for each name, some at once; tells how far it is. */
async function inTurn(names, order, tell) {
  const waiting = [...names];
  const refused = [];
  let done = 0;
  tell(0, refused);
  const one = async () => {
    for (let name = waiting.shift(); name !== undefined; name = waiting.shift()) {
      try {
        await order(name);
        done += 1;
      } catch (error) {
        if (error instanceof api.Refused && error.status === 429) {
          // The gateway has enough of us: a moment later.
          waiting.push(name);
          await new Promise((go) => setTimeout(go, 1000));
        } else refused.push([name, error.message]);
      }
      tell(done, refused);
    }
  };
  await Promise.all(Array.from({ length: AT_ONCE }, one));
}
