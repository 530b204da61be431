//! The kill matrix as a page for people.

use super::matrix::clause;
use super::{Matrix, Scores};
use softplug_report::Noticed;
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

impl Matrix {
    /// For people, as a page of Markdown, with the scores beside.
    pub fn to_markdown(&self, scores: &Scores) -> String {
        page(self, scores)
    }
}

/// The page.
fn page(matrix: &Matrix, scores: &Scores) -> String {
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
    write_scores(&mut text, scores);
    for profile in profiles {
        let _ = writeln!(text, "\n## {profile}\n");
        write_kills(&mut text, matrix, profile);
        write_survivors(&mut text, matrix, profile);
        write_unbreakable(&mut text, matrix, profile);
    }
    text
}

fn write_scores(text: &mut String, scores: &Scores) {
    if scores.rows.is_empty() {
        return;
    }
    text.push_str(
        "\n## Changes of the module\n\n\
         These mutants were made by hand. `cargo xtask mutants --module --long` changes the built modules by machine, one instruction \
         at a time ([how](certify.md#how-good-the-cases-are)), and writes this table. \"Told\" are changes that show outside: they were noticed, or did something else in \
         some run and nothing objected. The share is of these.\n\n\
         | plug-in | changes | tried | noticed by cases | by permutations | by random sessions | told, not noticed | share | the same in every run | not executed, or no module |\n\
         |---|---:|---:|---:|---:|---:|---:|---:|---:|---:|\n",
    );
    for row in &scores.rows {
        let Noticed { lint, cases, permutations, sessions } = row.noticed;
        let share = row.share();
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {permutations} | {sessions} | {} | {}.{} % | {} | {} |",
            row.plugin,
            row.changes,
            row.tried,
            lint + cases,
            row.different.len(),
            share / 10,
            share % 10,
            row.same,
            row.not_executed + u64::from(row.invalid)
        );
    }
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
