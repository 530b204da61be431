//! What a partner sends besides a transfer: refused where it has no place, kept where it has one,
//! and never acknowledged and dropped.

#![cfg(target_os = "linux")]

use std::fs::{self, File};
use std::io::{self, Cursor, ErrorKind, Read, Write};
use std::os::fd::AsFd;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::thread::{self, JoinHandle};
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, poll};
use softplug_abi::LineParameters;
use softplug_abi::manifest::Manifest;
use softplug_live::pty::PtyPair;
use softplug_live::station::{Station, StationOptions};
use softplug_live::store::Inbox;
use softplug_live::transfer::{
    Delivered, News, ReceiveOutcome, Reply, Request, SendOptions, SendOutcome, ServeHandler,
    ServeOptions, Sink, TransferError, ask, receive, serve,
};
use softplug_live::{Port, PortOptions, PortSpec};
use softplug_native::{NativeInstance, NativePlugin};

const DLE: u8 = 0x10;
const STX: u8 = 0x02;
const NAK: u8 = 0x15;
/// The block "A" on the line.
const BLOCK: [u8; 4] = [b'A', DLE, 0x03, 0x52];
/// The partner's block "XY".
const THEIRS: [u8; 5] = [b'X', b'Y', DLE, 0x03, 0x12];

/// A station on the slave of a pty, and the master.
fn pair(
    plugin: NativePlugin,
    asked: &[(&str, &str)],
    delivery_room: u32,
) -> (Station<NativeInstance>, PtyPair) {
    let mut pair = PtyPair::open().unwrap();
    let spec = PortSpec::Device(pair.slave_path().to_owned());
    let port = Port::open(&spec, &PortOptions::new(LineParameters::new(115_200))).unwrap();
    pair.release_slave();
    let manifest = Manifest::parse(plugin.manifest().as_bytes()).unwrap();
    let settings = manifest.resolve_settings(asked.iter().copied()).unwrap();
    let options = StationOptions { settings, delivery_room, ..StationOptions::default() };
    (Station::new(port, plugin.instantiate(), options).unwrap(), pair)
}

/// A partner that reads what it is to be sent, and then says something, in turns.
fn partner(pair: PtyPair, turns: Vec<(Vec<u8>, Vec<u8>)>) -> JoinHandle<PtyPair> {
    thread::spawn(move || {
        let mut master = File::from(pair.master().as_fd().try_clone_to_owned().unwrap());
        for (expected, answer) in turns {
            let mut came: Vec<u8> = Vec::new();
            while came.len() < expected.len() {
                let _ = poll(&mut [PollFd::new(&master, PollFlags::IN)], None);
                let mut byte = [0];
                match master.read(&mut byte) {
                    Ok(count) => came.extend(&byte[..count]),
                    Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                    Err(error) => panic!("{error}"),
                }
            }
            assert_eq!(came, expected);
            master.write_all(&answer).unwrap();
        }
        pair
    })
}

fn names(folder: &Path) -> Vec<String> {
    let name = |entry: std::io::Result<fs::DirEntry>| entry.unwrap().file_name();
    let mut names: Vec<_> = fs::read_dir(folder).unwrap().map(name).collect();
    names.sort();
    names.into_iter().map(|name| name.into_string().unwrap()).collect()
}

const QUIET: [(&str, &str); 1] = [("nak_at_start", "off")];

#[test]
fn without_a_place_the_partners_block_is_refused_and_not_acknowledged() {
    let (mut station, pair) = pair(NativePlugin::R3964, &QUIET, 0);
    // Both begin at once: the partner goes first, and finds no buffer.
    let far = partner(
        pair,
        vec![(vec![STX], vec![STX]), (vec![NAK, STX], vec![DLE]), (BLOCK.to_vec(), vec![DLE])],
    );
    let (options, stop) = (SendOptions::default(), AtomicBool::new(false));
    let (mut source, mut answer) = (Cursor::new(b"A"), Vec::new());
    let report =
        ask(&mut station, &mut source, &mut answer, None, &options, &stop, &mut |_| {}).unwrap();
    far.join().unwrap();
    assert_eq!(report.outcome, SendOutcome::Done);
    assert_eq!((report.refused, report.received), (1, 0));
    assert_eq!((report.kept, answer), (Vec::new(), Vec::new()));
}

#[test]
fn with_a_place_the_partners_block_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let mut inbox = Inbox::new(folder.path()).unwrap();
    let (mut station, pair) = pair(NativePlugin::R3964, &QUIET, 16_384);
    let far = partner(
        pair,
        vec![
            (vec![STX], vec![STX]),
            (vec![DLE], THEIRS.to_vec()),
            (vec![DLE, STX], vec![DLE]),
            (BLOCK.to_vec(), vec![DLE]),
        ],
    );
    let (options, stop) = (SendOptions::default(), AtomicBool::new(false));
    let mut source = Cursor::new(b"A");
    let besides = Some(&mut inbox);
    let report =
        ask(&mut station, &mut source, &mut Vec::new(), besides, &options, &stop, &mut |_| {})
            .unwrap();
    far.join().unwrap();
    assert_eq!(report.outcome, SendOutcome::Done);
    assert_eq!((report.refused, report.received, report.kept.len()), (0, 0, 1));
    let kept = &report.kept[0];
    assert_eq!((kept.bytes, kept.failure), (2, None));
    assert_eq!(fs::read(kept.path.as_ref().unwrap()).unwrap(), b"XY");
    assert_eq!(names(folder.path()).len(), 1);
}

#[test]
fn the_next_program_of_one_punch_is_kept_beside_the_first() {
    let folder = tempfile::tempdir().unwrap();
    let mut inbox = Inbox::new(folder.path()).unwrap();
    let (mut station, pair) = pair(NativePlugin::FanucRs232, &[], 16_384);
    let punched = b"\x12%\nO1\nM30\n%\nO2\nM30\n%\n".to_vec();
    // The rest comes after the first program has ended.
    let far = partner(pair, vec![(Vec::new(), punched), (Vec::new(), b"\0\0\x14".to_vec())]);
    let (mut out, stop) = (Vec::new(), AtomicBool::new(false));
    let give_up = Some(Duration::from_mins(1));
    let report =
        receive(&mut station, &mut out, Some(&mut inbox), give_up, &stop, &mut |_| {}).unwrap();
    far.join().unwrap();
    assert_eq!(report.outcome, ReceiveOutcome::Complete);
    assert_eq!((report.name.as_deref(), &out[..]), (Some("O1"), &b"%\nO1\nM30\n%\n"[..]));
    assert_eq!(names(folder.path()), ["O2"]);
    assert_eq!(fs::read(folder.path().join("O2")).unwrap(), b"%\nO2\nM30\n%\n");
    assert_eq!((report.kept.len(), report.dropped), (1, 0));
}

/// All that the partner finds on the line when the station has gone.
fn rest(pair: &PtyPair) -> Vec<u8> {
    let mut master = File::from(pair.master().as_fd().try_clone_to_owned().unwrap());
    let mut rest = Vec::new();
    // It ends with an error, as nobody has the other side.
    let _ = master.read_to_end(&mut rest);
    rest
}

/// A disk that is full: at the begin, at the first byte, or when all is to be put away.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Full {
    Begin,
    Write,
    End,
}

const ENOSPC: io::ErrorKind = ErrorKind::StorageFull;

impl Full {
    fn at(self, step: Self) -> io::Result<()> {
        if self == step { Err(ENOSPC.into()) } else { Ok(()) }
    }
}

impl Write for Full {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.at(Self::Write).map(|()| bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Sink for Full {
    fn complete(&mut self) -> io::Result<()> {
        self.at(Self::End)
    }
}

impl ServeHandler for Full {
    fn begin(&mut self) -> io::Result<()> {
        self.at(Self::Begin)
    }

    fn deliver(&mut self, _: &[u8]) -> io::Result<()> {
        self.at(Self::Write)
    }

    fn end(&mut self, _: &Delivered) -> io::Result<()> {
        self.at(Self::End)
    }

    fn asked(&mut self, _: &Request) -> Reply {
        Reply::Refused(softplug_abi::Failure::NotFound)
    }

    fn tell(&mut self, _: &News<'_>) {}
}

/// A partner that sends its block, and may find nothing behind the DLE that we are ready.
fn sends_a_block(pair: PtyPair) -> JoinHandle<PtyPair> {
    partner(pair, vec![(Vec::new(), vec![STX]), (vec![DLE], THEIRS.to_vec())])
}

#[test]
fn a_block_that_cannot_be_put_away_is_not_acknowledged() {
    let stop = AtomicBool::new(false);
    for mut full in [Full::Write, Full::End] {
        let (mut station, pair) = pair(NativePlugin::R3964, &QUIET, 16_384);
        let far = sends_a_block(pair);
        let failed = receive(&mut station, &mut full, None, None, &stop, &mut |_| {}).unwrap_err();
        assert!(
            matches!(&failed, TransferError::Sink(error) if error.kind() == ENOSPC),
            "{failed}"
        );
        drop(station);
        assert_eq!(rest(&far.join().unwrap()), b"", "{full:?}");
    }
    for mut full in [Full::Begin, Full::Write, Full::End] {
        let (mut station, pair) = pair(NativePlugin::R3964, &QUIET, 16_384);
        let far = sends_a_block(pair);
        let options = ServeOptions::default();
        let failed = serve(&mut station, &mut full, &options, &stop, &mut |_| {}).unwrap_err();
        assert!(
            matches!(&failed, TransferError::Sink(error) if error.kind() == ENOSPC),
            "{failed}"
        );
        drop(station);
        assert_eq!(rest(&far.join().unwrap()), b"", "{full:?}");
    }
}

#[test]
fn what_comes_besides_and_cannot_be_put_away_ends_the_job_unacknowledged() {
    let folder = tempfile::tempdir().unwrap();
    let gone = folder.path().join("gone");
    fs::create_dir(&gone).unwrap();
    let mut inbox = Inbox::new(&gone).unwrap();
    fs::remove_dir(&gone).unwrap();
    let (mut station, pair) = pair(NativePlugin::R3964, &QUIET, 16_384);
    let far = partner(pair, vec![(vec![STX], vec![STX]), (vec![DLE], THEIRS.to_vec())]);
    let (options, stop) = (SendOptions::default(), AtomicBool::new(false));
    let (mut source, mut answer) = (Cursor::new(b"A"), Vec::new());
    let besides = Some(&mut inbox);
    let failed = ask(&mut station, &mut source, &mut answer, besides, &options, &stop, &mut |_| {});
    let failed = failed.unwrap_err();
    let is_missing = |error: &io::Error| error.kind() == ErrorKind::NotFound;
    assert!(matches!(&failed, TransferError::Besides(error) if is_missing(error)), "{failed}");
    drop(station);
    let rest = rest(&far.join().unwrap());
    assert!(!rest.contains(&DLE), "{rest:x?}");
}

#[test]
fn a_sender_of_xmodem_is_told_that_it_cannot_be_put_away() {
    const ACK: u8 = 0x06;
    const CAN: u8 = 0x18;
    let stop = AtomicBool::new(false);
    // SOH, the first block of 128 times A, and its sum, which is 0x80 times 0x41.
    let block = [&[1, 1, 0xfe][..], &[b'A'; 128], &[0x80]].concat();
    for is_served in [false, true] {
        let check = [("mode", "checksum")];
        let (mut station, pair) = pair(NativePlugin::Xmodem, &check, 16_384);
        let far = partner(pair, vec![(vec![NAK], block.clone())]);
        let mut full = Full::Write;
        let failed = if is_served {
            serve(&mut station, &mut full, &ServeOptions::default(), &stop, &mut |_| {}).map(drop)
        } else {
            receive(&mut station, &mut full, None, None, &stop, &mut |_| {}).map(drop)
        };
        assert!(matches!(failed, Err(TransferError::Sink(_))), "{failed:?}");
        drop(station);
        let rest = rest(&far.join().unwrap());
        assert!(rest.contains(&CAN) && !rest.contains(&ACK), "{rest:x?}");
    }
}

#[test]
fn characters_that_are_no_program_are_counted() {
    let (mut station, pair) = pair(NativePlugin::FanucRs232, &[], 16_384);
    // Without DC2 no program begins.
    let far = partner(pair, vec![(Vec::new(), b"%\nO1\n%\n".to_vec())]);
    let (mut out, stop) = (Vec::new(), AtomicBool::new(false));
    let give_up = Some(Duration::from_secs(1));
    let report = receive(&mut station, &mut out, None, give_up, &stop, &mut |_| {}).unwrap();
    far.join().unwrap();
    assert_eq!((report.outcome, report.heard), (ReceiveOutcome::NothingCame, 7));
}
