//! What many links cost, and how long an echo takes over them: TCP client,
//! endpoint, plug-in in its sandbox, pty, and back. With ser2net in the
//! gateway's place, the same without a plug-in.
//!
//! ```text
//! many_links echo PLUGIN.wasm LINKS SECONDS
//! many_links ser2net CHARDELAY LINKS SECONDS
//! many_links saturate PLUGIN.wasm LINKS SECONDS DEPTH
//! many_links feed PLUGIN.wasm LINKS SECONDS DEPTH FANUC.wasm FANUC_DEPTH
//! many_links lathes PLUGIN.wasm LINKS SECONDS DEPTH PULSE_LATHE.wasm LATHES LATHE_DEPTH
//! ```
//!
//! `echo` and `ser2net` send 16 bytes over each link every 100 ms; `saturate`
//! fills lines of 9,600 baud both ways and looks at each byte; `feed` drip-feeds a
//! control at 19,200 baud beside that, `lathes` has lathes take 4,000 pulses a second
//! each. Each prints one line of JSON. What is measured is another process, so that the clients' and machines' own work does
//! not count.
//!
//! With `--real-time` the gateway's I/O threads, or ser2net, have real-time
//! priority 1. With `--apart` the first processor is for what is measured and for
//! the kernel's workers, the others are for the harness; that needs root, and what is
//! interrupted leaves `1` in `/sys/devices/virtual/workqueue/cpumask`.
#![allow(unreachable_pub)]

#[path = "../common/control.rs"]
mod control;
mod echo;
mod feed;
mod gateway;
mod lathes;
mod placement;
mod saturate;
mod subject;
mod used;

use std::error::Error;
use std::time::Duration;

use lathes::Wish;
use placement::Placement;
use softplug_live::pty::PtyPair;
use subject::{Subject, Wanted};

type Outcome<T = ()> = Result<T, Box<dyn Error>>;

fn main() -> Outcome {
    let (options, arguments): (Vec<String>, Vec<String>) =
        std::env::args().skip(1).partition(|argument| argument.starts_with("--"));
    let placement = Placement::new(&options)?;
    let of = |at: usize| {
        arguments.get(at).map(String::as_str).ok_or("read the first lines of the source")
    };
    let mode = of(0)?;
    if mode == "gateway" {
        return gateway::run(placement, &arguments[1..]);
    }
    let (links, seconds) = (of(2)?.parse()?, of(3)?.parse()?);
    let machines = (0..links).map(|_| PtyPair::open()).collect::<Result<Vec<_>, _>>()?;
    let span = Duration::from_secs(seconds);
    let wanted = |baud, depth| {
        let paths = machines.iter().map(PtyPair::slave_path);
        paths.map(|path| Wanted::new(path, of(1)?, baud, depth)).collect::<Outcome<Vec<_>>>()
    };
    let result = match mode {
        "echo" => {
            let mut subject = Subject::gateway(placement, &[of(1)?])?;
            subject.add(&wanted(echo::BAUD, echo::DEPTH)?)?;
            echo::measure(&subject, &machines, span)?
        }
        "ser2net" => echo::measure(
            &Subject::ser2net(placement, of(1)? == "true", &machines)?,
            &machines,
            span,
        )?,
        "saturate" => {
            let mut subject = Subject::gateway(placement, &[of(1)?])?;
            subject.add(&wanted(saturate::BAUD, of(4)?.parse()?)?)?;
            saturate::run(&subject, &machines, span)?
        }
        "feed" => {
            let mut subject = Subject::gateway(placement, &[of(1)?, of(5)?])?;
            subject.add(&wanted(saturate::BAUD, of(4)?.parse()?)?)?;
            feed::run(&mut subject, &machines, of(5)?, of(6)?.parse()?, seconds)?
        }
        "lathes" => {
            let mut subject = Subject::gateway(placement, &[of(1)?, of(5)?])?;
            subject.add(&wanted(saturate::BAUD, of(4)?.parse()?)?)?;
            let (plugin, count, depth) = (of(5)?, of(6)?.parse()?, of(7)?.parse()?);
            lathes::run(&mut subject, &machines, &Wish { plugin, count, depth, seconds })?
        }
        _ => return Err("no such measurement".into()),
    };
    println!("{result}");
    Ok(())
}
