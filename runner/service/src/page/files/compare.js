// What was received beside the program that was sent, line by line.

import * as api from './api.js';
import { field, h, options, say, show } from './dom.js';
import { NAMES, index, lineText } from './lines.js';
import * as store from './store.js';
import * as text from './text.js';

/** Larger ones are not compared here. */
const MOST_BYTES = 32 * 1024 * 1024;

/** What is said of one line, and of many; what matters most comes first. */
const WORDS = {
  changed: ['says something else', 'say something else'],
  missing: ['is missing in what was received', 'are missing in what was received'],
  added: ['is in what was received only', 'are in what was received only'],
  number: ['differs only in its block number', 'differ only in their block numbers'],
  case: ['differs only in small and capital letters', 'differ only in small and capital letters'],
  spaces: ['differs only in spaces', 'differ only in spaces'],
  controls: ['differs only in characters that cannot be seen', 'differ only in characters that cannot be seen'],
  ends: ['differs only in its end', 'differ only in their ends'],
};
const SIGNS = { same: '', ends: '↵', controls: '·', spaces: '␣', case: 'a', number: 'N', changed: '≠', missing: '−', added: '+' };

/** `name` is that of the link and that of the file. */
export function page(name) {
  const slash = name.indexOf('/');
  const [link, file] = [name.slice(0, slash), name.slice(slash + 1)];
  const end = new AbortController();
  const choice = h('select', { onchange: () => start(choice.value) });
  const status = h('p', { class: 'facts', role: 'status' });
  const wrong = h('p', { class: 'wrong', role: 'alert' });
  const verdict = h('p', { class: 'what large' });
  const words = h('ul', { class: 'remarks' });
  const small = h('input', { type: 'checkbox', onchange: () => table.classList.toggle('only-changed', small.checked) });
  const filter = h('label', { class: 'check' }, small, ' only what they say, not how it is written');
  const rest = h('p', { class: 'facts' });
  const body = h('tbody');
  const widths = h('colgroup', {}, ['kind', 'number', '', 'number', ''].map((kind) => h('col', { class: kind })));
  const table = h('table', { class: 'differences' }, widths,
    h('thead', {}, h('tr', {}, h('th', { scope: 'col' }, h('span', { class: 'hidden-words' }, 'Difference')), h('th', { scope: 'col', colSpan: 2 }, 'Sent'), h('th', { scope: 'col', colSpan: 2 }, 'Received'))), body);
  const frame = h('div', { class: 'panel' }, h('h2', {}, 'Differences'), filter, table, rest);
  let worker = null;
  show(frame, false);
  show(wrong, false);
  if (store.links.has(link)) store.loadReceptions(link).catch(fail);

  function fail(error) {
    if (end.signal.aborted) return;
    say(status, '');
    say(wrong, error.message);
    show(wrong, true);
  }

  async function start(program) {
    worker?.terminate();
    show(wrong, false);
    show(frame, false);
    words.replaceChildren();
    say(verdict, '');
    if (!program) return;
    say(status, 'Comparing…');
    try {
      const asked = [`/programs/${api.part(program)}`, `/links/${api.part(link)}/receptions/${api.part(file)}`];
      const sides = (await Promise.all(asked.map((path) => api.bytes(path, end.signal)))).map((buffer) => new Uint8Array(buffer));
      if (sides.some((side) => side.length > MOST_BYTES)) throw new Error(`Programs of more than ${text.bytes(MOST_BYTES)} are not compared here: save both to compare them.`);
      if (choice.value !== program) return;
      worker = new Worker('/page/reading.js', { type: 'module' });
      worker.onmessage = ({ data }) => tell(data.compared, sides);
      worker.onerror = () => fail(new Error('They could not be compared.'));
      const copies = sides.map((side) => side.slice().buffer);
      worker.postMessage({ compare: copies }, copies);
    } catch (error) {
      fail(error);
    }
  }

  function tell(of, sides) {
    say(status, '');
    const changed = of.counts.changed + of.counts.missing + of.counts.added;
    say(verdict, of.isSame ? 'The same, byte for byte.' : changed ? `They differ in ${lines(changed)}.` : 'They say the same; how it is written differs.');
    words.replaceChildren(...sentences(of).map((sentence) => h('li', {}, sentence)));
    const starts = sides.map(index);
    body.replaceChildren(...of.rows.map((row) => tableRow(row, sides, starts)));
    say(rest, of.more ? `And ${text.count(of.more)} more differences: save both to compare them with another program.` : '');
    show(filter, changed && of.rows.some(({ kind }) => kind && kind !== 'same' && kind !== 'ends' && !isChange(kind)));
    show(frame, of.rows.length);
    show(table, of.rows.length);
  }

  function update() {
    options(choice, store.programs.map((of) => [of.name, of.name]), 'which program?');
    if (choice.value || choice.isSettled) return;
    const reception = (store.receptions.get(link) ?? []).find((of) => of.file === file);
    if (!reception) return;
    choice.isSettled = true;
    sentOf(reception).then((program) => {
      if (end.signal.aborted || choice.value || !program) return;
      choice.value = program;
      start(choice.value);
    }, fail);
  }

  const node = h('section', { class: 'compare' },
    h('p', { class: 'back' }, h('a', { href: `#/link/${encodeURIComponent(link)}` }, `← ${link}`)), h('h1', {}, `${file}, compared`),
    h('div', { class: 'panel' }, h('div', { class: 'fields' }, field('Beside the program', choice)), status, wrong, verdict, words), frame);
  update();
  if (choice.value) start(choice.value);
  return {
    node,
    update,
    end() {
      end.abort();
      worker?.terminate();
    },
  };
}

/** The program that the reception belongs to: the one that was last sent under its name, if that is known. */
async function sentOf(reception) {
  const isThere = (name) => store.programs.some((of) => of.name === name);
  const job = reception.compared?.job;
  if (job) {
    const { program } = store.jobs.get(job) ?? await api.get(`/jobs/${job}`);
    if (isThere(program)) return program;
  }
  const stem = (name) => name.split('/').at(-1).replace(/\.[^.]*$/, '').toUpperCase();
  const alike = store.programs.filter(({ name }) => stem(name) === stem(reception.name ?? reception.file));
  return alike.length === 1 ? alike[0].name : null;
}

const lines = (count) => `${text.count(count)} ${count === 1 ? 'line' : 'lines'}`;
const isChange = (kind) => ['changed', 'missing', 'added'].includes(kind);

/** What differs, in words. */
function sentences(of) {
  const said = [];
  for (const [kind, what] of Object.entries(WORDS)) {
    const count = of.counts[kind];
    if (!count) continue;
    said.push(`${lines(count)} ${what[count === 1 ? 0 : 1]}`);
  }
  const [sent, received] = of.ends.map(mostly);
  if (sent && received && sent !== received) said.push(`lines end with ${sent} in what was sent, with ${received} in what was received`);
  for (const [where, both] of [['before', of.leaders], ['behind', of.trailers]]) {
    const [one, other] = both.map(listed);
    if (one !== other) said.push(`${where} the program stands ${other || 'nothing'} in what was received, ${one || 'nothing'} in what was sent`);
  }
  if (!of.isSame && !said.length) said.push('only blank lines or spaces before or behind the program differ');
  said.push(`${lines(of.counts.same)} ${of.counts.same === 1 ? 'is' : 'are'} the same`);
  return said;
}

function mostly(ends) {
  return Object.entries(ends).filter(([, count]) => count).map(([end]) => end).join(' or ');
}

function listed(codes) {
  return codes.map(([code, count]) => `${code === 127 ? 'DEL' : NAMES[code]}${count > 1 ? ` ${text.count(count)} times` : ''}`).join(', ');
}

function tableRow(row, sides, starts) {
  if (row.alike) return h('tr', { class: 'alike' }, h('td', { colSpan: 5 }, `${lines(row.alike)} alike`));
  const [one, other] = [row.a, row.b].map((line, side) => (line < 0 ? null : lineText(sides[side], starts[side], line)));
  const [left, right] = row.kind === 'changed' || row.kind === 'spaces' || row.kind === 'case' || row.kind === 'number' ? marked(one, other) : [one, other];
  const cell = (line, content, side) => [
    h('td', { class: `number ${side}-number${line < 0 ? ' none-number' : ''}` }, line < 0 ? '' : text.count(line + 1)),
    h('td', { class: `code ${side}${line < 0 ? ' none' : ''}`, 'data-side': side }, content),
  ];
  const words = row.kind === 'same' ? '' : WORDS[row.kind][0];
  return h('tr', { class: `is-${row.kind}` }, h('td', { class: 'kind', title: words }, h('span', { 'aria-hidden': 'true' }, SIGNS[row.kind]), h('span', { class: 'hidden-words' }, words)),
    cell(row.a, left, 'sent'), cell(row.b, right, 'received'));
}

/** What stands between what is alike, marked. */
function marked(one, other) {
  let from = 0;
  while (from < one.length && one[from] === other[from]) from += 1;
  let behind = 0;
  while (behind < Math.min(one.length, other.length) - from && one.at(-1 - behind) === other.at(-1 - behind)) behind += 1;
  return [one, other].map((line) => [line.slice(0, from), h('mark', {}, line.slice(from, line.length - behind)), line.slice(line.length - behind)]);
}
