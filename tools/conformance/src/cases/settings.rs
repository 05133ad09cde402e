//! Changing a modio's rate and format, and changing it back.

use std::time::Duration;

use register_map::codes::{Baud, Command};
use register_map::configuration::{BAUD, COMMAND};

use crate::bench::Bench;
use crate::case::{Case, Check, Need, Stop, case};
use crate::line::{LineFormat, Parity};
use crate::points::{pdu, write_words};

const N: &[Need] = &[
    Need::Modio,
    Need::Config,
    Need::SetLine,
    Need::Rtu,
    Need::Function(6),
    Need::Function(0x10),
];

pub(super) const CASES: &[Case] = &[
    case(
        "settings/reply-under-the-old-rate",
        "map, 0x0108",
        "the reply to the command that changes the rate goes out under the old one",
        N,
        one_change,
    ),
    case(
        "settings/every-rate",
        "map, 0x0101",
        "every rate can be set, is in force after the restart, and can be left again",
        N,
        every_rate,
    ),
    case(
        "settings/every-format",
        "map, 0x0102",
        "so can every format",
        N,
        every_format,
    ),
];

/// For the unit to store its configuration, and to start.
const STORING: Duration = Duration::from_millis(200);
const START: Duration = Duration::from_millis(1500);

fn format_code(line: LineFormat) -> u16 {
    match (line.parity, line.stop_bits) {
        (Parity::None, 2) => 0,
        (Parity::Even, _) => 1,
        (Parity::Odd, _) => 2,
        (Parity::None, _) => 3,
    }
}

/// Takes the unit, and the endpoint after it, to a rate and format.
fn move_to(bench: &mut Bench<'_>, to: LineFormat) -> Check {
    bench.unlock()?;
    let values = [(to.baud / 100) as u16, format_code(to)];
    let request = write_words(BAUD, &values);
    bench.reply_is(&request, &request[..5])?;
    // The old rate is in force until the restart.
    bench.alive("a new rate that waits for the restart")?;
    for command in [Command::Save, Command::Restart] {
        let request = pdu(6, COMMAND, command.code());
        bench.reply_is(&request, &request)?;
        bench.rest(STORING)?;
    }
    bench.rest(START)?;
    bench.endpoint.set_line(to)?;
    bench.patience.quiet = bench.patience.quiet.max(to.t35() + to.characters(2));
    bench.patience.reply = bench.patience.reply.max(to.t35() * 2 + to.characters(4));
    bench.alive(format!("the change to {to}"))
}

/// Goes through rates and formats and back to the first; where the unit is lost, the endpoint looks for it.
fn tour(bench: &mut Bench<'_>, stops: impl IntoIterator<Item = LineFormat>) -> Check {
    let home = bench.endpoint.line();
    let patience = bench.patience;
    let mut result = Ok(());
    for to in stops {
        let from = bench.endpoint.line();
        result = move_to(bench, to);
        if result.is_err() {
            for line in [from, to, home] {
                bench.endpoint.set_line(line)?;
                if bench.alive("a change that failed").is_ok() {
                    break;
                }
            }
            break;
        }
    }
    let back = if bench.endpoint.line() == home {
        Ok(())
    } else {
        move_to(bench, home)
    };
    bench.patience = patience;
    result.and(back)
}

fn one_change(bench: &mut Bench<'_>) -> Check {
    let home = bench.endpoint.line();
    let baud = if home.baud == 19_200 { 38_400 } else { 19_200 };
    tour(bench, [LineFormat { baud, ..home }])
}

fn every_rate(bench: &mut Bench<'_>) -> Check {
    let home = bench.endpoint.line();
    let rates = Baud::ALL.iter().map(|baud| LineFormat {
        baud: baud.bits_per_second(),
        ..home
    });
    tour(bench, rates.filter(|line| *line != home))
}

fn every_format(bench: &mut Bench<'_>) -> Check {
    let home = bench.endpoint.line();
    if home.data_bits != 8 {
        return Err(Stop::Skip("the line has no 8 data bits".to_owned()));
    }
    let formats = [
        (Parity::Even, 1),
        (Parity::Odd, 1),
        (Parity::None, 1),
        (Parity::None, 2),
    ];
    tour(
        bench,
        formats.map(|(parity, stop_bits)| LineFormat {
            parity,
            stop_bits,
            ..home
        }),
    )
}
