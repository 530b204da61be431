//! Fields of a job.

use super::telegram::{Area, Command, Kind};
use super::ways::Ways;
use softplug_abi::Failure;

/// What does not fit: the failure, its status and the clause.
pub(super) type Unfit = (Failure, u16, &'static str);

const BAD: Unfit = (Failure::BadJob, 0, "rk512.job.fields");

/// The command of a job.
///
/// # Errors
/// It is none.
pub(super) fn command(
    kind: &str,
    fields: &[(String, String)],
    data: &[u8],
    ways: &mut Ways,
) -> Result<Command, Unfit> {
    let kind = match kind {
        "write" => Kind::Send,
        "read" => Kind::Fetch,
        _ => return Err((Failure::NotSupported, 0, "rk512.job.kinds")),
    };
    let fields = Fields(fields);
    let area = fields.text("area").and_then(Area::of_name).ok_or(BAD)?;
    if kind == Kind::Send && !area.is_block() {
        return Err(BAD);
    }
    let block = fields.within("block", 0..=255)?;
    // Requests have a 0 where an area has no number.
    if !area.is_block() && !matches!(block, None | Some(0)) {
        return Err(BAD);
    }
    let offset = fields.within("offset", 0..=255)?;
    // What it means that they are not given is left open.
    let is_whole = offset.is_some() && (block.is_some() || !area.is_block());
    if !is_whole && ways.is_other() {
        return Err(BAD);
    }
    let flag = fields.flag()?;
    let told = fields.within("count", 1..=65_535)?;
    let count = match kind {
        Kind::Fetch => told.ok_or(BAD)?,
        // Whether nothing can be written is left open, and as what it fails.
        Kind::Send if data.is_empty() && ways.is_other() => return Err(BAD),
        Kind::Send if data.len() % 2 == 1 || data.is_empty() && ways.is_other() => {
            return Err((Failure::BadJob, 0x050E, "rk512.job.fields"));
        }
        Kind::Send => data.len() as i64 / 2,
    };
    let Ok(count) = u16::try_from(count) else {
        // As what more than a header can tell fails is left open.
        let too_long = (Failure::TooLong, 0x0517, "rk512.job.fields");
        return Err(if ways.is_other() { BAD } else { too_long });
    };
    if told.is_some_and(|told| told != i64::from(count)) {
        return Err(BAD);
    }
    Ok(Command {
        kind,
        area,
        block: block.unwrap_or(0) as u8,
        offset: offset.unwrap_or(0) as u8,
        count,
        flag,
    })
}

/// Fields by name.
struct Fields<'a>(&'a [(String, String)]);

impl Fields<'_> {
    fn text(&self, name: &str) -> Option<&str> {
        self.0.iter().find(|(known, _)| known == name).map(|(_, value)| value.as_str())
    }

    fn within(
        &self,
        name: &str,
        range: std::ops::RangeInclusive<i64>,
    ) -> Result<Option<i64>, Unfit> {
        let Some(text) = self.text(name) else { return Ok(None) };
        let value = text.parse().ok().filter(|value| range.contains(value));
        value.ok_or(BAD).map(Some)
    }

    /// Bytes 9 and 10: the coordination flag and the CPU.
    fn flag(&self) -> Result<[u8; 2], Unfit> {
        // FF would be no flag.
        let byte = self.within("flag_byte", 0..=254)?;
        let bit = self.within("flag_bit", 0..=7)?;
        if byte.is_some() != bit.is_some() {
            return Err(BAD);
        }
        let cpu = self.within("cpu", 1..=4)?.unwrap_or(0xF);
        let low = bit.unwrap_or(0xF);
        Ok([byte.unwrap_or(0xFF) as u8, (cpu << 4 | low) as u8])
    }
}
