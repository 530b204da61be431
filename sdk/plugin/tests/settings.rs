//! Settings and manifest from one declaration, and settings as they arrive.

use softplug_abi::manifest::{Manifest, OwnedValue, SettingError, ValueType};
use softplug_abi::{Event, Instance, Micros, Refusal, Value, ValueWriter, Values};
use softplug_plugin::bench::{Bench, BenchError};
use softplug_plugin::{
    Bytes, Context, Converter, LineParameters, Native, NativeFault, Opening, Text, choice,
    manifest, settings,
};

choice! {
    /// How lines end.
    pub enum LineEnd {
        /// As they are.
        Keep = "keep",
        Lf = "lf",
        CrLf = "cr-lf",
    }
}

settings! {
    /// One of each type.
    pub struct Settings {
        echo: bool = true, "A flag.";
        offset: i64 = -5 in -10..=600000 "ms", "A number with a unit.";
        count: i64 = 3 in 1..=9 "", "A number without.";
        plain: i64 = 7, "A number without a range.";
        trailer: Bytes<4> = "0d 0a", "Bytes.";
        name: Text<8> = "axis", "A text.";
        line_end: LineEnd = "cr-lf", "A choice.";
    }
}

/// Names its settings as its state.
#[derive(Debug)]
struct Teller(Settings);

impl Converter for Teller {
    type Settings = Settings;
    const MANIFEST: &'static str = manifest! {
        head: r#""abi":"1.0","name":"teller","version":"1","licence":"MIT","protocol":"p","description":"d""#,
        settings: Settings,
        tail: r#""jobs":[{"name":"send","text":"t"}]"#,
    };

    fn check_settings(settings: &Settings) -> Result<(), &'static str> {
        if settings.count == 9 { Err("nine is too many; take eight") } else { Ok(()) }
    }

    fn new(settings: Settings) -> Self {
        Self(settings)
    }

    fn opened(&mut self, link: &mut Context<'_>, _opening: &Opening) {
        let Settings { echo, offset, count, plain, trailer, name, line_end } = self.0;
        let (trailer, name) = (trailer.as_slice(), name.as_str());
        link.state(&format!("{echo} {offset} {count} {plain} {trailer:?} {name} {line_end:?}"));
    }
}

/// Without settings, and so without a list of them.
#[derive(Debug)]
struct Bare;

impl Converter for Bare {
    type Settings = ();
    const MANIFEST: &'static str = manifest! {
        head: r#""abi":"1.0","name":"bare","version":"1","licence":"MIT","protocol":"p","description":"d""#,
        settings: (),
    };

    fn new((): ()) -> Self {
        Self
    }
}

#[test]
fn the_manifest_lists_every_setting_in_order() {
    let manifest = Manifest::parse(Teller::MANIFEST.as_bytes()).unwrap();
    let kinds: Vec<_> =
        manifest.settings.iter().map(|setting| (setting.name.as_str(), setting.kind)).collect();
    let expected = [
        ("echo", ValueType::Bool),
        ("offset", ValueType::Int),
        ("count", ValueType::Int),
        ("plain", ValueType::Int),
        ("trailer", ValueType::Bytes),
        ("name", ValueType::Text),
        ("line_end", ValueType::Choice),
    ];
    assert_eq!(kinds, expected);
    let by_name = |name| manifest.settings.iter().find(|setting| setting.name == name).unwrap();
    let offset = by_name("offset");
    assert_eq!((offset.min, offset.max, offset.unit.as_str()), (Some(-10), Some(600_000), "ms"));
    assert_eq!(offset.text, "A number with a unit.");
    let count = by_name("count");
    assert_eq!((count.min, count.max, count.unit.as_str()), (Some(1), Some(9), ""));
    assert_eq!((by_name("plain").min, by_name("plain").max), (None, None));
    assert_eq!((by_name("trailer").max, by_name("name").max), (Some(4), Some(8)));
    assert_eq!(by_name("line_end").choices, ["keep", "lf", "cr-lf"]);
    assert_eq!(manifest.jobs.len(), 1);

    let values = manifest.resolve_settings([]).unwrap();
    let defaults = [
        OwnedValue::Bool(true),
        OwnedValue::Int(-5),
        OwnedValue::Int(3),
        OwnedValue::Int(7),
        OwnedValue::Bytes(vec![0x0D, 0x0A]),
        OwnedValue::Text("axis".to_owned()),
        OwnedValue::Choice(2),
    ];
    assert_eq!(values.as_slice(), defaults);

    let bare = Manifest::parse(Bare::MANIFEST.as_bytes()).unwrap();
    assert!(bare.settings.is_empty() && bare.jobs.is_empty());
}

#[test]
fn every_type_arrives_in_its_field() {
    let state = |bench: &Bench<Teller>| format!("{:?}", bench.observed());
    let bench = Bench::<Teller>::new().open();
    assert!(state(&bench).contains("true -5 3 7 [13, 10] axis CrLf"), "{}", state(&bench));
    let bench = Bench::<Teller>::new()
        .set("echo", "off")
        .set("offset", "600000")
        .set("count", "0x8")
        .set("plain", "-9223372036854775808")
        .set("trailer", "00ff")
        .set("name", "Ø 12345")
        .set("line_end", "keep")
        .open();
    let expected = "false 600000 8 -9223372036854775808 [0, 255] Ø 12345 Keep";
    assert!(state(&bench).contains(&expected[..40]), "{}", state(&bench));
}

#[test]
fn the_host_refuses_what_the_manifest_rules_out() {
    let refused = |name, value| match Bench::<Teller>::new().set(name, value).try_open() {
        Err(BenchError::Setting(error)) => error,
        other => panic!("{other:?}"),
    };
    assert!(matches!(refused("offset", "-11"), SettingError::Range { .. }));
    assert!(matches!(refused("trailer", "0102030405"), SettingError::Range { .. }));
    assert!(matches!(refused("name", "123456789"), SettingError::Range { .. }));
    assert!(matches!(refused("line_end", "crlf"), SettingError::Type { .. }));
    assert!(matches!(refused("echo", "1"), SettingError::Type { .. }));
    assert!(matches!(refused("shift", "1"), SettingError::Unknown { .. }));
}

/// A settings event with these values.
fn give(
    native: &mut Native<Teller>,
    (first, last): (bool, bool),
    values: &[(u16, Value<'_>)],
) -> Result<(), NativeFault> {
    let mut buffer = [0; 512];
    let mut writer = ValueWriter::new(&mut buffer);
    for (index, value) in values {
        writer.push(*index, *value).unwrap();
    }
    let values = Values::new(writer.written());
    native.step(&Event::Settings { first, last, values }, Micros::ZERO).map(drop)
}

fn open(native: &mut Native<Teller>) -> Result<(), NativeFault> {
    let line = LineParameters::new(9_600);
    let event = Event::Open { resumed: false, line, transmit_room: 64, delivery_room: 64 };
    native.step(&event, Micros::ZERO).map(drop)
}

const WHOLE: (bool, bool) = (true, true);

fn good() -> [(u16, Value<'static>); 7] {
    [
        (0, Value::Bool(true)),
        (1, Value::Int(1)),
        (2, Value::Int(2)),
        (3, Value::Int(3)),
        (4, Value::Bytes(b"1234")),
        (5, Value::Text("12345678")),
        (6, Value::Choice(2)),
    ]
}

#[test]
fn settings_come_complete_in_order_and_of_their_type() {
    let refused = |values: &[(u16, Value<'_>)]| {
        let mut native = Native::new();
        let fault = give(&mut native, WHOLE, values).unwrap_err();
        assert_eq!(fault.refusal, Refusal::Settings);
        // It does not open with what it refused.
        assert_eq!(open(&mut native).unwrap_err().refusal, Refusal::MalformedEvent);
        fault.words
    };
    let order = "a setting is of another type or order";
    let missing = "a setting has no value";
    let with = |at: usize, value| {
        let mut values = good();
        values[at].1 = value;
        values
    };
    assert_eq!(refused(&good()[..6]), missing);
    assert_eq!(refused(&[]), missing);
    assert_eq!(refused(&good()[1..]), order);
    let mut swapped = good();
    swapped.swap(1, 2);
    assert_eq!(refused(&swapped), order);
    assert_eq!(refused(&[good().as_slice(), &[(7, Value::Int(0))]].concat()), order);
    let twice = [&good()[..1], good().as_slice()].concat();
    assert_eq!(refused(&twice), order);
    for at in 0..7 {
        let other = if at == 0 { Value::Int(0) } else { Value::Bool(true) };
        assert_eq!(refused(&with(at, other)), order, "setting {at}");
    }
    assert_eq!(refused(&with(4, Value::Bytes(b"12345"))), order, "longer than it can hold");
    assert_eq!(refused(&with(5, Value::Text("123456789"))), order, "longer than it can hold");
    assert_eq!(refused(&with(6, Value::Choice(3))), order, "no such choice");
    assert_eq!(refused(&with(2, Value::Int(9))), "nine is too many; take eight");
    let fault = give(&mut Native::new(), WHOLE, &with(2, Value::Int(9))).unwrap_err();
    let text = "refused: a setting has a value that the plug-in cannot work with \
                (nine is too many; take eight)";
    assert_eq!(fault.to_string(), text);
}

#[test]
fn settings_come_in_pieces_and_begin_with_a_first_one() {
    let mut native = Native::new();
    let values = good();
    let fault = give(&mut native, (false, true), &values).unwrap_err();
    assert_eq!(fault.refusal, Refusal::MalformedEvent);
    assert_eq!(fault.words, "the first settings are missing");

    give(&mut native, (true, false), &values[..3]).unwrap();
    let fault = open(&mut native).unwrap_err();
    assert_eq!(fault.words, "open came before the settings", "not with a part of them");
    give(&mut native, (false, false), &values[3..5]).unwrap();
    give(&mut native, (false, true), &values[5..]).unwrap();
    open(&mut native).unwrap();

    // A first piece makes it forget all earlier ones.
    let mut native = Native::new();
    give(&mut native, (true, false), &values[..3]).unwrap();
    give(&mut native, WHOLE, &values).unwrap();
    open(&mut native).unwrap();
    // Others can be offered after some were refused.
    let mut native = Native::new();
    give(&mut native, WHOLE, &values[..3]).unwrap_err();
    give(&mut native, WHOLE, &values).unwrap();
    open(&mut native).unwrap();
    // They stay over a close.
    native.step(&Event::Close, Micros::ZERO).unwrap();
    open(&mut native).unwrap();
}

#[test]
fn a_plugin_without_settings_opens_without() {
    let line = LineParameters::new(9_600);
    let event = Event::Open { resumed: false, line, transmit_room: 1, delivery_room: 1 };
    Native::<Bare>::new().step(&event, Micros::ZERO).unwrap();
    let mut native = Native::<Bare>::new();
    let empty = Event::Settings { first: true, last: true, values: Values::new(&[]) };
    native.step(&empty, Micros::ZERO).unwrap();
    native.step(&event, Micros::ZERO).unwrap();
}
