// What is known of the gateway: fetched once, then kept up by its events.

import * as api from './api.js';

export const links = new Map();
export const jobs = new Map();
export const journal = [];
export let programs = [];
export let plugins = [];
export const receptions = new Map();
export let role = 'viewer';
/** Whether there are any of what few gateways have. */
export const has = { buses: false, cells: false };

/** What a link did in each of the last seconds. */
export const levels = new Map();
const LEVELS = 150;
const MOST_JOBS = 300;
const MOST_ENTRIES = 300;
/** Beyond so many links their news come once a second. */
const MANY = 50;

const watchers = new Set();
/** Links that have changed since the watchers were called. */
let news = new Set();
let pending = false;

/** Whether the token may order something. */
export const mayAct = () => role !== 'viewer';
export const isAdmin = () => role === 'admin';

/** Calls `watcher` with the names of links that have changed, at most once a frame; returns what ends it. */
export function watch(watcher) {
  watchers.add(watcher);
  return () => watchers.delete(watcher);
}

export function changed() {
  if (pending) return;
  pending = true;
  setTimeout(() => {
    pending = false;
    const names = news;
    news = new Set();
    for (const watcher of watchers) watcher(names);
  }, 50);
}

const collator = new Intl.Collator('en', { numeric: true });
export const inOrder = collator.compare;
let order = null;

/** All links in the order of their names. */
export function sorted() {
  order ??= [...links.keys()].sort(inOrder);
  return order.map((name) => links.get(name));
}

function keepLink(link) {
  if (!links.has(link.name)) order = null;
  links.set(link.name, link);
  news.add(link.name);
}

function dropLink(name) {
  links.delete(name);
  levels.delete(name);
  order = null;
  news.add(name);
}

export const newestJobs = () => [...jobs.values()].sort((a, b) => b.id - a.id);
export const groups = () => [...new Set([...links.values()].map((link) => link.group).filter(Boolean))].sort(inOrder);

/** Links first: the rest comes while they are shown already. */
export async function load() {
  const lists = ['/jobs?limit=200', '/programs', '/plugins', '/journal?limit=200', '/buses', '/cells'];
  const rest = Promise.all(lists.map((path) => api.get(path)));
  rest.catch(() => {});
  const [me, allLinks] = await Promise.all([api.me(), api.get('/links')]);
  role = me.role;
  links.clear();
  order = null;
  for (const link of allLinks) keepLink(link);
  receptions.clear();
  changed();
  rest.then(([someJobs, allPrograms, allPlugins, entries, buses, cells]) => {
    has.buses = buses.length > 0;
    has.cells = cells.length > 0;
    jobs.clear();
    for (const job of someJobs) jobs.set(job.id, job);
    journal.splice(0, Infinity, ...entries);
    programs = allPrograms;
    plugins = allPlugins;
    changed();
  }, () => {});
}

export async function loadReceptions(link) {
  receptions.set(link, await api.get(`/links/${api.part(link)}/receptions`));
  changed();
}

/** Something came back from an action: it counts as news. */
export function took(view) {
  if (view && 'kind' in view && 'id' in view) keepJob(view);
  else if (view && 'port' in view) keepLink(view);
  changed();
}

/** The last block that left is found out for one job at a time only: it stays known. */
function keepJob(job) {
  jobs.set(job.id, { ...job, last_block: job.last_block ?? jobs.get(job.id)?.last_block ?? null });
}

const heed = {
  link: keepLink,
  'link-removed': (change) => dropLink(change.name),
  job: keepJob,
  journal: (change) => journal.unshift(change),
  programs: async () => { programs = await api.get('/programs'); },
  receptions: (change) => receptions.has(change.link) && loadReceptions(change.link),
  plugins: async () => { plugins = await api.get('/plugins'); },
  stopping: () => {},
};

/** Follows the gateway; `state` is told when the connection comes and goes. */
export function follow(state) {
  let first = true;
  const path = links.size > MANY ? '/events?apart_ms=1000' : '/events';
  return api.listen(path, {
    state: async (isConnected, error) => {
      // What happened while we were not connected is not told again.
      if (isConnected && !first) await load().catch(() => {});
      first = false;
      state(isConnected, error);
    },
    changes: async (changes) => {
      for (const change of changes) await heed[change.change]?.(change);
      if (jobs.size > MOST_JOBS) for (const id of [...jobs.keys()].sort((a, b) => b - a).slice(MOST_JOBS)) jobs.delete(id);
      journal.splice(MOST_ENTRIES);
      changed();
    },
    missed: () => load().catch(() => {}),
  });
}

/** What the gateway kept of a link's last seconds is put before what was seen here; once for each link. */
export async function recall(name) {
  if (levels.has(name)) return;
  levels.set(name, []);
  const { seconds } = await api.get(`/links/${api.part(name)}/history`);
  const kept = seconds.level.map((level, at) => ({ level, isHeld: seconds.held_ms[at] > 0 }));
  levels.set(name, [...kept, ...(levels.get(name) ?? [])].slice(-LEVELS));
  news.add(name);
  changed();
}

/** Only of links whose levels somebody wants to see. */
setInterval(() => {
  for (const [name, of] of levels) {
    const link = links.get(name);
    if (!link) continue;
    of.push({ level: link.buffer.level, isHeld: link.is_held });
    of.splice(0, of.length - LEVELS);
    news.add(name);
  }
  if (levels.size) changed();
}, 1000);
