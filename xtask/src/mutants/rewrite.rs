//! Changes one file, so that each place asks which mutant is on.
//!
//! A change is made in the innermost block (`{ … }`) around it. That block then holds itself
//! once for each mutant, with the mutant's changes, and once as it is:
//!
//! ```text
//! { if softplug_mutant::is_on(…) { changed } else { as it is } }
//! ```

use std::ops::Range;

use proc_macro2::{Span, TokenStream};
use syn::visit::{self, Visit};

use super::change::Change;

/// A change that cannot be made.
#[derive(Debug, thiserror::Error)]
pub(crate) enum RewriteError {
    #[error("\"{id}\": its code is nowhere in the file: take it over as it is now\n{code}")]
    Nowhere { id: String, code: String },
    #[error("\"{id}\": its code is there {times} times: add lines before or behind it\n{code}")]
    Ambiguous { id: String, code: String, times: usize },
    #[error("\"{id}\": its code becomes what it was\n{code}")]
    Same { id: String, code: String },
    #[error(
        "\"{id}\": its code is in no block that runs: change what is inside of a function, or \
         write `always = true` if it does nothing by itself\n{code}"
    )]
    Outside { id: String, code: String },
    #[error("\"{id}\": two of its changes overlap: make them one")]
    Overlap { id: String },
    #[error("\"{id}\": its code ends where a bracket does not: add lines before or behind it")]
    Half { id: String },
    #[error("line {line}: this is no Rust: {cause}")]
    Parse { line: usize, cause: syn::Error },
}

/// The file's text with all changes.
pub(super) fn rewrite(source: &str, changes: &[Change]) -> Result<String, RewriteError> {
    let (always, chosen): (Vec<_>, Vec<_>) = changes.iter().partition(|change| change.is_always);
    let mut source = source.to_owned();
    for change in always {
        let edit = Edit::of(&source, change)?;
        source.replace_range(edit.range, &edit.text);
    }
    let edits: Result<Vec<_>, _> = chosen.iter().map(|change| Edit::of(&source, change)).collect();
    let edits = edits?;
    let file = syn::parse_file(&source)
        .map_err(|cause| RewriteError::Parse { line: cause.span().start().line, cause })?;
    let mut blocks = Blocks::default();
    blocks.visit_file(&file);
    let mut mutated: Vec<Mutated> = Vec::new();
    for (edit, change) in edits.iter().zip(&chosen) {
        let inside = blocks.0.iter().filter(|block| edit.is_inside(block));
        let block = inside.min_by_key(|block| block.len()).ok_or_else(|| {
            RewriteError::Outside { id: change.id.clone(), code: change.code.clone() }
        })?;
        match mutated.iter_mut().find(|mutated| mutated.inside == *block) {
            Some(mutated) if mutated.ids.contains(&edit.id) => {}
            Some(mutated) => mutated.ids.push(edit.id),
            None => mutated.push(Mutated { inside: block.clone(), ids: vec![edit.id] }),
        }
    }
    mutated.sort_by_key(|mutated| mutated.inside.start);
    Rewriter { source: &source, edits: &edits, mutated: &mutated }.text(0..source.len())
}

/// Where a change is, and what is put there: without the lines that it leaves as they are.
struct Edit<'a> {
    id: &'a str,
    range: Range<usize>,
    text: String,
}

impl<'a> Edit<'a> {
    fn of(source: &str, change: &'a Change) -> Result<Self, RewriteError> {
        let wanted: Vec<&str> = change.code.trim().lines().map(str::trim).collect();
        let becomes: Vec<&str> = change.becomes.trim().lines().collect();
        let mut lines = Vec::new();
        let mut at = 0;
        for line in source.split_inclusive('\n') {
            lines.push((line.trim(), at..at + line.len()));
            at += line.len();
        }
        let is_at = |window: &[(&str, Range<usize>)]| {
            window.iter().map(|(line, _)| *line).eq(wanted.iter().copied())
        };
        let (id, code) = (change.id.clone(), change.code.clone());
        let found: Vec<usize> = (0..(lines.len() + 1).saturating_sub(wanted.len()))
            .filter(|first| lines.get(*first..first + wanted.len()).is_some_and(is_at))
            .collect();
        let first = match found[..] {
            [] => return Err(RewriteError::Nowhere { id, code }),
            [first] => first,
            _ => return Err(RewriteError::Ambiguous { id, code, times: found.len() }),
        };
        let same = |(a, b): (&&str, &&str)| a.trim() == b.trim();
        let mut head = wanted.iter().zip(&becomes).take_while(|pair| same(*pair)).count();
        if head == wanted.len() && head == becomes.len() {
            return Err(RewriteError::Same { id, code });
        }
        let rest = wanted[head..].iter().rev().zip(becomes[head..].iter().rev());
        let mut tail = rest.take_while(|pair| same(*pair)).count();
        let differs = |lines: &[&str]| lines[head..lines.len() - tail].join("\n");
        // Half a block, as in `} else {`, is changed together with the lines around it.
        if !is_balanced(&differs(&wanted)) || !is_balanced(&differs(&becomes)) {
            (head, tail) = (0, 0);
        }
        let start = |line: usize| lines.get(line).map_or(source.len(), |(_, range)| range.start);
        let range = start(first + head)..start(first + wanted.len() - tail);
        let mut text = becomes[head..becomes.len() - tail].join("\n");
        text.push('\n');
        Ok(Self { id: &change.id, range, text })
    }

    fn is_inside(&self, block: &Range<usize>) -> bool {
        block.start <= self.range.start && self.range.end <= block.end
    }
}

/// Whether each bracket has its partner.
fn is_balanced(code: &str) -> bool {
    code.parse::<TokenStream>().is_ok()
}

/// A block with changes of its own.
struct Mutated<'a> {
    /// What stands between its braces.
    inside: Range<usize>,
    ids: Vec<&'a str>,
}

/// What stands between the braces of the blocks that run.
#[derive(Default)]
struct Blocks(Vec<Range<usize>>);

impl<'ast> Visit<'ast> for Blocks {
    fn visit_block(&mut self, block: &'ast syn::Block) {
        let inside = |open: Span, close: Span| open.byte_range().end..close.byte_range().start;
        self.0.push(inside(block.brace_token.span.open(), block.brace_token.span.close()));
        visit::visit_block(self, block);
    }

    // What the compiler works out cannot ask anything.
    fn visit_expr_const(&mut self, _constant: &'ast syn::ExprConst) {}

    fn visit_item_fn(&mut self, function: &'ast syn::ItemFn) {
        if function.sig.constness.is_none() {
            visit::visit_item_fn(self, function);
        }
    }

    fn visit_impl_item_fn(&mut self, function: &'ast syn::ImplItemFn) {
        if function.sig.constness.is_none() {
            visit::visit_impl_item_fn(self, function);
        }
    }
}

struct Rewriter<'a> {
    source: &'a str,
    edits: &'a [Edit<'a>],
    mutated: &'a [Mutated<'a>],
}

impl Rewriter<'_> {
    /// The text of a range, in which each mutated block asks.
    fn text(&self, range: Range<usize>) -> Result<String, RewriteError> {
        let mut text = String::new();
        let mut at = range.start;
        for Mutated { inside, ids } in self.mutated {
            let is_within = range.start <= inside.start && inside.end <= range.end;
            // The outer blocks come first: what lies in one that has been written is done.
            if !is_within || *inside == range || inside.start < at {
                continue;
            }
            text.push_str(&self.source[at..inside.start]);
            for id in ids {
                text.push_str(" if softplug_mutant::is_on(const { softplug_mutant::id(\"");
                text.push_str(id);
                text.push_str("\") }) {");
                text.push_str(&self.changed(inside, id)?);
                text.push_str("} else ");
            }
            text.push('{');
            text.push_str(&self.text(inside.clone())?);
            text.push_str("} ");
            at = inside.end;
        }
        text.push_str(&self.source[at..range.end]);
        Ok(text)
    }

    /// The text of a block with all changes of one mutant that lie in it.
    fn changed(&self, inside: &Range<usize>, id: &str) -> Result<String, RewriteError> {
        let mut edits: Vec<_> =
            self.edits.iter().filter(|edit| edit.id == id && edit.is_inside(inside)).collect();
        edits.sort_by_key(|edit| edit.range.start);
        let mut text = String::new();
        let mut at = inside.start;
        for edit in edits {
            if edit.range.start < at {
                return Err(RewriteError::Overlap { id: id.to_owned() });
            }
            text.push_str(&self.source[at..edit.range.start]);
            text.push_str(&edit.text);
            at = edit.range.end;
        }
        text.push_str(&self.source[at..inside.end]);
        // What closes a bracket of the block itself would change the question's own.
        if is_balanced(&text) { Ok(text) } else { Err(RewriteError::Half { id: id.to_owned() }) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOURCE: &str = "\
fn outer(held: bool) -> u8 {
    let byte = 1;
    if held {
        stop();
        wait();
    } else {
        go();
    }
    byte
}
";

    fn change(id: &str, code: &str, becomes: &str) -> Change {
        Change { id: id.into(), code: code.into(), becomes: becomes.into(), is_always: false }
    }

    /// The text's words, as a compiler sees them.
    fn tokens(code: &str) -> String {
        code.parse::<TokenStream>().expect("its brackets have partners").to_string()
    }

    fn is_on(id: &str) -> String {
        format!("softplug_mutant::is_on(const {{ softplug_mutant::id(\"{id}\") }})")
    }

    #[test]
    fn the_innermost_block_asks_for_each_mutant_in_turn() {
        let changes = [change("a", "stop();", ""), change("b", "wait();", "wait();\nwait();")];
        let (a, b) = (is_on("a"), is_on("b"));
        let expected = format!(
            "fn outer(held: bool) -> u8 {{ let byte = 1; if held {{ \
             if {a} {{ wait(); }} else if {b} {{ stop(); wait(); wait(); }} \
             else {{ stop(); wait(); }} }} else {{ go(); }} byte }}"
        );
        assert_eq!(tokens(&rewrite(SOURCE, &changes).unwrap()), tokens(&expected));
    }

    #[test]
    fn a_block_within_a_changed_block_asks_where_the_outer_one_is_as_it_was() {
        let changes = [change("outer", "byte", "byte + 1"), change("inner", "go();", "stop();")];
        let (outer, inner) = (is_on("outer"), is_on("inner"));
        let expected = format!(
            "fn outer(held: bool) -> u8 {{ if {outer} {{ let byte = 1; \
             if held {{ stop(); wait(); }} else {{ go(); }} byte + 1 }} else {{ let byte = 1; \
             if held {{ stop(); wait(); }} else {{ \
             if {inner} {{ stop(); }} else {{ go(); }} }} byte }} }}"
        );
        assert_eq!(tokens(&rewrite(SOURCE, &changes).unwrap()), tokens(&expected));
    }

    #[test]
    fn all_changes_of_a_mutant_are_made_together() {
        let changes = [change("a", "let byte = 1;", "let byte = 2;"), change("a", "go();", "")];
        let text = tokens(&rewrite(SOURCE, &changes).unwrap());
        let changed = "let byte = 2; if held { stop(); wait(); } else { } byte";
        assert!(text.contains(&tokens(changed)), "{text}");
    }

    #[test]
    fn indentation_and_lines_that_stay_do_not_count() {
        let wide = change("a", "  stop();\n        wait();\n", "stop();\n");
        let narrow = change("a", "wait();", "");
        assert_eq!(
            tokens(&rewrite(SOURCE, &[wide]).unwrap()),
            tokens(&rewrite(SOURCE, &[narrow]).unwrap()),
        );
    }

    #[test]
    fn half_a_block_is_changed_in_the_one_around_it() {
        let text = rewrite(SOURCE, &[change("a", "} else {", "} else if late() {")]).unwrap();
        let changed = "let byte = 1; if held { stop(); wait(); } else if late() { go(); } byte";
        assert!(tokens(&text).contains(&tokens(changed)), "{text}");
    }

    #[test]
    fn what_is_always_changed_asks_nothing() {
        let before = "fn outer(held: bool) -> u8 {";
        let mut change = change("a", before, &format!("fn more() {{}}\n{before}"));
        assert!(matches!(
            rewrite(SOURCE, std::slice::from_ref(&change)),
            Err(RewriteError::Outside { .. })
        ));
        change.is_always = true;
        assert_eq!(rewrite(SOURCE, &[change]).unwrap(), format!("fn more() {{}}\n{SOURCE}"));
    }

    #[test]
    fn what_cannot_be_made_says_which_and_why() {
        let error = |code: &str, becomes: &str| {
            rewrite(SOURCE, &[change("a.b/c", code, becomes)]).unwrap_err().to_string()
        };
        assert!(error("halt();", "").starts_with("\"a.b/c\": its code is nowhere in the file"));
        assert!(error("}", "").starts_with("\"a.b/c\": its code is there 2 times"));
        assert!(error("go();", " go(); ").starts_with("\"a.b/c\": its code becomes what it was"));
        assert!(error("go();", "} else {").starts_with("\"a.b/c\": its code ends where a bracket"));
        let twice = [change("a", "stop();\nwait();", "wait();"), change("a", "stop();", "go();")];
        let overlap = rewrite(SOURCE, &twice).unwrap_err();
        assert!(matches!(overlap, RewriteError::Overlap { .. }), "{overlap}");
    }

    #[test]
    fn what_the_compiler_works_out_is_no_place_for_a_question() {
        let source = "const fn two() -> u8 {\n    let two = 2;\n    two\n}\n";
        let error = rewrite(source, &[change("a", "let two = 2;", "let two = 3;")]).unwrap_err();
        assert!(matches!(error, RewriteError::Outside { .. }), "{error}");
    }
}
