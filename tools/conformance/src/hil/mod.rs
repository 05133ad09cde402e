//! A bench with a real board: what the user and the bench file say about it, and the programs that write, reset and switch
//! the board.

pub mod bench_file;
pub mod options;
pub mod shell;
pub mod spread;

use std::time::Duration;

use bench_file::Wire;

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
