//! The job: its data in packets, their marks and repeats.

use crate::coding::RUN;
use crate::packet::Packet;
use crate::settings::{Mode, Settings};
use crate::stage::Stage;
use crate::terms::{Terms, offer};
use softplug_plugin::parts::Block;
use softplug_plugin::{
    Context, Failure, JobId, JobStart, MarkId, MarkState, State, StateReader, StateWriter, Value,
    copy,
};

/// Characters of a name that can be sent.
const NAME: usize = 64;
/// Bytes of the job that are not in a packet yet.
const ROOM: usize = 512;
/// The name of a job that has none.
const USUAL_NAME: &[u8] = b"PROGRAM";
/// Characters given to the link at a time.
const PIECE: usize = 64;
/// What a long packet has besides data and check.
const LONG_OVERHEAD: usize = 7;
/// What the length of a short one counts besides data and check.
const SHORT_OVERHEAD: usize = 2;

/// What became of making a packet.
enum Made {
    Whole,
    /// There is not enough data to know.
    Part,
    /// It cannot be sent.
    Never(Failure),
}

/// What the file is called.
#[derive(Copy, Clone, Debug)]
struct Name {
    bytes: [u8; NAME],
    length: u8,
}

impl State for Name {
    fn save(&self, state: &mut StateWriter<'_>) {
        state.u8(self.length);
        state.bytes(self.bytes.get(..usize::from(self.length)).unwrap_or_default());
    }

    fn restore(&mut self, state: &mut StateReader<'_>) {
        self.length = state.u8();
        match self.bytes.get_mut(..usize::from(self.length)) {
            Some(own) => copy(own, state.bytes(own.len())),
            None => state.refuse(),
        }
    }
}

#[derive(Copy, Clone, Debug, State)]
pub(crate) struct Sender {
    /// Id of the job; 0: none.
    job: JobId,
    /// Why the job fails, once it is known how much of it has left.
    pub(crate) stopping: Option<Failure>,
    pub(crate) is_paused: bool,
    /// The receiver wants no more of the file.
    pub(crate) is_interrupted: bool,
    /// The latest byte of the job was CR.
    is_after_cr: bool,
    has_ended: bool,
    /// The packet is whole, and can go.
    is_made: bool,
    /// What was given last can have left, but for its EOL.
    has_left: bool,
    name: Name,
    data: Block<ROOM>,
    pub(crate) packet: Packet,
    /// Type and number of the packet under way; 0: none has begun.
    pub(crate) kind: u8,
    pub(crate) number: u8,
    /// Characters of it that the link has taken: its room may be smaller.
    given: u16,
    wanted: u32,
    pub(crate) repeats: u32,
    /// The mark behind what was given last. The one before stands ahead of its EOL: many receivers
    /// answer at the check.
    mark: MarkId,
    /// Characters queued for the job.
    queued: u64,
}

impl Sender {
    pub(crate) const fn new(mark: MarkId) -> Self {
        Self {
            job: JobId::NONE,
            stopping: None,
            is_paused: false,
            is_interrupted: false,
            is_after_cr: false,
            has_ended: false,
            is_made: false,
            has_left: false,
            name: Name { bytes: [0; NAME], length: 0 },
            data: Block::new(),
            packet: Packet::new(),
            kind: 0,
            number: 0,
            given: 0,
            wanted: 0,
            repeats: 0,
            mark,
            queued: 0,
        }
    }

    /// A job; one that cannot be taken fails at once.
    pub(crate) fn begin(&mut self, link: &mut Context<'_>, job: &JobStart<'_>) -> bool {
        let name = match job.fields.find(0) {
            Some(Value::Text(name)) => name.as_bytes(),
            _ => USUAL_NAME,
        };
        let is_sound = !name.is_empty()
            && name.len() <= NAME
            && name.iter().all(|character| matches!(character, 0x20..=0x7E));
        let why = match job.kind {
            _ if self.job != JobId::NONE => Failure::Busy,
            0 if is_sound => {
                *self = Self::new(self.mark);
                self.job = job.job;
                self.name.length = name.len() as u8;
                copy(&mut self.name.bytes, name);
                return true;
            }
            _ => Failure::BadJob,
        };
        link.job_failed(job.job, why, 0, 0);
        false
    }

    /// Whether there is a job to send.
    pub(crate) fn is_waiting(&self) -> bool {
        self.job != JobId::NONE && self.stopping.is_none()
    }

    pub(crate) fn data(&mut self, bytes: &[u8], settings: &Settings) {
        self.wanted = self.wanted.saturating_sub(bytes.len() as u32);
        if settings.mode == Mode::Binary {
            self.data.extend(bytes);
            return;
        }
        for byte in bytes {
            if *byte == b'\n' && !self.is_after_cr {
                self.data.extend(b"\r");
            }
            self.data.extend(&[*byte]);
            self.is_after_cr = *byte == b'\r';
        }
    }

    pub(crate) fn data_ended(&mut self) {
        self.has_ended = true;
        self.wanted = 0;
    }

    /// The first packet is next, again.
    pub(crate) fn restart(&mut self) {
        (self.kind, self.number) = (b'S', 0);
        (self.is_made, self.given, self.repeats) = (false, 0, 0);
        self.packet.clear();
    }

    /// The packet under way is with the receiver: the next one is of this type.
    pub(crate) fn goes_on_with(&mut self, kind: u8) {
        self.kind = kind;
        self.number = (self.number + 1) % 64;
        (self.is_made, self.repeats) = (false, 0);
        self.packet.clear();
    }

    /// Sends the packet that is next, or under way, if line, room and host allow it.
    pub(crate) fn next(
        &mut self,
        link: &mut Context<'_>,
        settings: &Settings,
        terms: &Terms,
        is_narrow: bool,
    ) -> Result<Stage, Failure> {
        if !self.is_made {
            match self.make(link, settings, terms, is_narrow) {
                Made::Whole => self.is_made = true,
                Made::Part => return Ok(Stage::Filling),
                Made::Never(failure) => return Err(failure),
            }
        }
        // A packet that has begun is not paused.
        if self.is_paused && self.given == 0 {
            return Ok(Stage::Filling);
        }
        Ok(if self.give(link, terms) { Stage::Answer } else { Stage::Filling })
    }

    fn make(
        &mut self,
        link: &mut Context<'_>,
        settings: &Settings,
        terms: &Terms,
        is_narrow: bool,
    ) -> Made {
        let short = usize::from(terms.short);
        let most = self.most_data(terms);
        match self.kind {
            b'S' => self.packet.push(&offer(settings, is_narrow)),
            b'F' => {
                let (name, length) = (self.name.bytes, usize::from(self.name.length));
                let used = self.encode(name.get(..length).unwrap_or_default(), terms, most);
                if used < length {
                    return Made::Never(Failure::BadJob);
                }
            }
            b'D' => match self.fill(link, settings, terms, is_narrow) {
                Made::Whole if self.packet.data_length() == 0 => self.kind = b'Z',
                Made::Whole => {}
                other => return other,
            },
            b'Z' if self.is_interrupted => self.packet.push(b"D"),
            _ => {}
        }
        self.packet.finish(self.kind, self.number, terms.check, short);
        Made::Whole
    }

    /// Characters of data that a packet can have.
    fn most_data(&self, terms: &Terms) -> usize {
        let check = usize::from(terms.check);
        let short = usize::from(terms.short) - SHORT_OVERHEAD - check;
        let long = usize::from(terms.long).saturating_sub(LONG_OVERHEAD + check);
        // Names and the like are short.
        if self.kind == b'D' { short.max(long) } else { short }
    }

    /// Puts data into the packet until there is no more, or no room.
    fn fill(
        &mut self,
        link: &mut Context<'_>,
        settings: &Settings,
        terms: &Terms,
        is_narrow: bool,
    ) -> Made {
        let most = self.most_data(terms);
        loop {
            let there = self.data.len();
            // How long a run is must be known.
            if there < RUN && !self.has_ended {
                if self.wanted == 0 {
                    let free = (ROOM - there) as u32;
                    self.wanted = if settings.mode == Mode::Text { free / 2 } else { free };
                    link.want(self.job, self.wanted);
                }
                return Made::Part;
            }
            if there == 0 {
                return Made::Whole;
            }
            // Up to where runs are known.
            let data = self.data;
            let data = data.as_slice();
            let mut used = 0;
            let mut is_full = false;
            while used < there && (self.has_ended || there - used >= RUN) {
                let rest = data.get(used..).unwrap_or_default();
                if is_narrow && terms.ours.eighth == 0 && rest[0] >= 0x80 {
                    self.data.drop_first(used);
                    return Made::Never(Failure::UnsupportedCharacter);
                }
                let taken = self.encode_one(rest, terms, most);
                if taken == 0 {
                    is_full = true;
                    break;
                }
                used += taken;
            }
            self.data.drop_first(used);
            if is_full {
                return Made::Whole;
            }
        }
    }

    /// Puts these into the packet as far as they fit: how many.
    fn encode(&mut self, bytes: &[u8], terms: &Terms, most: usize) -> usize {
        let mut used = 0;
        while let Some(rest) = bytes.get(used..)
            && !rest.is_empty()
        {
            let taken = self.encode_one(rest, terms, most);
            if taken == 0 {
                break;
            }
            used += taken;
        }
        used
    }

    /// Puts the first byte, or the run at the beginning, into the packet: how many that were;
    /// 0: it does not fit.
    fn encode_one(&mut self, bytes: &[u8], terms: &Terms, most: usize) -> usize {
        let Some(first) = bytes.first().copied() else { return 0 };
        let run = bytes.iter().take(RUN).take_while(|byte| **byte == first).count();
        let (unit, length, taken) = terms.ours.encode(first, run);
        if self.packet.data_length() + length > most {
            return 0;
        }
        self.packet.push(unit.get(..length).unwrap_or_default());
        taken
    }

    /// Gives the link what it takes of the packet. Whether that was the last of it.
    fn give(&mut self, link: &mut Context<'_>, terms: &Terms) -> bool {
        let padding = usize::from(terms.padding);
        let packet = self.packet.as_slice();
        let check = padding + packet.len();
        let total = check + 1;
        let mut given = usize::from(self.given);
        while given < total {
            let room = link.transmit_room() as usize;
            let mut count = (total - given).min(PIECE).min(room);
            if given < check && given + count >= check {
                // The EOL goes with the last of what is before it, behind a mark of its own.
                count = check - given - usize::from(room <= check - given);
            }
            if count == 0 {
                break;
            }
            let mut piece = [terms.end; PIECE];
            for (place, own) in (given..).zip(piece.iter_mut().take(count)) {
                *own = match place.checked_sub(padding) {
                    None => terms.pad,
                    Some(place) => packet.get(place).copied().unwrap_or(terms.end),
                };
            }
            link.transmit(piece.get(..count).unwrap_or_default());
            given += count;
            self.queued += count as u64;
            if given == check {
                self.mark = MarkId(self.mark.0.wrapping_add(2).max(2));
                self.has_left = false;
                link.transmit_marked(MarkId(self.mark.0 - 1), &[]);
            }
        }
        self.given = given as u16;
        let is_whole = given == total;
        if is_whole {
            self.given = 0;
            link.transmit_marked(self.mark, &[]);
        }
        is_whole
    }

    /// Whether the mark is the one behind what was given last.
    pub(crate) fn left(&mut self, mark: MarkId, state: MarkState) -> bool {
        let is_left = state != MarkState::Dropped;
        self.has_left |=
            is_left && (mark == self.mark || mark == MarkId(self.mark.0.wrapping_sub(1)));
        is_left && mark == self.mark
    }

    pub(crate) fn has_left(&self) -> bool {
        self.has_left
    }

    /// Whether the packet may be sent once more.
    pub(crate) fn repeats(&mut self, most: i64) -> bool {
        self.repeats += 1;
        i64::from(self.repeats) <= most
    }

    /// Whether the receiver has confirmed the whole file: the end of the transfer has begun.
    pub(crate) fn is_confirmed(&self) -> bool {
        self.kind == b'B' && !self.is_interrupted
    }

    pub(crate) fn dropped(&mut self, bytes: u32) {
        self.queued = self.queued.saturating_sub(u64::from(bytes));
    }

    pub(crate) fn done(&mut self, link: &mut Context<'_>) {
        link.job_done(self.job, self.queued);
        *self = Self::new(self.mark);
    }

    /// The job has failed; but what the receiver has confirmed is done.
    pub(crate) fn fail(&mut self, link: &mut Context<'_>, failure: Failure) {
        if self.job != JobId::NONE && self.is_confirmed() {
            self.done(link);
        } else if self.job != JobId::NONE {
            link.job_failed(self.job, failure, 0, self.queued);
            *self = Self::new(self.mark);
        }
    }
}
