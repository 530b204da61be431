// A host for Softplug plug-ins in JavaScript, for node and for browsers: loads one, gives it
// events, checks what it answers.
//
// As a command it replays what `softplug replay --calls` wrote: node host.mjs PLUGIN.wasm CALLS.jsonl.
// JavaScript has no fuel: run plug-ins that you do not know in a worker, and end it when it takes too
// long. The contract is docs/abi.md. SPDX-License-Identifier: MIT OR Apache-2.0

const [ROUNDS, MORE, CONTINUE] = [256, 0x40000000, 24];

/** The file is no plug-in. */
export class Refused extends Error {}
/** The instance has ended and takes no more events. */
export class Poisoned extends Error {}

function require(holds, sentence) {
    if (!holds) throw new Refused(sentence);
}

/** The ids of a module's sections. */
function* sections(wasm) {
    for (let at = 8; at < wasm.length; ) {
        yield wasm[at];
        let [length, shift] = [0, 0];
        do {
            length += (wasm[++at] & 0x7f) * 2 ** shift;
            shift += 7;
        } while (wasm[at] >= 0x80);
        at += 1 + length;
    }
}

function refuses(action) {
    try {
        action();
        return false;
    } catch {
        return true;
    }
}

/** Checks that a module is a plug-in and compiles it; returns it with its manifest. */
export function load(wasm) {
    require(wasm.length <= 256 * 1024, "the file is larger than 256 KiB");
    require(WebAssembly.validate(wasm), "it is no WebAssembly module");
    const module = new WebAssembly.Module(wasm);
    require(WebAssembly.Module.imports(module).length === 0, "it imports something");
    require(![...sections(wasm)].includes(8), "it has a start function");
    const exports = new Map(WebAssembly.Module.exports(module).map(({ name, kind }) => [name, kind]));
    const kinds = { memory: "memory", softplug_v1: "function", softplug_v1_step: "function" };
    for (const [name, kind] of Object.entries(kinds)) {
        require(exports.get(name) === kind, `it exports no ${kind} ${name}`);
        exports.delete(name);
    }
    require([...exports.values()].every((kind) => kind === "global"), "it exports something else");
    const manifests = WebAssembly.Module.customSections(module, "softplug.manifest");
    require(manifests.length === 1, "it has no manifest, or several");
    return { module, manifest: JSON.parse(new TextDecoder().decode(manifests[0])) };
}

/** One running instance. After `Poisoned` only `lastWords` still means something. */
export class Session {
    constructor(module) {
        const { memory, softplug_v1, softplug_v1_step } = new WebAssembly.Instance(module, {}).exports;
        const size = memory.buffer.byteLength;
        require(size > 0 && size <= 4 * 65536 && refuses(() => memory.grow(1)), "its memory can grow, or is not of 1 to 4 pages");
        require(softplug_v1.length === 0 && softplug_v1_step.length === 3, "a function has another signature");
        this.function = softplug_v1_step;
        this.bytes = new Uint8Array(memory.buffer);
        this.view = new DataView(memory.buffer);
        const descriptor = softplug_v1() >>> 0;
        require(descriptor + 24 <= size, "the mailbox leaves the memory");
        const word = (index) => this.view.getUint32(descriptor + 4 * index, true);
        const regions = [0, 2, 4].map((index) => ({ at: word(index), size: word(index + 1) }));
        [this.input, this.output, this.words] = regions;
        const [least, most] = [[512, 512, 64], [32768, 32768, 1024]];
        require(regions.every((r, i) => r.size >= least[i] && r.size <= most[i]), "a region of the mailbox is too short or too long");
        let end = 0;
        for (const region of regions.sort((a, b) => a.at - b.at)) {
            require(region.at >= end && region.at + region.size <= size, "the mailbox overlaps or leaves the memory");
            end = region.at + region.size;
        }
    }

    /** What the plug-in said as it trapped, or null. */
    lastWords() {
        const { at, size } = this.words;
        const length = Math.min(this.view.getUint32(at, true), size - 4);
        return length ? new TextDecoder().decode(this.bytes.slice(at + 4, at + 4 + length)) : null;
    }

    end(reason) {
        this.poison = reason;
        throw new Poisoned(reason);
    }

    /** One call: its result and the action records that it wrote. `now` is in µs. */
    step(kind, payload, now) {
        if (this.poison) throw new Poisoned(this.poison);
        if (payload.length > this.input.size) throw new RangeError("the event is longer than the plug-in's input buffer");
        this.bytes.set(payload, this.input.at);
        let result;
        try {
            result = this.function(kind, payload.length, BigInt(now));
        } catch (trap) {
            this.end(`it trapped: ${trap.message}`);
        }
        const length = result > 0 ? result & ~MORE : 0;
        if (result < -4 || length > this.output.size) this.end(`it returned ${result}`);
        // Whole records of known kinds; a real host carries them out here.
        for (let at = this.output.at, end = at + length; at < end; ) {
            const kind = this.view.getUint16(at, true);
            if (kind < 1 || kind > 22 || at + 4 > end) this.end("it wrote a malformed action");
            at += 4 + this.view.getUint16(at + 2, true);
            if (at > end) this.end("it wrote a malformed action");
        }
        return { result, actions: this.bytes.slice(this.output.at, this.output.at + length) };
    }

    /** An event and every round of its output. */
    *event(kind, payload, now) {
        for (let round = 0; round <= ROUNDS; round++) {
            const { result, actions } = this.step(kind, payload, now);
            yield { result, actions };
            if (result < 0 || !(result & MORE)) return;
            [kind, payload] = [CONTINUE, new Uint8Array()];
        }
        this.end("it does not stop writing");
    }
}

const fromHex = (text) => Uint8Array.from(text.match(/../g) ?? [], (pair) => parseInt(pair, 16));
const toHex = (bytes) => [...bytes].map((byte) => byte.toString(16).padStart(2, "0")).join("");

/** Plays recorded calls; returns the first difference, or null. */
export function replay(module, calls) {
    const [sessions, rounds] = [[], []];
    for (const call of calls) {
        const number = call.instance;
        if ("calls" in call) {
            sessions[number] = new Session(module);
            continue;
        }
        const session = sessions[number];
        let seen, same;
        try {
            if (call.kind !== CONTINUE) rounds[number] = session.event(call.kind, fromHex(call.payload), call.now);
            const { result, actions } = rounds[number].next().value ?? { result: 0, actions: [] };
            seen = { result, actions: toHex(actions) };
            same = seen.result === call.result && seen.actions === call.actions;
        } catch (fault) {
            if (!(fault instanceof Poisoned)) throw fault;
            seen = { fault: fault.message, last_words: session.lastWords() };
            same = "fault" in call && seen.last_words === (call.last_words ?? null);
        }
        if (!same) return `expected ${JSON.stringify(call)}, got ${JSON.stringify(seen)}`;
    }
    return null;
}

// As a module, in node or in a browser, it does nothing by itself.
if (globalThis.process?.argv[1]?.endsWith("host.mjs")) {
    const { readFileSync } = await import("node:fs");
    const [plugin, file] = process.argv.slice(2);
    if (!file) throw new Error("usage: host.mjs PLUGIN.wasm CALLS.jsonl");
    const calls = readFileSync(file, "utf8").trim().split("\n").map((line) => JSON.parse(line));
    const difference = replay(load(readFileSync(plugin)).module, calls);
    console.log(difference ?? `${calls.filter((call) => "kind" in call).length} calls, identical`);
    process.exitCode = difference ? 1 : 0;
}
