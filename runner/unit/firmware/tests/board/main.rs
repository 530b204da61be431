//! The built firmware on an emulated board, with a gateway's end at its uplink and a machine at its line.

mod needs_qemu_system_arm;
