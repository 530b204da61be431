//! The budget of an event is its own: what a session did before changes neither which event
//! is too much nor what it used. Under every engine.

use crate::common::{ENGINES, Guest, INPUT, host};
use proptest::collection::vec;
use proptest::prelude::*;
use softplug_abi::{Event, EventKind, Instance, Micros};
use softplug_host::{HostOptions, Plugin, Session, SessionFault};
use std::sync::LazyLock;

const BUDGET: u64 = 10_000;

/// How a step ends, after its rounds.
const RETURN: u8 = 0;
const UNREACHABLE: u8 = 1;
const OUT_OF_BOUNDS: u8 = 2;

/// Under each engine a guest that computes for as many rounds as its input says, and the most
/// of them that the budget allows.
static GUESTS: LazyLock<Vec<(Plugin, u32)>> = LazyLock::new(|| {
    let guest = Guest::stepping(&format!(
        "(local i32)
        (local.set 3 (i32.load (i32.const {INPUT})))
        (block (loop
            (br_if 1 (i32.eqz (local.get 3)))
            (local.set 3 (i32.sub (local.get 3) (i32.const 1)))
            (br 0)))
        (if (i32.eq (i32.load8_u offset=4 (i32.const {INPUT})) (i32.const {UNREACHABLE}))
            (then unreachable))
        (if (i32.eq (i32.load8_u offset=4 (i32.const {INPUT})) (i32.const {OUT_OF_BOUNDS}))
            (then (drop (i32.load (i32.const -4)))))
        (i32.const 0)"
    ));
    let mut guests = Vec::new();
    for engine in ENGINES {
        let options = HostOptions { engine: *engine, ..HostOptions::default() };
        let host = host(HostOptions { fuel_per_event: BUDGET, ..options });
        let plugin = host.load_bytes(&guest.wasm()).unwrap();
        let fits = |rounds: &u32| step(&mut plugin.instantiate().unwrap(), *rounds, RETURN).is_ok();
        let most = (0..BUDGET as u32).take_while(fits).last().unwrap();
        guests.push((plugin, most));
    }
    guests
});

fn step(session: &mut Session, rounds: u32, end: u8) -> Result<(), SessionFault> {
    let [a, b, c, d] = rounds.to_le_bytes();
    session.step(&Event::Received(&[a, b, c, d, end]), Micros::ZERO).map(|_| ())
}

/// How such an event ends where it is the first, and what it uses.
fn first(plugin: &Plugin, rounds: u32, end: u8) -> (Result<(), SessionFault>, u64) {
    let mut session = plugin.instantiate().unwrap();
    (step(&mut session, rounds, end), session.fuel_used())
}

fn exhausted() -> SessionFault {
    SessionFault::BudgetExhausted { event: EventKind::Received, fuel: BUDGET }
}

#[test]
fn one_round_more_is_too_much_whatever_went_before() {
    for (plugin, most) in GUESTS.iter() {
        let (most, a_round) = (*most, first(plugin, 2, RETURN).1 - first(plugin, 1, RETURN).1);
        let (taken, largest) = first(plugin, most, RETURN);
        assert_eq!(taken, Ok(()));
        assert!((BUDGET - 2 * a_round..=BUDGET).contains(&largest), "{largest}");
        let histories: [&[u32]; 6] =
            [&[], &[0], &[most], &[most, most, most], &[1; 50], &[most / 2]];
        for history in histories {
            let mut session = plugin.instantiate().unwrap();
            for rounds in history {
                step(&mut session, *rounds, RETURN).unwrap();
            }
            step(&mut session, most, RETURN).unwrap();
            assert_eq!(session.fuel_used(), largest, "{history:?}");
            assert_eq!(step(&mut session, most + 1, RETURN), Err(exhausted()), "{history:?}");
            assert_eq!(session.fuel_used(), BUDGET);
        }
    }
}

#[test]
fn past_the_budget_it_is_the_budget_that_ends_a_session_and_not_a_trap() {
    for (plugin, most) in GUESTS.iter() {
        for end in [UNREACHABLE, OUT_OF_BOUNDS] {
            let mut session = plugin.instantiate().unwrap();
            step(&mut session, most / 3, RETURN).unwrap();
            let fault = step(&mut session, *most / 2, end).unwrap_err();
            assert!(matches!(fault, SessionFault::Trapped { .. }), "{fault}");
            // One round more is left to an engine that counts operator by operator: it comes to
            // the trap earlier than to the return.
            for rounds in [most + 2, most + 3, most * 3 / 2, most * 2, most * 9] {
                let mut session = plugin.instantiate().unwrap();
                step(&mut session, most / 3, RETURN).unwrap();
                assert_eq!(step(&mut session, rounds, end), Err(exhausted()), "{rounds}");
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn an_event_ends_as_if_it_were_the_first(
        history in vec(0..=1_000_u32, 0..12),
        rounds in 0..=2_500_u32,
        end in RETURN..=OUT_OF_BOUNDS,
    ) {
        for (plugin, most) in GUESTS.iter() {
            let mut session = plugin.instantiate().unwrap();
            let (mut total, mut largest) = (0, 0);
            for part in &history {
                step(&mut session, most * part / 1_000, RETURN).unwrap();
                total += session.fuel_used();
                largest = largest.max(session.fuel_used());
            }
            let rounds = most * rounds / 1_000;
            let (result, used) = first(plugin, rounds, end);
            prop_assert_eq!(step(&mut session, rounds, end), result);
            prop_assert_eq!(session.fuel_used(), used);
            prop_assert_eq!(session.total_fuel(), total + used);
            prop_assert_eq!(session.largest_fuel(), largest.max(used));
        }
    }
}
