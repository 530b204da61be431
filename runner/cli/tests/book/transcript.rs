//! What a `console` block says: commands behind `$`, and below each what it shows.

/// A command, and the lines that it shows. None: they are not looked at.
#[derive(PartialEq, Eq, Debug)]
pub(crate) struct Step {
    /// Lines of the block before it.
    pub(crate) line: usize,
    pub(crate) command: String,
    pub(crate) shown: Vec<String>,
}

/// Takes a block apart. A command goes on behind a `\` at the end of a line.
pub(crate) fn read(text: &str) -> Result<Vec<Step>, String> {
    let mut steps: Vec<Step> = Vec::new();
    for (line, content) in text.lines().enumerate() {
        if let Some(command) = content.strip_prefix("$ ") {
            steps.push(Step { line, command: command.to_owned(), shown: Vec::new() });
            continue;
        }
        let Some(step) = steps.last_mut() else {
            return Err("the block does not begin with a command: `$ …`".to_owned());
        };
        if step.shown.is_empty() && step.command.ends_with('\\') {
            step.command = format!("{}\n{content}", step.command);
        } else {
            step.shown.push(content.trim_end().to_owned());
        }
    }
    Ok(steps)
}

/// What is different between what the page shows and what came, if anything is. In a line
/// `…` stands for any characters, alone in a line for any lines.
pub(crate) fn difference(shown: &[String], came: &str) -> Option<String> {
    let shown: Vec<&str> = shown.iter().map(String::as_str).collect();
    let came_lines: Vec<&str> = came.trim_end().lines().map(str::trim_end).collect();
    let end = shown.iter().rposition(|line| !line.is_empty()).map_or(0, |last| last + 1);
    if shown.is_empty() || are_alike(&shown[..end], &came_lines) {
        return None;
    }
    Some(format!("--- the page shows\n{}\n--- what came\n{}", shown.join("\n"), came.trim_end()))
}

fn are_alike(shown: &[&str], came: &[&str]) -> bool {
    match shown {
        [] => came.is_empty(),
        ["…", rest @ ..] => (0..=came.len()).any(|skipped| are_alike(rest, &came[skipped..])),
        [line, rest @ ..] => match came {
            [first, others @ ..] => is_alike(line, first) && are_alike(rest, others),
            [] => false,
        },
    }
}

fn is_alike(shown: &str, came: &str) -> bool {
    let Some((begin, rest)) = shown.split_once('…') else { return shown == came };
    let Some(mut left) = came.strip_prefix(begin) else { return false };
    let parts: Vec<&str> = rest.split('…').collect();
    let (end, middle) = parts.split_last().expect("a split has a part");
    for part in middle {
        let Some(at) = left.find(part) else { return false };
        left = &left[at + part.len()..];
    }
    left.ends_with(end)
}

#[test]
fn a_block_is_commands_and_what_they_show() {
    let steps = read("$ a \\\n  b\none\n\ntwo\n$ c\n").unwrap();
    assert_eq!(steps[0].command, "a \\\n  b");
    assert_eq!(steps[0].shown, ["one", "", "two"]);
    assert_eq!((steps[1].line, steps[1].command.as_str(), steps[1].shown.len()), (5, "c", 0));
    assert!(read("one\n").is_err());
}

#[test]
fn dots_stand_for_what_differs() {
    let same = |shown: &[&str], came: &str| {
        let shown: Vec<String> = shown.iter().map(|line| (*line).to_owned()).collect();
        difference(&shown, came).is_none()
    };
    assert!(same(&[], "anything"));
    assert!(same(&["took … ms, … in all"], "took 12 ms, 3 in all\n"));
    assert!(!same(&["took … ms"], "took 12 s\n"));
    assert!(same(&["a", "…", "b"], "a\nx\ny\nb\n"));
    assert!(same(&["a", "…", "b"], "a\nb\n"));
    assert!(!same(&["a", "…", "b"], "a\nb\nc\n"));
    assert!(!same(&["a"], "a\nb\n"));
    assert!(!same(&["a…a"], "a"));
}
