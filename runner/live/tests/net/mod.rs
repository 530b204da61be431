//! Device servers that are killed, machines behind them, and what listens for them.

pub(crate) mod killed;
pub(crate) mod machine;
pub(crate) mod port;
pub(crate) mod ser2net;
