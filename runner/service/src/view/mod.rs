//! What the gateway shows and takes: plain data, the same in the HTTP API, its
//! OpenAPI document, the command and the web page.
//!
//! Times of day are milliseconds since 1970 (UTC), spans are microseconds; a
//! field's name says which (`_ms` is a time of day, `_us` a span).

mod bus;
mod cell;
mod change;
mod check;
mod health;
mod history;
mod job;
mod journal;
mod link;
mod plugin;
mod program;
mod swap;
mod time;

pub use bus::{BusMeasuredView, BusUnitView, BusView, UnitSlotView};
pub use cell::{
    CellAxisView, CellChannelState, CellChannelView, CellGroupView, CellMode, CellSpanView,
    CellStuckView, CellView, ForceOrder, ModeOrder,
};
pub use change::{Change, Seen, SeenWhat};
pub use check::{AlteredView, CheckResult, CheckView};
pub use health::{HealthView, LinkCounts, ReadyView, ReloadView, RemadeLink, StopHow};
pub use history::{HistorySpan, HistoryView};
pub use job::{
    BlockView, CheckFault, JobBrief, JobFilter, JobOrder, JobOrigin, JobProgress, JobState, JobView,
};
pub use journal::{JournalEntry, JournalFilter, JournalKind, JournalWeight};
pub use link::{
    AlarmView, BufferView, CountersView, DownView, DropView, EndpointView, FaultView, LatheView,
    LinkState, LinkView, PortView, QuarantineView, ReceivingView, UnappliedView,
};
pub use plugin::{FieldView, KindView, PluginRef, PluginView, SettingView};
pub use program::{Compared, ProgramView, ReceptionView};
pub use swap::{ProbationOrder, ProbationView, SwapOrder, SwapState, SwapView, SwapWhen};
pub(crate) use time::DAY;
pub use time::{TimeMs, day, now_ms, utc};
