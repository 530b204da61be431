//! The converter on a bench: a line in virtual time.

use my_protocol::{Plugin, XOFF, XON};
use softplug_plugin::bench::Bench;

#[test]
fn a_machine_without_room_is_stopped_and_goes_on() {
    let mut bench = Bench::<Plugin>::new()
        .room(64, 1_000)
        .drain_by_hand()
        .open();
    bench.receive(&[b'x'; 800]);
    bench.run_for_millis(10);
    assert_eq!(bench.sent(), [XOFF]);
    bench.drain(800);
    bench.run_for_millis(10);
    assert_eq!(bench.sent(), [XOFF, XON]);
}
