// The text of a program with the numbers of its lines. Only the lines in view are in the page, however many there are.

import { h } from './dom.js';
import { lineText } from './lines.js';

const ROW = 24;
/** Browsers lay out no taller box than some ten million pixels: behind it the bar stands for more lines than it shows. */
const TALLEST = 6_000_000;

/** `onPick` is told which line was chosen, counted from 0. */
export function listing(label, onPick) {
  const rows = h('div', { class: 'rows', role: 'presentation' });
  const space = h('div', { role: 'presentation' }, rows);
  const node = h('div', { class: 'listing', tabIndex: 0, role: 'listbox', 'aria-label': label, onscroll: scrolled, onkeydown: pressed, onwheel: turned, onclick: clicked }, space);
  let bytes = new Uint8Array();
  let starts = new Uint32Array();
  let first = 0;
  let chosen = -1;
  /** What has left: lines before `surely` whole, `surely` to `maybe` perhaps. */
  let left = null;
  let isMoving = false;
  const id = `line-${Math.random().toString(36).slice(2)}`;
  const watch = new ResizeObserver(() => draw());
  watch.observe(node);

  const inView = () => Math.max(1, Math.floor(node.clientHeight / ROW));
  const height = () => Math.min(starts.length * ROW, TALLEST);
  const lastFirst = () => Math.max(0, starts.length - inView());
  const isTall = () => starts.length * ROW > TALLEST;

  function scrolled() {
    if (isMoving) {
      isMoving = false;
      draw();
      return;
    }
    const most = Math.max(1, node.scrollHeight - node.clientHeight);
    first = isTall() ? Math.round((node.scrollTop / most) * lastFirst()) : Math.floor(node.scrollTop / ROW);
    draw();
  }

  /** Shows from this line on; the bar follows. */
  function move(to) {
    first = Math.max(0, Math.min(lastFirst(), to));
    const most = node.scrollHeight - node.clientHeight;
    const top = Math.round(isTall() ? (first / Math.max(1, lastFirst())) * most : first * ROW);
    if (top !== node.scrollTop) {
      isMoving = true;
      node.scrollTop = top;
    }
    draw();
  }

  /** A wheel goes on by lines, also where the bar goes on by hundreds. */
  function turned(event) {
    if (!isTall() || event.ctrlKey || Math.abs(event.deltaX) > Math.abs(event.deltaY)) return;
    event.preventDefault();
    move(first + Math.sign(event.deltaY) * Math.max(1, Math.round(Math.abs(event.deltaY) / ROW)));
  }

  function pressed(event) {
    const steps = { ArrowDown: 1, ArrowUp: -1, PageDown: inView(), PageUp: -inView(), Home: -starts.length, End: starts.length };
    const step = steps[event.key];
    if (!step || !starts.length || event.ctrlKey || event.altKey) return;
    event.preventDefault();
    pick(Math.max(0, Math.min(starts.length - 1, (chosen < 0 ? first : chosen) + step)));
  }

  function clicked(event) {
    const row = event.target.closest('[data-line]');
    if (row && !String(getSelection())) pick(Number(row.dataset.line));
  }

  function pick(line) {
    choose(line);
    onPick(line);
  }

  function choose(line) {
    chosen = line;
    reveal(line);
  }

  /** Brings a line into view if it is not there. */
  function reveal(line) {
    if (line < first || line >= first + inView()) move(line - Math.floor(inView() / 2));
    else draw();
  }

  function draw() {
    const count = Math.min(starts.length - first, inView() + 2);
    space.style.height = `${height()}px`;
    // In a tall listing the rows stand where the bar is; else where they belong.
    rows.style.top = `${isTall() ? node.scrollTop : first * ROW}px`;
    const made = [];
    for (let line = first; line < first + count; line += 1) made.push(row(line));
    rows.replaceChildren(...made);
    const isChosenShown = chosen >= first && chosen < first + count;
    if (isChosenShown) node.setAttribute('aria-activedescendant', `${id}-${chosen}`);
    else node.removeAttribute('aria-activedescendant');
  }

  function row(line) {
    const [kind, sign, words] = state(line);
    return h('div', {
      id: `${id}-${line}`, class: `${kind}${line === chosen ? ' chosen' : ''}`, role: 'option', 'aria-selected': String(line === chosen),
      'aria-posinset': line + 1, 'aria-setsize': starts.length, 'data-line': line,
    }, h('span', { class: 'number' }, (line + 1).toLocaleString('en')), h('span', { class: 'sign', title: words }, sign),
    h('span', { class: 'code' }, lineText(bytes, starts, line)));
  }

  function state(line) {
    if (!left || line > left.maybe) return ['', '', ''];
    if (line === left.surely) return ['now', '▶', 'leaves now'];
    return line < left.surely ? ['left', '✓', 'has left'] : ['maybe', '·', 'may have left'];
  }

  return {
    node,
    set(someBytes, someStarts) {
      [bytes, starts] = [someBytes, someStarts];
      first = 0;
      draw();
    },
    /** Marks what has left; null if nothing is sent. */
    mark(what) {
      if (left?.surely === what?.surely && left?.maybe === what?.maybe) return;
      left = what;
      draw();
    },
    choose,
    reveal,
    get chosen() {
      return chosen;
    },
    end: () => watch.disconnect(),
  };
}
