//! The converter on a bench: a line in virtual time.

use my_protocol::{CR, Plugin};
use softplug_plugin::bench::Bench;

#[test]
fn a_reply_belongs_to_its_question() {
    let mut bench = Bench::<Plugin>::new().open();
    bench.receive(b"unasked\r");
    bench.send(b"?POS");
    bench.run_for_millis(100);
    assert_eq!(bench.sent(), [b"?POS".as_slice(), &[CR]].concat());
    bench.receive(b"X10\r");
    assert_eq!(bench.deliveries()[0].bytes, b"X10");
}
