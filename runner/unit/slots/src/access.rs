//! Reading and programming a device with care.

use crate::device::Device;
use crate::error::{Doing, Fault};
use sha2::{Digest, Sha256};

/// Bytes that are read at a time: a multiple of every granule.
const CHUNK: usize = 256;
/// Times that a read is tried. What fails as often is damaged.
const TRIES: u32 = 3;

pub(crate) type Done<D> = Result<(), Fault<<D as Device>::Error>>;

/// Reads whole granules.
pub(crate) fn read<D: Device>(device: &mut D, at: u32, into: &mut [u8]) -> Done<D> {
    let mut tries = 1;
    loop {
        match device.read(at, into) {
            Ok(()) => return Ok(()),
            Err(_) if tries < TRIES => tries += 1,
            Err(source) => return Err(Fault::Failed { doing: Doing::Reading, at, source }),
        }
    }
}

/// Reads any bytes from `offset` behind `at`, which begins a granule, piece by piece. `take` gets the bytes and their
/// place among them.
pub(crate) fn read_pieces<D: Device>(
    device: &mut D,
    at: u32,
    offset: u32,
    length: u32,
    mut take: impl FnMut(usize, &[u8]),
) -> Done<D> {
    let granule = device.geometry().granule;
    let mut chunk = [0; CHUNK];
    let mut done = 0;
    while done < length {
        let place = offset + done;
        let before = place % granule;
        let wanted = (length - done).min(CHUNK as u32 - before);
        let whole = (before + wanted).next_multiple_of(granule) as usize;
        read(device, at + place - before, &mut chunk[..whole])?;
        take(done as usize, &chunk[before as usize..(before + wanted) as usize]);
        done += wanted;
    }
    Ok(())
}

pub(crate) fn digest<D: Device>(
    device: &mut D,
    at: u32,
    length: u32,
) -> Result<[u8; 32], Fault<D::Error>> {
    let mut digest = Sha256::new();
    read_pieces(device, at, 0, length, |_, bytes| digest.update(bytes))?;
    Ok(digest.finalize().into())
}

pub(crate) fn erase<D: Device>(device: &mut D, at: u32, length: u32) -> Done<D> {
    let failed = |source| Fault::Failed { doing: Doing::Erasing, at, source };
    device.erase(at, length).map_err(failed)
}

/// Programs whole granules, and looks whether they are there.
pub(crate) fn program<D: Device>(device: &mut D, at: u32, bytes: &[u8]) -> Done<D> {
    if bytes.is_empty() {
        return Ok(());
    }
    let failed = |source| Fault::Failed { doing: Doing::Programming, at, source };
    device.program(at, bytes).map_err(failed)?;
    let mut is_kept = true;
    read_pieces(device, at, 0, bytes.len() as u32, |place, found| {
        is_kept &= bytes[place..].starts_with(found);
    })?;
    if is_kept { Ok(()) } else { Err(Fault::NotKept { at }) }
}
