//! Mutants that are wrong in a value: what was set does not count.

use softplug_plugin::mutant;
use softplug_procedure_3964::{Options, Priority};

/// Without the feature `mutants` this changes nothing.
pub(crate) fn mutate(options: &mut Options) {
    if mutant!("r3964.line.presets/set-up-attempts-not-taken") {
        options.setup_attempts = 6;
    }
    if mutant!("r3964.line.start-nak/though-off") {
        options.nak_at_start = true;
    }
    if mutant!("r3964.tx.qvz/character-delay-instead") {
        options.qvz = options.zvz;
    }
    if mutant!("r3964.tx.set-up-attempts/one-more") {
        options.setup_attempts += 1;
    }
    if mutant!("r3964.tx.set-up-attempts/one-less") {
        options.setup_attempts -= 1;
    }
    if mutant!("r3964.tx.split/refused") {
        options.split = false;
    }
    if mutant!("r3964.rx.garbage/answered-though-off") {
        options.nak_on_garbage = true;
    }
    if mutant!("r3964.rx.no-buffer/refused-at-once") {
        options.buffer_wait = 0;
    }
    if mutant!("r3964.rx.bwz/waits-without") && options.bwz == 0 {
        options.bwz = 4_000;
    }
    options.priority = priority(options.priority);
    if mutant!("3964.tx.qvz/not-taken") && !options.bcc {
        options.qvz = 0;
    }
}

/// Whose turn it is in a conflict.
fn priority(set: Priority) -> Priority {
    match set {
        Priority::Low if mutant!("r3964.conflict.low/insists") => Priority::High,
        Priority::High if mutant!("r3964.conflict.high/gives-way") => Priority::Low,
        Priority::None if mutant!("r3964.conflict.none/gives-way") => Priority::Low,
        Priority::None if mutant!("r3964.conflict.none/insists") => Priority::High,
        _ => set,
    }
}
