//! Sessions and their traces come to the same.

use super::trace::of_session;
use crate::given::case::Case;
use crate::judge::run::Start;
use crate::run::subject::{FromFn, Subject as _};
use softplug_abi::Micros;
use softplug_abi::manifest::Manifest;
use softplug_models::{Given, Ran, Session, Step};
use softplug_native::NativePlugin;

/// Sessions that are looked at of each profile.
const SESSIONS: u64 = 400;

/// What a trace cannot say: another clock, jobs without a size, data in small pieces. Long ones
/// only take long.
fn can_be_held(session: &Session) -> bool {
    let conditions = &session.conditions;
    conditions.long.is_none()
        && !conditions.is_usual
        && conditions.clock == Micros::ZERO
        && conditions.has_sizes
        && conditions.pieces == usize::MAX
}

/// In a trace all that comes from the line at one time stands before what the host does: a swap
/// between two characters of that time cannot be written.
fn swaps_between_characters(ran: &Ran) -> bool {
    ran.steps.windows(2).any(|pair| {
        let [(swapped, Step::Swap), (came, Step::Given(Given::Line(_)))] = pair else {
            return false;
        };
        swapped == came
    })
}

#[test]
fn a_session_runs_again_as_its_trace() {
    for plugin in NativePlugin::ALL {
        let manifest = Manifest::parse(plugin.manifest().as_bytes()).expect("it is sound");
        let subject = FromFn::new(manifest, move || plugin.instantiate());
        for claim in &subject.manifest().profiles {
            let Some(profile) = softplug_models::profile(&claim.name) else { continue };
            let mut held = 0;
            for number in 0..SESSIONS {
                let session = Session::draw(profile, subject.manifest(), 1, number);
                let Some(session) = session.filter(can_be_held) else { continue };
                let make = &mut || Ok(plugin.instantiate());
                let ran = session.run(subject.manifest(), make);
                assert_eq!(ran.finding, None, "{} {number}", claim.name);
                if swaps_between_characters(&ran) {
                    continue;
                }
                let trace = of_session(profile, &session, &ran, subject.manifest());
                let case = Case::new("session.spt", trace);
                let failure = Start::new(&subject, &case).failure;
                let why = failure.map(|failure| format!("{failure:?}"));
                assert_eq!(why, None, "{} {number}\n{}", claim.name, case.trace.format());
                held += 1;
            }
            assert!(held > 25, "{}: {held}", claim.name);
        }
    }
}
