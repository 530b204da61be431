// What a program cannot say on a link's line, as the link's own plug-in tells it before anything is sent.

import * as api from './api.js';
import { h, say, show } from './dom.js';
import * as store from './store.js';
import * as text from './text.js';

/** So many checks are asked for at once. */
const AT_ONCE = 2;
/** So many answers are kept that nobody wants at present. */
const MOST_ANSWERS = 200;
/** So many characters are named in a sentence. */
const NAMED = 4;

/** What is known already: `{ view }` or `{ error }`, by what the answer depends on. */
const answers = new Map();

/** What the answer depends on; with `own` also on the link itself, its machine and its cell. */
function keyOf(link, program, own) {
  const known = store.programs.find(({ name }) => name === program);
  return JSON.stringify([program, known?.changed_ms, known?.bytes, link.plugin?.digest, link.settings, link.port.line, own ? link.name : null]);
}

/** What is wanted stays, or it would be asked for again and again. */
function keep(key, answer, wanted) {
  answers.set(key, answer);
  for (const old of answers.keys()) {
    if (answers.size <= MOST_ANSWERS) return;
    if (!wanted.has(old)) answers.delete(old);
  }
}

/** Asks for checks; `told` is called when there is an answer. Links that are alike are asked for once, unless `own` says otherwise. */
export function asker(told, own = () => true) {
  const wanted = new Map();
  const underWay = new Map();

  function goOn() {
    for (const [key, [link, program]] of wanted) {
      if (underWay.size >= AT_ONCE) return;
      if (underWay.has(key) || answers.has(key)) continue;
      const end = new AbortController();
      underWay.set(key, end);
      ask(key, link, program, end.signal).finally(() => {
        if (underWay.get(key) !== end) return;
        underWay.delete(key);
        told();
        goOn();
      });
    }
  }

  function stop(key) {
    underWay.get(key).abort();
    underWay.delete(key);
  }

  async function ask(key, link, program, signal) {
    const path = `/links/${api.part(link)}/check?program=${api.part(program)}`;
    try {
      keep(key, { view: await api.get(path, signal) }, wanted);
    } catch (error) {
      if (signal.aborted) return;
      // The gateway has enough of us, or is not there: a moment later.
      if (!(error instanceof api.Refused) || [429, 503].includes(error.status)) await new Promise((go) => setTimeout(go, 1000));
      else keep(key, { error: error.message }, wanted);
    }
  }

  return {
    /** What is known of `program` on these links: a function from a link to its answer, or undefined yet. Nothing else is asked for any more. */
    want(links, program) {
      wanted.clear();
      if (program) for (const link of links) if (link.plugin) wanted.set(keyOf(link, program, own(link)), [link.name, program]);
      for (const key of underWay.keys()) if (!wanted.has(key)) stop(key);
      goOn();
      return (link) => answers.get(keyOf(link, program, own(link)));
    },
    end() {
      wanted.clear();
      for (const key of underWay.keys()) stop(key);
    },
  };
}

const GRAVITY = ['passes', 'altered', 'refused'];

/** The graver the higher; nothing is known yet of what is below 0. */
export function gravity(answer) {
  if (!answer) return -1;
  return answer.view ? GRAVITY.indexOf(answer.view.result) : 0.5;
}

const characters = (count) => (count === 1 ? '1 character' : `${text.count(count)} characters`);

/** The worst of several answers, in a sentence: before something is sent to many. */
export function worst(of) {
  const unknown = of.filter(([, answer]) => !answer).length;
  if (unknown) return `Trying it through the plug-ins, ${text.count(of.length - unknown)} of ${text.count(of.length)} links known; nothing is sent…`;
  const all = of.length === 1 ? 'the link' : `all ${text.count(of.length)} links`;
  const grave = Math.max(...of.map(([, answer]) => gravity(answer)));
  if (grave === 0) return `It passes as it is written to ${all}.`;
  const names = of.filter(([, answer]) => gravity(answer) === grave).map(([name]) => name);
  const where = names.length === of.length ? all : `${text.count(names.length)} of ${text.count(of.length)} links`;
  const what = { 2: 'it is refused by', 1: 'it does not arrive as it is written at', 0.5: 'how it arrives is not known of' }[grave];
  return `At worst ${what} ${where}: ${names.length > NAMED ? `${names.slice(0, NAMED).join(', ')} and more` : names.join(', ')}.`;
}

/** An answer in a sentence that follows others. */
export function inShort(answer) {
  if (!answer) return 'how it arrives is not known yet';
  if (answer.error) return `how it arrives is not known: ${answer.error}`;
  const { result, message, characters: altered } = answer.view;
  if (result === 'refused') return `refused: ${message}`;
  if (result === 'passes') return 'passes as it is written';
  const some = altered.slice(0, NAMED).map(({ character, what }) => `${character} ${what}`).join(', ');
  const more = altered.length > NAMED ? ` and ${text.count(altered.length - NAMED)} more` : '';
  return `${characters(altered.length)} not as written: ${some}${more}`;
}

/** The answer for one link: a sentence, and a table of what does not pass. `goTo` shows a line, where there is a text to show it in. */
export function checked(goTo) {
  const said = h('p', { role: 'status', class: 'checked' });
  const remark = h('p', { class: 'facts' });
  const body = h('tbody');
  const table = h('table', { class: 'measured' }, h('thead', {}, h('tr', {}, ['Character', 'How often', 'First at', 'What happens', 'Write instead'].map((title) => h('th', { scope: 'col' }, title)))), body);
  const frame = h('div', { class: 'scroll', tabIndex: 0, role: 'region', 'aria-label': 'Table of characters that do not arrive as written' }, table);
  const node = h('div', {}, said, frame, remark);
  let shown = null;

  const place = ({ line, column }) => {
    const words = `line ${text.count(line)}, column ${text.count(column)}`;
    return goTo ? h('button', { type: 'button', class: 'link', onclick: () => goTo(line - 1) }, words) : words;
  };
  const cells = (of) => [of.character, text.count(of.count), place(of), of.what, of.instead ?? '–'];

  return {
    node,
    /** `answer` is undefined until there is one. */
    update(link, program, answer) {
      const view = answer?.view;
      say(said, sentence(link, program, answer));
      said.classList.toggle('wrong', view?.result === 'refused' || Boolean(answer?.error));
      say(remark, view?.remark ? `${view.remark}.` : '');
      show(remark, view?.remark);
      show(frame, view?.characters.length);
      if (view === shown) return;
      shown = view;
      body.replaceChildren(...(view?.characters ?? []).map((of) => h('tr', {}, cells(of).map((cell) => h('td', {}, cell)))));
    },
  };
}

/** In plain words. */
function sentence(link, program, answer) {
  if (!answer) return `Trying ${program} through the plug-in of ${link.name}; nothing is sent…`;
  if (answer.error) return `How ${program} arrives on ${link.name} is not known: ${answer.error}`;
  const { result, plugin, line, different, characters: altered, message } = answer.view;
  const way = `with ${plugin} on ${line}`;
  if (result === 'refused') return `${link.name} refuses it ${way}: ${message}.`;
  if (result === 'passes') return `${program} passes as it is written to ${link.name}, ${way}.`;
  const verb = altered.length === 1 ? 'does' : 'do';
  return `${program} can be sent to ${link.name}, but ${text.count(altered.length)} of its ${text.count(different)} different characters ${verb} not arrive as written, ${way}.`;
}
