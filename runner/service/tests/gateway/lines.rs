//! The line of a link: as it is written, as the plug-in names it, and as the port has it.

use std::fs;
use std::net::TcpListener;

use softplug_service::config::{Config, ConfigError};
use softplug_service::gateway::{self, StartError};
use softplug_service::library::Library;
use softplug_service::view::LinkState;

use crate::gateway::journal_says;
use crate::gateway::shop::{Shop, plugins, wait_for};

/// Problems, or remarks, of a configuration with these links.
fn checked(links: &str) -> (Vec<String>, bool) {
    let folder = tempfile::tempdir().unwrap();
    let library = Library::open(&folder.path().join("state/plugins")).unwrap();
    for name in ["xon-xoff", "fanuc-rs232", "r3964"] {
        library.add_file(&plugins().join(format!("{name}.wasm"))).unwrap();
    }
    let file = folder.path().join("gateway.toml");
    fs::write(&file, links).unwrap();
    let (told, is_right) = match gateway::check(&Config::read(&file).unwrap()) {
        Ok(remarks) => (remarks, true),
        Err(StartError::Config(ConfigError::Wrong(problems))) => (problems, false),
        Err(other) => panic!("{other}"),
    };
    let told = told.iter().map(|told| {
        format!("{}:{}: {}; {}", told.place.line, told.place.column, told.message, told.hint)
    });
    (told.collect(), is_right)
}

fn link(name: &str, port: &str, rest: &str) -> String {
    format!("[[link]]\nname = \"{name}\"\nport = \"{port}\"\n{rest}\n")
}

#[test]
fn a_check_says_which_line_is_not_the_protocols() {
    let lathe = link("lathe", "/dev/ttyS7", "plugin = \"fanuc-rs232\"");
    assert_eq!(checked(&lathe), (vec![], true), "it takes the plug-in's");
    let eia = "plugin = \"fanuc-rs232\"\nsettings = { code = \"eia\" }\nline = \"8N2\"";
    assert_eq!(checked(&link("lathe", "/dev/ttyS7", eia)), (vec![], true));
    let other = "plugin = \"fanuc-rs232\"\nline = \"9600 8N1\"";
    let (told, is_right) = checked(&link("lathe", "/dev/ttyS7", other));
    assert!(is_right);
    assert_eq!(
        told,
        ["5:8: the line is 9600 8N1, the protocol's 7E2: a wrong parity bit is not looked at; \
          `line = \"7E2\"`, unless the machine is set otherwise"]
    );
    // A pty and a raw connection have neither.
    for port in ["pty:", "tcp://127.0.0.1:1"] {
        assert_eq!(checked(&link("lathe", port, other)), (vec![], true), "{port}");
    }
}

#[test]
fn a_serial_port_needs_a_rate_from_somebody() {
    let needs =
        |line: &str| format!("a serial port needs a baud rate; add one: `line = \"{line}\"`");
    for (rest, place, line) in [
        ("plugin = \"xon-xoff\"", "1:1", "9600 8N1"),
        ("plugin = \"r3964\"", "1:1", "9600 8E1"),
        ("plugin = \"r3964\"\nline = \"8O1\"", "5:8", "9600 8O1"),
    ] {
        let told = checked(&link("a", "/dev/ttyS7", rest));
        assert_eq!(told, (vec![format!("{place}: {}", needs(line))], false));
    }
    let buderus = "plugin = \"r3964\"\nsettings = { preset = \"buderus\" }";
    assert_eq!(checked(&link("a", "/dev/ttyS7", buderus)), (vec![], true));
}

#[test]
fn a_link_without_a_line_has_the_plug_ins() {
    let shop = Shop::with(2, "plugin = \"fanuc-rs232\"\n");
    let gateway = shop.gateway();
    let line = |name: &str| gateway.link(name).unwrap().port.line;
    assert_eq!(line("link-0"), "4800 7E2");
    // Another line is another port: it is opened anew.
    shop.configure(|text| {
        text.replacen("\"fanuc-rs232\"", "\"fanuc-rs232\"\nsettings = { code = \"eia\" }", 1)
    });
    let view = gateway.reload().unwrap();
    assert_eq!(
        (view.untouched, view.changed[0].keys.as_slice()),
        (1, &["line".into(), "settings".into()][..])
    );
    wait_for("the other line", || line("link-0") == "4800 8N2");
    assert_eq!(line("link-1"), "4800 7E2");
}

#[test]
fn a_port_that_does_not_do_what_was_asked_is_down() {
    let free = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let served = format!(
        "plugin = \"xon-xoff\"\nline = \"115200 8N1\"\n\
         endpoint = {{ listen = \"{free}\", kind = \"rfc2217\" }}\n"
    );
    let shop = Shop::with(1, &served);
    let gateway = shop.gateway();
    let asking = link(
        "far",
        &format!("rfc2217://{free}"),
        "plugin = \"xon-xoff\"\nline = \"9600 7E1\"\nreopen = { first = \"50ms\", longest = \"50ms\" }",
    );
    shop.configure(|text| text + &asking);
    gateway.reload().unwrap();
    let far = || gateway.link("far").unwrap();
    // Until the endpoint listens, nobody answers.
    wait_for("the refusal", || !far().port.differences.is_empty());
    let view = far();
    assert_eq!(view.state, LinkState::Down);
    let reason = view.down.unwrap().reason;
    assert!(reason.contains("does not do what was asked of it"), "{reason}");
    assert_eq!(
        view.port.differences,
        [
            "baud rate: asked for 9600, the port has 115200",
            "data bits: asked for 7, the port has 8",
            "parity: asked for even, the port has none",
        ]
    );
    // Also where nobody answered at first.
    wait_for("the journal", || journal_says(gateway, "asked for 9600, the port has 115200"));
    // It is tried again: set right, it comes up.
    shop.configure(|text| text.replace("9600 7E1", "115200 8N1"));
    gateway.reload().unwrap();
    wait_for("the port", || far().state == LinkState::Idle);
    assert_eq!(far().port.differences, Vec::<String>::new());
}
