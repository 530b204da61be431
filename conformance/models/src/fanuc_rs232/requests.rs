//! Requests from the panel.

use super::delivery::Delivery;
use super::rules::Rules;
use crate::demands::Demands;
use crate::model::Effect;
use std::collections::BTreeSet;

/// So many may wait for an answer.
const MOST: usize = 4;

/// Requests that the host has not answered.
#[derive(Clone, Debug, Default)]
pub(super) struct Requests {
    /// The last one's id.
    last: u32,
    open: BTreeSet<u32>,
}

impl Requests {
    pub(super) fn open(&self) -> &BTreeSet<u32> {
        &self.open
    }

    /// A complete delivery may ask for a program.
    pub(super) fn ask(&mut self, delivery: &Delivery, rules: &Rules, demands: &mut Demands) {
        if delivery.number() != Some(rules.request_program) || self.open.len() == MOST {
            return;
        }
        let Some(name) = &delivery.asked else { return };
        self.last += 1;
        self.open.insert(self.last);
        let mut fields = vec![("name".to_owned(), name.clone())];
        let is_digits = name.bytes().all(|byte| byte.is_ascii_digit());
        let is_short = name.trim_start_matches('0').len() <= 18;
        if let Some(number) = name.parse::<u64>().ok().filter(|_| is_digits && is_short) {
            fields.push(("number".to_owned(), number.to_string()));
        }
        let kind = "program".to_owned();
        let requested = Effect::Requested { id: self.last, kind, fields };
        demands.add(requested, "fanuc-rs232.request.ask");
    }

    pub(super) fn answered(&mut self, id: u32) {
        self.open.remove(&id);
    }

    /// The link is closed.
    pub(super) fn close(&mut self) {
        *self = Self::default();
    }
}
