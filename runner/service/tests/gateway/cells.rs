//! Cells: programs on ptys that wait for each other, start each other and hand axes over.

use softplug_abi::JobId;
use std::fmt::Write as _;
use std::fs;
use std::thread::sleep;
use std::time::Duration;

use softplug_service::Refusal;
use softplug_service::view::{
    CellChannelState, CellMode, CellView, JobFilter, JobOrder, JobState, LinkState, StopHow,
};

use crate::gateway::shop::{Shop, wait_for};
use crate::gateway::{journal_says, send};

const LINE: &str = "plugin = \"xon-xoff\"\nline = \"921600 8N1\"\n";
/// Longer than it takes until something has left that should not.
const A_WHILE: Duration = Duration::from_millis(300);

/// So many links in one cell with an axis.
fn cell(links: usize, more: &str) -> Shop {
    let names: Vec<String> = (0..links).map(|at| format!("\"{}\"", Shop::name(at))).collect();
    let cell = format!(
        "[[cell]]\nname = \"shafts\"\nchannels = [{}]\naxes = [\"GANTRY\"]\n{more}",
        names.join(", ")
    );
    let last = format!("{LINE}{cell}");
    let mut lines = vec![LINE; links - 1];
    lines.push(&last);
    Shop::each("", &lines)
}

/// So many blocks.
fn blocks(count: usize) -> String {
    let mut text = String::new();
    for number in 0..count {
        let _ = writeln!(text, "N{number} G1 X{}.5", number % 97);
    }
    text
}

/// Where programs are sent from, and where the links search for those that are loaded.
fn put(shop: &Shop, name: &str, text: &str) {
    for folder in ["programs", "programs/b"] {
        let folder = shop.path(folder);
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join(name), text).unwrap();
    }
}

fn view(shop: &Shop) -> CellView {
    shop.gateway().cell("shafts").unwrap()
}

fn state(shop: &Shop, at: usize) -> CellChannelState {
    view(shop).channels[at].state
}

fn waits(shop: &Shop, at: usize) {
    wait_for("a channel that waits", || state(shop, at) == CellChannelState::Waits);
}

fn is_done(shop: &Shop, job: u32) {
    wait_for("the job's end", || shop.gateway().job(JobId(job)).unwrap().state == JobState::Done);
}

/// The job of O77 in the second channel, which is paused while the first one starts it.
fn started_while_it_was_paused(shop: &Shop) -> u32 {
    put(shop, "A", "(SOFTPLUG LOAD LINK-1 O77)\n(SOFTPLUG WAIT 1)\n(SOFTPLUG START LINK-1)\n");
    put(shop, "B", "(SOFTPLUG WAIT 1)\n");
    let one = shop.gateway().submit("link-0", &send("A")).unwrap().id;
    let filter = JobFilter { link: Some("link-1".to_owned()), ..JobFilter::default() };
    wait_for("what is loaded", || !shop.gateway().jobs(&filter).unwrap().is_empty());
    let loaded = shop.gateway().jobs(&filter).unwrap()[0].id;
    shop.gateway().pause(JobId(loaded)).unwrap();
    shop.gateway().submit("link-1", &send("B")).unwrap();
    shop.drain_all(|| shop.gateway().job(JobId(one)).unwrap().state == JobState::Done);
    loaded
}

#[test]
fn nothing_behind_a_mark_leaves_before_all_are_there() {
    let shop = cell(3, "");
    let gateway = shop.gateway();
    let (before, behind) = (blocks(500), blocks(300));
    let mark = "(SOFTPLUG WAIT 10 LINK-0 LINK-1 LINK-2)\n";
    let mut ids = Vec::new();
    for at in 0..3 {
        put(&shop, &format!("O{at}"), &format!("{before}{mark}{behind}"));
    }
    let until = before.len() + mark.len();
    for at in 0..3 {
        ids.push(gateway.submit(&Shop::name(at), &send(&format!("O{at}"))).unwrap().id);
        assert_eq!(shop.read(at, until).len(), until);
        if at < 2 {
            waits(&shop, at);
            let channel = &view(&shop).channels[at];
            assert_eq!((channel.words_passed, channel.words), (0, 1));
            assert!(channel.text.starts_with("waits at mark 10 for link-"), "{}", channel.text);
        }
        if at == 2 {
            break;
        }
        sleep(A_WHILE);
        for one in 0..=at {
            assert_eq!(shop.waiting(one), 0, "channel {one} runs ahead");
        }
    }
    for (at, id) in ids.into_iter().enumerate() {
        assert_eq!(shop.read(at, behind.len()), behind.as_bytes());
        is_done(&shop, id);
    }
    assert!(journal_says(
        gateway,
        "shafts: mark 10: link-0, link-1 and link-2 are there and go on"
    ));
    assert_eq!(view(&shop).stuck, []);
}

#[test]
fn blocks_that_the_machine_must_not_get_are_left_out() {
    let shop = cell(2, "words = \"siemens\"\nnotations = { link-1 = \"M100-M110\" }\n");
    let gateway = shop.gateway();
    put(&shop, "A", "G0 X1\nWAITM(101,1,2)\nG0 X2\nM30\n");
    put(&shop, "B", "G0 Z1\nM101 P12\nM30\n");
    let one = gateway.submit("link-0", &send("A")).unwrap().id;
    assert_eq!(shop.read(0, 6), b"G0 X1\n");
    waits(&shop, 0);
    let two = gateway.submit("link-1", &send("B")).unwrap().id;
    assert_eq!(shop.read(1, 10), b"G0 Z1\nM30\n");
    assert_eq!(shop.read(0, 10), b"G0 X2\nM30\n");
    is_done(&shop, one);
    is_done(&shop, two);
    // A word that cannot be understood is told before anything leaves.
    put(&shop, "C", "G0\nWAITM(1,9)\n");
    let refused = gateway.submit("link-0", &send("C")).unwrap_err();
    assert!(
        matches!(&refused, Refusal::Invalid { reason, .. } if reason.contains("block 2: \"9\" is no channel")),
        "{refused}"
    );
}

#[test]
fn a_program_loads_and_starts_another() {
    let shop = cell(2, "");
    let gateway = shop.gateway();
    put(&shop, "O77", &blocks(20));
    let first = "(SOFTPLUG LOAD LINK-1 O77)\nG0 X1\n(SOFTPLUG START LINK-1)\nM30\n";
    put(&shop, "O1", first);
    let one = gateway.submit("link-0", &send("O1")).unwrap().id;
    assert_eq!(shop.read(0, first.len()), first.as_bytes());
    is_done(&shop, one);
    assert_eq!(shop.read(1, blocks(20).len()), blocks(20).as_bytes());
    let filter = JobFilter { link: Some("link-1".to_owned()), ..JobFilter::default() };
    let job = gateway.jobs(&filter).unwrap()[0].clone();
    assert_eq!(job.program.as_deref(), Some("O77"));
    is_done(&shop, job.id);
    assert!(journal_says(gateway, "shafts: link-0 loads O77 into link-1"));
    assert!(journal_says(gateway, "shafts: link-0 starts O77 in link-1"));
    // What is not there is told before anything is sent.
    put(&shop, "O2", "(SOFTPLUG LOAD LINK-1 O99)\n");
    let refused = gateway.submit("link-0", &send("O2")).unwrap_err().to_string();
    assert!(
        refused.contains("block 1: there is no program \"O99\" to load into link-1"),
        "{refused}"
    );
    // Loaded and not started, it waits; and can be taken out of the queue.
    put(&shop, "O3", "(SOFTPLUG LOAD LINK-1 O77)\nM30\n");
    let three = gateway.submit("link-0", &send("O3")).unwrap().id;
    is_done(&shop, three);
    wait_for("what is loaded", || gateway.jobs(&filter).unwrap()[0].id > three);
    let loaded = gateway.jobs(&filter).unwrap()[0].clone();
    sleep(A_WHILE);
    assert_eq!(gateway.job(JobId(loaded.id)).unwrap().state, JobState::Queued);
    gateway.abort(JobId(loaded.id)).unwrap();
    wait_for("an empty place", || view(&shop).channels[1].loaded.is_none());
}

#[test]
fn an_axis_is_waited_for_taken_and_given_back() {
    let shop = cell(2, "");
    let gateway = shop.gateway();
    let long = format!("(SOFTPLUG GET GANTRY)\n{}M30\n", blocks(3_000));
    let other = "(SOFTPLUG GET GANTRY)\nG0 X1\n(SOFTPLUG RELEASE GANTRY)\nM30\n";
    put(&shop, "LONG", &long);
    put(&shop, "OTHER", other);
    let one = gateway.submit("link-0", &send("LONG")).unwrap().id;
    let begun = shop.read(0, 1_000);
    let two = gateway.submit("link-1", &send("OTHER")).unwrap().id;
    waits(&shop, 1);
    assert_eq!(shop.read(1, 22).len(), 22);
    let axis = view(&shop).axes[0].clone();
    assert_eq!((axis.owner.as_deref(), axis.queue), (Some("link-0"), vec!["link-1".to_owned()]));
    // By force: who had it stands, until the other has given it back.
    gateway.force_axis("shafts", "gantry", "link-1").unwrap();
    assert_eq!(shop.read(1, other.len() - 22), &other.as_bytes()[22..]);
    let rest = shop.read(0, long.len() - begun.len());
    assert_eq!([begun, rest].concat(), long.as_bytes());
    is_done(&shop, one);
    is_done(&shop, two);
    assert!(journal_says(gateway, "link-1 takes GANTRY from link-0, which is interrupted"));
    assert_eq!(view(&shop).axes[0].owner, None);
    let refused = gateway.force_axis("shafts", "GANTRY", "link-1").unwrap_err().to_string();
    assert!(refused.contains("link-1 runs none"), "{refused}");
    let refused = gateway.release_axis("shafts", "GANTY").unwrap_err().to_string();
    assert_eq!(refused, "the cell has no axis \"GANTY\"; did you mean \"GANTRY\"?");
}

#[test]
fn who_waits_for_each_other_is_told_at_once() {
    let shop = cell(2, "");
    let gateway = shop.gateway();
    put(&shop, "A", "(SOFTPLUG WAIT 10 LINK-1)\nM30\n");
    put(&shop, "B", "(SOFTPLUG WAIT 20 LINK-0)\nM30\n");
    let one = gateway.submit("link-0", &send("A")).unwrap().id;
    waits(&shop, 0);
    // Nobody runs who would start the other.
    wait_for("a channel that nobody comes to", || view(&shop).stuck.len() == 1);
    assert!(!view(&shop).stuck[0].is_deadlock);
    let two = gateway.submit("link-1", &send("B")).unwrap().id;
    wait_for("a deadlock", || {
        view(&shop).stuck.iter().filter(|stuck| stuck.is_deadlock).count() == 2
    });
    let text = &view(&shop).stuck[0].text;
    assert_eq!(text, "link-0 waits at mark 10 for link-1: end the program of link-0");
    assert!(journal_says(gateway, "shafts: deadlock: link-0 and link-1 wait for each other"));
    gateway.abort(JobId(two)).unwrap();
    wait_for("its end", || gateway.job(JobId(two)).unwrap().ended_ms.is_some());
    assert!(!view(&shop).stuck[0].is_deadlock);
    gateway.abort(JobId(one)).unwrap();
    wait_for("its end", || gateway.job(JobId(one)).unwrap().ended_ms.is_some());
    assert_eq!(view(&shop).stuck, []);
}

#[test]
fn a_group_is_in_one_mode() {
    let shop = cell(2, "groups = { BOTH = [\"link-0\", \"link-1\"] }\n");
    let gateway = shop.gateway();
    let long = blocks(4_000);
    put(&shop, "LONG", &long);
    let one = gateway.submit("link-0", &send("LONG")).unwrap().id;
    let mut got = shop.read(0, 500);
    let refused = gateway.set_mode("shafts", "BOTH", CellMode::Jog).unwrap_err().to_string();
    assert!(refused.contains("link-0 of the group BOTH still run"), "{refused}");
    gateway.set_mode("shafts", "both", CellMode::JogInAuto).unwrap();
    assert_eq!(state(&shop, 0), CellChannelState::Stands);
    wait_for("a line that stands", || {
        let before = got.len();
        got.extend(shop.take_now(0));
        sleep(A_WHILE);
        got.len() == before
    });
    assert!(got.len() < long.len());
    gateway.set_mode("shafts", "BOTH", CellMode::Auto).unwrap();
    got.extend(shop.read(0, long.len() - got.len()));
    assert_eq!(got, long.as_bytes());
    is_done(&shop, one);
    gateway.set_mode("shafts", "BOTH", CellMode::Jog).unwrap();
    let two = gateway.submit("link-1", &send("LONG")).unwrap().id;
    sleep(A_WHILE);
    assert_eq!(gateway.job(JobId(two)).unwrap().state, JobState::Queued);
    gateway.set_mode("shafts", "BOTH", CellMode::Auto).unwrap();
    assert_eq!(shop.read(1, long.len()), long.as_bytes());
    is_done(&shop, two);
    assert_eq!(gateway.link("link-0").unwrap().state, LinkState::Idle);
}

#[test]
fn a_pause_holds_the_others_at_their_mark() {
    let shop = cell(2, "");
    let gateway = shop.gateway();
    let text = format!("{}(SOFTPLUG WAIT 1)\nM30\n", blocks(2_000));
    put(&shop, "A", &text);
    let one = gateway.submit("link-0", &send("A")).unwrap().id;
    gateway.pause(JobId(one)).unwrap();
    let two = gateway.submit("link-1", &send("A")).unwrap().id;
    shop.drain(1, || state(&shop, 1) == CellChannelState::Waits);
    sleep(A_WHILE);
    assert_eq!(view(&shop).channels[0].text, "paused");
    gateway.resume(JobId(one)).unwrap();
    shop.drain_all(|| gateway.job(JobId(two)).unwrap().state == JobState::Done);
    shop.drain_all(|| gateway.job(JobId(one)).unwrap().state == JobState::Done);
}

#[test]
fn an_order_with_a_name_only_is_refused_like_any_other() {
    let shop = cell(2, "");
    let refused = shop.gateway().submit("link-0", &JobOrder::default()).unwrap_err();
    assert!(matches!(refused, Refusal::Invalid { .. }), "{refused}");
}

#[test]
fn a_cell_at_work_keeps_its_links_when_its_name_changes() {
    let shop = cell(2, "");
    let gateway = shop.gateway();
    put(&shop, "A", "(SOFTPLUG WAIT 1)\nM30\n");
    let one = gateway.submit("link-0", &send("A")).unwrap().id;
    waits(&shop, 0);
    shop.configure(|text| text.replace("name = \"shafts\"", "name = \"others\""));
    let changed = gateway.reload().unwrap();
    assert_eq!(changed.needs_restart, ["cell.shafts", "cell.others"]);
    assert_eq!(changed.cells, ["others", "shafts"]);
    let names: Vec<String> = gateway.cells().unwrap().into_iter().map(|cell| cell.name).collect();
    assert_eq!(names, ["shafts"]);
    gateway.abort(JobId(one)).unwrap();
    wait_for("its end", || gateway.job(JobId(one)).unwrap().ended_ms.is_some());
    shop.configure(|text| text.replace("name = \"others\"", "name = \"shafts\""));
    gateway.reload().unwrap();
    let two = gateway.submit("link-1", &send("A")).unwrap().id;
    waits(&shop, 1);
    sleep(A_WHILE);
    assert_eq!(gateway.job(JobId(two)).unwrap().state, JobState::Running, "it waits for nobody");
    assert_eq!(shop.read(1, 18), b"(SOFTPLUG WAIT 1)\n");
    assert_eq!(shop.waiting(1), 0);
}

#[test]
fn a_cell_with_another_name_keeps_its_axes_and_its_mode() {
    let mut shop = cell(2, "");
    put(&shop, "KEEPS", "(SOFTPLUG GET GANTRY)\n(SOFTPLUG WAIT 1)\n");
    put(&shop, "WANTS", "(SOFTPLUG TAKE GANTRY)\nMOVED\n");
    let keeps = shop.gateway().submit("link-0", &send("KEEPS")).unwrap().id;
    wait_for("the axis", || view(&shop).axes[0].owner.is_some());
    waits(&shop, 0);
    shop.gateway().abort(JobId(keeps)).unwrap();
    let owner = |shop: &Shop, name: &str| shop.gateway().cell(name).unwrap().axes[0].owner.clone();
    wait_for("its end", || shop.gateway().job(JobId(keeps)).unwrap().ended_ms.is_some());
    assert_eq!(owner(&shop, "shafts").as_deref(), Some("link-0"));
    shop.gateway().stop(StopHow::Park);
    shop.stopped();
    shop.configure(|text| text.replace("name = \"shafts\"", "name = \"others\""));
    shop.start();
    assert_eq!(owner(&shop, "others").as_deref(), Some("link-0"));
    assert!(journal_says(shop.gateway(), "others: was called shafts"));
    shop.gateway().submit("link-1", &send("WANTS")).unwrap();
    sleep(A_WHILE);
    assert!(!shop.take_now(1).ends_with(b"MOVED\n"));
    // The old name has nothing left: what it was has come along.
    shop.gateway().release_axis("others", "GANTRY").unwrap();
    wait_for("what follows", || shop.take_now(1).ends_with(b"MOVED\n"));
    shop.gateway().stop(StopHow::Park);
    shop.stopped();
    shop.configure(|text| text.replace("name = \"others\"", "name = \"shafts\""));
    shop.start();
    assert_eq!(owner(&shop, "shafts"), None);
}

#[test]
fn all_that_a_cell_at_work_is_divided_into_are_stopped() {
    let mut shop = cell(4, "");
    put(&shop, "KEEPS", "(SOFTPLUG GET GANTRY)\n(SOFTPLUG WAIT 1)\n");
    shop.gateway().submit("link-0", &send("KEEPS")).unwrap();
    wait_for("the axis", || view(&shop).axes[0].owner.is_some());
    shop.gateway().stop(StopHow::Park);
    shop.stopped();
    let one = "name = \"shafts\"\nchannels = [\"link-0\", \"link-1\", \"link-2\", \"link-3\"]\n";
    let two = "name = \"left\"\nchannels = [\"link-0\", \"link-1\"]\n[[cell]]\nname = \"right\"\n\
               channels = [\"link-2\", \"link-3\"]\n";
    shop.configure(|text| {
        assert!(text.contains(one));
        text.replace(one, two)
    });
    shop.start();
    for name in ["left", "right"] {
        assert!(shop.gateway().cell(name).unwrap().is_stopped, "{name}");
    }
}

#[test]
fn a_group_in_jog_is_not_in_auto_after_a_reload() {
    let shop = cell(2, "groups = { BOTH = [\"link-0\", \"link-1\"] }\n");
    shop.gateway().set_mode("shafts", "BOTH", CellMode::Jog).unwrap();
    shop.configure(|text| text.replace("axes = [\"GANTRY\"]", "axes = [\"GANTRY\", \"BAR\"]"));
    assert_eq!(shop.gateway().reload().unwrap().needs_restart, ["cell.shafts"]);
    assert_eq!(view(&shop).groups[0].mode, CellMode::Jog);
}

#[test]
fn a_program_that_loads_one_with_a_wrong_word_is_refused() {
    let shop = cell(2, "");
    put(&shop, "BAD", "(SOFTPLUG WAIT 1 ZZ)\n");
    put(&shop, "A", "G0\n(SOFTPLUG LOAD LINK-1 BAD)\n");
    let refused = shop.gateway().submit("link-0", &send("A")).unwrap_err().to_string();
    assert!(refused.contains("block 2: BAD cannot be loaded into link-1: block 1"), "{refused}");
}

#[test]
fn a_program_that_was_loaded_and_paused_begins_when_it_is_resumed() {
    let shop = cell(2, "");
    let gateway = shop.gateway();
    put(&shop, "O77", "M30\n");
    let loaded = started_while_it_was_paused(&shop);
    assert_eq!(gateway.job(JobId(loaded)).unwrap().state, JobState::Paused);
    gateway.resume(JobId(loaded)).unwrap();
    shop.drain_all(|| gateway.job(JobId(loaded)).unwrap().state == JobState::Done);
    wait_for("an idle cell", || state(&shop, 1) == CellChannelState::Idle);
}

#[test]
fn no_program_begins_while_axes_are_moved_by_hand() {
    let shop = cell(2, "groups = { BOTH = [\"link-0\", \"link-1\"] }\n");
    let gateway = shop.gateway();
    put(&shop, "A", "(SOFTPLUG WAIT 1)\n");
    put(&shop, "NEXT", "G0 X1\n");
    let stands = gateway.submit("link-0", &send("A")).unwrap().id;
    waits(&shop, 0);
    let queued = gateway.submit("link-0", &send("NEXT")).unwrap().id;
    gateway.set_mode("shafts", "BOTH", CellMode::JogInAuto).unwrap();
    // Its place is free then.
    gateway.abort(JobId(stands)).unwrap();
    wait_for("its end", || gateway.job(JobId(stands)).unwrap().state == JobState::Aborted);
    let given = gateway.submit("link-1", &send("NEXT")).unwrap().id;
    sleep(A_WHILE);
    for job in [queued, given] {
        assert_eq!(gateway.job(JobId(job)).unwrap().state, JobState::Queued);
    }
    assert_eq!(shop.take_now(1), b"");
    gateway.set_mode("shafts", "BOTH", CellMode::Auto).unwrap();
    assert_eq!(shop.read(1, 6), b"G0 X1\n");
    is_done(&shop, given);
    is_done(&shop, queued);
}

#[test]
fn a_started_program_that_begins_late_is_held_as_its_group_is() {
    let shop = cell(2, "groups = { BOTH = [\"link-0\", \"link-1\"] }\n");
    let gateway = shop.gateway();
    let text = blocks(20);
    put(&shop, "O77", &text);
    let loaded = started_while_it_was_paused(&shop);
    shop.take_now(1);
    // It has been started and has not begun; the machine is in the operator's hands.
    gateway.set_mode("shafts", "BOTH", CellMode::JogInAuto).unwrap();
    gateway.resume(JobId(loaded)).unwrap();
    sleep(A_WHILE);
    assert_eq!(gateway.job(JobId(loaded)).unwrap().state, JobState::Queued);
    assert_eq!(String::from_utf8_lossy(&shop.take_now(1)), "");
    gateway.set_mode("shafts", "BOTH", CellMode::Auto).unwrap();
    assert_eq!(shop.read(1, text.len()), text.as_bytes());
    is_done(&shop, loaded);
}

#[test]
fn a_plug_in_that_finds_blocks_itself_is_behind_the_words_before_its_first_block() {
    let mut lines = vec!["plugin = \"fanuc-rs232\"\nline = \"9600 8N1\"\n".to_owned(); 2];
    lines[1] += "[[cell]]\nname = \"shafts\"\nchannels = [\"link-0\", \"link-1\"]\n";
    let shop = Shop::each("", &[&lines[0], &lines[1]]);
    let gateway = shop.gateway();
    put(&shop, "A", "O1\nN1 G0 X1\n(SOFTPLUG WAIT 1)\nN2 G0 X2\n(SOFTPLUG WAIT 2)\nM30\n");
    let order = JobOrder { from_block: Some(4), ..send("A") };
    gateway.submit("link-0", &order).unwrap();
    // DC1: the control reads.
    shop.write(0, &[0x11]);
    shop.drain(0, || state(&shop, 0) == CellChannelState::Waits);
    assert_eq!(view(&shop).channels[0].text, "waits at mark 2 for link-1");
}
