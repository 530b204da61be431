//! The built command from outside: what it prints and how it ends.

#![allow(clippy::disallowed_macros, reason = "tests print their figures")]

mod bench;
#[cfg(target_os = "linux")]
mod bombs;
mod certify;
mod ci_kit;
mod ci_new;
#[cfg(target_os = "linux")]
mod dev;
mod diff;
mod exchange;
mod explore;
mod files;
#[cfg(target_os = "linux")]
mod foreign;
#[cfg(target_os = "linux")]
mod full_output;
#[cfg(target_os = "linux")]
mod gateway;
mod help;
#[cfg(target_os = "linux")]
mod kermit;
mod kit;
mod languages;
#[cfg(target_os = "linux")]
mod library;
mod machines;
mod own_corpus;
mod pack;
mod plan;
mod plugins;
#[cfg(target_os = "linux")]
mod put_away;
#[cfg(target_os = "linux")]
mod record;
mod recorded;
mod refusals;
#[cfg(target_os = "linux")]
mod remote;
mod replay;
#[cfg(target_os = "linux")]
mod simulation;
#[cfg(target_os = "linux")]
mod simulations;
#[cfg(target_os = "linux")]
mod step;
#[cfg(target_os = "linux")]
mod transfers;
#[cfg(target_os = "linux")]
mod unit;
#[cfg(target_os = "linux")]
mod unit_settings;
#[cfg(target_os = "linux")]
mod unit_strangers;
#[cfg(target_os = "linux")]
mod xmodem;
