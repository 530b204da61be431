//! Random sessions of a reference plug-in as native code:
//! `cargo run -p softplug-models --example sessions -- PROFILE PLUGIN FIRST COUNT [SEED]`.
//! The first that fails is made short and printed.

use softplug_abi::manifest::Manifest;
use softplug_models::{Session, profile};
use softplug_native::NativePlugin;
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [name, plugin, first, count, seed @ ..] = arguments.as_slice() else {
        return Err("PROFILE PLUGIN FIRST COUNT [SEED] are wanted".into());
    };
    let profile = profile(name).ok_or("no model has this name")?;
    let plugin = NativePlugin::ALL.iter().find(|known| known.name() == plugin);
    let plugin = *plugin.ok_or("no reference plug-in has this name")?;
    let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
    let (first, count): (u64, u64) = (first.parse()?, count.parse()?);
    let seed = seed.first().map_or(Ok(1), |seed| seed.parse())?;
    let (mut drawn, mut steps, mut effects) = (0, 0, 0);
    let mut make = || Ok(plugin.instantiate());
    for number in first..first + count {
        let Some(session) = Session::draw(profile, &manifest, seed, number) else { continue };
        let ran = session.run(&manifest, &mut make);
        (drawn, steps, effects) =
            (drawn + 1, steps + ran.steps.len(), effects + ran.observed.len());
        if ran.finding.is_none() {
            continue;
        }
        let ran = session.shrunk(&manifest, &mut make, ran);
        println!("session {number}: {:?}", ran.finding);
        println!("{:?}", session.conditions);
        for (name, value) in &session.asked {
            print!(" {name}={value}");
        }
        println!("\ngiven:");
        for (at, step) in &ran.steps {
            println!("  {:>12} {step:?}", at.0);
        }
        println!("seen:");
        for (at, observed) in &ran.observed {
            println!("  {:>12} {observed:?}", at.0);
        }
        return Err(format!("session {number} failed").into());
    }
    println!("{drawn} sessions of {count} passed: {steps} steps, {effects} effects");
    Ok(())
}
