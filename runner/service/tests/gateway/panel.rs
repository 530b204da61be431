//! What the operator asks for at the machine's panel.

use softplug_abi::JobId;
use std::fs;
use std::os::unix::fs::symlink;

use softplug_machines::fanuc::{Control, Press};
use softplug_machines::kept::Received;
use softplug_service::Gateway;
use softplug_service::view::{
    JobFilter, JobOrder, JobOrigin, JobState, JournalFilter, JournalKind,
};

use crate::gateway::machine::Machine;
use crate::gateway::shop::{Shop, wait_for};

/// A block of a job is a line of its program, whatever the plug-in counts: none is left out.
#[test]
fn a_program_begins_at_the_line_that_was_asked_for() {
    let shop = Shop::with(1, LINES);
    let gateway = shop.gateway();
    let lines = ["%", "O0777", "", "N10 X1", "N20 X2", "N30 X3", "%"];
    fs::write(shop.path("programs").join("A"), lines.join("\n")).unwrap();
    for block in 3..=6 {
        let order = JobOrder {
            program: Some("A".to_owned()),
            from_block: Some(block),
            ..JobOrder::default()
        };
        let job = gateway.submit(&Shop::name(0), &order).unwrap();
        // DC1: the control reads.
        shop.write(0, &[0x11]);
        let expected = [&lines[..2], &lines[block as usize - 1..]].concat().join("\n");
        let came = shop.read(0, expected.len());
        assert_eq!(String::from_utf8(came).unwrap(), expected, "from block {block}");
        wait_for("the job's end", || gateway.job(JobId(job.id)).unwrap().state == JobState::Done);
        let progress = gateway.job(JobId(job.id)).unwrap().progress.text;
        assert!(progress.ends_with(&format!("; it began at block {block}")), "{progress}");
    }
}

const LINES: &str = "plugin = \"fanuc-rs232\"\nline = \"9600 8N2\"\n";

fn press(panel: &Machine<Control>, key: Press) {
    panel.tell(move |now, control| control.press(now, key));
}

/// The control has the program: what it keeps begins behind the first block.
fn until_panel_has(panel: &Machine<Control>, program: &[u8]) {
    let kept = program.strip_prefix(b"%\n").and_then(|rest| rest.strip_suffix(b"\n")).unwrap();
    wait_for("the program", || {
        let report = panel.tell(|_, control| control.report());
        assert_eq!(
            (report.before_dc1, &*report.alarms),
            (0, &[][..]),
            "not sent as it asked for it"
        );
        match report.received {
            Received::Bytes(bytes) => bytes == kept,
            other @ Received::Digest { .. } => panic!("{other:?}"),
        }
    });
}

fn requests(gateway: &Gateway) -> Vec<String> {
    let filter = JournalFilter { kind: Some(JournalKind::Request), ..JournalFilter::default() };
    gateway.journal(&filter).unwrap().into_iter().map(|entry| entry.text).collect()
}

#[test]
fn the_panel_gets_the_program_that_it_asks_for() {
    let panel = Machine::fanuc();
    let shop = Shop::of_machine(&panel, LINES);
    let gateway = shop.gateway();
    let program = shop.program_in("b", "O1234", 2_000);
    press(&panel, Press::Request("O1234".to_owned()));
    until_panel_has(&panel, &program);
    // The request itself is a reception.
    let asked_for = || {
        let jobs = gateway.jobs(&JobFilter::default()).unwrap();
        jobs.into_iter().find(|job| job.origin == JobOrigin::Panel)
    };
    wait_for("the job", || asked_for().is_some_and(|job| job.state == JobState::Done));
    assert_eq!(asked_for().unwrap().program.as_deref(), Some("b/O1234"));
    assert!(requests(gateway)[0].contains("name=O1234"), "{:?}", requests(gateway));
}

#[test]
fn no_name_from_the_panel_leads_out_of_its_folder() {
    let panel = Machine::fanuc();
    let shop = Shop::of_machine(&panel, LINES);
    let gateway = shop.gateway();
    let program = shop.program_in("b", "O1234", 2_000);
    // Outside of the programs, beside the search path, hidden, and behind a link.
    let text = "%\nO6666\nM30\n%\n";
    for file in ["SECRET", "programs/O7", "programs/b/.HIDDEN"] {
        fs::write(shop.path(file), text).unwrap();
    }
    symlink(shop.path("SECRET"), shop.path("programs/b/LINK")).unwrap();
    let names =
        ["../../SECRET", "../O7", "/ETC/PASSWD", "B/../../../SECRET", "LINK", ".HIDDEN", "..", "*"];
    for (count, name) in (1..).zip(names) {
        press(&panel, Press::Request(name.to_owned()));
        wait_for("the refusal", || requests(gateway).len() == count);
        assert!(requests(gateway)[0].contains("; refused: "), "{name}: {:?}", requests(gateway));
        press(&panel, Press::Reset);
        wait_for("the control's rest", || panel.tell(|_, control| control.is_idle()));
    }
    // What asks is a program of the control's own, and kept like one; nothing was sent.
    let jobs = gateway.jobs(&JobFilter::default()).unwrap();
    assert!(jobs.iter().all(|job| job.origin == JobOrigin::Machine), "{jobs:?}");
    press(&panel, Press::Request("O1234".to_owned()));
    wait_for("the last request", || requests(gateway).len() == names.len() + 1);
    assert!(!requests(gateway)[0].contains("refused"), "{:?}", requests(gateway));
    until_panel_has(&panel, &program);
}

#[test]
fn the_panel_gets_the_program_whose_text_says_the_name_and_none_if_two_do() {
    let panel = Machine::fanuc();
    let shop = Shop::of_machine(&panel, LINES);
    let gateway = shop.gateway();
    fs::create_dir_all(shop.path("programs/b")).unwrap();
    let program = "%\nO4711 (FLANGE)\nG0 X1\nM30\n%\n";
    fs::write(shop.path("programs/b/flange.nc"), program).unwrap();
    press(&panel, Press::Request("4711".to_owned()));
    until_panel_has(&panel, program.as_bytes());
    let sent = || {
        let jobs = gateway.jobs(&JobFilter::default()).unwrap();
        jobs.into_iter().find(|job| job.origin == JobOrigin::Panel)
    };
    wait_for("the job", || sent().is_some_and(|job| job.state == JobState::Done));
    let job = sent().unwrap();
    assert_eq!(
        (job.program.as_deref(), job.named.as_deref()),
        (Some("b/flange.nc"), Some("O4711"))
    );

    fs::write(shop.path("programs/b/old-flange.nc"), program.replace("X1", "X2")).unwrap();
    press(&panel, Press::Reset);
    wait_for("the control's rest", || panel.tell(|_, control| control.is_idle()));
    press(&panel, Press::Request("O4711".to_owned()));
    let said = "O4711 is asked for, and more than one program is called so in its text: \
                b/flange.nc and b/old-flange.nc; none is sent";
    wait_for("the reason", || requests(gateway).iter().any(|text| text.starts_with(said)));
    wait_for("the refusal", || requests(gateway).iter().any(|text| text.contains("; refused: ")));
    let jobs = gateway.jobs(&JobFilter::default()).unwrap();
    assert_eq!(jobs.iter().filter(|job| job.origin == JobOrigin::Panel).count(), 1);
}
