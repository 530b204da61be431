//! What a port gives to whoever reads it: what it heard, and, before that, how
//! much of what it was given it still held when that was read.

use super::marks::Input;

/// What a port tells of the bytes that it was given.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub struct Backlog {
    /// Bytes that it still holds, as far as it tells: a UART's or an adapter's
    /// own memory is not counted, nor what lies between a device server and its
    /// line. 0 on a pty, which does not tell.
    pub bytes: usize,
    /// The last bit of everything has left, for certain: only a UART tells.
    pub is_empty: bool,
}

/// Takes in what a read brings.
pub(crate) trait InputSink {
    /// Something was read, and is given next. `backlog` asks the port, which is
    /// behind the read: what the answer says is still held was no cause of it.
    fn came(&mut self, backlog: impl FnOnce() -> Backlog);

    /// The next of what was read, in the line's order.
    fn heard(&mut self, input: Input<'_>);
}

/// A sink that asks nothing.
pub(super) struct InputOnly<'a, F>(pub(super) &'a mut F);

impl<F: FnMut(Input<'_>)> InputSink for InputOnly<'_, F> {
    fn came(&mut self, _: impl FnOnce() -> Backlog) {}

    fn heard(&mut self, input: Input<'_>) {
        (self.0)(input);
    }
}
