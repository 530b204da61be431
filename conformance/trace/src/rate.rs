//! Characters that came, or left, one after the other at the line's rate, as one line.

use crate::exchange::pace::Pace;
use crate::model::{Entry, Item, Line, Payload, SourceLine, Time, Trace, What, When};

/// Characters of a line at the most.
const CHARACTERS: usize = 4_096;

impl Trace {
    /// The trace with one `<<` line, or one `>` line, in the place of lines that follow each other
    /// at the line's rate, as a recorder writes them: no character then stands later than it stood,
    /// and none more than a quarter of a character earlier. Characters that come at one time stay as they are, and
    /// a comment or an empty line ends what can be joined.
    ///
    /// ```
    /// use softplug_trace::Trace;
    ///
    /// # let text = "\
    /// # id: echo.rx.first
    /// # title: Characters at the line's rate
    /// # profile: echo
    /// # clauses: echo.rx.all
    /// # level: must
    /// # line: 9600 8N1 depth=1 reaction=0
    /// # since: 1
    /// # origin: hand-written
    /// # ---
    /// # < 0.000000 \"%\"
    /// # < 0.001060 \"O\"
    /// # < 0.002090 \"1\"
    /// # < 0.009000 13
    /// # ";
    /// // `< 0.000000 "%"`, `< 0.001060 "O"`, `< 0.002090 "1"`, `< 0.009000 13`
    /// let joined = Trace::parse(text)?.at_line_rate();
    /// let lines: Vec<_> = joined.entries().map(ToString::to_string).collect();
    /// assert_eq!(lines, ["<< 0.000000 \"%O1\"", "< 0.009000 13             ; DC3=XOFF"]);
    /// # Ok::<(), softplug_trace::ParseError>(())
    /// ```
    #[must_use]
    pub fn at_line_rate(&self) -> Self {
        if self.front.line.baud == 0 {
            return self.clone();
        }
        let mut joiner = Joiner {
            pace: Pace::of(&self.front.line),
            body: Vec::with_capacity(self.body.len()),
            given: None,
            sent: None,
        };
        for line in &self.body {
            joiner.take(line);
        }
        joiner.close_all();
        let mut joined = Self { front: self.front.clone(), body: joiner.body };
        joined.body.retain(|line| !is_taken(line));
        joined.last_until(joiner.pace, self.end());
        joined
    }

    /// What follows the first character of a line counts too: the trace lasts as long, and as long
    /// as it did.
    fn last_until(&mut self, pace: Pace, end: Time) {
        let last = self.entries().filter_map(|entry| match &entry.what {
            What::Burst(payload) => {
                let behind = usize::try_from(payload.length()?).ok()?.saturating_sub(1);
                Some(Time(entry.when.to.0 + pace.of_characters(behind) as u64))
            }
            _ => None,
        });
        let last = last.max().unwrap_or_default().max(end);
        if last <= self.end() {
            return;
        }
        match self.body.last_mut() {
            Some(Line::Entry(entry)) if entry.what == What::Quiet => entry.when = When::at(last),
            _ => self.body.push(Line::Entry(Entry {
                when: When::at(last),
                what: What::Quiet,
                line: SourceLine::default(),
            })),
        }
    }
}

/// A line that another one has taken in: one without bytes is nothing.
fn is_taken(line: &Line) -> bool {
    matches!(
        line,
        Line::Entry(Entry { what: What::Burst(payload) | What::Send(payload), .. })
            if payload.is_absent()
    )
}

/// Characters of one direction at the line's rate.
struct Run {
    /// Where its line stands.
    place: usize,
    /// When its first character was.
    at: u64,
    items: Vec<Item>,
    count: usize,
    /// Lines that it was made of.
    lines: usize,
}

struct Joiner {
    pace: Pace,
    body: Vec<Line>,
    given: Option<Run>,
    sent: Option<Run>,
}

impl Joiner {
    fn take(&mut self, line: &Line) {
        self.body.push(line.clone());
        let Line::Entry(entry) = line else {
            self.close_all();
            return;
        };
        let (is_sent, payload) = match &entry.what {
            What::Receive(payload) if payload.length() == Some(1) => (false, payload),
            What::Burst(payload) => (false, payload),
            What::Send(payload) => (true, payload),
            // What comes at one time does not come at the rate.
            What::Receive(_) => return self.close(false),
            _ => return,
        };
        let count = payload.length().and_then(|count| usize::try_from(count).ok());
        let plain = |item: &Item| matches!(item, Item::Hex(_) | Item::Text(_) | Item::Bad { .. });
        let is_plain = !entry.when.is_window() && payload.items().iter().all(plain);
        let Some(count) = count.filter(|count| is_plain && *count > 0 && *count <= CHARACTERS)
        else {
            return self.close(is_sent);
        };
        let at = entry.when.from.0;
        let pace = self.pace;
        let open = if is_sent { &mut self.sent } else { &mut self.given };
        if let Some(run) = open
            && run.count + count <= CHARACTERS
            && is_near(pace, run.at + pace.of_characters(run.count) as u64, at)
        {
            run.items.extend(payload.items().iter().cloned());
            run.count += count;
            run.lines += 1;
            let none = Payload::default();
            let taken = if is_sent { What::Send(none) } else { What::Burst(none) };
            if let Some(Line::Entry(last)) = self.body.last_mut() {
                last.what = taken;
            }
            return;
        }
        self.close(is_sent);
        let (place, items) = (self.body.len() - 1, payload.items().to_vec());
        let run = Run { place, at, items, count, lines: 1 };
        *(if is_sent { &mut self.sent } else { &mut self.given }) = Some(run);
    }

    fn close_all(&mut self) {
        self.close(false);
        self.close(true);
    }

    fn close(&mut self, is_sent: bool) {
        let open = if is_sent { &mut self.sent } else { &mut self.given };
        let Some(run) = open.take().filter(|run| run.lines > 1) else { return };
        let Some(Line::Entry(first)) = self.body.get_mut(run.place) else { return };
        let payload = written(&run.items);
        first.what = if is_sent { What::Send(payload) } else { What::Burst(payload) };
    }
}

/// At most a quarter of a character behind: who reads is never before the line. What is early is
/// no part of a run, or it could be overtaken by what follows it.
fn is_near(pace: Pace, due: u64, at: u64) -> bool {
    at.checked_sub(due).is_some_and(|late| late <= pace.of_characters(1) as u64 / 4)
}

/// The characters as an author would write them: what is not damaged in one piece.
fn written(items: &[Item]) -> Payload {
    let mut pieces = Vec::new();
    let mut run = Vec::new();
    for item in items {
        match item {
            Item::Hex(bytes) | Item::Text(bytes) => run.extend(bytes),
            other => {
                pieces.extend_from_slice(Payload::from_bytes(&std::mem::take(&mut run)).items());
                pieces.push(other.clone());
            }
        }
    }
    pieces.extend_from_slice(Payload::from_bytes(&run).items());
    Payload::new(pieces)
}
