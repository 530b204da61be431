//! The configurations that are explored of each profile.

use crate::ExploreError;
use crate::partner::{Control, Partner, Reader, Tnc, Unjudged};
use crate::promise::Guard;
use softplug_abi::{LineParameters, Parity};

/// One configuration of a profile that is explored.
///
/// ```
/// let plan = softplug_explore::plans("r3964")?[0];
/// assert_eq!((plan.name, plan.partner), ("one-block", "a second plug-in"));
/// assert_eq!(plan.jobs[0], [b"A\x10"]);
/// # Ok::<(), softplug_explore::ExploreError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// The profile.
    pub profile: &'static str,
    /// What is explored of it.
    pub name: &'static str,
    /// What stands at the other end.
    pub partner: &'static str,
    /// Settings that are not as the manifest says.
    pub settings: &'static [(&'static str, &'static str)],
    /// The same, of each end.
    pub of_each: [&'static [(&'static str, &'static str)]; 2],
    /// The jobs of each end, one after the other.
    pub jobs: [&'static [&'static [u8]]; 2],
    /// Bytes of deliveries that the host takes before it has to put them away; where it is given,
    /// the host may let them wait.
    pub delivery_room: Option<u32>,
    /// Characters that come in place of another, or out of nothing: one of each class that the
    /// protocol tells apart.
    pub alphabet: &'static [u8],
    /// The characters on the line: each takes a whole ms, so that no rounding tells states apart.
    pub line: LineParameters,
    /// Jobs of both ends may fail because they began at one time.
    pub(crate) may_conflict: bool,
    /// Jobs arrive in other pieces than they were given in: only the model judges them.
    pub(crate) has_pieces: bool,
    pub(crate) guard: Guard,
    pub(crate) make_partner: Option<fn() -> Box<dyn Partner>>,
}

impl Plan {
    /// Plug-ins on the line.
    pub(crate) fn plug_ins(&self) -> usize {
        if self.has_machine() { 1 } else { 2 }
    }

    /// Whether a machine stands at the other end and no plug-in. It knows the plan's settings: with
    /// others, only the profile's model judges.
    ///
    /// ```
    /// assert!(softplug_explore::plans("fanuc-rs232")?[0].has_machine());
    /// # Ok::<(), softplug_explore::ExploreError>(())
    /// ```
    pub fn has_machine(&self) -> bool {
        self.make_partner.is_some()
    }

    /// The promises that the protocol cannot always keep, in the order of
    /// [`Breach::NAMES`](crate::Breach::NAMES).
    ///
    /// ```
    /// let plan = softplug_explore::plans("fanuc-rs232")?[0];
    /// assert_eq!(plan.unavoidable(), ["sent-while-held", "stands-still"]);
    /// # Ok::<(), softplug_explore::ExploreError>(())
    /// ```
    pub fn unavoidable(&self) -> &'static [&'static str] {
        self.guard.unavoidable()
    }
}

/// Short waits, of which none is another's multiple.
const SHORT: &[(&str, &str)] = &[("qvz", "60"), ("zvz", "35"), ("bwz", "170")];
const SHORT_WITHOUT_CHECK: &[(&str, &str)] =
    &[("bcc", "off"), ("qvz", "60"), ("zvz", "35"), ("bwz", "170")];
const FEW_LOW: &[(&str, &str)] =
    &[("priority", "low"), ("setup_attempts", "2"), ("transmission_attempts", "2")];
const FEW_HIGH: &[(&str, &str)] =
    &[("priority", "high"), ("setup_attempts", "2"), ("transmission_attempts", "2")];
const FEW_NONE: &[(&str, &str)] =
    &[("priority", "none"), ("setup_attempts", "2"), ("transmission_attempts", "2")];

/// Waits that the control's own do not reach, of which none is another's multiple.
const FANUC: &[(&str, &str)] = &[
    ("dc1_timeout", "71"),
    ("held_timeout", "46"),
    ("end_wait", "19"),
    ("end_quiet", "7"),
    ("after_dc4", "11"),
    ("quiet_time", "31"),
];

/// Eight bits, one of start and one of stop.
const TEN_BITS: LineParameters = LineParameters::new(10_000);
/// Seven bits, one of start, one of parity and two of stop.
const ELEVEN_BITS: LineParameters =
    LineParameters { baud: 11_000, data_bits: 7, parity: Parity::Even, stop_half_bits: 4 };

const R3964: Plan = Plan {
    profile: "r3964",
    name: "one-block",
    partner: "a second plug-in",
    settings: SHORT,
    of_each: [FEW_LOW, FEW_HIGH],
    jobs: [&[b"A\x10"], &[]],
    delivery_room: None,
    // STX, DLE, ETX, NAK, and a character that is none of them.
    alphabet: &[0x02, 0x10, 0x03, 0x15, 0x41],
    line: TEN_BITS,
    may_conflict: false,
    has_pieces: false,
    guard: Guard::Checked,
    make_partner: None,
};

const SIMPLIFIED: Plan = Plan { profile: "r3964-simplified", of_each: [&[], &[]], ..R3964 };

const FANUC_RS232: Plan = Plan {
    profile: "fanuc-rs232",
    name: "read-and-punch",
    partner: "a control that reads and punches",
    settings: FANUC,
    jobs: [&[b"O1\nG1\n"], &[]],
    // DC1, DC2, DC3, DC4, `%`, EOB, and a character that is none of them.
    alphabet: &[0x11, 0x12, 0x13, 0x14, 0x25, 0x0A, 0x31],
    line: ELEVEN_BITS,
    guard: Guard::Open,
    make_partner: Some(|| Box::new(Control::new())),
    ..XON_XOFF
};

const HEIDENHAIN_FE: Plan = Plan {
    profile: "heidenhain-fe",
    name: "both-ways",
    partner: "a control that asks for a program and puts one out",
    settings: &[
        // The control knows these two.
        ("repeats", "1"),
        ("character_time", "10"),
        ("answer_time", "100"),
        ("block_time", "170"),
        ("request_time", "230"),
    ],
    jobs: [&[b"1\n2\n"], &[]],
    // ACK, NAK, EOT, STX, DC3, and a character that is none of them.
    alphabet: &[0x06, 0x15, 0x04, 0x02, 0x13, 0x41],
    line: ELEVEN_BITS,
    guard: Guard::Unnumbered,
    make_partner: Some(|| Box::new(Tnc::new())),
    ..XON_XOFF
};

const XON_XOFF: Plan = Plan {
    profile: "xon-xoff",
    name: "hold",
    partner: "a machine that holds and sends",
    settings: &[("quiet_time", "50"), ("held_timeout", "200")],
    of_each: [&[], &[]],
    jobs: [&[b"G1X2\n"], &[]],
    // XON, XOFF, and a character that is neither.
    alphabet: &[0x11, 0x13, 0x41],
    guard: Guard::Open,
    make_partner: Some(|| Box::new(Reader::new(b"N7"))),
    ..R3964
};

/// Every configuration that is explored, those of a profile one behind the other.
pub const PLANS: &[Plan] = &[
    R3964,
    Plan { name: "both-send", jobs: [&[b"A"], &[b"B"]], ..R3964 },
    Plan {
        name: "both-high",
        of_each: [FEW_HIGH, FEW_HIGH],
        jobs: [&[b"A"], &[b"B"]],
        may_conflict: true,
        ..R3964
    },
    Plan {
        name: "no-priority",
        of_each: [FEW_NONE, FEW_LOW],
        jobs: [&[b"A"], &[b"B"]],
        may_conflict: true,
        ..R3964
    },
    Plan {
        name: "split",
        settings: &[
            ("qvz", "60"),
            ("zvz", "35"),
            ("bwz", "0"),
            ("split", "on"),
            ("block_size", "1"),
            ("nak_at_start", "off"),
            ("nak_on_garbage", "off"),
        ],
        jobs: [&[b"AB", b"C"], &[]],
        has_pieces: true,
        ..R3964
    },
    Plan {
        name: "no-buffer",
        settings: &[("qvz", "60"), ("zvz", "35"), ("bwz", "170"), ("buffer_wait", "25")],
        jobs: [&[b"A", b"B"], &[]],
        delivery_room: Some(1),
        ..R3964
    },
    Plan { profile: "3964", settings: SHORT_WITHOUT_CHECK, guard: Guard::Unchecked, ..R3964 },
    SIMPLIFIED,
    Plan { name: "both-send", jobs: [&[b"A"], &[b"B"]], may_conflict: true, ..SIMPLIFIED },
    Plan {
        name: "no-handshake",
        settings: &[("handshake", "off"), ("qvz", "60"), ("zvz", "35")],
        guard: Guard::Checked,
        ..SIMPLIFIED
    },
    Plan {
        name: "no-doubling",
        settings: &[
            ("doubling", "off"),
            ("bcc", "off"),
            ("qvz", "60"),
            ("zvz", "35"),
            ("block_size", "1"),
            ("split", "on"),
        ],
        jobs: [&[b"A\x10"], &[]],
        has_pieces: true,
        guard: Guard::Unchecked,
        ..SIMPLIFIED
    },
    XON_XOFF,
    Plan {
        name: "other-codes",
        settings: &[
            ("xon", "14"),
            ("xoff", "15"),
            ("control_in_data", "refuse"),
            ("send_line_end", "lfcrcr"),
            ("quiet_time", "50"),
            ("held_timeout", "200"),
        ],
        jobs: [&[b"A\n", b"B\x0e"], &[]],
        // XON and XOFF as they are set, and as they usually are.
        alphabet: &[0x0E, 0x0F, 0x11, 0x13],
        make_partner: Some(|| Box::new(Reader::unjudged(b"N"))),
        ..XON_XOFF
    },
    Plan {
        name: "receive",
        settings: &[
            ("quiet_time", "50"),
            ("low_mark", "5"),
            ("high_mark", "6"),
            ("xon_repeat", "20"),
            ("xoff_repeat", "1"),
            ("xon_at_open", "on"),
        ],
        jobs: [&[], &[]],
        delivery_room: Some(8),
        make_partner: Some(|| Box::new(Reader::sending_at_once(b"N7G1X2"))),
        ..XON_XOFF
    },
    Plan {
        name: "end-mark",
        settings: &[
            ("quiet_time", "50"),
            ("end_quiet", "20"),
            ("end_mark", "25"),
            ("receive_line_end", "lf"),
            ("receive_drop", "00"),
            ("on_line_error", "keep"),
        ],
        jobs: [&[], &[]],
        // CR, LF, %, NUL, and XOFF.
        alphabet: &[0x0D, 0x0A, 0x25, 0x00, 0x13],
        make_partner: Some(|| Box::new(Reader::sending_at_once(b"\r\n%\0"))),
        ..XON_XOFF
    },
    Plan {
        name: "transparent",
        settings: &[("transparent", "on"), ("quiet_time", "50"), ("held_timeout", "200")],
        jobs: [&[b"\x11\x10\x93"], &[]],
        // XON, XOFF, DLE, an escaped DLE, and a character that is none of them.
        alphabet: &[0x11, 0x13, 0x10, 0x50, 0x41],
        make_partner: Some(|| Box::new(Reader::unjudged(b"\x10\x51"))),
        ..XON_XOFF
    },
    Plan {
        name: "strings",
        settings: &[
            ("feed_start", "3c"),
            ("feed_end", "3e"),
            ("abort_send", "21"),
            ("wait_for_xon", "on"),
            ("send_line_end", "crlf"),
            ("send_drop", "00"),
            ("control_in_data", "drop"),
            ("parity_mask", "127"),
            ("while_sending", "ignore"),
            ("quiet_time", "50"),
            ("held_timeout", "200"),
        ],
        jobs: [&[b"A\n\x13", b"\0B"], &[]],
        // XON and XOFF, each also with its parity bit, and a character that is neither.
        alphabet: &[0x11, 0x13, 0x91, 0x93, 0x41],
        make_partner: Some(|| Box::new(Reader::letting_go(b"N"))),
        ..XON_XOFF
    },
    Plan {
        name: "line-ends",
        settings: &[
            ("send_line_end", "crlf"),
            ("control_in_data", "send"),
            ("quiet_time", "50"),
            ("held_timeout", "200"),
        ],
        jobs: [&[b"A\n\r\rB\x13\n\r"], &[]],
        make_partner: Some(|| Box::new(Reader::unjudged(b"\x93"))),
        ..XON_XOFF
    },
    HEIDENHAIN_FE,
    Plan {
        name: "bare",
        of_each: [
            &[("dc1", "off"), ("bcc_space", "on"), ("parity", "even"), ("line_end", "crlf")],
            &[],
        ],
        jobs: [&[b"1\r\n2"], &[]],
        line: LineParameters {
            baud: 11_000,
            data_bits: 8,
            parity: Parity::None,
            stop_half_bits: 4,
        },
        make_partner: Some(|| Box::new(Unjudged(Box::new(Tnc::new())))),
        ..HEIDENHAIN_FE
    },
    Plan {
        name: "lines",
        jobs: [&[b"1\r\n2"], &[]],
        make_partner: Some(|| Box::new(Unjudged(Box::new(Tnc::new())))),
        ..HEIDENHAIN_FE
    },
    FANUC_RS232,
    Plan {
        name: "texts",
        of_each: [
            &[
                ("eob", "lfcrcr"),
                ("line_end", "crlf"),
                ("leader", "1"),
                ("trailer", "1"),
                ("tv_pad", "on"),
                ("tv_check", "on"),
                ("unsupported", "space"),
                ("replace", "3b2f"),
                ("block_numbers", "renumber"),
                ("answer_dc2", "on"),
                ("programs", "split"),
            ],
            &[],
        ],
        jobs: [&[b"o1;{\n"], &[]],
        make_partner: Some(|| Box::new(Unjudged(Box::new(Control::new())))),
        ..FANUC_RS232
    },
    Plan {
        name: "tape",
        of_each: [
            &[
                ("eob", "crlf"),
                ("ascii", "on"),
                ("parity", "software"),
                ("after_end", "drop"),
                ("block_numbers", "renumber"),
            ],
            &[],
        ],
        jobs: [&[b"N1(:%)[\r\nN5@\r\n%\nX"], &[]],
        line: TEN_BITS,
        make_partner: Some(|| Box::new(Unjudged(Box::new(Control::new())))),
        ..FANUC_RS232
    },
    Plan {
        name: "refuse",
        of_each: [&[("after_end", "refuse"), ("unsupported", "refuse")], &[]],
        jobs: [&[b"G1@\n", b"G2\n%\nX\n"], &[]],
        make_partner: Some(|| Box::new(Unjudged(Box::new(Control::new())))),
        ..FANUC_RS232
    },
    Plan {
        name: "eia",
        of_each: [
            &[
                ("end_wait", "0"),
                ("code", "eia"),
                ("receive_code", "eia"),
                ("parity", "none"),
                ("need_dc2", "off"),
                ("resume_code", "dc2"),
            ],
            &[],
        ],
        jobs: [&[b"O1\n"], &[]],
        // DC1, DC2, DC3, DC4, the EOR and the EOB of EIA, and a digit.
        alphabet: &[0x11, 0x12, 0x93, 0x94, 0x0B, 0x80, 0x01],
        line: TEN_BITS,
        make_partner: Some(|| Box::new(Unjudged(Box::new(Control::new())))),
        ..FANUC_RS232
    },
];

/// One larger configuration of each profile, for random ways.
pub const LARGER: &[Plan] = &[
    Plan {
        name: "large",
        jobs: [&[b"G1X2\x10\x02\x03", b"B\x10\x10"], &[b"N7\x15", b"8"]],
        ..R3964
    },
    Plan {
        profile: "3964",
        name: "large",
        settings: SHORT_WITHOUT_CHECK,
        jobs: [&[b"G1X2\x10\x02\x03", b"B\x10\x10"], &[b"N7\x15", b"8"]],
        guard: Guard::Unchecked,
        ..R3964
    },
    Plan {
        name: "large",
        jobs: [&[b"G1X2\x10\x02\x03", b"B\x10\x10"], &[b"N7\x15", b"8"]],
        may_conflict: true,
        ..SIMPLIFIED
    },
    Plan {
        name: "large",
        jobs: [&[b"N1G0X1\n", b"N2G1Y2\nM30\n"], &[]],
        make_partner: Some(|| Box::new(Reader::new(b"N7G1X2\nM30\n"))),
        ..XON_XOFF
    },
    Plan { name: "large", jobs: [&[b"O1\nG1X2\nG2\nM30\n"], &[]], ..FANUC_RS232 },
    Plan { name: "large", jobs: [&[b"1\n22\n3\n\n4\n"], &[]], ..HEIDENHAIN_FE },
];

/// The larger configuration of this profile.
///
/// # Errors
/// There is none.
///
/// ```
/// assert_eq!(softplug_explore::larger("r3964")?.jobs[0].len(), 2);
/// # Ok::<(), softplug_explore::ExploreError>(())
/// ```
pub fn larger(profile: &str) -> Result<&'static Plan, ExploreError> {
    LARGER.iter().find(|plan| plan.profile == profile).ok_or_else(|| no_plan(profile))
}

/// The configurations of this profile that are explored.
///
/// # Errors
/// There are none.
///
/// The example of [`Plan`] shows it.
pub fn plans(profile: &str) -> Result<Vec<&'static Plan>, ExploreError> {
    let plans: Vec<_> = PLANS.iter().filter(|plan| plan.profile == profile).collect();
    if plans.is_empty() { Err(no_plan(profile)) } else { Ok(plans) }
}

fn no_plan(profile: &str) -> ExploreError {
    let known: Vec<_> = LARGER.iter().map(|plan| plan.profile).collect();
    ExploreError::NoPlan { profile: profile.to_owned(), known: known.join(", ") }
}
