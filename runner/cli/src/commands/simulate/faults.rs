//! Faults of a simulated 3964R station as they are written on the command line.

use softplug_abi::Micros;
use softplug_machines::r3964::{Fault, When};

/// The faults with their values, for the help.
pub(super) const HELP: &str = "\
Faults, each with its value and what the station does:
  no-answer                 does not answer an STX
  late-answer=MS            answers it so much later
  nak-answer                answers it by NAK
  other-answer=HEX          answers it by this character
  conflict                  answers it by an STX of its own
  no-buffer                 has no buffer: NAK after the wait for one
  silence=MS                neither hears nor says anything for so long
  no-acknowledgement        takes a good block and does not acknowledge it
  late-acknowledgement=MS   acknowledges it so much later
  nak-acknowledgement       refuses it as if its check were wrong
  other-acknowledgement=HEX drops it and answers by this character
  nak-in-block=N            NAK after N characters of a block
  other-in-block=N,HEX      another character after N of its characters
  late-start=MS             its own STX goes out so much later
  wrong-check               its own block has a wrong check character
  lone-dle=N                a DLE before neither DLE nor ETX, after N characters
  gap=N,MS                  a gap of so long after N characters of its block
  cut=N                     its block stops after N characters
  garbage=HEX               stray characters on the idle line
Without @ the fault happens the first time; @3 the third time, @always each time,
@20/1000 so often in a thousand, by chance.";

/// `NAME[=VALUE[,VALUE]][@WHEN]`.
pub(super) fn parse(text: &str) -> Result<(When, Fault), String> {
    let (fault, when) = text.rsplit_once('@').unwrap_or((text, "1"));
    Ok((when_of(when)?, fault_of(fault)?))
}

fn when_of(text: &str) -> Result<When, String> {
    if text == "always" {
        return Ok(When::Always);
    }
    let when = match text.strip_suffix("/1000") {
        Some(chance) => {
            chance.parse().ok().filter(|chance| (1..=1_000).contains(chance)).map(When::PerMille)
        }
        None => text.parse().ok().filter(|nth| *nth > 0).map(When::Nth),
    };
    when.ok_or_else(|| format!("\"{text}\" is no time: give 3, always or 20/1000"))
}

fn fault_of(text: &str) -> Result<Fault, String> {
    let (name, value) = match text.split_once('=') {
        Some((name, value)) => (name, Some(value)),
        None => (text, None),
    };
    let number = || value.and_then(|value| value.parse().ok()).ok_or("a number");
    let span = || {
        let millis = value.and_then(|value| value.parse().ok()).filter(|millis| *millis >= 0);
        millis.map(Micros::from_millis).ok_or("milliseconds")
    };
    let byte = || {
        let hex = value.filter(|hex| hex.len() == 2);
        hex.and_then(|hex| u8::from_str_radix(hex, 16).ok()).ok_or("a character in hex")
    };
    let pair = || value.and_then(|value| value.split_once(','));
    let fault = match name {
        "no-answer" => plain(value, Fault::NoAnswer),
        "late-answer" => span().map(Fault::LateAnswer),
        "nak-answer" => plain(value, Fault::NakAnswer),
        "other-answer" => byte().map(Fault::OtherAnswer),
        "conflict" => plain(value, Fault::Conflict),
        "no-buffer" => plain(value, Fault::NoBuffer),
        "silence" => span().map(Fault::Silence),
        "no-acknowledgement" => plain(value, Fault::NoAcknowledgement),
        "late-acknowledgement" => span().map(Fault::LateAcknowledgement),
        "nak-acknowledgement" => plain(value, Fault::NakAcknowledgement),
        "other-acknowledgement" => byte().map(Fault::OtherAcknowledgement),
        "nak-in-block" => number().map(Fault::NakInBlock),
        "other-in-block" => {
            let parsed = pair().and_then(|(after, hex)| {
                Some((after.parse().ok()?, u8::from_str_radix(hex, 16).ok()?))
            });
            parsed
                .map(|(after, byte)| Fault::OtherInBlock(after, byte))
                .ok_or("a number and a character in hex, such as 5,31")
        }
        "late-start" => span().map(Fault::LateStart),
        "wrong-check" => plain(value, Fault::WrongCheck),
        "lone-dle" => number().map(Fault::LoneDle),
        "gap" => {
            let parsed = pair().and_then(|(after, millis)| {
                let millis = millis.parse().ok().filter(|millis| *millis >= 0)?;
                Some(Fault::Gap(after.parse().ok()?, Micros::from_millis(millis)))
            });
            parsed.ok_or("a number and milliseconds, such as 5,300")
        }
        "cut" => number().map(Fault::Cut),
        "garbage" => value.and_then(bytes).map(Fault::Garbage).ok_or("characters in hex"),
        _ => return Err(format!("there is no fault \"{name}\"; the help lists them")),
    };
    fault.map_err(|needs| format!("the fault \"{name}\" takes {needs}"))
}

fn plain(value: Option<&str>, fault: Fault) -> Result<Fault, &'static str> {
    if value.is_none() { Ok(fault) } else { Err("no value") }
}

fn bytes(hex: &str) -> Option<Vec<u8>> {
    let (pairs, rest) = hex.as_bytes().as_chunks::<2>();
    let pair = |pair: &[u8; 2]| {
        let digit = |byte: u8| char::from(byte).to_digit(16);
        Some((digit(pair[0])? << 4 | digit(pair[1])?) as u8)
    };
    let bytes: Option<Vec<u8>> = pairs.iter().map(pair).collect();
    bytes.filter(|bytes| rest.is_empty() && !bytes.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_of_the_help_is_understood() {
        let lines = HELP.lines().filter(|line| line.starts_with("  "));
        let mut count = 0;
        for line in lines {
            let word = line.split_whitespace().next().unwrap();
            let example = word.replace("N,MS", "5,300").replace("N,HEX", "5,31");
            let example = example.replace("=MS", "=300").replace("=HEX", "=31").replace("=N", "=5");
            assert!(parse(&example).is_ok(), "{example}: {:?}", parse(&example));
            count += 1;
        }
        assert_eq!(count, 19);
    }

    #[test]
    fn times_and_values_are_read() {
        assert_eq!(parse("wrong-check"), Ok((When::Nth(1), Fault::WrongCheck)));
        assert_eq!(parse("cut=5@always"), Ok((When::Always, Fault::Cut(5))));
        assert_eq!(parse("garbage=3115@20/1000"), {
            Ok((When::PerMille(20), Fault::Garbage(vec![0x31, 0x15])))
        });
        let gap = Fault::Gap(2, Micros::from_millis(300));
        assert_eq!(parse("gap=2,300@3"), Ok((When::Nth(3), gap)));
        for (text, part) in [
            ("nonsense", "no fault \"nonsense\""),
            ("cut", "takes a number"),
            ("no-answer=3", "takes no value"),
            ("late-answer=-3", "takes milliseconds"),
            ("other-answer=1", "a character in hex"),
            ("cut=5@0", "is no time"),
            ("cut=5@1001/1000", "is no time"),
            ("garbage=1", "characters in hex"),
        ] {
            assert!(parse(text).unwrap_err().contains(part), "{text}");
        }
    }
}
