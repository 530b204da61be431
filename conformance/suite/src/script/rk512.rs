//! RK512: what the host asks for through the plug-in, and what a simulated computer asks
//! of the host.

use super::case::Script;
use super::failure::Outcome;
use super::play::Play;
use super::setup::Setup;
use softplug_abi::{Failure, Micros, Value, Values};
use softplug_link::Observed;
use softplug_machines::r3964::rk512::{Area, Computer, Memory, Options};

const LONG: Micros = Micros::from_secs(1_000);
const SETTINGS: [(&str, &str); 4] =
    [("layer", "rk512"), ("nak_at_start", "off"), ("block_size", "256"), ("priority", "low")];
/// Values that both 3964R and its simplified form are set to, where they differ.
const PROCEDURE: [(&str, &str); 3] =
    [("bwz", "4000"), ("setup_attempts", "6"), ("transmission_attempts", "6")];

pub(super) fn scripts() -> Vec<Script> {
    vec![write_and_read(), late(), served(), unknown_area()]
}

fn setup() -> Setup {
    let settings: Vec<_> = SETTINGS.into_iter().chain(PROCEDURE).collect();
    Setup::new(Options::default().procedure.line, &settings)
}

fn computer() -> Computer {
    let mut options = Options::default();
    options.procedure.nak_at_start = false;
    let mut memory = Memory::default();
    memory.set(Area::Db(5), content());
    let mut computer = Computer::new(options).expect("the scenario's computer is sound");
    computer.memory = memory;
    computer
}

/// 300 words.
fn content() -> Vec<u8> {
    (0..600_u32).map(|n| (n * 7 + n / 256) as u8).collect()
}

/// More than one telegram each, so that follow-ups are needed.
fn write_and_read() -> Script {
    let clauses = [
        "rk512.send.command",
        "rk512.send.follow-up",
        "rk512.fetch.command",
        "rk512.fetch.follow-up",
    ];
    let title = "300 bytes are written into a computer and read back, in several telegrams";
    Script::new("rk512", "rk512.loop.write-and-read", title, &clauses, |context| {
        context.play(&setup(), computer(), |play| {
            let data: Vec<u8> = (0..300_u32).map(|n| (n * 13 + 5) as u8).collect();
            let place = [("area", "DB"), ("block", "5"), ("offset", "20")];
            let write = play.job("write", &place, &data)?;
            let end = play.end_of(write, LONG)?;
            play.demand("the write must be done", end.is_ok(), end)?;
            let mut expected = content();
            expected[40..340].copy_from_slice(&data);
            let memory = play.partner().memory.area(Area::Db(5)).map(<[u8]>::to_vec);
            play.same_bytes("the computer's memory", &expected, &memory.unwrap_or_default())?;
            let place = [("area", "DB"), ("block", "5"), ("offset", "10"), ("count", "160")];
            let read = play.job("read", &place, b"")?;
            let end = play.end_of(read, LONG)?;
            play.demand("the read must be done", end.is_ok(), end)?;
            let deliveries = play.deliveries();
            play.equal("deliveries", 1, deliveries.len())?;
            play.same_bytes("what was read", &expected[20..340], &deliveries[0].1.bytes)?;
            let errors: Vec<u8> = play.partner().served.iter().map(|one| one.error).collect();
            play.equal("errors of the computer", vec![0; errors.len()], errors)
        })
    })
}

/// As from a slow disk or over a network.
fn late() -> Script {
    let title = "What is written into a computer comes late, in pieces, and arrives as it is";
    let clauses = ["rk512.send.command", "rk512.send.follow-up"];
    Script::new("rk512", "rk512.loop.late", title, &clauses, |context| {
        context.play(&setup(), computer(), |play| {
            let data: Vec<u8> = (0..300_u32).map(|n| (n * 13 + 5) as u8).collect();
            let place = [("area", "DB"), ("block", "5"), ("offset", "20")];
            let write = play.late_job("write", &place, &data)?;
            let end = play.end_of_late(write, 17, Micros::from_millis(30))?;
            play.demand("the write must be done", end.is_ok(), end)?;
            let mut expected = content();
            expected[40..340].copy_from_slice(&data);
            let memory = play.partner().memory.area(Area::Db(5)).map(<[u8]>::to_vec);
            play.same_bytes("the computer's memory", &expected, &memory.unwrap_or_default())
        })
    })
}

/// A read of what is not there is refused by the computer.
fn unknown_area() -> Script {
    let title = "A read of a block that the computer does not have fails with its error";
    Script::new("rk512", "rk512.loop.not-there", title, &["rk512.react.error"], |context| {
        context.play(&setup(), computer(), |play| {
            let place = [("area", "DB"), ("block", "77"), ("offset", "0"), ("count", "4")];
            let read = play.job("read", &place, b"")?;
            let end = play.end_of(read, LONG)?;
            play.demand("the read must fail", end.is_err(), end)?;
            let served: Vec<_> =
                play.partner().served.iter().map(|one| u16::from(one.error)).collect();
            play.equal("commands that the computer refused", 1, served.len())?;
            let status = end.err().map(|(_, status)| status & 0xFF);
            play.equal("the error's number", Some(served[0]), status)
        })
    })
}

/// The computer reads and writes; each request of the plug-in is answered from a memory
/// of the host.
fn served() -> Script {
    let clauses = ["rk512.serve.read", "rk512.serve.write", "rk512.serve.reaction"];
    let title = "A computer writes to the host and reads it back, over telegrams and follow-ups";
    Script::new("rk512", "rk512.loop.served", title, &clauses, |context| {
        context.play(&setup(), computer(), |play| {
            let data: Vec<u8> = (0..200_u32).map(|n| (n * 11 + 3) as u8).collect();
            let mut memory = content();
            let now = play.now();
            play.partner().write(now, Area::Db(5), 7, data.clone());
            play.partner().fetch(now, Area::Db(5), 3, 120);
            let mut answered = 0;
            while play.partner().waiting() > 0 {
                let goes_on = play.step(LONG)?;
                serve(play, &mut memory, &mut answered)?;
                if !goes_on {
                    break;
                }
            }
            let mut expected = content();
            expected[14..214].copy_from_slice(&data);
            play.same_bytes("the host's memory", &expected, &memory)?;
            let results: Vec<_> =
                play.partner().outcomes.iter().map(|one| one.result.clone()).collect();
            let read = expected[6..246].to_vec();
            play.equal(
                "what the computer's commands came to",
                vec![Ok(Vec::new()), Ok(read)],
                results,
            )?;
            let stray = play.partner().stray_reactions;
            play.equal("reactions that nobody asked for", 0, stray)
        })
    })
}

/// Answers what the plug-in has asked for since the last look.
fn serve(play: &mut Play<'_, Computer>, memory: &mut [u8], answered: &mut usize) -> Outcome {
    let asked = play.host.observed.iter().filter_map(|(_, observed)| match observed {
        Observed::Request { request, kind, fields } => Some((*request, *kind, fields.clone())),
        _ => None,
    });
    let asked: Vec<_> = asked.skip(*answered).collect();
    *answered += asked.len();
    for (request, kind, fields) in asked {
        let answer = answer(play, memory, kind, &fields);
        play.answer(request.0, answer.as_ref().map(Vec::as_slice).map_err(|failure| *failure))?;
    }
    Ok(())
}

/// By the names of the plug-in's own manifest.
fn answer(
    play: &Play<'_, Computer>,
    memory: &mut [u8],
    kind: u16,
    fields: &[u8],
) -> Result<Vec<u8>, Failure> {
    let kind = play.manifest().requests.get(usize::from(kind)).ok_or(Failure::NotFound)?;
    let place = |name: &str| kind.fields.iter().position(|field| field.name == name);
    let values = Values::new(fields);
    let value = |name: &str| place(name).and_then(|place| values.find(place as u16));
    let number = |name: &str| match value(name) {
        Some(Value::Int(number)) => usize::try_from(number).ok(),
        _ => None,
    };
    if value("area") != Some(Value::Text("DB")) || number("block") != Some(5) {
        return Err(Failure::NotFound);
    }
    let start = number("offset").ok_or(Failure::BadJob)? * 2;
    let length = number("count").ok_or(Failure::BadJob)? * 2;
    let bytes = memory.get_mut(start..start + length).ok_or(Failure::NotFound)?;
    match value("data") {
        Some(Value::Bytes(data)) if data.len() == length => bytes.copy_from_slice(data),
        Some(_) => return Err(Failure::BadJob),
        None => return Ok(bytes.to_vec()),
    }
    Ok(Vec::new())
}
