//! The converter on a bench: a line in virtual time.

use my_protocol::{ACK, EOT, Plugin, STX};
use softplug_plugin::bench::Bench;

#[test]
fn blocks_wait_for_their_answers() {
    let mut bench = Bench::<Plugin>::new().open();
    bench.send(b"G1");
    bench.run_for_millis(100);
    bench.receive(&[ACK]);
    bench.run_for_millis(100);
    assert_eq!(bench.sent(), [STX, 2, b'G', b'1', b'G' + b'1', EOT]);
}
