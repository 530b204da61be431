/* softplug.h: the Softplug ABI, version 1.0, for C without a library.
 *
 * Include it in exactly one file of a plug-in. That file implements
 *
 *     static int32_t plugin_event(int32_t kind, const uint8_t *payload, uint32_t length);
 *
 * which handles one event and writes actions with the functions below. It returns 0, or a
 * refusal (SP_REFUSE_...). Build it with
 *
 *     clang --target=wasm32 -mcpu=mvp -Oz -ffreestanding -nostdlib \
 *         -Wl,--no-entry -Wl,--strip-all -Wl,--compress-relocations -Wl,-zstack-size=1024 \
 *         -Wl,--initial-memory=65536 -Wl,--max-memory=65536 -o my-plugin.wasm my_plugin.c
 *     softplug pack my-plugin.wasm --manifest my-plugin.json
 *
 * All that is said of events, actions, codes and limits stands in docs/abi.md; a test holds
 * the numbers here against those of the Rust crate. Before an event reaches plugin_event its
 * length was checked, so that the fixed fields of its table are there.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#ifndef SOFTPLUG_H
#define SOFTPLUG_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
#error "softplug.h is for C; C++ would need a library for its statics"
#endif

/* Sizes of the mailbox in bytes. Define them before including this file to change them. */
#ifndef SP_INPUT_BYTES
#define SP_INPUT_BYTES 1040 /* 512 to 32,768 */
#endif
#ifndef SP_OUTPUT_BYTES
#define SP_OUTPUT_BYTES 4096 /* 512 to 32,768 */
#endif
#ifndef SP_WORDS_BYTES
#define SP_WORDS_BYTES 64 /* 64 to 1,024 */
#endif

/* Events: the first argument of a step. */
enum {
    SP_EVENT_SETTINGS = 1,
    SP_EVENT_OPEN = 2,
    SP_EVENT_CLOSE = 3,
    SP_EVENT_RECEIVED = 4,
    SP_EVENT_LINE_ERROR = 5,
    SP_EVENT_MODEM_LINES = 6,
    SP_EVENT_LINK_DOWN = 7,
    SP_EVENT_LINK_UP = 8,
    SP_EVENT_TIMER = 9,
    SP_EVENT_MARK = 10,
    SP_EVENT_TRANSMIT_ROOM = 11,
    SP_EVENT_DISCARDED = 12,
    SP_EVENT_DELIVERY_ROOM = 13,
    SP_EVENT_JOB_BEGIN = 14,
    SP_EVENT_JOB_DATA = 15,
    SP_EVENT_JOB_END = 16,
    SP_EVENT_PAUSE = 17,
    SP_EVENT_RESUME = 18,
    SP_EVENT_ABORT = 19,
    SP_EVENT_FORCE_RESUME = 20,
    SP_EVENT_ANSWER = 21,
    SP_EVENT_SAVE = 22,
    SP_EVENT_RESTORE = 23,
    SP_EVENT_CONTINUE = 24,
};

/* Actions: the kinds of the records in the output buffer. */
enum {
    SP_ACTION_TRANSMIT = 1,
    SP_ACTION_TRANSMIT_URGENT = 2,
    SP_ACTION_HOLD = 3,
    SP_ACTION_RELEASE = 4,
    SP_ACTION_DISCARD = 5,
    SP_ACTION_SET_TIMER = 6,
    SP_ACTION_CANCEL_TIMER = 7,
    SP_ACTION_MODEM_LINES = 8,
    SP_ACTION_BREAK = 9,
    SP_ACTION_WANT = 10,
    SP_ACTION_DELIVERY_BEGIN = 11,
    SP_ACTION_DELIVER = 12,
    SP_ACTION_DELIVERY_NAME = 13,
    SP_ACTION_DELIVERY_END = 14,
    SP_ACTION_JOB_DONE = 15,
    SP_ACTION_JOB_FAILED = 16,
    SP_ACTION_CHECK_RESULT = 17,
    SP_ACTION_REQUEST = 18,
    SP_ACTION_WITHDRAW = 19,
    SP_ACTION_NOTE = 20,
    SP_ACTION_STATE = 21,
    SP_ACTION_SAVED = 22,
};

/* Why a job or a delivery failed, or a request was refused. 0: it did not. */
enum {
    SP_FAILURE_ABORTED = 1,
    SP_FAILURE_NO_ANSWER = 2,
    SP_FAILURE_REFUSED = 3,
    SP_FAILURE_LINE_ERROR = 4,
    SP_FAILURE_PROTOCOL = 5,
    SP_FAILURE_CHECKSUM = 6,
    SP_FAILURE_TOO_LONG = 7,
    SP_FAILURE_UNSUPPORTED_CHARACTER = 8,
    SP_FAILURE_HELD_TOO_LONG = 9,
    SP_FAILURE_PARTNER_RESET = 10,
    SP_FAILURE_PARTNER_ALARM = 11,
    SP_FAILURE_LINK_DOWN = 12,
    SP_FAILURE_PARTNER_GONE = 13,
    SP_FAILURE_OVERRUN = 14,
    SP_FAILURE_NO_END_MARK = 15,
    SP_FAILURE_CONFLICT = 16,
    SP_FAILURE_ATTEMPTS_USED_UP = 17,
    SP_FAILURE_BAD_JOB = 18,
    SP_FAILURE_NOT_SUPPORTED = 19,
    SP_FAILURE_INTERRUPTED = 20,
    SP_FAILURE_BUSY = 21,
    SP_FAILURE_NOT_FOUND = 22,
    SP_FAILURE_DENIED = 23,
    SP_FAILURE_BREAK = 24,
    SP_FAILURE_ECHO = 25,
    SP_FAILURE_NO_BUFFER = 26,
    SP_FAILURE_PARITY_CHECK = 27,
    SP_FAILURE_INTERNAL = 28,
};

/* Why a plug-in does not take an event: what plugin_event returns. */
enum {
    SP_REFUSE_MALFORMED_EVENT = -1,
    SP_REFUSE_UNKNOWN_EVENT = -2,
    SP_REFUSE_SETTINGS = -3,
    SP_REFUSE_STATE = -4,
};

/* Kinds of line error. */
enum {
    SP_LINE_ERROR_PARITY = 1,
    SP_LINE_ERROR_FRAMING = 2,
    SP_LINE_ERROR_PARITY_OR_FRAMING = 3,
    SP_LINE_ERROR_OVERRUN = 4,
    SP_LINE_ERROR_BREAK = 5,
};

/* Why the link is down. */
enum {
    SP_LINK_DOWN_UNPLUGGED = 1,
    SP_LINK_DOWN_DISCONNECTED = 2,
    SP_LINK_DOWN_FAILED = 3,
};

/* How far a marked byte has come. */
enum {
    SP_MARK_MAYBE_LEFT = 1,
    SP_MARK_SURELY_LEFT = 2,
    SP_MARK_DROPPED = 3,
};

/* Levels of a note. */
enum {
    SP_NOTE_ERROR = 1,
    SP_NOTE_WARNING = 2,
    SP_NOTE_INFO = 3,
    SP_NOTE_DEBUG = 4,
};

/* Modem lines, as bits of a set. */
enum {
    SP_LINE_CTS = 1,
    SP_LINE_DSR = 2,
    SP_LINE_DCD = 4,
    SP_LINE_RI = 8,
    SP_LINE_RTS = 16,
    SP_LINE_DTR = 32,
};

/* Types of a value record. A plug-in's own table says of a bool and of a choice how many values
 * there are: SP_VALUE_BOOL | SP_CHOICES(2). */
enum {
    SP_VALUE_BOOL = 1,
    SP_VALUE_INT = 2,
    SP_VALUE_TEXT = 3,
    SP_VALUE_BYTES = 4,
    SP_VALUE_CHOICE = 5,
};
#define SP_CHOICES(count) ((count) << 4)

/* Limits. */
enum {
    SP_LIMIT_MODULE_BYTES = 262144,
    SP_LIMIT_MEMORY_PAGES = 4,
    SP_LIMIT_TYPES = 1024,
    SP_LIMIT_PARAMETERS = 64,
    SP_LIMIT_FUNCTIONS = 4096,
    SP_LIMIT_GLOBALS = 1024,
    SP_LIMIT_EXPORTS = 256,
    SP_LIMIT_ELEMENTS = 1024,
    SP_LIMIT_SEGMENTS = 1024,
    SP_LIMIT_LOCALS = 1024,
    SP_LIMIT_NESTING = 1024,
    SP_LIMIT_FUNCTION_WEIGHT = 500000,
    SP_LIMIT_MODULE_WEIGHT = 1500000,
    SP_LIMIT_MANIFEST_BYTES = 65536,
    SP_LIMIT_INPUT_BYTES_LEAST = 512,
    SP_LIMIT_INPUT_BYTES_MOST = 32768,
    SP_LIMIT_OUTPUT_BYTES_LEAST = 512,
    SP_LIMIT_OUTPUT_BYTES_MOST = 32768,
    SP_LIMIT_WORDS_BYTES_LEAST = 64,
    SP_LIMIT_WORDS_BYTES_MOST = 1024,
    SP_LIMIT_TIMERS = 16,
    SP_LIMIT_RECORD_BYTES = 65535,
    SP_LIMIT_URGENT_BYTES = 16,
    SP_LIMIT_MARKS = 64,
    SP_LIMIT_STEPS_PER_INSTANT = 1000,
    SP_LIMIT_OUTPUT_ROUNDS = 256,
    SP_LIMIT_STATE_BYTES = 65536,
    SP_LIMIT_FUEL_PER_EVENT = 1000000,
    SP_LIMIT_SETTINGS = 128,
    SP_LIMIT_VALUE_BYTES = 400,
    SP_LIMIT_FIELDS = 16,
    SP_LIMIT_NOTE_BYTES = 240,
    SP_LIMIT_STATE_NAME_BYTES = 48,
    SP_LIMIT_DELIVERY_NAME_BYTES = 128,
    SP_LIMIT_REQUESTS = 4,
    SP_LIMIT_BREAK_MICROS = 10000000,
};
_Static_assert(SP_INPUT_BYTES >= SP_LIMIT_INPUT_BYTES_LEAST &&
                   SP_INPUT_BYTES <= SP_LIMIT_INPUT_BYTES_MOST,
               "SP_INPUT_BYTES is outside the ABI's limits");
_Static_assert(SP_OUTPUT_BYTES >= SP_LIMIT_OUTPUT_BYTES_LEAST &&
                   SP_OUTPUT_BYTES <= SP_LIMIT_OUTPUT_BYTES_MOST,
               "SP_OUTPUT_BYTES is outside the ABI's limits");
_Static_assert(SP_WORDS_BYTES >= SP_LIMIT_WORDS_BYTES_LEAST &&
                   SP_WORDS_BYTES <= SP_LIMIT_WORDS_BYTES_MOST,
               "SP_WORDS_BYTES is outside the ABI's limits");

/* Of a step's result: call again with SP_EVENT_CONTINUE. */
enum { SP_MORE_OUTPUT = 0x40000000 };

/* The optimiser repeats small functions in their callers where that costs more than it saves. */
#define SP_SHARED __attribute__((noinline))
#define SP_IN_PLACE __attribute__((always_inline)) inline

static int32_t plugin_event(int32_t kind, const uint8_t *payload, uint32_t length);

/* The link, as long as one event is handled. */
static struct {
    int64_t now;            /* µs on the link's clock */
    uint32_t transmit_room; /* bytes that may be transmitted now */
    uint32_t delivery_room; /* bytes that may be delivered now */
    uint32_t written;       /* bytes of actions so far */
    uint8_t *last;          /* the latest record, if it is one that can grow */
    bool more;              /* call again with SP_EVENT_CONTINUE */
} sp_link;

static uint8_t sp_input[SP_INPUT_BYTES];
static uint8_t sp_output[SP_OUTPUT_BYTES];
static uint8_t sp_words[SP_WORDS_BYTES];

static void sp_copy(void *to, const void *from, uint32_t count) {
    uint8_t *at = to;
    const uint8_t *next = from;
    for (; count > 0; count--)
        *at++ = *next++;
}

static uint32_t sp_length(const char *text) {
    const char *end = text;
    while (*end != 0)
        end++;
    return (uint32_t)(end - text);
}

/* Leaves a sentence for the host, of which it keeps SP_WORDS_BYTES - 4, and ends the instance. */
static _Noreturn void sp_panic(const char *text) {
    uint32_t length = sp_length(text);
    if (length > SP_WORDS_BYTES - 4)
        length = SP_WORDS_BYTES - 4;
    __builtin_memcpy(sp_words, &length, 4);
    sp_copy(sp_words + 4, text, length);
    __builtin_trap();
}

/* ---- reading a payload: little-endian, without alignment ---- */

static inline uint32_t sp_u16(const uint8_t *at) { return at[0] | (uint32_t)at[1] << 8; }

static inline uint32_t sp_u32(const uint8_t *at) {
    uint32_t value;
    __builtin_memcpy(&value, at, 4);
    return value;
}

static inline int64_t sp_i64(const uint8_t *at) {
    int64_t value;
    __builtin_memcpy(&value, at, 8);
    return value;
}

/* One setting as it was given: the `number` of a bool, int or choice, `length` and `bytes` of the
 * others. */
#ifndef SP_SETTING_BYTES
#define SP_SETTING_BYTES 32 /* of the longest text or bytes among this plug-in's settings, at least 8 */
#endif
#ifndef SP_SETTING_NUMBER
#define SP_SETTING_NUMBER int64_t /* int32_t makes a smaller plug-in, if its ranges fit */
#endif
typedef struct {
    uint32_t length;
    union {
        SP_SETTING_NUMBER number;
        uint8_t bytes[SP_SETTING_BYTES];
    };
} sp_setting;

/* How many settings have been given so far. */
static uint32_t sp_settings_given;

/* Takes an event `settings` into a table of `count`; `types` has the type of each (SP_VALUE_...).
 * Returns what plugin_event returns for it, before checks of its own; if that is 0 and bit 1 of
 * payload[0] is set, the table is complete. */
static int32_t sp_take_settings(sp_setting *table, const uint8_t *types, uint32_t count,
                                const uint8_t *payload, uint32_t length) {
    static const uint8_t sizes[] = {0, 1, 8, 0, 0, 2}; /* 0: any */
    uint32_t at = 1, index = payload[0] & 1 ? 0 : sp_settings_given;
    sp_settings_given = 0; /* none, if one of these is refused */
    for (; at < length; index++) {
        if (length - at < 6)
            return SP_REFUSE_MALFORMED_EVENT;
        const uint8_t *record = payload + at;
        uint32_t size = sp_u16(record + 4);
        at += 6 + size;
        if (at > length)
            return SP_REFUSE_MALFORMED_EVENT;
        if (index >= count)
            return SP_REFUSE_SETTINGS;
        sp_setting *setting = &table[index];
        uint32_t type = types[index] & 15, choices = types[index] >> 4;
        if (sp_u32(record) != (index | type << 16))
            return SP_REFUSE_SETTINGS;
        if (sizes[type] != 0 && size != sizes[type])
            return SP_REFUSE_MALFORMED_EVENT;
        if (size > SP_SETTING_BYTES)
            return SP_REFUSE_SETTINGS;
        setting->number = 0;
        sp_copy(setting->bytes, record + 6, size);
        setting->length = size;
        if ((uint64_t)setting->number > (uint64_t)choices - 1) /* of no choices all are good */
            return SP_REFUSE_SETTINGS;
    }
    sp_settings_given = index;
    return (payload[0] & 2) && index != count ? SP_REFUSE_SETTINGS : 0;
}

/* Takes an event `restore` into `state`, which was saved as `format` and has `size` bytes. Returns
 * a refusal, 0 if there is more to come, or 1 when the state is complete. */
static int32_t sp_take_state(void *state, uint32_t size, uint32_t format, const uint8_t *payload,
                             uint32_t length) {
    uint32_t offset = sp_u32(payload + 4), count = length - 12, end = offset + count;
    if (sp_u32(payload) != format || sp_u32(payload + 8) != size || offset > size || end > size)
        return SP_REFUSE_STATE;
    sp_copy((uint8_t *)state + offset, payload + 12, count);
    return end == size;
}

/* ---- writing actions ---- */

/* Room for `count` more bytes of actions. */
static uint8_t *sp_reserve(uint32_t count) {
    uint32_t at = sp_link.written;
    if (count > SP_OUTPUT_BYTES - at)
        sp_panic("the output buffer is full");
    sp_link.written = at + count;
    return sp_output + at;
}

static void sp_bytes(const void *bytes, uint32_t count) {
    sp_copy(sp_reserve(count), bytes, count);
}

static void sp_put(uint32_t value) { __builtin_memcpy(sp_reserve(4), &value, 4); }

static void sp_put_long(uint64_t value) { __builtin_memcpy(sp_reserve(8), &value, 8); }

/* Begins a record of `length` bytes of payload, at most 65,535. */
SP_SHARED static void sp_begin(uint32_t kind, uint32_t length) {
    sp_link.last = 0;
    sp_put(kind | length << 16);
}

/* A record of one number, or of two. */
static inline void sp_one(uint32_t kind, uint32_t number) {
    sp_begin(kind, 4);
    sp_put(number);
}

static void sp_two(uint32_t kind, uint32_t first, uint32_t second) {
    sp_begin(kind, 8);
    sp_put(first);
    sp_put(second);
}

/* A record that begins with a number, then bytes. */
static void sp_record(uint32_t kind, uint32_t number, const void *bytes, uint32_t count) {
    sp_begin(kind, 4 + count);
    sp_put(number);
    sp_bytes(bytes, count);
}

/* Bytes left in the output buffer, headers of 4 bytes included. */
static inline uint32_t sp_output_room(void) { return SP_OUTPUT_BYTES - sp_link.written; }

SP_IN_PLACE static void sp_use(uint32_t *room, uint32_t count) {
    if (count > *room)
        sp_panic("more bytes than room");
    *room -= count;
}

/* A record of bytes for which there is `room`; with its neighbour of the same kind and number it
 * becomes one. */
static void sp_append(uint32_t *room, uint32_t kind, uint32_t number, const void *bytes,
                      uint32_t count) {
    if (count == 0)
        return;
    sp_use(room, count);
    uint8_t *record = sp_link.last;
    if (record != 0 && record[0] == kind && sp_u32(record + 4) == number) {
        uint32_t header = sp_u32(record) + (count << 16);
        __builtin_memcpy(record, &header, 4);
        sp_bytes(bytes, count);
        return;
    }
    record = sp_output + sp_link.written;
    sp_record(kind, number, bytes, count);
    sp_link.last = record;
}

/* Appends bytes to the transmit queue; nothing for 0 bytes. */
static inline void sp_transmit(const void *bytes, uint32_t count) {
    sp_append(&sp_link.transmit_room, SP_ACTION_TRANSMIT, 0, bytes, count);
}

/* The same with a mark, not 0: SP_EVENT_MARK tells when the last of the bytes has left; with
 * no bytes, when the last of the queue has. */
static inline void sp_transmit_marked(uint32_t mark, const void *bytes, uint32_t count) {
    sp_use(&sp_link.transmit_room, count);
    sp_record(SP_ACTION_TRANSMIT, mark, bytes, count);
}

/* Sends 1 to 16 bytes ahead of queue and hold; mark 0: none. */
static inline void sp_transmit_urgent(uint32_t mark, const void *bytes, uint32_t count) {
    sp_record(SP_ACTION_TRANSMIT_URGENT, mark, bytes, count);
}

/* Stops the transmit queue before its next byte, lets it go on, drops what it holds. */
static inline void sp_hold(void) { sp_begin(SP_ACTION_HOLD, 0); }
static inline void sp_release(void) { sp_begin(SP_ACTION_RELEASE, 0); }
static inline void sp_discard(void) { sp_begin(SP_ACTION_DISCARD, 0); }

/* Sets timer `id` (0 to 15) to an absolute time in µs; the past runs out now. */
static inline void sp_set_timer(uint8_t id, int64_t deadline) {
    sp_begin(SP_ACTION_SET_TIMER, 9);
    *sp_reserve(1) = id;
    sp_put_long((uint64_t)deadline);
}

static inline void sp_cancel_timer(uint8_t id) {
    sp_begin(SP_ACTION_CANCEL_TIMER, 1);
    *sp_reserve(1) = id;
}

/* Sets RTS and DTR: those in `mask`, on where they are in `on` too. */
static inline void sp_set_modem_lines(uint8_t mask, uint8_t on) {
    sp_begin(SP_ACTION_MODEM_LINES, 2);
    *sp_reserve(1) = mask;
    *sp_reserve(1) = on;
}

/* Sends a break of 1 to 10,000,000 µs. */
static inline void sp_break(uint32_t micros) { sp_one(SP_ACTION_BREAK, micros); }

/* Asks for `count` more bytes of the job's data, at least 1. */
static inline void sp_want(uint32_t job, uint32_t count) {
    sp_two(SP_ACTION_WANT, job, count);
}

/* Begins a delivery under an id of your choice, not 0; `job` that it answers, or 0. */
static inline void sp_delivery_begin(uint32_t delivery, uint32_t job) {
    sp_two(SP_ACTION_DELIVERY_BEGIN, delivery, job);
}

/* Hands bytes to the host; nothing for 0 bytes. */
static inline void sp_deliver(uint32_t delivery, const void *bytes, uint32_t count) {
    sp_append(&sp_link.delivery_room, SP_ACTION_DELIVER, delivery, bytes, count);
}

/* Names the delivery: at most 128 bytes of UTF-8. */
static inline void sp_delivery_name(uint32_t delivery, const char *name, uint32_t length) {
    sp_record(SP_ACTION_DELIVERY_NAME, delivery, name, length);
}

/* Failure and the protocol's own code, as they stand in records. */
static inline uint32_t sp_why(uint16_t failure, uint16_t status) {
    return failure | (uint32_t)status << 16;
}

/* Ends the delivery: failure 0 is complete. */
static inline void sp_delivery_end(uint32_t delivery, uint16_t failure, uint16_t status) {
    sp_two(SP_ACTION_DELIVERY_END, delivery, sp_why(failure, status));
}

/* The job is done; so many bytes left for it. */
static inline void sp_job_done(uint32_t job, uint64_t sent) {
    sp_begin(SP_ACTION_JOB_DONE, 12);
    sp_put(job);
    sp_put_long(sent);
}

/* The job has failed; so many bytes left for it. */
static inline void sp_job_failed(uint32_t job, uint16_t failure, uint16_t status, uint64_t sent) {
    sp_begin(SP_ACTION_JOB_FAILED, 16);
    sp_put(job);
    sp_put(sp_why(failure, status));
    sp_put_long(sent);
}

/* The check pass has ended: good with failure 0, else where the fault lies, from 1. */
static inline void sp_check_result(uint32_t job, uint16_t failure, uint16_t status, uint32_t line,
                                   uint32_t column) {
    sp_begin(SP_ACTION_CHECK_RESULT, 16);
    sp_put(job);
    sp_put(sp_why(failure, status));
    sp_put(line);
    sp_put(column);
}

/* Asks the host for something of `kind`; `fields` are value records. */
static inline void sp_request(uint32_t request, uint16_t kind, const void *fields,
                              uint32_t length) {
    sp_begin(SP_ACTION_REQUEST, 6 + length);
    sp_put(request);
    sp_bytes(&kind, 2); /* little-endian, as all of wasm is */
    sp_bytes(fields, length);
}

/* Takes a request back. */
static inline void sp_withdraw(uint32_t request) { sp_one(SP_ACTION_WITHDRAW, request); }

/* A line for the log: at most 240 bytes of UTF-8. */
SP_IN_PLACE static void sp_note(uint8_t level, uint16_t code, const char *text) {
    sp_record(SP_ACTION_NOTE, level | (uint32_t)code << 16, text, sp_length(text));
}

/* Names the state for people: at most 48 bytes of UTF-8. */
static inline void sp_state(const char *name) {
    uint32_t length = sp_length(name);
    sp_begin(SP_ACTION_STATE, length);
    sp_bytes(name, length);
}

/* A piece of the saved state; asked for by SP_EVENT_SAVE. */
static inline void sp_saved(uint16_t format, uint32_t offset, uint32_t total, const void *bytes,
                            uint32_t count) {
    sp_begin(SP_ACTION_SAVED, 12 + count);
    sp_put(format);
    sp_put(offset);
    sp_put(total);
    sp_bytes(bytes, count);
}

/* ---- the two exported functions ---- */

static const struct {
    const uint8_t *input;
    uint32_t input_bytes;
    const uint8_t *output;
    uint32_t output_bytes;
    const uint8_t *words;
    uint32_t words_bytes;
} sp_mailbox = {sp_input, SP_INPUT_BYTES, sp_output, SP_OUTPUT_BYTES, sp_words, SP_WORDS_BYTES};

__attribute__((export_name("softplug_v1"))) int32_t softplug_v1(void) {
    return (int32_t)(uintptr_t)&sp_mailbox;
}

/* Whether a payload has a length that its event can have. */
static inline bool sp_has_length(int32_t kind, uint32_t length) {
    /* Bit 7: at least so many; else exactly. */
    static const uint8_t lengths[] = {
        0,        0x80 | 1, 16, 0,        0x80 | 1, 8, 2, 1, 0, 9, 5,        4, 4,
        4,        0x80 | 16, 0x80 | 5, 4, 4,        4, 4, 0, 0x80 | 8, 0, 0x80 | 12, 0,
    };
    uint8_t asked = lengths[kind];
    return asked & 0x80 ? length >= (asked & 0x7F) : length == asked;
}

__attribute__((export_name("softplug_v1_step"))) int32_t softplug_v1_step(int32_t kind,
                                                                          int32_t length,
                                                                          int64_t now_us) {
    if (kind < SP_EVENT_SETTINGS || kind > SP_EVENT_CONTINUE)
        return SP_REFUSE_UNKNOWN_EVENT;
    if ((uint32_t)length > SP_INPUT_BYTES || !sp_has_length(kind, (uint32_t)length))
        return SP_REFUSE_MALFORMED_EVENT;
    sp_link.now = now_us;
    sp_link.written = 0;
    sp_link.last = 0;
    sp_link.more = false;
    if (kind == SP_EVENT_OPEN) {
        sp_link.transmit_room = sp_u32(sp_input + 8);
        sp_link.delivery_room = sp_u32(sp_input + 12);
    }
    if (kind == SP_EVENT_TRANSMIT_ROOM || kind == SP_EVENT_DISCARDED)
        sp_link.transmit_room += sp_u32(sp_input);
    if (kind == SP_EVENT_DELIVERY_ROOM)
        sp_link.delivery_room += sp_u32(sp_input);
    int32_t refusal = plugin_event(kind, sp_input, (uint32_t)length);
    if (refusal < 0)
        return refusal;
    return (int32_t)(sp_link.written | (sp_link.more ? SP_MORE_OUTPUT : 0));
}

#endif
