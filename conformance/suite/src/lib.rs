//! Judges Softplug plug-ins: simulated partners, replay and reports.

pub mod partners;
