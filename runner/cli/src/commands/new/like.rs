//! The protocols that a new project can begin like.

use clap::ValueEnum;
use include_dir::{Dir, include_dir};

/// A kind of protocol; for each there is a small one in `templates/like`.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, ValueEnum)]
pub(super) enum Like {
    /// Lines of text, each answered with ACK or NAK
    #[default]
    Line,
    /// Data in blocks with a sum, each answered with ACK or NAK
    Block,
    /// Bytes as they are, under XOFF and XON
    Stream,
    /// The host asks with a line, and the machine replies with one
    RequestReply,
}

static LINE: Dir<'static> = include_dir!("$CARGO_MANIFEST_DIR/templates/like/line");
static BLOCK: Dir<'static> = include_dir!("$CARGO_MANIFEST_DIR/templates/like/block");
static STREAM: Dir<'static> = include_dir!("$CARGO_MANIFEST_DIR/templates/like/stream");
static REQUEST_REPLY: Dir<'static> =
    include_dir!("$CARGO_MANIFEST_DIR/templates/like/request-reply");

impl Like {
    /// Its sources, ledger, traces and tests, with their paths in a project.
    pub(super) fn files(self) -> &'static Dir<'static> {
        match self {
            Self::Line => &LINE,
            Self::Block => &BLOCK,
            Self::Stream => &STREAM,
            Self::RequestReply => &REQUEST_REPLY,
        }
    }

    /// What stands in the package's description.
    pub(super) fn description(self) -> &'static str {
        match self {
            Self::Line => "Softplug plug-in: lines of text, each answered with ACK or NAK",
            Self::Block => "Softplug plug-in: data in blocks, each answered with ACK or NAK",
            Self::Stream => "Softplug plug-in: bytes as they are, under XOFF and XON",
            Self::RequestReply => "Softplug plug-in: a line asks, and a line replies",
        }
    }
}
