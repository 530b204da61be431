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
  receptions.delete(name);
  order = null;
  news.add(name);
}

/** The last block that left is found out for one job at a time only: it stays known. */
function keepJob(job) {
  jobs.set(job.id, { ...job, last_block: job.last_block ?? jobs.get(job.id)?.last_block ?? null });
}

/** How many changes were told; and of each link, by its name, and each job, by its number, which of them was the last. */
let told = 0;
const toldAt = new Map();
const wasToldSince = (key, since) => (toldAt.get(key) ?? 0) > since;

export const newestJobs = () => [...jobs.values()].sort((a, b) => b.id - a.id);
export const groups = () => [...new Set([...links.values()].map((link) => link.group).filter(Boolean))].sort(inOrder);

/** Links first: the rest comes while they are shown already. */
export async function load() {
  for (const part of [loadJobs, loadJournal, loadPrograms, loadPlugins, lookForBusesAndCells]) part().catch(() => {});
  for (const link of receptions.keys()) loadReceptions(link).catch(() => {});
  const [me] = await Promise.all([api.me(), loadLinks()]);
  role = me.role;
  changed();
}

async function lookForBusesAndCells() {
  const [buses, cells] = await Promise.all([api.get('/buses'), api.get('/cells')]);
  has.buses = buses.length > 0;
  has.cells = cells.length > 0;
  changed();
}

const askings = new Map();

/** What is at `path`, or null if it was asked again meanwhile: of two answers that of the later asking stands. */
async function newest(path) {
  const mine = (askings.get(path) ?? 0) + 1;
  askings.set(path, mine);
  const answer = await api.get(path);
  return askings.get(path) === mine ? answer : null;
}

async function loadLinks() {
  const since = told;
  const all = await newest('/links');
  if (!all) return;
  const names = new Set(all.map((link) => link.name));
  for (const name of [...links.keys()]) if (!names.has(name) && !wasToldSince(name, since)) dropLink(name);
  for (const link of all) if (!wasToldSince(link.name, since)) keepLink(link);
  changed();
}

async function loadJobs() {
  const since = told;
  const some = await newest('/jobs?limit=200');
  if (!some) return;
  for (const id of [...jobs.keys()]) if (!wasToldSince(id, since)) jobs.delete(id);
  for (const job of some) if (!wasToldSince(job.id, since)) keepJob(job);
  changed();
}

async function loadJournal() {
  const entries = await newest('/journal?limit=200');
  if (!entries) return;
  const last = entries[0]?.number ?? 0;
  journal.splice(0, Infinity, ...journal.filter((entry) => entry.number > last), ...entries);
  changed();
}

async function loadPrograms() {
  programs = await newest('/programs') ?? programs;
  changed();
}

async function loadPlugins() {
  plugins = await newest('/plugins') ?? plugins;
  changed();
}

export async function loadReceptions(link) {
  const list = await newest(`/links/${api.part(link)}/receptions`);
  if (list) receptions.set(link, list);
  changed();
}

/**
 * Keeps the view of a job or a link that `asked` brings, and returns what it brings. An answer may be overtaken by
 * changes that were told later: they stand then.
 */
export async function took(asked) {
  const since = told;
  const view = await asked;
  if (view && 'kind' in view && 'id' in view) {
    if (!wasToldSince(view.id, since)) keepJob(view);
    else if (view.last_block) keepJob({ ...jobs.get(view.id), last_block: view.last_block });
  } else if (view && 'port' in view && !wasToldSince(view.name, since)) keepLink(view);
  changed();
  return view;
}

const heed = {
  link: keepLink,
  'link-removed': (change) => dropLink(change.name),
  job: keepJob,
  journal: (change) => journal.unshift(change),
  programs: loadPrograms,
  receptions: (change) => receptions.has(change.link) && loadReceptions(change.link),
  plugins: loadPlugins,
  stopping: () => {},
};

/** Takes a change, now: those that were told later are taken later. What it makes us ask for comes when it comes. */
function take(change) {
  told += 1;
  if (change.change === 'job') toldAt.set(change.id, told);
  if (change.change.startsWith('link')) toldAt.set(change.name, told);
  Promise.resolve(heed[change.change]?.(change)).catch(() => {});
}

function forgetOldJobs() {
  if (jobs.size <= MOST_JOBS) return;
  for (const id of [...jobs.keys()].sort((a, b) => b - a).slice(MOST_JOBS)) {
    jobs.delete(id);
    toldAt.delete(id);
  }
}

/** Follows the gateway; `state` is told when the connection comes and goes. */
export function follow(state) {
  const path = links.size > MANY ? '/events?apart_ms=1000' : '/events';
  return api.listen(path, {
    state: async (isConnected, error) => {
      // What happened before is not told.
      if (isConnected) await load().catch(() => {});
      state(isConnected, error);
    },
    changes: (changes) => {
      changes.forEach(take);
      forgetOldJobs();
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
