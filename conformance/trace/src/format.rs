//! The canonical text of a trace.

use std::fmt::{self, Write as _};

use softplug_abi::{LineErrorKind, Parity};

use crate::annotation::annotation;
use crate::model::{
    Assignment, ByteClass, Drain, Entry, Exact, Expected, FrontMatter, Given, HostRequest, Item,
    Line, LineEvent, ModemLevels, Origin, Payload, Permutations, Room, Trace, UNDER_WAY, What,
};

/// Where the annotation begins, unless the line is longer.
const GLOSS_COLUMN: usize = 24;

impl Trace {
    /// The canonical text. Parsed again it gives an equal trace, as long as the
    /// trace came from [`Trace::parse`] or keeps the format's rules (names are
    /// names, times are sorted, blank lines single).
    pub fn format(&self) -> String {
        trace(self)
    }
}

/// The whole file.
fn trace(trace: &Trace) -> String {
    let mut text = front(&trace.front);
    text.push_str("---\n");
    for line in &trace.body {
        write_line(&mut text, "", line);
    }
    text
}

fn front(front: &FrontMatter) -> String {
    let mut text = String::new();
    let mut key = |key: &str, value: &str| {
        if !value.is_empty() {
            text.push_str(key);
            text.push_str(": ");
            text.push_str(value);
            text.push('\n');
        }
    };
    key("id", &front.id);
    key("title", &front.title);
    key("profile", &front.profile);
    key("clauses", &front.clauses.join(" "));
    key("level", front.level.name());
    key("edge", front.edge.map_or("", crate::Edge::name));
    for (name, value) in run_keys(front) {
        key(name, &value);
    }
    key("since", &front.since.to_string());
    key("origin", &origin(&front.origin));
    key("permute", &permute(front.permute));
    key("leaves", &front.leaves);
    key("bytes", &front.bytes.as_ref().map_or_else(String::new, byte_class));
    text
}

/// Of the parity in `8N1`.
fn letter(parity: Parity) -> char {
    match parity {
        Parity::None => 'N',
        Parity::Even => 'E',
        Parity::Odd => 'O',
        Parity::Mark => 'M',
        Parity::Space => 'S',
    }
}

/// The keys that say on what the case is run.
pub(crate) fn run_keys(front: &FrontMatter) -> [(&'static str, String); 4] {
    let line = &front.line;
    let stop = match line.stop_half_bits {
        3 => "1.5",
        4 => "2",
        _ => "1",
    };
    let (parity, depth, reaction) = (letter(line.parity), line.depth, line.reaction);
    let line =
        format!("{} {}{parity}{stop} depth={depth} reaction={reaction}", line.baud, line.data_bits);
    [
        ("line", line),
        ("config", assignments(&front.config)),
        ("room", room(&front.room)),
        ("modem", levels(&front.modem)),
    ]
}

fn origin(origin: &Origin) -> String {
    match origin {
        Origin::HandWritten => "hand-written".to_owned(),
        Origin::Recorded { device, date, tool } => format!("recorded({device}, {date}, {tool})"),
        Origin::Generated { generator, seed } => format!("generated({generator}, {seed})"),
    }
}

/// Empty for all, which is what the key's absence means.
fn permute(permute: Permutations) -> String {
    if permute == Permutations::ALL {
        return String::new();
    }
    let named = permute.named();
    let chosen: Vec<&str> = named.iter().filter(|(_, on)| *on).map(|(name, _)| *name).collect();
    if chosen.is_empty() { "none".to_owned() } else { chosen.join(" ") }
}

fn byte_class(class: &ByteClass) -> String {
    let mut text = format!("{:02X} =", class.written);
    for (first, last) in class.ranges() {
        let _ = write!(text, " {first:02X}");
        if first != last {
            let _ = write!(text, "-{last:02X}");
        }
    }
    text
}

fn write_line(text: &mut String, indent: &str, line: &Line) {
    match line {
        Line::Blank => text.push('\n'),
        Line::Comment(comment) => {
            let _ = writeln!(text, "{indent}#{comment}");
        }
        Line::Entry(entry) => {
            let written = format!("{indent}{}", self::entry(entry));
            let _ = writeln!(text, "{}", with_annotation(&written, entry));
        }
        Line::Alternatives(block) => {
            let _ = writeln!(text, "{{ alt {}", block.clause);
            for (place, branch) in block.branches.iter().enumerate() {
                if place > 0 {
                    text.push_str("|\n");
                }
                for line in branch {
                    write_line(text, "  ", line);
                }
            }
            text.push_str("}\n");
        }
    }
}

fn with_annotation(written: &str, entry: &Entry) -> String {
    match entry.what.payload().and_then(annotation) {
        Some(annotation) => format!("{written:<GLOSS_COLUMN$}  ; {annotation}"),
        None => written.to_owned(),
    }
}

impl fmt::Display for Entry {
    /// The line of a trace, with its annotation.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&with_annotation(&self::entry(self), self))
    }
}

/// The longest that an entry's line can be: indented, with an annotation.
pub(crate) fn line_bytes(entry: &Entry) -> usize {
    const INDENT_AND_GLOSS: usize = 256;
    self::entry(entry).len() + INDENT_AND_GLOSS
}

/// An entry without its annotation.
fn entry(entry: &Entry) -> String {
    let mut text = format!("{} {}", entry.what.sign(), entry.when);
    let mut part = |part: &str| {
        if !part.is_empty() {
            text.push(' ');
            text.push_str(part);
        }
    };
    match &entry.what {
        What::Given(given) => match given {
            Given::Receive(bytes) | Given::Burst(bytes) => part(&payload(bytes)),
            Given::Line(event) => part(&line_event(event)),
            Given::Host(request) => part(&host(request)),
            Given::Exact(Exact::UnderWay(facts)) => {
                part(UNDER_WAY);
                part(&assignments(facts));
            }
            Given::Exact(Exact::Event { name, payload: bytes }) => {
                part(name);
                part(&payload(bytes));
            }
        },
        What::Expected(expected) => part(&self::expected(expected)),
        What::Quiet => {}
    }
    text
}

fn line_event(event: &LineEvent) -> String {
    match event {
        LineEvent::Modem(changed) => levels(changed),
        LineEvent::Error {
            kind: kind @ (LineErrorKind::Break | LineErrorKind::Overrun),
            byte: None,
            span: 0,
        } => kind.name().to_owned(),
        LineEvent::Error { kind, byte, span } => {
            let byte = byte.map_or(String::new(), |byte| format!(" byte={byte:02X}"));
            format!("lineerror {}{byte} span={span}", kind.name())
        }
        LineEvent::Down(reason) => format!("down {}", reason.name()),
        LineEvent::Up => "up".to_owned(),
    }
}

fn host(request: &HostRequest) -> String {
    match request {
        HostRequest::Job { id, kind, fields, data } => {
            if kind == "send" && fields.is_empty() && !data.is_absent() {
                return format!("send {id} {}", payload(data));
            }
            spaced(&[&format!("job {id} {kind}"), &assignments(fields), &payload(data)])
        }
        HostRequest::Pause(id) => format!("pause {id}"),
        HostRequest::Resume(id) => format!("resume {id}"),
        HostRequest::Abort(id) => format!("abort {id}"),
        HostRequest::ForceResume => "force-resume".to_owned(),
        HostRequest::Room(grown) => spaced(&["room", &room(grown)]),
        HostRequest::Drain(Drain::Auto) => "drain auto".to_owned(),
        HostRequest::Drain(Drain::Off) => "drain off".to_owned(),
        HostRequest::Grant { id, data } => {
            spaced(&[&format!("answer {id} granted"), &payload(data)])
        }
        HostRequest::Refuse { id, failure } => format!("answer {id} refused {failure}"),
        HostRequest::Swap => "swap".to_owned(),
        HostRequest::Close => "close".to_owned(),
        HostRequest::Open => "open".to_owned(),
    }
}

fn expected(expected: &Expected) -> String {
    let option = |name: &str, number: Option<u64>| {
        number.map_or(String::new(), |number| format!("{name}={number}"))
    };
    let place = |name: &str, number: u32| option(name, (number != 0).then_some(number.into()));
    let status = |status: &u16| match status {
        0 => String::new(),
        _ => format!("status={status:04X}"),
    };
    match expected {
        Expected::Send(bytes) => payload(bytes),
        Expected::SetLines(set) => levels(set),
        Expected::SendBreak(micros) => format!("break {micros}"),
        Expected::Deliver { id, data, failure, status: own, name } => {
            let end = failure.map_or("complete".to_owned(), |failure| format!("failed {failure}"));
            let name = name
                .as_ref()
                .map_or(String::new(), |name| format!("name={}", quote(name.as_bytes())));
            spaced(&[&format!("deliver {id}"), &payload(data), &end, &status(own), &name])
        }
        Expected::Done { id, sent } => spaced(&[&format!("done {id}"), &option("sent", *sent)]),
        Expected::Fail { id, failure, status: own, sent } => {
            spaced(&[&format!("fail {id} {failure}"), &status(own), &option("sent", *sent)])
        }
        Expected::Check { id, failure: None, .. } => format!("check {id} good"),
        Expected::Check { id, failure: Some(failure), status: own, line, column } => spaced(&[
            &format!("check {id} {failure}"),
            &place("line", *line),
            &place("column", *column),
            &status(own),
        ]),
        Expected::Request { id, kind, fields } => {
            spaced(&[&format!("request {id} {kind}"), &assignments(fields)])
        }
        Expected::Withdraw(id) => format!("withdraw {id}"),
    }
}

fn spaced(parts: &[&str]) -> String {
    parts.iter().filter(|part| !part.is_empty()).copied().collect::<Vec<_>>().join(" ")
}

fn room(room: &Room) -> String {
    let side = |name: &str, bytes: Option<u32>| {
        bytes.map_or(String::new(), |bytes| format!("{name}={bytes}"))
    };
    spaced(&[&side("transmit", room.transmit), &side("delivery", room.delivery)])
}

fn levels(levels: &ModemLevels) -> String {
    let word = |(line, on): (&crate::ModemLine, &bool)| {
        format!("{}{}", line.name(), if *on { '+' } else { '-' })
    };
    levels.0.iter().map(word).collect::<Vec<_>>().join(" ")
}

/// `name=value` pairs, quoted where they have to be.
pub(crate) fn assignments(assignments: &[Assignment]) -> String {
    let bare = |c: char| c.is_ascii_graphic() && !matches!(c, '"' | ';' | '\\');
    let written = |assignment: &Assignment| {
        let value = &assignment.value;
        if !value.is_empty() && value.chars().all(bare) {
            format!("{}={value}", assignment.name)
        } else {
            format!("{}={}", assignment.name, quote(value.as_bytes()))
        }
    };
    assignments.iter().map(written).collect::<Vec<_>>().join(" ")
}

/// A payload's items with single spaces between them.
fn payload(payload: &Payload) -> String {
    let mut text = String::new();
    for item in payload.items() {
        if !text.is_empty() {
            text.push(' ');
        }
        let _ = match item {
            Item::Hex(bytes) => bytes.iter().enumerate().try_for_each(|(place, byte)| {
                let space = if place > 0 { " " } else { "" };
                write!(text, "{space}{byte:02X}")
            }),
            Item::Text(bytes) => write!(text, "{}", quote(bytes)),
            Item::Bad { kind, byte } => write!(text, "~{}{byte:02X}", kind.letter()),
            Item::File(digest) => write!(text, "file:{digest}"),
            Item::Generated(generator) => write!(text, "{generator}"),
        };
    }
    text
}

/// Text in quotes. Letters and digits of any script stand as they are, all else
/// beyond ASCII as `\xNN`: a reviewer sees every byte.
fn quote(bytes: &[u8]) -> String {
    let mut text = String::from("\"");
    for chunk in bytes.utf8_chunks() {
        for c in chunk.valid().chars() {
            match c {
                '\n' => text.push_str("\\n"),
                '\r' => text.push_str("\\r"),
                '\t' => text.push_str("\\t"),
                '"' => text.push_str("\\\""),
                '\\' => text.push_str("\\\\"),
                ' '..='~' => text.push(c),
                c if c.is_alphanumeric() && !c.is_ascii() => text.push(c),
                c => escape(&mut text, c.encode_utf8(&mut [0; 4]).as_bytes()),
            }
        }
        escape(&mut text, chunk.invalid());
    }
    text.push('"');
    text
}

fn escape(text: &mut String, bytes: &[u8]) {
    for byte in bytes {
        let _ = write!(text, "\\x{byte:02X}");
    }
}
