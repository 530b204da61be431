//! A board in memory, a unit on it, and a server at its uplink, in virtual time.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::fs;
use std::path::PathBuf;
use std::rc::Rc;

use sha2::{Digest, Sha256};
use softplug_abi::{LineParameters, Micros};
use softplug_interpreter::Room;
use softplug_unit_firmware::{Board, FromMachine, Options, Unit};
use softplug_unit_protocol::{
    Frame, FrameKind, Identity, Messages, PAYLOAD, Role, Session, ToServer, ToUnit, length_of_frame,
};
use softplug_unit_slots::{Device, Geometry, Misuse, Ram, Trust};

const GEOMETRY: Geometry = Geometry { size: 256 * 1_024, erase: 4_096, granule: 4 };
/// A round of the unit.
const ROUND: Micros = Micros(250);
/// Rounds within which something must come: two minutes of its time.
const MOST_ROUNDS: usize = 480_000;

/// What outlives the unit.
type Bytes = Rc<RefCell<Vec<u8>>>;

pub(crate) struct FlashInMemory(Bytes);

impl FlashInMemory {
    fn ram<T>(&self, act: impl FnOnce(&mut Ram<'_>) -> T) -> T {
        let mut bytes = self.0.borrow_mut();
        act(&mut Ram::new(&mut bytes, GEOMETRY).unwrap())
    }
}

impl Device for FlashInMemory {
    type Error = Misuse;

    fn geometry(&self) -> Geometry {
        GEOMETRY
    }

    fn read(&mut self, at: u32, into: &mut [u8]) -> Result<(), Misuse> {
        self.ram(|ram| ram.read(at, into))
    }

    fn erase(&mut self, at: u32, length: u32) -> Result<(), Misuse> {
        self.ram(|ram| ram.erase(at, length))
    }

    fn program(&mut self, at: u32, bytes: &[u8]) -> Result<(), Misuse> {
        self.ram(|ram| ram.program(at, bytes))
    }
}

pub(crate) struct BoardInMemory {
    now: Micros,
    flash: Bytes,
    pub(crate) from_machine: VecDeque<FromMachine>,
    pub(crate) to_machine: Vec<u8>,
    pub(crate) breaks: usize,
    pub(crate) line: LineParameters,
    from_uplink: VecDeque<u8>,
    to_uplink: Vec<u8>,
}

impl Board for BoardInMemory {
    type Flash = FlashInMemory;
    type Code = Vec<u8>;

    fn now(&mut self) -> Micros {
        self.now
    }

    fn set_line(&mut self, line: &LineParameters) {
        self.line = *line;
    }

    fn hear_machine(&mut self) -> Option<FromMachine> {
        self.from_machine.pop_front()
    }

    fn machine_takes(&mut self) -> bool {
        true
    }

    fn tell_machine(&mut self, byte: u8) {
        self.to_machine.push(byte);
    }

    fn set_break(&mut self, on: bool) {
        self.breaks += usize::from(on);
    }

    fn hear_uplink_byte(&mut self) -> Option<u8> {
        self.from_uplink.pop_front()
    }

    fn tell_uplink_byte(&mut self, byte: u8) -> bool {
        self.to_uplink.push(byte);
        true
    }

    fn code(&self, at: u32, length: u32) -> Vec<u8> {
        self.flash.borrow()[at as usize..][..length as usize].to_vec()
    }
}

pub(crate) struct Shop {
    pub(crate) unit: Unit<BoardInMemory>,
    server: Box<Session<16, 1024>>,
    /// Bytes of the uplink that are no whole frame yet.
    rest: Vec<u8>,
    waiting: VecDeque<Vec<u8>>,
    /// Messages as they are shown by `Debug`.
    pub(crate) heard: Vec<String>,
    flash: Bytes,
    starts: u64,
    /// Each byte of the uplink whose number is a multiple of this is altered.
    pub(crate) alter_each: Option<usize>,
    carried: usize,
}

impl Shop {
    pub(crate) fn new() -> Self {
        let flash = Rc::new(RefCell::new(vec![0xFF; GEOMETRY.size as usize]));
        let unit = start(&flash, 1);
        let mut shop = Self {
            unit,
            server: Box::new(Session::new(Role::Server, Identity(77))),
            rest: Vec::new(),
            waiting: VecDeque::new(),
            heard: Vec::new(),
            flash,
            starts: 1,
            alter_each: None,
            carried: 0,
        };
        shop.connect();
        shop
    }

    fn connect(&mut self) {
        let now = self.unit.board_mut().now();
        *self.server = Session::new(Role::Server, Identity(77 + self.starts));
        self.server.call(now);
        self.say(&ToUnit::Query {});
        self.until("Told");
    }

    /// The unit begins anew, with what its flash holds.
    pub(crate) fn lose_power(&mut self) {
        self.starts += 1;
        self.unit = start(&self.flash, self.starts);
        self.heard.clear();
        self.rest.clear();
        self.connect();
    }

    pub(crate) fn say(&mut self, message: &ToUnit<'_>) {
        let mut buffer = [0; PAYLOAD];
        let length = softplug_unit_protocol::Encode::encode(message, &mut buffer).unwrap();
        self.waiting.push_back(buffer[..length].to_vec());
    }

    /// Downloads a module and has it run, with these settings.
    pub(crate) fn run(&mut self, module: &[u8], settings: &[u8]) {
        let digest = Sha256::digest(module).into();
        let length = module.len() as u32;
        self.say(&ToUnit::Download { link: 0, length, digest, signature: &[] });
        self.until("Downloaded");
        for (nth, bytes) in module.chunks(900).enumerate() {
            self.say(&ToUnit::Piece { link: 0, at: nth as u32 * 900, bytes });
            self.until("Downloaded");
        }
        self.say(&ToUnit::Install { link: 0 });
        self.until("Installed");
        self.say(&ToUnit::Open { link: 0, digest, settings });
    }

    /// A job with all its data.
    pub(crate) fn begin(&mut self, job: u64, program: &[u8]) {
        let size = program.len() as u64;
        self.say(&ToUnit::Begin { link: 0, job, kind: 0, size, check: false, fields: &[] });
        let mut at = 0;
        while at < program.len() {
            let until = self.until_credit(at);
            let end = until.min(at + 900).min(program.len());
            let bytes = &program[at..end];
            self.say(&ToUnit::Data { link: 0, job, pass: 0, at: at as u64, bytes });
            at = end;
        }
        self.say(&ToUnit::End { link: 0, job, pass: 0, size });
    }

    fn until_credit(&mut self, beyond: usize) -> usize {
        for _ in 0..MOST_ROUNDS {
            let credit = self.heard.iter().rev().find(|message| message.starts_with("Credit"));
            let until = credit.and_then(|credit| credit.split("until: ").nth(1));
            let until = until.and_then(|until| until.split(' ').next()?.parse().ok()).unwrap_or(0);
            if until > beyond {
                return until;
            }
            self.round();
        }
        panic!("no credit beyond {beyond}: {:?}", self.heard);
    }

    /// The next message in which this stands; those before it are forgotten.
    pub(crate) fn until(&mut self, what: &str) -> String {
        for _ in 0..MOST_ROUNDS {
            if let Some(at) = self.heard.iter().position(|message| message.contains(what)) {
                return self.heard.drain(..=at).next_back().unwrap();
            }
            self.round();
        }
        panic!("{what} never came: {:?}", self.heard);
    }

    pub(crate) fn rounds(&mut self, count: usize) {
        (0..count).for_each(|_| self.round());
    }

    fn round(&mut self) {
        let board = self.unit.board_mut();
        board.now = board.now + ROUND;
        let now = board.now;
        self.rest.append(&mut board.to_uplink);
        self.server.handle_timeout(now);
        while let Some(message) = self.waiting.front()
            && self.server.has_room(message.len())
        {
            self.server.send(&softplug_unit_protocol::Encoded(message)).unwrap();
            self.waiting.pop_front();
        }
        let mut frame = [0; 2_048];
        while let Some(length) = self.server.poll_transmit(now, &mut frame) {
            for &byte in &frame[..length] {
                self.carried += 1;
                let is_altered =
                    self.alter_each.is_some_and(|each| self.carried.is_multiple_of(each));
                let byte = if is_altered { byte ^ 0x40 } else { byte };
                self.unit.board_mut().from_uplink.push_back(byte);
            }
        }
        self.unit.turn();
        while let Ok(Some(length)) = length_of_frame(&self.rest)
            && self.rest.len() >= length
        {
            let frame: Vec<u8> = self.rest.drain(..length).collect();
            assert!(Frame::decode(&frame).is_ok_and(|frame| frame.kind != FrameKind::Refuse));
            if let Ok(Some(payload)) = self.server.receive(now, &frame) {
                for message in Messages::<ToServer<'_>>::new(payload) {
                    let message = message.unwrap();
                    self.heard.push(format!("{message:?}"));
                    if let ToServer::DeliveryEnded { delivery, size, .. } = message {
                        let stored =
                            ToUnit::Stored { link: 0, delivery, until: size, is_whole: true };
                        self.say(&stored);
                    }
                }
            }
        }
    }

    /// What the machine has received.
    pub(crate) fn received(&self) -> &[u8] {
        &self.unit.board().to_machine
    }

    pub(crate) fn machine_says(&mut self, bytes: &[u8]) {
        let said = bytes.iter().map(|byte| FromMachine::Byte(*byte));
        self.unit.board_mut().from_machine.extend(said);
    }
}

fn start(flash: &Bytes, identity: u64) -> Unit<BoardInMemory> {
    let board = BoardInMemory {
        now: Micros::ZERO,
        flash: Rc::clone(flash),
        from_machine: VecDeque::new(),
        to_machine: Vec::new(),
        breaks: 0,
        line: LineParameters::new(0),
        from_uplink: VecDeque::new(),
        to_uplink: Vec::new(),
    };
    let options = Options {
        name: "unit",
        link: "machine",
        serial: 9,
        identity: identity << 32,
        baud: 19_200,
        trust: Trust::unsigned_too(&[]),
        most_erases: 10_000,
        room: Room { memory_bytes: 40 * 1_024, stack_slots: 1_024, call_depth: 64 },
    };
    Unit::start(board, FlashInMemory(Rc::clone(flash)), options).unwrap()
}

/// A plug-in as it was built for tests.
pub(crate) fn built(name: &str) -> Vec<u8> {
    let folder = std::env::var_os("SOFTPLUG_PLUGINS").filter(|folder| !folder.is_empty());
    let beside = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../target/plugins");
    let file = folder.map_or_else(beside, PathBuf::from).join(format!("{name}.wasm"));
    fs::read(&file)
        .unwrap_or_else(|_| panic!("there is no {}: run `cargo xtask build`", file.display()))
}
