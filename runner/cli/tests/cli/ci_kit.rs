//! The CI kit in `docs/ci`: its own steps, run as the CI systems run them.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde::Deserialize;

use crate::bench::{Bench, Ran, plugins};

const REPORTS: [&str; 4] = ["badge.json", "conformance.json", "junit.xml", "report.html"];

/// Where a file of the kit is.
fn kit(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/ci").join(name)
}

/// What a file in YAML says.
pub(crate) fn yaml<T: serde::de::DeserializeOwned>(path: &Path) -> T {
    let text = fs::read_to_string(path).unwrap();
    serde_saphyr::from_str(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// A shell with the built command on its path and nothing else of ours.
fn shell(bench: &Bench, words: &[&str]) -> Command {
    let command = Path::new(env!("CARGO_BIN_EXE_softplug")).parent().unwrap();
    let mut path = command.as_os_str().to_owned();
    path.push(":/usr/bin:/bin");
    let mut shell = Command::new(words[0]);
    shell.args(&words[1..]).current_dir(bench.path(".")).env_clear().env("PATH", path);
    shell
}

/// A bench with the real plug-in and what only looks like one.
fn bench() -> Bench {
    let bench = Bench::new();
    bench.write("xon-xoff.wasm", fs::read(plugins().join("xon-xoff.wasm")).unwrap());
    bench.write("broken.wasm", "no module at all");
    bench
}

/// The names of what a run wrote into its folder.
fn written(bench: &Bench, folder: &str) -> Vec<String> {
    let Ok(entries) = fs::read_dir(bench.path(folder)) else { return Vec::new() };
    let name =
        |entry: std::io::Result<fs::DirEntry>| entry.unwrap().file_name().into_string().unwrap();
    let mut names: Vec<_> = entries.map(name).collect();
    names.sort();
    names
}

fn verdict(bench: &Bench, folder: &str) -> serde_json::Value {
    let report = bench.read(&format!("{folder}/conformance.json"));
    serde_json::from_slice::<serde_json::Value>(&report).unwrap()["verdict"].clone()
}

pub(crate) mod github {
    use super::*;

    #[derive(Deserialize)]
    struct Action {
        inputs: BTreeMap<String, Input>,
        outputs: BTreeMap<String, Output>,
        runs: Runs,
    }

    #[derive(Deserialize)]
    struct Input {
        #[serde(default)]
        required: bool,
        default: Option<String>,
    }

    #[derive(Deserialize)]
    struct Output {
        value: String,
    }

    #[derive(Deserialize)]
    struct Runs {
        using: String,
        steps: Vec<Step>,
    }

    #[derive(Deserialize)]
    struct Step {
        id: Option<String>,
        #[serde(rename = "if")]
        condition: Option<String>,
        shell: Option<String>,
        run: Option<String>,
        #[serde(default)]
        env: BTreeMap<String, String>,
        uses: Option<String>,
        #[serde(default)]
        with: BTreeMap<String, String>,
    }

    /// What came of a run of the action.
    pub(crate) struct Outcome {
        /// Of the first step that failed; 0 if none did.
        pub(crate) code: i32,
        outputs: BTreeMap<String, String>,
        /// What all steps printed.
        pub(crate) log: String,
        summary: String,
        /// The folder that was uploaded.
        uploaded: Option<String>,
    }

    /// Runs the action as the runner of GitHub does: step by step, each in a shell
    /// of its own; expressions are filled in before.
    pub(crate) fn act(bench: &Bench, action: &Path, inputs: &[(&str, &str)]) -> Outcome {
        let action: Action = yaml(action);
        assert_eq!(action.runs.using, "composite");
        let mut values = BTreeMap::new();
        for (name, input) in &action.inputs {
            let given = inputs.iter().find(|(given, _)| given == name);
            let value = given.map(|(_, value)| (*value).to_owned()).or(input.default.clone());
            assert!(value.is_some() || !input.required, "{name} is required");
            values.insert(format!("inputs.{name}"), value.unwrap_or_default());
        }
        for (name, _) in inputs {
            assert!(action.inputs.contains_key(*name), "there is no input {name}");
        }
        let mut outcome = Outcome {
            code: 0,
            outputs: BTreeMap::new(),
            log: String::new(),
            summary: String::new(),
            uploaded: None,
        };
        bench.write("summary.md", "");
        for step in &action.runs.steps {
            if !is_due(step.condition.as_deref(), outcome.code, &values) {
                continue;
            }
            if let Some(action) = &step.uses {
                assert!(action.starts_with("actions/upload-artifact@v"), "{action}");
                outcome.uploaded = Some(fill(&step.with["path"], &values));
                continue;
            }
            assert_eq!(step.shell.as_deref(), Some("bash"));
            bench.write("step.sh", step.run.as_deref().unwrap());
            bench.write("output.txt", "");
            let mut shell =
                shell(bench, &["bash", "--noprofile", "--norc", "-eo", "pipefail", "step.sh"]);
            shell.env("GITHUB_OUTPUT", bench.path("output.txt"));
            shell.env("GITHUB_STEP_SUMMARY", bench.path("summary.md"));
            shell.envs(step.env.iter().map(|(name, value)| (name, fill(value, &values))));
            let ran: Ran = shell.output().unwrap().into();
            outcome.log += &(ran.out + &ran.err);
            if outcome.code == 0 {
                outcome.code = ran.code;
            }
            if let Some(id) = &step.id {
                for line in String::from_utf8(bench.read("output.txt")).unwrap().lines() {
                    let (name, value) = line.split_once('=').unwrap();
                    values.insert(format!("steps.{id}.outputs.{name}"), value.to_owned());
                }
            }
        }
        outcome.outputs = action
            .outputs
            .iter()
            .map(|(name, output)| (name.clone(), fill(&output.value, &values)))
            .collect();
        outcome.summary = String::from_utf8(bench.read("summary.md")).unwrap();
        outcome
    }

    fn run(bench: &Bench, inputs: &[(&str, &str)]) -> Outcome {
        act(bench, &kit("github/action.yml"), inputs)
    }

    /// Puts values in the place of `${{ NAME }}`.
    fn fill(text: &str, values: &BTreeMap<String, String>) -> String {
        let mut filled = String::new();
        let mut rest = text;
        while let Some((before, after)) = rest.split_once("${{") {
            let (name, after) = after.split_once("}}").unwrap();
            filled += before;
            filled += values.get(name.trim()).map_or("", String::as_str);
            rest = after;
        }
        filled + rest
    }

    /// The two forms of condition that the action has.
    fn is_due(condition: Option<&str>, code: i32, values: &BTreeMap<String, String>) -> bool {
        let Some(condition) = condition else { return code == 0 };
        match condition.strip_prefix("always()").map(str::trim) {
            Some("") => true,
            Some(more) => {
                let (name, value) = more.strip_prefix("&& ").unwrap().split_once(" != ").unwrap();
                values.get(name).map_or("", String::as_str) != value.trim_matches('\'')
            }
            None => panic!("a condition that this test does not know: {condition}"),
        }
    }

    #[test]
    fn a_good_plug_in_passes_and_its_reports_are_uploaded() {
        let bench = bench();
        let inputs = [("plugin", "xon-xoff.wasm"), ("profile", "xon-xoff"), ("out", "my reports")];
        let outcome = run(&bench, &inputs);
        assert_eq!(outcome.code, 0, "{}", outcome.log);
        assert_eq!(outcome.uploaded.as_deref(), Some("my reports"));
        for name in REPORTS {
            assert!(written(&bench, "my reports").contains(&name.to_owned()), "{name}");
        }
        assert_eq!(verdict(&bench, "my reports"), "conformant");
        assert_eq!(outcome.outputs["exit-code"], "0");
        assert_eq!(outcome.outputs["report"], "my reports/conformance.json");
        assert!(outcome.summary.contains("`xon-xoff.wasm`: conformant"), "{}", outcome.summary);
        assert!(!outcome.log.contains("::error"), "{}", outcome.log);
    }

    #[test]
    fn a_plug_in_of_another_protocol_fails_with_annotations() {
        let bench = bench();
        let outcome = run(&bench, &[("plugin", "xon-xoff.wasm"), ("profile", "r3964")]);
        assert_eq!(outcome.code, 1, "{}", outcome.log);
        assert_eq!(outcome.outputs["exit-code"], "1");
        assert_eq!(verdict(&bench, "conformance"), "not-conformant");
        assert!(outcome.log.contains("::error"), "{}", outcome.log);
        assert!(outcome.summary.contains("**not conformant**"), "{}", outcome.summary);
        assert_eq!(outcome.uploaded.as_deref(), Some("conformance"));
    }

    #[test]
    fn what_cannot_be_judged_or_read_is_never_green() {
        let bench = bench();
        let outcome = run(&bench, &[("plugin", "broken.wasm"), ("profile", "xon-xoff")]);
        assert_eq!(outcome.code, 3, "{}", outcome.log);
        assert!(outcome.summary.contains("**not judged**"), "{}", outcome.summary);
        // The reports of that run must not be taken for those of the next.
        let outcome = run(&bench, &[("plugin", "none.wasm"), ("profile", "xon-xoff")]);
        assert_eq!(outcome.code, 2, "{}", outcome.log);
        assert_eq!((outcome.uploaded, outcome.outputs["report"].as_str()), (None, ""));
        assert!(outcome.summary.contains("**no verdict** (exit code 2)"), "{}", outcome.summary);
        let inputs = [("plugin", "xon-xoff.wasm"), ("profile", "xon-xoff"), ("strict", "yes")];
        let outcome = run(&bench, &inputs);
        assert_eq!(outcome.code, 2, "{}", outcome.log);
        assert!(outcome.log.contains("strict must be true or false"), "{}", outcome.log);
        let inputs =
            [("plugin", "xon-xoff.wasm"), ("profile", "xon-xoff"), ("baseline", "none.toml")];
        assert_eq!(run(&bench, &inputs).code, 2);
    }

    #[test]
    fn inputs_are_data_and_no_part_of_a_script() {
        let action: Action = yaml(&kit("github/action.yml"));
        for step in action.runs.steps {
            let script = step.run.unwrap_or_default();
            assert!(!script.contains("${{"), "an expression stands in a script: {script}");
        }
        let bench = bench();
        let profile = "xon-xoff; touch \"$(echo stolen)\" `touch stolen`";
        let outcome = run(&bench, &[("plugin", "xon-xoff.wasm"), ("profile", profile)]);
        assert_eq!(outcome.code, 2, "{}", outcome.log);
        assert!(!bench.path("stolen").exists());
    }
}

pub(crate) mod gitlab {
    use super::*;

    #[derive(Deserialize)]
    pub(crate) struct Pipeline {
        #[serde(rename = ".softplug-certify")]
        pub(crate) job: Job,
    }

    #[derive(Deserialize)]
    pub(crate) struct Job {
        pub(crate) variables: BTreeMap<String, String>,
        pub(crate) before_script: Vec<String>,
        pub(crate) script: Vec<String>,
        artifacts: Artifacts,
    }

    #[derive(Deserialize)]
    struct Artifacts {
        when: String,
        paths: Vec<String>,
        reports: BTreeMap<String, String>,
    }

    /// Runs the job as the runner of GitLab does: all lines in one shell.
    fn run(bench: &Bench, variables: &[(&str, &str)]) -> Ran {
        let job = yaml::<Pipeline>(&kit("gitlab/softplug.yml")).job;
        for (name, _) in variables {
            assert!(job.variables.contains_key(*name), "there is no variable {name}");
        }
        let script = [job.before_script, job.script].concat().join("\n");
        bench.write("job.sh", script);
        let mut shell = shell(bench, &["sh", "-e", "job.sh"]);
        shell.envs(&job.variables).envs(variables.iter().copied());
        shell.output().unwrap().into()
    }

    #[test]
    fn a_good_plug_in_passes_and_its_artifacts_are_there() {
        let bench = bench();
        let variables = [
            ("SOFTPLUG_PLUGIN", "xon-xoff.wasm"),
            ("SOFTPLUG_PROFILE", "xon-xoff"),
            ("SOFTPLUG_STRICT", "false"),
        ];
        run(&bench, &variables).with_code(0);
        assert_eq!(verdict(&bench, "conformance"), "conformant");
        let job = yaml::<Pipeline>(&kit("gitlab/softplug.yml")).job;
        let out = &job.variables["SOFTPLUG_OUT"];
        let place = |path: &str| path.replace("$SOFTPLUG_OUT", out);
        assert_eq!(job.artifacts.when, "always");
        assert!(job.artifacts.paths.iter().all(|path| bench.path(&place(path)).exists()));
        let junit = String::from_utf8(bench.read(&place(&job.artifacts.reports["junit"]))).unwrap();
        assert!(junit.contains("<testsuites"), "{junit}");
    }

    #[test]
    fn what_fails_has_the_exit_code_of_the_command() {
        let bench = bench();
        let codes = [
            ("xon-xoff.wasm", "r3964", 1),
            ("none.wasm", "xon-xoff", 2),
            ("broken.wasm", "xon-xoff", 3),
        ];
        for (plugin, profile, code) in codes {
            let variables = [("SOFTPLUG_PLUGIN", plugin), ("SOFTPLUG_PROFILE", profile)];
            run(&bench, &variables).with_code(code);
        }
        let variables = [
            ("SOFTPLUG_PLUGIN", "xon-xoff.wasm"),
            ("SOFTPLUG_PROFILE", "xon-xoff"),
            ("SOFTPLUG_STRICT", "1"),
        ];
        run(&bench, &variables).with_code(2);
    }
}
