//! Mutants that are wrong in a value: what was set does not count.

use softplug_plugin::mutant;
use softplug_procedure_3964::{Options, Priority};

/// Without the feature `mutants` this changes nothing.
pub(crate) fn mutate(options: &mut Options) {
    if mutant!("r3964-simplified.line.block-size/one-more") {
        options.block_size += 1;
    }
    if mutant!("r3964-simplified.line.block-size/one-less") {
        options.block_size -= 1;
    }
    if mutant!("r3964-simplified.line.no-start-nak/sent") {
        options.nak_at_start = true;
    }
    if mutant!("r3964-simplified.line.no-doubling/doubled") {
        options.doubling = true;
    }
    if mutant!("r3964-simplified.line.no-check/checked") {
        options.bcc = true;
    }
    if mutant!("r3964-simplified.line.no-check/short-delay") && !options.bcc {
        options.qvz = 550;
    }
    if mutant!("r3964-simplified.tx.set-up-attempts/one-more") {
        options.setup_attempts += 1;
    }
    if mutant!("r3964-simplified.tx.set-up-attempts/one-less") {
        options.setup_attempts -= 1;
    }
    if mutant!("r3964-simplified.tx.one-transmission/repeated") {
        options.transmission_attempts += 1;
    }
    if mutant!("r3964-simplified.tx.no-arbitration/gives-way") {
        options.priority = Priority::Low;
    }
    if mutant!("r3964-simplified.tx.no-arbitration/insists") {
        options.priority = Priority::High;
    }
    if mutant!("r3964-simplified.tx.set-up/without-handshake") {
        options.handshake = false;
    }
    if mutant!("r3964-simplified.tx.no-handshake/handshake") {
        options.handshake = true;
    }
    if mutant!("r3964-simplified.rx.one-attempt/repetition-awaited") {
        options.bwz = 4_000;
        options.transmission_attempts += 1;
    }
    if mutant!("r3964-simplified.rx.busy/waits") {
        options.buffer_wait = 400;
    }
    if mutant!("r3964-simplified.rx.garbage-ignored/answered") {
        options.nak_on_garbage = true;
    }
}
