//! Modem lines through a tap: as over a null-modem cable, the RTS of one
//! partner becomes the CTS of the other, and its DTR the other's DSR.

use softplug_abi::ModemLines;

use super::{Event, Side};
use crate::error::PortError;
use crate::port::Port;

/// What a partner sets, as our port sees it, and what we set for the other one.
const CROSSED: [(ModemLines, ModemLines); 2] =
    [(ModemLines::CTS, ModemLines::RTS), (ModemLines::DSR, ModemLines::DTR)];

/// The lines of both ports as they were seen last.
#[derive(Debug)]
pub(super) struct Lines {
    seen: [Option<(ModemLines, ModemLines)>; 2],
    /// What the other port was last asked to set.
    set: [Option<ModemLines>; 2],
    told: [bool; 2],
}

impl Lines {
    pub(super) fn new(ports: &[Port; 2]) -> Self {
        let seen = [&ports[0], &ports[1]].map(inputs);
        Self { seen, set: [None; 2], told: [false; 2] }
    }

    pub(super) fn are_watched(&self) -> bool {
        self.seen.iter().any(Option::is_some)
    }

    pub(super) fn seen(&self, side: Side) -> Option<(ModemLines, ModemLines)> {
        self.seen[side.index()]
    }

    /// Looks at the lines, tells changes and passes them on.
    pub(super) fn pass(
        &mut self,
        ports: &mut [Port; 2],
        tell: &mut dyn FnMut(Event<'_>),
    ) -> Result<(), PortError> {
        for from in [Side::A, Side::B] {
            let index = from.index();
            // A device server tells its lines when it likes.
            if self.seen[index].is_none() && !ports[index].tells_modem_lines() {
                continue;
            }
            let Some((known, on)) = inputs(&ports[index]) else { continue };
            if self.seen[index] != Some((known, on)) {
                self.seen[index] = Some((known, on));
                tell(Event::Lines { from, known, on });
            }
            let wanted = crossed(on);
            if self.set[index] == Some(wanted) {
                continue;
            }
            self.set[index] = Some(wanted);
            let to = from.other();
            match ports[to.index()].set_modem_lines(ModemLines::OUTPUTS, wanted) {
                // Of a port that is gone the next read or write says so, and which side it was.
                Ok(()) | Err(PortError::Gone(_)) => {}
                Err(PortError::Unsupported { what }) => {
                    if !std::mem::replace(&mut self.told[to.index()], true) {
                        tell(Event::Cannot { side: to, what });
                    }
                }
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}

/// The lines that the partner sets, if any are known.
fn inputs(port: &Port) -> Option<(ModemLines, ModemLines)> {
    let (known, on) = port.modem_lines()?;
    let inputs = !ModemLines::OUTPUTS.0;
    (known.0 & inputs != 0).then_some((ModemLines(known.0 & inputs), ModemLines(on.0 & inputs)))
}

fn crossed(on: ModemLines) -> ModemLines {
    let wanted = CROSSED.iter().filter(|(seen, _)| on.contains(*seen));
    wanted.fold(ModemLines::default(), |all, (_, set)| all.union(*set))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_cross_as_in_a_null_modem_cable() {
        assert_eq!(crossed(ModemLines::CTS), ModemLines::RTS);
        assert_eq!(crossed(ModemLines::DSR.union(ModemLines::DCD)), ModemLines::DTR);
        assert_eq!(crossed(ModemLines::ALL), ModemLines::OUTPUTS);
        assert_eq!(crossed(ModemLines::RI), ModemLines::default());
    }
}
