// The lines of a program: where each begins, and what is shown of it.

/** Of a longer line only the beginning is shown. */
const MOST_SHOWN = 400;
/** Control characters, by code. */
export const NAMES = [
  'NUL', 'SOH', 'STX', 'ETX', 'EOT', 'ENQ', 'ACK', 'BEL', 'BS', 'TAB', 'LF', 'VT', 'FF', 'CR', 'SO', 'SI',
  'DLE', 'DC1', 'DC2', 'DC3', 'DC4', 'NAK', 'SYN', 'ETB', 'CAN', 'EM', 'SUB', 'ESC', 'FS', 'GS', 'RS', 'US',
];

/**
 * Where each line begins. A line ends behind its line feed or, in a program without any in its first
 * 64 KiB, behind its carriage return: these are the blocks that the gateway counts.
 */
export function index(bytes) {
  const head = bytes.subarray(0, 65536);
  const end = head.includes(10) || !head.includes(13) ? 10 : 13;
  let starts = new Uint32Array(1024);
  let count = 0;
  for (let at = 0; at < bytes.length;) {
    if (count === starts.length) {
      const larger = new Uint32Array(2 * count);
      larger.set(starts);
      starts = larger;
    }
    starts[count] = at;
    count += 1;
    const next = bytes.indexOf(end, at);
    at = next < 0 ? bytes.length : next + 1;
  }
  return starts.slice(0, count);
}

/** The line in which a byte stands, counted from 0; -1 if there is none. */
export function lineOf(starts, byte) {
  let [low, high] = [0, starts.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (starts[middle] <= byte) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

/** A line for people, without its end: control characters by their names, what is no UTF-8 as �. */
export function lineText(bytes, starts, line) {
  const from = starts[line];
  let to = starts[line + 1] ?? bytes.length;
  while (to > from && (bytes[to - 1] === 10 || bytes[to - 1] === 13)) to -= 1;
  const shown = new TextDecoder('utf-8', { ignoreBOM: true }).decode(bytes.subarray(from, Math.min(to, from + MOST_SHOWN)));
  const rest = to - from - MOST_SHOWN;
  return visible(shown) + (rest > 0 ? ` … ${rest.toLocaleString('en')} more bytes` : '');
}

/** What cannot be seen is named, and what turns the direction of a text too. */
export function visible(text) {
  return text.replace(/[\u0000-\u001f\u007f\u0080-\u009f\u00ad\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff]/g, (sign) => {
    const code = sign.charCodeAt(0);
    if (code === 9) return '→ ';
    if (code < 0x20) return `⟨${NAMES[code]}⟩`;
    return code === 0x7f ? '⟨DEL⟩' : `⟨U+${code.toString(16).toUpperCase().padStart(4, '0')}⟩`;
  });
}
