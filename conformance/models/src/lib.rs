//! Executable specifications of the profiles, and random sessions that hold a
//! plug-in to them.
//!
//! A [`Model`] is told what a plug-in is given and what it does, and says what may
//! not be. It is written from the protocol's page and the ledger alone and shares no
//! code with a plug-in or a simulated machine: slow and obvious, so that a reader
//! can hold it against the page. [`PROFILES`] lists them.
//!
//! A [`Session`] drives one plug-in in virtual time: the model proposes what a
//! partner and a host could do next, noise is added, and everything is judged. What
//! was given is kept: a session that fails is made as short as it can be, and runs
//! again the same.
//!
//! ```
//! use softplug_abi::manifest::Manifest;
//! use softplug_models::{Session, profile};
//! use softplug_native::NativePlugin;
//!
//! let plugin = NativePlugin::XonXoff;
//! let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
//! let profile = profile("xon-xoff").expect("it has a model");
//! let session = Session::draw(profile, &manifest, 1, 0).expect("its settings fit");
//! let ran = session.run(&manifest, &mut || Ok(plugin.instantiate()));
//! assert_eq!(ran.finding, None);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod block_room;
mod cover;
mod demands;
mod dice;
mod drive;
mod expected;
mod fanuc_rs232;
mod fanuc_rs232_remote;
mod heidenhain_fe;
mod kermit;
mod line_ends;
mod model;
mod noise;
mod out;
mod port;
mod propose;
mod pulse_lathe;
mod r3964;
mod rk512;
mod room;
mod session;
mod settings;
mod shrink;
mod words;
mod xmodem;
mod xon_xoff;

pub use dice::Dice;
pub use drive::{Finding, Ran, Step};
pub use model::{
    Broken, Conditions, Effect, Given, HostRequest, LineInput, Model, Preset, Profile, Proposal,
};
pub use port::Port;
pub use session::Session;
pub use settings::Settings;

/// Every profile that has a model.
pub const PROFILES: &[&Profile] = &[
    &fanuc_rs232::PROFILE,
    &heidenhain_fe::PROFILE,
    &kermit::PROFILE,
    &pulse_lathe::PROFILE,
    &r3964::PLAIN_3964,
    &r3964::R3964,
    &r3964::SIMPLIFIED,
    &rk512::PROFILE,
    &xmodem::PROFILE,
    &xon_xoff::PROFILE,
];

/// The profile of this name, if it has a model.
pub fn profile(name: &str) -> Option<&'static Profile> {
    PROFILES.iter().copied().find(|profile| profile.name == name)
}
