//! Characters that came, or left, one after the other at the line's rate, as one line.

use crate::exchange::pace::Pace;
use crate::model::{
    Entry, Expected, Given, Item, Line, Payload, SourceLine, Time, Trace, What, When,
};

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
            given: Way::default(),
            sent: Way::default(),
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
            What::Given(Given::Burst(payload)) => {
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
    let Line::Entry(entry) = line else { return false };
    matches!(
        &entry.what,
        What::Given(Given::Burst(payload)) | What::Expected(Expected::Send(payload))
            if payload.is_absent()
    )
}

/// Characters of one direction at the line's rate.
struct Run {
    /// Where its line stands.
    place: usize,
    /// When its first character may be, so that none is too early or too late.
    at: (i64, i64),
    items: Vec<Item>,
    count: usize,
    /// Lines that it was made of.
    lines: usize,
}

/// What is open and what was last of one direction.
#[derive(Default)]
struct Way {
    run: Option<Run>,
    /// When the last character was that is no longer open.
    last: i64,
}

struct Joiner {
    pace: Pace,
    body: Vec<Line>,
    given: Way,
    sent: Way,
}

impl Joiner {
    fn take(&mut self, line: &Line) {
        let before = self.body.iter().rev().find_map(|line| {
            let entry = line.entry().filter(|_| !is_taken(line))?;
            Some(entry.when.from.0 as i64)
        });
        self.body.push(line.clone());
        let Line::Entry(entry) = line else {
            self.close_all();
            return;
        };
        let (is_sent, payload) = match &entry.what {
            What::Given(Given::Receive(payload)) if payload.length() == Some(1) => (false, payload),
            What::Given(Given::Burst(payload)) => (false, payload),
            What::Expected(Expected::Send(payload)) => (true, payload),
            // What comes at one time does not come at the rate.
            What::Given(Given::Receive(_)) => {
                self.close(false);
                self.given.last = entry.when.to.0 as i64;
                return;
            }
            _ => return,
        };
        let count = payload.length().and_then(|count| usize::try_from(count).ok());
        let plain = |item: &Item| matches!(item, Item::Hex(_) | Item::Text(_) | Item::Bad { .. });
        let is_plain = !entry.when.is_window() && payload.items().iter().all(plain);
        let at = entry.when.from.0 as i64;
        let Some(count) = count.filter(|count| is_plain && *count > 0 && *count <= CHARACTERS)
        else {
            self.close(is_sent);
            self.way(is_sent).last = at;
            return;
        };
        if count == 1 && self.join(is_sent, at, payload) {
            return;
        }
        self.close(is_sent);
        let earliest = at - self.quarter();
        // Not before what stands above it, nor before the character in front of it. What is more
        // than a character already has its time.
        let floor = before.unwrap_or(0).max(self.way(is_sent).last);
        let first = if count == 1 { earliest.max(floor).min(at) } else { at };
        let (place, items) = (self.body.len() - 1, payload.items().to_vec());
        self.way(is_sent).run = Some(Run { place, at: (first, at), items, count, lines: 1 });
    }

    /// Takes a character into the open line, if one time of its first character is right for all:
    /// none stands later than it came, or what follows could be overtaken.
    fn join(&mut self, is_sent: bool, at: i64, payload: &Payload) -> bool {
        let (pace, quarter) = (self.pace, self.quarter());
        let Some(run) = &mut self.way(is_sent).run else { return false };
        let first = at - pace.of_characters(run.count);
        let both = (run.at.0.max(first - quarter), run.at.1.min(first));
        if both.0 > both.1 || run.count == CHARACTERS {
            return false;
        }
        run.at = both;
        run.items.extend(payload.items().iter().cloned());
        run.count += 1;
        run.lines += 1;
        let none = Payload::default();
        if let Some(Line::Entry(last)) = self.body.last_mut() {
            last.what = if is_sent {
                What::Expected(Expected::Send(none))
            } else {
                What::Given(Given::Burst(none))
            };
        }
        true
    }

    fn quarter(&self) -> i64 {
        self.pace.of_characters(1) / 4
    }

    fn way(&mut self, is_sent: bool) -> &mut Way {
        if is_sent { &mut self.sent } else { &mut self.given }
    }

    fn close_all(&mut self) {
        self.close(false);
        self.close(true);
    }

    fn close(&mut self, is_sent: bool) {
        let pace = self.pace;
        let Some(run) = self.way(is_sent).run.take() else { return };
        self.way(is_sent).last = run.at.1 + pace.of_characters(run.count - 1);
        let Some(Line::Entry(first)) = self.body.get_mut(run.place).filter(|_| run.lines > 1)
        else {
            return;
        };
        let payload = written(&run.items);
        first.what = if is_sent {
            What::Expected(Expected::Send(payload))
        } else {
            What::Given(Given::Burst(payload))
        };
        first.when = When::at(Time(run.at.1 as u64));
    }
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
