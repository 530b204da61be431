// The library of plug-ins.

import * as api from './api.js';
import { act } from './message.js';
import { field, h, keyed, say, show, sureButton } from './dom.js';
import * as store from './store.js';
import * as text from './text.js';

export function page() {
  const file = h('input', { type: 'file', name: 'module', accept: '.wasm', required: true });
  const form = h('form', {
    class: 'fields panel',
    onsubmit: (event) => {
      event.preventDefault();
      act(async () => {
        const added = await api.send('POST', '/plugins', file.files[0], 'application/wasm');
        form.reset();
        return `Added ${text.plugin(added)}`;
      });
    },
  }, field('Plug-in to add (.wasm)', file, 'It is checked first; no link changes by it.'), h('button', { class: 'main' }, 'Add'));
  const list = h('ul', { class: 'plugins' });
  const empty = h('p', { class: 'empty' }, 'The library is empty.');
  function update() {
    show(form, store.isAdmin());
    show(empty, !store.plugins.length);
    keyed(list, store.plugins, (of) => of.digest, item);
  }
  update();
  return { node: h('section', {}, h('h1', {}, 'Plug-ins'), form, list, empty), update };
}

function item(of) {
  const runs = h('p', { class: 'facts' });
  const remove = sureButton('Remove', () => act(() => api.remove(`/plugins/${api.part(text.pluginKey(of))}`)));
  const settings = h('tbody', {}, of.settings.map((one) => h('tr', {},
    h('td', {}, h('code', {}, one.name)), h('td', {}, one.choices.length ? one.choices.join(', ') : one.type),
    h('td', {}, `${one.default}${one.unit ? ` ${one.unit}` : ''}`), h('td', {}, one.text))));
  const node = h('li', { class: 'panel' },
    h('h2', {}, text.plugin(of)), h('p', {}, of.description),
    h('p', { class: 'facts' }, `${of.protocol} · ${text.bytes(of.bytes)} · sha256 ${of.digest.slice(0, 16)}… · ${of.licence}`), runs,
    of.settings.length > 0 && h('details', {}, h('summary', {}, `${of.settings.length} settings`),
      h('div', { class: 'scroll' }, h('table', {}, h('thead', {}, h('tr', {}, ['Setting', 'Values', 'Default', 'What it does'].map((title) => h('th', {}, title)))), settings))),
    remove);
  return {
    node,
    update(now) {
      say(runs, now.links.length ? `Runs on ${now.links.join(', ')}` : 'No link runs it.');
      show(remove, store.isAdmin() && !now.links.length);
    },
  };
}
