//! Runs the benchmarks and writes their tables, to be copied into the docs.

mod gateway;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::SystemTime;

use serde_json::Value;

use crate::run::{self, cargo, output, succeed};
use crate::workspace::Workspace;
use crate::{Error, plugins};

/// What the benchmarks left behind cannot be read.
#[derive(Debug, thiserror::Error)]
pub(crate) enum BenchError {
    #[error("{}: {cause}", path.display())]
    File { path: PathBuf, cause: io::Error },
    #[error("{} cannot be understood: {what}", path.display())]
    Format { path: PathBuf, what: String },
    #[error("no benchmark ran: is there one whose name contains the filter?")]
    None,
}

/// A measurement that criterion does not make: a program that prints its
/// figures as one JSON object.
struct Hook {
    program: Program,
    name: &'static str,
}

/// Which program.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Program {
    /// An example that gets the file of this plug-in as its argument.
    Example { plugin: &'static str },
    /// A benchmark that finds the plug-ins by itself.
    Bench,
}

const HOOKS: &[Hook] = &[
    Hook { program: Program::Bench, name: "fuel" },
    Hook { program: Program::Example { plugin: "xon-xoff" }, name: "resident" },
];

/// A line of the table.
#[derive(Clone, PartialEq, Debug)]
struct Row {
    name: String,
    /// The median in nanoseconds, if it is a time.
    median: Option<f64>,
    figure: String,
    /// Time for each byte, where bytes are what is measured.
    per_byte: String,
    spread: String,
}

impl Row {
    /// A figure that is no time.
    fn count(name: String, figure: String) -> Self {
        Self { name, median: None, figure, per_byte: String::new(), spread: String::new() }
    }
}

/// Where a benchmark's name ends like this, it is compared with the other.
const NATIVE: &str = "/native";
const WASM: &str = "/wasm";

/// The filter that leaves only what the gateway costs.
const GATEWAY: &str = "gateway";

/// Prints tables to standard output; all else goes to standard error.
pub(crate) fn run(workspace: &Workspace, filter: Option<&str>) -> Result<(), Error> {
    let sizes = plugins::build(workspace, plugins::Report::Table)?;
    println!("Machine: {}", machine());
    println!("Command: cargo xtask bench {}", filter.unwrap_or_default());
    println!();
    if filter == Some(GATEWAY) {
        return gateway::run(workspace);
    }
    let started = SystemTime::now();
    let is_hook =
        |bench: &str| HOOKS.iter().any(|hook| hook.program == Program::Bench && hook.name == bench);
    for (package, bench) in workspace.benches().into_iter().filter(|(_, name)| !is_hook(name)) {
        let mut command = cargo();
        command
            .current_dir(workspace.root())
            .env("SOFTPLUG_PLUGINS", workspace.plugin_folder())
            .stdout(io::stderr())
            .args(["bench", "-p", &package, "--bench", &bench, "--"])
            .args(filter);
        succeed(&mut command)?;
    }
    let mut rows = measured_since(&workspace.target().join("criterion"), started)?;
    rows.extend(ratios(&rows));
    rows.sort_by(|a, b| a.name.cmp(&b.name));
    for hook in HOOKS {
        rows.extend(hook.run(workspace)?.into_iter().filter(|row| is_wanted(row, filter)));
    }
    let sizes = sizes.iter().map(|size| {
        Row::count(format!("{}.wasm: size", size.name), format!("{} bytes", size.total))
    });
    rows.extend(sizes.filter(|row| is_wanted(row, filter)));
    if rows.is_empty() {
        return Err(BenchError::None.into());
    }
    print(&rows);
    println!();
    if filter.is_none() { gateway::run(workspace) } else { Ok(()) }
}

fn is_wanted(row: &Row, filter: Option<&str>) -> bool {
    filter.is_none_or(|part| row.name.contains(part))
}

impl Hook {
    fn run(&self, workspace: &Workspace) -> Result<Vec<Row>, Error> {
        let mut command = cargo();
        command.current_dir(workspace.root()).env("SOFTPLUG_PLUGINS", workspace.plugin_folder());
        match self.program {
            Program::Bench => {
                let benches = workspace.benches();
                let Some((package, _)) = benches.iter().find(|(_, name)| name == self.name) else {
                    return Ok(self.left_out());
                };
                command.args(["bench", "--quiet", "-p", package, "--bench", self.name]);
            }
            Program::Example { plugin } => {
                let Some(package) = workspace.package_of_example(self.name) else {
                    return Ok(self.left_out());
                };
                command.args(["run", "--quiet", "--release", "-p", &package]);
                command.args(["--example", self.name, "--"]);
                command.arg(workspace.plugin_folder().join(format!("{plugin}.wasm")));
            }
        }
        Ok(self.rows(&output(&mut command)?)?)
    }

    fn left_out(&self) -> Vec<Row> {
        eprintln!("left out: there is no {}", self.name);
        Vec::new()
    }

    fn rows(&self, printed: &str) -> Result<Vec<Row>, BenchError> {
        let path = || PathBuf::from(format!("the output of {}", self.name));
        let figures: serde_json::Map<String, Value> = serde_json::from_str(printed)
            .map_err(|cause| BenchError::Format { path: path(), what: cause.to_string() })?;
        let name = |figure: String| match self.program {
            Program::Bench => figure,
            Program::Example { plugin } => format!("{}: {figure} ({plugin})", self.name),
        };
        let rows =
            figures.into_iter().map(|(what, value)| Row::count(name(what), value.to_string()));
        Ok(rows.collect())
    }
}

/// How many times longer the sandbox takes than native code, for each pair of
/// the same run.
fn ratios(rows: &[Row]) -> Vec<Row> {
    let pairs = rows.iter().filter_map(|wasm| {
        let what = wasm.name.strip_suffix(WASM)?;
        let native = rows.iter().find(|row| row.name.strip_suffix(NATIVE) == Some(what))?;
        let ratio = format!("{:.2}", wasm.median? / native.median?);
        Some(Row::count(format!("{what}/wasm : native"), ratio))
    });
    pairs.collect()
}

/// Results that criterion wrote in this run, by name; older ones stay out.
fn measured_since(folder: &Path, started: SystemTime) -> Result<Vec<Row>, BenchError> {
    let mut rows = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        let Ok(entries) = fs::read_dir(&folder) else { continue };
        for entry in entries.filter_map(Result::ok) {
            if entry.path().is_dir() {
                folders.push(entry.path());
            }
        }
        let estimates = folder.join("estimates.json");
        let fresh = folder.ends_with("new")
            && fs::metadata(&estimates).and_then(|m| m.modified()).is_ok_and(|at| at >= started);
        if fresh {
            rows.push(row(&folder.join("benchmark.json"), &estimates)?);
        }
    }
    rows.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(rows)
}

fn row(benchmark: &Path, estimates: &Path) -> Result<Row, BenchError> {
    let described = json(benchmark)?;
    let name = described["full_id"].as_str().ok_or_else(|| missing(benchmark, "full_id"))?;
    let estimate = json(estimates)?;
    let median = &estimate["median"];
    let nanoseconds =
        |value: &Value, what: &str| value.as_f64().ok_or_else(|| missing(estimates, what));
    let interval = &median["confidence_interval"];
    let low = nanoseconds(&interval["lower_bound"], "median.lower_bound")?;
    let high = nanoseconds(&interval["upper_bound"], "median.upper_bound")?;
    let middle = nanoseconds(&median["point_estimate"], "median.point_estimate")?;
    Ok(Row {
        name: name.to_owned(),
        median: Some(middle),
        figure: duration(middle),
        per_byte: described["throughput"]["Bytes"]
            .as_f64()
            .map(|bytes| duration(middle / bytes))
            .unwrap_or_default(),
        spread: format!("{} to {}", duration(low), duration(high)),
    })
}

fn json(path: &Path) -> Result<Value, BenchError> {
    let text = fs::read(path).map_err(|cause| BenchError::File { path: path.to_owned(), cause })?;
    serde_json::from_slice(&text)
        .map_err(|cause| BenchError::Format { path: path.to_owned(), what: cause.to_string() })
}

fn missing(path: &Path, what: &str) -> BenchError {
    BenchError::Format { path: path.to_owned(), what: format!("it has no {what}") }
}

/// Three digits that count, in the unit that suits.
fn duration(nanoseconds: f64) -> String {
    let (value, unit) = match nanoseconds {
        n if n < 1e3 => (n, "ns"),
        n if n < 1e6 => (n / 1e3, "µs"),
        n if n < 1e9 => (n / 1e6, "ms"),
        n => (n / 1e9, "s"),
    };
    let decimals = if value < 10.0 { 2 } else { usize::from(value < 100.0) };
    format!("{value:.decimals$} {unit}")
}

fn print(rows: &[Row]) {
    let width = rows.iter().map(|row| row.name.chars().count()).max().unwrap_or(0);
    println!("| {:width$} | median | per byte | 95 % of medians |", "what");
    println!("|{}|---:|---:|---|", "-".repeat(width + 2));
    for Row { name, figure, per_byte, spread, .. } in rows {
        println!("| {name:width$} | {figure} | {per_byte} | {spread} |");
    }
}

fn machine() -> String {
    let processor = fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| {
        let line = text.lines().find(|line| line.starts_with("model name"))?;
        Some(line.split_once(':')?.1.trim().to_owned())
    });
    let cores = std::thread::available_parallelism().map_or(0, usize::from);
    let rustc = run::output(Command::new("rustc").arg("--version")).unwrap_or_default();
    format!(
        "{} ({cores} cores), {} {}, {}",
        processor.as_deref().unwrap_or("unknown processor"),
        std::env::consts::OS,
        std::env::consts::ARCH,
        rustc.trim()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_have_three_digits() {
        let shown = [1.234, 12.34, 123.4, 1_234.0, 98_765.0, 2.5e6, 3.0e9].map(duration);
        assert_eq!(
            shown,
            ["1.23 ns", "12.3 ns", "123 ns", "1.23 µs", "98.8 µs", "2.50 ms", "3.00 s"]
        );
    }

    #[test]
    fn a_ratio_is_given_for_pairs_only() {
        let row = |name: &str, median| Row {
            median: Some(median),
            ..Row::count(name.into(), String::new())
        };
        let rows = [row("a/native", 100.0), row("b/wasm", 9.0), row("a/wasm", 250.0)];
        let ratios = ratios(&rows);
        assert_eq!(ratios.len(), 1);
        assert_eq!(
            (ratios[0].name.as_str(), ratios[0].figure.as_str()),
            ("a/wasm : native", "2.50")
        );
    }

    #[test]
    fn programs_give_their_figures_as_json() {
        let hook = Hook { program: Program::Example { plugin: "xon-xoff" }, name: "resident" };
        let rows = hook.rows("{\"bytes_per_instance\":20480}\n").unwrap();
        let expected = "resident: bytes_per_instance (xon-xoff)".to_owned();
        assert_eq!(rows, [Row::count(expected, "20480".into())]);
        assert!(hook.rows("20480 bytes").is_err());
        let hook = Hook { program: Program::Bench, name: "fuel" };
        let rows = hook.rows("{\"r3964: blocks sent, fuel per byte\":70.5}").unwrap();
        assert_eq!(rows, [Row::count("r3964: blocks sent, fuel per byte".into(), "70.5".into())]);
        assert!(is_wanted(&rows[0], Some("r3964")) && !is_wanted(&rows[0], Some("fanuc")));
    }

    #[test]
    fn only_fresh_results_of_criterion_are_read() {
        let folder = std::env::temp_dir().join(format!("softplug-bench-{}", std::process::id()));
        let new = folder.join("step/one byte/new");
        fs::create_dir_all(&new).unwrap();
        let benchmark = r#"{"full_id":"step/one byte","throughput":{"Bytes":4}}"#;
        fs::write(new.join("benchmark.json"), benchmark).unwrap();
        let estimates = r#"{"median":{"point_estimate":120.4,
            "confidence_interval":{"lower_bound":119.0,"upper_bound":121.96}}}"#;
        fs::write(new.join("estimates.json"), estimates).unwrap();
        let all = measured_since(&folder, SystemTime::UNIX_EPOCH).unwrap();
        let later = SystemTime::now() + std::time::Duration::from_hours(1);
        let none = measured_since(&folder, later).unwrap();
        fs::write(new.join("estimates.json"), "{}").unwrap();
        let broken = measured_since(&folder, SystemTime::UNIX_EPOCH);
        fs::remove_dir_all(&folder).unwrap();
        assert_eq!(
            all,
            [Row {
                name: "step/one byte".into(),
                median: Some(120.4),
                figure: "120 ns".into(),
                per_byte: "30.1 ns".into(),
                spread: "119 ns to 122 ns".into()
            }]
        );
        assert_eq!(none, []);
        assert!(broken.unwrap_err().to_string().contains("median.lower_bound"));
    }
}
