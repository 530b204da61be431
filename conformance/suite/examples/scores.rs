//! Scores the modules of the reference plug-ins and keeps what came of it:
//! `cargo run --release -p softplug-conformance --example scores -- PLUGINS FILE SAMPLE SESSIONS CROSSED [FILTER]`.
//! Each score, with all its survivors, goes to standard output as a line of JSON.

use softplug_conformance::Corpus;
use softplug_conformance::mutants::Scores;
use softplug_conformance::score::{ScoreOptions, score};
use softplug_native::NativePlugin;
use std::error::Error;
use std::fs;
use std::path::Path;
use std::sync::atomic::AtomicBool;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [plugins, file, sample, sessions, crossed, filter @ ..] = arguments.as_slice() else {
        return Err("PLUGINS FILE SAMPLE SESSIONS CROSSED [FILTER] are wanted".into());
    };
    let options = ScoreOptions {
        sample: Some(sample.parse()?),
        sessions: sessions.parse()?,
        crossed: crossed.parse()?,
        ..ScoreOptions::default()
    };
    let file = Path::new(file);
    let mut scores = match fs::read_to_string(file) {
        Ok(text) => Scores::parse(file, &text)?,
        Err(_) => Scores::default(),
    };
    let corpus = Corpus::embedded();
    for plugin in NativePlugin::ALL {
        let name = plugin.name();
        if !filter.iter().all(|part| name.contains(part)) {
            continue;
        }
        let module = fs::read(Path::new(plugins).join(format!("{name}.wasm")))?;
        let tell = |done: usize, all: usize| {
            if done.is_multiple_of(10) {
                eprintln!("{name}: {done} of {all}");
            }
        };
        let never = AtomicBool::new(false);
        let scored = score(&module, &corpus, &options, &tell, &never)?;
        println!("{}", serde_json::to_string(&(name, &scored))?);
        scores.put(name, &scored);
        // What is known is kept, whatever becomes of the next.
        fs::write(file, scores.to_toml())?;
    }
    Ok(())
}
