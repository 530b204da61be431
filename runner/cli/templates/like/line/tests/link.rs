//! The converter on a bench: a line in virtual time.

use my_protocol::{ACK, LINE, NAK, Plugin};
use softplug_plugin::bench::Bench;

#[test]
fn the_longest_line_is_taken_and_a_longer_one_is_not() {
    for (length, answer) in [(LINE, ACK), (LINE + 1, NAK)] {
        let mut line = vec![b'x'; length];
        line[length - 1] = b'\n';
        let mut bench = Bench::<Plugin>::new().open();
        bench.receive(&line);
        bench.run_for_millis(10);
        assert_eq!(bench.sent(), [answer]);
    }
}
