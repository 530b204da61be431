//! A disk that is full: the reserve is given up, what runs goes on, new work is refused.

mod needs_unshare {
    use std::fs;
    use std::path::{Path, PathBuf};
    use std::process::{Command, Stdio};

    use rustix::process::Signal;
    use softplug_live::pty::PtyPair;

    use super::super::{Gateway, bench, link, take, token, wait_for};
    use crate::bench::Bench;

    /// The gateway with a state folder on a small disk of its own, and where that is seen from here.
    fn on_a_small_disk(bench: &Bench) -> (Gateway, PathBuf) {
        let script = "mount -t tmpfs -o size=8m none state && cp -r library state/plugins && \
                      exec \"$0\" \"$@\"";
        let mut command = Command::new("unshare");
        command
            .args(["--user", "--map-root-user", "--mount", "sh", "-c", script])
            .args([env!("CARGO_BIN_EXE_softplug"), "gateway", "run", "gateway.toml", "--json"])
            .current_dir(bench.path(""))
            .env_remove("SOFTPLUG_LOG")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        let gateway = Gateway::of(command);
        let root = format!("/proc/{}/root{}", gateway.child.id(), bench.path("state").display());
        (gateway, PathBuf::from(root))
    }

    /// Leaves no room.
    fn fill(state: &Path) {
        let mut size = 1 << 20;
        let mut text = Vec::new();
        let path = state.join("in the way");
        while size > 0 {
            text.resize(text.len() + size, b'x');
            if fs::write(&path, &text).is_err() {
                text.truncate(text.len() - size);
                size /= 2;
            }
        }
    }

    #[test]
    fn on_a_full_disk_the_reserve_lets_what_runs_go_on() {
        let pty = PtyPair::open().unwrap();
        let bench = bench(&link("lathe", pty.slave_path().to_str().unwrap()));
        fs::rename(bench.path("state/plugins"), bench.path("library")).unwrap();
        fs::create_dir_all(bench.path("state")).unwrap();
        let token = token(&bench);
        let program = format!("%\nO1\n{}M30\n%\n", "N10 G1 X12.5 Y25\n".repeat(20_000));
        bench.write("programs/O1.nc", &program);
        let (gateway, state) = on_a_small_disk(&bench);
        let ask = |words: &[&str]| gateway.ask(&bench, &token, words);
        ask(&["job", "submit", "lathe", "O1.nc"]).with_code(0);
        let mut got = Vec::new();
        wait_for("bytes", || {
            take(&pty, &mut got);
            got.len() > 5_000
        });
        // The machine holds; what is written down meanwhile needs room, until there is none but
        // the reserve.
        pty.write(b"\x13").unwrap();
        fill(&state);
        let reserve = state.join("reserve");
        wait_for("the reserve to be given up", || {
            ask(&["job", "priority", "1", "5"]);
            !reserve.exists()
        });
        let refused = ask(&["job", "submit", "lathe", "O1.nc"]).with_code(6);
        assert!(refused.err.contains("make room on the disk"), "{refused}");
        pty.write(b"\x11").unwrap();
        wait_for("the program's end", || {
            take(&pty, &mut got);
            got.len() >= program.len()
        });
        assert_eq!(got, program.as_bytes());
        ask(&["job", "wait", "1"]).with_code(0);
        fs::remove_file(state.join("in the way")).unwrap();
        ask(&["job", "submit", "lathe", "O1.nc"]).with_code(0);
        assert!(reserve.exists(), "it is there again before new work is taken");
        gateway.signal(Signal::KILL);
        let (_, log) = gateway.end();
        assert!(log.contains("the last reserve is used"), "{log}");
    }
}
