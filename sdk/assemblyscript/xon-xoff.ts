// XON/XOFF in both directions, in AssemblyScript: does what plugins/xon-xoff does in Rust, byte for
// byte.
//
// The protocol's page is docs/protocols/xon-xoff.md.
//
// SPDX-License-Identifier: MIT OR Apache-2.0
import * as link from "./softplug";
import { Action, Event, Failure, INPUT, Level, LineError, Mark, Refusal, SETTING_BYTES, SETTING_SIZE } from "./softplug";

export { softplug_v1 } from "./softplug";

export function softplug_v1_step(kind: i32, length: i32, now: i64): i32 {
    const refusal = link.begin(kind, <u32>length, now);
    return link.finish(refusal < 0 ? refusal : event(kind, <u32>length));
}

// ---- settings, in the manifest's order ----

const enum Setting {
    Xon,
    Xoff,
    WaitForXon,
    HeldTimeout,
    ControlInData,
    WhileSending,
    Speak,
    LowMark,
    HighMark,
    XonAtOpen,
    QuietTime,
    OnLineError,
    ParityMask,
    FeedStart,
    FeedEnd,
    AbortSend,
    SendLineEnd,
    SendDrop,
    Transparent,
    Escape,
    EscapeXor,
    XonRepeat,
    XoffRepeat,
    ReceiveLineEnd,
    ReceiveDrop,
    EndMark,
    EndMarkCount,
    EndQuiet,
    Count,
}

// 0x21 a bool, 2 an int, 4 bytes, 0x25 a choice of two, 0x35 of three, 0x55 of five.
// @ts-ignore: decorator
@inline const TYPES: usize = memory.data<u8>([
    2, 2, 0x21, 2, 0x35, 0x25, 0x21, 2, 2, 0x21, 2, 0x25, 2, 4, 4, 4, 0x55, 4, 0x21, 2, 2, 2, 2, 0x55, 4, 4, 2, 2,
]);
// @ts-ignore: decorator
@inline const SETTINGS: usize = memory.data(1008, 8); // Setting.Count * SETTING_SIZE

/** How lines end. */
const enum LineEnd {
    Keep,
    Lf,
    Cr,
    CrLf,
    LfCrCr,
}

/** Control bytes in a program. */
const enum Control {
    Refuse,
    Drop,
    Send,
}

// @ts-ignore: decorator
@inline function number(which: i32): i32 {
    return load<i32>(SETTINGS + <usize>which * SETTING_SIZE, 4);
}

// @ts-ignore: decorator
@inline function byteOf(which: i32): u8 {
    return load<u8>(SETTINGS + <usize>which * SETTING_SIZE, 4);
}

// @ts-ignore: decorator
@inline function lengthOf(which: i32): u32 {
    return load<u32>(SETTINGS + <usize>which * SETTING_SIZE);
}

// @ts-ignore: decorator
@inline function bytesOf(which: i32): usize {
    return SETTINGS + <usize>which * SETTING_SIZE + 4;
}

// Bytes that are dropped, a bit each: to look for each byte in a list takes too long.
// @ts-ignore: decorator
@inline const SEND_DROPS: usize = memory.data(32);
// @ts-ignore: decorator
@inline const RECEIVE_DROPS: usize = memory.data(32);

function makeSet(set: usize, which: i32): void {
    memory.fill(set, 0, 32);
    for (let i: u32 = 0; i < lengthOf(which); i++) {
        const byte = load<u8>(bytesOf(which) + i);
        store<u8>(set + (byte >> 3), load<u8>(set + (byte >> 3)) | (<u8>1 << (byte & 7)));
    }
}

// @ts-ignore: decorator
@inline function contains(set: usize, byte: u8): bool {
    return ((load<u8>(set + (byte >> 3)) >> (byte & 7)) & 1) != 0;
}

// ---- what is kept between two events; all of it is saved and restored ----

/** What the sender is at. */
const enum Stage {
    Idle,
    Checking,
    Feeding,
    Closing,
    Draining,
    Stopping,
}

/** Where in a line end a reader is. */
const enum Line {
    Within,
    AfterCr,
    AfterLf,
    AfterLfCr,
}

/** Timers: silence, a repeated XON, a hold that lasts too long. */
const enum Timer {
    Quiet,
    RepeatXon,
    Held,
    Count,
}

const NEVER: i64 = -1;

@unmanaged
class State {
    quietTimer: i64; // deadlines by the timer's number, or NEVER
    repeatTimer: i64;
    heldTimer: i64;
    queued: u64; // bytes queued for the job
    xoffAt: i64;
    job: u32;
    wanted: u32; // asked for and not yet given
    unqueued: u32; // bytes of the feed's strings that found no room yet
    line: u32;
    column: u32;
    delivery: u32;
    lastDelivery: u32;
    markProgress: u32;
    marksSeen: u32;
    afterXoff: u32; // characters since our XOFF, those of its own time left out
    low: u32;
    high: u32;
    stage: i32;
    stopping: i32; // why the job fails once the queue is dropped
    sendLines: i32;
    receiveLines: i32;
    failure: i32; // why the delivery under way cannot end well
    held: bool; // the partner has sent XOFF, and no XON since
    waitsForXon: bool; // the first XON of the job has not come
    paused: bool;
    holding: bool; // the queue is held for any of these reasons
    escaped: bool;
    stopped: bool; // we have sent XOFF, and no XON since
    xonUnanswered: bool; // nothing came since our XON
    leaving: bool; // a control byte of ours has not left yet
    heard: bool; // something came in the event under way
}

// @ts-ignore: decorator
@inline const STATE: usize = memory.data(128, 8);
const STATE_BYTES: u32 = offsetof<State>();
// @ts-ignore: decorator
@inline const s: State = changetype<State>(STATE);

/** The state that the host knows; not saved: a restored plug-in tells it anew. */
let named: usize = 0;
let isOpen: bool = false;
/** What follows from control bytes is done behind the last of their event, of which there may be a thousand. */
let isHearing: bool = false;

/** Where bytes are made: a pair of escape and byte, or a line end. */
// @ts-ignore: decorator
@inline const MADE: usize = memory.data(4);
/** What `mapLine` made of a byte. */
let mapped: usize = 0;

function setTimer(id: i32, at: i64): void {
    const deadline = STATE + (<usize>id << 3);
    if (load<i64>(deadline) == at) return;
    store<i64>(deadline, at);
    if (isHearing && id == Timer.Held) return;
    if (at == NEVER) link.cancelTimer(id);
    else link.setTimer(id, at);
}

function after(millis: i32): i64 {
    return link.now + <i64>millis * 1000;
}

// ---- codes ----

function isLike(byte: u8, which: i32): bool {
    return ((byte ^ byteOf(which)) & byteOf(Setting.ParityMask)) == 0;
}

/** Xoff, Xon, or Count for a byte that is neither. */
function control(byte: u8): i32 {
    return isLike(byte, Setting.Xoff) ? Setting.Xoff : isLike(byte, Setting.Xon) ? Setting.Xon : Setting.Count;
}

/** Whether a data byte must be escaped: controls with either parity bit, the escape itself. */
function mustEscape(byte: u8): bool {
    return (
        byte == byteOf(Setting.Escape) ||
        ((byte ^ byteOf(Setting.Xon)) & 0x7f) == 0 ||
        ((byte ^ byteOf(Setting.Xoff)) & 0x7f) == 0
    );
}

/**
 * Says ahead of all else whether the partner may send, or as soon as what was said before has left:
 * a partner that sends faster than the line cannot make more of them wait.
 */
function say(): void {
    if (s.leaving) return;
    s.leaving = true;
    const which: i32 = toSay();
    // Its mark tells which one has left. The mark of a job is its id.
    link.transmitUrgent(~which, bytesOf(which), 1); // the lowest byte of its number
}

function toSay(): i32 {
    return s.stopped ? Setting.Xoff : Setting.Xon;
}

/** Bytes of a line end of three bytes at most, with their number in the highest byte. */
function lineEnd(form: i32): u32 {
    if (form == LineEnd.Lf) return 0x0100000a;
    if (form == LineEnd.Cr) return 0x0100000d;
    return form == LineEnd.CrLf ? 0x02000a0d : 0x030d0d0a;
}

/** Puts what the byte at `at` becomes at `mapped`; returns its length. Reads line ends over any
 *  cut: LF, CR LF, CR, LF CR and LF CR CR are each one. `reader` is where the reader's state is. */
function mapLine(reader: usize, form: i32, at: usize): u32 {
    mapped = at;
    if (form == LineEnd.Keep) return 1;
    const byte = load<u8>(at);
    const before = load<i32>(reader);
    const current = byte == 0x0a ? Line.AfterLf : byte == 0x0d ? Line.AfterCr : Line.Within;
    store<i32>(reader, current);
    if (current == Line.Within) return 1;
    if (byte == 0x0d && before == Line.AfterLf) {
        store<i32>(reader, Line.AfterLfCr);
        return 0;
    }
    if (before == (byte == 0x0a ? Line.AfterCr : Line.AfterLfCr)) {
        store<i32>(reader, Line.Within);
        return 0;
    }
    mapped = MADE;
    const end = lineEnd(form);
    store<u32>(MADE, end);
    return end >> 24;
}

// ---- the sender ----

function updateHold(): void {
    const holding = s.held || s.waitsForXon || s.paused;
    if (holding == s.holding || isHearing) return;
    s.holding = holding;
    if (holding) link.hold();
    else link.release();
}

/** The partner's hold is over. A job still waits for its first XON. */
function released(): void {
    s.held = false;
    setTimer(Timer.Held, NEVER);
    updateHold();
}

function forgetHold(): void {
    s.waitsForXon = false;
    released();
}

function isFeeding(): bool {
    return s.stage >= Stage.Feeding && s.stage <= Stage.Draining;
}

/** A hold is timed only while there is a job to fail. */
function watchHold(): void {
    if (s.held && isFeeding() && number(Setting.HeldTimeout) > 0)
        setTimer(Timer.Held, after(number(Setting.HeldTimeout)));
}

function queue(bytes: usize, count: u32): void {
    s.queued += count;
    link.transmit(bytes, count);
}

/** What belonged to the job alone ends with it; a partner's XOFF stays. */
function finish(): void {
    s.stage = Stage.Idle;
    s.paused = false;
    s.waitsForXon = false;
    s.wanted = 0;
    s.unqueued = 0;
    setTimer(Timer.Held, NEVER);
    updateHold();
}

/** Stops at once and drops what is queued; the job fails when it is known how much that was. */
function stop(failure: i32): void {
    if (isFeeding()) {
        link.discard();
        s.unqueued = 0;
        s.stage = Stage.Stopping;
        s.stopping = failure;
    } else if (s.stage == Stage.Checking) {
        link.jobFailed(s.job, failure, 0, 0);
        finish();
    }
}

function discarded(bytes: u32): void {
    if (s.stage != Stage.Stopping) return;
    // What an abort before this one sent may have waited still, and is among these bytes.
    const ofJob = <u32>min<u64>(bytes, s.queued);
    link.jobFailed(s.job, s.stopping, 0, s.queued - ofJob);
    const length = lengthOf(Setting.AbortSend);
    const words = s.stopping == Failure.Aborted ? length : min<u32>(bytes - ofJob, length);
    if (words > 0 && words <= link.transmitRoom)
        link.transmit(bytesOf(Setting.AbortSend) + length - words, words);
    finish();
}

/** Asks for as much as can be queued whatever it grows to, the feed's end kept in reserve. */
function ask(): void {
    let most: u32 = 3072;
    if (s.stage == Stage.Feeding) {
        const room = link.transmitRoom;
        most = min<u32>(most, room - min<u32>(room, lengthOf(Setting.FeedEnd)));
        const form = number(Setting.SendLineEnd);
        const longest: u32 = form == LineEnd.LfCrCr ? 3 : form == LineEnd.CrLf ? 2 : 1;
        most /= longest << number(Setting.Transparent);
    } else if (s.stage != Stage.Checking) {
        return;
    }
    // Small requests would make many small events.
    if (most > s.wanted && (most - s.wanted >= most / 4 || s.wanted == 0)) {
        link.want(s.job, most - s.wanted);
        s.wanted = most;
    }
}

/** Queues of the strings around the program what there is room for. */
function queueStrings(): void {
    const start = lengthOf(Setting.FeedStart);
    const end: u32 = s.stage == Stage.Closing ? lengthOf(Setting.FeedEnd) : 0;
    // Of a state that was saved under other settings too much may wait.
    s.unqueued = min<u32>(s.unqueued, start + end);
    for (; s.unqueued > 0 && link.transmitRoom > 0; s.unqueued--) {
        const at = start + end - s.unqueued;
        queue(at < start ? bytesOf(Setting.FeedStart) + at : bytesOf(Setting.FeedEnd) + at - start, 1);
    }
    if (s.stage == Stage.Closing && s.unqueued == 0) {
        link.transmitMarked(s.job, 0, 0);
        s.stage = Stage.Draining;
    }
}

/** Does what there is room for. */
function goOn(): void {
    queueStrings();
    if (s.unqueued == 0) ask();
}

function jobBegin(): void {
    const job = load<u32>(INPUT);
    if (s.stage != Stage.Idle || load<u16>(INPUT, 4) != 0) {
        link.jobFailed(job, s.stage != Stage.Idle ? Failure.Busy : Failure.NotSupported, 0, 0);
        return;
    }
    s.job = job;
    s.wanted = 0;
    s.queued = 0;
    s.sendLines = Line.Within;
    s.line = 1;
    s.column = 0;
    s.stage = Stage.Checking;
    if (load<u8>(INPUT, 6) == 0) {
        s.stage = Stage.Feeding;
        s.waitsForXon = number(Setting.WaitForXon) != 0;
        updateHold();
        watchHold();
        s.unqueued = lengthOf(Setting.FeedStart);
    }
    goOn();
}

/** What becomes of a byte of a program. */
function fate(byte: u8): i32 {
    if (contains(SEND_DROPS, byte)) return Control.Drop;
    if (number(Setting.Transparent) || control(byte) == Setting.Count) return Control.Send;
    return number(Setting.ControlInData);
}

function feed(at: usize): void {
    const count = mapLine(STATE + offsetof<State>("sendLines"), number(Setting.SendLineEnd), at);
    if (!number(Setting.Transparent)) {
        queue(mapped, count);
        return;
    }
    // A byte of a line end is read before its escaped form is written over it.
    const bytes = mapped == MADE ? load<u32>(MADE) : <u32>load<u8>(at);
    for (let i: u32 = 0; i < count; i++) {
        const byte = <u8>(bytes >> (i << 3));
        const escapes = mustEscape(byte);
        store<u8>(MADE, escapes ? byteOf(Setting.Escape) : byte);
        store<u8>(MADE, byte ^ byteOf(Setting.EscapeXor), 1);
        queue(MADE, escapes ? 2 : 1);
    }
}

function jobData(bytes: usize, count: u32): void {
    s.wanted -= count;
    if (s.stage != Stage.Checking && s.stage != Stage.Feeding) return;
    for (let at = bytes; at < bytes + count; at++) {
        const byte = load<u8>(at);
        const what = fate(byte);
        s.column += 1;
        if (what == Control.Refuse) {
            if (s.stage == Stage.Feeding) {
                stop(Failure.UnsupportedCharacter);
            } else {
                link.checkResult(s.job, Failure.UnsupportedCharacter, 0, s.line, s.column);
                finish();
            }
            return;
        }
        if (byte == 0x0a) {
            s.line += 1;
            s.column = 0;
        }
        if (s.stage == Stage.Feeding && what == Control.Send) feed(at);
    }
    ask();
}

function jobEnd(): void {
    if (s.stage == Stage.Checking) {
        link.checkResult(s.job, 0, 0, 0, 0);
        s.stage = Stage.Idle;
    } else if (s.stage == Stage.Feeding) {
        s.stage = Stage.Closing;
        s.unqueued += lengthOf(Setting.FeedEnd);
        queueStrings();
    }
}

function left(mark: u32): void {
    if (~mark <= <u32>Setting.Xoff) {
        s.leaving = false;
        if (~mark != <u32>toSay()) say();
        return;
    }
    if (s.stage == Stage.Draining && mark == s.job) {
        link.jobDone(s.job, s.queued);
        finish();
    }
}

// ---- the receiver ----

function isComplete(): bool {
    return lengthOf(Setting.EndMark) > 0 && s.marksSeen >= <u32>number(Setting.EndMarkCount);
}

/** Silence counts only while the partner may send. */
function awaitQuiet(): void {
    const span = isComplete() ? number(Setting.EndQuiet) : number(Setting.QuietTime);
    setTimer(Timer.Quiet, s.delivery != 0 && !s.stopped && span > 0 ? after(span) : NEVER);
}

/** An XON is repeated until something comes. */
function awaitAnswer(unanswered: bool): void {
    s.xonUnanswered = unanswered;
    const repeats = unanswered && s.delivery != 0 && number(Setting.XonRepeat) > 0;
    setTimer(Timer.RepeatXon, repeats ? after(number(Setting.XonRepeat)) : NEVER);
}

/** A partner that we stopped, or may have, is to go on. */
function letGo(): void {
    if (!s.stopped) return;
    s.stopped = false;
    say();
}

/** Ends the delivery under way; an earlier reason to fail goes first. */
function endDelivery(failure: i32): void {
    if (s.delivery == 0) return;
    link.deliveryEnd(s.delivery, s.failure != 0 ? s.failure : failure, 0);
    s.delivery = 0;
    setTimer(Timer.Quiet, NEVER);
    awaitAnswer(false);
}

function beginDelivery(): void {
    s.heard = true;
    if (s.delivery != 0) return;
    s.lastDelivery += 1;
    s.lastDelivery += u32(s.lastDelivery == 0);
    s.delivery = s.lastDelivery;
    s.failure = 0;
    s.escaped = false;
    s.receiveLines = Line.Within;
    s.markProgress = 0;
    s.marksSeen = 0;
    link.deliveryBegin(s.delivery, 0);
}

/** What finds no room is lost, and the delivery says so. */
function deliver(bytes: usize, count: u32): void {
    const fitting = min<u32>(count, link.deliveryRoom);
    link.deliver(s.delivery, bytes, fitting);
    if (fitting < count && s.failure != Failure.Overrun) {
        s.failure = Failure.Overrun;
        link.note(Level.Error, 0, "the partner did not stop: characters are lost");
    }
}

/** How much of the end mark stands at its own end once `byte` has come after `progress` bytes of it. */
function markProgress(progress: u32, byte: u8): u32 {
    const mark = bytesOf(Setting.EndMark);
    // The longest beginning of the mark that is an end of what was seen, and goes on with this byte.
    for (let length = progress; length <= progress; length--) {
        let at: u32 = 0;
        while (at < length && load<u8>(mark + at) == load<u8>(mark + progress - length + at)) at++;
        if (at == length && load<u8>(mark + length) == byte) return length + 1;
    }
    return 0;
}

/** The end mark over any cut, overlaps with itself included. */
function lookForEnd(byte: u8): void {
    if (lengthOf(Setting.EndMark) == 0) return;
    s.markProgress = markProgress(s.markProgress, byte);
    if (s.markProgress == lengthOf(Setting.EndMark)) {
        s.marksSeen += u32(s.marksSeen != u32.MAX_VALUE);
        s.markProgress = 0;
    }
}

function countAfterXoff(): void {
    if (s.stopped && link.now > s.xoffAt) s.afterXoff += u32(s.afterXoff != u32.MAX_VALUE);
}

function receive(at: usize): void {
    beginDelivery();
    countAfterXoff();
    if (number(Setting.Transparent)) {
        if (!s.escaped && load<u8>(at) == byteOf(Setting.Escape)) {
            s.escaped = true;
            return;
        }
        if (s.escaped) store<u8>(at, load<u8>(at) ^ byteOf(Setting.EscapeXor));
        s.escaped = false;
    }
    lookForEnd(load<u8>(at));
    if (contains(RECEIVE_DROPS, load<u8>(at))) return;
    const count = mapLine(STATE + offsetof<State>("receiveLines"), number(Setting.ReceiveLineEnd), at);
    deliver(mapped, count);
}

/** After the bytes of one time: marks, repeats, silence. */
function afterBytes(): void {
    if (!s.heard) return;
    s.heard = false;
    awaitAnswer(false);
    const isFull = !s.stopped && link.deliveryRoom < s.low;
    const isIgnored =
        s.stopped && number(Setting.XoffRepeat) > 0 && s.afterXoff >= <u32>number(Setting.XoffRepeat);
    if (number(Setting.Speak) && (isFull || isIgnored)) {
        s.stopped = true;
        s.xoffAt = link.now;
        s.afterXoff = 0;
        say();
    }
    awaitQuiet();
}

/** A damaged character keeps its place, so that its neighbours keep theirs. */
function damaged(kind: i32, hasByte: bool, at: usize): void {
    // What is lost cannot be kept, and may have been the beginning.
    const isLost = kind == LineError.Overrun;
    if (s.delivery == 0 && !isLost && (kind == LineError.Break || !hasByte)) return;
    beginDelivery();
    if (isLost) s.failure = Failure.Overrun;
    else if (number(Setting.OnLineError) == 0 && s.failure == 0) s.failure = Failure.LineError;
    // What stands around it is apart.
    s.escaped = false;
    s.receiveLines = Line.Within;
    s.markProgress = 0;
    if (hasByte) {
        countAfterXoff();
        deliver(at, 1);
    }
    afterBytes();
}

function makeRoom(): void {
    raiseMarks();
    if (!s.stopped || link.deliveryRoom <= s.high) return;
    letGo();
    awaitAnswer(true);
    awaitQuiet();
}

/** Marks must leave the host space to report room in between. They rise with the room that is known. */
function raiseMarks(): void {
    const room = link.deliveryRoom;
    s.low = max<u32>(s.low, min<u32>(number(Setting.LowMark), room / 2));
    s.high = max<u32>(s.high, min<u32>(max<u32>(number(Setting.HighMark), s.low), (room / 4) * 3));
}

// ---- events ----

/** Whether what comes while we send is only an echo. */
function ignoresData(): bool {
    return number(Setting.WhileSending) == 1 && s.stage != Stage.Idle;
}

function received(count: u32): void {
    const held = STATE + (<usize>Timer.Held << 3);
    const before = load<i64>(held);
    isHearing = true;
    for (let at = INPUT; at < INPUT + count; at++) {
        const which = control(load<u8>(at));
        if (which == Setting.Xon) {
            forgetHold();
        } else if (which != Setting.Xoff) {
            if (!ignoresData()) receive(at);
        } else if (!s.held) {
            s.held = true;
            updateHold();
            watchHold();
        }
    }
    isHearing = false;
    updateHold();
    const until = load<i64>(held);
    store<i64>(held, before);
    setTimer(Timer.Held, until);
    afterBytes();
}

function lineErrorText(kind: i32): string {
    if (kind == LineError.Parity) return "the parity bit is wrong";
    if (kind == LineError.Framing) return "the stop bit is missing";
    if (kind == LineError.ParityOrFraming) return "parity or framing, the port cannot tell";
    if (kind == LineError.Overrun) return "characters were lost in the port";
    return "the line was held low for longer than a character";
}

function lineError(): void {
    const kind: i32 = load<u8>(INPUT);
    link.note(Level.Warning, kind, lineErrorText(kind));
    // With a span the character was given already.
    const hasByte = load<u8>(INPUT, 1) != 0 && load<u32>(INPUT, 4) == 0;
    if (!ignoresData()) damaged(kind, hasByte, INPUT + 2);
}

function timer(id: i32): void {
    if (id == Timer.Held) {
        stop(Failure.HeldTooLong);
        return;
    }
    store<i64>(STATE + (<usize>id << 3), NEVER);
    if (id == Timer.Quiet) {
        endDelivery(lengthOf(Setting.EndMark) > 0 && !isComplete() ? Failure.NoEndMark : Failure.None);
    } else if (s.xonUnanswered && s.delivery != 0) {
        say();
        awaitAnswer(true);
    }
}

function stateName(): string {
    if (s.stage == Stage.Checking) return "checking";
    if (s.stage == Stage.Stopping) return "stopping";
    if (s.stage == Stage.Idle) return s.stopped ? "stopped" : s.delivery != 0 ? "receiving" : "idle";
    return s.held ? "held" : s.waitsForXon ? "waiting for XON" : s.paused ? "paused" : "sending";
}

function nameState(): void {
    const name = stateName();
    if (changetype<usize>(name) != named) link.state(name);
    named = changetype<usize>(name);
}

function takeSettings(length: u32): i32 {
    const refusal = link.takeSettings(SETTINGS, TYPES, Setting.Count, length);
    if (refusal < 0 || !(load<u8>(INPUT) & 2)) return refusal;
    makeSet(SEND_DROPS, Setting.SendDrop);
    makeSet(RECEIVE_DROPS, Setting.ReceiveDrop);
    if (control(byteOf(Setting.Xon)) == control(byteOf(Setting.Xoff))) return Refusal.Settings;
    if (!number(Setting.Transparent)) return 0;
    // No data byte may be a control byte in other bits alone, the escape must be none, and no
    // escaped byte may be one.
    let clashes = (number(Setting.ParityMask) & 0x7f) != 0x7f;
    if (control(byteOf(Setting.Escape)) != Setting.Count) clashes = true;
    for (let byte = 0; byte < 256; byte++) {
        if (mustEscape(<u8>byte) && mustEscape(<u8>byte ^ byteOf(Setting.EscapeXor))) clashes = true;
    }
    return clashes ? Refusal.Settings : 0;
}

function restore(length: u32): i32 {
    const taken = link.takeState(STATE, STATE_BYTES, 1, length);
    if (taken > 0 && (s.stage > Stage.Stopping || s.markProgress >= SETTING_BYTES)) return Refusal.State;
    isOpen = taken > 0;
    return min(taken, 0);
}

function open(): void {
    for (let at: u32 = 0; at < STATE_BYTES; at++) store<u8>(STATE + at, 0);
    for (let id = 0; id < Timer.Count; id++) store<i64>(STATE + (<usize>id << 3), NEVER);
    raiseMarks();
    if (number(Setting.XonAtOpen) && number(Setting.Speak)) say();
    isOpen = true;
}

function tellTimers(): void {
    for (let id = 0; id < Timer.Count; id++) {
        const deadline = load<i64>(STATE + (<usize>id << 3));
        if (deadline != NEVER) link.setTimer(id, deadline);
    }
}

function event(kind: i32, length: u32): i32 {
    if (kind == Event.Settings) return takeSettings(length);
    if (link.settingsGiven != Setting.Count) return Refusal.MalformedEvent;
    if (kind == Event.Restore) return restore(length);
    if (kind == Event.Open) {
        named = 0;
        if (load<u8>(INPUT) == 0) open();
    }
    if (!isOpen) return Refusal.MalformedEvent;
    switch (kind) {
        case Event.Open:
            tellTimers();
            break;
        case Event.Close:
            isOpen = false;
            return 0;
        case Event.Received:
            received(length);
            break;
        case Event.LineError:
            if (<u8>(load<u8>(INPUT) - 1) >= <u8>LineError.Break) return Refusal.MalformedEvent;
            lineError();
            break;
        case Event.LinkDown:
            stop(Failure.LinkDown);
            endDelivery(Failure.LinkDown);
            break;
        case Event.LinkUp:
            released();
            letGo();
            break;
        case Event.Timer:
            if (load<u8>(INPUT) >= <u8>Timer.Count) return 0;
            timer(load<u8>(INPUT));
            break;
        case Event.Mark:
            if (load<u8>(INPUT, 4) != <u8>Mark.SurelyLeft) return 0;
            left(load<u32>(INPUT));
            break;
        case Event.TransmitRoom:
            goOn();
            return 0;
        case Event.Discarded:
            discarded(load<u32>(INPUT));
            break;
        case Event.DeliveryRoom:
            makeRoom();
            break;
        case Event.JobBegin:
            jobBegin();
            break;
        case Event.JobData:
            jobData(INPUT + 4, length - 4);
            return 0;
        case Event.JobEnd:
            jobEnd();
            return 0;
        case Event.Pause:
        case Event.Resume:
            s.paused = kind == Event.Pause;
            updateHold();
            break;
        case Event.Abort:
            if (load<u32>(INPUT) != 0) {
                stop(Failure.Aborted);
            } else {
                endDelivery(Failure.Aborted);
                letGo();
            }
            break;
        case Event.ForceResume:
            forgetHold();
            break;
        case Event.Save:
            link.saved(1, 0, STATE_BYTES, STATE, STATE_BYTES);
            return 0;
        default: // modem lines, answers, the rest of an output: nothing to do
            return 0;
    }
    nameState();
    return 0;
}
