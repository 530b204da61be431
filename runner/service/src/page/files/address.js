// What is asked for in the address: #/links?group=Hall%201&sort=state. A page that is reloaded, or whose address is sent
// to somebody, shows the same.

/** The page, its argument and what is asked of it. */
export function read() {
  const [path, query = ''] = location.hash.replace(/^#\/?/, '').split('?', 2);
  const [name, ...rest] = path.split('/');
  let argument;
  try {
    argument = rest.length ? decodeURIComponent(rest.join('/')) : undefined;
  } catch {
    argument = rest.join('/');
  }
  return { name: name || 'links', argument, query: new URLSearchParams(query) };
}

/** An address of a page. Empty values are left out. */
export function to(name, values = {}) {
  const query = new URLSearchParams(Object.entries(values).filter(([, value]) => value !== '' && value !== null && value !== undefined));
  const text = query.toString();
  return `#/${name}${text ? `?${text}` : ''}`;
}

/** The page of a link. */
export const toLink = (name) => `#/link/${encodeURIComponent(name)}`;

/** Changes what is asked for, without showing the page anew. */
export function ask(name, values) {
  const hash = to(name, values);
  if (location.hash !== hash) history.replaceState(null, '', hash);
}
