//! What a program becomes: the encoded program that packets carry.

mod characters;
mod lines;
mod numbers;
mod restart;
mod rules;
mod tv;

pub(super) use rules::{Refused, TapeRules};

use characters::{Place, read};
use lines::{Line, Program};
use restart::Restart;
use softplug_abi::Failure;
use tv::Writer;

/// The encoded program.
///
/// # Errors
/// Why the job is refused.
pub(super) fn encode(
    rules: &TapeRules,
    data: &[u8],
    fields: &[(String, String)],
) -> Result<Vec<u8>, Refused> {
    let restart = Restart::new(fields)?;
    let program = Program::split(rules, &read(rules, data));
    let found = restart.find(&program);
    // Faults come in the order of the tape; what is skipped is not checked.
    let blocks = program.blocks.iter().enumerate();
    let sent = blocks.filter(|(place, _)| found.keeps(*place)).map(|(_, block)| block);
    let sent: Vec<Line> = sent.cloned().collect();
    let (before, from) = sent.split_at(found.kept_before().min(sent.len()));
    program.header.iter().chain(before).try_for_each(check_line)?;
    let preamble = restart.preamble(rules);
    let preamble = if found.has_others() { preamble? } else { Vec::new() };
    from.iter().try_for_each(check_line)?;
    check_behind(rules, &program)?;
    found.check()?;

    let mut before = before.to_vec();
    if !preamble.is_empty()
        && let Some(last) = before.last_mut()
    {
        // Also where nothing else follows it.
        last.has_eob = true;
    }
    let lines = before.into_iter().chain(preamble).chain(from.iter().cloned());
    let mut writer = Writer::new(rules);
    writer.begin(program.header.as_ref());
    for line in numbers::rewrite(rules, lines.collect()) {
        writer.block(&line);
    }
    Ok(writer.end(program.is_closed))
}

/// A line that is sent.
fn check_line(line: &Line) -> Result<(), Refused> {
    let Some((place, is_percent)) = line.fault() else { return Ok(()) };
    let clause = if is_percent {
        "fanuc-rs232.tape.percent-in-comment"
    } else {
        "fanuc-rs232.tape.unsupported"
    };
    Err(Refused::at(Failure::UnsupportedCharacter, 0, place, clause))
}

/// Text behind the closing `%` would not arrive.
fn check_behind(rules: &TapeRules, program: &Program) -> Result<(), Refused> {
    let Some(place) = program.text_behind else { return Ok(()) };
    let (status, is_dropped) =
        if program.is_opened() { (4, rules.drops_behind) } else { (3, false) };
    if is_dropped {
        return Ok(());
    }
    Err(Refused::at(Failure::BadJob, status, place, "fanuc-rs232.tape.after-end"))
}

impl Refused {
    fn at(failure: Failure, status: u16, place: Place, clause: &'static str) -> Self {
        let Place { line, column } = place;
        Self { failure: Some(failure), status, line, column, clause }
    }

    fn without_place(failure: Failure, status: u16, clause: &'static str) -> Self {
        Self { failure: Some(failure), status, line: 0, column: 0, clause }
    }
}
