//! The kill matrix as a page for people.

use super::Matrix;
use super::matrix::clause;
use std::collections::BTreeSet;
use std::fmt::Write as _;

const HEAD: &str = "\
# Kill matrix

Does the conformance suite notice a plug-in that is wrong? For every clause that binds there is a *mutant*: a reference plug-in with this one
rule broken. Each row names the first run that notices it. Only wrong behaviour counts: a trap, an exhausted budget, a broken rule of the ABI and
a refusal prove nothing. (What a clause of the ABI itself forbids shows as a broken rule; there it counts.)

This page is written by `cargo xtask mutants` and compared with a new hunt in every run of the tests. How to add a mutant:
[CONTRIBUTING.md](../CONTRIBUTING.md).

";

/// The page.
pub(super) fn page(matrix: &Matrix) -> String {
    let mut text = HEAD.to_owned();
    let profiles: BTreeSet<&str> = (matrix.kills.iter().map(|row| row.profile.as_str()))
        .chain(matrix.survivors.iter().map(|row| row.profile.as_str()))
        .chain(matrix.unbreakable.iter().map(|row| row.profile.as_str()))
        .collect();
    text += "| profile | clauses | mutants | killed | survivors | clauses that cannot be broken |\n\
             |---|---|---|---|---|---|\n";
    let mut total = [0; 5];
    for profile in &profiles {
        let counts = counts(matrix, profile);
        let [clauses, mutants, killed, survivors, unbreakable] = counts;
        let _ = writeln!(
            text,
            "| {profile} | {clauses} | {mutants} | {killed} | {survivors} | {unbreakable} |"
        );
        total.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
    }
    let [clauses, mutants, killed, survivors, unbreakable] = total;
    let _ =
        writeln!(text, "| all | {clauses} | {mutants} | {killed} | {survivors} | {unbreakable} |");
    let foreign = matrix.kills.iter().filter(|row| !row.cites).count();
    let _ = writeln!(
        text,
        "\n{foreign} of them are noticed first by a case that does not cite the broken clause; these are \
         marked with †."
    );
    for profile in profiles {
        let _ = writeln!(text, "\n## {profile}\n");
        write_kills(&mut text, matrix, profile);
        write_survivors(&mut text, matrix, profile);
        write_unbreakable(&mut text, matrix, profile);
    }
    text
}

/// Clauses with mutants, mutants, killed ones, survivors, clauses that cannot be broken.
fn counts(matrix: &Matrix, profile: &str) -> [usize; 5] {
    let killed = matrix.kills.iter().filter(|row| row.profile == profile);
    let survivors = matrix.survivors.iter().filter(|row| row.profile == profile);
    let unbreakable = matrix.unbreakable.iter().filter(|row| row.profile == profile).count();
    let clauses: BTreeSet<&str> = (killed.clone().map(|row| clause(&row.mutant)))
        .chain(survivors.clone().map(|row| clause(&row.mutant)))
        .collect();
    let (killed, survivors) = (killed.count(), survivors.count());
    [clauses.len(), killed + survivors, killed, survivors, unbreakable]
}

fn write_kills(text: &mut String, matrix: &Matrix, profile: &str) {
    let rows = matrix.kills.iter().filter(|row| row.profile == profile);
    *text += "| mutant | what is wrong | noticed by | as |\n|---|---|---|---|\n";
    for row in rows {
        let mark = if row.cites { "" } else { " †" };
        let _ = writeln!(
            text,
            "| `{}` | {} | `{}`{mark} | {} |",
            row.mutant,
            cell(&row.text),
            row.run,
            row.class
        );
    }
}

fn write_survivors(text: &mut String, matrix: &Matrix, profile: &str) {
    let mut rows = matrix.survivors.iter().filter(|row| row.profile == profile).peekable();
    if rows.peek().is_some() {
        *text += "\n| survivor | what is wrong | why no case can notice |\n|---|---|---|\n";
    }
    for row in rows {
        let _ =
            writeln!(text, "| `{}` | {} | {} |", row.mutant, cell(&row.text), cell(&row.reason));
    }
}

fn write_unbreakable(text: &mut String, matrix: &Matrix, profile: &str) {
    let mut rows = matrix.unbreakable.iter().filter(|row| row.profile == profile).peekable();
    if rows.peek().is_some() {
        *text +=
            "\n| clause without a mutant | why no change of a plug-in can break it |\n|---|---|\n";
    }
    for row in rows {
        let _ = writeln!(text, "| `{}` | {} |", row.clause, cell(&row.reason));
    }
}

/// A text that stays in its cell.
fn cell(text: &str) -> String {
    text.replace('|', "\\|").replace(['\n', '\r'], " ")
}
