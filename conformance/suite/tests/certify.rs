//! Certification: verdicts, and what each of them follows from.

mod common;

#[path = "certify/baseline.rs"]
mod baseline;
#[path = "certify/corpus.rs"]
mod corpus;
#[path = "certify/small.rs"]
mod small;
#[path = "certify/verdicts.rs"]
mod verdicts;
