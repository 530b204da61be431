//! What is run: a plug-in in virtual time, in every permutation of a trace, and what was
//! seen of it. Nothing here knows what is right.

pub(crate) mod back_to_back;
pub(crate) mod class;
pub(crate) mod cut;
pub(crate) mod erased;
pub(crate) mod fault;
pub(crate) mod outcome;
pub(crate) mod overhear;
pub(crate) mod permute;
pub(crate) mod plan;
pub(crate) mod replay;
pub(crate) mod rerun;
pub(crate) mod seen;
pub(crate) mod subject;
pub(crate) mod transcript;
pub(crate) mod watched;
pub(crate) mod way;
