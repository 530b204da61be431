//! Certification: verdicts, and what each of them follows from.

mod baseline;
mod corpus;
mod coverage;
mod score;
mod verdicts;
