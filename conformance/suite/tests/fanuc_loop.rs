//! The FANUC plug-in and a simulated control on one line: programs in, programs
//! out, stops, resets and the remote buffer.

mod punching;
mod reading;
mod remote;

use softplug_abi::Micros;
use softplug_machines::fanuc::{Eob, Options};

const SECOND: Micros = Micros::from_secs(1);
const EOBS: [(&str, Eob); 5] = [
    ("lf", Eob::Lf),
    ("crlf", Eob::CrLf),
    ("lfcrcr", Eob::LfCrCr),
    ("lfcr", Eob::LfCr),
    ("cr", Eob::Cr),
];

/// A control whose 256 characters fill and drain many times.
fn small(options: Options) -> Options {
    Options {
        buffer: 256,
        reserve: 32,
        resume: 128,
        block_time: Micros::from_millis(60),
        ..options
    }
}
