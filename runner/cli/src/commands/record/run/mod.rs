//! `softplug record` between two ports.

mod completion;
mod redact;
mod rehearsal;
mod story;
mod trace_writer;

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{SystemTime, UNIX_EPOCH};

use softplug_abi::{LineParameters, Micros};
use softplug_live::port::line_text;
use softplug_live::tap::{Event, Side, Tap, Turn};
use softplug_live::{Input, Port, PortOptions, PortSpec};
use softplug_trace::{
    Assignment, Entry, Expected, FrontMatter, Given, HostRequest, Item, Level, Line, LineSettings,
    Origin, Payload, Permutations, SourceLine, Time, What, When,
};

use self::completion::Completion;
use self::redact::{Redactor, Way};
use self::rehearsal::Rehearsal;
use self::story::{Character, Happening, Story};
use self::trace_writer::TraceWriter;
use crate::commands::record::{Arguments, Document, Prepared, SideName};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::numbers;
use crate::screen::Screen;
use crate::stop;

/// How often a stop is looked for and the disk gets what waits.
const TICK: Micros = Micros::from_millis(50);

pub(crate) fn record(
    arguments: &Arguments,
    prepared: Option<Prepared>,
    requests: Vec<HostRequest>,
    screen: &Screen,
) -> Result<Exit, Failure> {
    let stop = stop::on_signals()?;
    let profile = profile(arguments, prepared.as_ref());
    // Compiled before the ports are touched.
    let instance = prepared.as_ref().map(|prepared| prepared.plugin.instantiate()).transpose()?;
    let line = arguments.line(prepared.as_ref());
    let a = open(Side::A, &arguments.a, line, screen)?;
    let b = open(Side::B, &arguments.b, line, screen)?;
    let tap = Tap::new(a, b)?;
    let side = match arguments.side {
        SideName::A => Side::A,
        SideName::B => Side::B,
    };
    let lines = tap.modem_lines(side.other());
    let completion =
        Completion { plugin: prepared.as_ref().map(|prepared| prepared.plugin.clone()), requests };
    // A rehearsal has no jobs: of a plug-in that was asked for something it knows nothing.
    let rehearsed = prepared.zip(instance).filter(|_| completion.requests.is_empty());
    let rehearsal = rehearsed.map(|(prepared, instance)| {
        let name = &prepared.plugin.manifest().name;
        Rehearsal::new(name, instance, prepared.settings, line, lines, !arguments.redact)
    });
    let mut front = front(arguments, &profile, side, line);
    if let Some((_, on)) = lines {
        front.modem = story::inputs(on);
    }
    let mut story = Story::new(side, tap.port(side).line(), tap.port(side).rate_known());
    for from in [Side::A, Side::B] {
        if let Some((_, on)) = tap.modem_lines(from) {
            story.lines_at_start(from, on);
        }
    }
    let writer = TraceWriter::create(&arguments.out, arguments.force, front)?;
    writer.say_left(screen);
    let recording = Recording {
        story,
        writer,
        is_line_asked: arguments.line.is_some(),
        redactor: arguments.redact.then(|| Redactor::new(&profile)),
        rehearsal,
        side,
        has_begun: false,
        origin: None,
        last: Time::default(),
        passed: [0; 2],
        line_errors: 0,
    };
    run(tap, recording, arguments, &completion, &stop, screen)
}

/// Why a recording ended.
enum End {
    Stopped,
    Duration,
    Idle,
    Lost(Side, String),
}

impl End {
    fn name(&self) -> &'static str {
        match self {
            Self::Stopped => "stopped",
            Self::Duration => "duration",
            Self::Idle => "idle",
            Self::Lost(..) => "port-lost",
        }
    }
}

fn run(
    mut tap: Tap,
    mut recording: Recording,
    arguments: &Arguments,
    completion: &Completion,
    stop: &AtomicBool,
    screen: &Screen,
) -> Result<Exit, Failure> {
    let seconds = |seconds: Option<u32>| seconds.map(|count| Micros::from_secs(i64::from(count)));
    let (duration, idle) = (seconds(arguments.duration), seconds(arguments.idle));
    let begin = tap.now();
    let mut moved_at = None;
    recording.begin()?;
    let mut pump = || -> Result<End, Failure> {
        loop {
            let now = tap.now();
            if stop.load(Ordering::Relaxed) {
                return Ok(End::Stopped);
            }
            if duration.is_some_and(|duration| now - begin >= duration) {
                return Ok(End::Duration);
            }
            let quiet = idle.zip(moved_at);
            if quiet.is_some_and(|(idle, at)| now - at >= idle) {
                return Ok(End::Idle);
            }
            let turn = tap.turn(now + TICK, &mut |at, event| {
                if matches!(event, Event::Heard { .. } | Event::Passed { .. }) {
                    moved_at = Some(at);
                }
                recording.tell(at, &event, screen);
            })?;
            if recording.is_at_start() {
                recording.begin_line(&tap, screen);
            }
            recording.write(tap.now())?;
            if let Turn::Gone(side, reason) = turn {
                return Ok(End::Lost(side, reason.text().to_owned()));
            }
        }
    };
    let end = pump();
    let held = tap.finish(&mut |at, event| recording.tell(at, &event, screen));
    match (end, held) {
        (Ok(end), Ok(held)) => {
            let now = tap.now();
            // What follows takes its time: the ports are not kept for it.
            drop(tap);
            let span = (begin, now);
            report(&end, held, span, recording, completion, screen)
        }
        (Err(failure), _) => Err(kept(recording, tap.now(), failure)),
        (Ok(_), Err(error)) => Err(kept(recording, tap.now(), error.into())),
    }
}

/// Of a recording that cannot go on everything stays that was seen.
fn kept(recording: Recording, now: Micros, failure: Failure) -> Failure {
    match recording.finish(now) {
        Ok(_) => failure,
        Err(second) => failure.hint(second.message),
    }
}

fn report(
    end: &End,
    held: [usize; 2],
    (begin, now): (Micros, Micros),
    recording: Recording,
    completion: &Completion,
    screen: &Screen,
) -> Result<Exit, Failure> {
    let (passed, line_errors) = (recording.passed, recording.line_errors);
    let files = recording.finish(now)?;
    let became = completion.complete(&files, screen);
    let not_passed: usize = held.iter().sum();
    let lost = match end {
        End::Lost(side, reason) => {
            Some(format!("the port on side {side} is lost: {reason}; check the cable"))
        }
        _ => None,
    };
    let document = Document {
        result: end.name(),
        seconds: (now - begin).0 as f64 / 1e6,
        a_to_b: passed[0],
        b_to_a: passed[1],
        line_errors,
        not_passed,
        files: files.iter().map(|file| file.display().to_string()).collect(),
        case: became.as_ref().map(|became| became.is_case),
        standing: became.as_ref().map(|became| became.sentence.clone()),
        message: lost.clone(),
    };
    screen.document(&document);
    for file in &document.files {
        screen.say(file);
    }
    screen.note(format_args!(
        "passed {} from a to b and {} from b to a",
        numbers::things(passed[0], "byte"),
        numbers::things(passed[1], "byte")
    ));
    if let Some(became) = &became {
        screen.note(format_args!(
            "{}: {}",
            if became.is_case { "the record is a case" } else { "the record is no case yet" },
            became.sentence
        ));
    }
    if line_errors > 0 {
        screen.note(format_args!(
            "{} with damage; damaged characters were passed on as they were read",
            numbers::things(line_errors, "line error")
        ));
    }
    if not_passed > 0 {
        screen.error(format_args!(
            "{} could not be passed on: the other side did not take them",
            numbers::things(not_passed as u64, "byte")
        ));
    }
    if let Some(message) = lost {
        screen.error(message);
        return Ok(Exit::Port);
    }
    Ok(if not_passed > 0 { Exit::Incomplete } else { Exit::Done })
}

fn open(
    side: Side,
    spec: &PortSpec,
    line: LineParameters,
    screen: &Screen,
) -> Result<Port, Failure> {
    let port = Port::open(spec, &PortOptions::new(line))?;
    for difference in port.differences() {
        screen.note(format_args!("note: the port on side {side} has other settings: {difference}"));
    }
    if let Some(path) = port.slave_path() {
        screen.note(format_args!("the partner on side {side} may open {}", path.display()));
    }
    if !port.rate_known() {
        screen.note(format_args!(
            "note: the port on side {side} has no line rate, no line errors and no breaks to record"
        ));
    }
    tracing::info!(port = %spec, line = line_text(&port.line()), "open");
    Ok(port)
}

/// The trace under way.
struct Recording {
    story: Story,
    writer: TraceWriter,
    /// Nobody who is recorded has a say in it.
    is_line_asked: bool,
    redactor: Option<Redactor>,
    rehearsal: Option<Rehearsal>,
    /// The side in the plug-in's place.
    side: Side,
    /// Something was told.
    has_begun: bool,
    /// When the first event was.
    origin: Option<Micros>,
    last: Time,
    /// By where they came from.
    passed: [u64; 2],
    line_errors: u64,
}

impl Recording {
    fn begin(&mut self) -> Result<(), Failure> {
        match &self.redactor {
            Some(redactor) => self.writer.add(Line::Comment(redactor.notice().to_owned())),
            None => Ok(()),
        }
    }

    fn tell(&mut self, at: Micros, event: &Event<'_>, screen: &Screen) {
        match event {
            Event::Passed { to, what } => {
                let bytes = match what {
                    Input::Bytes(bytes) => bytes.len(),
                    Input::LineError { byte, .. } => usize::from(byte.is_some()),
                };
                self.passed[to.other() as usize] += bytes as u64;
                self.line_errors += u64::from(matches!(what, Input::LineError { .. }));
            }
            Event::Cannot { side, what } => {
                screen.note(format_args!("note: the port on side {side} cannot {what}"));
            }
            Event::Heard { .. } | Event::Lines { .. } => {}
        }
        self.has_begun = true;
        self.story.tell(at, event);
    }

    /// Whether something has happened, and nothing of it is written yet.
    fn is_at_start(&self) -> bool {
        self.has_begun && !self.writer.is_begun()
    }

    /// A pty has the rate that the program on it has set by the time at which it sends: that is the
    /// line's, unless somebody has named one or a port keeps one.
    fn begin_line(&mut self, tap: &Tap, screen: &Screen) {
        for side in [self.side, self.side.other()] {
            let Some(told) = tap.port(side).told_baud() else { continue };
            let line = self.writer.line();
            if told == line.baud {
                return;
            }
            let is_free = !self.is_line_asked
                && ![Side::A, Side::B].iter().any(|side| tap.port(*side).rate_known());
            if is_free {
                self.writer.set_line(LineSettings { baud: told, ..line });
                return;
            }
            screen.note(format_args!(
                "note: the program on side {side} has set its port to {told} baud, the line is at {}; \
                 --line names another",
                line.baud
            ));
            return;
        }
    }

    /// Writes what is sure by now; nothing before the first event.
    fn write(&mut self, now: Micros) -> Result<(), Failure> {
        while let Some((at, what)) = self.story.next(now) {
            self.add(at, what)?;
        }
        if self.has_begun { self.writer.flush() } else { Ok(()) }
    }

    fn finish(mut self, now: Micros) -> Result<Vec<std::path::PathBuf>, Failure> {
        for (at, what) in self.story.rest() {
            self.add(at, what)?;
        }
        let end = self.time(now).max(self.last);
        if let Some(rehearsal) = &mut self.rehearsal {
            for remark in rehearsal.until(Micros(end.0 as i64)) {
                self.writer.add(Line::Comment(remark))?;
            }
        }
        self.add_entry(end, What::Quiet)?;
        self.writer.finish()
    }

    fn add(&mut self, at: Micros, what: Happening) -> Result<(), Failure> {
        let time = self.time(at);
        if let Some(rehearsal) = &mut self.rehearsal {
            for remark in rehearsal.take(Micros(time.0 as i64), &what) {
                self.writer.add(Line::Comment(remark))?;
            }
        }
        let what = match what {
            Happening::Given(characters) => What::Given(Given::Receive(self.given(characters))),
            Happening::Burst(characters) => What::Given(Given::Burst(self.given(characters))),
            Happening::Sent(mut bytes) => {
                for byte in &mut bytes {
                    *byte = self.redacted(Way::Sent, *byte);
                }
                What::Expected(Expected::Send(Payload::from_bytes(&bytes)))
            }
            Happening::SentBreak(micros) => What::Expected(Expected::SendBreak(micros)),
            Happening::SetLines(levels) => What::Expected(Expected::SetLines(levels)),
            Happening::Line(event) => What::Given(Given::Line(event)),
            Happening::Remark(text) => return self.writer.add(Line::Comment(text)),
        };
        self.add_entry(time, what)
    }

    fn add_entry(&mut self, time: Time, what: What) -> Result<(), Failure> {
        self.last = time;
        self.writer.add(Line::Entry(Entry {
            when: When::at(time),
            what,
            line: SourceLine::default(),
        }))
    }

    /// Since the first event; never before what was written last.
    fn time(&mut self, at: Micros) -> Time {
        let origin = *self.origin.get_or_insert(at);
        Time((at - origin).0.max(0) as u64).max(self.last)
    }

    fn given(&mut self, characters: Vec<Character>) -> Payload {
        let mut items = Vec::new();
        let mut run = Vec::new();
        for (byte, bad) in characters {
            let byte = self.redacted(Way::Given, byte);
            match bad {
                None => run.push(byte),
                Some(kind) => {
                    items.extend(good(&std::mem::take(&mut run)));
                    items.push(Item::Bad { kind, byte });
                }
            }
        }
        items.extend(good(&run));
        Payload::new(items)
    }

    fn redacted(&mut self, way: Way, byte: u8) -> u8 {
        self.redactor.as_mut().map_or(byte, |redactor| redactor.byte(way, byte))
    }
}

fn good(run: &[u8]) -> Vec<Item> {
    Payload::from_bytes(run).items().to_vec()
}

/// The plug-in's, or the first part of the id.
fn profile(arguments: &Arguments, prepared: Option<&Prepared>) -> String {
    if let Some(id) = &arguments.id {
        let claims = prepared.iter().flat_map(|prepared| &prepared.plugin.manifest().profiles);
        let mut claims = claims.map(|profile| profile.name.as_str());
        let begins = |name: &&str| id.strip_prefix(*name).is_some_and(|rest| rest.starts_with('.'));
        let first = id.split('.').next().unwrap_or(id);
        return claims.find(begins).unwrap_or(first).to_owned();
    }
    let claimed = prepared.and_then(|prepared| prepared.plugin.manifest().profiles.first());
    claimed.map_or_else(|| "recorded".to_owned(), |profile| profile.name.clone())
}

fn front(arguments: &Arguments, profile: &str, side: Side, line: LineParameters) -> FrontMatter {
    let far = match side {
        Side::A => &arguments.b,
        Side::B => &arguments.a,
    };
    let id = arguments.id.clone().unwrap_or_else(|| format!("{profile}.{}", slug(&arguments.out)));
    let title = arguments.title.clone().unwrap_or_else(|| "Recorded between two partners".into());
    let redacted = if arguments.redact { " (redacted)" } else { "" };
    FrontMatter {
        id,
        title: format!("{title}{redacted}"),
        profile: profile.to_owned(),
        clauses: vec![format!("{profile}.recorded")],
        level: Level::May,
        edge: None,
        line: line.into(),
        config: config(arguments),
        room: softplug_trace::Room::default(),
        modem: softplug_trace::ModemLevels::default(),
        since: 1,
        origin: Origin::Recorded {
            device: arguments.device.clone().unwrap_or_else(|| plain(&far.to_string())),
            date: date(SystemTime::now()),
            tool: concat!("softplug ", env!("CARGO_PKG_VERSION")).to_owned(),
        },
        permute: Permutations::default(),
        leaves: String::new(),
        bytes: None,
    }
}

fn config(arguments: &Arguments) -> Vec<Assignment> {
    let pair = |setting: &crate::assignment::Assignment| Assignment {
        name: setting.name.clone(),
        value: setting.value.clone(),
    };
    arguments.settings.iter().map(pair).collect()
}

/// What a trace may name as a device.
fn plain(text: &str) -> String {
    let plain = text.chars().filter(|c| !c.is_control() && !matches!(c, ',' | '(' | ')'));
    let text: String = plain.take(30).collect();
    if text.trim().is_empty() { "unknown".to_owned() } else { text.trim().to_owned() }
}

/// A file's name as the last part of an id.
fn slug(path: &Path) -> String {
    let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
    let mut slug = String::new();
    for c in stem.chars().take(60) {
        if c.is_ascii_alphanumeric() {
            slug.push(c.to_ascii_lowercase());
        } else if !slug.is_empty() && !slug.ends_with('-') {
            slug.push('-');
        }
    }
    let slug = slug.trim_end_matches('-');
    if slug.is_empty() { "session".to_owned() } else { slug.to_owned() }
}

/// `YYYY-MM-DD` in universal time.
fn date(now: SystemTime) -> String {
    let seconds = now.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    let mut days = seconds / 86_400;
    let mut year = 1970_u64;
    let is_leap = |year: u64| {
        year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400))
    };
    let length = |year| 365 + u64::from(is_leap(year));
    while days >= length(year) {
        days -= length(year);
        year += 1;
    }
    let february = 28 + u64::from(is_leap(year));
    let mut month = 1;
    for length in [31, february, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31] {
        if days < length {
            break;
        }
        days -= length;
        month += 1;
    }
    format!("{year:04}-{month:02}-{:02}", days + 1)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn dates_are_those_of_the_calendar() {
        let at = |seconds| date(UNIX_EPOCH + Duration::from_secs(seconds));
        assert_eq!(at(0), "1970-01-01");
        assert_eq!(at(951_782_400), "2000-02-29");
        assert_eq!(at(1_795_219_199), "2026-11-20");
        assert_eq!(at(1_795_219_200), "2026-11-21");
        assert_eq!(at(4_107_542_399), "2100-02-28");
        assert_eq!(at(4_107_542_400), "2100-03-01");
    }

    #[test]
    fn any_file_name_makes_an_id() {
        assert_eq!(slug(Path::new("/x/My Lathe (2).spt")), "my-lathe-2");
        assert_eq!(slug(Path::new("___.spt")), "session");
        assert!(softplug_trace::is_slug(&slug(Path::new("Größe--1.spt"))));
    }
}
