//! Two machines: one sends, the other takes.

use super::*;

/// What a sender and a receiver make of a file, once both are silent.
fn meet(sender: Options, receiver: Options) -> [Report; 2] {
    let mut ends = [Machine::new(sender), Machine::new(receiver)];
    while let Some(now) = ends.iter().filter_map(Machine::next_event).min() {
        assert!(now < Micros::from_secs(10_000), "it never ends");
        for end in &mut ends {
            end.advance(now);
        }
        for (from, to) in [(0, 1), (1, 0)] {
            while let Some(byte) = ends[from].poll_transmit(now) {
                ends[to].receive(now, byte);
            }
        }
    }
    ends.map(|end| end.report)
}

fn sending(file: &[u8]) -> Options {
    Options { file: Some(("O1.NC".to_owned(), file.to_vec())), ..Options::default() }
}

#[test]
fn a_file_passes_in_all_forms() {
    let file: Vec<u8> = (0..9_000_u32).map(|n| (n * n / 50 % 256) as u8).collect();
    for (check, eighth, repeat, long) in [
        (1, None, None, None),
        (2, Some(b'&'), None, None),
        (3, None, Some(b'~'), Some(500)),
        (3, Some(b'&'), Some(b'~'), None),
    ] {
        let sender = Options { check, eighth, repeat, long, ..sending(&file) };
        let receiver = Options { long, ..Options::default() };
        let [sent, received] = meet(sender, receiver);
        assert!(sent.is_done && received.is_done && received.is_kept, "{check} {long:?}");
        assert_eq!(received.name, "O1.NC");
        assert_eq!(received.came, file);
    }
}

#[test]
fn what_is_damaged_or_lost_is_sent_again() {
    let file = [b'x'; 1_000].map(|byte| byte ^ 3);
    let sender = Options { damaged: vec![1, 4, 5], repeat: None, ..sending(&file) };
    let receiver = Options { damaged: vec![7], lost: vec![3], ..Options::default() };
    let [sent, received] = meet(sender, receiver);
    assert!(sent.is_done && received.is_done);
    assert_eq!(received.came, file);
    assert!(sent.packets > 18, "{sent:?}");
}

#[test]
fn nobody_there_is_given_up() {
    let mut machine = Machine::new(sending(b"M30"));
    while let Some(now) = machine.next_event() {
        machine.advance(now);
        while machine.poll_transmit(now).is_some() {}
    }
    assert!(machine.report().is_over && !machine.report().is_done);
}
