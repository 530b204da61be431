/* my-protocol: lines of text, each answered with ACK or NAK.
 *
 * A plug-in is a state machine: the host calls plugin_event (at the end of this file) for each
 * event, and the sp_ functions write the actions that answer it. There is no clock, no library and
 * no I/O; time comes with each event (sp_link.now, in microseconds).
 *
 * What the protocol demands stands, clause by clause, in requirements/my-protocol.toml; the cases
 * in traces show it. Change those first, then the code. All functions are described in softplug.h.
 */
#define SP_WORDS_BYTES 128 /* room for what sp_panic says */
#include "softplug.h"

enum { ACK = 0x06, NAK = 0x15, LF = 0x0A };
enum { LINE = 200 };       /* the longest line in bytes, its LF included */
enum { ANSWERS = 8 };      /* answers that may wait to leave: the ABI allows 16 urgent bytes */
enum { ANSWER_TIME = 0 };  /* the only timer: no answer has come */
enum { ANSWER = 1, FIRST_MARK = 2 }; /* the mark of every answer; marks of lines count up */

/* ---- settings: their order and types are those of manifest.json ---- */

enum { SET_ANSWER_TIME, SET_REPEATS, SETTINGS };
static const uint8_t types[SETTINGS] = {SP_VALUE_INT, SP_VALUE_INT};
static sp_setting settings[SETTINGS];

/* ---- all that must be remembered between two events ---- */

/* What a job waits for. */
enum {
    IDLE,     /* nothing: there is no job */
    FILLING,  /* a whole line of its data */
    SENDING,  /* room to transmit the rest of the line */
    LEAVING,  /* the line's last byte to leave */
    AWAITING, /* the answer */
    STOPPING, /* to be told how much of it never left */
};

/* It is saved and restored as it stands here: count `saves` in manifest.json up with each change. */
static struct {
    uint64_t sent;       /* bytes transmitted for the job */
    int64_t deadline;    /* until when the answer must have come; 0: it is not awaited */
    uint32_t job;
    uint32_t text_length;
    uint32_t asked;       /* bytes of data that the host was asked for and has not given yet */
    uint32_t transmitted; /* bytes of the line that were transmitted */
    uint32_t mark;        /* of the line's last byte */
    uint32_t refusals;    /* how often the line was refused */
    uint32_t line_length;
    uint32_t waiting;  /* answers that have not left yet */
    uint32_t delivery; /* id of the latest delivery */
    uint8_t stage;
    uint8_t failure; /* while stopping: why */
    bool has_ended;  /* the host has no more data */
    bool is_paused;
    bool is_bad;        /* a character of the line is damaged, or it is too long */
    bool has_told;      /* that a line went without an answer */
    uint8_t text[LINE]; /* the line that is on its way, and data behind it */
    uint8_t line[LINE]; /* the line that comes */
} s;
static bool is_open;

/* ---- sending: line by line, each waits for its answer ---- */

static void cancel_timer(void) {
    if (s.deadline != 0)
        sp_cancel_timer(ANSWER_TIME);
    s.deadline = 0;
}

/* Ends the job as soon as it is known how much of it has left. */
static void stop(uint8_t failure) {
    if (s.stage == IDLE || s.stage == STOPPING)
        return;
    cancel_timer();
    sp_discard();
    s.stage = STOPPING;
    s.failure = failure;
}

/* Length of the first line, its LF included; 0 if it is not there as a whole. */
static uint32_t first_line(void) {
    for (uint32_t i = 0; i < s.text_length; i++)
        if (s.text[i] == LF)
            return i + 1;
    return 0;
}

/* As much of the line as there is room for. */
static void transmit(void) {
    uint32_t end = first_line(), count = end - s.transmitted;
    if (count > sp_link.transmit_room)
        count = sp_link.transmit_room;
    const uint8_t *piece = s.text + s.transmitted;
    s.sent += count;
    s.transmitted += count;
    if (s.transmitted < end) {
        sp_transmit(piece, count);
        return;
    }
    s.mark = s.mark + 1 < FIRST_MARK ? FIRST_MARK : s.mark + 1;
    sp_transmit_marked(s.mark, piece, count);
    s.stage = LEAVING;
}

/* Does what can be done now. */
static void go_on(void) {
    if (s.stage == FILLING && !s.is_paused) {
        if (first_line() != 0) {
            s.stage = SENDING;
        } else if (s.has_ended) {
            s.stage = IDLE;
            sp_job_done(s.job, s.sent);
            sp_state("idle");
        } else if (s.text_length == LINE) {
            stop(SP_FAILURE_TOO_LONG);
        } else if (s.asked == 0) {
            s.asked = LINE - s.text_length;
            sp_want(s.job, s.asked);
        }
    }
    if (s.stage == SENDING)
        transmit();
}

static void begin(uint32_t job) {
    s.job = job;
    s.text_length = s.asked = s.transmitted = s.refusals = 0;
    s.has_ended = s.is_paused = false;
    s.sent = 0;
    s.stage = FILLING;
    sp_state("sending");
    go_on();
}

static void data(const uint8_t *bytes, uint32_t count) {
    s.asked -= count;
    for (uint32_t i = 0; i < count; i++) {
        if (bytes[i] == ACK || bytes[i] == NAK) {
            /* The other side would take it for an answer. */
            stop(SP_FAILURE_UNSUPPORTED_CHARACTER);
            return;
        }
        if (s.text_length == LINE)
            sp_panic("more data than was asked for");
        s.text[s.text_length++] = bytes[i];
    }
    go_on();
}

/* The last line gets its LF if it has none. */
static void data_ended(void) {
    s.has_ended = true;
    s.asked = 0;
    if (s.text_length > 0 && s.text[s.text_length - 1] != LF) {
        if (s.text_length == LINE) {
            stop(SP_FAILURE_TOO_LONG);
            return;
        }
        s.text[s.text_length++] = LF;
    }
    go_on();
}

/* ACK or NAK has come. Before the line can have left it is no answer. */
static void answered(uint8_t answer) {
    if (s.stage != AWAITING)
        return;
    cancel_timer();
    s.transmitted = 0;
    if (answer == ACK) {
        uint32_t length = first_line();
        s.text_length -= length;
        sp_copy(s.text, s.text + length, s.text_length);
        s.refusals = 0;
        s.stage = FILLING;
    } else if (s.refusals == (uint32_t)settings[SET_REPEATS].number) {
        stop(SP_FAILURE_ATTEMPTS_USED_UP);
    } else {
        s.refusals += 1;
        s.stage = SENDING;
    }
    go_on();
}

/* News of a line's last byte. It is first known that it may have left, then that it has. */
static void line_left(uint8_t state) {
    if (state == SP_MARK_MAYBE_LEFT && s.stage == LEAVING)
        s.stage = AWAITING;
    if (state == SP_MARK_SURELY_LEFT && s.stage == AWAITING) {
        s.deadline = sp_link.now + settings[SET_ANSWER_TIME].number * 1000;
        sp_set_timer(ANSWER_TIME, s.deadline);
    }
}

/* So many bytes were dropped: they never left. */
static void stopped(uint32_t dropped) {
    if (s.stage != STOPPING)
        return;
    s.stage = IDLE;
    sp_job_failed(s.job, s.failure, 0, s.sent - dropped);
    sp_state("idle");
}

/* ---- receiving: each line is delivered and answered ---- */

/* The line that has begun does not count. */
static void forget_line(void) {
    s.line_length = 0;
    s.is_bad = false;
}

/* The line is whole: takes it if it is good and there is room. */
static void line_ended(void) {
    if (s.waiting == ANSWERS) {
        if (!s.has_told)
            sp_note(SP_NOTE_WARNING, 0, "the other side does not wait for answers");
        s.has_told = true; /* one note is enough, and many would not fit */
        return;
    }
    bool is_taken = !s.is_bad && s.line_length <= sp_link.delivery_room;
    if (is_taken) {
        s.delivery += 1;
        s.delivery += s.delivery == 0;
        sp_delivery_begin(s.delivery, 0);
        sp_deliver(s.delivery, s.line, s.line_length);
        sp_delivery_end(s.delivery, 0, 0);
    }
    /* Ahead of a line of ours that is on its way: the other side waits for it. */
    uint8_t answer = is_taken ? ACK : NAK;
    sp_transmit_urgent(ANSWER, &answer, 1);
    s.waiting += 1;
}

static void received(const uint8_t *bytes, uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        if (bytes[i] == ACK || bytes[i] == NAK) {
            answered(bytes[i]);
            continue;
        }
        if (s.line_length < LINE)
            s.line[s.line_length++] = bytes[i];
        else
            s.is_bad = true;
        if (bytes[i] == LF) {
            line_ended();
            forget_line();
        }
    }
}

/* ---- saving and restoring: for swaps on a live link ---- */

static int32_t restore(const uint8_t *payload, uint32_t length) {
    int32_t taken = sp_take_state(&s, sizeof s, 1, payload, length);
    if (taken <= 0)
        return taken;
    /* A saved state may come from anywhere: nothing in it is believed unseen. */
    bool is_sound = s.text_length <= LINE && s.line_length <= LINE && s.waiting <= ANSWERS &&
                    s.stage <= STOPPING;
    if (!is_sound || s.asked > LINE - s.text_length || s.transmitted > first_line())
        return SP_REFUSE_STATE;
    is_open = true;
    return 0;
}

/* ---- events ---- */

static void clear(void *at, uint32_t count) {
    for (uint8_t *byte = at; count > 0; count--)
        *byte++ = 0;
}

static int32_t plugin_event(int32_t kind, const uint8_t *payload, uint32_t length) {
    if (kind == SP_EVENT_SETTINGS)
        return sp_take_settings(settings, types, SETTINGS, payload, length);
    if (sp_settings_given != SETTINGS)
        return SP_REFUSE_MALFORMED_EVENT;
    if (kind == SP_EVENT_RESTORE)
        return restore(payload, length);
    if (kind == SP_EVENT_OPEN && payload[0] == 0) {
        clear(&s, sizeof s);
        s.mark = FIRST_MARK;
        is_open = true;
    }
    if (!is_open)
        return SP_REFUSE_MALFORMED_EVENT;
    switch (kind) {
    case SP_EVENT_OPEN:
        /* A restored plug-in goes on where it was, but the host has forgotten its timers. */
        if (s.deadline != 0)
            sp_set_timer(ANSWER_TIME, s.deadline);
        break;
    case SP_EVENT_CLOSE:
        is_open = false;
        break;
    case SP_EVENT_RECEIVED:
        received(payload, length);
        break;
    case SP_EVENT_LINE_ERROR:
        sp_note(SP_NOTE_WARNING, payload[0], "a damaged character");
        s.is_bad = true;
        break;
    case SP_EVENT_LINK_DOWN:
        stop(SP_FAILURE_LINK_DOWN);
        forget_line();
        break;
    case SP_EVENT_TIMER:
        stop(SP_FAILURE_NO_ANSWER);
        break;
    case SP_EVENT_MARK:
        if (sp_u32(payload) == s.mark)
            line_left(payload[4]);
        else if (sp_u32(payload) == ANSWER && payload[4] == SP_MARK_SURELY_LEFT) {
            s.waiting -= 1;
            s.has_told = false;
        }
        break;
    case SP_EVENT_TRANSMIT_ROOM:
        go_on();
        break;
    case SP_EVENT_DISCARDED:
        stopped(sp_u32(payload));
        break;
    case SP_EVENT_JOB_BEGIN:
        begin(sp_u32(payload));
        break;
    case SP_EVENT_JOB_DATA:
        data(payload + 4, length - 4);
        break;
    case SP_EVENT_JOB_END:
        data_ended();
        break;
    case SP_EVENT_PAUSE:
    case SP_EVENT_RESUME:
        s.is_paused = kind == SP_EVENT_PAUSE;
        go_on();
        break;
    case SP_EVENT_ABORT:
        /* 0 is the delivery under way; here each begins and ends in one event. */
        if (sp_u32(payload) != 0)
            stop(SP_FAILURE_ABORTED);
        break;
    case SP_EVENT_SAVE:
        sp_saved(1, 0, sizeof s, &s, sizeof s);
        break;
    }
    return 0;
}
