//! One run: two ends, what they send, what goes wrong.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use softplug_abi::{LineParameters, Micros, Parity};
use softplug_machines::r3964::{Fault, Faults, Noise, Options, Priority, When};

/// Who is judged.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Subject {
    /// Another simulated station: the tests' own sanity.
    Station,
    /// The plug-in `r3964`.
    R3964,
    /// The plug-in `r3964-simplified`.
    Simplified,
}

/// A run, all of it from a seed.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    pub(crate) subject: Subject,
    /// The far end, a station; the subject is set to the same but its priority.
    pub(crate) options: Options,
    pub(crate) priority: Priority,
    /// Characters that the subject's port holds.
    pub(crate) depth: usize,
    /// How late the subject's port gives what arrived.
    pub(crate) latency: Micros,
    pub(crate) piece: usize,
    /// How long deliveries fill the subject's room.
    pub(crate) put_away_after: Micros,
    pub(crate) delivery_room: u32,
    /// When the plug-in is replaced by a new instance with its state.
    pub(crate) swaps: Vec<Micros>,
    /// When the host aborts the subject's job.
    pub(crate) aborts: Vec<Micros>,
    /// What the subject sends, and when.
    pub(crate) jobs: Vec<(Micros, Vec<u8>)>,
    /// What the station sends.
    pub(crate) blocks: Vec<(Micros, Vec<u8>)>,
    pub(crate) noise: Noise,
    /// No character of the data can be taken for control: tries are counted.
    pub(crate) is_plain: bool,
}

impl Case {
    pub(crate) fn new(subject: Subject, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let mut options = match subject {
            Subject::Simplified => Options::simplified(),
            _ => Options::default(),
        };
        let baud = random.pick(&[0, 1_200, 9_600, 9_600, 19_200, 38_400, 115_200]);
        let parity = random.pick(&[Parity::None, Parity::Even, Parity::Odd]);
        options.line = LineParameters { parity, ..LineParameters::new(baud) };
        options.bcc = random.one_in(5, false, true);
        options.qvz = Micros::from_millis(random.pick(&[500, 550, 2_000]));
        options.zvz = Micros::from_millis(random.pick(&[100, 220, 250]));
        options.reaction = Micros(random.pick(&[0, 0, 1, 500, 5_000]));
        options.block_size = random.pick(&[16, 128, 1_024]);
        options.nak_at_start = random.one_in(2, true, false);
        options.nak_on_garbage = random.one_in(3, false, true);
        let mut priority = Priority::None;
        if subject == Subject::Simplified {
            options.handshake = random.one_in(4, false, true);
            options.doubling = random.one_in(4, false, true);
            options.setup_attempts = random.pick(&[1, 3]);
        } else {
            options.setup_attempts = random.pick(&[1, 2, 3, 6]);
            options.transmission_attempts = random.pick(&[1, 2, 3, 6]);
            options.bwz = Micros::from_millis(random.pick(&[0, 1_000, 4_000]));
            let (far, near) = random.pick(&[
                (Priority::High, Priority::Low),
                (Priority::Low, Priority::High),
                (Priority::High, Priority::Low),
                (Priority::Low, Priority::High),
                (Priority::High, Priority::High),
                (Priority::Low, Priority::Low),
                (Priority::None, Priority::None),
            ]);
            options.priority = far;
            priority = near;
        }
        let is_plain = random.one_in(3, true, false);
        let span = random.pick(&[1, 500_000, 5_000_000]);
        let size = options.block_size;
        let mut jobs = random.blocks(size, span, is_plain);
        let mut blocks = random.blocks(size, span, is_plain);
        if !options.doubling {
            // What cannot be sent then.
            for (_, data) in jobs.iter_mut().chain(&mut blocks) {
                for place in 1..data.len() {
                    if data[place - 1..=place] == [0x10, 0x03] {
                        data[place] = 0x04;
                    }
                }
            }
        }
        // A third of the runs on a sound line with a sound partner.
        let trouble = random.pick(&[0, 0, 1, 2, 3, 3]);
        if trouble & 1 != 0 {
            options.faults = random.faults(&options, is_plain);
        }
        let noise = if trouble & 2 != 0 { random.noise() } else { Noise::default() };
        Self {
            subject,
            priority,
            depth: random.pick(&[1, 2, 16]),
            latency: Micros(random.pick(&[0, 0, 0, 1_000, 16_000])),
            piece: random.pick(&[0, 1, 7]),
            put_away_after: Micros(random.pick(&[0, 0, 0, 300_000, 1_000_000])),
            delivery_room: random.pick(&[1_024, 2_048, 4_096]),
            swaps: random.times(span, 40),
            aborts: random.times(span, 3),
            jobs,
            blocks,
            noise,
            is_plain,
            options,
        }
    }

    /// Whether nothing that happens may keep a block from arriving.
    pub(crate) fn is_sound(&self) -> bool {
        let is_still = self.noise == Noise { seed: self.noise.seed, ..Noise::default() };
        let is_good = self.options.faults.plan.is_empty()
            && self.aborts.is_empty()
            && self.put_away_after == Micros::ZERO;
        is_still && is_good && self.too_long() == 0 && self.is_settled()
    }

    /// How many blocks are longer than they may be.
    pub(crate) fn too_long(&self) -> usize {
        let all = self.jobs.iter().chain(&self.blocks);
        all.filter(|(_, data)| data.len() > self.options.block_size).count()
    }

    /// Whether both know who gives way, and begin when the NAKs of the start have
    /// passed: these would take attempts, and STXs that are repeated at once, or
    /// NAKs in between, can fall into the other side's reception.
    pub(crate) fn is_settled(&self) -> bool {
        let has_rule = self.options.priority != self.priority
            || self.jobs.is_empty()
            || self.blocks.is_empty();
        let start = Micros::from_millis(if self.options.nak_at_start { 50 } else { 0 });
        let mut begins = self.jobs.iter().chain(&self.blocks);
        has_rule && begins.all(|(at, _)| *at >= start)
    }

    /// Simpler cases, the simplest first.
    pub(crate) fn simpler(&self) -> Vec<Self> {
        let mut cases = Vec::new();
        let mut with = |change: &dyn Fn(&mut Self)| {
            let mut case = self.clone();
            change(&mut case);
            cases.push(case);
        };
        with(&|case| case.jobs.clear());
        with(&|case| case.blocks.clear());
        with(&|case| case.noise = Noise::default());
        with(&|case| case.aborts.clear());
        with(&|case| case.aborts.truncate(1));
        with(&|case| case.swaps.clear());
        with(&|case| case.swaps.truncate(self.swaps.len() / 2));
        with(&|case| drop(case.swaps.drain(..self.swaps.len() / 2)));
        for n in 0..self.options.faults.plan.len() {
            with(&|case| drop(case.options.faults.plan.remove(n)));
        }
        for n in 0..self.jobs.len() {
            with(&|case| drop(case.jobs.remove(n)));
        }
        for n in 0..self.blocks.len() {
            with(&|case| drop(case.blocks.remove(n)));
        }
        with(&|case| case.noise.flip_one = 0);
        with(&|case| case.noise.flip_two = 0);
        with(&|case| case.noise.drop = 0);
        with(&|case| case.noise.double = 0);
        with(&|case| case.noise.delay = 0);
        with(&|case| case.noise.insert = 0);
        with(&|case| case.noise.framing = 0);
        with(&|case| case.latency = Micros::ZERO);
        with(&|case| case.put_away_after = Micros::ZERO);
        with(&|case| case.options.reaction = Micros::ZERO);
        with(&|case| case.depth = 1);
        with(&|case| case.piece = 0);
        with(&|case| case.options.nak_at_start = false);
        for n in 0..self.jobs.len() {
            with(&|case| case.jobs[n].1.truncate(self.jobs[n].1.len() / 2));
            with(&|case| case.jobs[n].0 = Micros::ZERO);
        }
        for n in 0..self.blocks.len() {
            with(&|case| case.blocks[n].1.truncate(self.blocks[n].1.len() / 2));
            with(&|case| case.blocks[n].0 = Micros::ZERO);
        }
        let form = format!("{self:?}");
        cases.retain(|case| format!("{case:?}") != form);
        cases
    }
}

/// Chance, the same for the same seed.
pub(crate) struct Random(ChaCha8Rng);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        let mut bytes = [0; 32];
        bytes[..8].copy_from_slice(&seed.to_le_bytes());
        Self(ChaCha8Rng::from_seed(bytes))
    }

    pub(crate) fn below(&mut self, limit: u64) -> u64 {
        self.0.next_u64() % limit.max(1)
    }

    pub(crate) fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len() as u64) as usize]
    }

    pub(crate) fn one_in<T>(&mut self, n: u64, then: T, otherwise: T) -> T {
        if self.below(n) == 0 { then } else { otherwise }
    }

    fn at(&mut self, span: i64) -> Micros {
        Micros(self.below(span.cast_unsigned()).cast_signed())
    }

    /// At random, and none for every second case.
    fn times(&mut self, span: i64, most: u64) -> Vec<Micros> {
        let count = self.below(2) * self.below(most);
        let mut times: Vec<_> = (0..count).map(|_| self.at(span + 200_000)).collect();
        times.sort();
        times
    }

    pub(crate) fn data(&mut self, longest: usize, is_plain: bool) -> Vec<u8> {
        let most = self.pick(&[3, 20, longest]).min(longest) as u64;
        // Now and then longer than a block may be.
        let length = self.below(most + 1) + self.one_in(20, longest as u64, 0);
        if is_plain {
            return self.plain(length.max(1));
        }
        let is_nasty = self.below(2) == 0;
        (0..length)
            .map(|_| {
                let any = self.below(256) as u8;
                if is_nasty { self.pick(&[0x02, 0x03, 0x10, 0x10, 0x15, any]) } else { any }
            })
            .collect()
    }

    /// Printable, and with a check character that is no control character.
    fn plain(&mut self, length: u64) -> Vec<u8> {
        loop {
            let data: Vec<u8> = (0..length).map(|_| 0x40 + self.below(0x3F) as u8).collect();
            let check = data.iter().fold(0x13, |check, byte| check ^ byte);
            if ![0x02, 0x03, 0x10, 0x15].contains(&check) {
                return data;
            }
        }
    }

    fn blocks(&mut self, size: usize, span: i64, is_plain: bool) -> Vec<(Micros, Vec<u8>)> {
        let count = self.below(6);
        let mut blocks: Vec<_> =
            (0..count).map(|_| (self.at(span), self.data(size, is_plain))).collect();
        blocks.sort_by_key(|(at, _)| *at);
        blocks
    }

    fn noise(&mut self) -> Noise {
        let level = self.pick(&[1, 5, 20]);
        let mut some = || if self.below(2) == 0 { 0 } else { level };
        let [flip_one, flip_two, drop, double, delay, insert, framing] =
            std::array::from_fn(|_| some());
        let longest_delay = Micros(self.pick(&[1_000, 250_000, 3_000_000]));
        let seed = self.below(u64::MAX);
        Noise { seed, flip_one, flip_two, drop, double, delay, longest_delay, insert, framing }
    }

    fn faults(&mut self, options: &Options, is_plain: bool) -> Faults {
        let count = 1 + self.below(3);
        let plan = (0..count)
            .map(|_| {
                let when = match self.below(3) {
                    0 => When::Nth(1 + self.below(4) as u32),
                    1 => When::PerMille(300),
                    _ => When::PerMille(50),
                };
                (when, self.fault(options, is_plain))
            })
            .collect();
        Faults { seed: self.below(u64::MAX), plan }
    }

    fn fault(&mut self, options: &Options, is_plain: bool) -> Fault {
        let qvz = self.around(options.qvz, options);
        let zvz = self.around(options.zvz, options);
        let after = self.pick(&[1, 2, 3, 10]);
        let any = self.below(256) as u8;
        let byte = if is_plain {
            self.pick(&[0x15, 0x03, 0x7F, 0x00])
        } else {
            self.pick(&[0x02, 0x03, 0x10, 0x15, any])
        };
        match self.below(21) {
            0 => Fault::NoAnswer,
            1 => Fault::LateAnswer(qvz),
            2 => Fault::NakAnswer,
            3 => Fault::OtherAnswer(byte),
            4 => Fault::Conflict,
            5 => Fault::NoBuffer,
            6 => Fault::Silence(Micros(3_000_000)),
            7 => Fault::NoAcknowledgement,
            8 => Fault::LateAcknowledgement(qvz),
            9 => Fault::NakAcknowledgement,
            10 => Fault::OtherAcknowledgement(byte),
            11 => Fault::NakInBlock(after),
            12 => Fault::OtherInBlock(after, byte),
            13 => Fault::BreakInBlock(after),
            14 => Fault::LateStart(self.around(options.bwz, options)),
            15 => Fault::WrongCheck,
            16 => Fault::LoneDle(after),
            17 => Fault::Gap(after, zvz),
            18 => Fault::Cut(after),
            19 => Fault::Garbage(vec![byte, 0x55]),
            _ => Fault::Break,
        }
    }

    /// A delay after which a character ends just before, at or just after a time
    /// limit; or any.
    fn around(&mut self, limit: Micros, options: &Options) -> Micros {
        let span = limit - options.line.characters(1) - options.reaction;
        let span = match self.below(5) {
            0 => span - Micros(1),
            1 => span,
            2 => span + Micros(1),
            _ => self.at(limit.0 * 2),
        };
        span.max(Micros::ZERO)
    }
}
