//! Searches for modules that the lint lets through and that take long to compile:
//! `cargo run --release --example bombs search [SECONDS [SEED]]`.
//!
//! It turns the numbers of recipes (`tests/bombs/recipe.rs`), measures each in a process of its
//! own, climbs from the worst so far, and prints what was worse than all before. What it finds
//! belongs into `tests/bombs/corpus.rs`, and if it is over the promised 2 s or 200 MB, the lint's
//! weights are wrong. `measure RECIPE` or `measure FILE` measures one, on Linux.

#[path = "../tests/bombs/recipe.rs"]
mod recipe;

use std::error::Error;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use recipe::{Piece, Recipe};
use rustix::time::{ClockId, clock_gettime};
use softplug_host::{Host, HostOptions, lint};

/// What is promised.
const SECONDS: f64 = 2.0;
const MEGABYTES: f64 = 200.0;

type Fallible<T> = Result<T, Box<dyn Error>>;

fn main() -> Fallible<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.first().map(String::as_str) {
        Some("measure") => measure(&arguments[1..].join(" ")),
        Some("search") => {
            let seconds = arguments.get(1).map_or(Ok(600), |text| text.parse())?;
            let seed = arguments.get(2).map_or(Ok(1), |text| text.parse())?;
            search(Duration::from_secs(seconds), seed)
        }
        _ => Err("say \"search\", or \"measure\" and a recipe or file".into()),
    }
}

/// Compiles it here and prints its weight, then seconds of computing and megabytes.
fn measure(what: &str) -> Fallible<()> {
    let wasm = match what.parse::<Recipe>() {
        Ok(recipe) => recipe.module(),
        Err(_) => std::fs::read(what)?,
    };
    let host = Host::new(HostOptions { instances: 4, ..HostOptions::default() })?;
    let before = computed();
    let weight = lint(&wasm)?.weight;
    let linted = computed();
    host.load_bytes(&wasm)?;
    let compiled = computed();
    let status = std::fs::read_to_string("/proc/self/status")?;
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let peak: u64 =
        peak.and_then(|text| text.trim().strip_suffix(" kB")).ok_or("no peak")?.parse()?;
    println!(
        "{weight} {:.3} {} ({} bytes, linted in {:.3} s)",
        compiled - linted,
        peak / 1_024,
        wasm.len(),
        linted - before
    );
    Ok(())
}

/// Seconds of computing of this process so far.
fn computed() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 / 1e9
}

struct Measured {
    seconds: f64,
    megabytes: f64,
    text: String,
}

impl Measured {
    fn score(&self) -> f64 {
        (self.seconds / SECONDS).max(self.megabytes / MEGABYTES)
    }
}

fn measured(recipe: &Recipe) -> Option<Measured> {
    let mut command = Command::new(std::env::current_exe().ok()?);
    let output = command.arg("measure").arg(recipe.to_string()).stderr(Stdio::null()).output();
    let text = String::from_utf8(output.ok()?.stdout).ok()?.trim().to_owned();
    let mut words = text.split(' ').skip(1);
    let (seconds, megabytes) = (words.next()?.parse().ok()?, words.next()?.parse().ok()?);
    Some(Measured { seconds, megabytes, text })
}

fn search(limit: Duration, seed: u64) -> Fallible<()> {
    let until = Instant::now() + limit;
    let mut random = Random(seed.max(1));
    let (mut tried, mut worst) = (0, 0.0);
    while Instant::now() < until {
        let mut best: Option<(f64, Recipe)> = None;
        let mut idle = 0;
        while idle < 12 && Instant::now() < until {
            let candidate = match &best {
                Some((_, recipe)) => random.turned(*recipe),
                None => random.recipe(),
            };
            let Some(recipe) = as_large_as_may_be(candidate) else {
                idle += 1;
                continue;
            };
            tried += 1;
            let Some(found) = measured(&recipe) else {
                println!("NOT COMPILED: {recipe}");
                idle += 1;
                continue;
            };
            let score = found.score();
            if score > worst {
                worst = score;
                println!("{score:.2}  {}  {recipe}", found.text);
            }
            if best.as_ref().is_none_or(|(before, _)| score > *before) {
                (best, idle) = (Some((score, recipe)), 0);
            } else {
                idle += 1;
            }
        }
    }
    println!("{tried} tried, the worst at {worst:.2} of what is promised");
    if worst > 1.0 { Err("more than is promised".into()) } else { Ok(()) }
}

/// The recipe with as many functions, or as much in them, as the lint lets through.
fn as_large_as_may_be(recipe: Recipe) -> Option<Recipe> {
    let fits = |recipe: &Recipe| recipe.is_small() && lint(&recipe.module()).is_ok();
    let mut recipe = recipe;
    while !fits(&recipe) {
        let less = |number: &mut u32| *number = *number * 3 / 4;
        let largest = [
            &mut recipe.times,
            &mut recipe.functions,
            &mut recipe.stack,
            &mut recipe.locals,
            &mut recipe.targets,
        ];
        let largest = largest.into_iter().max_by_key(|number| **number)?;
        if *largest < 2 {
            return None;
        }
        less(largest);
    }
    for _ in 0..8 {
        let more = Recipe { functions: recipe.functions + recipe.functions / 3 + 1, ..recipe };
        if !fits(&more) {
            break;
        }
        recipe = more;
    }
    Some(recipe)
}

/// Numbers by xorshift: the same seed searches in the same way.
struct Random(u64);

impl Random {
    fn below(&mut self, most: u32) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 33) as u32 % most
    }

    /// Small numbers as often as large ones.
    fn number(&mut self, bits: u32) -> u32 {
        let bits = self.below(bits + 1);
        self.below(1 << bits)
    }

    fn piece(&mut self) -> Piece {
        Piece::ALL[self.below(Piece::ALL.len() as u32) as usize]
    }

    fn recipe(&mut self) -> Recipe {
        Recipe {
            functions: 1 + self.number(11),
            parameters: self.number(6),
            locals: self.number(10),
            stack: self.number(11),
            loops: self.number(7),
            blocks: self.number(7),
            times: self.number(12),
            pieces: [self.piece(), self.piece()],
            targets: self.number(10),
        }
    }

    fn turned(&mut self, recipe: Recipe) -> Recipe {
        let mut recipe = recipe;
        for _ in 0..=self.below(2) {
            let factor = self.below(4);
            let turn = |number: &mut u32| {
                *number = match factor {
                    0 => *number / 2,
                    1 => *number * 2 + 1,
                    2 => *number + 1 + *number / 5,
                    _ => *number * 4 / 5,
                }
            };
            match self.below(10) {
                0 => turn(&mut recipe.functions),
                1 => turn(&mut recipe.parameters),
                2 => turn(&mut recipe.locals),
                3 => turn(&mut recipe.stack),
                4 => turn(&mut recipe.loops),
                5 => turn(&mut recipe.blocks),
                6 => turn(&mut recipe.times),
                7 => turn(&mut recipe.targets),
                8 => recipe.pieces[0] = self.piece(),
                _ => recipe.pieces[1] = self.piece(),
            }
        }
        recipe
    }
}
