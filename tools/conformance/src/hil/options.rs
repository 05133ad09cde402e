//! The options about a bench, and what they do.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::Result;
use register_map::codes::Baud;

use super::bench_file::Wire;
use super::{Hil, shell};

/// The options about a bench.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct Options {
    /// Run only the cases that need a bench: requests at each rate, wires
    #[arg(long)]
    pub no_suite: bool,

    /// Requests at each rate, whose replies are timed; 0: none [default: 0; with hil 2000]
    #[arg(long, value_name = "N")]
    pub requests: Option<u32>,

    /// Send them at these rates, such as 9600,115200, or `all`; the unit's configuration is saved at each rate and
    /// restored [default: the present rate]
    #[arg(long, value_name = "LIST", value_parser = rates)]
    pub rates: Option<List<u32>>,

    /// Fail when more than one turnaround in a hundred is longer than this
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u64).range(1..=60_000))]
    pub limit: Option<u64>,

    /// The bench file: port, probe, unit, line, module, commands and wires in TOML (docs/hil.md). An option takes
    /// precedence over its key
    #[arg(long, value_name = "FILE")]
    pub bench: Option<PathBuf>,

    /// Write the image into the board first, by `cargo xtask flash`
    #[arg(long)]
    pub flash: bool,

    /// The debug probe, when there are several: VID:PID or VID:PID:SERIAL, as `probe-rs list` shows it
    #[arg(long, value_name = "SELECTOR", requires = "flash")]
    pub probe: Option<String>,

    /// Write this image instead of building one
    #[arg(long, value_name = "FILE", requires = "flash")]
    pub elf: Option<PathBuf>,

    /// Run this in a shell before the tests, to reset the board or to switch it on
    #[arg(long, value_name = "CMD")]
    pub reset_cmd: Option<String>,

    /// Update the unit over the line first, by `modioctl update`, with this .modio file
    #[arg(long, value_name = "FILE")]
    pub update: Option<PathBuf>,

    /// Run this in a shell, followed by ` off` or ` on`, to switch the unit's power; without it the cases that switch the
    /// power are skipped on a serial port or a socket
    #[arg(long, value_name = "CMD")]
    pub power_cmd: Option<String>,

    /// The wires of the bench file.
    #[arg(skip)]
    pub wires: Vec<Wire>,
}

/// A list in one argument. The parser takes a `Vec` for several arguments.
pub type List<T> = Vec<T>;

fn rates(text: &str) -> Result<List<u32>, String> {
    let known = || Baud::ALL.iter().map(|baud| baud.bits_per_second());
    if text == "all" {
        return Ok(known().collect());
    }
    let one = |part: &str| {
        let rate = part.trim().parse().ok();
        let rate = rate.filter(|rate| known().any(|other| other == *rate));
        rate.ok_or_else(|| {
            let all: Vec<String> = known().map(|rate| rate.to_string()).collect();
            let all = all.join(" ");
            format!("{part:?} is not a rate of the device; use one of {all}")
        })
    };
    text.split(',').map(one).collect()
}

impl Options {
    /// Returns what a bench adds to the cases. `requests` is the number where no option gives one.
    pub fn adds(&self, requests: u32) -> Hil {
        Hil {
            wires: self.wires.clone(),
            requests: self.requests.unwrap_or(requests),
            rates: self.rates.clone().unwrap_or_default(),
            limit: self.limit.map(Duration::from_millis),
        }
    }

    /// Writes the image of the board and resets the board, as far as the user asks for that.
    pub fn prepare(&self) -> Result<()> {
        if self.flash {
            shell::flash(self.probe.as_deref(), self.elf.as_deref())?;
        }
        self.reset_cmd.as_deref().map_or(Ok(()), shell::run)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_those_of_the_device() {
        assert_eq!(rates("9600, 115200"), Ok(vec![9600, 115_200]));
        assert_eq!(rates("all").unwrap().len(), Baud::ALL.len());
        let text = rates("9600,300").unwrap_err();
        let begin = "\"300\" is not a rate of the device; use one of 1200 ";
        assert!(text.starts_with(begin), "{text}");
    }
}
