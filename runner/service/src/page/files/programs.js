// Programs: upload, send, save.

import * as api from './api.js';
import { act } from './message.js';
import { field, h, keyed, options, say, show, sureButton } from './dom.js';
import * as store from './store.js';
import * as text from './text.js';

export function page() {
  const file = h('input', { type: 'file', name: 'file', required: true, multiple: true });
  const folder = h('input', { type: 'text', name: 'folder', placeholder: 'none', autocomplete: 'off', pattern: '[A-Za-z0-9][A-Za-z0-9._ \\-]*' });
  const overwrite = h('input', { type: 'checkbox', name: 'overwrite' });
  const form = h('form', {
    class: 'fields panel',
    onsubmit: (event) => {
      event.preventDefault();
      const files = [...file.files];
      act(async () => {
        for (const one of files) {
          const name = folder.value ? `${folder.value}/${one.name}` : one.name;
          await api.send('PUT', `/programs/${api.part(name)}?overwrite=${overwrite.checked}`, one, 'application/octet-stream');
        }
        form.reset();
        return `Uploaded ${files.map((one) => one.name).join(', ')}`;
      });
    },
  }, field('Programs to upload', file), field('Into the folder', folder),
  h('label', { class: 'check' }, overwrite, ' replace what is there'), h('button', { class: 'main' }, 'Upload'));
  const search = h('input', { type: 'search', placeholder: 'Find a program', 'aria-label': 'Find a program', oninput: update });
  const link = h('select', { 'aria-label': 'Link to send to', onchange: update });
  const body = h('tbody');
  const empty = h('p', { class: 'empty' }, 'No programs.');
  const frame = h('div', { class: 'scroll' }, h('table', { class: 'stack' }, h('thead', {}, h('tr', {}, ['Program', 'Size', 'Changed', 'Actions'].map((title) => h('th', {}, title)))), body));

  function row({ name }) {
    const size = h('td');
    const when = h('td');
    const send = h('button', { onclick: () => act(async () => {
      const job = await store.took(api.post(`/links/${api.part(link.value)}/jobs`, { program: name }));
      return { progressOf: job.id };
    }) });
    const node = h('tr', {}, h('td', {}, h('a', { href: `#/program/${api.part(name)}` }, name)), size, when, h('td', { class: 'buttons' }, send,
      h('button', { class: 'quiet', 'aria-label': `Save ${name}`, onclick: () => act(() => api.save(`/programs/${api.part(name)}`, name.split('/').at(-1))) }, 'Save'),
      store.isAdmin() && sureButton('Delete', () => act(() => api.remove(`/programs/${api.part(name)}`)))));
    return {
      node,
      update(now) {
        say(size, text.bytes(now.bytes));
        say(when, text.time(now.changed_ms));
        // To which machine stands on the button itself.
        const to = link.value ? `Send to ${link.value}` : 'Send';
        say(send, to);
        send.setAttribute('aria-label', `${to}: ${name}`);
        send.disabled = !link.value;
        show(send, store.mayAct());
      },
    };
  }

  function update() {
    options(link, store.sorted().map(({ name }) => [name, name]), 'which machine?');
    const part = search.value.trim().toLowerCase();
    const shown = store.programs.filter(({ name }) => name.toLowerCase().includes(part)).slice(0, 500);
    keyed(body, shown, ({ name }) => name, row);
    show(frame, shown.length);
    show(empty, !shown.length);
    show(form, store.mayAct());
    show(to, store.mayAct());
  }
  const to = h('label', { class: 'inline' }, 'Send to ', link);
  update();
  const node = h('section', {}, h('h1', {}, 'Programs'), form,
    h('div', { class: 'panel' }, h('div', { class: 'tools' }, search, to), frame, empty));
  return { node, update };
}
