//! The book is executed: every command and every block of code in `docs/`, page by page.
//!
//! A page's ```` ```console ```` blocks run in order in one shell, in a folder of the page's
//! own that is empty at first; what they show is compared with what the page shows. What
//! stands behind the language in a block's first line says more:
//!
//! | mark | meaning |
//! |---|---|
//! | `file=PATH`, `append=PATH` | the block is that file, or goes behind what is in it |
//! | `stays` | its last command goes on until the page ends; with `^C` below it, until there |
//! | `with=FILE` | the folder has this plug-in of ours |
//! | `checkout` | from here on the folder has what a checkout of the repository has |
//! | `needs-SOMETHING` | it cannot run here; only its options are looked at |
#![cfg(target_os = "linux")]

#[allow(dead_code, reason = "the book needs less of it than the command's other tests")]
#[path = "../cli/bench.rs"]
mod bench;
mod blocks;
mod links;
mod messages;
mod page;
mod session;
mod summary;
mod transcript;

use page::{Block, Page};
use session::Session;

/// A test for each page, by the page's path below `docs`.
macro_rules! pages {
    ($list:ident; $($name:ident: $path:literal,)*) => {
        pub(crate) const $list: &[&str] = &[$($path),*];
        $(
            #[test]
            fn $name() {
                crate::execute($path);
            }
        )*
    };
}

pages! {
    PLAIN_PAGES;
    contents: "README.md",
    quick_start: "quick-start.md",
    machines: "machines.md",
    troubleshooting: "troubleshooting.md",
    tutorial: "tutorial.md",
    write: "write.md",
    windows: "windows.md",
    languages: "languages.md",
    certify: "certify.md",
    ci: "ci/README.md",
    code_mutants: "code-mutants.md",
    kill_matrix: "kill-matrix.md",
    explore: "explore.md",
    record: "record.md",
    playground: "playground/README.md",
    gateway: "gateway/README.md",
    gateway_config: "gateway/config.md",
    gateway_cells: "gateway/cells.md",
    gateway_operate: "gateway/operate.md",
    gateway_ports: "gateway/ports.md",
    gateway_library: "gateway/library.md",
    gateway_drop: "gateway/drop.md",
    gateway_jobs: "gateway/jobs.md",
    gateway_swap: "gateway/swap.md",
    gateway_page: "gateway/page.md",
    gateway_metrics: "gateway/metrics.md",
    plan: "plan.md",
    abi: "abi.md",
    trace_format: "trace-format.md",
    protocols: "protocols/README.md",
    protocols_xon_xoff: "protocols/xon-xoff.md",
    protocols_3964r: "protocols/3964r.md",
    protocols_fanuc_rs232: "protocols/fanuc-rs232.md",
    protocols_heidenhain_fe: "protocols/heidenhain-fe.md",
    protocols_pulse_lathe: "protocols/pulse-lathe.md",
    protocols_xmodem: "protocols/xmodem.md",
    protocols_kermit: "protocols/kermit.md",
    unit_index: "unit/README.md",
    unit_firmware: "unit/firmware.md",
    unit_protocol: "unit/protocol.md",
    unit_slots: "unit/slots.md",
    performance: "performance.md",
    architecture: "architecture.md",
    glossary: "glossary.md",
    decisions: "decisions/README.md",
    decision_0001: "decisions/0001-plug-ins-import-nothing.md",
    decision_0002: "decisions/0002-fixed-records-and-one-mailbox.md",
    decision_0003: "decisions/0003-link-rules-live-once.md",
    decision_0004: "decisions/0004-wasmtime-behind-a-small-interface.md",
    decision_0005: "decisions/0005-own-poll-loop.md",
    decision_0006: "decisions/0006-traces-as-text.md",
    decision_0007: "decisions/0007-delivery-is-memory.md",
    decision_0008: "decisions/0008-small-plug-ins.md",
    decision_0009: "decisions/0009-one-engine-for-the-3964-family.md",
    decision_0010: "decisions/0010-signed-results-name-their-report.md",
    decision_0011: "decisions/0011-jobs-in-redb.md",
    decision_0012: "decisions/0012-readers-have-no-part-in-the-writers-turns.md",
    decision_0013: "decisions/0013-weighed-then-compiled-apart.md",
    decision_0014: "decisions/0014-an-interpreter-that-translates-nothing.md",
    decision_0015: "decisions/0015-units-know-keys-not-certificates.md",
    decision_0016: "decisions/0016-channels-meet-and-nothing-is-remembered.md",
    decision_0017: "decisions/0017-answers-between-symbols.md",
    decisions_dependencies: "decisions/dependencies.md",
}

mod needs_curl {
    pages! {
        PAGES;
        gateway_api: "gateway/api.md",
    }
}

mod needs_openssl {
    pages! {
        PAGES;
        command: "command.md",
    }

    pub(crate) mod needs_jq {
        pages! {
            PAGES;
            report: "report/README.md",
        }
    }
}

mod needs_python_wasmtime {
    pub(crate) mod needs_node {
        pages! {
            PAGES;
            hosts: "hosts/README.md",
        }
    }
}

/// All pages: those above need nothing beyond the build.
fn pages() -> Vec<&'static str> {
    [
        PLAIN_PAGES,
        needs_curl::PAGES,
        needs_openssl::PAGES,
        needs_openssl::needs_jq::PAGES,
        needs_python_wasmtime::needs_node::PAGES,
    ]
    .concat()
}

/// Runs and checks all of a page.
fn execute(path: &str) {
    let page = Page::read(&format!("docs/{path}"));
    let mut session = Session::new();
    let mut wrong = links::check(&page);
    for block in &page.blocks {
        if let Err(error) = perform(&mut session, block) {
            wrong.push(format!("{}:{}: {error}", page.path, block.line));
            if block.language == "console" {
                // What follows builds on it.
                break;
            }
        }
    }
    for (line, code) in &page.codes {
        let is_command = code.starts_with("softplug ") && !code.contains(['…', '|', '$']);
        if is_command && let Err(error) = blocks::check_options(code) {
            wrong.push(format!("{}:{line}: {error}", page.path));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    session.end();
}

fn perform(session: &mut Session, block: &Block) -> Result<(), String> {
    if let Some(name) = block.value("with") {
        session.give(name);
    }
    if block.has("checkout") {
        session.check_out();
    }
    if block.language == "console" {
        return match block.lacks() {
            Some(_) => transcript::read(&block.text)?
                .iter()
                .filter(|step| step.command.starts_with("softplug "))
                .try_for_each(|step| blocks::check_options(&step.command)),
            None => session.run(block),
        };
    }
    if let Some(name) = block.value("file") {
        session.write(name, &block.text, false);
    } else if let Some(name) = block.value("append") {
        session.write(name, &block.text, true);
        // Only a part: the command that reads the file judges it.
        return Ok(());
    }
    blocks::check(block)
}
