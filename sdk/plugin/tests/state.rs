//! `#[derive(State)]`: the bytes, what is taken back, and which field an error tells.

use proptest::prelude::*;
use softplug_abi::{Action, Actions, Event, Instance, LineParameters, Micros, Refusal};
use softplug_plugin::parts::{Answers, Block, Timers};
use softplug_plugin::{Context, Converter, Failure, Native, NativeFault, State, state_format};

#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, State)]
enum Stage {
    #[default]
    Idle,
    Sending,
    #[state(code = 7)]
    Receiving,
    Waiting,
}

softplug_plugin::timers! {
    enum Timer {
        Answer,
        Character,
    }
}

#[derive(Copy, Clone, Debug, Default, State)]
#[state(check = Self::is_sound)]
struct Line {
    timers: Timers<Timer, 2>,
    answers: Answers<4>,
    text: Block<6>,
    #[state(within = 0..=3)]
    repeats: u32,
    /// So many of the text have been sent.
    given: u16,
}

impl Line {
    fn is_sound(&self) -> bool {
        usize::from(self.given) <= self.text.len()
    }
}

/// The latest of three formats.
#[derive(Debug, Default, State)]
struct Plugin {
    stage: Stage,
    stopping: Option<Failure>,
    flags: [bool; 2],
    #[state(skip)]
    heard: usize,
    line: Line,
    #[state(since = 2)]
    sent: u64,
    #[state(since = 3)]
    began: Micros,
    #[state(since = 3)]
    end: End,
}

/// A field that is written by hand.
#[derive(Debug, Default)]
struct End;

impl State for End {
    fn save(&self, state: &mut softplug_plugin::StateWriter<'_>) {
        state.bytes(b"!");
    }

    fn restore(&mut self, state: &mut softplug_plugin::StateReader<'_>) {
        if state.u8() != b'!' {
            state.refuse();
        }
    }
}

impl Converter for Plugin {
    type Settings = ();
    const MANIFEST: &'static str = "";

    fn new((): ()) -> Self {
        Self::default()
    }

    fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        self.stage = Stage::Waiting;
        self.stopping = Some(Failure::NoAnswer);
        self.flags = [false, true];
        self.heard += bytes.len();
        self.line.timers.set(link, Timer::Character, Some(Micros(0x0203)));
        self.line.text.extend(bytes);
        self.line.repeats = 2;
        self.line.given = 1;
        self.sent = 9;
        self.began = Micros(5);
        while link.transmit_room() > 0 {
            self.line.answers.say(link, b"a");
        }
        self.line.answers.say(link, b"bc");
    }

    state_format!(3, accepts 1..=3);
}

fn opened() -> Native<Plugin> {
    let mut native = Native::new();
    let line = LineParameters::new(9_600);
    let open = Event::Open { resumed: false, line, transmit_room: 8, delivery_room: 8 };
    native.step(&open, Micros::ZERO).unwrap();
    native
}

fn saved(native: &mut Native<Plugin>) -> Vec<u8> {
    let output = native.step(&Event::Save, Micros::ZERO).unwrap();
    let mut state = Vec::new();
    for action in Actions::new(output.actions) {
        let Ok(Action::Saved { format: 3, bytes, .. }) = action else { panic!("{action:?}") };
        state.extend(bytes);
    }
    state
}

/// What a fault says is wrong.
fn place(fault: NativeFault) -> String {
    let text = fault.wrong.expect("it names something").to_string();
    text.strip_prefix("the saved state cannot be taken: ").unwrap().to_owned()
}

fn restored(format: u16, state: &[u8]) -> Result<Native<Plugin>, NativeFault> {
    let mut native = Native::new();
    let event = Event::Restore { format, offset: 0, total: state.len() as u32, bytes: state };
    native.step(&event, Micros::ZERO)?;
    Ok(native)
}

const NO_TIMER: [u8; 9] = [0; 9];
const TIMER: [u8; 9] = [1, 3, 2, 0, 0, 0, 0, 0, 0];

/// As the table of `State` says.
fn expected() -> Vec<u8> {
    [
        [8, 2, 0, 0, 1].as_slice(),
        &NO_TIMER,
        &TIMER,
        &[2, b'b', b'c'],
        &[4, 0, b'G', b'1', b'X', b'9'],
        &[2, 0, 0, 0, 1, 0],
        &[9, 0, 0, 0, 0, 0, 0, 0],
        &[5, 0, 0, 0, 0, 0, 0, 0, b'!'],
    ]
    .concat()
}

/// Where each field ends, and its name.
const FIELDS: [(usize, &str); 12] = [
    (1, "Plugin.stage"),
    (3, "Plugin.stopping"),
    (5, "Plugin.flags"),
    (23, "Line.timers"),
    (26, "Line.answers"),
    (32, "Line.text"),
    (36, "Line.repeats"),
    (38, "Line.given"),
    // Read as zero, what is not there is sound together: no word of the whole structure.
    (38, "Line"),
    (46, "Plugin.sent"),
    (54, "Plugin.began"),
    (55, "Plugin.end"),
];

#[test]
fn every_type_has_its_bytes() {
    let mut native = opened();
    native.step(&Event::Received(b"G1X9"), Micros::ZERO).unwrap();
    let state = saved(&mut native);
    assert_eq!(state, expected());
    assert_eq!(saved(&mut restored(3, &state).unwrap()), state);
}

#[test]
fn what_is_missing_is_told_by_name() {
    let state = expected();
    for length in 0..state.len() {
        let fault = restored(3, &state[..length]).unwrap_err();
        let (_, name) = FIELDS.iter().find(|(end, _)| length < *end).unwrap();
        assert_eq!(fault.refusal, Refusal::State);
        assert_eq!(
            fault.to_string(),
            format!("refused: {} (the saved state cannot be taken: {name})", Refusal::State.text())
        );
    }
    let fault = restored(3, &[state.as_slice(), b"?"].concat()).unwrap_err();
    assert_eq!(place(fault), "its end");
}

#[test]
fn what_cannot_be_is_told_by_name() {
    let wrong = [
        (0, 2, "Plugin.stage"),
        (0, 6, "Plugin.stage"),
        (1, 200, "Plugin.stopping"),
        (4, 2, "Plugin.flags"),
        (5, 2, "Line.timers"),
        (23, 5, "Line.answers"),
        (26, 7, "Line.text"),
        (32, 4, "Line.repeats"),
        (36, 5, "Line"),
        (54, b'?', "Plugin.end"),
    ];
    for (at, byte, name) in wrong {
        let mut state = expected();
        state[at] = byte;
        assert_eq!(place(restored(3, &state).unwrap_err()), name, "{at}");
    }
    // The first one counts.
    let mut state = expected();
    (state[0], state[54]) = (2, b'?');
    assert_eq!(place(restored(3, &state).unwrap_err()), "Plugin.stage");
}

#[test]
fn older_formats_lack_fields() {
    let state = expected();
    let old = |format, length| saved(&mut restored(format, &state[..length]).unwrap());
    let zeros = |from: usize, end: &[u8]| [&state[..from], &vec![0; 54 - from], end].concat();
    assert_eq!(old(1, 38), zeros(38, b"!"));
    assert_eq!(old(2, 46), zeros(46, b"!"));
    for format in [0, 4] {
        let fault = restored(format, &state).unwrap_err();
        assert_eq!(place(fault), "its format");
    }
}

proptest! {
    #[test]
    fn what_is_taken_is_saved_again(state in proptest::collection::vec(0..=9_u8, 20..60)) {
        if let Ok(mut native) = restored(3, &state) {
            // The time of a timer that is not set does not matter.
            let state = saved(&mut native);
            prop_assert_eq!(saved(&mut restored(3, &state).unwrap()), state);
        }
    }

    #[test]
    fn damage_is_taken_as_a_whole_or_refused(at in 0..55_usize, byte: u8) {
        let mut state = expected();
        state[at] = byte;
        if let Ok(mut native) = restored(3, &state) {
            // The time of a timer that is not set does not matter.
            let state = saved(&mut native);
            prop_assert_eq!(saved(&mut restored(3, &state).unwrap()), state);
        }
    }
}
