//! Ptys, where the system has none.

use std::path::Path;

use softplug_abi::LineParameters;

use crate::error::PortError;
use crate::port::input_sink::InputSink;
use crate::port::read_outcome::ReadOutcome;

/// A pty: there is none.
#[derive(Copy, Clone, Debug)]
pub enum PtyPair {}

impl PtyPair {
    /// [`PortError::NoPty`].
    pub fn open() -> Result<Self, PortError> {
        Err(PortError::NoPty)
    }
}

/// The master of a pty as a port: there is none.
#[derive(Copy, Clone, Debug)]
pub enum PtyPort {}

impl PtyPort {
    pub(crate) fn open(_: LineParameters) -> Result<Self, PortError> {
        Err(PortError::NoPty)
    }

    pub(crate) fn slave_path(&self) -> &Path {
        match *self {}
    }

    pub(crate) fn line(&self) -> LineParameters {
        match *self {}
    }

    pub(crate) fn told_baud(&self) -> Option<u32> {
        match *self {}
    }

    pub(crate) fn read_to(
        &mut self,
        _: usize,
        _: &mut impl InputSink,
    ) -> Result<ReadOutcome, PortError> {
        match *self {}
    }

    pub(crate) fn write(&mut self, _: &[u8]) -> Result<usize, PortError> {
        match *self {}
    }

    pub(crate) fn discard_output(&mut self) -> Result<(), PortError> {
        match *self {}
    }
}
