//! Certification: verdicts, and what each of them follows from.

mod common;

#[path = "certify/baseline.rs"]
mod baseline;
#[path = "certify/corpus.rs"]
mod corpus;
#[path = "certify/coverage.rs"]
mod coverage;
#[path = "certify/score.rs"]
mod score;
#[path = "certify/small.rs"]
mod small;
#[path = "certify/verdicts.rs"]
mod verdicts;
