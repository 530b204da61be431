//! The CI files of a new project, run as the CI systems run them.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;

use serde::Deserialize;

use crate::bench::{Bench, Ran};
use crate::ci_kit::gitlab::Pipeline;
use crate::ci_kit::{github, yaml};
use crate::kit::{alone, project};

/// What a machine of a CI system gets from the network; here it is there already.
const INSTALLED: [&str; 4] = [
    "cargo install --locked softplug",
    "rustup target add wasm32v1-none",
    "sudo apt-get update && sudo apt-get install -y clang lld",
    "apt-get update && apt-get install -y clang lld",
];

/// A bench that is the project: a CI system starts at its top.
fn checked_out(name: &str, language: &str) -> Bench {
    let made = project(name, language);
    let bench = Bench::new();
    let mut copy = Command::new("cp");
    copy.arg("-R").arg(made.path(name).join(".")).arg(bench.path("."));
    assert!(copy.status().unwrap().success());
    bench
}

/// Runs lines in one shell, where the command stands on the path.
fn lines(bench: &Bench, script: &[&str], variables: &BTreeMap<String, String>) -> Ran {
    let own = Path::new(env!("CARGO_BIN_EXE_softplug")).parent().unwrap();
    let path = format!("{}:{}", own.display(), std::env::var("PATH").unwrap());
    bench.write("lines.sh", script.join("\n"));
    let mut shell = Command::new("sh");
    shell.args(["-e", "lines.sh"]).current_dir(bench.path("."));
    alone(&mut shell).env("PATH", path).envs(variables).output().unwrap().into()
}

fn verdict(bench: &Bench) -> serde_json::Value {
    let report = bench.read("conformance/conformance.json");
    serde_json::from_slice::<serde_json::Value>(&report).unwrap()["verdict"].clone()
}

#[derive(Deserialize)]
struct Workflow {
    jobs: BTreeMap<String, Job>,
}

#[derive(Deserialize)]
struct Job {
    steps: Vec<Step>,
}

#[derive(Deserialize)]
struct Step {
    run: Option<String>,
    uses: Option<String>,
    #[serde(default)]
    with: BTreeMap<String, String>,
}

/// Runs the workflow as GitHub does; how many of its lines did something.
fn on_github(bench: &Bench) -> usize {
    let workflow: Workflow = yaml(&bench.path(".github/workflows/ci.yml"));
    let mut count = 0;
    for step in workflow.jobs.into_values().flat_map(|job| job.steps) {
        match (step.run, step.uses.as_deref()) {
            (Some(line), None) if INSTALLED.contains(&line.as_str()) => {}
            (Some(line), None) => {
                lines(bench, &[&line], &BTreeMap::new()).with_code(0);
                count += 1;
            }
            (None, Some(uses)) => {
                let Some(action) = uses.strip_prefix("./") else {
                    assert_eq!(uses, "actions/checkout@v4");
                    continue;
                };
                let action = bench.path(action).join("action.yml");
                let with: Vec<_> =
                    step.with.iter().map(|(name, value)| (name.as_str(), value.as_str())).collect();
                let outcome = github::act(bench, &action, &with);
                assert_eq!(outcome.code, 0, "{}", outcome.log);
                count += 1;
            }
            _ => panic!("a step either runs a line or uses an action"),
        }
    }
    count
}

#[derive(Deserialize)]
struct GitlabFile {
    #[serde(default)]
    include: Vec<Include>,
    conformance: GitlabJob,
}

#[derive(Deserialize)]
struct Include {
    local: String,
}

#[derive(Deserialize)]
struct GitlabJob {
    extends: Option<String>,
    #[serde(default)]
    variables: BTreeMap<String, String>,
    #[serde(default)]
    before_script: Vec<Lines>,
    #[serde(default)]
    script: Vec<String>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Lines {
    One(String),
    Reference(Vec<String>),
}

/// Runs the job as GitLab does; how many of its own lines did something.
fn on_gitlab(bench: &Bench) -> usize {
    // The tag stands before nothing but lists, and is the only one of a list.
    let text = String::from_utf8(bench.read(".gitlab-ci.yml")).unwrap().replace("!reference ", "");
    let file: GitlabFile = serde_saphyr::from_str(&text).unwrap();
    let Some(extends) = file.conformance.extends else {
        let own = file.conformance.script.iter().map(String::as_str);
        let own: Vec<_> = own.filter(|line| !INSTALLED.contains(line)).collect();
        lines(bench, &own, &BTreeMap::new()).with_code(0);
        return own.len();
    };
    let [include] = &file.include[..] else { panic!("one file is included") };
    let base = yaml::<Pipeline>(&bench.path(&include.local)).job;
    assert_eq!(extends, ".softplug-certify");
    let mut script = Vec::new();
    let mut count = 0;
    for line in &file.conformance.before_script {
        match line {
            Lines::One(line) if INSTALLED.contains(&line.as_str()) => {}
            Lines::One(line) => {
                script.push(line.as_str());
                count += 1;
            }
            Lines::Reference(place) => {
                assert_eq!(place[..], [".softplug-certify", "before_script"]);
                script.extend(base.before_script.iter().map(String::as_str));
            }
        }
    }
    script.extend(base.script.iter().map(String::as_str));
    let mut variables = base.variables.clone();
    variables.extend(file.conformance.variables);
    lines(bench, &script, &variables).with_code(0);
    count
}

/// Both systems come to a verdict of their own, with so many lines that do something.
fn is_certified(name: &str, language: &str, [github, gitlab]: [usize; 2]) {
    let bench = checked_out(name, language);
    assert_eq!(on_github(&bench), github);
    assert_eq!(verdict(&bench), "conformant");
    fs::remove_dir_all(bench.path("conformance")).unwrap();
    assert_eq!(on_gitlab(&bench), gitlab);
    assert_eq!(verdict(&bench), "conformant");
}

#[test]
fn a_project_in_c_is_certified_by_its_own_ci_files() {
    // On GitHub the action is one more.
    is_certified("ci-c", "c", [2, 1]);
}

#[test]
fn a_project_in_rust_is_certified_by_its_own_ci_files() {
    is_certified("ci-rust", "rust", [3, 3]);
}
