//! Protocol A of the remote buffer, at the CNC's end: one message, one answer.

use softplug_abi::Micros;

use super::options::RemoteOptions;
use super::report::RemoteReport;

/// The most characters of NC data in one DAT.
const MOST_DATA: usize = 4_096;
/// Digits of the sum and letters of the command.
const HEAD: usize = 5;

/// What is to be done with a sound message.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) enum Heard {
    /// Nothing outside the protocol.
    Nothing,
    /// NC data.
    Data(Vec<u8>),
    /// The host has no more.
    End,
    /// The buffer is to be cleared.
    Clear,
}

/// Which message the control has sent last: the host owes its answer.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Asked {
    Syn,
    Rdy,
    Gtd,
    Sat,
    Rst,
    Alm,
    Sdi,
}

/// The protocol's machine.
#[derive(Debug)]
pub(super) struct Remote {
    options: RemoteOptions,
    state: State,
    /// The message that comes.
    message: Vec<u8>,
    /// The last message that went, RTY included, without its sum.
    last: Vec<u8>,
    last_asked: Asked,
    /// A message to be told as soon as it is the control's turn.
    urgent: Option<Asked>,
    /// A program is being read.
    is_running: bool,
    /// The host had nothing yet: not asked again before.
    patient_until: Micros,
    sent: u32,
    heard: u32,
    report: RemoteReport,
}

#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum State {
    /// Not in operation.
    Off,
    /// An answer must come by then.
    Asked { asked: Asked, until: Micros },
    /// It is the control's turn: to ask for data when there is room, or to say
    /// something by then.
    Turn { next: Asked, until: Micros },
}

impl Remote {
    pub(super) fn new(options: RemoteOptions) -> Self {
        Self {
            options,
            state: State::Off,
            message: Vec::new(),
            last: Vec::new(),
            last_asked: Asked::Syn,
            urgent: None,
            is_running: false,
            patient_until: Micros::ZERO,
            sent: 0,
            heard: 0,
            report: RemoteReport::default(),
        }
    }

    pub(super) fn report(&self) -> &RemoteReport {
        &self.report
    }

    /// Remote operation begins with the host's initialisation, a further
    /// program with asking for data.
    pub(super) fn start(&mut self, now: Micros) {
        self.is_running = true;
        match self.state {
            State::Off => self.state = State::Turn { next: Asked::Syn, until: now },
            State::Turn { next: Asked::Sat, until } => {
                self.state = State::Turn { next: Asked::Gtd, until };
            }
            State::Turn { .. } | State::Asked { .. } => {}
        }
    }

    /// A reset or an alarm: told as soon as the host has answered.
    pub(super) fn tell(&mut self, is_alarm: bool) {
        self.is_running = false;
        self.urgent = Some(if is_alarm { Asked::Alm } else { Asked::Rst });
    }

    /// The control is switched off.
    pub(super) fn switch_off(&mut self) {
        self.state = State::Off;
        self.message.clear();
        self.urgent = None;
        self.is_running = false;
    }

    /// When the control says something by itself.
    pub(super) fn next(&self, now: Micros, has_space: bool) -> Option<Micros> {
        match self.state {
            State::Off => None,
            State::Turn { .. } if self.urgent.is_some() => Some(now),
            State::Turn { next: Asked::Gtd, until } if has_space => {
                Some(self.patient_until.max(now).min(until))
            }
            State::Asked { until, .. } | State::Turn { until, .. } => Some(until),
        }
    }

    /// Says what is due: the characters of a message.
    pub(super) fn advance(&mut self, now: Micros, has_space: bool) -> Option<Vec<u8>> {
        if self.next(now, has_space)? > now {
            return None;
        }
        match self.state {
            State::Off => None,
            State::Asked { .. } => {
                self.report.silences += 1;
                Some(self.repeat(now))
            }
            State::Turn { next, .. } => {
                let asked = match (self.urgent.take(), next) {
                    (Some(urgent), _) => urgent,
                    (None, Asked::Gtd) if !has_space => Asked::Sat,
                    (None, next) => next,
                };
                Some(self.say(now, asked))
            }
        }
    }

    /// A character from the host; what it completes, and an answer to be sent
    /// at once.
    pub(super) fn take(&mut self, now: Micros, byte: u8) -> (Heard, Option<Vec<u8>>) {
        if let State::Asked { until, .. } = &mut self.state {
            *until = now + self.options.period;
        }
        if byte != self.options.end_code {
            // Longer than any message: it is damaged, and grows no further.
            if self.message.len() <= HEAD + MOST_DATA {
                self.message.push(byte);
            }
            return (Heard::Nothing, None);
        }
        let message = std::mem::take(&mut self.message);
        let State::Asked { asked, .. } = self.state else {
            match message.get(2..5).filter(|_| self.is_sound(&message)) {
                Some(b"SYN") => return (Heard::Nothing, Some(self.initialise(now))),
                // The host is ready: whether it was asked or not is all the same.
                Some(b"RDY") => return (Heard::Nothing, None),
                Some(b"RTY") => {
                    self.report.retries_heard += 1;
                    return (Heard::Nothing, Some(self.frame(&self.last.clone())));
                }
                _ => {}
            }
            self.fault(format!("unasked message {}", printable(&message)));
            return (Heard::Nothing, None);
        };
        let count = self.heard;
        self.heard += 1;
        let is_sound = self.is_sound(&message);
        if !is_sound {
            self.fault(format!("damaged message {}", printable(&message)));
        }
        if !is_sound || self.options.refusals.contains(&count) {
            self.report.retries_asked += 1;
            let reason = if is_sound { b'1' } else { b'2' };
            // The answer that is owed stays the same; if this is damaged, it is
            // said again and not what was asked before.
            self.last = vec![b'R', b'T', b'Y', reason];
            self.last_asked = asked;
            return (Heard::Nothing, Some(self.repeat(now)));
        }
        self.report.received += 1;
        self.answer(now, asked, &message[2..5], &message[5..])
    }

    /// The host initialises the remote buffer: ready, and no answer is awaited.
    fn initialise(&mut self, now: Micros) -> Vec<u8> {
        self.report.received += 1;
        self.resume(now);
        self.last = b"RDY".to_vec();
        self.frame(b"RDY")
    }

    /// After an exchange: data is asked for as long as a program is read.
    fn resume(&mut self, now: Micros) {
        let next = if self.is_running { Asked::Gtd } else { Asked::Sat };
        self.state = State::Turn { next, until: now + self.options.period };
    }

    fn is_sound(&self, message: &[u8]) -> bool {
        let Some((sum, rest)) = message.split_at_checked(2) else { return false };
        rest.len() >= 3 && sum == sum_of(rest, self.options.end_code)
    }

    fn answer(
        &mut self,
        now: Micros,
        asked: Asked,
        command: &[u8],
        data: &[u8],
    ) -> (Heard, Option<Vec<u8>>) {
        let until = now + self.options.period;
        let announces = self.options.announce_ready;
        let now_do = |next| State::Turn { next, until: now };
        let mut heard = Heard::Nothing;
        let mut turn = None;
        match (asked, command) {
            (_, b"RTY") => {
                self.report.retries_heard += 1;
                return (Heard::Nothing, Some(self.repeat(now)));
            }
            (Asked::Syn, b"RDY") if announces => turn = Some(now_do(Asked::Rdy)),
            (Asked::Syn | Asked::Sat, b"SYN") => turn = Some(now_do(Asked::Rdy)),
            // Not ready yet: told again after a while.
            (Asked::Rdy, b"SYN") => turn = Some(State::Turn { next: Asked::Rdy, until }),
            (Asked::Syn | Asked::Rdy, b"RDY")
            | (Asked::Sat, b"SET")
            | (Asked::Gtd | Asked::Sat | Asked::Sdi, b"SDO") => {}
            (Asked::Gtd, b"DAT") if data.len() <= MOST_DATA => {
                self.report.data += 1;
                heard = Heard::Data(data.to_vec());
            }
            (Asked::Gtd, b"WAT") => {
                self.report.waits += 1;
                self.patient_until = now + Micros(self.options.period.0 / 10);
            }
            (Asked::Gtd, b"EOD") => {
                heard = Heard::End;
                self.is_running = false;
            }
            (Asked::Sat, b"CLB") => heard = Heard::Clear,
            (Asked::Gtd | Asked::Sat, b"RDI") => turn = Some(now_do(Asked::Sdi)),
            (Asked::Rst, b"ARS") | (Asked::Alm, b"AAL") => self.report.acknowledged += 1,
            _ => {
                let words = printable(command);
                self.fault(format!("{words} with {} characters for {asked:?}", data.len()));
            }
        }
        match turn {
            Some(turn) => self.state = turn,
            None => self.resume(now),
        }
        (heard, None)
    }

    fn say(&mut self, now: Micros, asked: Asked) -> Vec<u8> {
        let text: &[u8] = match asked {
            Asked::Syn => b"SYN",
            Asked::Rdy => b"RDY",
            Asked::Gtd => b"GTD",
            Asked::Sat => b"SAT00",
            Asked::Rst => b"RST",
            Asked::Alm => b"ALM",
            Asked::Sdi => b"SDI00",
        };
        self.last = text.to_vec();
        self.last_asked = asked;
        self.repeat(now)
    }

    fn repeat(&mut self, now: Micros) -> Vec<u8> {
        let message = self.frame(&self.last.clone());
        self.state = State::Asked { asked: self.last_asked, until: now + self.options.period };
        message
    }

    fn frame(&mut self, text: &[u8]) -> Vec<u8> {
        let mut sum = sum_of(text, self.options.end_code);
        if self.options.wrong_sums.contains(&self.sent) {
            sum[1] = if sum[1] == b'0' { b'1' } else { b'0' };
        }
        self.sent += 1;
        self.report.sent += 1;
        let mut message = sum.to_vec();
        message.extend(text);
        message.push(self.options.end_code);
        message
    }

    fn fault(&mut self, words: String) {
        self.report.faults.push(words);
    }
}

/// Low 8 bits of the sum from the command through the end code, high digit first.
fn sum_of(text: &[u8], end_code: u8) -> [u8; 2] {
    let sum = text.iter().fold(end_code, |sum, byte| sum.wrapping_add(*byte));
    let digit = |value: u8| b"0123456789ABCDEF"[usize::from(value)];
    [digit(sum >> 4), digit(sum & 15)]
}

fn printable(bytes: &[u8]) -> String {
    let most = bytes.len().min(24);
    bytes[..most].escape_ascii().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn remote(options: RemoteOptions) -> Remote {
        let mut remote = Remote::new(options);
        remote.start(Micros::ZERO);
        remote
    }

    /// What the control says at `now`, and the host's answer to it.
    fn turn(remote: &mut Remote, now: i64, says: &str, answer: &str) -> (Heard, Option<String>) {
        let said = remote.advance(Micros(now), true).map(|said| said.escape_ascii().to_string());
        assert_eq!(said.as_deref(), Some(says), "at {now}");
        hear(remote, now, answer)
    }

    fn hear(remote: &mut Remote, now: i64, answer: &str) -> (Heard, Option<String>) {
        let mut message = sum_of(answer.as_bytes(), b'\r').to_vec();
        message.extend(answer.as_bytes());
        hear_raw(remote, now, &message)
    }

    fn hear_raw(remote: &mut Remote, now: i64, message: &[u8]) -> (Heard, Option<String>) {
        for byte in message {
            assert_eq!(remote.take(Micros(now), *byte), (Heard::Nothing, None));
        }
        let (heard, said) = remote.take(Micros(now), b'\r');
        (heard, said.map(|said| said.escape_ascii().to_string()))
    }

    const NOTHING: (Heard, Option<String>) = (Heard::Nothing, None);

    #[test]
    fn a_program_comes_in_packets() {
        let mut remote = remote(RemoteOptions::default());
        // S, Y, N and CR: 53 + 59 + 4E + 0D = 107.
        assert_eq!(turn(&mut remote, 0, "07SYN\\r", "SYN"), NOTHING);
        assert_eq!(turn(&mut remote, 1, "FCRDY\\r", "RDY"), NOTHING);
        let data = Heard::Data(b"%\nO1\n".to_vec());
        assert_eq!(turn(&mut remote, 2, "ECGTD\\r", "DAT%\nO1\n"), (data, None));
        assert_eq!(turn(&mut remote, 3, "ECGTD\\r", "WAT"), NOTHING);
        // Asked again after a tenth of Tp; without room the status is told after Tp.
        assert_eq!(remote.next(Micros(3), true), Some(Micros(500_003)));
        assert_eq!(remote.next(Micros(3), false), Some(Micros(5_000_003)));
        assert_eq!(turn(&mut remote, 500_003, "ECGTD\\r", "EOD"), (Heard::End, None));
        assert_eq!(turn(&mut remote, 5_500_003, "55SAT00\\r", "SET"), NOTHING);
        let report = remote.report();
        assert_eq!((report.data, report.waits, report.silences), (1, 1, 0));
        assert_eq!(report.faults, [""; 0]);
    }

    #[test]
    fn a_damaged_message_is_asked_for_again_and_repeated_on_request() {
        let refusals = vec![1];
        let mut remote = remote(RemoteOptions { refusals, ..RemoteOptions::default() });
        turn(&mut remote, 0, "07SYN\\r", "SYN");
        let retry = "3DRTY1\\r".to_owned();
        assert_eq!(turn(&mut remote, 1, "FCRDY\\r", "RDY"), (Heard::Nothing, Some(retry)));
        assert_eq!(hear(&mut remote, 2, "RDY"), NOTHING);
        let again = Some("ECGTD\\r".to_owned());
        assert_eq!(turn(&mut remote, 3, "ECGTD\\r", "RTY1"), (Heard::Nothing, again));
        let retry = (Heard::Nothing, Some("3ERTY2\\r".to_owned()));
        assert_eq!(hear_raw(&mut remote, 4, b"00DATX"), retry);
        assert_eq!(remote.report().faults, ["damaged message 00DATX"]);
        assert_eq!((remote.report().retries_asked, remote.report().retries_heard), (2, 1));
    }

    #[test]
    fn a_damaged_rty_is_said_again_itself() {
        let options =
            RemoteOptions { refusals: vec![0], wrong_sums: vec![1], ..Default::default() };
        let mut remote = remote(options);
        let wrong = (Heard::Nothing, Some("30RTY1\\r".to_owned()));
        assert_eq!(turn(&mut remote, 0, "07SYN\\r", "SYN"), wrong);
        let right = (Heard::Nothing, Some("3DRTY1\\r".to_owned()));
        assert_eq!(hear(&mut remote, 1, "RTY1"), right);
        assert_eq!(hear(&mut remote, 2, "SYN"), NOTHING);
    }

    #[test]
    fn the_host_may_initialise_too() {
        let mut remote = Remote::new(RemoteOptions::default());
        let ready = Some("FCRDY\\r".to_owned());
        assert_eq!(hear(&mut remote, 7, "SYN"), (Heard::Nothing, ready));
        assert_eq!(remote.next(Micros(7), true), Some(Micros(5_000_007)));
        remote.start(Micros(8));
        assert!(matches!(turn(&mut remote, 8, "ECGTD\\r", "DATX").0, Heard::Data(_)));
        hear(&mut remote, 9, "DATX");
        assert_eq!(remote.report().faults, ["unasked message 3EDATX"]);
    }

    #[test]
    fn silence_is_counted_and_the_message_said_again() {
        let mut remote = remote(RemoteOptions::default());
        assert!(remote.advance(Micros::ZERO, true).is_some());
        assert_eq!(remote.advance(Micros(4_999_999), true), None);
        // A message under way is no silence.
        assert_eq!(remote.take(Micros(3_000_000), b'0'), (Heard::Nothing, None));
        assert_eq!(remote.advance(Micros(7_999_999), true), None);
        assert!(remote.advance(Micros(8_000_000), true).is_some());
        assert_eq!((remote.report().silences, remote.report().sent), (1, 2));
    }

    #[test]
    fn a_reset_is_told_when_the_host_has_answered() {
        let mut remote = remote(RemoteOptions::default());
        turn(&mut remote, 0, "07SYN\\r", "SYN");
        turn(&mut remote, 1, "FCRDY\\r", "RDY");
        assert!(remote.advance(Micros(2), true).is_some());
        remote.tell(false);
        assert_eq!(remote.next(Micros(2), true), Some(Micros(5_000_002)));
        assert!(matches!(hear(&mut remote, 3, "DATX"), (Heard::Data(_), None)));
        assert_eq!(turn(&mut remote, 4, "06RST\\r", "ARS"), NOTHING);
        assert_eq!(remote.report().acknowledged, 1);
        // Then nothing is asked for until remote operation begins again.
        assert_eq!(remote.next(Micros(4), true), Some(Micros(5_000_004)));
    }
}
