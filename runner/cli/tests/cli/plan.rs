//! Planning a bus.

use std::net::TcpListener;

use crate::bench::{Bench, snapshot};

/// A file of the page, which has them all.
fn of_page(name: &str) -> String {
    let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/plan.md");
    let page = std::fs::read_to_string(page).unwrap();
    let (_, behind) = page.split_once(&format!("```toml,file={name}\n")).unwrap();
    behind.split_once("```").unwrap().0.to_owned()
}

fn bench() -> Bench {
    let bench = Bench::new();
    bench.write("shop.toml", of_page("shop.toml"));
    bench.write("more.toml", of_page("shop.toml").replace("count = 16", "count = 17"));
    bench.write("mixed.toml", of_page("mixed.toml"));
    bench
}

#[test]
fn a_shop_that_fits_is_planned_and_simulated() {
    let ran = bench().run(&["plan", "mixed.toml", "--simulate", "10"]).with_code(0);
    snapshot("plan-feasible", ran);
}

#[test]
fn a_shop_that_does_not_fit_is_told_what_would_mend_it() {
    let ran = bench().run(&["plan", "more.toml", "--simulate", "1"]).with_code(1);
    snapshot("plan-infeasible", ran);
}

#[test]
fn a_plan_that_needs_units_that_do_not_pause_says_so() {
    let bench = bench();
    bench.write("one.toml", of_page("shop.toml").replace("count = 16", "count = 1"));
    let ran = bench.run(&["plan", "one.toml", "--simulate", "1"]).with_code(0);
    assert!(ran.out.contains("only if units feed their controls while they are filled"), "{ran}");
}

#[test]
fn machines_get_all_of_it() {
    let bench = bench();
    let plan = bench.run(&["plan", "shop.toml", "--json", "--simulate", "1"]).with_code(0).json();
    assert_eq!(plan["feasible"], true);
    assert_eq!(plan["largest_equal"], 16);
    assert_eq!(plan["machines"].as_array().unwrap().len(), 16);
    assert_eq!(plan["machines"][15]["name"], "mill-16");
    assert_eq!(plan["simulation"]["holds"], true);
    assert!(plan["advice"].is_null());
    let keys = |value: &serde_json::Value| {
        value.as_object().unwrap().keys().cloned().collect::<Vec<_>>().join(" ")
    };
    let refused = bench.run(&["plan", "more.toml", "--json"]).with_code(1).json();
    assert_eq!(keys(&refused), "advice bus changes feasible largest_equal machines");
    assert_eq!(
        keys(&refused["machines"][0]),
        "fill_seconds line_needed_bits_per_second must_feed_while_filled name unit_buffer_bits \
         unit_buffer_max_bits unit_buffer_min_bits violated wait_seconds"
    );
    assert_eq!(keys(&refused["bus"]), "load margin payload_bits_per_second round_seconds");
    assert_eq!(keys(&refused["advice"]), "from machine parameter relative to");
    assert_eq!(refused["machines"][0]["violated"], serde_json::json!([3]));
    assert!(refused["machines"][0]["unit_buffer_bits"].is_null());
    assert_eq!(refused["advice"], refused["changes"][0]);
}

#[test]
fn what_cannot_be_meant_is_refused() {
    let bench = bench();
    bench.write("nan.toml", of_page("shop.toml").replace("6_000 ", "nan "));
    bench.write("bytes.toml", b"\xff\xfe");
    bench.write("long.toml", "#".repeat(300_000));
    // Characters of two bytes, of which the last that is read is cut.
    bench.write("wide.toml", "#".to_owned() + &"\u{e4}".repeat(131_071) + "#\u{e4}\u{e4}");
    let mut all = String::new();
    for file in ["nan.toml", "bytes.toml", "long.toml", "wide.toml", "nowhere.toml", "."] {
        let ran = bench.run(&["plan", file]).with_code(2);
        assert_eq!(ran.out, "");
        all += &ran.err;
    }
    snapshot("plan-refused", all);
    let ran = bench.run(&["plan", "shop.toml", "--svg", "nowhere/a.svg"]).with_code(2);
    assert!(ran.err.contains("nowhere/a.svg"), "{ran}");
}

#[test]
fn hours_are_whole_and_not_too_many() {
    let bench = bench();
    for hours in ["0", "0.5", "1001", "1e9", "nan", "-1", ""] {
        let ran = bench.run(&["plan", "shop.toml", "--simulate", hours]).with_code(2);
        assert!(ran.err.contains("give whole hours from 1 to 1000"), "{hours}: {ran}");
    }
}

/// So many fills that the simulation ends early: nothing is wrong, and not all is known.
#[test]
fn a_simulation_that_ends_early_is_incomplete() {
    let bench = bench();
    bench.write(
        "fast.toml",
        "[bus]\nrate = 1e9\nefficiency = 1\nswitch = \"0us\"\n[[machine]]\nname = \"laser\"\n\
         rate = 1e9\nefficiency = 1\nconsumes = 1e6\nbuffer = 1\n",
    );
    let ran = bench.run(&["plan", "fast.toml", "--simulate", "1000"]).with_code(5);
    let said = "of 1,000 h, 20,000,000 fills: ended early, as no more fills are simulated; no machine ran dry so far";
    assert!(ran.out.contains(said), "{ran}");
    let ran = bench.run(&["plan", "fast.toml", "--simulate", "1000", "--json"]).with_code(5).json();
    assert_eq!(ran["simulation"]["holds"], true);
    assert_eq!(ran["simulation"]["is_complete"], false);
}

#[test]
fn one_fill_is_one() {
    let bench = bench();
    bench.write(
        "slow.toml",
        "[bus]\nrate = 1e6\nefficiency = 1\nswitch = \"2ms\"\n[[machine]]\nname = \"clock\"\n\
         rate = 9600\nefficiency = 0.8\nconsumes = 1\nbuffer = 1_000_000\n",
    );
    let ran = bench.run(&["plan", "slow.toml", "--simulate", "1"]).with_code(0);
    assert!(ran.out.contains("1.0 h, 1 fill: no machine"), "{ran}");
}

#[test]
fn the_picture_never_takes_the_place_of_the_shop() {
    let bench = bench();
    let shop = bench.read("shop.toml");
    let folder = bench.path(".");
    std::os::unix::fs::symlink("shop.toml", folder.join("link.svg")).unwrap();
    std::fs::hard_link(folder.join("shop.toml"), folder.join("hard.svg")).unwrap();
    for target in ["shop.toml", "./shop.toml", "link.svg", "hard.svg"] {
        let ran = bench.run(&["plan", "shop.toml", "--svg", target]).with_code(2);
        assert!(ran.err.contains(&format!("{target} is the file of the shop itself")), "{ran}");
        assert_eq!(bench.read("shop.toml"), shop, "{target}");
    }
    // A picture that is there is drawn anew.
    bench.run(&["plan", "shop.toml", "--svg", "a.svg"]).with_code(0);
    bench.run(&["plan", "shop.toml", "--svg", "a.svg"]).with_code(0);
}

#[test]
fn what_a_margin_makes_fail_is_told_as_such() {
    let bench = bench();
    let slow = of_page("shop.toml").replace("rate = 19_200", "rate = 7_500");
    bench.write("equal.toml", &slow);
    let ran = bench.run(&["plan", "equal.toml"]).with_code(1);
    assert!(ran.out.contains("1: the serial line does not carry more than the control"), "{ran}");
    bench.write("margin.toml", of_page("mixed.toml").replace("margin = 0.1", "margin = 0.8"));
    let ran = bench.run(&["plan", "margin.toml", "--svg", "a.svg"]).with_code(1);
    assert!(ran.out.contains("1: with the margin, the serial line does not carry more"), "{ran}");
    assert!(
        ran.out.contains("buffers   in the picture: the largest that constraint 3 allows"),
        "{ran}"
    );
}

/// Two lines carry less than their controls take, and no control takes less: one change mends one.
#[test]
fn where_no_change_would_do_it_is_said() {
    let bench = bench();
    let machine = |name: &str| {
        format!(
            "[[machine]]\nname = \"{name}\"\nrate = 1\nefficiency = 0.5\nconsumes = 1\nbuffer = 1\n"
        )
    };
    let bus = "[bus]\nrate = 1e6\nefficiency = 1\nswitch = \"0ms\"\n";
    bench.write("slow.toml", format!("{bus}{}{}", machine("a"), machine("b")));
    let ran = bench.run(&["plan", "slow.toml"]).with_code(1);
    assert!(ran.out.contains("mended by no change of one thing alone"), "{ran}");
    let ran = bench.run(&["plan", "slow.toml", "--json"]).with_code(1).json();
    assert!(ran["advice"].is_null() && ran["changes"].as_array().unwrap().is_empty());
}

#[test]
fn colours_can_be_switched_off() {
    let bench = bench();
    let colours =
        |when: &str| bench.run(&["plan", "shop.toml", "--color", when]).out.contains('\x1b');
    assert!(colours("always") && !colours("never"));
}

/// The picture in the documentation is the one that the page's command draws.
#[test]
fn the_picture_of_the_page_is_what_is_drawn() {
    let bench = bench();
    bench.run(&["plan", "mixed.toml", "--svg", "plan.svg"]).with_code(0);
    let drawn = String::from_utf8(bench.read("plan.svg")).unwrap();
    let picture = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/pictures/plan.svg");
    if std::env::var_os("SOFTPLUG_DRAW").is_some() {
        std::fs::write(picture, &drawn).unwrap();
    }
    assert_eq!(drawn, std::fs::read_to_string(picture).unwrap(), "SOFTPLUG_DRAW=1 writes it anew");
}

/// A gateway that answers one question, in this way, and tells what it was asked.
fn gateway(answer: serde_json::Value) -> (String, std::thread::JoinHandle<String>) {
    use std::io::{BufRead as _, BufReader, Write as _};

    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}", listener.local_addr().unwrap());
    let thread = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let lines = BufReader::new(stream.try_clone().unwrap()).lines().map_while(Result::ok);
        let asked: Vec<_> = lines.take_while(|line| !line.is_empty()).collect();
        let body = answer.to_string();
        let head = "HTTP/1.1 200 OK\r\nContent-Type: application/json\r\nConnection: close";
        write!(stream, "{head}\r\nContent-Length: {}\r\n\r\n{body}", body.len()).unwrap();
        asked.join("\n")
    });
    (url, thread)
}

fn bus(name: &str) -> serde_json::Value {
    let unit = |link: &str, consumes: Option<f64>| {
        serde_json::json!({
            "link": link, "port": "unit://can0/17", "level": 0, "buffer": 0, "consumes": consumes, "slots": [],
        })
    };
    serde_json::json!({
        "name": name, "rate": 250_000.0, "efficiency": 0.4, "switch_seconds": 0.002, "serves": null,
        "measured": { "load": 0.9, "efficiency": 0.45, "switch_seconds": 0.0015 },
        "units": [unit("mill-1", Some(5_000.4)), unit("mill-2", Some(5_200.0)), unit("mill-3", None), unit("saw", Some(1.0))],
    })
}

#[test]
fn measured_figures_take_the_place_of_those_of_the_file() {
    let bench = bench();
    bench.write("token", "softplug_1");
    let (url, asked) = gateway(serde_json::json!([bus("can0")]));
    let arguments = ["plan", "more.toml", "--from", &url, "--token-file", "token"];
    let ran = bench.run(&arguments).with_code(0);
    let asked = asked.join().unwrap().to_lowercase();
    assert!(asked.starts_with("get /api/v1/buses "), "{asked}");
    assert!(asked.contains("authorization: bearer softplug_1"), "{asked}");
    for taken in [
        "efficiency of the bus 0.45, in the file 0.4",
        "switch of the bus 1.5ms, in the file 2ms",
        "consumes of mill 5200 bit/s, in the file 6000 bit/s",
    ] {
        assert!(ran.out.contains(taken), "{ran}");
    }
    let (url, asked) = gateway(serde_json::json!([bus("can0"), bus("can1")]));
    let arguments = ["plan", "more.toml", "--from", &url, "--bus", "can1", "--json"];
    let plan = bench.run(&arguments).with_code(0).json();
    asked.join().unwrap();
    assert_eq!(plan["taken"].as_array().unwrap().len(), 3);
    assert_eq!(plan["taken"][2]["machine"], "mill");
    assert_eq!(plan["bus"]["payload_bits_per_second"], 112_500.0);
}

#[test]
fn a_gateway_whose_bus_is_not_clear_is_told() {
    let bench = bench();
    let cases = [
        (serde_json::json!([]), vec![], "the gateway has no bus"),
        (serde_json::json!([bus("a"), bus("b")]), vec![], "the gateway has several buses: a, b"),
        (
            serde_json::json!([bus("a")]),
            vec!["--bus", "c"],
            "the gateway has no bus \"c\"; it has a",
        ),
    ];
    for (answer, more, wanted) in cases {
        let (url, asked) = gateway(answer);
        let arguments = [&["plan", "shop.toml", "--from", &url], &more[..]].concat();
        let ran = bench.run(&arguments).with_code(2);
        asked.join().unwrap();
        assert!(ran.err.contains(wanted), "{ran}");
    }
}

#[test]
fn a_gateway_that_never_answers_is_not_waited_for_without_end() {
    let bench = bench();
    // It takes the connection, and says nothing.
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}", listener.local_addr().unwrap());
    let ran = bench.run(&["plan", "shop.toml", "--from", &url]).with_code(6);
    assert!(ran.err.contains("did not answer in time") && ran.err.contains("--from says"), "{ran}");
    drop(listener);
    let ran = bench.run(&["plan", "shop.toml", "--from", &url]).with_code(6);
    assert!(ran.err.contains("cannot be reached") && ran.err.contains("--from says"), "{ran}");
    assert!(!ran.err.contains("--gateway"), "{ran}");
}
