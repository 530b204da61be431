//! A shop simulated with a plug-in in each unit.

use indicatif::{ProgressBar, ProgressDrawTarget};
use softplug_link::LinkOptions;
use softplug_plan::{Plan, Shop};
use softplug_shop::{Options, ShopFault, Simulated, Unit, simulate};

use crate::failure::Failure;
use crate::plugin::{AnyFault, Chosen};
use crate::screen::Screen;

/// What a plug-in has to speak: the simulated controls do.
const PROFILE: &str = "xon-xoff";

pub(super) fn simulated(
    shop: &Shop,
    plan: &Plan,
    plugin: &Chosen,
    options: &Options,
    screen: &Screen,
) -> Result<Simulated, Failure> {
    let manifest = plugin.manifest();
    if !manifest.profiles.iter().any(|profile| profile.name == PROFILE) {
        return Err(Failure::usage(format_args!(
            "{} does not claim the profile {PROFILE}, and the simulated controls speak nothing else; \
             give another plug-in",
            manifest.name
        )));
    }
    let settings = plugin.settings(&[])?;
    let units = shop.each().map(|_| {
        let options = LinkOptions { settings: settings.clone(), ..LinkOptions::default() };
        Ok(Unit { instance: plugin.instantiate()?, options })
    });
    let units = units.collect::<Result<Vec<_>, Failure>>()?;
    let bar = if screen.shows_progress() {
        ProgressBar::with_draw_target(Some(options.seconds as u64), ProgressDrawTarget::stderr())
    } else {
        ProgressBar::hidden()
    };
    let simulated = simulate(shop, &plan.service(), units, options, |seconds| {
        bar.set_position(seconds as u64);
    });
    bar.finish_and_clear();
    simulated.map_err(|fault| failure(&fault))
}

fn failure(fault: &ShopFault<AnyFault>) -> Failure {
    match fault {
        ShopFault::Rate { .. } | ShopFault::Control { .. } => Failure::usage(fault),
        ShopFault::Plugin { .. } | ShopFault::Job { .. } | ShopFault::Done { .. } => {
            Failure::plug_in(fault)
        }
    }
}
