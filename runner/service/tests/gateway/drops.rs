//! Drop folders: what is put there becomes a job, once and whole, and is put away beside what became
//! of it.

use softplug_abi::JobId;
use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::Write as _;
use std::os::unix::ffi::OsStrExt as _;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::thread::sleep;
use std::time::Duration;

use softplug_service::view::{
    DropView, JobFilter, JobOrigin, JobState, JobView, JournalFilter, StopHow,
};

use crate::gateway::journal_says;
use crate::gateway::shop::{Shop, wait_for};

/// Longer than some looks take: what has not happened by then does not happen.
const A_WHILE: Duration = Duration::from_millis(700);
const LINK: &str = "plugin = \"xon-xoff\"\nline = \"921600 8N1\"\n";

fn with(drop: &str) -> Shop {
    let drop = format!("drop = {{ folder = \"in\", look = \"100ms\", {drop} }}\n");
    let shop = Shop::with(1, &format!("{LINK}{drop}"));
    fs::create_dir_all(shop.path("in")).unwrap();
    // It may have been looked for before it was there, which the journal tells.
    wait_for("the folder's own folders", || {
        let is_fine = shop.gateway().link("link-0").unwrap().trouble.is_empty();
        is_fine && shop.path("in/work/.owner").exists()
    });
    sleep(Duration::from_millis(50));
    shop
}

fn shop() -> Shop {
    with("settle = \"300ms\"")
}

fn view(shop: &Shop) -> DropView {
    shop.gateway().link("link-0").unwrap().drop.unwrap()
}

fn jobs(shop: &Shop) -> Vec<JobView> {
    let filter = JobFilter { limit: Some(1_000), ..JobFilter::default() };
    let mut jobs = shop.gateway().jobs(&filter).unwrap();
    jobs.retain(|job| job.origin == JobOrigin::Drop);
    jobs.reverse();
    jobs
}

fn text(path: &Path) -> String {
    fs::read_to_string(path).unwrap()
}

fn names(path: &Path) -> BTreeSet<Vec<u8>> {
    let entries = fs::read_dir(path).unwrap();
    entries.map(|entry| entry.unwrap().file_name().as_bytes().to_vec()).collect()
}

#[test]
fn a_file_becomes_a_job_and_is_put_away_beside_what_became_of_it() {
    let shop = shop();
    let program = shop.program("O1.nc", 5_000);
    fs::copy(shop.path("programs/O1.nc"), shop.path("in/O1.nc")).unwrap();
    assert_eq!(shop.read(0, program.len()), program);
    wait_for("the result", || shop.path("in/done/O1.nc").exists());
    assert_eq!(fs::read(shop.path("in/done/O1.nc")).unwrap(), program);
    let said = text(&shop.path("in/done/O1.nc.txt"));
    let first = "Job 1 is done: all of this program, 4,986 bytes, has left for \"link-0\".\n";
    assert!(said.starts_with(&first.replace("4,986", &thousands(program.len()))), "{said}");
    assert!(said.contains("\nIt was given at 2"), "{said}");
    assert!(!said.contains("What to do"), "{said}");
    let [job] = &jobs(&shop)[..] else { panic!("one job") };
    assert_eq!((job.program.as_deref(), job.state), (Some("O1.nc"), JobState::Done));
    wait_for("an empty folder", || {
        let view = view(&shop);
        (view.waiting, view.under_way, view.trouble) == (0, 0, None)
    });
    assert_eq!(names(&shop.path("in/work")), BTreeSet::from([b".owner".to_vec()]));

    // The same file again is another job, and overwrites nothing.
    fs::copy(shop.path("programs/O1.nc"), shop.path("in/O1.nc")).unwrap();
    assert_eq!(shop.read(0, program.len()), program);
    wait_for("the second result", || shop.path("in/done/O1-2.nc").exists());
    assert!(text(&shop.path("in/done/O1-2.nc.txt")).starts_with("Job 2 is done"));
    assert_eq!(jobs(&shop).len(), 2);
}

fn thousands(number: usize) -> String {
    format!("{},{:03}", number / 1_000, number % 1_000)
}

#[test]
fn a_file_that_somebody_writes_to_is_not_taken_before_that_has_ended() {
    let shop = shop();
    // Under a name of its own all the while, as most programs copy; it stands still for long.
    let mut file = File::create(shop.path("in/O1.nc")).unwrap();
    file.write_all(b"%\nO1\nG1 X1\n").unwrap();
    wait_for("the file", || view(&shop).waiting == 1);
    sleep(A_WHILE);
    assert_eq!((jobs(&shop).len(), view(&shop).waiting), (0, 1));
    file.write_all(b"M30\n%\n").unwrap();
    drop(file);
    wait_for("the job", || jobs(&shop).len() == 1);
    let whole = b"%\nO1\nG1 X1\nM30\n%\n";
    assert_eq!(shop.read(0, whole.len()), whole);
}

#[test]
fn temporary_names_are_passed_over_until_the_file_has_its_own() {
    let shop = with("settle = \"0s\"");
    for name in ["O1.nc.filepart", ".O1.nc", "~$O1.nc", "O1.tmp", "O1.nc.PART"] {
        fs::write(shop.path("in").join(name), "G1\n").unwrap();
    }
    sleep(A_WHILE);
    assert_eq!((jobs(&shop).len(), view(&shop).waiting), (0, 0));
    fs::rename(shop.path("in/O1.nc.filepart"), shop.path("in/O1.nc")).unwrap();
    assert_eq!(shop.read(0, 3), b"G1\n");
    wait_for("its end", || shop.path("in/done/O1.nc.txt").exists());
    assert_eq!(jobs(&shop).len(), 1);
}

#[test]
fn what_is_no_program_stays_or_fails_with_a_reason_and_the_rest_goes_on() {
    let shop = with("settle = \"100ms\", largest = 1_000");
    let at = |name: &str| shop.path("in").join(name);
    fs::write(shop.path("secret"), "SECRET").unwrap();
    symlink(shop.path("secret"), at("a-link.nc")).unwrap();
    symlink("/dev/zero", at("b-zero.nc")).unwrap();
    assert!(std::process::Command::new("mkfifo").arg(at("c-pipe.nc")).status().unwrap().success());
    let _socket = std::os::unix::net::UnixListener::bind(at("d-socket.nc")).unwrap();
    fs::create_dir(at("e-folder.nc")).unwrap();
    fs::write(at("e-folder.nc/inner.nc"), "G1\n").unwrap();
    fs::write(at("f-empty.nc"), "").unwrap();
    File::create(at("g-huge.nc")).unwrap().set_len(1 << 40).unwrap();
    let long = format!("{}.nc", "x".repeat(252));
    let odd: [&[u8]; 5] =
        [b"\xff\xfe.nc", b"h\x1b[2J\n.nc", long.as_bytes(), "Größe ☃.nc".as_bytes(), b"-rf"];
    for name in odd {
        fs::write(shop.path("in").join(OsStr::from_bytes(name)), "G1\n").unwrap();
    }
    wait_for("the odd names' ends", || {
        odd.iter().all(|name| shop.path("in/done").join(OsStr::from_bytes(name)).exists())
    });
    assert_eq!(shop.read(0, 5 * 3), b"G1\n".repeat(5));
    let said = text(&shop.path("in/done").join(format!("{}.txt", "x".repeat(251))));
    assert!(said.contains(" is done: all of this program, 3 bytes"), "{said}");

    wait_for("the huge one's end", || at("failed/g-huge.nc.txt").exists());
    assert_eq!(
        text(&at("failed/g-huge.nc.txt")),
        "This file has not become a job, nothing of it was sent: the program is larger than 1000 \
         bytes, which is the most that is taken.\n\
         What to do: mend that, and put the file into the folder again.\n"
    );
    wait_for("the rest", || view(&shop).left_lying == 4 && view(&shop).waiting == 1);
    for name in
        ["a-link.nc", "b-zero.nc", "c-pipe.nc", "d-socket.nc", "e-folder.nc/inner.nc", "f-empty.nc"]
    {
        assert!(fs::symlink_metadata(at(name)).is_ok(), "{name}");
    }
    assert_eq!((jobs(&shop).len(), view(&shop).trouble), (5, None));
    for said in [
        "a-link.nc in the drop folder is a symbolic link: it stays where it is",
        "c-pipe.nc in the drop folder is a pipe: it stays where it is",
        "g-huge.nc of the drop folder is not taken: the program is larger than 1000 bytes, which is \
         the most that is taken; it is now failed/g-huge.nc",
    ] {
        wait_for(said, || journal_says(shop.gateway(), said));
    }
    let names: Vec<_> = jobs(&shop).into_iter().map(|job| job.program.unwrap()).collect();
    assert!(names.iter().all(|name| name.chars().all(|c| !c.is_control())), "{names:?}");
    // Told once, not at each look, nor each time that it comes back.
    fs::rename(at("a-link.nc"), at(".a-link.nc")).unwrap();
    sleep(A_WHILE);
    fs::rename(at(".a-link.nc"), at("a-link.nc")).unwrap();
    sleep(A_WHILE);
    let journal = shop.gateway().journal(&JournalFilter::default()).unwrap();
    let told = journal.iter().filter(|entry| entry.text.contains("a symbolic link")).count();
    assert_eq!(told, 2);
}

#[test]
fn a_share_that_goes_and_comes_back_is_told_once_and_nothing_is_made_in_its_place() {
    let shop = shop();
    let said = format!(
        "the drop folder {} is not there: make it, or mount its share",
        shop.path("in").display()
    );
    let count = || {
        let journal = shop.gateway().journal(&JournalFilter::default()).unwrap();
        journal.iter().filter(|entry| entry.text == said).count()
    };
    let before = count();
    fs::write(shop.path("in/O1.nc"), "G1\n").unwrap();
    wait_for("the file", || view(&shop).waiting == 1);
    fs::rename(shop.path("in"), shop.path("away")).unwrap();
    wait_for("the trouble", || view(&shop).trouble.is_some());
    assert_eq!(view(&shop).trouble.as_deref(), Some(&*said));
    assert!(shop.gateway().link("link-0").unwrap().trouble.contains(&said));
    sleep(A_WHILE);
    assert!(!shop.path("in").exists());
    // The folder that a share is mounted on is there, and it is another.
    fs::create_dir(shop.path("in")).unwrap();
    fs::write(shop.path("in/O2.nc"), "G2\n").unwrap();
    wait_for("the other trouble", || {
        view(&shop).trouble.is_some_and(|text| text.contains("is not the one that it was"))
    });
    sleep(A_WHILE);
    assert_eq!(names(&shop.path("in")), BTreeSet::from([b"O2.nc".to_vec()]));
    fs::remove_file(shop.path("in/O2.nc")).unwrap();
    fs::remove_dir(shop.path("in")).unwrap();
    fs::rename(shop.path("away"), shop.path("in")).unwrap();
    wait_for("the result", || {
        shop.waiting(0);
        shop.path("in/done/O1.nc.txt").exists()
    });
    wait_for("the journal", || journal_says(shop.gateway(), "the drop folder can be used again"));
    // Gone again for a moment, while the other folder was taken away.
    assert!(count() <= before + 2, "{}", count());
    assert_eq!(jobs(&shop).len(), 1);
}

#[test]
fn a_folder_that_is_another_gateways_is_left_alone() {
    let shop = shop();
    fs::write(shop.path("in/work/.owner"), "the link \"mill\" of the gateway 1\n").unwrap();
    fs::write(shop.path("in/O1.nc"), "G1\n").unwrap();
    wait_for("the trouble", || {
        let trouble = view(&shop).trouble.unwrap_or_default();
        trouble.contains("belongs to the link \"mill\" of the gateway 1, which is not this one")
    });
    sleep(A_WHILE);
    assert!(shop.path("in/O1.nc").exists() && jobs(&shop).is_empty());
}

#[test]
fn many_files_become_jobs_in_their_order_and_never_fill_the_queue() {
    let shop = with("settle = \"0s\"");
    shop.hold(0);
    fs::create_dir(shop.path("staged")).unwrap();
    // They come at once, as from a folder that is moved.
    for at in 0..300 {
        fs::write(shop.path(&format!("staged/{at:03}.nc")), format!("N{at:03}\n")).unwrap();
    }
    for at in 0..300 {
        let name = format!("{at:03}.nc");
        fs::rename(shop.path("staged").join(&name), shop.path("in").join(&name)).unwrap();
    }
    wait_for("as many as may wait", || view(&shop).under_way >= 100);
    sleep(A_WHILE);
    assert!(jobs(&shop).len() <= 102, "{}", jobs(&shop).len());
    assert!(view(&shop).waiting >= 198);
    shop.release(0);
    let expected: Vec<u8> = (0..300).flat_map(|at| format!("N{at:03}\n").into_bytes()).collect();
    let got = shop.read(0, expected.len());
    assert_eq!(String::from_utf8(got).unwrap(), String::from_utf8(expected).unwrap());
    wait_for("the last result", || names(&shop.path("in/done")).len() == 600);
    assert_eq!(jobs(&shop).len(), 300);
}

#[test]
fn what_a_job_that_was_aborted_had_is_failed_and_says_what_to_do() {
    let shop = shop();
    shop.hold(0);
    fs::write(shop.path("in/O1.nc"), "G1 X1\n".repeat(3_000)).unwrap();
    wait_for("the job", || jobs(&shop).len() == 1);
    let job = jobs(&shop)[0].id;
    shop.gateway().abort(JobId(job)).unwrap();
    shop.release(0);
    shop.drain(0, || shop.path("in/failed/O1.nc").exists());
    let said = text(&shop.path("in/failed/O1.nc.txt"));
    assert!(
        said.starts_with("Job 1 is aborted.\nOf this program, 18,000 bytes, for \"link-0\": "),
        "{said}"
    );
    assert!(said.contains("softplug job restart 1 --from-block N"), "{said}");
}

#[test]
fn a_file_that_is_removed_or_rewritten_while_it_is_a_job_is_told_of_with_the_result() {
    let shop = shop();
    shop.hold(0);
    let both = ["O1.nc", "O2.nc"];
    for name in both {
        fs::write(shop.path(&format!("in/{name}")), "G1 X1\n").unwrap();
    }
    wait_for("the jobs", || jobs(&shop).len() == 2);
    let claims =
        names(&shop.path("in/work")).into_iter().map(|name| String::from_utf8(name).unwrap());
    for claim in claims.filter(|name| name != ".owner") {
        let file = |name| shop.path(&format!("in/work/{claim}/{name}"));
        if file(both[0]).exists() {
            fs::remove_file(file(both[0])).unwrap();
        } else {
            fs::write(file(both[1]), "G1 X2\n").unwrap();
        }
    }
    shop.release(0);
    shop.drain(0, || shop.path("in/done/O2.nc").exists());
    let (gone, rewritten) = (shop.path("in/done/O1.nc.txt"), shop.path("in/done/O2.nc.txt"));
    wait_for("the result of the file that is gone", || gone.exists());
    assert!(!shop.path("in/done/O1.nc").exists());
    let said = text(&gone);
    assert!(said.contains(" is done: all of this program, 6 bytes, has left"), "{said}");
    assert!(said.contains("removed the file from work while it was a job"), "{said}");
    wait_for("the journal", || {
        journal_says(
            shop.gateway(),
            "is gone from work in the drop folder; what became of it is in done/O1.nc.txt",
        )
    });
    let said = text(&rewritten);
    assert!(said.contains("what it says now is not what was taken"), "{said}");
    wait_for("no claims", || names(&shop.path("in/work")).len() == 1);
}

#[test]
fn what_becomes_of_a_claims_folder_is_told_and_holds_nobody_up() {
    let shop = shop();
    shop.hold(0);
    let names_of = ["O1.nc", "O2.nc", "O3.nc", "O4.nc"];
    for name in names_of {
        fs::write(shop.path(&format!("in/{name}")), "G1 X1\n").unwrap();
    }
    wait_for("the jobs", || view(&shop).under_way == 4);
    let claims =
        names(&shop.path("in/work")).into_iter().map(|name| String::from_utf8(name).unwrap());
    for claim in claims.filter(|name| name != ".owner") {
        let folder = shop.path(&format!("in/work/{claim}"));
        let file = |name: &str| folder.join(name);
        if file("O1.nc").exists() {
            fs::remove_dir_all(&folder).unwrap();
        } else if file("O2.nc").exists() {
            fs::remove_dir_all(&folder).unwrap();
            fs::write(&folder, "a file").unwrap();
        } else if file("O3.nc").exists() {
            fs::remove_file(file("O3.nc")).unwrap();
            symlink("/etc/passwd", file("O3.nc")).unwrap();
        }
    }
    shop.release(0);
    shop.drain(0, || shop.path("in/done/O4.nc").exists());
    let result = |name: &str| shop.path(&format!("in/done/{name}.txt"));
    for name in names_of {
        wait_for(name, || result(name).exists());
    }
    for name in ["O1.nc", "O2.nc"] {
        assert!(text(&result(name)).contains("removed the file from work"), "{name}");
        assert!(!shop.path(&format!("in/done/{name}")).exists());
    }
    assert!(text(&result("O3.nc")).contains("What lies here now is no file"));
    assert!(!text(&result("O4.nc")).contains("file"), "{}", text(&result("O4.nc")));
    // The next one is taken as ever, and nothing is told twice.
    fs::write(shop.path("in/O5.nc"), "G1 X1\n").unwrap();
    shop.drain(0, || shop.path("in/done/O5.nc").exists());
    sleep(A_WHILE);
    let done = names(&shop.path("in/done"));
    let texts = done.iter().filter(|name| name.ends_with(b".txt")).count();
    assert_eq!(texts, 5, "{done:?}");
}

#[test]
fn what_the_plug_in_refuses_says_where_it_stands() {
    let shop = shop();
    fs::write(shop.path("in/O1.nc"), b"G1 X1\nG1 \x13 X2\n").unwrap();
    wait_for("the result", || shop.path("in/failed/O1.nc.txt").exists());
    let said = text(&shop.path("in/failed/O1.nc.txt"));
    assert!(said.contains("cannot be sent on this link (line 2, column 4)"), "{said}");
}

#[test]
fn a_folder_that_is_given_up_with_jobs_under_way_is_told_of() {
    let shop = shop();
    shop.hold(0);
    fs::write(shop.path("in/O1.nc"), "G1 X1\n").unwrap();
    wait_for("the job", || view(&shop).under_way == 1);
    fs::create_dir(shop.path("other")).unwrap();
    shop.configure(|text| text.replace("folder = \"in\"", "folder = \"other\""));
    shop.gateway().reload().unwrap();
    let said = "is no longer looked after: 1 of its files are jobs that go on";
    wait_for("the journal", || journal_says(shop.gateway(), said));
    shop.configure(|text| text.replace("folder = \"other\"", "folder = \"in\""));
    shop.gateway().reload().unwrap();
    shop.release(0);
    shop.drain(0, || shop.path("in/done/O1.nc").exists());
}

#[test]
fn a_reload_takes_a_drop_folder_and_gives_it_up() {
    let shop = shop();
    fs::create_dir(shop.path("other")).unwrap();
    shop.configure(|text| text.replace("folder = \"in\"", "folder = \"other\""));
    let changed = shop.gateway().reload().unwrap().changed;
    assert_eq!(
        (changed.len(), &*changed[0].keys, changed[0].waits),
        (1, &["drop".to_owned()][..], false)
    );
    fs::write(shop.path("other/O1.nc"), "G1\n").unwrap();
    fs::write(shop.path("in/O2.nc"), "G2\n").unwrap();
    wait_for("the result", || {
        shop.waiting(0);
        shop.path("other/done/O1.nc.txt").exists()
    });
    shop.configure(|text| {
        let lines: Vec<_> = text.lines().filter(|line| !line.starts_with("drop")).collect();
        lines.join("\n")
    });
    shop.gateway().reload().unwrap();
    assert_eq!(shop.gateway().link("link-0").unwrap().drop, None);
    assert!(shop.path("in/O2.nc").exists());
    assert_eq!(jobs(&shop).len(), 1);
}

#[test]
fn what_was_claimed_before_a_start_becomes_its_one_job_and_what_had_one_gets_no_second() {
    let mut shop = shop();
    shop.hold(0);
    fs::write(shop.path("in/O1.nc"), "G1\n".repeat(1_000)).unwrap();
    wait_for("the job", || jobs(&shop).len() == 1);
    shop.gateway().stop(StopHow::Park);
    shop.release(0);
    wait_for("the end", || {
        shop.waiting(0);
        shop.gateway().links().map_or(true, |links| links.is_empty())
    });
    shop.stopped();
    // Killed between claim and job: with a file, without one, and with something that is none.
    let claim = |number: u8| shop.path(&format!("in/work/{:013x}{number:016x}", 7));
    for number in 1..=3 {
        fs::create_dir(claim(number)).unwrap();
    }
    fs::write(claim(1).join("O2.nc"), "G2\n").unwrap();
    symlink("/etc/passwd", claim(2).join("O3.nc")).unwrap();
    shop.start();
    wait_for("all to be put away", || {
        shop.waiting(0);
        names(&shop.path("in/work")).len() == 1
    });
    assert!(text(&shop.path("in/failed/O1.nc.txt")).starts_with("Job 1 is interrupted: "));
    assert!(text(&shop.path("in/done/O2.nc.txt")).starts_with("Job 2 is done: "));
    assert!(
        text(&shop.path("in/failed/O3.nc.txt")).contains("nothing of it was sent: it is no file.")
    );
    assert_eq!(jobs(&shop).len(), 2);
}
