// Building and updating the page. Texts become text nodes, so nothing that a machine sent is ever markup.

/** An element: h('p', {class: 'x', onclick: f}, 'text', child, …); what is null or false is left out. */
export function h(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  return fill(element, properties, children);
}

/** The same for SVG. */
export function s(tag, properties = {}, ...children) {
  const element = document.createElementNS('http://www.w3.org/2000/svg', tag);
  return fill(element, properties, children);
}

function fill(element, properties, children) {
  for (const [name, value] of Object.entries(properties)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith('on')) element.addEventListener(name.slice(2), value);
    else if (name in element && name !== 'list' && !(element instanceof SVGElement)) setProperty(element, name, value);
    else element.setAttribute(name, value === true ? '' : value);
  }
  element.append(...children.flat().filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

function setProperty(element, name, value) {
  if (typeof element[name] === 'object' && element[name] !== null) element.setAttribute(name, value);
  else element[name] = value;
}

/** Sets a text, if it is another one: what is selected or read aloud stays. */
export function say(element, text) {
  text = String(text ?? '');
  if (element.textContent !== text) element.textContent = text;
}

/** Shows or hides. */
export function show(element, is) {
  if (element.hasAttribute('hidden') === Boolean(is)) element.toggleAttribute('hidden', !is);
}

/** Keeps the children of `parent` in step with `items`: each is made once, then updated. */
export function keyed(parent, items, keyOf, make) {
  const parts = (parent.parts ??= new Map());
  const keys = new Set(items.map(keyOf));
  for (const [key, part] of parts) {
    if (keys.has(key)) continue;
    part.node.remove();
    parts.delete(key);
  }
  let before = parent.firstChild;
  for (const item of items) {
    const key = keyOf(item);
    let part = parts.get(key);
    if (!part) parts.set(key, (part = make(item)));
    if (part.node === before) before = before.nextSibling;
    else parent.insertBefore(part.node, before);
    part.update(item);
  }
}

/** A button that asks again: the second press within some seconds does it. */
export function sureButton(text, act) {
  let armed = null;
  const disarm = () => {
    clearTimeout(armed);
    armed = null;
    say(button, text);
    button.classList.remove('armed');
  };
  const button = h('button', {
    class: 'danger',
    onclick: () => {
      if (armed) {
        disarm();
        act();
        return;
      }
      say(button, `${text}: sure?`);
      button.classList.add('armed');
      armed = setTimeout(disarm, 5000);
    },
    onblur: () => armed && disarm(),
  }, text);
  return button;
}

/** A labelled field. */
export function field(label, control, hint) {
  return h('label', { class: 'field' }, h('span', {}, label), control, hint && h('small', {}, hint));
}

/** Replaces the options of a select and keeps its choice. Of several, none is chosen before somebody does: `question` asks. */
export function options(select, choices, question) {
  const values = question && choices.length > 1 ? [['', question], ...choices] : choices;
  const key = JSON.stringify(values);
  if (select.optionsKey === key) return;
  select.optionsKey = key;
  const chosen = select.value;
  select.replaceChildren(...values.map(([value, text]) => h('option', { value }, text)));
  if (values.some(([value]) => value === chosen)) select.value = chosen;
}
