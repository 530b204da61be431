/* XON/XOFF in both directions, in C: does what plugins/xon-xoff does in Rust, byte for byte.
 *
 * The protocol's page is docs/protocols/xon-xoff.md.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#define SP_SETTING_NUMBER int32_t
#ifdef XON_XOFF_CORE
#define SP_SETTING_BYTES 8 /* no setting of the core is longer */
#endif
/* Each character may cost a look at all of an end mark and of a list: so many are done in time. */
#define SP_INPUT_BYTES 512
#include "../softplug.h"

/* ---- settings, in the manifest's order: first those that every XON/XOFF needs ---- */

enum {
    XON,
    XOFF,
    WAIT_FOR_XON,
    HELD_TIMEOUT,
    CONTROL_IN_DATA,
    WHILE_SENDING,
    SPEAK,
    LOW_MARK,
    HIGH_MARK,
    XON_AT_OPEN,
    QUIET_TIME,
    ON_LINE_ERROR,
    CORE_SETTINGS,
    PARITY_MASK = CORE_SETTINGS,
    FEED_START,
    FEED_END,
    ABORT_SEND,
    SEND_LINE_END,
    SEND_DROP,
    TRANSPARENT,
    ESCAPE,
    ESCAPE_XOR,
    XON_REPEAT,
    XOFF_REPEAT,
    RECEIVE_LINE_END,
    RECEIVE_DROP,
    END_MARK,
    END_MARK_COUNT,
    END_QUIET,
    ALL_SETTINGS
};

/* The smallest plug-in has the protocol's core alone. */
#ifdef XON_XOFF_CORE
#define SETTINGS CORE_SETTINGS
#else
#define SETTINGS ALL_SETTINGS
#endif

enum {
    B = SP_VALUE_BOOL | SP_CHOICES(2),
    I = SP_VALUE_INT,
    S = SP_VALUE_BYTES,
    C2 = SP_VALUE_CHOICE | SP_CHOICES(2),
    C3 = SP_VALUE_CHOICE | SP_CHOICES(3),
    C5 = SP_VALUE_CHOICE | SP_CHOICES(5),
};
static const uint8_t types[] = {I,  I, B, I, C3, C2, B, I, I, B,  I, C2, /* the core ends here */
                                I,  S, S, S, C5, S,  B, I, I, I,  I, C5, S,  S,  I,  I};

enum { KEEP, LF, CR, CR_LF, LF_CR_CR }; /* how lines end */
enum { REFUSE, DROP, SEND };            /* control bytes in a program */

static sp_setting settings[SETTINGS];

/* What is not among the settings is as if it were off. */
#define IS_THERE(which) ((which) < SETTINGS)
#define NUMBER(which) (IS_THERE(which) ? settings[which].number : (which) == PARITY_MASK ? 0xFF : 0)
#define LENGTH(which) (IS_THERE(which) ? settings[which].length : 0)
#define HAS_STRINGS IS_THERE(FEED_END)

static bool is_among(uint32_t which, uint8_t byte) {
    for (uint32_t i = 0; i < settings[which].length; i++)
        if (settings[which].bytes[i] == byte)
            return true;
    return false;
}

#define CONTAINS(which, byte) (IS_THERE(which) && is_among(which, byte))

/* ---- what is kept between two events; all of it is saved and restored ---- */

/* What the sender is at. */
enum { IDLE, CHECKING, FEEDING, DRAINING, STOPPING, CLOSING };
/* Where in a line end a reader is. */
enum { IN_LINE, AFTER_CR, AFTER_LF, AFTER_LF_CR };
/* Timers: silence, a repeated XON, a hold that lasts too long. */
enum { QUIET, REPEAT_XON, HELD, TIMERS };

#define NEVER (-1)

static struct {
    int64_t timers[TIMERS]; /* deadlines, or NEVER */
    uint64_t queued;        /* bytes queued for the job */
    int64_t xoff_at;
    uint32_t job;
    uint32_t wanted;   /* asked for and not yet given */
    uint32_t unqueued; /* bytes of the feed's strings that found no room yet */
    uint32_t line, column;
    uint32_t delivery, last_delivery;
    uint32_t mark_progress, marks_seen;
    uint32_t after_xoff; /* characters since our XOFF, those of its own time left out */
    uint32_t low, high;
    uint8_t stage;
    uint8_t stopping; /* why the job fails once the queue is dropped */
    uint8_t send_lines, receive_lines;
    uint8_t failure;       /* why the delivery under way cannot end well */
    bool held;             /* the partner has sent XOFF, and no XON since */
    bool waits_for_xon;    /* the first XON of the job has not come */
    bool paused;
    bool holding;          /* the queue is held for any of these reasons */
    bool escaped;
    bool stopped;          /* we have sent XOFF, and no XON since */
    bool xon_unanswered;   /* nothing came since our XON */
    bool leaving;          /* a control byte of ours has not left yet */
    bool heard;            /* something came in the event under way */
} s;

/* The state that the host knows; not saved: a restored plug-in tells it anew. */
static const char *named;
static bool is_open;
/* What follows from control bytes is done behind the last of their event, of which there may be a
   thousand. */
static bool is_hearing;

static void fill(void *at, uint8_t with, uint32_t count) {
    for (uint8_t *byte = at; count > 0; count--)
        *byte++ = with;
}

static void set_timer(uint8_t id, int64_t at) {
    if (s.timers[id] == at)
        return;
    s.timers[id] = at;
    if (is_hearing && id == HELD)
        return;
    if (at == NEVER)
        sp_cancel_timer(id);
    else
        sp_set_timer(id, at);
}

static uint32_t least(uint32_t a, uint32_t b) { return a < b ? a : b; }

static int64_t after(int32_t millis) { return sp_link.now + (int64_t)millis * 1000; }

/* ---- codes ---- */

static bool is_like(uint8_t byte, uint32_t which) {
    return ((byte ^ (uint8_t)settings[which].number) & (uint8_t)NUMBER(PARITY_MASK)) == 0;
}

/* XOFF, XON, or SETTINGS for a byte that is neither. */
SP_SHARED static uint32_t control(uint8_t byte) {
    return is_like(byte, XOFF) ? XOFF : is_like(byte, XON) ? XON : SETTINGS;
}

/* Whether a data byte must be escaped: controls with either parity bit, the escape itself. */
static bool must_escape(uint8_t byte) {
    return byte == (uint8_t)NUMBER(ESCAPE) || ((byte ^ NUMBER(XON)) & 0x7F) == 0 ||
           ((byte ^ NUMBER(XOFF)) & 0x7F) == 0;
}

/* Says ahead of all else whether the partner may send, or as soon as what was said before has left:
 * a partner that sends faster than the line cannot make more of them wait. */
static void say(void) {
    if (s.leaving)
        return;
    s.leaving = true;
    uint32_t which = s.stopped ? XOFF : XON;
    /* Which one it is, so that it can be told when it has left. The mark of a job is its id. */
    sp_transmit_urgent(~which, settings[which].bytes, 1); /* the lowest byte of its number */
}

typedef struct {
    const void *bytes;
    uint32_t count;
} piece;

/* What the byte at `at` becomes. Reads line ends over any cut: LF, CR LF, CR, LF CR and LF CR CR
 * are each one. */
static piece map_line(uint8_t *state, uint32_t form, const uint8_t *at) {
    static const piece line_ends[] = {{0, 0}, {"\n", 1}, {"\r", 1}, {"\r\n", 2}, {"\n\r\r", 3}};
    uint8_t byte = *at, before = *state;
    if (form == KEEP)
        return (piece){at, 1};
    *state = byte == '\n' ? AFTER_LF : byte == '\r' ? AFTER_CR : IN_LINE;
    if (*state == IN_LINE)
        return (piece){at, 1};
    if (byte == '\r' && before == AFTER_LF) {
        *state = AFTER_LF_CR;
        return line_ends[KEEP];
    }
    if (before == (byte == '\n' ? AFTER_CR : AFTER_LF_CR)) {
        *state = IN_LINE;
        return line_ends[KEEP];
    }
    return line_ends[form];
}

/* ---- the sender ---- */

static void update_hold(void) {
    bool holding = s.held || s.waits_for_xon || s.paused;
    if (holding == s.holding || is_hearing)
        return;
    s.holding = holding;
    sp_begin(holding ? SP_ACTION_HOLD : SP_ACTION_RELEASE, 0);
}

/* The partner's hold is over. A job still waits for its first XON. */
static void released(void) {
    s.held = false;
    set_timer(HELD, NEVER);
    update_hold();
}

static void forget_hold(void) {
    s.waits_for_xon = false;
    released();
}

/* There is a job with bytes to send. */
static bool is_feeding(void) {
    return s.stage == FEEDING || s.stage == DRAINING || (HAS_STRINGS && s.stage == CLOSING);
}

/* A hold is timed only while there is a job to fail. */
static void watch_hold(void) {
    if (s.held && is_feeding() && NUMBER(HELD_TIMEOUT) > 0)
        set_timer(HELD, after(NUMBER(HELD_TIMEOUT)));
}

static void queue(const void *bytes, uint32_t count) {
    s.queued += count;
    sp_transmit(bytes, count);
}

/* What belonged to the job alone ends with it; a partner's XOFF stays. */
static void finish(void) {
    s.stage = IDLE;
    s.paused = s.waits_for_xon = false;
    s.wanted = 0;
    if (HAS_STRINGS)
        s.unqueued = 0;
    set_timer(HELD, NEVER);
    update_hold();
}

/* Stops at once and drops what is queued; the job fails when it is known how much that was. */
static void stop(uint8_t failure) {
    if (is_feeding()) {
        sp_discard();
        if (HAS_STRINGS)
            s.unqueued = 0;
        s.stage = STOPPING;
        s.stopping = failure;
    } else if (s.stage == CHECKING) {
        sp_job_failed(s.job, failure, 0, 0);
        finish();
    }
}

static void discarded(uint32_t bytes) {
    if (s.stage != STOPPING)
        return;
    /* What an abort before this one sent may have waited still, and is among these bytes. */
    uint64_t of_job = bytes < s.queued ? bytes : s.queued;
    sp_job_failed(s.job, s.stopping, 0, s.queued - of_job);
    if (IS_THERE(ABORT_SEND)) {
        uint32_t length = LENGTH(ABORT_SEND);
        uint32_t lost = least((uint32_t)(bytes - of_job), length);
        uint32_t words = s.stopping == SP_FAILURE_ABORTED ? length : lost;
        if (words > 0 && words <= sp_link.transmit_room)
            sp_transmit(settings[ABORT_SEND].bytes + length - words, words);
    }
    finish();
}

/* Asks for as much as can be queued whatever it grows to, the feed's end kept in reserve. */
static void ask(void) {
    uint32_t most = 3072;
    if (s.stage == FEEDING) {
        uint32_t room = sp_link.transmit_room;
        most = least(most, room - least(room, LENGTH(FEED_END)));
        uint32_t form = (uint32_t)NUMBER(SEND_LINE_END);
        most /= (form == LF_CR_CR ? 3 : form == CR_LF ? 2 : 1) << NUMBER(TRANSPARENT);
    } else if (s.stage != CHECKING) {
        return;
    }
    /* Small requests would make many small events. */
    if (most > s.wanted && (most - s.wanted >= most / 4 || s.wanted == 0)) {
        sp_want(s.job, most - s.wanted);
        s.wanted = most;
    }
}

/* Queues of the strings around the program what there is room for; whether that was all. */
static bool queue_strings(void) {
    if (!HAS_STRINGS)
        return true;
    uint32_t start = LENGTH(FEED_START), end = s.stage == CLOSING ? LENGTH(FEED_END) : 0;
    /* of a state that was saved under other settings too much may wait */
    s.unqueued = least(s.unqueued, start + end);
    for (; s.unqueued > 0 && sp_link.transmit_room > 0; s.unqueued--) {
        uint32_t at = start + end - s.unqueued;
        queue(at < start ? settings[FEED_START].bytes + at
                         : settings[FEED_END].bytes + at - start, 1);
    }
    return s.unqueued == 0;
}

SP_SHARED static void drain(void) {
    sp_transmit_marked(s.job, 0, 0);
    s.stage = DRAINING;
}

/* Does what there is room for. */
static void go_on(void) {
    if (!queue_strings())
        return;
    if (HAS_STRINGS && s.stage == CLOSING)
        drain();
    ask();
}

static void job_begin(const uint8_t *payload) {
    uint32_t job = sp_u32(payload);
    if (s.stage != IDLE || sp_u16(payload + 4) != 0) {
        sp_job_failed(job, s.stage != IDLE ? SP_FAILURE_BUSY : SP_FAILURE_NOT_SUPPORTED, 0, 0);
        return;
    }
    s.job = job;
    s.wanted = 0;
    s.queued = 0;
    s.send_lines = IN_LINE;
    s.line = 1;
    s.column = 0;
    s.stage = CHECKING;
    if (payload[6] == 0) {
        s.stage = FEEDING;
        s.waits_for_xon = NUMBER(WAIT_FOR_XON) != 0;
        update_hold();
        watch_hold();
        if (HAS_STRINGS)
            s.unqueued = LENGTH(FEED_START);
    }
    go_on();
}

static void feed(const uint8_t *at) {
    piece mapped = map_line(&s.send_lines, (uint32_t)NUMBER(SEND_LINE_END), at);
    if (!NUMBER(TRANSPARENT)) {
        queue(mapped.bytes, mapped.count);
        return;
    }
    for (const uint8_t *byte = mapped.bytes; mapped.count > 0; mapped.count--, byte++) {
        uint8_t pair[] = {(uint8_t)NUMBER(ESCAPE), *byte ^ (uint8_t)NUMBER(ESCAPE_XOR)};
        if (must_escape(*byte))
            queue(pair, 2);
        else
            queue(byte, 1);
    }
}

static void job_data(const uint8_t *bytes, uint32_t count) {
    s.wanted -= count;
    if (s.stage != CHECKING && s.stage != FEEDING)
        return;
    for (; count > 0; count--, bytes++) {
        uint8_t byte = *bytes;
        s.column += 1;
        int32_t fate = CONTAINS(SEND_DROP, byte)                         ? DROP
                       : NUMBER(TRANSPARENT) || control(byte) == SETTINGS ? SEND
                                                                         : NUMBER(CONTROL_IN_DATA);
        if (fate == REFUSE) {
            if (s.stage == FEEDING) {
                stop(SP_FAILURE_UNSUPPORTED_CHARACTER);
            } else {
                sp_check_result(s.job, SP_FAILURE_UNSUPPORTED_CHARACTER, 0, s.line, s.column);
                finish();
            }
            return;
        }
        if (byte == '\n') {
            s.line += 1;
            s.column = 0;
        }
        if (s.stage == FEEDING && fate == SEND)
            feed(bytes);
    }
    ask();
}

static void job_end(void) {
    if (s.stage == CHECKING) {
        sp_check_result(s.job, 0, 0, 0, 0);
        s.stage = IDLE;
    } else if (s.stage == FEEDING && !HAS_STRINGS) {
        drain();
    } else if (s.stage == FEEDING) {
        s.stage = CLOSING;
        s.unqueued += LENGTH(FEED_END);
        go_on();
    }
}

static void left(uint32_t mark) {
    if (~mark <= XOFF) {
        s.leaving = false;
        if (~mark != (s.stopped ? XOFF : XON))
            say();
        return;
    }
    if (s.stage == DRAINING && mark == s.job) {
        sp_job_done(s.job, s.queued);
        finish();
    }
}

/* ---- the receiver ---- */

static bool is_complete(void) {
    return LENGTH(END_MARK) > 0 && s.marks_seen >= (uint32_t)NUMBER(END_MARK_COUNT);
}

/* Silence counts only while the partner may send. */
static void await_quiet(void) {
    int32_t span = NUMBER(is_complete() ? END_QUIET : QUIET_TIME);
    set_timer(QUIET, s.delivery != 0 && !s.stopped && span > 0 ? after(span) : NEVER);
}

/* An XON is repeated until something comes. */
static void await_answer(bool unanswered) {
    if (!IS_THERE(XON_REPEAT))
        return;
    s.xon_unanswered = unanswered;
    bool repeats = unanswered && s.delivery != 0 && NUMBER(XON_REPEAT) > 0;
    set_timer(REPEAT_XON, repeats ? after(NUMBER(XON_REPEAT)) : NEVER);
}

/* A partner that we stopped, or may have, is to go on. */
static void let_go(void) {
    if (!s.stopped)
        return;
    s.stopped = false;
    say();
}

/* Ends the delivery under way; an earlier reason to fail goes first. */
static void end_delivery(uint8_t failure) {
    if (s.delivery == 0)
        return;
    sp_delivery_end(s.delivery, s.failure != 0 ? s.failure : failure, 0);
    s.delivery = 0;
    set_timer(QUIET, NEVER);
    await_answer(false);
}

/* What came before and what comes are apart: no escape, line end or end mark goes over it. */
static void part(void) {
    if (!IS_THERE(END_MARK))
        return;
    s.escaped = false;
    s.receive_lines = IN_LINE;
    s.mark_progress = 0;
}

static void begin_delivery(void) {
    s.heard = true;
    if (s.delivery != 0)
        return;
    s.last_delivery += 1;
    s.last_delivery += s.last_delivery == 0;
    s.delivery = s.last_delivery;
    s.failure = 0;
    part();
    if (IS_THERE(END_MARK))
        s.marks_seen = 0;
    sp_delivery_begin(s.delivery, 0);
}

/* What finds no room is lost, and the delivery says so. */
static void deliver(const void *bytes, uint32_t count) {
    uint32_t fitting = least(count, sp_link.delivery_room);
    sp_deliver(s.delivery, bytes, fitting);
    if (fitting < count && s.failure != SP_FAILURE_OVERRUN) {
        s.failure = SP_FAILURE_OVERRUN;
        sp_note(SP_NOTE_ERROR, 0, "the partner did not stop: characters are lost");
    }
}

/* The end mark over any cut, overlaps with itself included. */
static void look_for_end(uint8_t byte) {
    if (LENGTH(END_MARK) == 0)
        return;
    const uint8_t *mark = settings[END_MARK].bytes;
    uint32_t length = LENGTH(END_MARK), progress = s.mark_progress;
    while (progress > 0 && mark[progress] != byte) {
        /* The longest proper prefix of what was seen that is also its suffix. */
        uint32_t seen = progress, at = 0;
        for (progress -= 1; progress > 0; progress--) {
            for (at = 0; at < progress && mark[at] == mark[seen - progress + at]; at++)
                ;
            if (at == progress)
                break;
        }
    }
    if (mark[progress] == byte)
        progress += 1;
    if (progress == length) {
        s.marks_seen += s.marks_seen != UINT32_MAX;
        progress = 0;
    }
    s.mark_progress = progress;
}

static void count_after_xoff(void) {
    if (IS_THERE(XOFF_REPEAT) && s.stopped && sp_link.now > s.xoff_at)
        s.after_xoff += s.after_xoff != UINT32_MAX;
}

static void receive(uint8_t *at) {
    begin_delivery();
    count_after_xoff();
    if (NUMBER(TRANSPARENT)) {
        if (!s.escaped && *at == (uint8_t)NUMBER(ESCAPE)) {
            s.escaped = true;
            return;
        }
        if (s.escaped)
            *at ^= (uint8_t)NUMBER(ESCAPE_XOR);
        s.escaped = false;
    }
    look_for_end(*at);
    if (CONTAINS(RECEIVE_DROP, *at))
        return;
    piece mapped = map_line(&s.receive_lines, (uint32_t)NUMBER(RECEIVE_LINE_END), at);
    deliver(mapped.bytes, mapped.count);
}

/* After the bytes of one time: marks, repeats, silence. */
static void after_bytes(void) {
    if (!s.heard)
        return;
    s.heard = false;
    await_answer(false);
    bool is_full = !s.stopped && sp_link.delivery_room < s.low;
    bool is_ignored =
        s.stopped && NUMBER(XOFF_REPEAT) > 0 && s.after_xoff >= (uint32_t)NUMBER(XOFF_REPEAT);
    if (NUMBER(SPEAK) && (is_full || is_ignored)) {
        s.stopped = true;
        if (IS_THERE(XOFF_REPEAT)) {
            s.xoff_at = sp_link.now;
            s.after_xoff = 0;
        }
        say();
    }
    await_quiet();
}

/* A damaged character keeps its place, so that its neighbours keep theirs. */
static void damaged(uint8_t kind, bool has_byte, const uint8_t *byte) {
    /* What is lost cannot be kept, and may have been the beginning. */
    bool is_lost = kind == SP_LINE_ERROR_OVERRUN;
    if (s.delivery == 0 && !is_lost && (kind == SP_LINE_ERROR_BREAK || !has_byte))
        return;
    begin_delivery();
    if (is_lost)
        s.failure = SP_FAILURE_OVERRUN;
    else if (NUMBER(ON_LINE_ERROR) == 0 && s.failure == 0)
        s.failure = SP_FAILURE_LINE_ERROR;
    part();
    if (has_byte) {
        count_after_xoff();
        deliver(byte, 1);
    }
    after_bytes();
}

/* Marks must leave the host space to report room in between. They rise with the room that is
   known. */
static void raise_marks(void) {
    uint32_t room = sp_link.delivery_room, wanted = (uint32_t)NUMBER(HIGH_MARK);
    uint32_t low = least((uint32_t)NUMBER(LOW_MARK), room / 2);
    s.low = low > s.low ? low : s.low;
    uint32_t high = least(wanted > s.low ? wanted : s.low, room / 4 * 3);
    s.high = high > s.high ? high : s.high;
}

static void delivery_room(void) {
    raise_marks();
    if (!s.stopped || sp_link.delivery_room <= s.high)
        return;
    let_go();
    await_answer(true);
    await_quiet();
}

/* ---- events ---- */

/* Whether what comes while we send is only an echo. */
SP_SHARED static bool ignores_data(void) { return NUMBER(WHILE_SENDING) == 1 && s.stage != IDLE; }

static void received(uint8_t *bytes, uint32_t count) {
    int64_t before = s.timers[HELD];
    is_hearing = true;
    for (; count > 0; count--, bytes++) {
        switch (control(*bytes)) {
        case XOFF:
            if (!s.held) {
                s.held = true;
                update_hold();
                watch_hold();
            }
            break;
        case XON:
            forget_hold();
            break;
        default:
            if (!ignores_data())
                receive(bytes);
        }
    }
    is_hearing = false;
    update_hold();
    int64_t until = s.timers[HELD];
    s.timers[HELD] = before;
    set_timer(HELD, until);
    after_bytes();
}

static void line_error(const uint8_t *payload) {
    uint8_t kind = payload[0];
#ifdef XON_XOFF_CORE
    sp_note(SP_NOTE_WARNING, kind, "line error"); /* the kind stands beside it */
#else
    static const char *const texts[] = {
        "the parity bit is wrong",
        "the stop bit is missing",
        "parity or framing, the port cannot tell",
        "characters were lost in the port",
        "the line was held low for longer than a character",
    };
    sp_note(SP_NOTE_WARNING, kind, texts[kind - 1]);
#endif
    /* With a span the character was given already. */
    bool has_byte = payload[1] && sp_u32(payload + 4) == 0;
    if (!ignores_data())
        damaged(kind, has_byte, payload + 2);
}

static void timer(uint8_t id) {
    if (id == HELD) {
        stop(SP_FAILURE_HELD_TOO_LONG);
        return;
    }
    s.timers[id] = NEVER;
    if (id == QUIET)
        end_delivery(LENGTH(END_MARK) > 0 && !is_complete() ? SP_FAILURE_NO_END_MARK : 0);
    else if (IS_THERE(XON_REPEAT) && s.xon_unanswered && s.delivery != 0) {
        say();
        await_answer(true);
    }
}

static void name_state(void) {
    const char *name = s.stopped ? "stopped" : s.delivery != 0 ? "receiving" : "idle";
    if (s.stage == CHECKING)
        name = "checking";
    else if (s.stage == STOPPING)
        name = "stopping";
    else if (s.stage != IDLE)
        name = s.held            ? "held"
               : s.waits_for_xon ? "waiting for XON"
               : s.paused        ? "paused"
                                 : "sending";
    if (name != named)
        sp_state(name);
    named = name;
}

static int32_t take_settings(const uint8_t *payload, uint32_t length) {
    int32_t refusal = sp_take_settings(settings, types, SETTINGS, payload, length);
    if (refusal < 0 || !(payload[0] & 2))
        return refusal;
    if (control((uint8_t)NUMBER(XON)) == control((uint8_t)NUMBER(XOFF)))
        return SP_REFUSE_SETTINGS;
    if (!NUMBER(TRANSPARENT))
        return 0;
    /* No data byte may be a control byte in other bits alone, the escape must be none, and no
       escaped byte may be one. */
    bool clashes = (NUMBER(PARITY_MASK) & 0x7F) != 0x7F;
    clashes |= control((uint8_t)NUMBER(ESCAPE)) != SETTINGS;
    for (uint32_t byte = 0; byte < 256; byte++)
        clashes |= must_escape((uint8_t)byte) &&
                   must_escape((uint8_t)byte ^ (uint8_t)NUMBER(ESCAPE_XOR));
    return clashes ? SP_REFUSE_SETTINGS : 0;
}

static int32_t restore(const uint8_t *payload, uint32_t length) {
    int32_t taken = sp_take_state(&s, sizeof s, 1, payload, length);
    if (taken > 0 && (s.stage > (HAS_STRINGS ? CLOSING : STOPPING) ||
                      s.mark_progress >= SP_SETTING_BYTES))
        return SP_REFUSE_STATE;
    is_open = taken > 0;
    return taken < 0 ? taken : 0;
}

static void begin(void) {
    fill(&s, 0, sizeof s);
    fill(s.timers, 0xFF, sizeof s.timers); /* NEVER */
    raise_marks();
    if (NUMBER(XON_AT_OPEN) && NUMBER(SPEAK))
        say();
    is_open = true;
}

static int32_t plugin_event(int32_t kind, const uint8_t *payload, uint32_t length) {
    if (kind == SP_EVENT_SETTINGS)
        return take_settings(payload, length);
    if (sp_settings_given != SETTINGS)
        return SP_REFUSE_MALFORMED_EVENT;
    if (kind == SP_EVENT_RESTORE)
        return restore(payload, length);
    if (kind == SP_EVENT_OPEN) {
        named = 0;
        if (payload[0] == 0)
            begin();
    }
    if (!is_open)
        return SP_REFUSE_MALFORMED_EVENT;
    switch (kind) {
    case SP_EVENT_OPEN:
        for (uint8_t id = 0; id < TIMERS; id++)
            if (s.timers[id] != NEVER)
                sp_set_timer(id, s.timers[id]);
        break;
    case SP_EVENT_CLOSE:
        is_open = false;
        return 0;
    case SP_EVENT_RECEIVED:
        received(sp_input, length); /* which may be changed */
        break;
    case SP_EVENT_LINE_ERROR:
        if ((uint8_t)(payload[0] - 1) >= SP_LINE_ERROR_BREAK)
            return SP_REFUSE_MALFORMED_EVENT;
        line_error(payload);
        break;
    case SP_EVENT_LINK_DOWN:
        stop(SP_FAILURE_LINK_DOWN);
        end_delivery(SP_FAILURE_LINK_DOWN);
        break;
    case SP_EVENT_LINK_UP:
        released();
        let_go();
        break;
    case SP_EVENT_TIMER:
        if (payload[0] >= TIMERS)
            return 0;
        timer(payload[0]);
        break;
    case SP_EVENT_MARK:
        if (payload[4] != SP_MARK_SURELY_LEFT)
            return 0;
        left(sp_u32(payload));
        break;
    case SP_EVENT_TRANSMIT_ROOM:
        go_on();
        return 0;
    case SP_EVENT_DISCARDED:
        discarded(sp_u32(payload));
        break;
    case SP_EVENT_DELIVERY_ROOM:
        delivery_room();
        break;
    case SP_EVENT_JOB_BEGIN:
        job_begin(payload);
        break;
    case SP_EVENT_JOB_DATA:
        job_data(payload + 4, length - 4);
        return 0;
    case SP_EVENT_JOB_END:
        job_end();
        return 0;
    case SP_EVENT_PAUSE:
    case SP_EVENT_RESUME:
        s.paused = kind == SP_EVENT_PAUSE;
        update_hold();
        break;
    case SP_EVENT_ABORT:
        if (sp_u32(payload) != 0) {
            stop(SP_FAILURE_ABORTED);
        } else {
            end_delivery(SP_FAILURE_ABORTED);
            let_go();
        }
        break;
    case SP_EVENT_FORCE_RESUME:
        forget_hold();
        break;
    case SP_EVENT_SAVE:
        sp_saved(1, 0, sizeof s, &s, sizeof s);
        return 0;
    default: /* modem lines, answers, the rest of an output: nothing to do */
        return 0;
    }
    name_state();
    return 0;
}
