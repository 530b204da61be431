//! The bench: a line in virtual time for authors' tests.

use softplug_abi::manifest::SettingError;
use softplug_link::Observed;
use softplug_plugin::bench::{Bench, BenchError};
use softplug_plugin::{
    Context, Converter, DeliveryId, Failure, JobId, JobStart, LineErrorKind, LineParameters,
    MarkId, MarkState, Micros, ModemLines, NoteLevel, RequestId, StateError, StateReader,
    StateWriter, Values, manifest, settings,
};

settings! {
    /// The settings.
    pub struct Settings {
        burst: i64 = 4 in 1..=100 "bytes", "Asked for at a time.";
    }
}

/// Sends a job's data as it comes; delivers what it receives until `.`.
#[derive(Debug)]
struct Relay {
    burst: u32,
    job: JobId,
    sent: u64,
    delivery: DeliveryId,
}

impl Converter for Relay {
    type Settings = Settings;
    const MANIFEST: &'static str = manifest! {
        head: r#""abi":"1.0","name":"relay","version":"1","licence":"MIT","protocol":"p","description":"d""#,
        settings: Settings,
        tail: r#""jobs":[{"name":"send","text":"t"},{"name":"ask","text":"t"}],"state":{"saves":1,"accepts":[1]}"#,
    };
    const STATE_FORMAT: Option<u16> = Some(1);

    fn new(settings: Settings) -> Self {
        Self { burst: settings.burst as u32, job: JobId::NONE, sent: 0, delivery: DeliveryId::NONE }
    }

    fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        for byte in bytes {
            if self.delivery == DeliveryId::NONE {
                self.delivery = DeliveryId(1);
                link.delivery_begin(DeliveryId(1), JobId::NONE);
            }
            if *byte == b'.' {
                link.delivery_end(DeliveryId(1), None, 0);
                self.delivery = DeliveryId::NONE;
            } else if link.delivery_room() > 0 {
                link.deliver(DeliveryId(1), &[*byte]);
            } else {
                link.note(NoteLevel::Error, 1, "lost");
            }
        }
    }

    fn line_error(
        &mut self,
        link: &mut Context<'_>,
        kind: LineErrorKind,
        byte: Option<u8>,
        _span: u32,
    ) {
        link.note(NoteLevel::Warning, u16::from(byte.unwrap_or(0)), kind.name());
    }

    fn modem_lines(&mut self, link: &mut Context<'_>, known: ModemLines, on: ModemLines) {
        link.set_modem_lines(
            ModemLines::RTS,
            if on == known { ModemLines::RTS } else { ModemLines(0) },
        );
    }

    fn job_begin(&mut self, link: &mut Context<'_>, job: JobStart<'_>) {
        if job.kind == 1 {
            link.request(RequestId(9), 0, job.fields);
            link.job_done(job.job, 0);
            return;
        }
        self.job = job.job;
        self.sent = 0;
        link.want(job.job, self.burst);
    }

    fn job_data(&mut self, link: &mut Context<'_>, job: JobId, bytes: &[u8]) {
        self.sent += bytes.len() as u64;
        link.transmit(bytes);
        link.want(job, bytes.len() as u32);
    }

    fn job_end(&mut self, link: &mut Context<'_>, _job: JobId) {
        link.transmit_marked(MarkId(1), &[]);
    }

    fn mark(&mut self, link: &mut Context<'_>, _mark: MarkId, state: MarkState) {
        if state == MarkState::SurelyLeft {
            link.job_done(self.job, self.sent);
        }
    }

    fn abort(&mut self, link: &mut Context<'_>, job: JobId) {
        link.discard();
        link.job_failed(job, Failure::Aborted, 0, 0);
    }

    fn save(&self, state: &mut StateWriter<'_>) {
        state.u32(self.job.0);
        state.u64(self.sent);
        state.u32(self.delivery.0);
    }

    fn restore(&mut self, _format: u16, state: &mut StateReader<'_>) -> Result<(), StateError> {
        (self.job, self.sent) = (JobId(state.u32()), state.u64());
        self.delivery = DeliveryId(state.u32());
        Ok(())
    }
}

#[test]
fn a_job_leaves_at_the_lines_rate() {
    let mut bench = Bench::<Relay>::new().line(LineParameters::new(10_000)).open();
    let job = bench.send(b"ABCDEFGH");
    assert_eq!((job, bench.now()), (JobId(1), Micros::ZERO));
    bench.run_for_millis(5);
    assert_eq!(bench.sent(), b"ABCDEF");
    assert_eq!(bench.link().waiting(), 2);
    bench.run_until(Micros(7_999));
    assert_eq!(bench.link().job(), Some(JobId(1)));
    bench.run_until(Micros(8_000));
    let last = bench.observed().last().unwrap();
    assert_eq!(last, &(Micros(8_000), Observed::Done { job: JobId(1), sent: 8 }));
    assert_eq!(bench.send(b""), JobId(2), "ids go up");
}

#[test]
fn deliveries_can_be_drained_by_hand() {
    let mut bench = Bench::<Relay>::new().room(16, 4).drain_by_hand().open();
    bench.receive(b"123456");
    bench.drain(2);
    bench.receive(b"78.");
    assert_eq!(bench.deliveries()[0].bytes, b"123478");
    let lost = bench
        .observed()
        .iter()
        .filter(|(_, seen)| matches!(seen, Observed::Note(NoteLevel::Error, 1, _)));
    assert_eq!(lost.count(), 2);
    let mut bench = Bench::<Relay>::new().room(16, 4).open();
    bench.receive(b"1234");
    bench.receive(b"5678.");
    assert_eq!(bench.deliveries()[0].bytes, b"12345678");
}

#[test]
fn a_swap_changes_nothing_that_is_seen() {
    let run = |swaps: bool| {
        let mut bench = Bench::<Relay>::new().set("burst", "3").depth(2).open();
        bench.send(b"ABCDEFGHIJ");
        for at in 1..30_i64 {
            bench.run_until(Micros(at * 500));
            if at % 7 == 0 {
                bench.receive(b"x.y");
            }
            if swaps {
                bench.swap();
            }
        }
        bench.receive(b".");
        bench.observed().to_vec()
    };
    assert_eq!(run(true), run(false));
}

#[test]
fn errors_and_modem_lines_reach_the_converter() {
    let mut bench = Bench::<Relay>::new().open();
    bench.line_error(LineErrorKind::Parity, Some(0x41));
    bench.run_for_millis(1);
    let known = ModemLines::CTS.union(ModemLines::DSR);
    bench.modem_lines(known, known);
    bench.modem_lines(known, ModemLines::CTS);
    let seen: Vec<_> = bench.observed().iter().map(|(_, seen)| seen.clone()).collect();
    let expected = [
        Observed::Note(NoteLevel::Warning, 0x41, "parity".to_owned()),
        Observed::ModemLines(ModemLines::RTS, ModemLines::RTS),
        Observed::ModemLines(ModemLines::RTS, ModemLines(0)),
    ];
    assert_eq!(seen, expected);
    assert_eq!(bench.observed()[1].0, Micros(1_000));
}

#[test]
fn the_host_can_do_anything_else() {
    let mut bench = Bench::<Relay>::new().open();
    bench.send(b"ABCDEFGH");
    bench.run_for_millis(2);
    bench.host(|link, now, outside| link.abort(now, JobId(1), outside));
    bench.run_for_millis(20);
    assert_eq!(bench.sent(), b"AB");
    let aborted = Observed::Failed { job: JobId(1), failure: Failure::Aborted, status: 0, sent: 0 };
    assert_eq!(bench.observed().last().unwrap().1, aborted);

    let fields = [0, 0, 1, 0, 1, 0, 1].to_vec();
    bench.begin_job(1, fields.clone(), b"");
    let asked = Observed::Request { request: RequestId(9), kind: 0, fields: fields.clone() };
    assert!(bench.observed().iter().any(|(_, seen)| *seen == asked));
    assert_eq!(Values::new(&fields).count(), 1);
}

#[test]
fn a_wrong_setting_is_told() {
    let error = Bench::<Relay>::new().set("burst", "0").try_open().unwrap_err();
    assert!(
        matches!(&error, BenchError::Setting(SettingError::Range { name, .. }) if name == "burst")
    );
}

#[test]
#[should_panic(expected = "transmits more bytes than there is room for")]
fn a_converter_that_breaks_a_rule_ends_the_test() {
    let mut bench = Bench::<Relay>::new().set("burst", "100").room(8, 8).open();
    bench.send(b"ABCDEFGHIJ");
}

#[test]
#[should_panic(expected = "the converter's manifest is wrong")]
fn a_wrong_manifest_ends_the_test() {
    struct Wrong;
    impl Converter for Wrong {
        type Settings = ();
        const MANIFEST: &'static str = "{}";
        fn new((): ()) -> Self {
            Self
        }
    }
    let _ = Bench::<Wrong>::new();
}
