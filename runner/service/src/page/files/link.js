// One link: what it does, its jobs, its plug-in, its line.

import * as address from './address.js';
import * as api from './api.js';
import { act } from './message.js';
import { whenSelect } from './bulk.js';
import { asker, checked } from './check.js';
import { field, h, keyed, options, say, show, sureButton } from './dom.js';
import { history } from './history.js';
import { table as jobTable } from './jobs.js';
import { overview } from './overview.js';
import { quarantine } from './quarantine.js';
import { sequence } from './sequence.js';
import * as store from './store.js';
import * as text from './text.js';

export function page(name) {
  const path = `/links/${api.part(name)}`;
  const missing = h('p', { class: 'empty' }, `There is no link ${name}.`);
  const group = h('a', { class: 'group' });
  const now = overview(name, path);
  const isolated = quarantine(path);
  const past = history(path);
  const send = sendForm(path, () => update());
  const swap = swapForm(path);
  const jobs = queue(name);
  const came = received(name, path);
  const facts = connection(path);
  const counted = counters();
  const cut = lathe(path);
  const parts = [now, isolated, cut, send, swap, jobs, came, past, facts, counted];
  const line = sequence(path);
  const body = h('div', {}, isolated.node, now.node, cut.node, h('div', { class: 'columns' }, send.node, swap.node),
    jobs.node, came.node, past.node, line.node, facts.node, counted.node);
  const node = h('section', {},
    h('p', { class: 'back' }, h('a', { href: '#/links' }, '← All links')), h('div', { class: 'title' }, h('h1', {}, name), group), missing, body);
  const update = () => {
    const link = store.links.get(name);
    show(missing, !link);
    show(body, link);
    say(group, link?.group ?? '');
    show(group, link?.group);
    group.href = address.to('links', { group: link?.group });
    if (link) for (const part of parts) part.update(link);
  };
  update();
  const end = () => {
    line.end();
    cut.end();
    past.end();
    send.end();
  };
  return { node, update, end };
}

/** What a simulated lathe has cut, once a second while it can be seen. */
function lathe(path) {
  const picture = h('div', { class: 'part', role: 'img', 'aria-label': 'The turned part and the way of the tool' });
  const facts = h('p', { class: 'facts' });
  const node = h('div', { class: 'panel' }, h('h2', {}, 'Lathe'), picture, facts);
  let timer = null;
  let asked = false;
  const look = async () => {
    if (asked || document.hidden) return;
    asked = true;
    try {
      const of = await api.get(`${path}/lathe`);
      const drawn = new DOMParser().parseFromString(of.picture, 'image/svg+xml').documentElement;
      picture.replaceChildren(document.adoptNode(drawn));
      say(facts, `x ${of.x_mm.toFixed(3)} mm, z ${of.z_mm.toFixed(2)} mm from where they began; ${text.count(of.pulses)} pulses, ${of.gaps ? `${text.count(of.gaps)} gaps inside cuts` : 'no gap'}${of.lost_pulses ? `, ${text.count(of.lost_pulses)} pulses lost at a limit switch` : ''}.`);
    } catch (error) {
      say(facts, error.message);
    }
    asked = false;
  };
  show(node, false);
  return {
    node,
    update(link) {
      const is = link.port.spec === 'simulate:pulse-lathe';
      show(node, is);
      if (is && timer === null) {
        timer = setInterval(look, 1000);
        look();
      }
    },
    end() {
      clearInterval(timer);
    },
  };
}

/** The port, the line and the plug-in. */
function connection(path) {
  const facts = h('dl', { class: 'pairs' });
  const onLink = (verb) => () => act(() => store.took(api.post(`${path}/${verb}`)));
  const reopen = h('button', { class: 'quiet', onclick: onLink('reopen') }, 'Open the port again');
  const halt = sureButton('Stop the plug-in', onLink('quarantine'));
  const buttons = h('div', { class: 'buttons' }, reopen, halt);
  return {
    node: h('div', { class: 'panel' }, h('h2', {}, 'Port and line'), facts, buttons),
    update(link) {
      show(reopen, store.mayAct());
      // Whatever it does, at once: an admin's.
      show(halt, store.isAdmin() && !link.quarantine);
      show(buttons, store.mayAct());
      pairs(facts, [
        ['Port', link.port.spec],
        ['Line', link.port.line],
        ['Differs', link.port.differences.join('; ')],
        ['Other side', link.port.other_side],
        ['Plug-in', text.plugin(link.plugin)],
        ['Says', link.condition],
        ['Endpoint', link.endpoint && `${link.endpoint.kind} at ${link.endpoint.listen}${link.endpoint.client ? `, ${link.endpoint.client}` : ''}${link.endpoint.failure ? `: ${link.endpoint.failure}` : ''}`],
        ['Drop folder', link.drop && dropFolder(link.drop)],
        ['Change waits', link.is_change_waiting && 'until the link is idle'],
      ]);
    },
  };
}

/** A drop folder and what is in it. */
function dropFolder(drop) {
  const parts = [[drop.waiting, 'waiting'], [drop.under_way, 'under way'], [drop.left_lying, 'not taken: see the journal']];
  return [drop.folder, ...parts.filter(([count]) => count).map(([count, what]) => `${text.count(count)} ${what}`)].join(', ');
}

/** A list of names and values; empty values are left out. */
function pairs(list, values) {
  keyed(list, values.filter(([, value]) => value), ([name]) => name, ([name]) => {
    const value = h('dd');
    return { node: h('div', {}, h('dt', {}, name), value), update: ([, now]) => say(value, now) };
  });
}

function sendForm(path, told) {
  const checks = asker(told);
  const how = checked();
  const program = h('select', { name: 'program', required: true, onchange: told });
  const priority = h('input', { type: 'number', name: 'priority', value: '0', step: '1' });
  const block = h('input', { type: 'number', name: 'block', min: '1', placeholder: '1' });
  const none = h('p', { class: 'empty' }, 'No programs yet: ', h('a', { href: '#/programs' }, 'upload one'), '.');
  const form = h('form', {
    class: 'fields',
    onsubmit: (event) => {
      event.preventDefault();
      const order = { program: program.value, priority: Number(priority.value) || 0 };
      if (block.value) order.from_block = Number(block.value);
      act(async () => {
        const job = await store.took(api.post(`${path}/jobs`, order));
        return { progressOf: job.id };
      });
    },
  }, field('Program', program), h('button', { class: 'main' }, 'Send'),
  h('details', { class: 'whole' }, h('summary', {}, 'Begin at a block, or before others'), h('div', { class: 'fields' }, field('From block', block), field('Priority', priority))));
  const node = h('div', { class: 'panel' }, h('h2', {}, 'Send'), form, how.node, none);
  return {
    node,
    update(link) {
      options(program, store.programs.map(({ name, bytes }) => [name, `${name} (${text.bytes(bytes)})`]), 'Which?');
      show(node, store.mayAct());
      show(form, store.programs.length);
      show(none, !store.programs.length);
      const chosen = store.mayAct() && link.plugin ? program.value : '';
      const answerOf = checks.want([link], chosen);
      show(how.node, chosen);
      if (chosen) how.update(link, chosen, answerOf(link));
    },
    end: checks.end,
  };
}

function swapForm(path) {
  const choice = h('select', { name: 'plugin', 'aria-label': 'Plug-in' });
  const when = whenSelect();
  const swap = (plugin, moment) => act(async () => {
    const view = await api.post(`${path}/swap`, { plugin, when: moment });
    return `Swap to ${text.plugin(view.to)}: ${view.state}${view.message ? `, ${view.message}` : ''}`;
  });
  const one = h('button', { class: 'main', onclick: () => one.plugin && swap(one.plugin, 'now-or-idle') });
  const form = h('form', { class: 'fields', onsubmit: (event) => { event.preventDefault(); swap(choice.value, when.value); } },
    field('Plug-in', choice), field('When', when), h('button', {}, 'Swap'));
  const last = h('p', { class: 'facts', role: 'status' });
  const forbidden = h('p', { class: 'facts' }, 'Only an admin may swap.');
  const more = h('details', {}, h('summary', {}, 'Choose plug-in and time'), form);
  return {
    node: h('div', { class: 'panel' }, h('h2', {}, 'Plug-in'), one, more, forbidden, last),
    update(link) {
      const isAdmin = store.isAdmin();
      const newer = isAdmin ? newest(link) : null;
      one.plugin = newer && text.pluginKey(newer);
      const isNewer = newer && text.isNewer(newer, link.plugin);
      say(one, newer ? `${isNewer ? 'Swap' : 'Back'} to ${text.plugin(newer)}` : '');
      one.classList.toggle('main', Boolean(isNewer));
      // In quarantine the way back stands there.
      show(one, newer && newer.digest !== link.quarantine?.ran_well?.digest);
      show(more, isAdmin);
      show(forbidden, !isAdmin);
      options(choice, store.plugins.map((of) => [text.pluginKey(of), `${text.plugin(of)} (${of.digest.slice(0, 8)})${of.digest === link.plugin?.digest ? ', runs' : ''}`]));
      const { swap: view, probation } = link;
      say(last, [
        `Runs ${text.plugin(link.plugin)}.`,
        view && `Last swap, ${text.time(view.at_ms)}: ${view.from ? `${text.plugin(view.from)} → ` : ''}${text.plugin(view.to)}, ${view.state}${view.pause_us === null ? '' : `; the link stood still for ${text.span(view.pause_us)}`}${view.message ? `: ${view.message}` : ''}.`,
        probation && `On probation; returns to ${text.plugin(probation.returns_to)} if it fails.`,
      ].filter(Boolean).join(' '));
    },
  };
}

/** The last added plug-in of the same name that is another one than that which runs. */
function newest(link) {
  const others = store.plugins.filter((of) => of.name === link.plugin?.name && of.digest !== link.plugin.digest);
  return others.sort((a, b) => store.inOrder(a.version, b.version)).at(-1) ?? null;
}

function queue(name) {
  const jobs = jobTable(() => store.newestJobs().filter((job) => job.link === name).slice(0, 20), false);
  return { node: h('div', { class: 'panel' }, h('h2', {}, 'Jobs'), jobs.node), update: jobs.update };
}

function received(name, path) {
  const body = h('tbody');
  const empty = h('p', { class: 'empty' }, 'Nothing was received yet.');
  if (store.links.has(name)) store.loadReceptions(name).catch(() => {});
  const titles = ['Program', 'Size', 'When', 'Compared', 'Actions'].map((title) => h('th', { scope: 'col' }, title));
  const frame = h('div', { class: 'scroll' }, h('table', { class: 'stack' }, h('thead', {}, h('tr', {}, titles)), body));
  const node = h('div', { class: 'panel' }, h('h2', {}, 'Received'), frame, empty);
  return {
    node,
    update() {
      const all = store.receptions.get(name) ?? [];
      show(empty, !all.length);
      show(frame, all.length);
      keyed(body, all.slice(0, 100), (of) => of.file, (of) => ({ node: reception(name, path, of), update() {} }));
    },
  };
}

/** Something that came: by the name that the machine gave it; the file's name beside it where that is another. */
function reception(name, path, of) {
  const title = of.name || 'unnamed';
  return h('tr', { class: of.failure ? 'bad' : '' },
    h('td', {}, title, of.file !== title && [h('br'), h('small', {}, of.file)]), h('td', {}, text.bytes(of.bytes)), h('td', {}, text.time(of.at_ms)), h('td', {}, compared(of)),
    h('td', { class: 'buttons' }, h('a', { class: 'button quiet', href: `#/compare/${api.part(`${name}/${of.file}`)}`, 'aria-label': `Compare ${of.file}` }, 'Compare'),
      h('button', { class: 'quiet', 'aria-label': `Save ${title}, ${of.file}`, onclick: () => act(() => api.save(`${path}/receptions/${api.part(of.file)}`, of.file)) }, 'Save')));
}

function compared(of) {
  if (of.failure) return `failed: ${of.failure}`;
  if (!of.compared) return '';
  if (of.compared.is_same) return 'same as sent';
  return `differs from what was sent${of.compared.differs_at === null ? '' : ` at byte ${text.count(of.compared.differs_at)}`}`;
}

function counters() {
  const list = h('dl', { class: 'pairs' });
  return {
    node: h('details', { class: 'panel' }, h('summary', {}, h('h2', {}, 'Counters')), list),
    update(link) {
      const { counters: of, buffer } = link;
      pairs(list, [
        ['From the machine', `${text.count(of.bytes_in)} bytes`],
        ['To the machine', `${text.count(of.bytes_out)} bytes`],
        ['Line errors', Object.entries(of.line_errors).filter(([, n]) => n).map(([kind, n]) => `${kind} ${text.count(n)}`).join(', ') || 'none'],
        ['Held', `${text.count(of.holds)} times, ${text.span(of.held_us)}`],
        ['Gaps while bytes waited', of.gaps ? `${text.count(of.gaps)}, ${text.span(of.longest_gap_us)} at most` : 'none'],
        ['Sent after stop', `${text.count(of.after_stop)} characters`],
        ['Starved', `${text.count(of.starved)} times, ${text.span(of.starved_us)}`],
        ['Buffer', `${text.count(buffer.smallest ?? 0)} to ${text.count(buffer.largest)} bytes`],
        ['Events', text.count(of.events)],
        ['Fuel', text.count(of.fuel)],
        ['Plug-in restarts', text.count(of.restarts)],
        ['Port reopened', text.count(of.reopened)],
        ['Messages dropped', text.count(of.notes_dropped)],
        ...(link.endpoint ? [['From the endpoint', `${text.count(of.endpoint_bytes)} bytes in ${text.count(of.endpoint_jobs)} jobs, ${text.count(of.endpoint_failed)} failed`]] : []),
      ]);
    },
  };
}
