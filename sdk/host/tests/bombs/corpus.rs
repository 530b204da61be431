//! Bombs that are kept: what strangers tried, and what a search (`examples/bombs.rs`) has found.

use super::recipe::Recipe;

/// What the lint must refuse. Without its bounds these took from 3 s to more than ten minutes, and
/// up to 3.9 GB.
pub(crate) const REFUSED: [&str; 12] = [
    // Functions, parameters, locals, stack, loops, blocks, times, pieces, targets.
    "43000 0 1 0 0 0 0 copy copy 0",
    "121 5 4 22 126 0 1 loop global 0",
    "1 0 1000 0 100 0 2000 copy leave 0",
    "1 0 100 0 0 0 10000 join join 0",
    "1 0 1000 0 0 0 2700 loop copy 0",
    "1 0 1000 0 0 0 2300 if if 0",
    "1 0 1 10000 0 0 10000 loop loop 0",
    "1 0 8 0 1 0 3500 loop loop 0",
    "1 0 8 0 1 0 5000 indirect indirect 0",
    "1 0 8 0 1 0 4000 grow grow 0",
    "1 0 1 0 0 0 3000 round convert 0",
    "60 4 60 1 55 26 46 again round 33",
];

/// What the lint lets through and takes longest, or most memory, of all that was found.
pub(crate) const HEAVIEST: [&str; 10] = [
    "189 37 18 14 38 11 2 call memory 16",
    "177 37 18 59 31 2 2 leave memory 16",
    "118 47 18 118 31 4 1 leave grow 16",
    "20 2 2 3 14 1 92 convert add 83",
    "70 7 1 235 31 0 1 indirect divide 4",
    "40 4 60 1 20 0 20 again round 0",
    "50 5 4 22 126 0 1 loop global 0",
    "12 0 60 0 1 0 300 join if 0",
    "3400 0 1 0 0 0 1 loop loop 0",
    "2 0 1 0 1 0 800 count round 0",
];

pub(crate) fn recipes(of: &[&str]) -> Vec<Recipe> {
    of.iter().map(|text| text.parse().expect("a recipe")).collect()
}
