//! Plans, and simulations that are held against them.

mod agreement;
mod closed_forms;
mod extremes;
mod hostile;
mod largest;
mod long;
mod mending;
mod pictures;
mod shops;
