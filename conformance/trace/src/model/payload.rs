//! Bytes as a trace writes them, and how they become bytes.

use std::fmt;
use std::path::PathBuf;

use crate::generate::Generator;
use crate::limits::ITEM_BYTES;

/// A sequence of items, as the author wrote them; neighbouring hex pairs are
/// one item.
///
/// ```
/// use softplug_trace::{NoFiles, Payload};
///
/// let readable = Payload::from_bytes(b"G1 X10\n");
/// assert_eq!(readable.length(), Some(7));
/// assert_eq!(readable.bytes(&NoFiles)?, b"G1 X10\n");
/// # Ok::<(), softplug_trace::PayloadError>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Payload {
    items: Vec<Item>,
}

/// A piece of a payload.
///
/// ```
/// use softplug_trace::{BadKind, Item, NoFiles, Payload, Piece};
///
/// // `41 ~p42` in a trace: a good character and one whose parity is wrong.
/// let damaged = Item::Bad { kind: BadKind::Parity, byte: 0x42 };
/// let payload = Payload::new([Item::Hex(vec![0x41]), damaged]);
/// let pieces = payload.pieces(&NoFiles)?;
/// assert!(matches!(pieces[1], Piece::Bad { byte: 0x42, .. }));
/// # Ok::<(), softplug_trace::PayloadError>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Item {
    /// Hex pairs, at least one.
    Hex(Vec<u8>),
    /// Quoted text.
    Text(Vec<u8>),
    /// A character that arrives damaged; only in received bytes.
    Bad {
        /// What is wrong with it.
        kind: BadKind,
        /// As it was read.
        byte: u8,
    },
    /// The content of a file.
    File(Digest),
    /// Bytes that a generator makes.
    Generated(Generator),
}

/// What is wrong with a received character.
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug)]
pub enum BadKind {
    /// `~p`: the parity bit is wrong.
    Parity,
    /// `~f`: the stop bit is missing.
    Framing,
    /// `~e`: one of the two, the port cannot tell.
    ParityOrFraming,
}

impl BadKind {
    /// The letter after `~`.
    pub const fn letter(self) -> char {
        match self {
            Self::Parity => 'p',
            Self::Framing => 'f',
            Self::ParityOrFraming => 'e',
        }
    }
}

/// The SHA-256 of a file.
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug)]
pub struct Digest(pub [u8; 32]);

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// Finds the files that `file:` items name. A closure of the same shape will do.
///
/// ```
/// use softplug_trace::{Digest, Item, Payload};
///
/// // One program, whatever is asked for.
/// let program = |_: &Digest| Ok(b"%\nO0001\n%\n".to_vec());
/// let payload = Payload::new([Item::File(Digest([0; 32]))]);
/// assert_eq!(payload.bytes(&program)?.len(), 10);
/// # Ok::<(), softplug_trace::PayloadError>(())
/// ```
pub trait Files {
    /// The content of the file with this SHA-256. Whoever finds it checks the
    /// digest.
    ///
    /// # Errors
    /// Why there is none.
    fn read(&self, digest: &Digest) -> Result<Vec<u8>, NoFile>;
}

impl<F: Fn(&Digest) -> Result<Vec<u8>, NoFile>> Files for F {
    fn read(&self, digest: &Digest) -> Result<Vec<u8>, NoFile> {
        self(digest)
    }
}

/// No files at all.
#[derive(Copy, Clone, Debug, Default)]
pub struct NoFiles;

impl Files for NoFiles {
    fn read(&self, _digest: &Digest) -> Result<Vec<u8>, NoFile> {
        Err(NoFile::NoneAtHand)
    }
}

/// Why a file that an item names cannot be had.
///
/// ```
/// use softplug_trace::{Digest, Files, NoFile, NoFiles};
///
/// let refused = NoFiles.read(&Digest([0; 32])).unwrap_err();
/// assert_eq!(refused, NoFile::NoneAtHand);
/// assert_eq!(refused.to_string(), "no files are at hand");
/// ```
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum NoFile {
    /// There are no files at all.
    #[error("no files are at hand")]
    NoneAtHand,
    /// The corpus that the trace belongs to has none of this digest.
    #[error("the corpus has no file files/{0}")]
    NotInCorpus(Digest),
    /// The system does not give it.
    #[error("{}: {reason}", path.display())]
    Unreadable {
        /// Where it should be.
        path: PathBuf,
        /// What the system says.
        reason: String,
    },
    /// Its content is not what its name says.
    #[error("{} has another digest than its name says", .0.display())]
    OtherDigest(PathBuf),
}

/// Part of what arrives.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Piece {
    /// Good bytes, at least one.
    Bytes(Vec<u8>),
    /// A damaged character.
    Bad {
        /// What is wrong with it.
        kind: BadKind,
        /// As it was read.
        byte: u8,
    },
}

/// Why a payload has no bytes.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum PayloadError {
    /// A file cannot be had.
    #[error("file:{digest} cannot be read: {reason}")]
    File {
        /// The file.
        digest: Digest,
        /// Why.
        reason: NoFile,
    },
    /// A file or a generated run is over the limit.
    #[error("{item} gives {length} bytes; at most {ITEM_BYTES} are allowed")]
    TooLong {
        /// The item.
        item: String,
        /// Its length in bytes.
        length: u64,
    },
    /// A damaged character where only bytes have a meaning.
    #[error("~{}{byte:02X} is a damaged character; only received bytes can hold one", kind.letter())]
    BadCharacter {
        /// What is wrong with it.
        kind: BadKind,
        /// As it would be read.
        byte: u8,
    },
}

impl Payload {
    /// From items: joins neighbouring hex pairs and drops empty ones.
    pub fn new(items: impl IntoIterator<Item = Item>) -> Self {
        let mut joined: Vec<Item> = Vec::new();
        for item in items {
            match (joined.last_mut(), item) {
                (_, Item::Hex(bytes)) if bytes.is_empty() => {}
                (Some(Item::Hex(before)), Item::Hex(bytes)) => before.extend(bytes),
                (_, item) => joined.push(item),
            }
        }
        Self { items: joined }
    }

    /// The bytes as an author would write them: text if all of it can be read,
    /// else hex pairs.
    pub fn from_bytes(bytes: &[u8]) -> Self {
        let readable = |byte: &u8| matches!(byte, b' '..=b'~' | b'\n' | b'\r' | b'\t');
        if bytes.is_empty() {
            return Self::default();
        }
        if bytes.iter().all(readable) && bytes.iter().any(u8::is_ascii_graphic) {
            Self { items: vec![Item::Text(bytes.to_vec())] }
        } else {
            Self::hex(bytes)
        }
    }

    /// The bytes as hex pairs.
    pub fn hex(bytes: &[u8]) -> Self {
        Self::new([Item::Hex(bytes.to_vec())])
    }

    /// The items, in order.
    pub fn items(&self) -> &[Item] {
        &self.items
    }

    /// Whether nothing is written; `""` is something.
    pub fn is_absent(&self) -> bool {
        self.items.is_empty()
    }

    /// How many characters it has; `None` if it names a file.
    pub fn length(&self) -> Option<u64> {
        self.items.iter().map(Item::length).sum()
    }

    /// All bytes joined.
    ///
    /// # Errors
    /// A file cannot be had, an item is too long, or a character is damaged.
    pub fn bytes(&self, files: &impl Files) -> Result<Vec<u8>, PayloadError> {
        let mut all = Vec::new();
        for item in &self.items {
            match item {
                Item::Bad { kind, byte } => {
                    return Err(PayloadError::BadCharacter { kind: *kind, byte: *byte });
                }
                item => item.append(files, &mut all)?,
            }
        }
        Ok(all)
    }

    /// This with one byte in place of another. What a file or a generator makes stays.
    pub(crate) fn replace_byte(&mut self, written: u8, other: u8) {
        for item in &mut self.items {
            match item {
                Item::Hex(bytes) | Item::Text(bytes) if bytes.contains(&written) => {
                    let replaced =
                        bytes.iter().map(|byte| if *byte == written { other } else { *byte });
                    *item = Item::Hex(replaced.collect());
                }
                Item::Bad { byte, .. } if *byte == written => *byte = other,
                Item::Hex(_)
                | Item::Text(_)
                | Item::Bad { .. }
                | Item::File(_)
                | Item::Generated(_) => {}
            }
        }
    }

    /// What arrives: runs of good bytes with the damaged characters between.
    ///
    /// # Errors
    /// A file cannot be had or an item is too long.
    pub fn pieces(&self, files: &impl Files) -> Result<Vec<Piece>, PayloadError> {
        let mut pieces = Vec::new();
        for item in &self.items {
            if let Item::Bad { kind, byte } = item {
                pieces.push(Piece::Bad { kind: *kind, byte: *byte });
                continue;
            }
            if let Some(Piece::Bytes(run)) = pieces.last_mut() {
                item.append(files, run)?;
                continue;
            }
            let mut run = Vec::new();
            item.append(files, &mut run)?;
            if !run.is_empty() {
                pieces.push(Piece::Bytes(run));
            }
        }
        Ok(pieces)
    }
}

impl Item {
    fn length(&self) -> Option<u64> {
        match self {
            Self::Hex(bytes) | Self::Text(bytes) => Some(bytes.len() as u64),
            Self::Bad { .. } => Some(1),
            Self::File(_) => None,
            Self::Generated(generator) => Some(generator.length),
        }
    }

    fn append(&self, files: &impl Files, all: &mut Vec<u8>) -> Result<(), PayloadError> {
        let too_long = |item: String, length: u64| match length {
            0..=ITEM_BYTES => Ok(()),
            _ => Err(PayloadError::TooLong { item, length }),
        };
        match self {
            Self::Hex(bytes) | Self::Text(bytes) => all.extend_from_slice(bytes),
            Self::Bad { byte, .. } => all.push(*byte),
            Self::File(digest) => {
                let bytes = files
                    .read(digest)
                    .map_err(|reason| PayloadError::File { digest: *digest, reason })?;
                too_long(format!("file:{digest}"), bytes.len() as u64)?;
                all.extend(bytes);
            }
            Self::Generated(generator) => {
                too_long(generator.to_string(), generator.length)?;
                generator.append(all);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::GeneratorKind;

    #[test]
    fn neighbouring_hex_is_one_item_and_pieces_split_at_damage() {
        let payload = Payload::new([
            Item::Hex(vec![1]),
            Item::Hex(vec![]),
            Item::Hex(vec![2]),
            Item::Text(b"A".to_vec()),
            Item::Bad { kind: BadKind::Framing, byte: 0x31 },
            Item::Text(Vec::new()),
            Item::Hex(vec![3]),
        ]);
        assert_eq!(payload.items().len(), 5);
        assert_eq!(payload.length(), Some(5));
        assert_eq!(
            payload.pieces(&NoFiles),
            Ok(vec![
                Piece::Bytes(vec![1, 2, b'A']),
                Piece::Bad { kind: BadKind::Framing, byte: 0x31 },
                Piece::Bytes(vec![3]),
            ])
        );
        assert_eq!(
            payload.bytes(&NoFiles),
            Err(PayloadError::BadCharacter { kind: BadKind::Framing, byte: 0x31 })
        );
    }

    #[test]
    fn files_come_from_the_caller() {
        let digest = Digest([0xAB; 32]);
        let payload = Payload::new([
            Item::Text(b"<".to_vec()),
            Item::File(digest),
            Item::Text(b">".to_vec()),
        ]);
        let files = |asked: &Digest| {
            if *asked == digest { Ok(b"G0".to_vec()) } else { Err(NoFile::NotInCorpus(*asked)) }
        };
        assert_eq!(payload.bytes(&files), Ok(b"<G0>".to_vec()));
        assert_eq!(payload.length(), None);
        let refused = payload.bytes(&NoFiles).unwrap_err().to_string();
        assert!(
            refused.starts_with("file:abab")
                && refused.ends_with("cannot be read: no files are at hand")
        );
    }

    #[test]
    fn an_item_over_the_limit_is_refused_before_it_is_made() {
        let generator = Generator { kind: GeneratorKind::Text, seed: 1, length: u64::MAX };
        let payload = Payload::new([Item::Generated(generator)]);
        assert!(matches!(
            payload.bytes(&NoFiles),
            Err(PayloadError::TooLong { length: u64::MAX, .. })
        ));
        let huge = |_: &Digest| Ok(vec![0; ITEM_BYTES as usize + 1]);
        let file = Payload::new([Item::File(Digest([0; 32]))]);
        assert!(matches!(file.bytes(&huge), Err(PayloadError::TooLong { .. })));
    }

    #[test]
    fn lengths_that_overflow_are_unknown_not_wrong() {
        let generator = Generator { kind: GeneratorKind::Text, seed: 1, length: u64::MAX };
        assert_eq!(Payload::new([Item::Generated(generator)]).length(), Some(u64::MAX));
    }

    #[test]
    fn observed_bytes_are_text_only_if_they_can_be_read() {
        assert_eq!(Payload::from_bytes(b"G1\n").items(), [Item::Text(b"G1\n".to_vec())]);
        assert_eq!(Payload::from_bytes(b"\n").items(), [Item::Hex(b"\n".to_vec())]);
        assert_eq!(Payload::from_bytes(b"G\x13").items(), [Item::Hex(b"G\x13".to_vec())]);
        assert!(Payload::from_bytes(b"").is_absent());
    }
}
