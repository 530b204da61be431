//! Programs of a channel: their words, found before they are put into the queue.

use std::io::Read;

use softplug_cell::{ChannelId, Program, Stop, Word};

use super::super::Shared;
use crate::Refusal;
use crate::config::CellConfig;
use crate::jobs::Data;
use crate::programs::ProgramName;

/// The longest program whose words are looked for.
const LARGEST: u64 = 256 << 20;

/// A channel, as whoever reads its programs has to know it.
#[derive(Clone)]
pub(crate) struct ChannelOf {
    pub(super) config: CellConfig,
    pub(super) channel: ChannelId,
    /// Where each channel of the cell finds programs.
    pub(super) searches: Vec<Vec<String>>,
}

impl ChannelOf {
    /// The words of coordination in a program; what is sent is without what the machine does not get.
    pub(crate) fn read(&self, shared: &Shared, data: Data) -> Result<(Data, Vec<Stop>), Refusal> {
        if data.size > LARGEST {
            let most = LARGEST >> 20;
            let text = format!("a channel of a cell takes programs of at most {most} MiB");
            return Err(Refusal::TooLarge(text));
        }
        let snapshots = &shared.parts.snapshots;
        let mut bytes = Vec::new();
        let unread = |error: &dyn std::fmt::Display| Refusal::Unavailable(error.to_string());
        let mut file = snapshots.open(data).map_err(|error| unread(&error))?;
        file.read_to_end(&mut bytes).map_err(|error| unread(&error))?;
        let program = self.words(&bytes)?;
        for stop in &program.stops {
            if let Word::Load { channel, program } = &stop.word {
                self.check(shared, *channel, program).map_err(|error| {
                    Refusal::invalid("program", format!("block {}: {error}", stop.block))
                })?;
            }
        }
        if program.left_out.is_empty() {
            return Ok((data, program.stops));
        }
        let data =
            snapshots.take_all(&mut &*program.sent, "what is sent of the program", LARGEST)?;
        Ok((data, program.stops))
    }

    /// What the machine gets of a program.
    pub(crate) fn sent(&self, program: &[u8]) -> Result<Vec<u8>, Refusal> {
        Ok(self.words(program)?.sent.into_owned())
    }

    fn words<'a>(&self, program: &'a [u8]) -> Result<Program<'a>, Refusal> {
        let notation = self.config.notation(self.channel);
        let program = Program::read(program, self.channel, &self.config.setup, notation);
        let program = program.map_err(|error| Refusal::invalid("program", error))?;
        if program.sent.is_empty() {
            let text = "nothing of it is for the machine: write a block at least, or its words as comments";
            return Err(Refusal::invalid("program", text));
        }
        Ok(program)
    }

    /// Whether a program can be loaded into a channel, as it is now.
    fn check(&self, shared: &Shared, channel: ChannelId, name: &str) -> Result<(), Refusal> {
        let found = self.find(shared, channel, name)?;
        let (mut file, known) = shared.parts.programs.download(&found)?;
        if known.size > LARGEST {
            return Ok(());
        }
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(|error| Refusal::Unavailable(error.to_string()))?;
        let notation = self.config.notation(channel);
        let read = Program::read(&bytes, channel, &self.config.setup, notation);
        let to = self.config.setup.channel_name(channel);
        let name = name.escape_debug();
        read.map(drop).map_err(|error| {
            Refusal::Conflict(format!("{name} cannot be loaded into {to}: {error}"))
        })
    }

    /// The program of this name that a channel would be given.
    pub(super) fn find(
        &self,
        shared: &Shared,
        channel: ChannelId,
        name: &str,
    ) -> Result<ProgramName, Refusal> {
        let folders = self.searches.get(usize::from(channel.0)).map(Vec::as_slice);
        let found = shared.parts.programs.search(folders.unwrap_or_default(), name);
        found.map_err(|error| Refusal::Unavailable(error.to_string()))?.ok_or_else(|| {
            let to = self.config.setup.channel_name(channel);
            let name = name.escape_debug();
            Refusal::NotFound(format!("there is no program \"{name}\" to load into {to}"))
        })
    }
}
