//! Sessions that nobody judges: two modules are compared by what they do in them.

use crate::run::subject::Subject;
use softplug_abi::Micros;
use softplug_models::{Effect, Profile, Ran, Session, Step};

/// Steps that no model proposed, and what they are given under.
pub(crate) struct Crossing {
    session: Session,
    steps: Vec<(Micros, Step)>,
}

impl Crossing {
    /// So many of a profile's: steps of its sessions, as this plug-in went through them, each mixed
    /// with those of the one before.
    pub(crate) fn of<S: Subject>(
        model: &'static Profile,
        subject: &S,
        seed: u64,
        numbers: impl Iterator<Item = u64>,
        is_over: &dyn Fn() -> bool,
    ) -> Vec<Self> {
        let mut all = Vec::new();
        let mut before: Option<Ran> = None;
        for number in numbers {
            if is_over() {
                break;
            }
            let drawn = Session::draw(model, subject.manifest(), seed, number);
            let Some(session) = drawn.filter(|session| !session.is_long()) else { continue };
            let ran = session.run(subject.manifest(), &mut || start(subject));
            if let Some(other) = &before {
                let steps = session.crossed(&ran, other, number);
                all.push(Self { session, steps });
            }
            before = Some(ran);
        }
        all
    }

    /// What a plug-in does in it.
    pub(crate) fn run<S: Subject>(&self, subject: &S) -> Vec<(Micros, Effect)> {
        let made = &mut || start(subject);
        self.session.follow(subject.manifest(), made, &self.steps).effects
    }
}

fn start<S: Subject>(subject: &S) -> Result<S::Instance, String> {
    subject.instantiate().map_err(|error| error.to_string())
}
