// The Softplug ABI, version 1.0, for AssemblyScript without its runtime: no imports, no start
// function, no allocation.
//
// What it does is what sdk/c/softplug.h does; what events, actions, codes and limits mean stands
// in docs/abi.md. A plug-in is one file that imports this one and exports two functions:
//
//     export { softplug_v1 } from "./softplug";
//     export function softplug_v1_step(kind: i32, length: i32, now: i64): i32 {
//         const refusal = begin(kind, <u32>length, now);
//         return finish(refusal < 0 ? refusal : event(kind, <u32>length));
//     }
//
// SPDX-License-Identifier: MIT OR Apache-2.0

/** Events: the first argument of a step. */
export const enum Event {
    Settings = 1,
    Open = 2,
    Close = 3,
    Received = 4,
    LineError = 5,
    ModemLines = 6,
    LinkDown = 7,
    LinkUp = 8,
    Timer = 9,
    Mark = 10,
    TransmitRoom = 11,
    Discarded = 12,
    DeliveryRoom = 13,
    JobBegin = 14,
    JobData = 15,
    JobEnd = 16,
    Pause = 17,
    Resume = 18,
    Abort = 19,
    ForceResume = 20,
    Answer = 21,
    Save = 22,
    Restore = 23,
    Continue = 24,
}

/** Actions: the kinds of the records in the output buffer. */
export const enum Action {
    Transmit = 1,
    TransmitUrgent = 2,
    Hold = 3,
    Release = 4,
    Discard = 5,
    SetTimer = 6,
    CancelTimer = 7,
    ModemLines = 8,
    Break = 9,
    Want = 10,
    DeliveryBegin = 11,
    Deliver = 12,
    DeliveryName = 13,
    DeliveryEnd = 14,
    JobDone = 15,
    JobFailed = 16,
    CheckResult = 17,
    Request = 18,
    Withdraw = 19,
    Note = 20,
    State = 21,
    Saved = 22,
}

/** Why a job or a delivery failed, or a request was refused. 0: it did not. */
export const enum Failure {
    None = 0,
    Aborted = 1,
    NoAnswer = 2,
    Refused = 3,
    LineError = 4,
    Protocol = 5,
    Checksum = 6,
    TooLong = 7,
    UnsupportedCharacter = 8,
    HeldTooLong = 9,
    PartnerReset = 10,
    PartnerAlarm = 11,
    LinkDown = 12,
    PartnerGone = 13,
    Overrun = 14,
    NoEndMark = 15,
    Conflict = 16,
    AttemptsUsedUp = 17,
    BadJob = 18,
    NotSupported = 19,
    Interrupted = 20,
    Busy = 21,
    NotFound = 22,
    Denied = 23,
    Break = 24,
    Echo = 25,
    NoBuffer = 26,
    ParityCheck = 27,
    Internal = 28,
}

/** Why a plug-in does not take an event. */
export const enum Refusal {
    MalformedEvent = -1,
    UnknownEvent = -2,
    Settings = -3,
    State = -4,
}

/** Kinds of line error. */
export const enum LineError {
    Parity = 1,
    Framing = 2,
    ParityOrFraming = 3,
    Overrun = 4,
    Break = 5,
}

/** How far a marked byte has come. */
export const enum Mark {
    MaybeLeft = 1,
    SurelyLeft = 2,
    Dropped = 3,
}

/** Levels of a note. */
export const enum Level {
    Error = 1,
    Warning = 2,
    Info = 3,
    Debug = 4,
}

/** Types of a value record. A plug-in's own table says of a bool and of a choice how many values
 *  there are, in the upper four bits. */
export const enum Value {
    Bool = 1,
    Int = 2,
    Text = 3,
    Bytes = 4,
    Choice = 5,
}

// ---- the mailbox ----

// A plug-in that does much for each character is done in time with so many of them.
export const INPUT_BYTES: u32 = 512;
export const OUTPUT_BYTES: u32 = 4096;
export const WORDS_BYTES: u32 = 64;
const MORE_OUTPUT: i32 = 0x40000000;

// Places in memory, fixed when it is compiled: an object would need an allocation.
// @ts-ignore: decorator
@inline export const INPUT: usize = memory.data(512, 8);
// @ts-ignore: decorator
@inline const OUTPUT: usize = memory.data(4096, 8);
// @ts-ignore: decorator
@inline const WORDS: usize = memory.data(64, 8);
// @ts-ignore: decorator
@inline const MAILBOX: usize = memory.data(24, 8);

export function softplug_v1(): usize {
    store<usize>(MAILBOX, INPUT);
    store<u32>(MAILBOX, INPUT_BYTES, 4);
    store<usize>(MAILBOX, OUTPUT, 8);
    store<u32>(MAILBOX, OUTPUT_BYTES, 12);
    store<usize>(MAILBOX, WORDS, 16);
    store<u32>(MAILBOX, WORDS_BYTES, 20);
    return MAILBOX;
}

/** µs on the link's clock. */
export let now: i64 = 0;
/** Bytes that may be transmitted now. */
export let transmitRoom: u32 = 0;
/** Bytes that may be delivered now. */
export let deliveryRoom: u32 = 0;
/** Bytes of actions so far. */
let written: u32 = 0;
/** The latest record, if it is one that can grow. */
let last: usize = 0;
let more: bool = false;

/** Asks to be called again with `Event.Continue`. */
export function again(): void {
    more = true;
}

// Bit 7: at least so many bytes of payload; else exactly. By the event's number.
// @ts-ignore: decorator
@inline const LENGTHS: usize = memory.data<u8>([
    0, 0x81, 16, 0, 0x81, 8, 2, 1, 0, 9, 5, 4, 4, 4, 0x90, 0x85, 4, 4, 4, 4, 0, 0x88, 0, 0x8c, 0,
]);

/** Begins an event; what it refuses, the plug-in must not see. */
export function begin(kind: i32, length: u32, at: i64): i32 {
    if (kind < Event.Settings || kind > Event.Continue) return Refusal.UnknownEvent;
    const asked = load<u8>(LENGTHS + <usize>kind);
    const fits = asked & 0x80 ? length >= (asked & 0x7f) : length == asked;
    if (length > INPUT_BYTES || !fits) return Refusal.MalformedEvent;
    now = at;
    written = 0;
    last = 0;
    more = false;
    if (kind == Event.Open) {
        transmitRoom = load<u32>(INPUT, 8);
        deliveryRoom = load<u32>(INPUT, 12);
    } else if (kind == Event.TransmitRoom || kind == Event.Discarded) {
        transmitRoom += load<u32>(INPUT);
    } else if (kind == Event.DeliveryRoom) {
        deliveryRoom += load<u32>(INPUT);
    }
    return 0;
}

/** Ends an event: what a step returns. */
export function finish(refusal: i32): i32 {
    return refusal < 0 ? refusal : <i32>written | (more ? MORE_OUTPUT : 0);
}

function copy(to: usize, from: usize, count: u32): void {
    for (let i: u32 = 0; i < count; i++) store<u8>(to + i, load<u8>(from + i));
}

/** A string of ASCII as bytes; strings lie in memory as UTF-16. */
function copyText(to: usize, text: string, count: u32): void {
    const from = changetype<usize>(text);
    for (let i: u32 = 0; i < count; i++) store<u8>(to + i, load<u8>(from + (i << 1)));
}

/** Leaves a sentence of ASCII for the host and ends the instance. */
export function panic(text: string): void {
    const length = min<u32>(text.length, WORDS_BYTES - 4);
    store<u32>(WORDS, length);
    copyText(WORDS + 4, text, length);
    unreachable();
}

// ---- settings ----

/** The longest text or list of bytes among the settings, at least 8. */
export const SETTING_BYTES: u32 = 32;
/** One setting: u32 length, then its bytes; of a bool, int or choice the number. */
export const SETTING_SIZE: u32 = 4 + SETTING_BYTES;

/** How many settings have been given so far. */
export let settingsGiven: u32 = 0;

/** Takes an event `settings` into `table` of `count`; `types` has a byte for each (`Value`). Returns
 *  a refusal or 0; if that is 0 and bit 1 of the payload is set, the table is complete. */
export function takeSettings(table: usize, types: usize, count: u32, length: u32): i32 {
    const flags = load<u8>(INPUT);
    let at: u32 = 1;
    let index: u32 = flags & 1 ? 0 : settingsGiven;
    settingsGiven = 0; // none, if one of these is refused
    for (; at < length; index++) {
        if (length - at < 6) return Refusal.MalformedEvent;
        const record = INPUT + at;
        const size: u32 = load<u16>(record, 4);
        at += 6 + size;
        if (at > length) return Refusal.MalformedEvent;
        if (index >= count) return Refusal.Settings;
        const setting = table + index * SETTING_SIZE;
        const type: u32 = load<u8>(types + index) & 15;
        const choices: u32 = load<u8>(types + index) >> 4;
        if (load<u32>(record) != (index | (type << 16))) return Refusal.Settings;
        const fixed: u32 = type == Value.Bool ? 1 : type == Value.Int ? 8 : type == Value.Choice ? 2 : size;
        if (size != fixed) return Refusal.MalformedEvent;
        if (size > SETTING_BYTES) return Refusal.Settings;
        store<u32>(setting, size);
        store<u32>(setting, 0, 4);
        copy(setting + 4, record + 6, size);
        if (choices != 0 && load<u32>(setting, 4) >= choices) return Refusal.Settings;
    }
    settingsGiven = index;
    return flags & 2 && index != count ? Refusal.Settings : 0;
}

/** Takes an event `restore` into `state`, which was saved as `format` and has `size` bytes. Returns
 *  a refusal, 0 if there is more to come, or 1 when the state is complete. */
export function takeState(state: usize, size: u32, format: u32, length: u32): i32 {
    const offset = load<u32>(INPUT, 4);
    const count = length - 12;
    if (load<u32>(INPUT) != format || load<u32>(INPUT, 8) != size || offset > size || count > size - offset)
        return Refusal.State;
    copy(state + offset, INPUT + 12, count);
    return i32(offset + count == size);
}

// ---- writing actions ----

/** Room for `count` more bytes of actions. */
function reserve(count: u32): usize {
    const at = OUTPUT + written;
    if (count > OUTPUT_BYTES - written) panic("the output buffer is full");
    written += count;
    return at;
}

function put(value: u32): void {
    store<u32>(reserve(4), value);
}

function record(kind: u32, length: u32): void {
    last = 0;
    put(kind | (length << 16));
}

function putBytes(bytes: usize, count: u32): void {
    copy(reserve(count), bytes, count);
}

function numbered(kind: u32, number: u32, bytes: usize, count: u32): void {
    record(kind, 4 + count);
    put(number);
    putBytes(bytes, count);
}

function two(kind: u32, first: u32, second: u32): void {
    record(kind, 8);
    put(first);
    put(second);
}

/** With its neighbour of the same kind and number it becomes one record. */
function append(kind: u32, number: u32, bytes: usize, count: u32): void {
    if (last != 0 && load<u16>(last) == kind && load<u32>(last, 4) == number) {
        store<u32>(last, load<u32>(last) + (count << 16));
        putBytes(bytes, count);
        return;
    }
    const at = OUTPUT + written;
    numbered(kind, number, bytes, count);
    last = at;
}

function take(room: u32, count: u32): u32 {
    if (count > room) panic("more bytes than room");
    return room - count;
}

/** Appends bytes to the transmit queue; nothing for 0 bytes. */
export function transmit(bytes: usize, count: u32): void {
    transmitRoom = take(transmitRoom, count);
    if (count > 0) append(Action.Transmit, 0, bytes, count);
}

/** The same with a mark, not 0: with no bytes, it stands on the last of the queue. */
export function transmitMarked(mark: u32, bytes: usize, count: u32): void {
    transmitRoom = take(transmitRoom, count);
    numbered(Action.Transmit, mark, bytes, count);
}

/** Sends 1 to 16 bytes ahead of queue and hold; mark 0: none. */
export function transmitUrgent(mark: u32, bytes: usize, count: u32): void {
    numbered(Action.TransmitUrgent, mark, bytes, count);
}

/** Stops the transmit queue before its next byte, lets it go on, drops what it holds. */
export function hold(): void {
    record(Action.Hold, 0);
}
export function release(): void {
    record(Action.Release, 0);
}
export function discard(): void {
    record(Action.Discard, 0);
}

/** Sets timer `id` (0 to 15) to an absolute time in µs; the past runs out now. */
export function setTimer(id: i32, deadline: i64): void {
    record(Action.SetTimer, 9);
    store<u8>(reserve(1), <u8>id);
    store<i64>(reserve(8), deadline);
}

export function cancelTimer(id: i32): void {
    record(Action.CancelTimer, 1);
    store<u8>(reserve(1), <u8>id);
}

/** Sets RTS (16) and DTR (32): those in `mask`, on where they are in `on` too. */
export function setModemLines(mask: u8, on: u8): void {
    record(Action.ModemLines, 2);
    store<u8>(reserve(1), mask);
    store<u8>(reserve(1), on);
}

/** Sends a break of 1 to 10,000,000 µs. */
export function sendBreak(micros: u32): void {
    record(Action.Break, 4);
    put(micros);
}

/** Asks for `count` more bytes of the job's data, at least 1. */
export function want(job: u32, count: u32): void {
    two(Action.Want, job, count);
}

/** Begins a delivery under an id of your choice, not 0; `job` that it answers, or 0. */
export function deliveryBegin(delivery: u32, job: u32): void {
    two(Action.DeliveryBegin, delivery, job);
}

/** Hands bytes to the host; nothing for 0 bytes. */
export function deliver(delivery: u32, bytes: usize, count: u32): void {
    deliveryRoom = take(deliveryRoom, count);
    if (count > 0) append(Action.Deliver, delivery, bytes, count);
}

/** Names the delivery: at most 128 bytes of UTF-8. */
export function deliveryName(delivery: u32, name: usize, length: u32): void {
    numbered(Action.DeliveryName, delivery, name, length);
}

/** Ends the delivery; `status` is the protocol's own code. */
export function deliveryEnd(delivery: u32, failure: u32, status: u32): void {
    two(Action.DeliveryEnd, delivery, failure | (status << 16));
}

/** The job is done; so many bytes left for it. */
export function jobDone(job: u32, sent: u64): void {
    record(Action.JobDone, 12);
    put(job);
    store<u64>(reserve(8), sent);
}

/** The job has failed; so many bytes left for it. */
export function jobFailed(job: u32, failure: u32, status: u32, sent: u64): void {
    record(Action.JobFailed, 16);
    put(job);
    put(failure | (status << 16));
    store<u64>(reserve(8), sent);
}

/** The check pass has ended: good with failure 0, else where the fault lies, from 1. */
export function checkResult(job: u32, failure: u32, status: u32, line: u32, column: u32): void {
    record(Action.CheckResult, 16);
    put(job);
    put(failure | (status << 16));
    put(line);
    put(column);
}

/** Asks the host for something of `kind`; `fields` are value records. */
export function request(id: u32, kind: u16, fields: usize, length: u32): void {
    record(Action.Request, 6 + length);
    put(id);
    store<u16>(reserve(2), kind);
    putBytes(fields, length);
}

/** Takes a request back. */
export function withdraw(id: u32): void {
    record(Action.Withdraw, 4);
    put(id);
}

/** A line for the log: at most 240 characters of ASCII. */
export function note(level: u32, code: u32, text: string): void {
    const length: u32 = text.length;
    record(Action.Note, 4 + length);
    put(level | (code << 16));
    copyText(reserve(length), text, length);
}

/** Names the state for people: at most 48 characters of ASCII. */
export function state(name: string): void {
    const length: u32 = name.length;
    record(Action.State, length);
    copyText(reserve(length), name, length);
}

/** A piece of the saved state; asked for by `Event.Save`. */
export function saved(format: u32, offset: u32, total: u32, bytes: usize, count: u32): void {
    record(Action.Saved, 12 + count);
    put(format);
    put(offset);
    put(total);
    putBytes(bytes, count);
}
