//! What the gateway costs: many links at once, hostile neighbours, swaps; ser2net
//! beside it where it is installed.

use std::fs::OpenOptions;
use std::path::PathBuf;
use std::process::Command;
use std::thread;

use serde_json::Value;

use super::BenchError;
use crate::Error;
use crate::run::{cargo, output, succeed};
use crate::workspace::Workspace;

const PACKAGE: &str = "softplug-live";
/// Of each measurement.
const SECONDS: &str = "6";
/// Characters in flight where lines are full.
const DEPTH: &str = "16";
const LINKS: [&str; 4] = ["1", "10", "100", "1000"];
const MANY: &str = "1000";
const SWAPS: &str = "10000";

/// Runs them and prints their tables.
pub(super) fn run(workspace: &Workspace) -> Result<(), Error> {
    let examples = ["many_links", "hostile_links", "hot_swap"];
    let mut build = cargo();
    build.current_dir(workspace.root()).args(["build", "--release", "-p", PACKAGE]);
    succeed(build.args(examples.iter().flat_map(|name| ["--example", name])))?;
    let example = |name: &str, arguments: &[&str]| {
        let program = workspace.target().join("release/examples").join(name);
        figures(name, &output(Command::new(program).args(arguments))?)
    };
    let plugin = workspace.plugin_folder().join("xon-xoff.wasm");
    let plugin = plugin.to_str().ok_or_else(|| not_understood("the plug-in's path"))?;

    let mut echoes = Vec::new();
    for links in LINKS {
        echoes.push(example("many_links", &["echo", plugin, links, SECONDS])?);
    }
    if is_installed("ser2net") {
        for chardelay in ["false", "true"] {
            echoes.push(example("many_links", &["ser2net", chardelay, MANY, SECONDS])?);
        }
    } else {
        eprintln!("left out: ser2net is not installed");
    }
    print_echoes(&echoes);
    let saturate = ["saturate", plugin, MANY, SECONDS, DEPTH];
    let mut full = vec![("shared", example("many_links", &saturate)?)];
    if may_be_apart() {
        let apart = [&saturate[..], &["--real-time", "--apart"]].concat();
        full.push(("one for the gateway, at real-time priority", example("many_links", &apart)?));
    } else {
        eprintln!("left out: to keep a processor for the gateway takes two of them, and root");
    }
    print_full(&full);
    let hostile = example("hostile_links", &[SECONDS, "1"])?;
    print_hostile(&hostile);
    print_swaps(&example("hot_swap", &[plugin, SWAPS])?);
    Ok(())
}

fn is_installed(program: &str) -> bool {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let mut folders = std::env::split_paths(&path).chain([PathBuf::from("/usr/sbin")]);
    folders.any(|folder| folder.join(program).is_file())
}

fn figures(name: &str, printed: &str) -> Result<Value, Error> {
    Ok(serde_json::from_str(printed).map_err(|cause| BenchError::Format {
        path: PathBuf::from(format!("the output of {name}")),
        what: cause.to_string(),
    })?)
}

fn not_understood(what: &str) -> BenchError {
    BenchError::Format { path: PathBuf::from(what), what: "it is no text".to_owned() }
}

fn print_echoes(rows: &[Value]) {
    println!("16 bytes each way every 100 ms, 921,600 baud");
    println!();
    println!("| links | | p50 | p99 | unanswered | CPU | all else | memory |");
    println!("|---:|---|---:|---:|---:|---:|---:|---:|");
    for row in rows {
        println!(
            "| {} | {} | {} | {} | {} of {} | {} | {} | {} |",
            row["links"],
            row["subject"].as_str().unwrap_or_default(),
            millis(&row["p50_micros"]),
            millis(&row["p99_micros"]),
            row["unanswered"],
            row["echoes"],
            percent(&row["cpu_percent"]),
            percent(&row["other_cpu_percent"]),
            mebibytes(&row["resident_grown_kib"]),
        );
    }
    println!();
    if let Some(ratio) = cpu_ratio(rows) {
        println!("CPU of {MANY} links, ours : ser2net's without chardelay: {ratio:.2}");
        println!();
    }
}

/// Our share of the processor, all else than the harness included, compared with that
/// of ser2net's first row.
fn cpu_ratio(rows: &[Value]) -> Option<f64> {
    let share =
        |row: &Value| Some(row["cpu_percent"].as_f64()? + row["other_cpu_percent"].as_f64()?);
    let at = rows.iter().position(|row| row["subject"] != "softplug")?;
    Some(share(rows[..at].last()?)? / share(&rows[at])?)
}

/// Whether there is a processor to spare, and the kernel's workers can be told where to run.
fn may_be_apart() -> bool {
    let workers = "/sys/devices/virtual/workqueue/cpumask";
    thread::available_parallelism().is_ok_and(|processors| processors.get() > 1)
        && OpenOptions::new().write(true).open(workers).is_ok()
}

fn print_full(rows: &[(&str, Value)]) {
    println!("{MANY} lines of 9,600 baud, full both ways, depth {DEPTH}");
    println!();
    println!(
        "| processors | to the machine, of 960 B/s | to the client | wrong bytes | CPU | all else | of that for the harness's bytes | memory |"
    );
    println!("|---|---:|---:|---:|---:|---:|---:|---:|");
    for (processors, row) in rows {
        println!(
            "| {processors} | {:.0} | {:.0} | {} of {} | {} | {} | {} | {} |",
            row["to_machine_bytes_per_second"].as_f64().unwrap_or_default(),
            row["to_client_bytes_per_second"].as_f64().unwrap_or_default(),
            row["wrong_bytes"],
            sum(&[&row["to_machine_bytes"], &row["to_client_bytes"]]),
            percent(&row["cpu_percent"]),
            percent(&row["other_cpu_percent"]),
            percent(&row["other_cpu_percent_for_machines"]),
            mebibytes(&row["resident_grown_kib"]),
        );
    }
    println!();
}

fn print_hostile(rounds: &Value) {
    println!("90 links beside 10 others");
    println!();
    println!("| the others are | faults | p50 | p99 | longest | unanswered |");
    println!("|---|---:|---:|---:|---:|---:|");
    for round in rounds.as_array().into_iter().flatten() {
        let trip = &round["round_trip_us"];
        println!(
            "| {} | {} | {} | {} | {} | {} of {} |",
            if round["hostile_links"] == 0 { "sound" } else { "hostile" },
            round["faults"],
            millis(&trip["p50"]),
            millis(&trip["p99"]),
            millis(&trip["most"]),
            round["without_answer"],
            round["round_trips"],
        );
    }
    println!();
}

fn print_swaps(row: &Value) {
    let pause = &row["pause_us"];
    println!("{} swaps over {} links under load", row["swaps"], row["links"]);
    println!();
    println!("| links with a wrong byte | pause, p50 | p99 | p99.9 | longest |");
    println!("|---:|---:|---:|---:|---:|");
    println!(
        "| {} | {} | {} | {} | {} |",
        row["links_with_a_wrong_byte"],
        millis(&pause["p50"]),
        millis(&pause["p99"]),
        millis(&pause["p999"]),
        millis(&pause["most"]),
    );
    println!();
}

fn millis(micros: &Value) -> String {
    let millis = micros.as_f64().unwrap_or(f64::NAN) / 1e3;
    let decimals = if millis < 1.0 { 3 } else { 1 };
    format!("{millis:.decimals$} ms")
}

fn percent(share: &Value) -> String {
    format!("{:.0} %", share.as_f64().unwrap_or(f64::NAN))
}

fn mebibytes(kib: &Value) -> String {
    format!("{:.1} MiB", kib.as_f64().unwrap_or(f64::NAN) / 1_024.0)
}

fn sum(counts: &[&Value]) -> u64 {
    counts.iter().filter_map(|count| count.as_u64()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn figures_are_shown_in_units_that_suit() {
        assert_eq!(millis(&json!(87)), "0.087 ms");
        assert_eq!(millis(&json!(12_345)), "12.3 ms");
        assert_eq!(millis(&json!(null)), "NaN ms");
        assert_eq!(percent(&json!(59.4)), "59 %");
        assert_eq!(mebibytes(&json!(33_280)), "32.5 MiB");
        assert_eq!(sum(&[&json!(3), &json!(4)]), 7);
    }

    #[test]
    fn the_share_of_most_links_is_compared_with_ser2net() {
        let row = |subject: &str, percent: f64| json!({"subject": subject, "cpu_percent": percent, "other_cpu_percent": percent});
        let rows = [
            row("softplug", 1.0),
            row("softplug", 30.0),
            row("ser2net", 40.0),
            row("ser2net", 90.0),
        ];
        assert_eq!(cpu_ratio(&rows), Some(0.75));
        assert_eq!(cpu_ratio(&rows[..2]), None);
    }

    #[test]
    fn what_is_no_json_is_an_error() {
        assert!(figures("many_links", "{\"links\":1}").is_ok());
        assert!(figures("many_links", "no such measurement").is_err());
    }
}
