//! What the page leaves open: a plug-in may do one or the other, and the model goes
//! both ways until it is seen which.

/// The way that is gone now: an answer to each open question, in their order.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(super) struct Ways {
    answers: Vec<bool>,
    asked: usize,
}

impl Ways {
    /// Which of two ways it is.
    pub(super) fn is_other(&mut self) -> bool {
        let answer = self.answers.get(self.asked).copied().unwrap_or(false);
        self.asked += 1;
        answer
    }

    /// One of several, of which there is at least one.
    pub(super) fn one_of<T: Copy>(&mut self, all: &[T]) -> T {
        let last = all.len() - 1;
        let other = |_: &usize| !self.is_other();
        all[(0..last).find(other).unwrap_or(last)]
    }
}

/// Something that asks.
pub(super) trait Wayfarer: Clone + PartialEq {
    /// Where it asks.
    fn ways(&mut self) -> &mut Ways;
}

/// All that may be, likeliest first.
#[derive(Clone, Debug)]
pub(super) struct Worlds<W>(Vec<W>);

impl<W: Wayfarer> Worlds<W> {
    /// These, of which there is at least one.
    pub(super) fn new(all: Vec<W>) -> Self {
        Self(all)
    }

    /// The likeliest.
    pub(super) fn first(&self) -> &W {
        &self.0[0]
    }

    pub(super) fn all(&self) -> impl Iterator<Item = &W> {
        self.0.iter()
    }

    /// Something happens in each, in all the ways that it may.
    pub(super) fn each(&mut self, happen: impl Fn(&mut W)) {
        for world in std::mem::take(&mut self.0) {
            self.go(&world, &[], &happen);
        }
    }

    fn go(&mut self, world: &W, answers: &[bool], happen: &impl Fn(&mut W)) {
        let mut gone = world.clone();
        *gone.ways() = Ways { answers: answers.to_vec(), asked: 0 };
        happen(&mut gone);
        if gone.ways().asked > answers.len() {
            for answer in [false, true] {
                self.go(world, &[answers, &[answer]].concat(), happen);
            }
            return;
        }
        *gone.ways() = Ways::default();
        if !self.0.contains(&gone) {
            self.0.push(gone);
        }
    }

    /// Those go on in which this is right.
    ///
    /// # Errors
    /// It is right in none: what the likeliest says of it.
    pub(super) fn check<E>(
        &mut self,
        mut check: impl FnMut(&mut W) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut right = Vec::new();
        let mut wrong = None;
        for mut world in std::mem::take(&mut self.0) {
            match check(&mut world) {
                Ok(()) if right.contains(&world) => {}
                Ok(()) => right.push(world),
                Err(error) => wrong = Some(wrong.unwrap_or((error, world))),
            }
        }
        match wrong {
            Some((error, world)) if right.is_empty() => {
                self.0.push(world);
                Err(error)
            }
            _ => {
                self.0 = right;
                Ok(())
            }
        }
    }
}
