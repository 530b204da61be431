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
    let preamble = restart.preamble(rules)?;
    let program = Program::split(rules, &read(rules, data));
    let found = restart.find(&program);
    // Faults come in the order of the file; what is skipped is not checked.
    let blocks = program.blocks.iter().enumerate();
    let kept = blocks.filter(|(place, _)| found.keeps(*place)).map(|(_, block)| block);
    for line in program.header.iter().chain(kept.clone()) {
        if let Some(place) = line.fault() {
            let clause = line.clause();
            return Err(Refused::at(Failure::UnsupportedCharacter, 0, place, clause));
        }
    }
    check_behind(rules, &program)?;
    found.check()?;

    let numbered = numbers::rewrite(rules, kept.cloned().collect());
    let (before, from) = numbered.split_at(found.kept_before().min(numbered.len()));
    let mut writer = Writer::new(rules);
    writer.begin(program.header.as_ref());
    before.iter().for_each(|line| writer.block(line));
    preamble.iter().for_each(|line| writer.block(line));
    from.iter().for_each(|line| writer.block(line));
    Ok(writer.end(program.is_closed))
}

/// Text behind the closing `%` would not arrive.
fn check_behind(rules: &TapeRules, program: &Program) -> Result<(), Refused> {
    let Some(place) = program.text_behind else { return Ok(()) };
    let (status, is_dropped) = if program.is_opened() { (4, rules.drops_behind) } else { (3, false) };
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

impl Line {
    /// The clause that says what its fault is.
    fn clause(&self) -> &'static str {
        if self.is_fault_in_comment() {
            "fanuc-rs232.tape.percent-in-comment"
        } else {
            "fanuc-rs232.tape.unsupported"
        }
    }
}
