//! The built command on real serial drivers, in an emulated computer.

mod needs_qemu_system_x86_64;
