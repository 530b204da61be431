//! The procedures 3964 and 3964R, and RK512 on top of them.
#![cfg_attr(target_arch = "wasm32", no_std)]
