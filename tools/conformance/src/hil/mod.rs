//! A bench with a real board: what the user and the bench file say about it, and the programs that write, reset and switch
//! the board.

pub mod bench_file;
pub mod options;
pub mod shell;
pub mod spread;

use std::time::Duration;

use bench_file::Wire;

use crate::case::Need;

/// What a bench adds to the cases.
#[derive(Clone, Debug, Default)]
pub struct Hil {
    /// Outputs wired to inputs.
    pub wires: Vec<Wire>,
    /// Requests at each rate; 0: nothing is measured.
    pub requests: u32,
    /// The rates to measure at, in bit/s; none: the present one.
    pub rates: Vec<u32>,
    /// The longest turnaround that 99 of 100 requests may have; `None`: the turnaround is only reported.
    pub limit: Option<Duration>,
}

impl Hil {
    /// Returns the reason why a need of a bench is not met, if it is not met. Other needs are met here.
    pub fn lacks(&self, need: Need) -> Option<&'static str> {
        let mut wires = self.wires.iter();
        let (met, why) = match need {
            Need::Requests => (self.requests > 0, "measures with --requests only"),
            Need::Wires => (
                wires.any(Wire::is_digital),
                "no [[wire]] in a bench file: --bench",
            ),
            Need::Pulses => (
                wires.any(Wire::has_pulses),
                "no [[wire]] with pulses in a bench file: --bench",
            ),
            Need::AnalogWires => (
                wires.any(|wire| !wire.is_digital()),
                "no [[analog]] in a bench file: --bench",
            ),
            _ => return None,
        };
        (!met).then_some(why)
    }
}
