//! Each test has a computer of its own.

mod ports;
