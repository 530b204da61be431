//! What is judged: runs, held against what their traces demand and against each other.

pub(crate) mod compare;
pub(crate) mod demand;
pub(crate) mod divergence;
pub(crate) mod run;
pub(crate) mod verdict;
