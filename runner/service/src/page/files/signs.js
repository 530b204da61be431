// The signs of a program that not every line and control can say: each with how often and where first.

import { NAMES, lineOf, visible } from './lines.js';

/** What every control takes that reads ISO code. */
const PLAIN = new Set([...'0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ %()+-.,/:=*#[]\r\n'].map((sign) => sign.charCodeAt(0)));
const MOST = 60;
/** What a person would write in its place, as `softplug check` says too. */
const INSTEAD = {
  '\t': 'a space', '\u00a0': 'a space', ä: 'AE', Ä: 'AE', ö: 'OE', Ö: 'OE', ü: 'UE', Ü: 'UE', ß: 'SS', '–': '-', '—': '-', '−': '-', '×': 'X', '°': 'DEG',
  '\ufeff': 'save the file without a byte order mark',
};

/** Gives `[{sign, count, line, instead}]`, small letters together, the most frequent first. */
export function signs(bytes, starts) {
  const found = new Map();
  const note = (key, sign, at, instead) => {
    const of = found.get(key);
    if (of) of.count += 1;
    else if (found.size < MOST) found.set(key, { sign, count: 1, line: lineOf(starts, at), instead });
  };
  for (let at = 0; at < bytes.length; at += 1) {
    const byte = bytes[at];
    if (PLAIN.has(byte)) continue;
    if (byte >= 0x61 && byte <= 0x7a) note('small', 'small letters', at, 'capitals');
    else if (byte < 0x80) note(byte, byte < 0x20 ? NAMES[byte] : byte === 0x7f ? 'DEL' : String.fromCharCode(byte), at, INSTEAD[String.fromCharCode(byte)]);
    else {
      const length = byte >= 0xf0 ? 4 : byte >= 0xe0 ? 3 : 2;
      const sign = character(bytes.subarray(at, at + length));
      if (sign === null) note(byte, `byte ${byte.toString(16).toUpperCase()}`, at, 'save the file as plain ASCII');
      else {
        note(sign, visible(sign), at, INSTEAD[sign]);
        at += length - 1;
      }
    }
  }
  return [...found.values()].sort((one, other) => other.count - one.count);
}

const decoder = new TextDecoder('utf-8', { fatal: true, ignoreBOM: true });

/** The character of these bytes; null if they are none in UTF-8. */
function character(bytes) {
  try {
    return decoder.decode(bytes);
  } catch {
    return null;
  }
}
