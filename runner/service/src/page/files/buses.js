// Buses and the units on them: looked at each second while they are shown.

import * as api from './api.js';
import { h, keyed, say, show } from './dom.js';
import * as text from './text.js';

const percent = (part) => part === null ? '–' : `${(100 * part).toFixed(1)} %`;
const millis = (seconds) => seconds === null ? '–' : `${(1000 * seconds).toFixed(1)} ms`;
const payload = (bus) => `${text.count(Math.round(bus.rate * bus.efficiency))} bit/s`;

/** The part of its time in which a bus is to carry what its machines take at most, and to switch. */
function needed(bus) {
  const known = bus.units.filter((unit) => unit.consumes !== null && unit.buffer);
  if (!known.length) return null;
  const taken = known.reduce((sum, unit) => sum + unit.consumes, 0) / (bus.rate * bus.efficiency);
  // Each unit's buffer is filled once while its machine takes it.
  const switches = known.reduce((sum, unit) => sum + unit.consumes / (8 * unit.buffer), 0);
  return taken + switches * bus.switch_seconds;
}

/** A row of what is planned and what was measured. */
function row(title, planned, measured) {
  const cells = [h('td'), h('td')];
  return {
    node: h('tr', {}, h('th', { scope: 'row' }, title), cells),
    update(bus) {
      say(cells[0], planned(bus));
      say(cells[1], measured(bus.measured));
    },
  };
}

function slot(of) {
  if (!of.digest) return `${of.slot} ${of.state}`;
  return `${of.slot} ${of.state} ${of.digest.slice(0, 8)}…${of.runs ? ', runs' : ''}`;
}

function unit(of) {
  const bar = h('progress', { max: 1 });
  const level = h('span', { class: 'facts' });
  const turn = h('td');
  const takes = h('td');
  const slots = h('td');
  const link = h('a', { href: `#/link/${encodeURIComponent(of.link)}` }, of.link);
  bar.setAttribute('aria-label', `Buffer of ${of.link}`);
  const node = h('tr', {}, h('td', {}, link, h('br'), h('small', {}, of.port)), h('td', { class: 'level' }, bar, level), turn, takes, slots);
  return {
    node,
    update(now) {
      bar.value = now.buffer ? Math.min(1, now.level / now.buffer) : 0;
      say(level, now.buffer ? `${text.bytes(now.level)} of ${text.bytes(now.buffer)}` : 'no job yet');
      say(turn, now.isServed ? '▶ its turn' : '');
      say(takes, now.consumes === null ? '–' : `${text.count(Math.round(now.consumes))} bit/s`);
      say(slots, now.slots.map(slot).join(' · '));
    },
  };
}

const heads = (titles) => h('thead', {}, h('tr', {}, titles.map((title) => h('th', {}, title))));

function item(bus) {
  const rows = [
    row('Load', (of) => percent(needed(of)), (measured) => percent(measured.load)),
    row('Data of all bits', (of) => percent(of.efficiency), (measured) => percent(measured.efficiency)),
    row('Time to switch', (of) => millis(of.switch_seconds), (measured) => millis(measured.switch_seconds)),
  ];
  const facts = h('p', { class: 'facts' });
  const units = h('tbody');
  const empty = h('p', { class: 'empty' }, 'No link is on this bus.');
  const all = h('div', { class: 'scroll' }, h('table', { class: 'stack' }, heads(['Unit', 'Buffer', 'Turn', 'Takes at most', 'Slots']), units));
  const node = h('li', { class: 'panel' }, h('h2', {}, bus.name), facts,
    h('table', { class: 'measured' }, heads(['What', 'Planned', 'Measured']), h('tbody', {}, rows.map((one) => one.node))),
    all, empty);
  return {
    node,
    update(now) {
      say(facts, `${text.count(now.rate)} bit/s, of which ${payload(now)} are data`);
      for (const one of rows) one.update(now);
      show(all, now.units.length);
      show(empty, !now.units.length);
      keyed(units, now.units.map((of) => ({ ...of, isServed: of.link === now.serves })), (of) => of.link, unit);
    },
  };
}

/** The page with all buses. */
export function page() {
  const list = h('ul', { class: 'plugins' });
  const empty = h('p', { class: 'empty' });
  async function look() {
    try {
      const buses = await api.get('/buses');
      say(empty, 'There are no buses: gateway.toml names them.');
      show(empty, !buses.length);
      keyed(list, buses, (bus) => bus.name, item);
    } catch (error) {
      say(empty, `The buses cannot be had: ${error.message}`);
      show(empty, true);
    }
  }
  const timer = setInterval(look, 1000);
  look();
  return { node: h('section', {}, h('h1', {}, 'Buses'), list, empty), update() {}, end: () => clearInterval(timer) };
}
