//! A priority that the gateway has no right to.

mod needs_unshare {
    use std::process::Command;

    use super::super::bench;
    use crate::bench::Ran;

    #[test]
    fn without_the_right_to_real_time_priority_it_does_not_start() {
        let bench = bench("[gateway]\nreal-time-priority = 7\n");
        // Root of a user namespace of its own has no rights outside of it.
        let ran: Ran = Command::new("unshare")
            .args(["--user", "--map-root-user", "prlimit", "--rtprio=0"])
            .args([env!("CARGO_BIN_EXE_softplug"), "gateway", "run", "gateway.toml"])
            .current_dir(bench.path(""))
            .output()
            .unwrap()
            .into();
        let refused = ran.with_code(2);
        assert!(refused.err.contains("may not have real-time priority 7: "), "{refused}");
        assert!(refused.err.contains("`ulimit -r 7`"), "{refused}");
    }
}
