//! The constraints as a linear programme.
//!
//! The variables are the fill x of each kind of machine and the round C. Rates reach from 1 to
//! 10¹² bit/s, and a solver works to fixed tolerances; so each variable is taken in units of what
//! it is at the least point. There all of them are 1, and no coefficient is above 1 but the one
//! limit of a fill.

use good_lp::{
    Expression, Solution, SolverModel, Variable, constraint, microlp, variable, variables,
};

use crate::model::Model;

/// What is to be as large as it can be.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Goal {
    /// The sum of all buffers; the round stands for it, being that sum over R and what is switched.
    Sum,
    /// The buffer of one machine. Its group must have a count of 1.
    #[cfg(test)]
    Most(usize),
    /// The buffer of one machine, as small as it can be. Its group must have a count of 1.
    #[cfg(test)]
    Least(usize),
}

/// Fills of all groups and the round, all in seconds.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Point {
    /// Of one machine of each group.
    pub(crate) fills: Vec<f64>,
    /// C.
    pub(crate) round: f64,
}

/// Solves the programme. `None` if it has no solution, or the solver finds none; whoever calls
/// holds what comes to the constraints.
pub(crate) fn solve(model: &Model, goal: Goal) -> Option<Point> {
    let round_unit = model.least_round()?;
    let units: Vec<_> = model.groups.iter().map(|group| group.least_fill(round_unit)).collect();

    let mut names = variables!();
    let round = names.add(variable().min(0.0));
    let fills: Vec<Variable> = units.iter().map(|_| names.add(variable().min(0.0))).collect();

    let objective: Expression = match goal {
        Goal::Sum => round.into(),
        #[cfg(test)]
        Goal::Most(index) => fills[index].into(),
        #[cfg(test)]
        Goal::Least(index) => -1.0 * fills[index],
    };
    let mut sum: Expression = (model.switching / round_unit).into();
    let mut rows = Vec::with_capacity(2 * fills.len() + 1);
    for ((group, unit), fill) in model.groups.iter().zip(&units).zip(&fills) {
        sum += group.count * unit / round_unit * *fill;
        // Constraint 2, over what it is at the least point.
        let scale = group.part / ((1.0 + group.part) * unit);
        let (held, waits) = (scale * group.holds, scale * round_unit);
        rows.push(constraint!(*fill - waits * round >= held));
        // Constraint 3.
        rows.push(constraint!(*fill <= group.holds / unit));
    }
    rows.push(constraint!(sum - round == 0.0));
    let solution = names.maximise(objective).using(microlp).with_all(rows).solve().ok()?;
    let fill = |(variable, unit): (&Variable, &f64)| solution.value(*variable) * unit;
    Some(Point {
        fills: fills.iter().zip(&units).map(fill).collect(),
        round: solution.value(round) * round_unit,
    })
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

    use super::*;
    use crate::shop::{Bus, Machine, Shop};

    fn near(one: f64, other: f64) -> bool {
        (one - other).abs() <= 1e-6 * one.abs().max(other.abs())
    }

    /// A number between two, each order of magnitude as likely as any other.
    fn between(random: &mut ChaCha8Rng, least: f64, most: f64) -> f64 {
        let part = random.next_u32() as f64 / u32::MAX as f64;
        least * (most / least).powf(part)
    }

    fn shop(random: &mut ChaCha8Rng) -> Shop {
        let machines = 1 + random.next_u32() % 12;
        let rate = between(random, 1e4, 1e9);
        let machine = |index: u32, random: &mut ChaCha8Rng| {
            let consumes = between(random, 0.01, 1.0) * rate / machines as f64;
            Machine {
                name: format!("m{index}"),
                rate: 4.0 * consumes.max(1.0),
                efficiency: 0.5,
                consumes: consumes.max(1.0),
                buffer: between(random, 1.0, 1e5) as u64,
                count: 1,
            }
        };
        let machines = (0..machines).map(|index| machine(index, random)).collect();
        let switch = between(random, 1e-6, 1e-1);
        Shop::new(Bus { rate, efficiency: 1.0, switch, margin: 1e-6 }, machines).unwrap()
    }

    /// Rates of ten orders of magnitude in one shop, buffers of nine.
    #[test]
    fn the_solver_finds_it_also_where_numbers_are_far_apart() {
        let mut random = ChaCha8Rng::seed_from_u64(6);
        let mut feasible = 0;
        for number in 0..3_000 {
            let rate = between(&mut random, 1e3, 1e12);
            let machines = 1 + random.next_u32() % 40;
            let machine = |index| {
                let consumes = between(&mut random, 1.0, rate / f64::from(machines));
                let buffer = between(&mut random, 1.0, 1e9) as u64;
                Machine {
                    name: format!("m{index}"),
                    rate: 1e12,
                    efficiency: 1.0,
                    consumes,
                    buffer,
                    count: 1 + u64::from(index % 3),
                }
            };
            let machines = (0..machines).map(machine).collect();
            let switch = between(&mut random, 1e-9, 60.0);
            let bus = Bus { rate, efficiency: 1.0, switch, margin: 1e-6 };
            let model = Model::new(&Shop::new(bus, machines).unwrap());
            if !model.is_feasible() {
                continue;
            }
            feasible += 1;
            let solved = solve(&model, Goal::Sum).map(|point| point.round);
            let round = model.longest_round();
            assert!(solved.is_some_and(|it| near(it, round)), "shop {number}: {solved:?}, {round}");
        }
        assert!(feasible > 300, "{feasible}");
    }

    #[test]
    fn the_solver_finds_what_the_closed_forms_say() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut feasible = 0;
        for number in 0..300 {
            let shop = shop(&mut random);
            let model = Model::new(&shop);
            let sum = solve(&model, Goal::Sum);
            assert_eq!(sum.is_some(), model.is_feasible(), "shop {number}: {shop:?}");
            let Some(sum) = sum else { continue };
            feasible += 1;
            assert!(near(sum.round, model.longest_round()), "shop {number}");
            let least_round = model.least_round().unwrap();
            for (index, group) in model.groups.iter().enumerate() {
                let least = solve(&model, Goal::Least(index)).unwrap().fills[index];
                assert!(near(least, group.least_fill(least_round)), "shop {number}, least {index}");
                let most = solve(&model, Goal::Most(index)).unwrap().fills[index];
                assert!(near(most, model.most_fill(group)), "shop {number}, most {index}");
            }
        }
        assert!((50..=250).contains(&feasible), "{feasible} of 300 are feasible");
    }
}
