// A program to look at: its text, the way of the tool, where the cut is.

import * as api from './api.js';
import { asker, checked } from './check.js';
import { act } from './message.js';
import { field, h, keyed, options, say, show } from './dom.js';
import { lineOf, lineText } from './lines.js';
import { listing } from './listing.js';
import { badge } from './state.js';
import { toolpath } from './toolpath.js';
import * as store from './store.js';
import * as text from './text.js';

/** A larger program is not shown. */
const MOST_BYTES = 64 * 1024 * 1024;
const RAPID_KEY = 'softplug-rapid';
const FORM_KEY = 'softplug-reading';

export function page(name) {
  const path = `/programs/${api.part(name)}`;
  const end = new AbortController();
  const worker = new Worker('/page/reading.js', { type: 'module' });
  const wrong = h('p', { class: 'wrong', role: 'alert' });
  const status = h('p', { class: 'facts', role: 'status' });
  const facts = h('dl', { class: 'pairs' });
  const runs = running(name, () => update());
  const list = listing(`Text of ${name}`, (line) => picture.choose(line));
  const picture = toolpath((line) => {
    list.choose(line);
    picture.choose(line);
  });
  const goTo = (line) => {
    list.choose(line);
    picture.choose(line);
    list.node.focus({ preventScroll: true });
    list.node.scrollIntoView({ block: 'nearest' });
  };
  const heard = remarks(goTo);
  const odd = oddSigns(goTo);
  const arrives = arrival(name, goTo, () => update());
  const how = reading(() => worker.postMessage({ options: how.options }), describe);
  const find = finder(() => bytes, () => starts, list, (line) => picture.choose(line));
  let bytes = null;
  let starts = null;
  let read = null;
  let version = null;

  worker.onmessage = ({ data }) => {
    if (data.part !== undefined) say(status, `Reading: ${Math.round(100 * data.part)} %`);
    if (data.starts) {
      starts = data.starts;
      list.set(bytes, starts);
      odd.set(data.signs);
      update();
    }
    if (data.path) {
      read = data.path;
      say(status, '');
      picture.set(read, how.options.isLathe ? 'ZX' : flattest(read.size));
      heard.set(read);
      describe();
      update();
    }
  };
  worker.onerror = () => say(status, 'The program could not be read for its tool path.');

  async function load() {
    const known = store.programs.find((of) => of.name === name);
    if (known?.bytes > MOST_BYTES) throw new Error(`${name} has ${text.bytes(known.bytes)}: more than ${text.bytes(MOST_BYTES)} are not shown here. Save it to look at it.`);
    version = known?.changed_ms;
    say(status, 'Loading…');
    bytes = new Uint8Array(await api.bytes(path, end.signal));
    const copy = bytes.slice().buffer;
    worker.postMessage({ bytes: copy, options: how.options }, [copy]);
  }

  const again = () => load().catch((error) => {
    if (end.signal.aborted) return;
    say(status, '');
    say(wrong, error.message);
    show(wrong, true);
  });

  function describe() {
    const known = store.programs.find((of) => of.name === name);
    const values = read ? measures(read, how.rapid) : [];
    values.push(['File', bytes && `${text.bytes(bytes.length)}, ${starts ? `${text.count(starts.length)} ${starts.length === 1 ? 'line' : 'lines'}` : ''}`], ['Changed', known && text.time(known.changed_ms)]);
    keyed(facts, values.filter(([, value]) => value), ([title]) => title, ([title]) => {
      const value = h('dd');
      return { node: h('div', {}, h('dt', {}, title), value), update: ([, now]) => say(value, now) };
    });
    if (read) picture.describe(`Tool path of ${name}: ${read.size ? dimensions(read.size) : 'nothing is cut'}`);
  }

  function update() {
    const known = store.programs.find((of) => of.name === name);
    if (version && known && known.changed_ms !== version) {
      version = known.changed_ms;
      again();
    }
    const place = starts && runs.update((byte) => lineOf(starts, byte), (line) => lineText(bytes, starts, line), version);
    list.mark(place ?? null);
    picture.mark(place ? place.surely : -1);
    if (place && runs.isFollowed) list.reveal(place.surely);
    sendTo.update();
    const link = store.links.get(sendTo.link);
    odd.update(link);
    arrives.update(link);
  }

  const sendTo = sender(name, () => update());
  show(wrong, false);
  const node = h('section', { class: 'program' },
    h('p', { class: 'back' }, h('a', { href: '#/programs' }, '← All programs')), h('h1', {}, name), wrong,
    h('div', { class: 'panel' }, facts, status, h('div', { class: 'buttons' }, sendTo.node,
      h('button', { class: 'quiet', onclick: () => act(() => api.save(path, name.split('/').at(-1))) }, 'Save'))),
    arrives.node, runs.node,
    h('div', { class: 'columns' },
      h('div', { class: 'panel' }, h('h2', {}, 'Text'), find.node, list.node),
      h('div', { class: 'panel' }, h('h2', {}, 'Tool path'), picture.node, how.node)),
    odd.node, heard.node);
  again();
  return {
    node,
    update() {
      describe();
      update();
    },
    end() {
      end.abort();
      worker.terminate();
      arrives.end();
      list.end();
      picture.end();
    },
  };
}

/** Which links send it, and where they are; one of them is followed. */
function running(name, changed) {
  const list = h('ul', { class: 'runs' });
  const follow = h('input', { type: 'checkbox', checked: true, onchange: changed });
  const node = h('div', { class: 'panel' }, h('h2', {}, 'On its way'), list, h('label', { class: 'check' }, follow, ' the text follows'));
  let followed = null;

  function item({ name: link }) {
    const state = badge();
    const choice = h('input', { type: 'radio', name: 'followed', 'aria-label': `Show where ${link} is`, onchange: () => { followed = link; changed(); } });
    const what = h('span', { class: 'what' });
    const block = h('code');
    return {
      node: h('li', {}, choice, h('a', { href: `#/link/${encodeURIComponent(link)}` }, link), state.node, what, block),
      update(of) {
        state.update(of.link);
        choice.checked = of.name === followed;
        say(what, of.words);
        say(block, of.text);
      },
    };
  }

  return {
    node,
    get isFollowed() {
      return follow.checked;
    },
    /** Gives the lines between which the one that is followed is; nothing if none sends it. */
    update(lineAt, textOf, version) {
      const links = store.sorted().filter(({ job }) => job?.program === name && ['running', 'paused'].includes(job.state));
      show(node, links.length);
      if (!links.some((link) => link.name === followed)) followed = links[0]?.name ?? null;
      let place = null;
      keyed(list, links.map((link) => {
        const of = { surely: Math.max(0, lineAt(link.job.surely_left)), maybe: Math.max(0, lineAt(Math.max(0, link.job.maybe_left - 1))) };
        if (link.name === followed) place = of;
        const ordered = store.jobs.get(link.job.id)?.created_ms;
        const isOther = ordered && version && version > ordered;
        return {
          name: link.name, link, text: textOf(of.surely),
          words: `line ${text.count(of.surely + 1)}, ${link.job.percent ?? 0} %${isOther ? '; the program was changed since: the machine gets it as it was' : ''}`,
        };
      }), (of) => of.name, item);
      return place;
    },
  };
}

/** `changed` is told when another link is chosen. */
function sender(name, changed) {
  const link = h('select', { 'aria-label': 'Link to send to', onchange: changed });
  const send = h('button', { class: 'main', onclick: () => act(async () => {
    const job = await store.took(api.post(`/links/${api.part(link.value)}/jobs`, { program: name }));
    return { progressOf: job.id };
  }) });
  function update() {
    options(link, store.sorted().map((of) => [of.name, of.name]), 'which machine?');
    say(send, link.value ? `Send to ${link.value}` : 'Send');
    send.disabled = !link.value;
  }
  const label = h('span', {}, 'Send to ');
  const node = h('div', { class: 'buttons' }, h('label', { class: 'inline' }, label, link), send);
  // Who may only look may look at what would arrive.
  show(send, store.mayAct());
  if (!store.mayAct()) {
    say(label, 'As it would be sent to ');
    link.ariaLabel = 'Link that it would be sent to';
  }
  return { node, update, get link() { return link.value; } };
}

/** How numbers are read; and how fast rapids are, which no program says. */
function reading(changed, rapidChanged) {
  const kept = new URLSearchParams(localStorage.getItem(FORM_KEY) ?? '');
  const machine = h('select', { onchange: keep }, h('option', { value: 'mill' }, 'Mill'), h('option', { value: 'lathe' }, 'Lathe: X is a diameter, U and W are steps, feed for a turn'));
  const whole = h('select', { onchange: keep }, h('option', { value: 'whole' }, '10 is 10 mm (10 inch)'), h('option', { value: 'thousandths' }, '10 is 0.01 mm (0.001 inch)'));
  const rapid = h('input', { type: 'number', min: '0.1', max: '200', step: '0.1', value: localStorage.getItem(RAPID_KEY) ?? '10', oninput: () => {
    localStorage.setItem(RAPID_KEY, rapid.value);
    rapidChanged();
  } });
  machine.value = kept.get('machine') === 'lathe' ? 'lathe' : 'mill';
  whole.value = kept.get('whole') === 'thousandths' ? 'thousandths' : 'whole';
  function keep() {
    localStorage.setItem(FORM_KEY, new URLSearchParams({ machine: machine.value, whole: whole.value }));
    changed();
  }
  return {
    node: h('div', { class: 'fields' }, field('Read as of a', machine), field('Without a point', whole), field('Rapids, m/min', rapid)),
    get options() {
      return { isLathe: machine.value === 'lathe', isThousandths: whole.value === 'thousandths' };
    },
    /** Millimetres a second. */
    get rapid() {
      const value = Number(rapid.value);
      return value > 0 ? (value * 1000) / 60 : null;
    },
  };
}

/** Finds a line by number, or a text. */
function finder(bytesOf, startsOf, list, found) {
  const what = h('input', { type: 'search', 'aria-label': 'Find in the text, or go to a line', placeholder: 'Text, or a line’s number' });
  const said = h('span', { class: 'facts', role: 'status' });
  let searched = null;
  const go = (line) => {
    list.choose(line);
    found(line);
    say(said, `line ${text.count(line + 1)}`);
  };
  const form = h('form', { class: 'tools', onsubmit: (event) => {
    event.preventDefault();
    const [bytes, starts, wanted] = [bytesOf(), startsOf(), what.value.trim()];
    if (!starts?.length || !wanted) return;
    if (/^\d+$/.test(wanted)) {
      go(Math.min(starts.length, Math.max(1, Number(wanted))) - 1);
      return;
    }
    if (searched?.bytes !== bytes) searched = { bytes, text: new TextDecoder('latin1').decode(bytes).toUpperCase() };
    const needle = String.fromCharCode(...new TextEncoder().encode(wanted.toUpperCase()));
    const from = list.chosen < 0 ? 0 : starts[list.chosen + 1] ?? bytes.length;
    const next = searched.text.indexOf(needle, from);
    const place = next < 0 ? searched.text.indexOf(needle) : next;
    if (place < 0) say(said, 'not found');
    else go(lineOf(starts, place));
  } }, what, h('button', {}, 'Find'), said);
  return { node: form };
}

/** What arrives of it on the link that is chosen. */
function arrival(name, goTo, told) {
  const checks = asker(told);
  const how = checked(goTo);
  const title = h('h2');
  const node = h('div', { class: 'panel' }, title, how.node);
  show(node, false);
  return {
    node,
    update(link) {
      show(node, link?.plugin);
      const answerOf = checks.want(link ? [link] : [], name);
      if (!link) return;
      say(title, `What arrives at ${link.name}`);
      how.update(link, name, answerOf(link));
    },
    end: checks.end,
  };
}

/** What not every line can say; what the line of a link makes of it, its plug-in tells once the link is chosen. */
function oddSigns(goTo) {
  const body = h('tbody');
  const hint = h('p', { class: 'facts' }, 'What becomes of them on a link, its plug-in tells before anything is sent: choose the link above.');
  const table = h('table', { class: 'measured' }, h('thead', {}, h('tr', {}, ['Sign', 'How often', 'First in', 'Write instead'].map((title) => h('th', { scope: 'col' }, title)))), body);
  const node = h('div', { class: 'panel' }, h('h2', {}, 'Signs that not every control takes'), h('div', { class: 'scroll', tabIndex: 0, role: 'region', 'aria-label': 'Table of signs' }, table), hint);
  let count = 0;
  show(node, false);
  return {
    node,
    set(signs) {
      body.replaceChildren(...signs.map(({ sign, count, line, instead }) => h('tr', {}, h('td', {}, sign), h('td', {}, text.count(count)),
        h('td', {}, h('button', { class: 'link', onclick: () => goTo(line) }, `line ${text.count(line + 1)}`)), h('td', {}, instead ?? '–'))));
      count = signs.length;
    },
    /** Of a link that is chosen more is known. */
    update(link) {
      show(node, count && !link?.plugin);
    },
  };
}

/** What was not understood, and what was taken for granted. */
function remarks(goTo) {
  const none = h('p', {}, 'Everything in this program was understood.');
  const list = h('ul', { class: 'remarks' });
  const taken = h('ul', { class: 'remarks' });
  const takenTitle = h('h3', {}, 'Taken for granted');
  const node = h('div', { class: 'panel' }, h('h2', {}, 'What the picture leaves out'), none, list, takenTitle, taken);
  show(node, false);
  const items = (of) => of.map(({ what, count, line }) => h('li', {}, `${what}: ${text.count(count)} ${count === 1 ? 'time' : 'times'}, first in `,
    h('button', { class: 'link', onclick: () => goTo(line) }, `line ${text.count(line + 1)}`)));
  return {
    node,
    set(read) {
      const extra = [];
      if (read.jumps) extra.push(`${text.count(read.jumps)} ${read.jumps === 1 ? 'move is' : 'moves are'} not drawn and not counted: the beginning or the way is not known`);
      if (read.notDrawn) extra.push(`${text.count(read.notDrawn)} points at the end are not drawn; lengths and time have them`);
      if (read.length.unfed) extra.push(`${distance(read.length.unfed)} of cutting have no feed that is understood: they are not in the time`);
      list.replaceChildren(...items(read.remarks), ...extra.map((words) => h('li', {}, words)));
      taken.replaceChildren(h('li', {}, 'The tool begins at X0 Y0 Z0; speeding up and slowing down take no time.'), ...items(read.assumed));
      show(none, !list.childElementCount);
      show(node, true);
    },
  };
}

function measures(read, rapid) {
  const { length, seconds, moves } = read;
  const air = rapid ? length.rapid / rapid : 0;
  const time = seconds.cut + seconds.dwell + air;
  const parts = [`${duration(seconds.cut)} cutting`, rapid ? `${duration(air)} rapid` : 'rapids not counted'];
  if (seconds.dwell) parts.push(`${duration(seconds.dwell)} dwelling`);
  const isPart = length.unfed || read.remarks.length;
  return [
    ['Time, estimated', length.cut + length.rapid > 0 && `${isPart ? 'more than ' : ''}${duration(time)} (${parts.join(', ')})`],
    ['Size of what is cut', read.size && `${dimensions(read.size)}, from ${corner(read.size.least)} to ${corner(read.size.most)}`],
    ['Way', `${distance(length.cut)} cutting, ${distance(length.rapid)} rapid; ${text.count(moves.straight)} straight, ${text.count(moves.arc)} arcs, ${text.count(moves.rapid)} rapid`],
  ];
}

const duration = (seconds) => text.span(Math.round(seconds) * 1e6);
const round = (mm) => Number(mm.toFixed(3));
const corner = (at) => at.map((value, axis) => `${'XYZ'[axis]}${round(value)}`).join(' ');
const dimensions = ({ least, most }) => `${least.map((from, axis) => round(most[axis] - from)).join(' × ')} mm`;
const distance = (mm) => (mm < 10_000 ? `${mm.toFixed(mm < 100 ? 1 : 0)} mm` : `${text.count(Math.round(mm / 1000))} m`);

/** From where there is most to be seen. */
function flattest(size) {
  if (!size) return 'XY';
  const [x, y, z] = [0, 1, 2].map((axis) => size.most[axis] - size.least[axis]);
  if (y < 1e-9 && x > 0 && z > 0) return 'XZ';
  if (x < 1e-9 && y > 0 && z > 0) return 'YZ';
  return 'XY';
}
