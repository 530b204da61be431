//! How a walk looks: the run as a list, the moment in full, and how the plug-in
//! stands.

use std::fmt::Write as _;

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Modifier, Style, Stylize};
use ratatui::text::{Line, Span, Text};
use ratatui::widgets::{Block, List, ListItem, ListState, Paragraph, Wrap};
use softplug_abi::Micros;
use softplug_conformance::{Happening, Moment, Other, Phrase, Step};
use softplug_trace::reading;

use super::walk::Walk;
use crate::dump::Dump;

/// Columns from which on the list and the moment stand side by side.
const WIDE: u16 = 100;
/// Bytes of a dump that are shown.
const BYTES: usize = 256;

pub(super) fn draw(frame: &mut Frame<'_>, walk: &Walk) {
    let verdict = verdict(walk);
    let height = verdict.lines.len() as u16;
    let rows = Layout::vertical([
        Constraint::Length(height),
        Constraint::Min(3),
        Constraint::Length(3),
        Constraint::Length(1),
    ]);
    let [top, middle, bottom, keys] = rows.areas(frame.area());
    frame.render_widget(Paragraph::new(verdict), top);
    let (list, moment) = halves(middle);
    draw_list(frame, list, walk);
    draw_moment(frame, moment, walk);
    draw_standing(frame, bottom, walk);
    let known = "→ ← step  t next time  s next state  d difference  Home End  PgUp PgDn  q end";
    frame.render_widget(Paragraph::new(known).dim(), keys);
}

fn halves(middle: Rect) -> (Rect, Rect) {
    let [list, moment] = if middle.width >= WIDE {
        Layout::horizontal([Constraint::Percentage(52), Constraint::Percentage(48)]).areas(middle)
    } else {
        Layout::vertical([Constraint::Percentage(45), Constraint::Percentage(55)]).areas(middle)
    };
    (list, moment)
}

fn verdict(walk: &Walk) -> Text<'static> {
    let title = Span::styled(walk.title.clone(), Modifier::BOLD);
    let cut = if walk.stepper.is_cut { "  (cut: there is more)" } else { "" };
    let Some(failure) = &walk.stepper.failure else {
        let end = Micros(walk.stepper.end_us);
        return Line::from(vec![
            title,
            "  ".into(),
            "passed".green(),
            format!(" up to {end} s{cut}").into(),
        ])
        .into();
    };
    let mut lines = vec![Line::from(vec![title, "  ".into(), "FAILED".red().bold(), cut.into()])];
    lines.push(format!("the plug-in {}", failure.class.text()).into());
    if let Some(fault) = &failure.fault {
        lines.push(format!("at {}: {}", Micros(fault.at_us), fault.message).into());
    }
    if let Some(divergence) = &failure.divergence {
        let line = divergence.line.map_or(String::new(), |line| format!(", line {line}"));
        lines.push(format!("at {}{line}", Micros(divergence.at_us)).into());
        lines.push(format!("  expected  {}", divergence.expected.text).into());
        lines.push(format!("  observed  {}", divergence.observed.text).into());
    }
    Text::from(lines)
}

fn draw_list(frame: &mut Frame<'_>, area: Rect, walk: &Walk) {
    let count = walk.stepper.moments.len();
    let block = Block::bordered().title(format!(" step {} of {count} ", walk.at + 1));
    // Of a long run only what can be seen is laid out.
    let around = usize::from(area.height);
    let first = walk.at.saturating_sub(around);
    let end = count.min(walk.at + around + 1);
    let items = (first..end).map(|at| {
        let is_difference = Some(at) == walk.stepper.differs_at;
        item(&walk.stepper.moments[at], is_difference)
    });
    let list = List::new(items).block(block).highlight_style(Style::new().reversed());
    let mut state = ListState::default().with_selected(Some(walk.at - first));
    // The chosen one in the middle, so that one sees what comes.
    let half = usize::from(area.height.saturating_sub(2)) / 2;
    *state.offset_mut() = (walk.at - first).saturating_sub(half);
    frame.render_stateful_widget(list, area, &mut state);
}

/// Signs are those of a trace: `<` reaches the plug-in, `>` leaves it.
fn item(moment: &Moment, is_difference: bool) -> ListItem<'static> {
    let time = Span::from(format!("{:>11} ", Micros(moment.at_us).to_string())).dim();
    let mark = if is_difference { "!".red().bold() } else { " ".into() };
    let (arrow, text) = match &moment.what {
        Happening::Wire(bytes) => ("> ", told("", bytes)),
        Happening::Break(micros) => ("> ", format!("break of {micros} µs")),
        Happening::Step(step) => {
            let arrow = match step.given.other {
                Other::Line => "< ",
                Other::Host => "? ",
                Other::Link => ". ",
            };
            let text = told(&step.given.text, &step.given.bytes);
            (arrow, if step.fault.is_some() { format!("{text}  FAULT") } else { text })
        }
    };
    ListItem::new(Line::from(vec![mark, time, arrow.into(), text.into()]))
}

/// A text and, behind it, the beginning of its bytes.
fn told(text: &str, bytes: &[u8]) -> String {
    const SHOWN: usize = 16;
    let mut told = text.to_owned();
    for byte in bytes.iter().take(SHOWN) {
        told.push_str(if told.is_empty() { "" } else { " " });
        let _ = write!(told, "{byte:02X}");
    }
    if bytes.len() > SHOWN {
        told.push_str(" …");
    }
    told
}

fn draw_moment(frame: &mut Frame<'_>, area: Rect, walk: &Walk) {
    let moment = walk.moment();
    let lines = match &moment.what {
        Happening::Wire(bytes) => bytes_lines("bytes leave on the line", bytes),
        Happening::Break(micros) => vec![format!("a break of {micros} µs leaves").into()],
        Happening::Step(step) => step_lines(step, walk),
    };
    let line = match moment.line {
        0 => String::new(),
        line => format!("line {line} "),
    };
    let block = Block::bordered().title(format!(" {} {line}", Micros(moment.at_us)));
    frame.render_widget(Paragraph::new(lines).block(block).wrap(Wrap { trim: false }), area);
}

fn step_lines(step: &Step, walk: &Walk) -> Vec<Line<'static>> {
    let mut lines = phrase_lines("", &step.given);
    lines[0] = lines[0].clone().bold();
    for action in &step.actions {
        let sign = match action.other {
            Other::Line => "> ",
            Other::Host => "= ",
            Other::Link => "  ",
        };
        lines.extend(phrase_lines(sign, action));
    }
    if step.actions.is_empty() && step.fault.is_none() {
        lines.push("nothing is done".dim().into());
    }
    if let Some(fault) = &step.fault {
        lines.push(fault.clone().red().into());
    }
    lines.extend(step.frames.iter().map(|frame| format!("  in {frame}").into()));
    let source =
        step.last_words.as_ref().and_then(|words| Some((words, walk.source.around(words)?)));
    if let Some((words, source)) = source {
        let place = words.rsplit_once(':').and_then(|(_, line)| line.parse().ok());
        lines.extend(source.into_iter().map(|(number, text)| {
            let line = Line::from(format!("{number:>6} {text}"));
            if Some(number) == place { line.red().bold() } else { line.dim() }
        }));
    }
    lines
}

fn phrase_lines(sign: &str, phrase: &Phrase) -> Vec<Line<'static>> {
    bytes_lines(&format!("{sign}{}", phrase.text), &phrase.bytes)
}

/// A text, the bytes below it as a dump, and the names of control characters.
fn bytes_lines(text: &str, bytes: &[u8]) -> Vec<Line<'static>> {
    let mut lines: Vec<Line<'_>> = vec![text.to_owned().into()];
    if bytes.is_empty() {
        return lines;
    }
    let shown = &bytes[..bytes.len().min(BYTES)];
    lines.extend(Dump(shown).to_string().lines().map(|line| Line::from(format!("  {line}"))));
    if bytes.len() > shown.len() {
        lines.push(format!("  … {} more", bytes.len() - shown.len()).into());
    }
    let names = shown.iter().map(|byte| reading(*byte)).filter(|name| !name.starts_with('\''));
    let mut names: Vec<_> = names.collect();
    names.dedup();
    if !names.is_empty() {
        lines.push(format!("  {}", names.join(" ")).dim().into());
    }
    lines
}

fn draw_standing(frame: &mut Frame<'_>, area: Rect, walk: &Walk) {
    let moment = walk.moment();
    let after = &moment.after;
    let timers: Vec<_> = after
        .timers
        .iter()
        .map(|timer| {
            let ahead = Micros(timer.until_us - moment.at_us);
            format!("{} at {} (in {ahead})", timer.id, Micros(timer.until_us))
        })
        .collect();
    let timers = if timers.is_empty() { "none".to_owned() } else { timers.join(", ") };
    let queue = if after.is_held { "held" } else { "free" };
    let (own, instance) = match &moment.what {
        Happening::Step(step) => {
            (format!("{}, ", step.fuel), format!("   instance {}", step.instance))
        }
        Happening::Wire(_) | Happening::Break(_) => (String::new(), String::new()),
    };
    let state = after.state.as_deref().unwrap_or("not told");
    let text =
        format!("timers {timers}   queue {queue}   fuel {own}{} in all{instance}", after.fuel);
    let block = Block::bordered().title(format!(" state: {state} "));
    frame.render_widget(Paragraph::new(text).block(block), area);
}

#[cfg(all(test, feature = "native"))]
mod tests {
    use super::super::source::near;
    use super::super::walk::Turn;
    use super::*;
    use crossterm::event::{KeyCode, KeyEvent};
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;
    use softplug_abi::manifest::Manifest;
    use softplug_conformance::{Case, FromFn, Permutation, Stepper};
    use softplug_native::NativePlugin;
    use softplug_trace::Trace;

    const TRACE: &str = "\
id: xon-xoff.tx.walk
title: XOFF holds what is sent
profile: xon-xoff
clauses: xon-xoff.tx.obey-xoff
level: must
line: 9600 8N1 depth=1 reaction=0
since: 1
origin: hand-written
---
? 0.000000 send 1 \"ABCD\"
= 0.000000 check 1 good
> 0.000000 41 42          ; 'AB'
< 0.001500 13             ; DC3=XOFF
< 2.000000 11             ; DC1=XON
> 2.000000 43 44          ; 'CD'
= 2.002084 done 1 sent=4
. 5.000000
";

    fn walk(trace: &str, permutation: &Permutation) -> Walk {
        let plugin = NativePlugin::from_name("xon-xoff").unwrap();
        let manifest = Manifest::parse(plugin.manifest().as_bytes()).unwrap();
        let subject = FromFn::new(manifest, move || plugin.instantiate());
        let case = Case::new("xon-xoff.tx.walk.spt", Trace::parse(trace).unwrap());
        let stepper = Stepper::new(&subject, &case, permutation);
        Walk::new(stepper, "xon-xoff.tx.walk/uncut  xon-xoff".to_owned(), near(None))
    }

    fn screen(walk: &Walk, width: u16, height: u16) -> String {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        terminal.draw(|frame| draw(frame, walk)).unwrap();
        terminal.backend().to_string()
    }

    fn press(walk: &mut Walk, keys: &[KeyCode]) {
        for key in keys {
            assert_eq!(walk.take(KeyEvent::from(*key)), Turn::On);
        }
    }

    #[test]
    fn a_walk_forward_and_back_wide_and_narrow() {
        let mut walk = walk(TRACE, &Permutation::Uncut);
        press(&mut walk, &[KeyCode::Char('t'), KeyCode::Char('t')]);
        insta::assert_snapshot!("wide", screen(&walk, 110, 24));
        insta::assert_snapshot!("narrow", screen(&walk, 60, 24));
        let there = walk.at;
        press(&mut walk, &[KeyCode::Right, KeyCode::Right, KeyCode::Left, KeyCode::Left]);
        assert_eq!(walk.at, there);
        press(&mut walk, &[KeyCode::End, KeyCode::Right]);
        assert_eq!(walk.at, walk.stepper.moments.len() - 1);
        press(&mut walk, &[KeyCode::Home, KeyCode::Left, KeyCode::PageUp]);
        assert_eq!(walk.at, 0);
        for key in [KeyCode::Char('q'), KeyCode::Esc] {
            assert_eq!(walk.take(KeyEvent::from(key)), Turn::End);
        }
    }

    #[test]
    fn it_begins_at_the_difference_and_finds_it_again() {
        let mut walk = walk(&TRACE.replace("43 44 ", "43 45 "), &Permutation::Uncut);
        let found = walk.at;
        insta::assert_snapshot!("difference", screen(&walk, 110, 20));
        press(&mut walk, &[KeyCode::Home, KeyCode::Char('d')]);
        assert_eq!(walk.at, found);
    }

    #[test]
    fn a_swap_shows_as_another_instance() {
        let mut walk = walk(TRACE, &Permutation::SwapAll);
        press(&mut walk, &[KeyCode::End]);
        assert!(!screen(&walk, 110, 20).contains("instance 1 "));
        assert!(screen(&walk, 110, 20).contains("passed"));
    }

    #[test]
    fn the_smallest_terminal_is_no_reason_to_fail() {
        let walk = walk(TRACE, &Permutation::Uncut);
        for (width, height) in [(1, 1), (5, 2), (20, 5), (300, 3)] {
            screen(&walk, width, height);
        }
    }

    #[test]
    fn a_panic_shows_the_lines_of_its_source() {
        let top = tempfile::tempdir().unwrap();
        std::fs::create_dir(top.path().join("src")).unwrap();
        std::fs::write(top.path().join("src/lib.rs"), "fn f() {\n    panic!()\n}\n").unwrap();
        let mut walk = walk(TRACE, &Permutation::Uncut);
        walk.source = near(Some(top.path().to_owned()));
        let Happening::Step(step) = &mut walk.stepper.moments[0].what else { panic!("no step") };
        step.fault = Some("the plug-in trapped".to_owned());
        step.frames = vec!["f".to_owned()];
        step.last_words = Some("no job, at src/lib.rs:2".to_owned());
        let screen = screen(&walk, 110, 24);
        for text in ["the plug-in trapped", "in f", "2     panic!()", "FAULT"] {
            assert!(screen.contains(text), "{text}\n{screen}");
        }
    }
}
