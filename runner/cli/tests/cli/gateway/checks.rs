//! What a gateway tells of a program before it is sent is what the command tells of a file.

use rustix::process::Signal;
use serde_json::Value;

use super::{Gateway, bench, link, token};

#[test]
fn a_link_is_asked_what_would_not_arrive_of_a_program() {
    let bench = bench(&link("lathe", "simulate:xon-xoff").replace("115200 8N1", "9600 7E2"));
    let token = token(&bench);
    let odd = "%\nO1 (Gr\u{f6}\u{df}e)\nG0\tX1\nM30\n%\n";
    for (name, program) in [("odd.nc", odd), ("plain.nc", "%\nO1\nM30\n%\n")] {
        bench.write(&format!("programs/{name}"), program);
        bench.write(name, program);
    }
    let gateway = Gateway::start(&bench);
    let ask = |words: &[&str]| gateway.ask(&bench, &token, words);
    let told = ask(&["link", "check", "lathe", "odd.nc"]).with_code(0).out;
    assert!(
        told.starts_with(
            "odd.nc: 2 of 17 characters do not pass as they are written with xon-xoff"
        ),
        "{told}"
    );
    assert!(told.contains("2:7       a character of this line has 7 bits"), "{told}");
    ask(&["link", "check", "lathe", "odd.nc", "--strict"]).with_code(1);
    let plain = ask(&["link", "check", "lathe", "plain.nc", "--strict"]).with_code(0).out;
    assert!(plain.starts_with("plain.nc passes as it is written with xon-xoff"), "{plain}");
    let of_link = ask(&["link", "check", "lathe", "odd.nc", "--json"]).with_code(0).json();
    let words = ["check", "odd.nc", "--plugin", "xon-xoff", "--line", "9600 7E2", "--json"];
    let of_file = bench.run(&words).with_code(0).json();
    for key in ["result", "line", "bytes", "characters"] {
        assert_ne!(of_link[key], Value::Null, "{of_link:#}");
        assert_eq!(of_link[key], of_file[key], "{key}");
    }
    let none = ask(&["link", "check", "lathe", "none.nc"]);
    assert!(none.code != 0 && none.err.contains("there is no program \"none.nc\""), "{none}");
    let field = ask(&["link", "check", "lathe", "odd.nc", "--field", "x=1"]);
    assert!(field.code != 0 && field.err.contains("\"x\""), "{field}");
    gateway.signal(Signal::TERM);
    let (code, log) = gateway.end();
    assert_eq!(code, Some(0), "{log}");
}
