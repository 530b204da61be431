// Numbers, times and bytes for people.

const UNITS = ['B', 'KiB', 'MiB', 'GiB'];

export function bytes(count) {
  if (count === null || count === undefined) return '–';
  let unit = 0;
  let value = count;
  while (value >= 1024 && unit < UNITS.length - 1) {
    value /= 1024;
    unit += 1;
  }
  const digits = unit === 0 || value >= 100 || Number.isInteger(value) ? 0 : 1;
  return `${value.toFixed(digits)} ${UNITS[unit]}`;
}

/** Bytes to the last one. */
export const exact = (number) => `${count(number)} ${number === 1 ? 'byte' : 'bytes'}`;

export function count(number) {
  return (number ?? 0).toLocaleString('en');
}

export function time(ms) {
  if (!ms) return '–';
  const date = new Date(ms);
  const clock = date.toLocaleTimeString('en-GB');
  return date.toDateString() === new Date().toDateString() ? clock : `${date.toLocaleDateString('en-CA')} ${clock}`;
}

export function span(us) {
  const seconds = us / 1e6;
  if (seconds === 0) return '0 s';
  if (seconds < 0.001) return `${us} µs`;
  if (seconds < 1) return `${Math.round(seconds * 1000)} ms`;
  if (seconds < 60) return `${seconds.toFixed(1)} s`;
  const minutes = Math.floor(seconds / 60);
  const rest = minutes < 60 ? Math.floor(seconds % 60) : minutes % 60;
  if (minutes < 60) return `${minutes} min${rest ? ` ${rest} s` : ''}`;
  return `${Math.floor(minutes / 60)} h${rest ? ` ${rest} min` : ''}`;
}

/** A span that is only reckoned: no more digits than are known. */
export function rough(us) {
  const seconds = us / 1e6;
  if (seconds < 10) return 'a few s';
  if (seconds < 90) return `${Math.ceil(seconds / 5) * 5} s`;
  const minutes = Math.ceil(seconds / 60);
  return minutes < 60 ? `${minutes} min` : `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

export function since(ms) {
  return ms ? span(Math.max(0, Date.now() - ms) * 1000) : '';
}

const BAD = new Set(['failed', 'aborted', 'interrupted']);

export const hasEnded = (job) => job.state === 'done' || BAD.has(job.state);
export const isBad = (job) => BAD.has(job.state);

/** A job's program, with the name that it says of itself if that is another. */
export const program = (of) => `${of.program ?? of.kind}${of.named ? ` (${of.named})` : ''}`;

/** A job in a sentence: the gateway's own words for how far it is. */
export function job(of) {
  const parts = [`Job ${of.id}, ${program(of)} on ${of.link}: ${of.state}`];
  const isSaid = of.text.endsWith(of.state);
  if (isBad(of) && of.message) parts.push(of.message);
  if (of.text) parts.push(isSaid ? of.text.slice(0, -of.state.length).replace(/; $/, '') : of.text);
  return parts.join('; ');
}

/** Whether one version of a plug-in comes after another. */
export const isNewer = (one, other) => one.version.localeCompare(other.version, 'en', { numeric: true }) > 0;

/** A plug-in's name and version. */
export function plugin(of) {
  return of ? `${of.name} ${of.version}` : 'none';
}

/** How the API names it: by its digest, which means one module only. */
export function pluginKey(of) {
  return `${of.name}@sha256:${of.digest}`;
}

const CONTROLS = [
  'NUL', 'SOH', 'STX', 'ETX', 'EOT', 'ENQ', 'ACK', 'BEL', 'BS', 'HT', 'LF', 'VT', 'FF', 'CR', 'SO', 'SI',
  'DLE', 'DC1', 'DC2', 'DC3', 'DC4', 'NAK', 'SYN', 'ETB', 'CAN', 'EM', 'SUB', 'ESC', 'FS', 'GS', 'RS', 'US',
];

/** Splits bytes in hex into runs of text and single codes: [{text} | {code}]. */
export function runs(hex) {
  const found = [];
  let text = '';
  for (let at = 0; at + 1 < hex.length; at += 2) {
    const byte = parseInt(hex.slice(at, at + 2), 16);
    if (byte >= 0x20 && byte < 0x7f) {
      text += String.fromCharCode(byte);
      continue;
    }
    if (text) found.push({ text });
    text = '';
    found.push({ code: CONTROLS[byte] ?? (byte === 0x7f ? 'DEL' : hex.slice(at, at + 2).toUpperCase()) });
  }
  if (text) found.push({ text });
  return found;
}

/** Bytes in hex, with gaps. */
export function spaced(hex) {
  return (hex.match(/../g) ?? []).join(' ').toUpperCase();
}
