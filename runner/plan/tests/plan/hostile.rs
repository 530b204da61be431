//! Files that mean no shop: each is refused in one sentence, with its place.

use std::fmt::Write as _;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use softplug_plan::{Bus, MOST_FILE_BYTES, Shop, Wrong};

const BUS: &str = "[bus]\nrate = 250_000\nefficiency = 0.4\nswitch = \"2ms\"\n";

fn machine(name: &str) -> String {
    format!(
        "[[machine]]\nname = \"{name}\"\nrate = 19200\nefficiency = 0.8\nconsumes = 6000\nbuffer = 256\n"
    )
}

fn refusal(text: &str) -> String {
    Shop::parse(text).expect_err(text).to_string()
}

#[test]
fn a_usual_file_is_read() {
    let text = format!("{BUS}margin = 0.1\n{}count = 3\n{}", machine("mill"), machine("lathe"));
    let shop = Shop::parse(&text).unwrap();
    let bus = Bus { rate: 250_000.0, efficiency: 0.4, switch: 0.002, margin: 0.1 };
    assert_eq!(shop.bus(), &bus);
    let names: Vec<_> = shop.each().map(|(name, _)| name).collect();
    assert_eq!(names, ["mill-1", "mill-2", "mill-3", "lathe"]);
}

#[test]
fn each_slip_is_told_with_its_place() {
    let good = format!("{BUS}{}", machine("mill"));
    let cases = [
        ("rate = 250_000", "rate = nan"),
        ("rate = 250_000", "rate = inf"),
        ("rate = 250_000", "rate = -inf"),
        ("rate = 250_000", "rate = 0"),
        ("rate = 250_000", "rate = 1e300"),
        ("rate = 250_000", "rate = \"fast\""),
        ("rate = 250_000", "rate = [1]"),
        ("efficiency = 0.4", "efficiency = 1.01"),
        ("efficiency = 0.4", "efficiency = 0"),
        ("efficiency = 0.4", "efficiency = 1e-300"),
        ("switch = \"2ms\"", "switch = 2"),
        ("switch = \"2ms\"", "switch = \"2\""),
        ("switch = \"2ms\"", "switch = \"-2ms\""),
        ("switch = \"2ms\"", "switch = \"61s\""),
        ("switch = \"2ms\"", "switch = \"2min\""),
        ("switch = \"2ms\"", "switch = \"12345678901234567890123456s\""),
        ("switch = \"2ms\"", "switch = \"\\u001b[2Jms\""),
        ("switch = \"2ms\"", "switsh = \"2ms\""),
        ("switch = \"2ms\"", "switch = \"2ms\"\nmargin = 1"),
        ("switch = \"2ms\"", "switch = \"2ms\"\nmargin = 0"),
        ("switch = \"2ms\"", "switch = \"2ms\"\nswitch = \"3ms\""),
        ("switch = \"2ms\"\n", ""),
        ("consumes = 6000", "consumes = -6000"),
        ("consumes = 6000", "consumes = -nan"),
        ("consumes = 6000", "consume = 6000"),
        ("consumes = 6000", "colour = 6000"),
        ("buffer = 256", "buffer = 0"),
        ("buffer = 256", "buffer = -1"),
        ("buffer = 256", "buffer = 2.5"),
        ("buffer = 256", "buffer = 9223372036854775807"),
        ("buffer = 256", "buffer = 92233720368547758070"),
        ("buffer = 256", "buffer = -92233720368547758070"),
        ("buffer = 256", "buffer = 9999999999999999999999999999999999999999999"),
        ("buffer = 256", "buffer = 0xffff_ffff_ffff_ffff_ffff_ffff_ffff_ffff_ff"),
        ("buffer = 256", "buffer = 256.0"),
        ("buffer = 256", "buffer = 1e30"),
        ("buffer = 256", "buffer = nan"),
        ("buffer = 256", "buffer = \"256\""),
        ("buffer = 256", "buffer = 256\ncount = 1.0"),
        ("buffer = 256", "buffer = 256\ncount = -1"),
        ("buffer = 256", "buffer = 256\ncount = 0"),
        ("buffer = 256", "buffer = 256\ncount = 1001"),
        ("buffer = 256", "buffer = 256\ncount = 9223372036854775807"),
        ("buffer = 256", "buffer = 256\ncount = 1e3"),
        ("\"mill\"", "\"\""),
        ("\"mill\"", "\" \""),
        ("\"mill\"", "7"),
        ("\"mill\"", "\"mi\\nll\""),
        ("\"mill\"", "\"mi\\u202ell\""),
        ("\"mill\"", "\"mi\\ufffell\""),
        ("\"mill\"", "\"mi\\uffffll\""),
        ("\"mill\"", "\"mi\\ufdd0ll\""),
        ("\"mill\"", "\"mi\\U0001fffell\""),
        ("[bus]", "[buss]"),
        ("[[machine]]", "[machine]"),
        ("[[machine]]", "[[machines]]"),
        ("[bus]", "[bus"),
    ];
    let mut said = String::new();
    for (from, to) in cases {
        assert!(good.contains(from), "{from}");
        let refusal = refusal(&good.replacen(from, to, 1));
        assert!(!refusal.chars().any(char::is_control), "{refusal:?}");
        writeln!(said, "{:<44} {refusal}", to.replace('\n', " / ")).unwrap();
    }
    insta::assert_snapshot!(said);
}

#[test]
fn what_only_shows_together_is_told_too() {
    assert_eq!(refusal(""), "1:1: missing field `bus`; add a table [bus]");
    assert_eq!(refusal(BUS), "1:1: there are no machines; add a table [[machine]] for each");
    let twice = format!("{BUS}{}{}", machine("a"), machine("a"));
    assert_eq!(
        refusal(&twice),
        "12:8: there are two machines \"a\"; rename one, and mind that a `count` makes NAME-1, NAME-2 and so on"
    );
    let made_twice = format!("{BUS}{}{}count = 2\n", machine("a-2"), machine("a"));
    assert!(refusal(&made_twice).contains("12:8: there are two machines \"a-2\""));
    let many: String = (0..3).map(|n| machine(&format!("m{n}")) + "count = 999\n").collect();
    assert!(
        refusal(&format!("{BUS}{many}"))
            .contains("there are 2997 machines; a bus is planned for at most 1000")
    );
    let long = machine(&"x".repeat(65));
    assert!(refusal(&format!("{BUS}{long}")).contains("is no name; give 1 to 64 characters"));
    let comment = format!("{BUS}{}#{}", machine("a"), "x".repeat(MOST_FILE_BYTES));
    assert!(matches!(Shop::parse(&comment).unwrap_err().wrong, Wrong::TooLong { .. }));
    assert!(refusal(&comment).starts_with("the file has more than 262144 bytes; "));
}

#[test]
fn nothing_that_is_deep_or_broken_ends_otherwise_than_in_a_refusal() {
    let deep = format!("{BUS}x = {}1{}", "[".repeat(50_000), "]".repeat(50_000));
    let tables = format!("[{}a]", "a.".repeat(40_000));
    for text in [
        &deep,
        &tables,
        "\u{feff}",
        "\0",
        "=",
        "[[machine]]",
        "machine = 1",
        "bus = 1",
        "machine = [1]",
    ] {
        assert!(!refusal(text).is_empty());
    }
    // Any prefix, and any byte put out, is a shop or a refusal.
    let good = format!("{BUS}{}", machine("mill"));
    for at in 0..good.len() {
        let _ = Shop::parse(&good[..at]);
        let without: String =
            good.chars().enumerate().filter(|(n, _)| *n != at).map(|(_, c)| c).collect();
        let _ = Shop::parse(&without);
    }
}

#[test]
fn damaged_files_are_shops_or_refusals() {
    let good = format!("{BUS}margin = 0.1\n{}count = 3\n", machine("mill"));
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut shops = 0;
    for _ in 0..5_000 {
        let mut bytes = good.clone().into_bytes();
        for _ in 0..=random.next_u32() % 4 {
            let at = random.next_u32() as usize % bytes.len();
            bytes[at] =
                b"0123456789-.eE\"'[]{}=#\n\\ \x00\x7fanifbxum"[random.next_u32() as usize % 35];
        }
        let Ok(text) = String::from_utf8(bytes) else { continue };
        match Shop::parse(&text) {
            Ok(shop) => {
                shops += 1;
                assert!(shop.load().is_finite() && shop.each().count() <= 1_000);
            }
            Err(error) => assert!(!error.to_string().chars().any(char::is_control), "{error:?}"),
        }
    }
    assert!(shops > 100, "{shops}");
}
