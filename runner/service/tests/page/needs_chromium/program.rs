//! A program is something to look at: its text, the way of the tool, where the cut is; and what was
//! received beside it.

use std::fmt::Write as _;
use std::fs;

use serde_json::{Value, json};

use crate::common::bench::Bench;
use crate::page::browser::Browser;
use crate::page::picture::Picture;

/// A square with round corners and a hole, and a cycle that is not drawn.
const PLATE: &str = "%\r\nO7 (PLATE)\r\nG21 G17 G90\r\nG0 X0. Y10. Z5.\r\nG1 Z-2. F300\r\n\
    Y50.\r\nG2 X10. Y60. R10.\r\nG1 X90. F600\r\nG2 X100. Y50. J-10.\r\nG1 Y10.\r\nG2 X90. Y0. R10.\r\n\
    G1 X10.\r\nG2 X0. Y10. R10.\r\nG0 Z5.\r\nG81 X50. Y30. Z-5. R2. F100\r\nG80\r\nM30\r\n%\r\n";

fn open(bench: &Bench, page: &str) -> Browser {
    let mut browser = Browser::open();
    browser.size(1280, 1300);
    browser.go(&bench.url(&format!("/#/{page}")));
    browser.until("document.activeElement?.name === 'token'");
    browser.type_text(&bench.operator);
    browser.press("Enter");
    browser.until("document.querySelector('nav a[aria-current]')");
    browser
}

fn keep(browser: &mut Browser, name: &str) {
    if let Some(folder) = std::env::var_os("SOFTPLUG_PICTURES") {
        fs::write(std::path::Path::new(&folder).join(name), browser.screenshot()).unwrap();
    }
}

/// Colours of the picture of the way: of its canvas alone.
const INK: &str = "(() => { const canvas = document.querySelector('.toolpath canvas'); \
    const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height); \
    let ink = 0; for (let at = 3; at < data.length; at += 4) ink += data[at] > 40; return ink; })()";

#[test]
fn text_and_way_are_shown_and_belong_together() {
    let bench = Bench::new();
    bench.upload("plate.nc", PLATE.as_bytes()).with(201);
    let mut browser = open(&bench, "programs");
    browser.click("td a", "plate.nc");
    for text in ["O7 (PLATE)", "100 × 60 × 7 mm, from X0 Y0 Z-2 to X100 Y60 Z5", "18 lines"] {
        browser.sees(text);
    }
    browser.sees("cycles (G81): 1 time, first in line 15");
    browser.until(&format!("{INK} > 500"));
    let label = browser.value("document.querySelector('canvas.over').getAttribute('aria-label')");
    assert_eq!(label, "Tool path of plate.nc: 100 × 60 × 7 mm");

    // A line of the remarks leads to the text.
    browser.click("button.link", "line 15");
    let chosen = "document.querySelector('.listing .chosen .number')?.textContent";
    browser.until(&format!("{chosen} === '15'"));
    // By the keys, with what is read aloud.
    browser.value("document.querySelector('.listing').focus()");
    let press = |browser: &mut Browser, key: &str| {
        let event = format!(
            "document.activeElement.dispatchEvent(new KeyboardEvent('keydown', {{ key: '{key}', bubbles: true, cancelable: true }}))"
        );
        browser.value(&event);
    };
    press(&mut browser, "Home");
    press(&mut browser, "ArrowDown");
    browser.until(&format!("{chosen} === '2'"));
    let read = "document.getElementById(document.activeElement.getAttribute('aria-activedescendant')).textContent";
    assert!(browser.value(read).as_str().unwrap().contains("O7 (PLATE)"));

    // Each view shows something else, larger is larger, and a click on the way finds its line.
    browser.value("document.querySelector('canvas.over').focus()");
    let mut seen = Vec::new();
    for view in ["1", "2", "3", "4", "5"] {
        press(&mut browser, view);
        browser.value("new Promise((go) => setTimeout(go, 100))");
        seen.push(browser.value("document.querySelector('.toolpath canvas').toDataURL()"));
    }
    seen.dedup();
    assert_eq!(seen.len(), 5, "views that look alike");
    press(&mut browser, "1");
    browser.value("new Promise((go) => setTimeout(go, 100))");
    let place = browser.value(
        "(() => { const canvas = document.querySelector('.toolpath canvas'); canvas.scrollIntoView({ block: 'center' }); \
         const { x, y, width, height } = canvas.getBoundingClientRect(); \
         const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height); \
         const row = Math.round(canvas.height / 2); let at = canvas.width - 1; \
         while (at > 0 && data[4 * (row * canvas.width + at) + 3] < 100) at -= 1; \
         return [x + at * width / canvas.width, y + row * height / canvas.height]; })()",
    );
    for what in ["mousePressed", "mouseReleased"] {
        browser.call(
            "Input.dispatchMouseEvent",
            json!({ "type": what, "x": place[0], "y": place[1], "button": "left", "clickCount": 1 }),
        );
    }
    // The right side of the plate.
    browser.until(&format!("{chosen} === '10'"));
    let before = browser.value(INK).as_u64().unwrap();
    press(&mut browser, "-");
    press(&mut browser, "-");
    press(&mut browser, "-");
    browser.until(&format!("{INK} < {before} * 0.8"));
    press(&mut browser, "0");
    browser.until(&format!("Math.abs({INK} - {before}) < {before} * 0.05"));
    keep(&mut browser, "program.png");
    assert_eq!(browser.complaints, Vec::<String>::new());
}

#[test]
fn how_it_is_read_can_be_said() {
    let bench = Bench::new();
    bench.upload("shaft.nc", b"G0 X40 Z2\nG1 Z-10 F.2\nX60 W-10\n").with(201);
    let mut browser = open(&bench, "program/shaft.nc");
    browser.sees("the axis or word W: 1 time, first in line 3");
    browser.sees("numbers without a point: 5 times, first in line 1");
    let set = |browser: &mut Browser, value: &str| {
        browser.value(&format!(
            "(() => {{ const select = document.querySelector('option[value={value}]').parentNode; \
             select.value = '{value}'; select.dispatchEvent(new Event('change')); }})()"
        ));
    };
    set(&mut browser, "lathe");
    browser.sees("from X20 Y0 Z-20 to X30 Y0 Z2");
    let pressed = "document.querySelector('.chip[aria-pressed=true]')?.textContent === 'ZX'";
    browser.until(pressed);
    set(&mut browser, "thousandths");
    browser.sees("from X0.02 Y0 Z-0.02 to X0.03 Y0 Z0.002");
    assert_eq!(browser.complaints, Vec::<String>::new());
}

#[test]
fn signs_that_not_every_control_takes_are_named() {
    let bench = Bench::new();
    let text = "%\nO1 (GR\u{fc}N f\u{fc}r M)\nG1 X10. ;CUT\n\tM30\n\u{14}%\n";
    let program = [text.as_bytes(), b"(\xe4)\n"].concat();
    bench.upload("odd%20name.nc", &program).with(201);
    bench.upload("plain.nc", PLATE.as_bytes()).with(201);
    let mut browser = open(&bench, "program/odd%20name.nc");
    browser.sees("Signs that not every control takes");
    let rows = "[...document.querySelectorAll('table.measured tbody tr')].map((row) => [...row.children].map((cell) => cell.textContent))";
    assert_eq!(
        browser.value(rows),
        json!([
            ["\u{fc}", "2", "line 2", "UE"],
            ["small letters", "2", "line 2", "capitals"],
            [";", "1", "line 3", "–"],
            ["TAB", "1", "line 4", "a space"],
            ["DC4", "1", "line 5", "–"],
            ["byte E4", "1", "line 6", "save the file as plain ASCII"],
        ])
    );
    browser.sees("choose the link above");
    browser.value("location.hash = '#/program/plain.nc'");
    browser.sees("18 lines");
    browser.until("!document.querySelector('table.measured')?.checkVisibility()");
    assert_eq!(browser.complaints, Vec::<String>::new());
}

#[test]
fn the_line_that_leaves_is_shown_in_text_and_way() {
    let bench = Bench::new();
    let blocks = (1..=4_000).fold(String::from("%\nG90\n"), |mut text, n| {
        let angle = f64::from(n) / 20.0;
        let _ =
            writeln!(text, "N{n} G1 X{:.3} Y{:.3} F900", 50.0 * angle.cos(), 50.0 * angle.sin());
        text
    });
    bench.upload("ring.nc", blocks.as_bytes()).with(201);
    bench.until_link("lathe-1", "idle");
    let mut browser = open(&bench, "program/ring.nc");
    browser.sees("4,002 lines");
    let job = bench.post("/links/lathe-1/jobs", &json!({ "program": "ring.nc" })).with(201).json();
    browser.sees("On its way");
    let now = "Number(document.querySelector('.listing .now .number')?.textContent.replace(',', '') ?? 0)";
    browser.until(&format!("{now} > 60"));
    let first = browser.value(now).as_u64().unwrap();
    browser.until(&format!("{now} > {first} + 20"));
    // What is marked is what the gateway tells: neither ahead of it nor far behind.
    let line = browser.value(now).as_u64().unwrap();
    let view = bench.get(&format!("/jobs/{}", job["id"])).with(200).json();
    let left = view["surely_left"].as_u64().unwrap() as usize;
    let lines = blocks[..left].matches('\n').count() as u64;
    assert!(line <= lines + 1, "line {line} is marked, {lines} have left");
    browser.until("document.querySelector('.listing .left .sign').textContent === '✓'");
    browser.until("document.querySelector('.runs code').textContent.startsWith('N')");
    // The way up to there has another colour; so has the place itself.
    let colours = "(() => { const canvas = document.querySelector('canvas.over'); \
        const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height); \
        let red = 0; for (let at = 0; at < data.length; at += 4) red += data[at] > 150 && data[at + 1] < 60 && data[at + 3] > 200; \
        return red; })()";
    browser.until(&format!("{colours} > 60"));
    keep(&mut browser, "program-sent.png");
    bench.post(&format!("/jobs/{}/abort", job["id"]), &json!({})).with(200);
    browser.until("!document.querySelector('.listing .now')");
    assert_eq!(browser.complaints, Vec::<String>::new());
}

#[test]
fn a_program_of_ten_megabytes_has_only_the_lines_in_view_in_the_page() {
    let bench = Bench::new();
    let text = (0..400_000).fold(String::new(), |mut text, n| {
        let _ = writeln!(text, "N{n} G1 X{} Y{} F100", n % 977, n % 1_009);
        text
    });
    assert!(text.len() > 10_000_000, "{}", text.len());
    fs::write(bench.path("programs/long.nc"), &text).unwrap();
    let mut browser = open(&bench, "program/long.nc");
    browser.sees("400,000 lines");
    // While it is read and drawn, the page has its turn.
    browser.sees("Everything in this program was understood.");
    let rows = "document.querySelectorAll('.listing [data-line]').length";
    let shown = browser.value(rows).as_u64().unwrap();
    assert!((10..100).contains(&shown), "{shown} rows");
    let find = |browser: &mut Browser, text: &str| {
        browser.value(&format!(
            "(() => {{ const field = document.querySelector('input[type=search]'); field.value = '{text}'; \
             field.form.requestSubmit(); }})()"
        ));
    };
    find(&mut browser, "399999");
    browser.until("document.querySelector('.listing .chosen').textContent.includes('N399998 ')");
    find(&mut browser, "n123456 ");
    browser.until("document.querySelector('.listing .chosen').textContent.includes('N123456 ')");
    assert!(browser.value(rows).as_u64().unwrap() < 100);
    // The bar leads to both ends.
    browser.value("(() => { const list = document.querySelector('.listing'); list.scrollTop = list.scrollHeight; })()");
    browser.until(
        "[...document.querySelectorAll('.listing .number')].at(-1).textContent === '400,000'",
    );
    browser.value("document.querySelector('.listing').scrollTop = 0");
    browser.until("document.querySelector('.listing .number').textContent === '1'");
    assert_eq!(browser.complaints, Vec::<String>::new());
}

#[test]
fn hostile_programs_are_only_shown() {
    let bench = Bench::new();
    let mark = "<img src=x onerror=document.title='owned'>";
    let mut hostile = format!("{mark}\n(\u{202e}G1\u{0}\u{7}) \u{200b}\n").into_bytes();
    hostile.extend_from_slice(&[0xff, 0xfe, b'\n']);
    hostile.extend(std::iter::repeat_n(b'X', 900_000));
    bench.upload("hostile.nc", &hostile).with(201);
    bench.upload("empty.nc", b"\n").with(201);
    let mut browser = open(&bench, "program/hostile.nc");
    browser.sees(mark);
    browser.sees("⟨U+202E⟩G1⟨NUL⟩⟨BEL⟩");
    browser.sees("899,600 more bytes");
    browser.sees("Nothing to draw");
    assert_eq!(browser.value("document.querySelectorAll('main img').length"), 0);
    assert_ne!(browser.value("document.title"), "owned");
    browser.value("location.hash = '#/program/empty.nc'");
    browser.sees("1 line");
    browser.sees("Nothing to draw");
    for (hash, text) in
        [("%E0%A4%A", "is no name of a program"), ("none.nc", "there is no program")]
    {
        browser.value(&format!("location.hash = '#/program/{hash}'"));
        browser.sees(text);
    }
}

#[test]
fn a_reception_is_shown_beside_what_was_sent() {
    let bench = Bench::new();
    bench.upload("O7.nc", PLATE.as_bytes()).with(201);
    let received = PLATE
        .replace("\r\n", "\n")
        .replace("Y50.\nG2 X10. Y60. R10.", "Y55.\nG2 X10. Y60. R10.")
        .replace("G1 Z-2. F300\n", "G1  Z-2.  F300\n")
        .replace("G21 G17 G90\n", "g21 g17 g90\n")
        .replace("G80\n", "")
        .replace("G81 X50.", "(<b>SHIFT 2</b>)\nG81 X50.");
    let folder = bench.path("state/receptions/lathe-1");
    fs::create_dir_all(&folder).unwrap();
    fs::write(folder.join("O7"), format!("\0\0\0\u{12}{received}\u{14}")).unwrap();
    fs::write(folder.join("O8"), PLATE).unwrap();
    let mut browser = open(&bench, "link/lathe-1");
    browser.until("document.querySelector('a[aria-label=\"Compare O7\"]')");
    browser.value("document.querySelector('a[aria-label=\"Compare O7\"]').click()");
    for text in [
        "They differ in 3 lines.",
        "1 line says something else",
        "1 line is missing in what was received",
        "1 line is in what was received only",
        "1 line differs only in small and capital letters",
        "1 line differs only in spaces",
        "lines end with CR LF in what was sent, with LF in what was received",
        "before the program stands NUL 3 times, DC2 in what was received, nothing in what was sent",
        "behind the program stands DC4 in what was received",
        "(<b>SHIFT 2</b>)",
    ] {
        browser.sees(text);
    }
    assert_eq!(browser.value("document.querySelectorAll('main b').length"), 0);
    let row = |kind: &str| format!("document.querySelector('tr.is-{kind} .sent')?.textContent");
    assert_eq!(browser.value(&row("changed")), "Y50.");
    assert_eq!(browser.value(&row("missing")), "G80");
    let marks =
        "[...document.querySelectorAll('tr.is-changed mark')].map((mark) => mark.textContent)";
    assert_eq!(browser.value(marks), json!(["0", "5"]));
    keep(&mut browser, "compare.png");
    for scheme in ["light", "dark"] {
        browser.prefer(scheme);
        browser.size(360, 740);
        for page in ["compare/lathe-1%2FO7", "program/O7.nc"] {
            browser.value(&format!("location.hash = '#/{page}'"));
            browser.until("document.querySelector('.differences tr, .listing [data-line]')");
            browser.value("new Promise((go) => setTimeout(go, 300))");
            assert!(browser.overhang() <= 0, "{page} is wider than a phone");
            let picture = Picture::read(&browser.screenshot());
            assert_eq!(picture.brightness() < 100, scheme == "dark", "{page}");
        }
    }
    browser.size(1280, 900);
    browser.value("location.hash = '#/compare/lathe-1%2FO8'");
    browser.until("document.querySelector('main h1').textContent === 'O8, compared'");
    browser.until("document.querySelector('main select').options.length > 0");
    browser.sees("The same, byte for byte.");
    assert_eq!(browser.complaints, Vec::<String>::new());
}

/// The same lines cut up by chance: those that belong together are found, and none is lost.
#[test]
fn every_line_of_both_sides_stands_in_the_comparison_once() {
    let bench = Bench::new();
    let mut browser = Browser::open();
    browser.go(&bench.url("/"));
    browser.until("document.activeElement?.name === 'token'");
    let wrong = browser.value(
        "import('/page/differences.js').then(({ compare }) => { \
         let seed = 7; const chance = (of) => { seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0; return (seed >>> 8) % of; }; \
         const bytes = (lines) => new TextEncoder().encode(lines.map((line) => `${line}\\n`).join('') + 'END\\n'); \
         const wrong = []; \
         for (let turn = 0; turn < 1500; turn += 1) { \
           const letters = 2 + chance(6); const letter = () => 'ABCDEFGH'[chance(letters)]; \
           const one = Array.from({ length: chance(40) }, letter); const other = one.slice(); \
           let edits = chance(5); const most = edits; \
           while (edits-- > 0) { if (chance(2)) other.splice(chance(other.length + 1), 0, letter()); else other.splice(chance(other.length + 1), 1); } \
           const { counts, lines, rows } = compare(bytes(one), bytes(other)); \
           const paired = counts.same + counts.changed; \
           const isWhole = paired + counts.missing === one.length + 1 && paired + counts.added === other.length + 1; \
           const isHonest = rows.every(({ kind, a, b }) => kind !== 'same' || (one[a] ?? 'END') === (other[b] ?? 'END')); \
           if (!isWhole || !isHonest || (!most && counts.same !== one.length + 1)) wrong.push([one.join(''), other.join(''), counts, lines]); \
         } return wrong; })",
    );
    assert_eq!(wrong, Value::Array(Vec::new()));
}
