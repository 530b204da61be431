//! `softplug simulate fanuc-rs232`.

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, ValueEnum};
use softplug_abi::Micros;
use softplug_machines::fanuc::{
    CharacterSet, Code, Dc4, Eob, Feeding, Interface, Options, Parity, Press, PunchOptions,
    RemoteOptions, TvCheck, eight_none_two, seven_even_two,
};

use super::{Common, RunOptions, seconds};
use crate::failure::Failure;
use crate::files;

/// A FANUC control: reader/punch interface or remote buffer, with its alarms.
///
/// Prints the path to connect to, runs until Ctrl-C, then reports: what was read, alarms, holds,
/// and how many characters came after each DC3. Ends with 1 if the control raised an alarm or did
/// not get what was expected. What the operator does is given with --press; without it, READ is
/// pressed after half a second. A pseudo-terminal carries no parity bit and no modem lines: parity
/// is either left out (uart) or bit 7 of the character (software).
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug simulate fanuc-rs232
  softplug simulate fanuc-rs232 --once --expect O0001.nc --buffer 128 --block-time 20000
  softplug simulate fanuc-rs232 --code eia --drip 64 --press 0.5:read
  softplug simulate fanuc-rs232 --press 1:punch=O0001.nc --eob lfcrcr --trailer 40 --dc4 late=20
  softplug simulate fanuc-rs232 --press 1:request=O1234 --press 20:reset --tell-reset
  softplug simulate fanuc-rs232 --interface remote-a --buffer 4096")]
pub(super) struct Fanuc {
    /// Baud rate; it paces what the control itself sends
    #[arg(long, default_value_t = 4_800, value_parser = clap::value_parser!(u32).range(50..=16_000_000))]
    baud: u32,
    /// The control's interface
    #[arg(long, value_enum, default_value_t, value_name = "WHICH")]
    interface: InterfaceBy,
    /// Code of the programs, both ways
    #[arg(long, value_enum, default_value_t, value_name = "CODE")]
    code: CodeBy,
    /// Where ISO's even parity is
    #[arg(long, value_enum, default_value_t, value_name = "WHERE")]
    parity: ParityBy,
    /// DC1 to DC4 go out without parity: DC3 is 13 and not 93
    #[arg(long)]
    plain_codes: bool,
    /// Each DC1 and DC3 is sent twice
    #[arg(long)]
    codes_twice: bool,
    /// Take all printable ASCII, and not only the characters of FANUC's table
    #[arg(long)]
    ascii: bool,
    /// CR ends a block in ISO, and LF means nothing
    #[arg(long)]
    cr_ends_block: bool,
    /// Check that every block has an even number of characters (TV), alarm 002
    #[arg(long)]
    tv: bool,
    /// Characters in the receive buffer
    #[arg(long, default_value_t = 512, value_name = "CHARACTERS")]
    buffer: usize,
    /// DC3 is sent when fewer characters than this are free
    #[arg(long, default_value_t = 64, value_name = "CHARACTERS")]
    reserve: usize,
    /// DC1 is sent again when at least so many are free
    #[arg(long, default_value_t = 256, value_name = "CHARACTERS")]
    resume: usize,
    /// Characters that may come after DC3; one more is alarm 087
    #[arg(long, default_value_t = 10, value_name = "CHARACTERS")]
    tolerance: u32,
    /// How long a block takes to be stored or executed
    #[arg(long, default_value_t = 0, value_name = "MICROSECONDS", value_parser = clap::value_parser!(i64).range(0..=60_000_000))]
    block_time: i64,
    /// Execute the program while it comes, from so many characters on
    #[arg(long, value_name = "CHARACTERS")]
    drip: Option<usize>,
    /// How long the control takes to look at what came
    #[arg(long, default_value_t = 0, value_name = "MICROSECONDS", value_parser = clap::value_parser!(i64).range(0..=10_000_000))]
    latency: i64,
    /// Repeat DC1 after so many milliseconds of silence
    #[arg(long, value_name = "MILLISECONDS", value_parser = clap::value_parser!(i64).range(1..=600_000))]
    repeat_dc1: Option<i64>,
    /// Send no DC3 when the closing % was read
    #[arg(long)]
    no_final_dc3: bool,
    /// Tell a reset or an alarm by SYN or NAK
    #[arg(long)]
    tell_reset: bool,
    /// What the operator does, and after how many seconds: read, punch=FILE, request=NAME, reset,
    /// alarm, off or on; may be repeated
    #[arg(long, value_name = "SECONDS:WHAT")]
    press: Vec<Pressed>,
    /// Punch without DC2
    #[arg(long)]
    no_dc2: bool,
    /// Punch only after DC1, and repeat DC2 after so many milliseconds without
    #[arg(long, value_name = "MILLISECONDS", value_parser = clap::value_parser!(i64).range(1..=600_000))]
    wait_dc1: Option<i64>,
    /// Ends of block in a punch
    #[arg(long, value_enum, default_value_t, value_name = "FORM")]
    eob: EobBy,
    /// NULs before a punched program
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = clap::value_parser!(u16))]
    leader: u16,
    /// NULs after it
    #[arg(long, default_value_t = 0, value_name = "N")]
    trailer: u32,
    /// The end of a punch: prompt, late=N (after N further NULs) or missing
    #[arg(long, default_value = "prompt", value_name = "HOW", value_parser = dc4)]
    dc4: Dc4,
    /// Characters that still leave after the host's DC3
    #[arg(long, default_value_t = 10, value_name = "CHARACTERS")]
    after_dc3: u32,
    /// A punch that was held goes on at DC2 instead of DC1
    #[arg(long)]
    resume_on_dc2: bool,
    /// Number of the program that carries a request
    #[arg(long, default_value_t = 9_999, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=99_999_999))]
    request_program: u32,
    /// Remote buffer, protocol A: status and longest silence, Tp
    #[arg(long, default_value_t = 5_000, value_name = "MILLISECONDS", value_parser = clap::value_parser!(i64).range(1..=600_000))]
    period: i64,
    /// Remote buffer, protocol A: data is asked for when more characters than this are free
    #[arg(long, default_value_t = 1_024, value_name = "CHARACTERS")]
    space: usize,
    /// Remote buffer, protocol A: messages end with ETX instead of CR
    #[arg(long)]
    etx: bool,
    /// Remote buffer, protocol A: this message of the control has a wrong sum; may be repeated
    #[arg(long, value_name = "N")]
    wrong_sum: Vec<u32>,
    /// Remote buffer, protocol A: this message of the host is asked for again; may be repeated
    #[arg(long, value_name = "N")]
    refuse: Vec<u32>,
    #[command(flatten)]
    common: Common,
}

#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, ValueEnum)]
enum InterfaceBy {
    #[default]
    Reader,
    RemoteA,
    RemoteB,
}

#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, ValueEnum)]
enum CodeBy {
    #[default]
    Iso,
    Eia,
}

#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, ValueEnum)]
enum ParityBy {
    #[default]
    Uart,
    Software,
    None,
}

#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, ValueEnum)]
enum EobBy {
    #[default]
    Lf,
    #[value(name = "crlf")]
    CrLf,
    #[value(name = "lfcrcr")]
    LfCrCr,
    #[value(name = "lfcr")]
    LfCr,
    Cr,
}

/// `1.5:punch=FILE`.
#[derive(Clone, Debug)]
struct Pressed {
    after: f64,
    what: What,
}

#[derive(Clone, Debug)]
enum What {
    Punch(PathBuf),
    Other(Press),
}

impl FromStr for Pressed {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (after, what) = text.split_once(':').ok_or("write SECONDS:WHAT, such as 0.5:read")?;
        let what = match what.split_once('=').unwrap_or((what, "")) {
            ("read", "") => What::Other(Press::Read),
            ("punch", file) if !file.is_empty() => What::Punch(PathBuf::from(file)),
            ("request", name) if !name.is_empty() => What::Other(Press::Request(name.to_owned())),
            ("reset", "") => What::Other(Press::Reset),
            ("alarm", "") => What::Other(Press::Alarm),
            ("off", "") => What::Other(Press::Off),
            ("on", "") => What::Other(Press::On),
            _ => return Err(format!("\"{what}\" is nothing that an operator does here")),
        };
        Ok(Self { after: seconds(after)?, what })
    }
}

/// A simulation that was checked.
pub(crate) struct FanucSimulation {
    pub(crate) options: Options,
    /// When the operator does the last thing.
    pub(crate) last_press: Micros,
    pub(crate) run: RunOptions,
}

impl Fanuc {
    pub(super) fn prepare(self) -> Result<FanucSimulation, Failure> {
        let panel = self.panel()?;
        let needs_eight = self.code == CodeBy::Eia || self.parity != ParityBy::Uart;
        let line = if needs_eight { eight_none_two(self.baud) } else { seven_even_two(self.baud) };
        let last_press = panel.last().map_or(Micros::ZERO, |(at, _)| *at);
        let sends = panel.iter().any(|(_, press)| *press != Press::Read);
        let options = Options {
            line,
            interface: match self.interface {
                InterfaceBy::Reader => Interface::ReaderPunch,
                InterfaceBy::RemoteA => Interface::RemoteA,
                InterfaceBy::RemoteB => Interface::RemoteB,
            },
            code: match self.code {
                CodeBy::Iso => Code::Iso,
                CodeBy::Eia => Code::Eia,
            },
            parity: match self.parity {
                ParityBy::Uart => Parity::Uart,
                ParityBy::Software => Parity::Software,
                ParityBy::None => Parity::None,
            },
            codes_with_parity: !self.plain_codes,
            codes_twice: self.codes_twice,
            characters: if self.ascii { CharacterSet::Printable } else { CharacterSet::Table },
            cr_ends_block: self.cr_ends_block,
            tv: self.tv.then_some(TvCheck { returns: true, comments: true }),
            buffer: self.buffer,
            reserve: self.reserve,
            resume: self.resume,
            tolerance: self.tolerance,
            block_time: Micros(self.block_time),
            feeding: match self.drip {
                Some(cycle_start) => Feeding::Drip { cycle_start, feed_holds: Vec::new() },
                None => Feeding::Memory,
            },
            repeat_dc1: self.repeat_dc1.map(Micros::from_millis),
            final_dc3: (!self.no_final_dc3).then_some(Micros::ZERO),
            tell_reset: self.tell_reset,
            punch: PunchOptions {
                dc2: !self.no_dc2,
                wait_dc1: self.wait_dc1.map(Micros::from_millis),
                leader: vec![0; usize::from(self.leader)],
                eob: match self.eob {
                    EobBy::Lf => Eob::Lf,
                    EobBy::CrLf => Eob::CrLf,
                    EobBy::LfCrCr => Eob::LfCrCr,
                    EobBy::LfCr => Eob::LfCr,
                    EobBy::Cr => Eob::Cr,
                },
                trailer: self.trailer,
                dc4: self.dc4,
                after_dc3: self.after_dc3,
                resume_on_dc2: self.resume_on_dc2,
                ..PunchOptions::default()
            },
            remote: RemoteOptions {
                period: Micros::from_millis(self.period),
                space: self.space,
                end_code: if self.etx { 0x03 } else { b'\r' },
                wrong_sums: self.wrong_sum,
                refusals: self.refuse,
                ..RemoteOptions::default()
            },
            request_program: self.request_program,
            latency: Micros(self.latency),
            // A pty brings characters in bursts, which no UART does.
            receive_fifo: 65_536,
            panel,
            ..Options::default()
        };
        options.check().map_err(Failure::usage)?;
        let mut run = self.common.run_options(sends)?;
        run.expect = run.expect.as_deref().map(text_of);
        Ok(FanucSimulation { options, last_press, run })
    }

    fn panel(&self) -> Result<Vec<(Micros, Press)>, Failure> {
        let read = Pressed { after: 0.5, what: What::Other(Press::Read) };
        let pressed = if self.press.is_empty() { vec![read] } else { self.press.clone() };
        let press = |pressed: Pressed| {
            let press = match pressed.what {
                What::Punch(path) => Press::Punch(punched(&files::read(&path)?)),
                What::Other(press) => press,
            };
            Ok((super::micros(pressed.after), press))
        };
        let panel: Result<Vec<_>, Failure> = pressed.into_iter().map(press).collect();
        let mut panel = panel?;
        panel.sort_by_key(|(at, _)| *at);
        Ok(panel)
    }
}

/// What a control keeps of a program: what follows the first block up to the
/// closing `%`, with LF, in upper case.
fn text_of(program: &[u8]) -> Vec<u8> {
    let mut text = punched(program);
    text.push(b'%');
    text.make_ascii_uppercase();
    text
}

/// What stands between the two `%` of a program, with LF.
fn punched(program: &[u8]) -> Vec<u8> {
    let lines: Vec<u8> = program.iter().copied().filter(|byte| *byte != b'\r').collect();
    let inside = match lines.iter().position(|byte| *byte == b'%') {
        // The text between the first % and its end of block means nothing.
        Some(at) => {
            let rest = &lines[at..];
            &rest[rest.iter().position(|byte| *byte == b'\n').map_or(rest.len(), |end| end + 1)..]
        }
        None => &lines[..],
    };
    let end = inside.iter().position(|byte| *byte == b'%').unwrap_or(inside.len());
    inside[..end].to_vec()
}

fn dc4(text: &str) -> Result<Dc4, String> {
    match text {
        "prompt" => Ok(Dc4::Prompt),
        "missing" => Ok(Dc4::Missing),
        _ => {
            let late = text.strip_prefix("late=").and_then(|nuls| nuls.parse().ok());
            late.map(Dc4::Late).ok_or_else(|| "give prompt, late=N or missing".to_owned())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_is_what_stands_between_its_marks() {
        let text = |program: &str| String::from_utf8(text_of(program.as_bytes())).unwrap();
        assert_eq!(text("%\r\nO1\r\nm30\r\n%\r\n"), "O1\nM30\n%");
        assert_eq!(text("junk%head\nO1\n%rest"), "O1\n%");
        assert_eq!(text("O1\nM30\n"), "O1\nM30\n%");
    }

    #[test]
    fn what_the_operator_does_is_read() {
        let press = |text: &str| text.parse::<Pressed>();
        assert!(matches!(press("1.5:reset").unwrap().what, What::Other(Press::Reset)));
        assert!(matches!(press("0:punch=O1.nc").unwrap().what, What::Punch(_)));
        for wrong in ["read", "1:dance", "1:punch=", "-1:read", "1:read=now"] {
            assert!(press(wrong).is_err(), "{wrong}");
        }
        assert_eq!(dc4("late=20"), Ok(Dc4::Late(20)));
        assert!(dc4("late").is_err());
    }
}
