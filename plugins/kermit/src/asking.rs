//! A machine asks for a file, and the host sends it by a job or will not.

use crate::Kermit;
use crate::Timer;
use crate::receiver::title;
use crate::stage::Stage;
use softplug_plugin::{Context, Failure, ValueWriter, Values};

/// Room for the field of a request.
const FIELD: usize = 112;

impl Kermit {
    /// R: the machine asks for a file. The same one again changes nothing; for another one it
    /// has given up the first.
    pub(crate) fn asked(&mut self, link: &mut Context<'_>, number: u8) {
        let (name, length) = title(self.terms.theirs, self.reader.data());
        let name = name.get(..length).unwrap_or_default();
        let is_same = self.is_asking && self.asked_for.as_slice() == name;
        if is_same || self.timers.is_set(Timer::Begin) {
            return;
        }
        self.withdraw(link);
        if length == 0 {
            self.say_plainly(link, number, b"A name is needed");
            return;
        }
        let mut buffer = [0; FIELD];
        let mut fields = ValueWriter::new(&mut buffer);
        // It fits: a name has at most 94 characters.
        let _ = fields.push_ascii(0, name);
        self.asked_for.clear();
        self.asked_for.extend(name);
        self.request = self.request.next();
        self.is_asking = true;
        link.request(self.request, 0, Values::new(fields.written()));
    }

    /// The host's answer: a job follows, or none.
    pub(crate) fn answer_to(&mut self, link: &mut Context<'_>, refused: Option<Failure>) {
        self.is_asking = false;
        if self.stage != Stage::Idle {
            return;
        }
        if refused.is_some() {
            self.say_plainly(link, 0, b"There is no such file");
        } else {
            self.timers.set_after(link, Timer::Begin, self.settings.job_time);
        }
    }

    /// The machine has gone on to something else.
    pub(crate) fn withdraw(&mut self, link: &mut Context<'_>) {
        if self.is_asking {
            self.is_asking = false;
            link.withdraw(self.request);
        }
        if !self.sender.is_waiting() {
            self.timers.cancel(link, Timer::Begin);
        }
    }

    /// A job that nobody takes, or a program that was granted and did not come.
    pub(crate) fn too_late(&mut self, link: &mut Context<'_>) {
        if self.stage.is_sending() {
            self.stop(link, Failure::NoAnswer);
        } else {
            self.say_plainly(link, 0, b"The file did not come");
        }
    }
}
