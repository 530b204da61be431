//! `gateway.toml`: what may stand in it, and what is said of what may not.
#![cfg(target_os = "linux")]

use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;
use std::time::Duration;

use softplug_abi::Micros;
use softplug_live::endpoint::{EndpointKind, Framing};
use softplug_live::units::TlsPrivateKey;
use softplug_live::{Flow, PortSpec};
use softplug_service::config::{Config, ConfigError, LogFormat, PortConfig, SwapPolicy};

const FULL: &str = r#"
[gateway]
state = "/var/lib/softplug"
library = "plugins"
programs = ["programs", "/srv/nc"]
threads = 2
real-time-priority = 1
log = "json"
stop = "finish"

[http]
listen = "127.0.0.1:8118"
tokens = "tokens.toml"
upload-bytes = "32 MiB"

[supervision]
faults = 3
within = "5m"

[defaults]
plugin = "xon-xoff@0.1"
line = "19200 7E2"
settings = { stop-level = 64, wait_for_xon = true }

[[link]]
name = "lathe-1"
port = "/dev/ttyUSB0"
flow = "device"
settings = { stop-level = 32 }
search = ["lathes", "common"]
buffer = { size = 16384, low = 4096, high = "12 KiB" }
endpoint = { listen = "127.0.0.1:4001", kind = "rfc2217", gap = "20ms" }
watchdog = { no-bytes = "10m" }
swap = "follow"

[[link]]
name = "mill"
port = "tcp://moxa:4001"
line = "8N1"
plugin = "r3964"
"#;

fn parse(text: &str) -> Result<Config, ConfigError> {
    Config::parse(Path::new("shop/gateway.toml"), text)
}

/// Each problem as `line:column: message; hint`.
fn problems(text: &str) -> Vec<String> {
    match parse(text) {
        Err(ConfigError::Wrong(problems)) => problems
            .iter()
            .map(|problem| problem.to_string().replace("shop/gateway.toml:", ""))
            .collect(),
        other => panic!("no problems but {other:?}"),
    }
}

#[test]
fn all_of_it_is_understood() {
    let config = parse(FULL).unwrap();
    assert_eq!(config.gateway.state, Path::new("/var/lib/softplug"));
    assert_eq!(config.gateway.library, Path::new("shop/plugins"));
    assert_eq!(config.gateway.programs[1], Path::new("/srv/nc"));
    assert_eq!(config.gateway.receptions, Path::new("/var/lib/softplug/receptions"));
    assert_eq!(config.gateway.real_time_priority, Some(1));
    assert_eq!(config.gateway.log, LogFormat::Json);
    assert_eq!(config.http.unwrap().limits.upload_bytes, 32 << 20);
    assert_eq!(config.supervision.faults, 3);
    let [lathe, mill] = &config.links[..] else { panic!("two links") };
    assert_eq!(lathe.port, PortConfig::Port(PortSpec::Device("/dev/ttyUSB0".into())));
    assert_eq!(lathe.line_text(), "19200 7E2");
    assert_eq!(lathe.flow, Flow::Device);
    assert_eq!(lathe.plugin, "xon-xoff@0.1");
    let settings: Vec<_> = lathe.settings.iter().collect();
    let expected = [("stop_level", "32"), ("wait_for_xon", "on")];
    assert!(settings.iter().map(|(n, v)| (n.as_str(), v.as_str())).eq(expected), "{settings:?}");
    assert_eq!(lathe.buffer.high, 12_288);
    let endpoint = lathe.endpoint.unwrap();
    assert_eq!(endpoint.kind, EndpointKind::Rfc2217);
    assert_eq!(endpoint.framing, Framing::Gap(Micros::from_millis(20)));
    assert_eq!(lathe.watchdogs.no_bytes, Some(Duration::from_mins(10)));
    assert_eq!(lathe.swap, SwapPolicy::Follow);
    assert_eq!(mill.line_text(), "8N1", "a device server keeps its own rate");
    assert!(mill.settings.is_empty(), "settings belong to the plug-in of the defaults");
    assert_eq!(mill.receive, "mill");
}

#[test]
fn a_machine_stands_in_for_what_a_link_does_not_say() {
    let link = "[[link]]\nname = \"a\"\nport = \"/dev/ttyS0\"\nmachine = \"haas-vf\"\n";
    let of = |more: &str| {
        let config = parse(&format!("{link}{more}")).unwrap();
        let link = &config.links[0];
        let settings: Vec<_> =
            link.settings.iter().map(|(name, value)| format!("{name}={value}")).collect();
        (link.plugin.clone(), link.line_text(), settings.join(" "))
    };
    let is = |plugin: &str, line: &str, settings: &str| {
        (plugin.to_owned(), line.to_owned(), settings.to_owned())
    };
    assert_eq!(of(""), is("xon-xoff", "9600 7E2", "send_line_end=crlf"));
    assert_eq!(
        of("plugin = \"xon-xoff@0.1\"\nline = \"19200 7E1\"\n\
            settings = { send-line-end = \"lf\", xon_at_open = true }\n"),
        is("xon-xoff@0.1", "19200 7E1", "send_line_end=lf xon_at_open=on")
    );
    let defaults = "[defaults]\nplugin = \"r3964\"\nline = \"8E1\"\nsettings = { priority = 1 }\n";
    assert_eq!(of(defaults), is("xon-xoff", "9600 7E2", "send_line_end=crlf"));

    let told = |from: &str, to: &str| problems(&link.replace(from, to)).join("|");
    assert_eq!(
        told("haas-vf", "hass-vf"),
        "4:11: there is no machine \"hass-vf\"; did you mean \"haas-vf\"?"
    );
    assert_eq!(
        told("machine", "plugin = \"r3964\"\nmachine"),
        "4:10: the machine haas-vf is spoken to with xon-xoff; leave out `plugin`, or `machine`"
    );
    let told = problems(&format!("[gateway]\nmachines = \"nowhere\"\n{link}")).join("|");
    assert!(told.starts_with("2:12: shop/nowhere cannot be read: "), "{told}");
}

#[test]
fn an_empty_file_is_a_gateway_without_links() {
    let config = parse("").unwrap();
    assert!(config.links.is_empty() && config.http.is_none() && config.gateway.watch);
    assert_eq!(parse("[http]").unwrap().http.unwrap().listen.to_string(), "127.0.0.1:8117");
}

#[test]
fn every_problem_has_its_place_and_a_hint() {
    let link = |rest: &str| format!("[[link]]\nname = \"a\"\nplugin = \"x\"\n{rest}\n");
    let cases = [
        ("[gateway]\nthreds = 2\n", "2:1: unknown field `threds`, "),
        ("[[link]\n", "1:"),
        ("[gateway]\nthreads = \"two\"\n", "2:11: invalid type: string \"two\", expected u16; "),
        ("[gateway]\nthreads = 0\n", "2:11: threads is 0; give at least 1"),
        ("[gateway]\nreal-time-priority = 100\n", "2:22: there is no such real-time priority; "),
        ("[gateway]\nstop = \"prak\"\n", "2:8: \"prak\" is not known here; did you mean \"park\"?"),
        ("[http]\nlisten = \"0.0.0.0:80\"\n", "2:10: 0.0.0.0:80 can be reached from elsewhere"),
        (
            "[http]\nlisten = \"10.0.0.1:80\"\ntokens = \"t\"\n",
            "2:10: 10.0.0.1:80 can be reached from elsewhere, and tokens would pass in the clear; ",
        ),
        ("[http]\nlisten = \"gateway:80\"\n", "2:10: \"gateway:80\" is not an address and a port"),
        ("[http]\nkey = \"key.pem\"\n", "2:7: certificate and key go together"),
        ("[http]\nburst = 0\n", "2:9: it is 0"),
        ("[supervision]\nwithin = \"5\"\n", "2:10: \"5\" is not a span of time; write a number"),
        ("[[link]]\nport = \"pty:\"\n", "1:1: this link has no name; add a line"),
        (&link(""), "1:1: the link \"a\" has no port; add a line"),
        ("[[link]]\nname = \"../a\"\n", "2:8: \"../a\" cannot name a link; use 1 to 64"),
        (&link("port = \"COM3\""), "4:8: `COM3` names no port; give a device"),
        (&link("port = \"simulate:r3965\""), "4:8: \"r3965\" is no machine to simulate; did you"),
        (&link("port = \"pty:\"\nline = \"9600 9N1\""), "5:8: `9N1` is not a form of characters; "),
        (&link("port = \"pty:\"\ndepth = 0"), "5:9: so many characters cannot be in flight; "),
        (&link("port = \"pty:\"\nsearch = [\"a/b\"]"), "5:11: \"a/b\" cannot name a folder; use"),
        (&link("port = \"pty:\"\nsettings = { a = 1.5 }"), "5:18: the setting \"a\" has no such"),
        (
            &link("port = \"pty:\"\nbuffer = { low = 9, high = 9 }"),
            "5:10: the marks do not fit: size 16384, low 9, high 9; low must",
        ),
        (&link("port = \"pty:\"\nbuffer = { size = \"1T\" }"), "5:19: this is not a number of by"),
        (&link("port = \"pty:\"\nendpoint = { kind = \"raw\" }"), "5:12: the endpoint has no addr"),
        ("[defaults]\nport = \"pty:\"\n", "2:8: port cannot be the same for all links; move"),
    ];
    for (text, expected) in cases {
        let found = problems(text);
        assert!(found[0].starts_with(expected), "{text}\n{found:#?}");
        assert!(found[0].contains("; "), "a hint is missing: {found:#?}");
    }
}

#[test]
fn links_may_not_be_in_each_others_way() {
    let two = |one: &str, other: &str| {
        let one = format!("[[link]]\nplugin = \"x\"\n{one}\n");
        problems(&format!("{one}[[link]]\nplugin = \"x\"\n{other}\n"))
    };
    let found = two("name = \"a\"\nport = \"pty:\"", "name = \"A\"\nport = \"pty:\"");
    assert!(found[0].starts_with("7:8: there are two links \"A\"; "), "{found:?}");
    let port = "line = \"9600\"\nport = \"/dev/ttyS0\"";
    let found = two(&format!("name = \"a\"\n{port}"), &format!("name = \"b\"\n{port}"));
    assert!(found[0].contains("the link \"a\" has the same port /dev/ttyS0; "), "{found:?}");
    let end = "port = \"pty:\"\nendpoint = { listen = \"127.0.0.1:4001\" }";
    let found = two(&format!("name = \"a\"\n{end}"), &format!("name = \"b\"\n{end}"));
    assert!(found[0].contains("the endpoint of \"a\" listens on 127.0.0.1:4001 too"), "{found:?}");
    let found =
        two("name = \"a\"\nport = \"pty:\"\nreceive = \"b\"", "name = \"b\"\nport = \"pty:\"");
    assert!(found[0].contains("receives into the same folder \"b\""), "{found:?}");
}

#[test]
fn all_problems_are_told_at_once() {
    let found = problems("[gateway]\nthreads = 0\nstop = \"x\"\n[[link]]\n[[link]]\nname = \"\"\n");
    assert_eq!(found.len(), 4, "{found:#?}");
}

#[test]
fn what_changed_is_seen_key_by_key() {
    let one = parse(FULL).unwrap();
    let other = parse(&FULL.replace("size = 16384", "size = 32768").replace("\"8N1\"", "\"7E1\""));
    let other = other.unwrap();
    assert_eq!(one.links[0].changed_keys(&other.links[0]), ["buffer"]);
    assert_eq!(one.links[1].changed_keys(&other.links[1]), ["line"]);
    let moved = parse(&format!("\n\n{FULL}")).unwrap();
    assert_eq!(one, moved, "where something is written says nothing of what it is");
}

#[test]
fn files_that_cannot_be_read_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("gateway.toml");
    let error = Config::read(&missing).unwrap_err();
    assert!(error.to_string().starts_with(&format!("{} cannot be read", missing.display())));
    std::fs::write(&missing, [0xFF, 0xFE, b'a']).unwrap();
    assert!(matches!(Config::read(&missing), Err(ConfigError::Unreadable { .. })));
}

#[test]
fn what_is_wrong_with_keys_of_units_is_told_in_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let key = folder.path().join("gateway.key");
    let own = TlsPrivateKey::make(&key).unwrap().public().to_string();
    let unit = "MCowBQYDK2VwAyEAGb9ECWmEzf6FQbrBZ9w7lshQhqowtrbLDFw4rXAxZuE=";
    let head = format!("[gateway]\nkey = \"{}\"\n", key.display());
    let link = |name: &str, port: &str, key: &str| {
        let key = if key.is_empty() { String::new() } else { format!("unit-key = \"{key}\"\n") };
        format!("[[link]]\nname = \"{name}\"\nplugin = \"xon-xoff\"\nport = \"{port}\"\n{key}")
    };
    let (mill, saw) = ("unit://10.0.0.17:7640/mill", "unit://10.0.0.17:7640/saw");
    let right = [head.clone(), link("a", mill, unit), link("b", saw, unit)].concat();
    let config = parse(&right).unwrap();
    assert!(config.links.iter().all(|link| link.tls.is_some()));
    assert_eq!(config, parse(&right).unwrap());
    let cases = [
        (
            link("a", mill, unit),
            "the link \"a\" has a unit-key, and the gateway has no key; make one",
        ),
        (
            head.clone() + &link("a", mill, "unit.key"),
            "\"unit.key\" is no public key; write the text",
        ),
        (head.clone() + &link("a", mill, &own), "is the gateway's own key; name the unit's"),
        (
            head.clone() + &link("a", "unit://can0/17", unit),
            "\"a\" is not of a unit over TCP, and has",
        ),
        (
            head.clone() + &link("a", "pty:", unit),
            "\"a\" is not of a unit over TCP, and has a unit-key",
        ),
        (
            head.clone() + &link("a", mill, unit) + &link("b", saw, ""),
            "the links \"a\" and \"b\" are of the unit 10.0.0.17:7640, and have not the same unit-key",
        ),
        (
            format!("{head}[defaults]\nunit-key = \"{unit}\"\n") + &link("a", mill, unit),
            "unit-key cannot be the same for all links",
        ),
        (
            head.replace("gateway.key", "none.key") + &link("a", mill, unit),
            "none.key cannot be read; No such file",
        ),
    ];
    for (text, wanted) in cases {
        let told = problems(&text).join("|");
        assert!(told.contains(wanted) && !told.contains('|'), "{told}\n{wanted}");
    }
    std::fs::set_permissions(&key, std::fs::Permissions::from_mode(0o644)).unwrap();
    let told = problems(&right).join("|");
    let wanted =
        "gateway.key can be read or written by others than its owner (mode 644); `chmod 600";
    assert!(told.contains(wanted) && !told.contains('|'), "{told}");
}

proptest::proptest! {
    /// Whatever stands in the file, it is a configuration or a list of problems.
    #[test]
    fn no_text_panics(at in 0_usize..FULL.len(), cut in 0_usize..40, put in ".{0,8}") {
        let mut text = FULL.to_owned();
        let floor = |mut at: usize| { while !FULL.is_char_boundary(at) { at -= 1; } at };
        let (from, to) = (floor(at), floor((at + cut).min(FULL.len())));
        text.replace_range(from..to, &put);
        if let Err(error) = parse(&text) {
            proptest::prop_assert!(!error.to_string().is_empty());
        }
    }
}

const BUS: &str = "[[bus]]\nname = \"can0\"\nrate = 250_000\nefficiency = 0.4\nswitch = \"2ms\"\n";

#[test]
fn a_units_link_is_on_the_bus_that_it_names_or_that_of_its_can_interface() {
    let link = |name: &str, rest: &str| {
        format!("[[link]]\nname = \"{name}\"\nplugin = \"xon-xoff\"\n{rest}\n")
    };
    let text = [
        BUS.to_owned(),
        link("a", "port = \"unit://10.0.0.17:7640/mill\"\nbus = \"can0\""),
        link("b", "port = \"unit://can0/17\""),
        link("c", "port = \"unit://can1/17\""),
        link("d", "port = \"unit://10.0.0.18:7640/mill\""),
    ];
    let config = parse(&text.concat()).unwrap();
    let buses: Vec<_> = config.links.iter().map(|link| link.bus.as_deref()).collect();
    assert_eq!(buses, [Some("can0"), Some("can0"), None, None]);
    let [bus] = &config.buses[..] else { panic!("{:?}", config.buses) };
    assert_eq!((bus.name.as_str(), bus.rates.rate, bus.rates.switch), ("can0", 250_000.0, 0.002));
    assert_eq!(bus.rates.payload() as u64, 100_000);
    for (written, micros) in [("250us", 250), ("0.5s", 500_000), ("0ms", 0)] {
        let config = parse(&BUS.replace("2ms", written)).unwrap();
        assert_eq!((config.buses[0].rates.switch * 1e6).round() as u64, micros, "{written}");
    }
}

#[test]
fn what_a_bus_cannot_have_is_told_in_one_sentence() {
    let with = |from: &str, to: &str| problems(&BUS.replace(from, to)).join("|");
    let cases = [
        (with("name = \"can0\"\n", ""), "this bus has no name; add a line such as"),
        (with("can0", "can/0"), "\"can/0\" cannot name a bus; use 1 to 64 letters"),
        (with("rate = 250_000\n", ""), "the bus \"can0\" has no rate; add a line such as"),
        (with("switch = \"2ms\"\n", ""), "the bus \"can0\" has no switch; add a line such as"),
        (with("250_000", "0"), "0 does not do here; give bits per second from 1 to 1e12"),
        (with("0.4", "1.5"), "1.5 does not do here; give data bits of all bits, from 0.001 to 1"),
        (with("2ms", "soon"), "\"soon\" is no time to switch in; give a number and a unit"),
        (with("2ms", "61s"), "\"61s\" is no time to switch in; give a number and a unit"),
        (problems(&BUS.repeat(2)).join("|"), "there are two buses \"can0\"; give each a name"),
    ];
    for (told, wanted) in cases {
        assert!(told.contains(wanted) && !told.contains('|'), "{told}\n{wanted}");
    }
    let link =
        "[[link]]\nname = \"a\"\nplugin = \"xon-xoff\"\nport = \"unit://10.0.0.17:7640/mill\"\n";
    let told = problems(&format!("{BUS}{link}bus = \"can1\"\n")).join("|");
    assert!(told.contains("there is no bus \"can1\"; did you mean"), "{told}");
    let told = problems(&format!("{link}bus = \"can1\"\n")).join("|");
    assert!(told.contains("there is no bus \"can1\"; add one: [[bus]]"), "{told}");
    let local = link.replace("unit://10.0.0.17:7640/mill", "pty:");
    let told = problems(&format!("{BUS}{local}bus = \"can0\"\n")).join("|");
    assert!(told.contains("the link \"a\" is no unit's, and on no bus; take `bus` away"), "{told}");
}

#[test]
fn a_drop_folder_is_one_links_and_no_other_folder() {
    let link = |name: &str, drop: &str| {
        format!(
            "[[link]]\nname = \"{name}\"\nport = \"/dev/{name}\"\nplugin = \"xon-xoff\"\ndrop = {drop}\n"
        )
    };
    let config = parse(
        &(link("a", "{ folder = \"in/a\" }")
            + &link(
                "b",
                "{ folder = \"./x/../in/b\", settle = \"0s\", look = \"1m\", largest = \"2 MiB\" }",
            )),
    )
    .unwrap();
    let drops: Vec<_> = config.links.iter().map(|link| link.drop.clone().unwrap()).collect();
    assert_eq!(drops[0].folder, Path::new("shop/in/a"));
    assert_eq!((drops[0].settle, drops[0].poll), (Duration::from_secs(5), Duration::from_secs(2)));
    assert_eq!(drops[0].largest, 64 << 20);
    assert_eq!(drops[1].folder, Path::new("shop/in/b"));
    assert_eq!((drops[1].settle, drops[1].poll), (Duration::ZERO, Duration::from_mins(1)));

    let place = "give each drop folder a place of its own, within no other and around none";
    let cases = [
        ("{}", "the drop folder is not named; add folder = \"drop/lathe-1\"".to_owned()),
        ("{ folder = \" \" }", "this cannot name a folder; name one: \"drop/lathe-1\"".to_owned()),
        (
            "{ folder = \"in\" }",
            format!("the folder shop/in/a is the drop folder of \"a\" already; {place}"),
        ),
        (
            "{ folder = \"in/a\" }",
            format!("the folder shop/in/a is the drop folder of \"a\" already; {place}"),
        ),
        (
            "{ folder = \"programs/b\" }",
            format!("the folder shop/programs is a folder of programs already; {place}"),
        ),
        (
            "{ folder = \"state/x/../b\" }",
            format!("the folder shop/state is the gateway's state already; {place}"),
        ),
        (
            "{ folder = \"b\", settle = \"25h\" }",
            "a file would settle for more than a day; give at most 24h".to_owned(),
        ),
        (
            "{ folder = \"b\", look = \"1ms\" }",
            "a folder is not looked into so often; give 100ms to 1h".to_owned(),
        ),
        (
            "{ folder = \"b\", largest = 0 }",
            "0 bytes do not do here; give 1 to 1099511627776 bytes".to_owned(),
        ),
    ];
    for (drop, problem) in cases {
        let found = problems(&(link("a", "{ folder = \"in/a\" }") + &link("b", drop)));
        let [found] = &found[..] else { panic!("{drop}: {found:?}") };
        assert!(found.ends_with(&format!(": {problem}")), "{drop}: {found}");
    }
    let defaults = problems("[defaults]\ndrop = { folder = \"in\" }\n");
    assert_eq!(
        defaults,
        ["2:8: a drop folder cannot be the same for all links; move it to the links"]
    );
}

#[test]
fn a_link_has_the_notations_of_its_machine_or_its_own_before_the_known_ones() {
    let link = |more: &str| {
        let text = format!("[[link]]\nname = \"a\"\nport = \"/dev/a\"\n{more}\n");
        parse(&text).unwrap().links[0].names.clone()
    };
    let own = link("plugin = \"xon-xoff\"\nnames = [\"({name})\"]");
    assert_eq!(own.name_in(b"%\n(PART A)\nO1\n").as_deref(), Some("PART A"));
    assert_eq!(own.name_in(b"%\nO1\n").as_deref(), Some("O1"));
    let machine = link("machine = \"siemens-840d\"");
    assert_eq!(machine.name_in(b"%_N_L1_SPF\n").as_deref(), Some("L1_SPF"));
    assert_eq!(link("plugin = \"xon-xoff\"").name_in(b"(PART A)\n"), None);
    let found = problems(
        "[[link]]\nname = \"a\"\nport = \"/dev/a\"\nplugin = \"xon-xoff\"\nnames = [\"O1234\"]\n",
    );
    assert_eq!(
        found,
        [
            "5:10: \"O1234\" is no notation of a name; write one {number} or {name} into it, as in O{number} or <{name}>"
        ]
    );
}

#[test]
fn what_a_port_does_by_itself_fits_its_kind() {
    let link = |port: &str, flow: &str| {
        format!(
            "[[link]]\nname = \"a\"\nport = \"{port}\"\nplugin = \"xon-xoff\"\nline = \"9600 8N1\"\nflow = \"{flow}\"\n"
        )
    };
    for (port, flow) in [
        ("/dev/ttyS0", Flow::RtsCts),
        ("/dev/ttyS0", Flow::Rs485),
        ("rfc2217://moxa:4001", Flow::RtsCts),
        ("rfc2217://moxa:4001", Flow::DsrDtr),
        ("tcp://moxa:4001", Flow::Device),
    ] {
        assert_eq!(parse(&link(port, flow.name())).unwrap().links[0].flow, flow);
    }
    assert_eq!(
        problems(&link("/dev/ttyS0", "dsr-dtr")),
        ["6:8: this port has no DSR/DTR flow control, which the kernel does not know; lead the \
          machine's DTR to our CTS and take rts-cts, or use a device server (rfc2217://)"]
    );
    assert_eq!(problems(&link("tcp://moxa:4001", "rts-cts")).len(), 1);
    assert_eq!(problems(&link("rfc2217://moxa:4001", "rs-485")).len(), 1);
    let unknown = problems(&link("/dev/ttyS0", "rts"));
    assert_eq!(unknown, ["6:8: \"rts\" is not known here; did you mean \"rts-cts\"?"]);
}
