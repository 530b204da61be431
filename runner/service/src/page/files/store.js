// What is known of the gateway: fetched once, then kept up by its events.

import * as api from './api.js';

export const links = new Map();
export const jobs = new Map();
export const journal = [];
export let programs = [];
export let plugins = [];
export const receptions = new Map();
export let role = 'operator';

/** Levels of a link's buffer: one for each second of the last minutes. */
export const levels = new Map();
const LEVELS = 150;
const MOST_JOBS = 300;
const MOST_ENTRIES = 300;

const watchers = new Set();
let pending = false;

/** Calls `watcher` when something has changed, at most once a frame; returns what ends it. */
export function watch(watcher) {
  watchers.add(watcher);
  return () => watchers.delete(watcher);
}

export function changed() {
  if (pending) return;
  pending = true;
  setTimeout(() => {
    pending = false;
    for (const watcher of watchers) watcher();
  }, 50);
}

export const sorted = () => [...links.values()].sort((a, b) => a.name.localeCompare(b.name, 'en', { numeric: true }));
export const newestJobs = () => [...jobs.values()].sort((a, b) => b.id - a.id);

export async function load() {
  const [me, allLinks, someJobs, allPrograms, allPlugins, entries] = await Promise.all([
    api.me(), api.get('/links'), api.get('/jobs?limit=200'), api.get('/programs'), api.get('/plugins'),
    api.get('/journal?limit=200'),
  ]);
  role = me.role;
  links.clear();
  for (const link of allLinks) links.set(link.name, link);
  jobs.clear();
  for (const job of someJobs) jobs.set(job.id, job);
  journal.splice(0, Infinity, ...entries);
  programs = allPrograms;
  plugins = allPlugins;
  receptions.clear();
  changed();
}

export async function loadReceptions(link) {
  receptions.set(link, await api.get(`/links/${api.part(link)}/receptions`));
  changed();
}

/** Something came back from an action: it counts as news. */
export function took(view) {
  if (view && 'kind' in view && 'id' in view) keepJob(view);
  else if (view && 'port' in view) links.set(view.name, view);
  changed();
}

/** The last block that left is found out for one job at a time only: it stays known. */
function keepJob(job) {
  jobs.set(job.id, { ...job, last_block: job.last_block ?? jobs.get(job.id)?.last_block ?? null });
}

const news = {
  link: (change) => links.set(change.name, change),
  'link-removed': (change) => links.delete(change.name),
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
  return api.listen('/events', {
    state: async (isConnected, error) => {
      // What happened while we were not connected is not told again.
      if (isConnected && !first) await load().catch(() => {});
      first = false;
      state(isConnected, error);
    },
    changes: async (changes) => {
      for (const change of changes) await news[change.change]?.(change);
      for (const id of [...jobs.keys()].sort((a, b) => b - a).slice(MOST_JOBS)) jobs.delete(id);
      journal.splice(MOST_ENTRIES);
      changed();
    },
    missed: () => load().catch(() => {}),
  });
}

setInterval(() => {
  for (const link of links.values()) {
    const of = levels.get(link.name) ?? [];
    of.push({ level: link.buffer.level, isHeld: link.is_held, isSending: link.state === 'sending' });
    of.splice(0, of.length - LEVELS);
    levels.set(link.name, of);
  }
  for (const name of levels.keys()) if (!links.has(name)) levels.delete(name);
  if (links.size) changed();
}, 1000);
