//! What is kept of a plug-in that failed: a trace that shows the fault again, and
//! says what it was.

use softplug_abi::{Event, LineParameters, Pass};
use softplug_link::UnderWay;
use softplug_live::recorder::{Entry as Kept, Recording};
use softplug_trace::{
    Assignment, Entry, Exact, FrontMatter, Given, Level, Line, LineSettings, ModemLevels, Origin,
    Payload, Permutations, Room, SourceLine, Time, Trace, What, When, is_slug,
};
use std::path::{Path, PathBuf};

use crate::disk::{DiskError, make_folder, names_in, remove, write_whole};

/// Traces of faults that are kept of one link; the oldest goes first.
const KEPT: usize = 20;
/// Bytes of a payload that stand on one line.
const PIECE: usize = 8_192;
/// Characters of a title.
const TITLE: usize = 120;

/// What a fault's trace says beside the events.
#[derive(Clone, Debug)]
pub struct About<'a> {
    /// The link's name.
    pub link: &'a str,
    /// The plug-in's name, as its manifest has it.
    pub plugin: &'a str,
    /// Its version and whatever else tells which it was.
    pub version: &'a str,
    /// What happened, in one sentence.
    pub sentence: &'a str,
    /// What the plug-in said last.
    pub last_words: Option<&'a str>,
    /// The day, as YYYY-MM-DD.
    pub day: &'a str,
    /// Tells this fault of the link from its others: lower-case letters and digits.
    pub number: &'a str,
}

/// The trace of a fault, as text. A recording whose beginning was not kept cannot
/// be given to another instance: its events are comments.
pub fn trace(recording: &Recording, about: &About<'_>) -> String {
    let profile = if is_slug(about.plugin) { about.plugin } else { "plugin" };
    let mut body: Vec<Line> = heading(about).map(Line::Comment).collect();
    let mut end = Time(0);
    if recording.is_whole() {
        let first = recording.entries().next().map_or(Time(0), |entry| time(&entry));
        body.extend(under_way(recording.under_way()).map(|facts| line(first, facts)));
    } else {
        body.push(Line::Comment(
            " The beginning was not kept, so that this cannot be replayed. The last events:"
                .to_owned(),
        ));
    }
    for kept in recording.entries() {
        end = time(&kept);
        for payload in pieces(&kept) {
            let event = Exact::Event { name: kept.kind.name().to_owned(), payload };
            match line(end, event) {
                Line::Entry(entry) if !recording.is_whole() => {
                    body.push(Line::Comment(format!(" {entry}")));
                }
                line => body.push(line),
            }
        }
    }
    if !recording.is_whole() || recording.is_empty() {
        body.push(Line::Entry(entry(end, What::Quiet)));
    }
    let front = FrontMatter {
        id: format!("{profile}.flight.{}", about.number),
        title: title(about),
        profile: profile.to_owned(),
        clauses: vec![format!("{profile}.flight")],
        level: Level::Must,
        edge: None,
        line: line_settings(recording),
        config: Vec::new(),
        room: Room::default(),
        modem: ModemLevels::default(),
        since: 1,
        origin: Origin::Recorded {
            device: plain(&about.link.replace(['(', ')', ','], " "), 64),
            date: about.day.to_owned(),
            tool: "softplug gateway".to_owned(),
        },
        permute: Permutations::NONE,
        leaves: String::new(),
        bytes: None,
    };
    Trace { front, body }.format()
}

/// Puts the trace into the link's folder; older ones go when there are many.
///
/// # Errors
/// It cannot be written.
pub fn keep(folder: &Path, about: &About<'_>, text: &str) -> Result<PathBuf, DiskError> {
    make_folder(folder)?;
    let path = folder.join(format!("{}.spt", about.number));
    write_whole(&path, text.as_bytes())?;
    let mut traces = names_in(folder)?;
    traces.retain(|name| Path::new(name).extension().is_some_and(|end| end == "spt"));
    // Numbers are of one length, and later ones are greater.
    for old in traces.iter().rev().skip(KEPT).map(|name| folder.join(name)) {
        if old != path {
            remove(&old)?;
        }
    }
    Ok(path)
}

fn heading(about: &About<'_>) -> impl Iterator<Item = String> {
    let who = format!("{}, version {}, on link {}", about.plugin, about.version, about.link);
    let words = about.last_words.map(|words| format!("Its last words: {words}"));
    [Some(who), Some(about.sentence.to_owned()), words]
        .into_iter()
        .flatten()
        .map(|text| format!(" {}", plain(&text, 1_000)))
}

fn title(about: &About<'_>) -> String {
    let mut title = plain(about.sentence, TITLE);
    if title.is_empty() {
        "A plug-in failed".clone_into(&mut title);
    }
    title
}

/// Text from a plug-in in a trace: nothing of it may look like anything else.
fn plain(text: &str, most: usize) -> String {
    let shown = |c: char| if c.is_ascii_graphic() { c } else { ' ' };
    let plain: String = text.chars().map(shown).take(most).collect();
    plain.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn under_way(known: &UnderWay) -> Option<Exact> {
    let UnderWay { job, delivery, requests, marks } = known;
    let fact = |name: &str, value: String| Assignment { name: name.to_owned(), value };
    let mut facts = Vec::new();
    if let Some((job, pass)) = job {
        facts.push(fact("job", job.to_string()));
        let pass = if *pass == Pass::Check { "check" } else { "run" };
        facts.push(fact("pass", pass.to_owned()));
    }
    facts.extend(delivery.map(|delivery| fact("delivery", delivery.to_string())));
    if !requests.is_empty() {
        let ids: Vec<String> = requests.iter().map(ToString::to_string).collect();
        facts.push(fact("requests", ids.join(",")));
    }
    if *marks > 0 {
        facts.push(fact("marks", marks.to_string()));
    }
    (!facts.is_empty()).then_some(Exact::UnderWay(facts))
}

/// The payload in pieces that fit a line: what may be cut is cut.
fn pieces(kept: &Kept<'_>) -> Vec<Payload> {
    if kept.payload.len() <= PIECE {
        return vec![Payload::hex(kept.payload)];
    }
    match Event::decode(kept.kind, kept.payload) {
        Ok(Event::Received(bytes)) => bytes.chunks(PIECE).map(Payload::hex).collect(),
        Ok(Event::JobData { job, bytes }) => {
            bytes.chunks(PIECE).map(|bytes| encoded(&Event::JobData { job, bytes })).collect()
        }
        Ok(Event::Restore { format, total, mut offset, bytes }) => {
            let cut = bytes.chunks(PIECE).map(|bytes| {
                let piece = encoded(&Event::Restore { format, offset, total, bytes });
                offset += bytes.len() as u32;
                piece
            });
            cut.collect()
        }
        Ok(Event::Answer { request, refused, more, bytes }) => {
            let last = bytes.len().div_ceil(PIECE) - 1;
            let cut = bytes.chunks(PIECE).enumerate().map(|(at, bytes)| {
                encoded(&Event::Answer { request, refused, more: more || at < last, bytes })
            });
            cut.collect()
        }
        _ => vec![Payload::hex(kept.payload)],
    }
}

fn encoded(event: &Event<'_>) -> Payload {
    let mut buffer = [0; PIECE + 64];
    let length = event.encode(&mut buffer).expect("a piece and its head fit");
    Payload::hex(&buffer[..length])
}

fn line(at: Time, exact: Exact) -> Line {
    Line::Entry(entry(at, What::Given(Given::Exact(exact))))
}

fn entry(at: Time, what: What) -> Entry {
    Entry { when: When::at(at), what, line: SourceLine::default() }
}

fn time(kept: &Kept<'_>) -> Time {
    Time(kept.at.0.max(0) as u64)
}

/// As the plug-in was told when it was opened.
fn line_settings(recording: &Recording) -> LineSettings {
    let opened =
        recording.entries().find_map(|kept| match Event::decode(kept.kind, kept.payload) {
            Ok(Event::Open { line, .. }) => Some(line),
            _ => None,
        });
    opened.unwrap_or_else(|| LineParameters::new(0)).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use softplug_abi::RequestId;
    use softplug_abi::{EventKind, Instance, Micros};
    use softplug_conformance::{Case, FaultClass, Permutation, Sandboxed, replay};
    use softplug_host::{Host, HostOptions, Plugin, Session};
    use softplug_link::{Link, LinkFault, LinkOptions, Recorder};
    use softplug_live::recorder::{Recorded, checkpoint, recording};
    use std::sync::LazyLock;

    /// Counts the bytes that it receives, saves the count, and traps at the 300th.
    const COUNTS: &str = r#"(module
      (@custom "softplug.manifest"
        "{\"abi\":\"1.0\",\"name\":\"counts\",\"version\":\"1.0.0\",\"licence\":\"MIT\","
        "\"protocol\":\"none\",\"description\":\"Traps.\",\"state\":{\"saves\":1,\"accepts\":[1]}}")
      (memory (export "memory") 1 1)
      (data (i32.const 16) "\00\04\00\00\00\02\00\00" "\00\08\00\00\00\04\00\00" "\40\00\00\00\40\00\00\00")
      (data (i32.const 64) "\0d\00\00\00three hundred")
      (global $count (mut i32) (i32.const 0))
      (func (export "softplug_v1") (result i32) (i32.const 16))
      (func (export "softplug_v1_step") (param $kind i32) (param $len i32) (param $now i64) (result i32)
        (if (i32.eq (local.get $kind) (i32.const 4)) (then
          (global.set $count (i32.add (global.get $count) (local.get $len)))
          (if (i32.ge_u (global.get $count) (i32.const 300)) (then unreachable))))
        (if (i32.eq (local.get $kind) (i32.const 23))
          (then (global.set $count (i32.load (i32.const 1036)))))
        (if (i32.eq (local.get $kind) (i32.const 22)) (then
          (i32.store (i32.const 2048) (i32.const 0x00100016))
          (i32.store (i32.const 2052) (i32.const 1))
          (i32.store (i32.const 2056) (i32.const 0))
          (i32.store (i32.const 2060) (i32.const 4))
          (i32.store (i32.const 2064) (global.get $count))
          (return (i32.const 20))))
        (i32.const 0)))"#;

    static PLUGIN: LazyLock<Plugin> = LazyLock::new(|| {
        let host = Host::new(HostOptions::default()).unwrap();
        host.load_bytes(&wat::parse_str(COUNTS).unwrap()).unwrap()
    });

    fn crash(
        bytes: usize,
        checkpoints: bool,
    ) -> (LinkFault<<Session as Instance>::Fault>, Recording) {
        let instance = Recorded::new(PLUGIN.instantiate().unwrap(), bytes);
        let mut link = Link::new(instance, LinkOptions::default());
        let mut out = Recorder::default();
        link.open(Micros::ZERO, &mut out).unwrap();
        for at in 1.. {
            let now = Micros(at * 1_000);
            if checkpoints && link.instance().wants_checkpoint() {
                checkpoint(&mut link, now, &mut out).unwrap();
            }
            if let Err(fault) = link.received(now, b"abc", &mut out) {
                return (fault, recording(&link));
            }
        }
        unreachable!("it traps");
    }

    fn about<'a>(sentence: &'a str, number: &'a str) -> About<'a> {
        About {
            link: "lathe (1), hall 2",
            plugin: "counts",
            version: "1.0.0 sha256:0123",
            sentence,
            last_words: Some("three\nhundred \u{202e}"),
            day: "2026-03-01",
            number,
        }
    }

    fn case(text: &str) -> Case {
        let trace = Trace::parse(text).unwrap_or_else(|error| panic!("{text}\n{error}"));
        Case::new("fault.spt", trace)
    }

    #[test]
    fn the_trace_of_a_fault_shows_it_again() {
        for (bytes, checkpoints) in [(1 << 20, false), (512, true)] {
            let (fault, recording) = crash(bytes, checkpoints);
            let sentence = fault.to_string();
            let text = trace(&recording, &about(&sentence, "17"));
            let case = case(&text);
            assert_eq!(case.trace.format(), text);
            let entries = case.trace.entries().count();
            assert!(if checkpoints { entries < 60 } else { entries > 100 }, "{entries}");
            let subject = Sandboxed::new(PLUGIN.clone());
            let shown = replay(&subject, &case, &Permutation::Uncut, 0).fault.unwrap();
            assert_eq!((shown.class, &shown.message), (FaultClass::Trapped, &sentence));
            assert_eq!(shown.at_us, 100_000);
            assert!(text.contains("\n# Its last words: three hundred\n"), "{text}");
        }
    }

    #[test]
    fn without_its_beginning_it_is_read_by_people_only() {
        let (fault, recording) = crash(512, false);
        let text = trace(&recording, &about(&fault.to_string(), "18"));
        let case = case(&text);
        assert!(text.contains("\n# @ 0.100000 received 61 62 63"), "{text}");
        assert_eq!(case.trace.entries().count(), 1);
    }

    #[test]
    fn large_events_are_cut_to_lines() {
        let bytes = vec![7; 20_000];
        let mut encoded = vec![0; 20_100];
        let event =
            Event::Answer { request: RequestId(1), refused: None, more: false, bytes: &bytes };
        let length = event.encode(&mut encoded).unwrap();
        let at = Micros(5);
        let kept = Kept { at, kind: EventKind::Answer, payload: &encoded[..length] };
        let cut: Vec<(bool, usize)> = pieces(&kept)
            .iter()
            .map(|payload| {
                let payload = payload.bytes(&softplug_trace::NoFiles).unwrap();
                match Event::decode(EventKind::Answer, &payload).unwrap() {
                    Event::Answer { more, bytes, .. } => (more, bytes.len()),
                    other => panic!("{other:?}"),
                }
            })
            .collect();
        assert_eq!(cut, [(true, 8_192), (true, 8_192), (false, 3_616)]);
    }

    #[test]
    fn a_link_keeps_a_bounded_number() {
        let folder = tempfile::tempdir().unwrap();
        for number in 100..130 {
            let number = number.to_string();
            keep(&folder.path().join("lathe"), &about("", &number), "text").unwrap();
        }
        let names = names_in(&folder.path().join("lathe")).unwrap();
        assert_eq!((names.len(), names[0].as_str()), (KEPT, "110.spt"));
    }
}
