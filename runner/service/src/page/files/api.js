// Talking with the gateway: the token, requests, streams of events.

const KEY = 'softplug-token';
let token = sessionStorage.getItem(KEY) ?? localStorage.getItem(KEY) ?? '';

export class Refused extends Error {
  constructor(status, detail) {
    super(detail);
    this.status = status;
  }
}

export function hasToken() {
  return token !== '';
}

export function keepToken(text, forLong) {
  token = text.trim();
  sessionStorage.setItem(KEY, token);
  if (forLong) localStorage.setItem(KEY, token);
}

export function forgetToken() {
  token = '';
  sessionStorage.removeItem(KEY);
  localStorage.removeItem(KEY);
}

async function ask(method, path, { body, kind, signal } = {}) {
  const headers = { Authorization: `Bearer ${token}` };
  if (kind) headers['Content-Type'] = kind;
  const answer = await fetch(`/api/v1${path}`, { method, headers, body, signal, cache: 'no-store' });
  if (answer.ok) return answer;
  let detail = `the gateway answered ${answer.status}`;
  try {
    const problem = await answer.json();
    detail = problem.detail ?? detail;
  } catch {
    // No problem document: the status has to do.
  }
  throw new Refused(answer.status, detail);
}

const json = async (answer) => (answer.status === 204 ? null : answer.json());

export const get = (path, signal) => ask('GET', path, { signal }).then(json);
export const remove = (path) => ask('DELETE', path).then(json);
export const post = (path, order) =>
  ask('POST', path, order === undefined ? {} : { body: JSON.stringify(order), kind: 'application/json' }).then(json);
export const put = (path, order) =>
  ask('PUT', path, { body: JSON.stringify(order), kind: 'application/json' }).then(json);
export const send = (method, path, file, kind) => ask(method, path, { body: file, kind }).then(json);

/** The bytes of a file. */
export const bytes = (path, signal) => ask('GET', path, { signal }).then((answer) => answer.arrayBuffer());

/** A part of a path. */
export const part = encodeURIComponent;

/** Saves a file through the browser. */
export async function save(path, name) {
  const blob = await (await ask('GET', path)).blob();
  const link = document.createElement('a');
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

/** Whether the token lets us in, and as whom. */
export const me = () => get('/me');

/**
 * Listens to server-sent events until told to stop; connects again when the connection is lost.
 * `on` has a function for each event's name, and `state(isConnected, error)`.
 */
export function listen(path, on) {
  const end = new AbortController();
  (async () => {
    for (let wait = 500; !end.signal.aborted; wait = Math.min(wait * 2, 10000)) {
      try {
        const answer = await ask('GET', path, { signal: end.signal });
        on.state?.(true);
        wait = 500;
        await read(answer.body, on);
        on.state?.(false);
      } catch (error) {
        if (end.signal.aborted) return;
        on.state?.(false, error);
        if (error instanceof Refused && error.status < 500 && error.status !== 429) return;
      }
      await new Promise((go) => setTimeout(go, wait));
    }
  })();
  return () => end.abort();
}

async function read(body, on) {
  const reader = body.pipeThrough(new TextDecoderStream()).getReader();
  let text = '';
  for (;;) {
    const { value, done } = await reader.read();
    if (done) return;
    text += value;
    const events = text.split('\n\n');
    text = events.pop();
    for (const event of events) deliver(event, on);
  }
}

function deliver(event, on) {
  let name = 'message';
  let data = '';
  for (const line of event.split('\n')) {
    if (line.startsWith('event:')) name = line.slice(6).trim();
    if (line.startsWith('data:')) data += line.slice(5);
  }
  if (data) on[name]?.(JSON.parse(data));
}
