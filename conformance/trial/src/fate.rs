//! What becomes of a character on its way: each is tried in a small program, through the plug-in
//! itself, and what is on the wire is compared with that of others.

use std::collections::HashMap;
use std::error::Error;
use std::io::Cursor;

use data_encoding::HEXLOWER;
use softplug_abi::manifest::Manifest;
use softplug_abi::{Failure, Instance};

use crate::characters::Written;
use crate::error::TrialError;
use crate::paper::Keep;
use crate::reason::{WAITS, reason};
use crate::trial::Trial;
use crate::tried::End;

/// What becomes of a character.
///
/// ```
/// use softplug_abi::manifest::Manifest;
/// use softplug_native::NativePlugin;
/// use softplug_trial::Fate;
///
/// let manifest = Manifest::parse(NativePlugin::XonXoff.manifest().as_bytes())?;
/// assert_eq!(Fate::Passes.name(), None);
/// let fate = Fate::Replaced("A".to_owned());
/// assert_eq!((fate.name(), fate.what(&manifest).as_str()), (Some("replaced"), "sent as A"));
/// # Ok::<(), softplug_abi::manifest::ManifestError>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Fate {
    /// It arrives.
    Passes,
    /// Nothing of it is sent.
    Dropped,
    /// This is sent in its place.
    Replaced(String),
    /// These bytes are sent for it, which controls do not take for one character.
    Foreign(Vec<u8>),
    /// It has more bits than a character of the line.
    Cut,
    /// The plug-in fails the job, for this reason and with the protocol's own code of it; or, without
    /// one, waits for something that only a real partner sends.
    Refused(Option<(Failure, u16)>),
}

impl Fate {
    /// Its name: `dropped`, `replaced`, `foreign`, `cut` or `refused`; `None` for what passes.
    pub fn name(&self) -> Option<&'static str> {
        Some(match self {
            Self::Passes => return None,
            Self::Dropped => "dropped",
            Self::Replaced(_) => "replaced",
            Self::Foreign(_) => "foreign",
            Self::Cut => "cut",
            Self::Refused(_) => "refused",
        })
    }

    /// It for people, with the words of the plug-in's protocol.
    pub fn what(&self, manifest: &Manifest) -> String {
        match self {
            Self::Passes => "sent as it is written".to_owned(),
            Self::Dropped => "left out".to_owned(),
            Self::Replaced(text) if text == " " => "sent as a space".to_owned(),
            Self::Replaced(text) if text.trim().is_empty() => {
                format!("sent as {} spaces", text.len())
            }
            Self::Replaced(text) => format!("sent as {text}"),
            Self::Foreign(bytes) => {
                format!("sent as {}, which few controls know", HEXLOWER.encode(bytes))
            }
            Self::Cut => "a character of this line has 7 bits: arrives as another".to_owned(),
            Self::Refused(None) => WAITS.to_owned(),
            Self::Refused(Some((failure, status))) => reason(manifest, *failure, *status),
        }
    }
}

/// Finds out the fate of characters.
pub(crate) struct Probe<'a, F> {
    trial: &'a Trial<'a, F>,
    /// Of a job with the small program.
    records: Vec<u8>,
    /// What is on the wire without the character.
    without: Vec<u8>,
    /// The characters that can be seen, by what is on the wire with each.
    seen: HashMap<Vec<u8>, Vec<char>>,
    /// Whether characters are sent as they are, but for a parity bit.
    is_plain: bool,
}

/// What is on the wire, or why it is refused.
type Wire = Result<Vec<u8>, Option<(Failure, u16)>>;

impl<'a, F, I, E> Probe<'a, F>
where
    F: Fn() -> Result<I, E>,
    I: Instance,
    E: Error + 'static,
{
    /// None: the plug-in does not send a small program, so that nothing can be tried.
    pub(crate) fn new(trial: &'a Trial<'a, F>) -> Result<Option<Self>, TrialError<E, I::Fault>> {
        let records = trial.setup.records_from_its_start();
        let Ok(without) = tried(trial, &records, &[])? else { return Ok(None) };
        let mut seen: HashMap<_, Vec<char>> = HashMap::new();
        let mut is_plain = true;
        for byte in b' '..=b'~' {
            if let Ok(wire) = tried(trial, &records, &[byte])? {
                let is_itself = inserted(&without, &wire).first().map(|sent| sent & 0x7F);
                is_plain &= !byte.is_ascii_digit() || is_itself == Some(byte);
                seen.entry(wire).or_default().push(char::from(byte));
            }
        }
        Ok(Some(Self { trial, records, without, seen, is_plain }))
    }

    pub(crate) fn fate(&self, written: Written) -> Result<Fate, TrialError<E, I::Fault>> {
        // Ends of lines and of the tape are no characters that could be put anywhere.
        if matches!(written, Written::Character('\n' | '\r' | '%')) {
            return Ok(Fate::Passes);
        }
        let bytes = written.bytes();
        let wire = match tried(self.trial, &self.records, &bytes)? {
            Ok(wire) => wire,
            Err(refusal) => return Ok(Fate::Refused(refusal)),
        };
        if wire == self.without {
            return Ok(Fate::Dropped);
        }
        let sent = inserted(&self.without, &wire);
        if let Some(alike) = self.seen.get(&wire) {
            let real = self.real(alike, sent);
            let is_real = written == Written::Character(real);
            return Ok(if is_real { Fate::Passes } else { Fate::Replaced(real.to_string()) });
        }
        if bytes.is_ascii() {
            return Ok(Fate::Passes);
        }
        if self.trial.setup.line.data_bits < 8 && sent.iter().any(|byte| *byte > 0x7F) {
            return Ok(Fate::Cut);
        }
        // What stands around it, such as a length or a sum, may be another one for it; and a protocol
        // with a code of its own gives the other side what was written.
        let is_within = sent.windows(bytes.len()).any(|run| run == bytes);
        let sent = if is_within || !self.is_plain { &bytes } else { sent };
        let text: String = sent.iter().map(|byte| char::from(byte & 0x7F)).collect();
        let is_text =
            self.is_plain && sent != bytes && text.chars().all(|c| (' '..='~').contains(&c));
        Ok(if is_text { Fate::Replaced(text) } else { Fate::Foreign(sent.to_vec()) })
    }

    /// Of characters that are sent alike, the one that is sent: whose code it is, where characters
    /// are sent as they are; in another code, the first.
    fn real(&self, alike: &[char], sent: &[u8]) -> char {
        let is_sent = |character: &&char| {
            self.is_plain && sent.iter().any(|byte| char::from(byte & 0x7F) == **character)
        };
        *alike.iter().find(is_sent).unwrap_or(&alike[0])
    }
}

/// What is on the wire for a block with these bytes at its end, or why it is refused.
fn tried<F, I, E>(
    trial: &Trial<'_, F>,
    records: &[u8],
    bytes: &[u8],
) -> Result<Wire, TrialError<E, I::Fault>>
where
    F: Fn() -> Result<I, E>,
    I: Instance,
    E: Error + 'static,
{
    let text = [b"N1X1", bytes, b"\nM30\n"].concat();
    let size = text.len() as u64;
    let tried = trial.go(&mut Cursor::new(text), size, records, Keep::Wire)?;
    Ok(match tried.end {
        Some(End::Done) => Ok(tried.wire),
        Some(End::Failed { failure, status } | End::CheckFailed { failure, status, .. }) => {
            Err(Some((failure, status)))
        }
        None => Err(None),
    })
}

/// What `with` has between what it begins and ends with as `without` does.
fn inserted<'a>(without: &[u8], with: &'a [u8]) -> &'a [u8] {
    let begin = without.iter().zip(with).take_while(|(one, other)| one == other).count();
    let rest = without.len().min(with.len()) - begin;
    let behind = without.iter().rev().zip(with.iter().rev());
    let end = behind.take(rest).take_while(|(one, other)| one == other).count();
    &with[begin..with.len() - end]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_put_in_is_found_between_what_is_alike() {
        assert_eq!(inserted(b"N1X1\r\n", b"N1X1a\r\n"), b"a");
        assert_eq!(inserted(b"X11", b"X111"), b"1");
        assert_eq!(inserted(b"ab", b"ab"), b"");
        // A sum behind it goes with it.
        assert_eq!(inserted(b"\x02AB\x10\x03\x11", b"\x02ABC\x10\x03\x52"), b"C\x10\x03\x52");
    }
}
