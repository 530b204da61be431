//! What was recorded becomes a case: the requests that go with it, and the plug-in that has to
//! send what was recorded.

use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use sha2::{Digest as _, Sha256};
use softplug_conformance::{
    Case, FlightError, Judge, Made, RecordStanding, bless, case_of_record, record_of_flight,
};
use softplug_trace::{
    Digest, Entry, Given, HostRequest, Item, Line, Payload, SourceLine, Time, Trace, What, When,
    limits,
};

use crate::failure::Failure;
use crate::files;
use crate::plugin::SEND;

/// What a front matter is for a moment, so that a line can be read.
const HEAD: &str = "id: a.b\ntitle: T\nprofile: a\nclauses: a.b\nlevel: may\n\
                    line: 9600 8N1 depth=1 reaction=0\nsince: 1\norigin: hand-written\n---\n";

/// What the side in the plug-in's place was asked to do.
#[derive(Clone, Debug, Args)]
pub(crate) struct Requests {
    /// A file that was sent from the plug-in's side: the trace asks the plug-in to send it. May be
    /// repeated, in the order in which they were sent
    #[arg(long, value_name = "FILE", requires = "plugin", conflicts_with = "ask")]
    send: Vec<PathBuf>,
    /// Something else that was asked of the plug-in's side, as behind the time of a "?" line: "job
    /// 1 read area=DB block=5 offset=0 count=7". May be repeated
    #[arg(long, value_name = "REQUEST", requires = "plugin", value_parser = request)]
    ask: Vec<HostRequest>,
}

impl Requests {
    /// The requests of a trace. The data of a long one is a file in the folder `files` beside it.
    pub(crate) fn of(&self, trace: &Path) -> Result<Vec<HostRequest>, Failure> {
        let sent = (1..).zip(&self.send).map(|(id, file)| {
            let bytes = files::read(file)?;
            if bytes.is_empty() {
                let file = file.display();
                return Err(Failure::usage(format_args!(
                    "{file} is empty: nothing was sent of it"
                )));
            }
            let data = data(trace, &bytes)?;
            Ok(HostRequest::Job { id, kind: SEND.to_owned(), fields: Vec::new(), data })
        });
        let mut all = sent.collect::<Result<Vec<_>, _>>()?;
        all.extend(self.ask.iter().cloned());
        Ok(all)
    }
}

/// The bytes as a line has room for them.
fn data(trace: &Path, bytes: &[u8]) -> Result<Payload, Failure> {
    let data = Payload::from_bytes(bytes);
    let request = HostRequest::Job { id: 1, kind: SEND.into(), fields: Vec::new(), data };
    let when = When::at(Time(limits::SECONDS * 1_000_000));
    let entry =
        Entry { when, what: What::Given(Given::Host(request)), line: SourceLine::default() };
    // An escape takes four characters of a byte; twice that is left free.
    if bytes.len() < limits::LINE_BYTES && entry.to_string().len() + 64 < limits::LINE_BYTES {
        return Ok(entry.what.payload().cloned().unwrap_or_default());
    }
    if bytes.len() as u64 > limits::ITEM_BYTES {
        return Err(Failure::usage("a trace asks for files of at most 64 MiB"));
    }
    let digest = Digest(Sha256::digest(bytes).into());
    let parent = trace.parent().filter(|parent| !parent.as_os_str().is_empty());
    let folder = parent.unwrap_or(Path::new(".")).join("files");
    fs::create_dir_all(&folder).map_err(|error| files::unwritable(&folder, &error))?;
    files::write(&folder.join(digest.to_string()), bytes)?;
    Ok(Payload::new([Item::File(digest)]))
}

fn request(text: &str) -> Result<HostRequest, String> {
    if text.contains(['\n', '\r']) {
        return Err("a request is one line".to_owned());
    }
    let trace = Trace::parse(&format!("{HEAD}? 0.0 {text}\n")).map_err(|error| {
        format!("{}; docs/trace-format.md has what may stand behind \"?\"", error.kind)
    })?;
    let entries = trace.entries().find_map(|entry| match &entry.what {
        What::Given(Given::Host(request)) => Some(request.clone()),
        _ => None,
    });
    entries.ok_or_else(|| "this asks for nothing".to_owned())
}

/// What became of a record, for people and machines.
pub(crate) struct Became {
    pub(crate) is_case: bool,
    /// A sentence, without a full stop.
    pub(crate) sentence: String,
}

/// A record as a case of this plug-in, as far as it is one. Remarks of a rehearsal are needless in
/// a case.
pub(crate) fn make(
    judge: &dyn Judge,
    path: &Path,
    record: Trace,
    requests: &[HostRequest],
) -> (Trace, Became) {
    let name = &judge.manifest().name;
    let case = Case::new(path, record);
    let bare = case.with_trace(without_remarks(&case.trace, name));
    match case_of_record(judge, &bare, requests) {
        Ok(Made { trace, standing: standing @ RecordStanding::Case { .. } }) => {
            (trace, Became { is_case: true, sentence: standing.to_string() })
        }
        Ok(Made { trace, standing }) => {
            let sentence = standing.to_string();
            // A rehearsal knows of no request: with one, its remarks would be wrong.
            let mut trace = if requests.is_empty() { case.trace.at_line_rate() } else { trace };
            let remark = format!(" No case of {name} yet: {}.", sentence.escape_debug());
            trace.body.insert(0, Line::Comment(remark));
            (trace, Became { is_case: false, sentence })
        }
        Err(error) => {
            let sentence = error.to_string();
            (case.trace.at_line_rate(), Became { is_case: false, sentence })
        }
    }
}

/// A flight recording as a case of this plug-in: what it was given, and what it does now.
pub(crate) fn of_flight(
    judge: &dyn Judge,
    path: &Path,
    flight: Trace,
) -> Result<(Trace, Became), FlightError> {
    let flight = Case::new(path, flight);
    let given = record_of_flight(judge.manifest(), &flight)?.at_line_rate();
    match bless(judge, &flight.with_trace(given.clone())) {
        Ok(trace) => {
            let sentence = "what the plug-in was given, and what it does now".to_owned();
            Ok((trace, Became { is_case: true, sentence }))
        }
        Err(error) => Ok((given, Became { is_case: false, sentence: error.to_string() })),
    }
}

/// What a rehearsal says begins with this.
pub(crate) fn remark(name: &str, text: &str) -> String {
    format!(" {name} {text}.")
}

fn without_remarks(trace: &Trace, name: &str) -> Trace {
    let begins = [format!(" {name} would have "), format!(" {name} cannot go on: ")];
    let mut trace = trace.clone();
    trace.body.retain(|line| match line {
        Line::Comment(text) => !begins.iter().any(|begin| text.starts_with(begin)),
        _ => true,
    });
    trace
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_is_one_line_of_the_format() {
        let asked = request("job 7 read area=DB block=5").unwrap();
        let HostRequest::Job { id: 7, kind, fields, .. } = asked else { panic!("{asked:?}") };
        assert_eq!((&*kind, fields.len()), ("read", 2));
        assert!(request("send 1 \"G1\"").is_ok() && request("abort 1").is_ok());
        for wrong in ["", "send", "send 0 41", "G1", "send 1 41\n> 0.0 41", "job 1 read ; x\r"] {
            assert!(request(wrong).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn what_is_too_long_for_a_line_is_a_file_beside_the_trace() {
        let folder = tempfile::tempdir().unwrap();
        let trace = folder.path().join("a.spt");
        assert!(data(&trace, &vec![b'G'; 60_000]).unwrap().items().len() == 1);
        assert!(!folder.path().join("files").exists());
        // Hex takes three characters a byte.
        for bytes in [vec![0x10; 30_000], vec![b'G'; 70_000]] {
            let data = data(&trace, &bytes).unwrap();
            let [Item::File(digest)] = data.items() else { panic!("{data:?}") };
            assert_eq!(
                fs::read(folder.path().join("files").join(digest.to_string())).unwrap(),
                bytes
            );
        }
    }
}
