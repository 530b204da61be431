//! The clauses of the page, by what they are about, and their ids in each ledger.

/// Which profile of the page a station is judged by.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Procedure {
    /// 3964R: blocks end with a check character.
    R3964,
    /// 3964: the same without it.
    Plain3964,
    /// The subset that small devices share.
    Simplified,
    /// What lies below telegrams of RK512: 3964R or 3964.
    Rk512,
}

/// A rule of the page.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Rule {
    /// A block is its data, doubled, and DLE ETX.
    Frame,
    /// The check character.
    Bcc,
    /// STX, and the data follow a DLE.
    SetUp,
    /// How long DLE is awaited.
    Qvz,
    /// NAK, another or a damaged character instead of DLE.
    SetUpRefused,
    /// So many STX, then one NAK.
    SetUpAttempts,
    /// What comes too early is no answer.
    LateDle,
    /// A NAK stops the block.
    StopOnNak,
    /// Any other character stops it, too.
    StopOnOther,
    /// DLE behind the block.
    Acknowledged,
    /// The whole block again, from STX.
    Repeat,
    /// Nothing but DLE acknowledges.
    NoFalseSuccess,
    /// So many blocks, then one NAK.
    TransmissionAttempts,
    /// One block: the cause is told.
    OneAttempt,
    /// A job longer than a block.
    TooLongJob,
    /// A job of several blocks.
    Split,
    /// A job that comes in a reception.
    Waits,
    /// A pause stops before the first STX of a block.
    Pause,
    /// An abort.
    Abort,
    /// DLE answers STX.
    RxSetUp,
    /// A second STX before our DLE has left.
    SecondStx,
    /// Other characters before our DLE has left.
    NotWaiting,
    /// What is data.
    Transparent,
    /// A good block.
    Deliver,
    /// Silence in a block.
    Zvz,
    /// Behind DLE neither DLE nor ETX.
    DleError,
    /// A damaged or lost character.
    LineError,
    /// A wrong check character.
    RxBcc,
    /// Behind a bad block nothing but STX counts.
    Repetition,
    /// So many bad blocks.
    RxAttempts,
    /// How long a repetition is awaited.
    Bwz,
    /// The first error is told.
    FirstError,
    /// A block longer than the largest.
    RxTooLong,
    /// STX waits for a buffer.
    NoBuffer,
    /// Other characters in idle.
    Garbage,
    /// What is ignored in idle.
    Ignored,
    /// Low priority gives way.
    ConflictLow,
    /// High priority insists.
    ConflictHigh,
    /// Two of high priority.
    BothHigh,
    /// Two of low priority.
    BothLow,
    /// Without priority STX is a wrong character.
    ConflictNone,
    /// NAK when the link opens.
    StartNak,
    /// BREAK leads to idle.
    Break,
    /// The port is gone.
    Down,
    /// Closed and opened.
    Close,
    /// DLE goes as it is.
    NoDoubling,
    /// What a line of 7 data bits cannot carry.
    SevenBits,
    /// STX, data and end in one go.
    NoHandshake,
    /// STX is not answered.
    RxNoHandshake,
    /// Silence behind an abort.
    AfterAbort,
    /// Jobs of a layer that is off.
    Kinds,
}

impl Procedure {
    /// The clause of this profile's ledger that the rule stands in, or the nearest.
    pub(super) const fn clause(self, rule: Rule) -> &'static str {
        match self {
            Self::R3964 => of_r3964(rule),
            Self::Plain3964 => of_3964(rule),
            Self::Simplified => of_simplified(rule),
            Self::Rk512 => of_rk512(rule),
        }
    }
}

const fn of_r3964(rule: Rule) -> &'static str {
    match rule {
        Rule::Frame | Rule::NoDoubling => "r3964.line.frame",
        Rule::Bcc => "r3964.line.bcc",
        Rule::SevenBits => "r3964.line.seven-bits",
        Rule::SetUp | Rule::NoHandshake | Rule::Kinds => "r3964.tx.set-up",
        Rule::Qvz => "r3964.tx.qvz",
        Rule::SetUpRefused => "r3964.tx.set-up-refused",
        Rule::SetUpAttempts => "r3964.tx.set-up-attempts",
        Rule::LateDle => "r3964.tx.late-dle",
        Rule::StopOnNak => "r3964.tx.stop-on-nak",
        Rule::StopOnOther => "r3964.tx.stop-on-other",
        Rule::Acknowledged => "r3964.tx.acknowledged",
        Rule::Repeat => "r3964.tx.repeat",
        Rule::NoFalseSuccess => "r3964.tx.no-false-success",
        Rule::TransmissionAttempts => "r3964.tx.transmission-attempts",
        Rule::OneAttempt => "r3964.tx.one-attempt",
        Rule::TooLongJob => "r3964.tx.too-long",
        Rule::Split => "r3964.tx.split",
        Rule::Waits => "r3964.tx.waits",
        Rule::Pause => "r3964.tx.pause",
        Rule::Abort | Rule::AfterAbort => "r3964.tx.abort",
        Rule::RxSetUp | Rule::RxNoHandshake => "r3964.rx.set-up",
        Rule::SecondStx => "r3964.rx.second-stx",
        Rule::NotWaiting => "r3964.rx.not-waiting",
        Rule::Transparent => "r3964.rx.transparent",
        Rule::Deliver => "r3964.rx.deliver",
        Rule::Zvz => "r3964.rx.zvz",
        Rule::DleError => "r3964.rx.dle-error",
        Rule::LineError => "r3964.rx.line-error",
        Rule::RxBcc => "r3964.rx.bcc",
        Rule::Repetition => "r3964.rx.repetition",
        Rule::RxAttempts => "r3964.rx.attempts",
        Rule::Bwz => "r3964.rx.bwz",
        Rule::FirstError => "r3964.rx.first-error",
        Rule::RxTooLong => "r3964.rx.too-long",
        Rule::NoBuffer => "r3964.rx.no-buffer",
        Rule::Garbage => "r3964.rx.garbage",
        Rule::Ignored => "r3964.rx.ignored",
        Rule::ConflictLow => "r3964.conflict.low",
        Rule::ConflictHigh => "r3964.conflict.high",
        Rule::BothHigh => "r3964.conflict.both-high",
        Rule::BothLow => "r3964.conflict.both-low",
        Rule::ConflictNone => "r3964.conflict.none",
        Rule::StartNak => "r3964.line.start-nak",
        Rule::Break => "r3964.line.break",
        Rule::Down => "r3964.line.down",
        Rule::Close => "r3964.line.close",
    }
}

const fn of_3964(rule: Rule) -> &'static str {
    match rule {
        Rule::Frame
        | Rule::Bcc
        | Rule::NoDoubling
        | Rule::SevenBits
        | Rule::TooLongJob
        | Rule::Split
        | Rule::StartNak
        | Rule::Down
        | Rule::Close
        | Rule::Break => "3964.line.frame",
        Rule::Acknowledged | Rule::NoFalseSuccess | Rule::LateDle | Rule::Pause | Rule::Abort => {
            "3964.tx.acknowledged"
        }
        Rule::Qvz => "3964.tx.qvz",
        Rule::SetUp
        | Rule::NoHandshake
        | Rule::Kinds
        | Rule::SetUpRefused
        | Rule::SetUpAttempts
        | Rule::StopOnNak
        | Rule::StopOnOther
        | Rule::Repeat
        | Rule::TransmissionAttempts
        | Rule::OneAttempt
        | Rule::Waits
        | Rule::AfterAbort => "3964.tx.repeat",
        Rule::RxSetUp
        | Rule::RxNoHandshake
        | Rule::SecondStx
        | Rule::Transparent
        | Rule::Deliver
        | Rule::NoBuffer => "3964.rx.acknowledge",
        Rule::Zvz => "3964.rx.zvz",
        Rule::NotWaiting
        | Rule::DleError
        | Rule::LineError
        | Rule::RxBcc
        | Rule::Repetition
        | Rule::RxAttempts
        | Rule::Bwz
        | Rule::FirstError
        | Rule::RxTooLong => "3964.rx.repetition",
        Rule::Garbage | Rule::Ignored => "3964.rx.garbage",
        Rule::ConflictLow | Rule::BothLow => "3964.conflict.low",
        Rule::ConflictHigh | Rule::BothHigh | Rule::ConflictNone => "3964.conflict.both-high",
    }
}

const fn of_simplified(rule: Rule) -> &'static str {
    match rule {
        Rule::Frame | Rule::Bcc | Rule::Split | Rule::Close | Rule::Down | Rule::Break => {
            "r3964-simplified.line.frame"
        }
        Rule::TooLongJob | Rule::RxTooLong => "r3964-simplified.line.block-size",
        Rule::StartNak => "r3964-simplified.line.no-start-nak",
        Rule::NoDoubling => "r3964-simplified.line.no-doubling",
        Rule::SevenBits => "r3964-simplified.line.seven-bits",
        Rule::SetUp | Rule::Acknowledged | Rule::Pause | Rule::Waits | Rule::Kinds => {
            "r3964-simplified.tx.set-up"
        }
        Rule::SetUpRefused | Rule::SetUpAttempts | Rule::Qvz => {
            "r3964-simplified.tx.set-up-attempts"
        }
        Rule::StopOnNak
        | Rule::StopOnOther
        | Rule::Repeat
        | Rule::TransmissionAttempts
        | Rule::OneAttempt => "r3964-simplified.tx.one-transmission",
        Rule::ConflictLow
        | Rule::ConflictHigh
        | Rule::BothHigh
        | Rule::BothLow
        | Rule::ConflictNone => "r3964-simplified.tx.no-arbitration",
        Rule::LateDle | Rule::NoFalseSuccess => "r3964-simplified.tx.late-dle",
        Rule::NoHandshake => "r3964-simplified.tx.no-handshake",
        Rule::Abort | Rule::AfterAbort => "r3964-simplified.tx.abort",
        Rule::RxSetUp | Rule::SecondStx | Rule::NotWaiting | Rule::Transparent | Rule::Deliver => {
            "r3964-simplified.rx.set-up"
        }
        Rule::RxNoHandshake => "r3964-simplified.rx.no-handshake",
        Rule::DleError
        | Rule::LineError
        | Rule::RxBcc
        | Rule::Repetition
        | Rule::RxAttempts
        | Rule::Bwz
        | Rule::FirstError => "r3964-simplified.rx.one-attempt",
        Rule::NoBuffer => "r3964-simplified.rx.busy",
        Rule::Garbage | Rule::Ignored => "r3964-simplified.rx.garbage-ignored",
        Rule::Zvz => "r3964-simplified.rx.zvz",
    }
}

/// A telegram is a block with all that the page says of blocks.
const fn of_rk512(rule: Rule) -> &'static str {
    match rule {
        Rule::Kinds => "rk512.job.kinds",
        Rule::NoDoubling => "rk512.line.no-doubling",
        Rule::SevenBits => "rk512.line.seven-bits",
        Rule::Pause => "rk512.job.pause",
        Rule::Abort | Rule::AfterAbort => "rk512.job.abort",
        Rule::SetUpAttempts
        | Rule::TransmissionAttempts
        | Rule::OneAttempt
        | Rule::BothHigh
        | Rule::BothLow => "rk512.send.underneath",
        Rule::Frame
        | Rule::Bcc
        | Rule::SetUp
        | Rule::Qvz
        | Rule::SetUpRefused
        | Rule::LateDle
        | Rule::StopOnNak
        | Rule::StopOnOther
        | Rule::Acknowledged
        | Rule::Repeat
        | Rule::NoFalseSuccess
        | Rule::TooLongJob
        | Rule::Split
        | Rule::Waits
        | Rule::RxSetUp
        | Rule::SecondStx
        | Rule::NotWaiting
        | Rule::Transparent
        | Rule::Deliver
        | Rule::Zvz
        | Rule::DleError
        | Rule::LineError
        | Rule::RxBcc
        | Rule::Repetition
        | Rule::RxAttempts
        | Rule::Bwz
        | Rule::FirstError
        | Rule::RxTooLong
        | Rule::NoBuffer
        | Rule::Garbage
        | Rule::Ignored
        | Rule::ConflictLow
        | Rule::ConflictHigh
        | Rule::ConflictNone
        | Rule::StartNak
        | Rule::Break
        | Rule::Down
        | Rule::Close
        | Rule::NoHandshake
        | Rule::RxNoHandshake => "rk512.line.telegram",
    }
}
