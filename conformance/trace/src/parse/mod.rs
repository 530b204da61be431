//! From text to a trace: the file as a whole, line by line.

mod entry;
mod front;
mod lex;
mod payload;

use crate::error::{ParseError, ParseErrorKind};
use crate::hidden::forbidden;
use crate::limits;
use crate::model::{Alternatives, Entry, FrontMatter, Item, Line, Time, Trace, tidy_blank_lines};
use front::{Front, Incomplete};
use lex::{Fault, skip_space, slug};

impl Trace {
    /// Reads a trace.
    ///
    /// # Errors
    /// The first fault, with its line and column.
    pub fn parse(text: &str) -> Result<Self, ParseError> {
        trace(text)
    }
}

impl FrontMatter {
    /// Reads front matter that stands alone, with or without the line `---` that
    /// ends it. What follows that line is not looked at.
    ///
    /// # Errors
    /// The first fault, with its line and column.
    pub fn parse(text: &str) -> Result<Self, ParseError> {
        front_matter_alone(text)
    }
}

/// Parses a whole file.
fn trace(text: &str) -> Result<Trace, ParseError> {
    if text.len() > limits::FILE_BYTES {
        return Err(Source { number: 1, text: "" }.error("", ParseErrorKind::FileTooLong));
    }
    let mut lines = Lines { lines: text.lines(), number: 0 };
    let front = front_matter(&mut lines)?;
    let mut body = Body::default();
    let mut last = Source { number: lines.number.max(1), text: "" };
    while let Some(line) = lines.next()? {
        body.read(line)?;
        last = line;
    }
    let trace = Trace { front, body: body.finish(last)? };
    // The canonical form may be longer, and must be readable too. It never is
    // more than eight times as long.
    if text.len() > limits::FILE_BYTES / 8 && trace.format().len() > limits::FILE_BYTES {
        return Err(Source { number: 1, text: "" }.error("", ParseErrorKind::FileTooLong));
    }
    Ok(trace)
}

/// One line of the file, without the spaces at its end.
#[derive(Copy, Clone)]
struct Source<'a> {
    number: u32,
    text: &'a str,
}

impl Source<'_> {
    /// The fault `kind` where `rest` is what is left of the line.
    fn error(&self, rest: &str, kind: ParseErrorKind) -> ParseError {
        self.fault(Fault { rest: rest.len(), kind })
    }

    /// The line is too long, as it stands or in its canonical form.
    fn too_long(&self) -> ParseError {
        let mut error = self.error(self.text, ParseErrorKind::LineTooLong);
        // The whole line would make the error as long as it is.
        error.source_line = self.text.chars().take(80).collect();
        error
    }

    fn fault(&self, fault: Fault) -> ParseError {
        let before =
            self.text.get(..self.text.len().saturating_sub(fault.rest)).unwrap_or_default();
        ParseError {
            line: self.number,
            column: before.chars().count() as u32 + 1,
            kind: fault.kind,
            source_line: self.text.to_owned(),
        }
    }
}

/// The lines, each checked for its length and its characters.
struct Lines<'a> {
    lines: std::str::Lines<'a>,
    number: u32,
}

impl<'a> Lines<'a> {
    fn next(&mut self) -> Result<Option<Source<'a>>, ParseError> {
        let Some(line) = self.lines.next() else { return Ok(None) };
        self.number += 1;
        let source = Source { number: self.number, text: line.trim_end_matches([' ', '\t']) };
        if self.number as usize > limits::LINES {
            return Err(source.error(source.text, ParseErrorKind::TooManyLines));
        }
        if line.len() > limits::LINE_BYTES {
            return Err(source.too_long());
        }
        match source.text.char_indices().find(|(_, c)| forbidden(*c)) {
            Some((at, c)) => {
                Err(source.error(&source.text[at..], ParseErrorKind::ForbiddenCharacter(c)))
            }
            None => Ok(Some(source)),
        }
    }
}

/// Parses front matter without a body.
fn front_matter_alone(text: &str) -> Result<FrontMatter, ParseError> {
    if text.len() > limits::FILE_BYTES {
        return Err(Source { number: 1, text: "" }.error("", ParseErrorKind::FileTooLong));
    }
    front_matter(&mut Lines { lines: text.lines(), number: 0 })
}

fn front_matter(lines: &mut Lines<'_>) -> Result<FrontMatter, ParseError> {
    let mut front = Front::default();
    let end = loop {
        match lines.next()? {
            Some(line) if line.text.is_empty() || line.text == "---" => break line,
            Some(line) => front.read(line.text, line.number).map_err(|fault| line.fault(fault))?,
            None => break Source { number: lines.number + 1, text: "" },
        }
    };
    front.finish().map_err(|incomplete| match incomplete {
        Incomplete::Missing(key) => end.error(end.text, ParseErrorKind::MissingKey(key)),
        Incomplete::ForeignId { line, source, rest, profile } => {
            Source { number: line, text: &source }
                .fault(Fault { rest, kind: ParseErrorKind::ForeignId { profile } })
        }
    })
}

/// The body as far as it was read.
struct Body<'a> {
    lines: Vec<Line>,
    last: Time,
    block: Option<Block<'a>>,
    variants: usize,
    generated: u64,
}

/// A block of alternatives that is not closed yet.
struct Block<'a> {
    opened: Source<'a>,
    clause: String,
    branches: Vec<Vec<Line>>,
    current: Vec<Line>,
    /// The last time in the current branch.
    last: Time,
}

impl Default for Body<'_> {
    fn default() -> Self {
        Self { lines: Vec::new(), last: Time::default(), block: None, variants: 1, generated: 0 }
    }
}

impl<'a> Body<'a> {
    fn read(&mut self, source: Source<'a>) -> Result<(), ParseError> {
        let text = skip_space(source.text);
        if text.is_empty() {
            self.push(Line::Blank);
            return Ok(());
        }
        if let Some(comment) = text.strip_prefix('#') {
            if comment.len() + 3 > limits::LINE_BYTES {
                return Err(source.too_long());
            }
            self.push(Line::Comment(comment.to_owned()));
            return Ok(());
        }
        match text.as_bytes()[0] {
            b'{' => self.open(source, text),
            sign @ (b'|' | b'}') => {
                let rest = skip_space(&text[1..]);
                if !lex::at_end(rest) {
                    return Err(
                        source.error(rest, ParseErrorKind::Expected("nothing more on this line"))
                    );
                }
                let Some(block) = self.block.take() else {
                    return Err(
                        source.error(text, ParseErrorKind::OutsideAlternatives(char::from(sign)))
                    );
                };
                if sign == b'}' {
                    return self.close(block);
                }
                self.next_branch(block);
                Ok(())
            }
            _ => self.entry(source, text),
        }
    }

    fn push(&mut self, line: Line) {
        match &mut self.block {
            Some(block) => block.current.push(line),
            None => self.lines.push(line),
        }
    }

    fn open(&mut self, source: Source<'a>, text: &'a str) -> Result<(), ParseError> {
        if self.block.is_some() {
            return Err(source.error(text, ParseErrorKind::NestedAlternatives));
        }
        let alt_at = skip_space(&text[1..]);
        let Some(clause_at) =
            alt_at.strip_prefix("alt").filter(|rest| rest.starts_with([' ', '\t']))
        else {
            return Err(source.error(alt_at, ParseErrorKind::Expected("`{ alt CLAUSE`")));
        };
        let parsed = slug("the clause that leaves the choice", skip_space(clause_at)).and_then(
            |(rest, clause)| {
                lex::end(rest, "nothing more on this line").map(|(rest, ())| (rest, clause))
            },
        );
        let (_, clause) = finished(source, parsed)?;
        self.block = Some(Block {
            opened: source,
            clause: clause.to_owned(),
            branches: Vec::new(),
            current: Vec::new(),
            last: self.last,
        });
        Ok(())
    }

    fn next_branch(&mut self, mut block: Block<'a>) {
        tidy_blank_lines(&mut block.current);
        block.branches.push(std::mem::take(&mut block.current));
        block.last = self.last;
        self.block = Some(block);
    }

    fn close(&mut self, mut block: Block<'a>) -> Result<(), ParseError> {
        tidy_blank_lines(&mut block.current);
        block.branches.push(block.current);
        if block.branches.len() < 2 {
            return Err(block.opened.error(block.opened.text, ParseErrorKind::OneAlternative));
        }
        self.variants = self.variants.saturating_mul(block.branches.len());
        if self.variants > limits::VARIANTS {
            return Err(block.opened.error(block.opened.text, ParseErrorKind::TooManyVariants));
        }
        let line =
            Line::Alternatives(Alternatives { clause: block.clause, branches: block.branches });
        self.last = line.start().unwrap_or(self.last);
        self.lines.push(line);
        Ok(())
    }

    fn entry(&mut self, source: Source<'a>, text: &'a str) -> Result<(), ParseError> {
        let floor = self.block.as_ref().map_or(self.last, |block| block.last);
        let (_, entry) = finished(source, entry::entry(text, floor, source.number))?;
        if self.block.is_some() && entry.what.is_input() {
            return Err(source.error(text, ParseErrorKind::InputInAlternatives));
        }
        // Only a long line can grow over the limit by its escapes and its annotation.
        if source.text.len() > limits::LINE_BYTES / 8
            && crate::format::line_bytes(&entry) > limits::LINE_BYTES
        {
            return Err(source.too_long());
        }
        self.generated = self.generated.saturating_add(generated(&entry));
        if self.generated > limits::GENERATED_BYTES {
            return Err(source.error(text, ParseErrorKind::TooMuchGenerated));
        }
        match &mut self.block {
            Some(block) => block.last = entry.when.from,
            None => self.last = entry.when.from,
        }
        self.push(Line::Entry(entry));
        Ok(())
    }

    fn finish(mut self, last: Source<'a>) -> Result<Vec<Line>, ParseError> {
        if let Some(block) = self.block {
            return Err(block.opened.error(block.opened.text, ParseErrorKind::OpenAlternatives));
        }
        if !self.lines.iter().any(|line| line.entry().is_some()) {
            let end = Source { number: last.number + 1, text: "" };
            return Err(end
                .error("", ParseErrorKind::Expected("at least one event below the front matter")));
        }
        tidy_blank_lines(&mut self.lines);
        Ok(self.lines)
    }
}

fn finished<'a, T>(
    source: Source<'_>,
    parsed: lex::Parsed<'a, T>,
) -> Result<(&'a str, T), ParseError> {
    parsed.map_err(|error| match error {
        nom::Err::Failure(fault) | nom::Err::Error(fault) => source.fault(fault),
        nom::Err::Incomplete(_) => unreachable!("complete parsers never ask for more"),
    })
}

fn generated(entry: &Entry) -> u64 {
    let items = entry.what.payload().map_or(&[][..], crate::Payload::items);
    items.iter().fold(0, |sum, item| match item {
        Item::Generated(generator) => sum.saturating_add(generator.length),
        _ => sum,
    })
}
