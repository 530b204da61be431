//! Whether a program is one: envelope, characters, comments, loops and jumps.

use std::collections::BTreeMap;

/// What is wrong with a program, and in which line.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("line {line}: {what}")]
pub(crate) struct Unsound {
    line: usize,
    what: String,
}

/// Checks a file: `%`, one program or several, `%`, with LF at line ends.
pub(super) fn check(file: &[u8]) -> Result<(), Unsound> {
    let text = std::str::from_utf8(file).map_err(|_| unsound(1, "not even text"))?;
    let Some(body) = text.strip_prefix("%\n").and_then(|rest| rest.strip_suffix("\n%\n")) else {
        return Err(unsound(1, "not between `%` and `%`, each in a line of its own"));
    };
    let mut program: Option<Program> = None;
    let mut line = 1;
    for block in body.split('\n') {
        line += 1;
        let words = words_of(block).map_err(|what| unsound(line, &what))?;
        if words.starts_with('O') {
            program.take().map_or(Ok(()), Program::end)?;
            program = Some(Program::default());
        }
        let Some(program) = &mut program else {
            return Err(unsound(line, "a block before the first O number"));
        };
        program.block(words.trim(), line)?;
    }
    program.map_or(Ok(()), Program::end)
}

/// The block without its comments.
fn words_of(block: &str) -> Result<String, String> {
    let mut words = String::new();
    let mut in_comment = false;
    for character in block.chars() {
        match character {
            '%' => return Err("a `%` would end the tape".into()),
            ' '..='~' if character.is_ascii_lowercase() => {
                return Err(format!("`{character}` is a small letter"));
            }
            '(' if in_comment => return Err("a comment in a comment".into()),
            '(' => in_comment = true,
            ')' if !in_comment => return Err("`)` without `(`".into()),
            ')' => in_comment = false,
            ' '..='~' if in_comment => {}
            ' '..='~' => words.push(character),
            _ => return Err(format!("{character:?} is no character of ISO code here")),
        }
    }
    if in_comment {
        return Err("a comment without end".into());
    }
    if words.matches('[').count() != words.matches(']').count() {
        return Err("`[` and `]` do not match".into());
    }
    Ok(words)
}

/// What one program has opened and where it jumps.
#[derive(Default)]
struct Program {
    loops: Vec<String>,
    /// How often each sequence number stands.
    labels: BTreeMap<u32, u32>,
    jumps: Vec<(u32, usize)>,
    ended: bool,
    last_line: usize,
}

impl Program {
    fn block(&mut self, words: &str, line: usize) -> Result<(), Unsound> {
        self.last_line = line;
        if words.is_empty() {
            return Ok(());
        }
        if self.ended {
            return Err(unsound(line, "a block after the end of its program"));
        }
        let statement = self.label(words, line)?;
        if let Some(target) = statement.split_once("GOTO").map(|(_, target)| target) {
            self.jumps.push((number(target, line)?, line));
        }
        if statement.starts_with("WHILE[") {
            let (_, id) =
                statement.rsplit_once("]DO").ok_or_else(|| unsound(line, "WHILE without DO"))?;
            if !matches!(id, "1" | "2" | "3") {
                return Err(unsound(line, "a loop is DO1, DO2 or DO3"));
            }
            self.loops.push(id.to_owned());
        } else if let Some(id) = statement.strip_prefix("END") {
            if self.loops.pop().as_deref() != Some(id) {
                return Err(unsound(line, "END of a loop that is not the innermost"));
            }
        } else if !statement.starts_with("IF[") && !statement.starts_with("GOTO") {
            addresses(statement, line)?;
        }
        self.ended = ["M30", "M2", "M02", "M99"].contains(&statement);
        Ok(())
    }

    /// Takes the sequence number off.
    fn label<'a>(&mut self, words: &'a str, line: usize) -> Result<&'a str, Unsound> {
        let Some(rest) = words.strip_prefix('N') else { return Ok(words) };
        let end = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
        let (label, statement) = rest.split_at(end);
        *self.labels.entry(number(label, line)?).or_default() += 1;
        Ok(statement.trim_start())
    }

    fn end(self) -> Result<(), Unsound> {
        if !self.ended {
            return Err(unsound(self.last_line, "the program has no end (M30 or M99)"));
        }
        if !self.loops.is_empty() {
            return Err(unsound(self.last_line, "a loop has no END"));
        }
        for (target, line) in self.jumps {
            match self.labels.get(&target) {
                Some(1) => {}
                Some(_) => return Err(unsound(line, &format!("N{target} stands twice"))),
                None => return Err(unsound(line, &format!("there is no N{target}"))),
            }
        }
        Ok(())
    }
}

/// Outside of macro statements each letter is an address with a value, but for
/// the names of functions in brackets.
fn addresses(statement: &str, line: usize) -> Result<(), Unsound> {
    let statement = statement.strip_prefix('/').unwrap_or(statement);
    if statement.starts_with('#') {
        let assigns = statement.contains('=') && !statement.ends_with('=');
        return assigns.then_some(()).ok_or_else(|| unsound(line, "a variable without a value"));
    }
    let mut depth = 0;
    let mut open = false;
    let mut first = true;
    for character in statement.chars() {
        match character {
            '[' => depth += 1,
            ']' => {
                depth -= 1;
                open = false;
            }
            _ if depth > 0 => {}
            'A'..='Z' if open => return Err(unsound(line, "an address without a value")),
            'A'..='Z' => open = true,
            '0'..='9' | '.' | '#' | '-' | '+' if !first => {
                open = open && !character.is_ascii_digit();
            }
            ' ' | '/' | '*' if !first => {}
            _ => return Err(unsound(line, &format!("`{character}` where an address belongs"))),
        }
        first = false;
    }
    (!open).then_some(()).ok_or_else(|| unsound(line, "an address without a value"))
}

fn number(digits: &str, line: usize) -> Result<u32, Unsound> {
    digits.parse().map_err(|_| unsound(line, &format!("`{digits}` is no sequence number")))
}

fn unsound(line: usize, what: &str) -> Unsound {
    Unsound { line, what: what.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::check;

    fn verdict(body: &str) -> Result<(), String> {
        check(format!("%\n{body}\n%\n").as_bytes()).map_err(|error| error.to_string())
    }

    #[test]
    fn sound_programs_pass() {
        let bodies = [
            "O1\nM30",
            "O1(FIRST)\nN10 G0 X1.Y-.5 (MOVE)\nIF[#1EQ0]GOTO10\nM99\nO2\n\nM30",
            "O1\n#1=#2+SIN[#3]\nWHILE[#1LT5]DO1\nWHILE[#2LT5]DO2\nG1X#1Y[#2+1]\nEND2\nEND1\nM30",
            "O1\n/M1\nG65P9010A1.B-2.\nM30",
        ];
        for body in bodies {
            assert_eq!(verdict(body), Ok(()), "{body}");
        }
    }

    #[test]
    fn each_fault_has_its_line() {
        let cases = [
            ("G0X1.\nM30", "line 2: a block before the first O number"),
            ("O1\nG0X1.", "line 3: the program has no end (M30 or M99)"),
            ("O1\nO2\nM30", "line 2: the program has no end (M30 or M99)"),
            ("O1\nM30\nG0X1.", "line 4: a block after the end of its program"),
            ("O1(A%B)\nM30", "line 2: a `%` would end the tape"),
            ("O1(A\nM30", "line 2: a comment without end"),
            ("O1(A(B))\nM30", "line 2: a comment in a comment"),
            ("O1)\nM30", "line 2: `)` without `(`"),
            ("O1\r\nM30", "line 2: '\\r' is no character of ISO code here"),
            ("O1\ng0\nM30", "line 3: `g` is a small letter"),
            ("O1\nG0X\nM30", "line 3: an address without a value"),
            ("O1\nGX1\nM30", "line 3: an address without a value"),
            ("O1\n5\nM30", "line 3: `5` where an address belongs"),
            ("O1\nG1X[1\nM30", "line 3: `[` and `]` do not match"),
            ("O1\nGOTO5\nM30", "line 3: there is no N5"),
            ("O1\nGOTOX\nM30", "line 3: `X` is no sequence number"),
            ("O1\nGOTO5\nN5\nN5\nM30", "line 3: N5 stands twice"),
            ("O1\nWHILE[1]DO1\nM30", "line 4: a loop has no END"),
            ("O1\nWHILE[1]DO4\nM30", "line 3: a loop is DO1, DO2 or DO3"),
            ("O1\nWHILE[1]\nM30", "line 3: WHILE without DO"),
            ("O1\nEND1\nM30", "line 3: END of a loop that is not the innermost"),
            ("O1\n#1=\nM30", "line 3: a variable without a value"),
        ];
        for (body, error) in cases {
            assert_eq!(verdict(body), Err(error.to_owned()), "{body}");
        }
        let envelope = "line 1: not between `%` and `%`, each in a line of its own";
        for file in ["", "%", "%\n", "O1\nM30\n%\n", "%\nO1\nM30\n", "%\r\nO1\r\nM30\r\n%\r\n"] {
            assert_eq!(check(file.as_bytes()).unwrap_err().to_string(), envelope, "{file:?}");
        }
        assert!(check(b"%\n\xFF\n%\n").is_err());
    }
}
