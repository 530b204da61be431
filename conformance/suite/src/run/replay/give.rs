//! What a plug-in is given: by the line, and by the host.

use super::Run;
use super::numbers::{job_of_link, request_of_link};
use crate::given::timeline::{Asked, Input};
use crate::run::fault::Fault;
use crate::run::subject::Subject;
use softplug_abi::{JobId, Micros, ModemLines, RequestId};
use softplug_link::{Job, VirtualLine};
use softplug_trace::Drain;

impl<S: Subject> Run<'_, S> {
    pub(super) fn hear(&mut self, now: Micros, input: &Input) -> Result<(), Fault> {
        let Self { line: VirtualLine { link, .. }, recorder, .. } = self;
        let stepped = match input {
            Input::Bytes(bytes) => link.received(now, bytes, recorder),
            Input::Character(byte) => link.received(now, &[*byte], recorder),
            Input::Damaged { kind, byte, span } => {
                link.line_error(now, *kind, *byte, *span, recorder)
            }
            Input::Modem(named, on) => {
                let (known, before) = self.modem;
                let kept = ModemLines(before.0 & !named.0);
                self.modem = (known.union(*named), kept.union(*on));
                link.modem_lines(now, self.modem.0, self.modem.1, recorder)
            }
            Input::Down(reason) => {
                self.is_down = true;
                link.link_down(now, *reason, recorder)
            }
            Input::Up => {
                self.is_down = false;
                link.link_up(now, recorder)
            }
            Input::Host(_) => Ok(()),
        };
        self.judged(now, stepped)
    }

    pub(super) fn ask(&mut self, now: Micros, asked: &Asked) -> Result<(), Fault> {
        let base = self.job_base;
        let of_link = |job: u32| job_of_link(base, job);
        let is_dripping = self.drips();
        let Self { line: VirtualLine { link, .. }, recorder, .. } = self;
        let stepped = match asked {
            Asked::Job(job, data) => {
                let job = Job { id: JobId(of_link(job.id.0)), ..job.clone() };
                recorder.add_source(job.id, data.clone());
                link.begin_job(now, job, recorder)
            }
            Asked::Pause(job) => link.pause(now, JobId(of_link(*job)), recorder),
            Asked::Resume(job) => link.resume(now, JobId(of_link(*job)), recorder),
            Asked::Abort(job) => link.abort(now, JobId(of_link(*job)), recorder),
            Asked::ForceResume => link.force_resume(now, recorder),
            Asked::Room(bytes) => {
                recorder.drain(*bytes);
                link.handle_timeout(now, recorder)
            }
            Asked::Drain(Drain::Off) => {
                self.keeps_deliveries = true;
                recorder.drain_by_hand = true;
                Ok(())
            }
            Asked::Drain(Drain::Auto) => {
                self.keeps_deliveries = false;
                recorder.drain_by_hand = is_dripping;
                recorder.drain(u32::MAX);
                link.handle_timeout(now, recorder)
            }
            Asked::Answer(request, answer) => {
                let answer = answer.as_ref().map(Vec::as_slice).map_err(|failure| *failure);
                let request = match base {
                    0 => *request,
                    _ => request_of_link(&recorder.observed[self.first..], *request),
                };
                link.answer(now, RequestId(request), answer, recorder)
            }
            Asked::Swap => return self.swap(now),
            Asked::Close => return self.close(now),
            Asked::Open => return self.open(now),
        };
        self.judged(now, stepped)
    }

    pub(super) fn open(&mut self, now: Micros) -> Result<(), Fault> {
        self.is_open = true;
        self.is_down = false;
        let opened = self.line.link.open(now, &mut self.recorder);
        self.judged(now, opened)
    }

    pub(super) fn close(&mut self, now: Micros) -> Result<(), Fault> {
        self.is_open = false;
        let closed = self.line.link.close(now, &mut self.recorder);
        self.judged(now, closed)
    }
}
