#!/usr/bin/env python3
"""A host for Softplug plug-ins: loads one, gives it events, checks what it answers.

Needs `pip install wasmtime`. As a command it replays what `softplug replay --calls` wrote:
python3 host.py PLUGIN.wasm CALLS.jsonl. The contract is docs/abi.md.
SPDX-License-Identifier: MIT OR Apache-2.0
"""
import json
import struct
import sys

import wasmtime

FUEL, ROUNDS, MORE, CONTINUE = 1_000_000, 256, 0x40000000, 24
# What came after WebAssembly 1.0, as far as this engine can turn it off; `softplug inspect` refuses the rest.
FEATURES = "relaxed_simd simd threads tail_call multi_memory memory64 multi_value"


class Refused(Exception):
    """The file is no plug-in."""


class Poisoned(Exception):
    """The instance has ended and takes no more events."""


def require(holds, sentence):
    if not holds:
        raise Refused(sentence)


def sections(module):
    """The sections of a module as (id, content)."""
    at = 8
    while at < len(module):
        kind, length, shift = module[at], 0, 0
        while shift == 0 or module[at] >= 0x80:
            at, length, shift = at + 1, length | (module[at + 1] & 0x7F) << shift, shift + 7
        at += 1 + length
        yield kind, module[at - length:at]


def load(wasm):
    """Checks that a module is a plug-in and compiles it; returns engine, module and manifest."""
    require(len(wasm) <= 256 * 1024, "the file is larger than 256 KiB")
    require(wasm.startswith(b"\0asm"), "it is no WebAssembly module")
    config = wasmtime.Config()
    config.consume_fuel = config.cranelift_nan_canonicalization = True
    for feature in FEATURES.split():
        setattr(config, "wasm_" + feature, False)
    engine = wasmtime.Engine(config)
    try:
        module = wasmtime.Module(engine, wasm)
    except wasmtime.WasmtimeError as error:
        raise Refused(f"it is no WebAssembly 1.0 module: {error}") from error
    require(not module.imports, "it imports something")
    require(all(kind != 8 for kind, _ in sections(wasm)), "it has a start function")
    exports = {export.name: export.type for export in module.exports}
    memory = exports.pop("memory", None)
    require(isinstance(memory, wasmtime.MemoryType), "it exports no memory")
    pages = memory.limits
    require(pages.min == pages.max and 1 <= pages.min <= 4, "its memory can grow, or is not of 1 to 4 pages")
    for name, shape in (("softplug_v1", "-> i32"), ("softplug_v1_step", "i32 i32 i64 -> i32")):
        found = exports.pop(name, None)
        require(isinstance(found, wasmtime.FuncType), f"it exports no function {name}")
        words = [*map(str, found.params), "->", *map(str, found.results)]
        require(words == shape.split(), f"the function {name} must be {shape}")
    immutable = (isinstance(t, wasmtime.GlobalType) and not t.mutable for t in exports.values())
    require(all(immutable), "it exports something else")
    name = b"\x11softplug.manifest"
    manifests = [body[18:] for kind, body in sections(wasm) if kind == 0 and body.startswith(name)]
    require(len(manifests) == 1, "it has no manifest, or several")
    return engine, module, json.loads(manifests[0])


class Session:
    """One running instance. After `Poisoned` only `last_words` still means something."""

    def __init__(self, engine, module):
        self.store, self.poison = wasmtime.Store(engine), None
        self.store.set_fuel(FUEL)
        exports = wasmtime.Instance(self.store, module, []).exports(self.store)
        self.memory, self.function = exports["memory"], exports["softplug_v1_step"]
        mailbox = struct.unpack("<6I", self.read(exports["softplug_v1"](self.store) & 0xFFFFFFFF, 24))
        regions = list(zip(mailbox[0::2], mailbox[1::2]))
        self.input, self.output, self.words = regions
        limits = ((512, 32768), (512, 32768), (64, 1024))
        for (_, size), (least, most) in zip(regions, limits):
            require(least <= size <= most, "a region of the mailbox is too short or too long")
        ends = [0, *(at + size for at, size in sorted(regions))]
        require(all(end <= at for end, (at, _) in zip(ends, sorted(regions)))
                and ends[-1] <= self.memory.data_len(self.store), "the mailbox overlaps or leaves the memory")

    def read(self, at, length):
        return bytes(self.memory.read(self.store, at, at + length))

    def last_words(self):
        """What the plug-in said as it trapped, or None."""
        at, size = self.words
        length = min(struct.unpack("<I", self.read(at, 4))[0], size - 4)
        return self.read(at + 4, length).decode(errors="replace") if length else None

    def end(self, reason):
        self.poison = reason
        raise Poisoned(reason)

    def step(self, kind, payload, now):
        """One call, with fresh fuel: its result and the action records that it wrote."""
        if self.poison:
            raise Poisoned(self.poison)
        if len(payload) > self.input[1]:
            raise ValueError("the event is longer than the plug-in's input buffer")
        self.memory.write(self.store, payload, self.input[0])
        self.store.set_fuel(FUEL)
        try:
            result = self.function(self.store, kind, len(payload), now)
        except (wasmtime.Trap, wasmtime.WasmtimeError) as trap:
            self.end(f"it trapped: {trap}")
        length = result & ~MORE if result > 0 else 0
        if result < -4 or length > self.output[1]:
            self.end(f"it returned {result}")
        actions = self.read(self.output[0], length)
        at = 0
        while at < length:  # whole records of known kinds; a real host carries them out here
            kind, size = struct.unpack_from("<HH", actions + bytes(4), at)
            at += 4 + size
            if not 1 <= kind <= 22 or at > length:
                self.end("it wrote a malformed action")
        return result, actions

    def event(self, kind, payload, now):
        """An event and every round of its output, as (result, actions)."""
        for _ in range(1 + ROUNDS):
            result, actions = self.step(kind, payload, now)
            yield result, actions
            if result < 0 or not result & MORE:
                return
            kind, payload = CONTINUE, b""
        self.end("it does not stop writing")


def replay(engine, module, calls):
    """Plays recorded calls; returns the first difference, or None."""
    sessions, rounds = {}, {}
    for call in calls:
        number = call["instance"]
        if "calls" in call:
            sessions[number] = Session(engine, module)
            continue
        session = sessions[number]
        try:
            if call["kind"] != CONTINUE:
                rounds[number] = session.event(call["kind"], bytes.fromhex(call["payload"]), call["now"])
            result, actions = next(rounds[number], (0, b""))
            seen = {"result": result, "actions": actions.hex()}
            same = all(call.get(key) == value for key, value in seen.items())
        except Poisoned as fault:
            seen = {"fault": str(fault), "last_words": session.last_words()}
            same = "fault" in call and call.get("last_words") == seen["last_words"]
        if not same:
            return f"expected {json.dumps(call)}, got {json.dumps(seen)}"
    return None


def main():
    if len(sys.argv) != 3:
        sys.exit("usage: host.py PLUGIN.wasm CALLS.jsonl")
    with open(sys.argv[1], "rb") as plugin, open(sys.argv[2], encoding="utf-8") as file:
        engine, module, _ = load(plugin.read())
        calls = [json.loads(line) for line in file]
    difference = replay(engine, module, calls)
    count = sum("kind" in call for call in calls)
    print(difference or f"{count} calls, identical")
    sys.exit(1 if difference else 0)


if __name__ == "__main__":
    main()
