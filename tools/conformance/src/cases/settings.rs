//! Changes of the rate and format of a modio.

use modbus_line::{Format, LineFormat};
use register_map::codes::{self, Baud};

use crate::case::{Case, Check, Need, Stop, case};
use crate::frame::Mode;
use crate::rate;
use crate::tester::Tester;

const N: &[Need] = &[
    Need::Modio,
    Need::Config,
    Need::SetLine,
    Need::Function(6),
    Need::Function(0x10),
];

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    case("settings/reply-under-the-old-rate", "map, 0x0108",
        "the reply to the command that changes the rate goes out under the old one", N, one_change),
    case("settings/every-rate", "map, 0x0101",
        "every rate can be set, is in force after the restart, and can be left again", N, every_rate),
    case("settings/every-format", "map, 0x0102", "so can every format that the transmission mode can use", N,
        every_format),
];

/// Changes to each of these rates and formats, and restores the first.
fn tour(tester: &mut Tester<'_>, stops: impl IntoIterator<Item = LineFormat>) -> Check {
    rate::tour(tester, stops, |_| Ok(()))
}

fn one_change(tester: &mut Tester<'_>) -> Check {
    let home = tester.endpoint.line();
    let baud = if home.baud == 19_200 { 38_400 } else { 19_200 };
    tour(tester, [LineFormat { baud, ..home }])
}

fn every_rate(tester: &mut Tester<'_>) -> Check {
    let home = tester.endpoint.line();
    let rates = Baud::ALL.iter().map(|baud| LineFormat {
        baud: baud.bits_per_second(),
        ..home
    });
    tour(tester, rates.filter(|line| *line != home))
}

fn every_format(tester: &mut Tester<'_>) -> Check {
    let home = tester.endpoint.line();
    let mode = match tester.target.mode {
        Mode::Rtu => codes::Mode::Rtu,
        Mode::Ascii => codes::Mode::Ascii,
    };
    let formats = codes::Format::ALL.iter();
    let formats = formats.filter(|format| format.suits(mode));
    let formats: Result<Vec<Format>, _> = formats.map(|format| format.name().parse()).collect();
    let formats = formats.map_err(Stop::Skip)?.into_iter();
    let lines = formats.map(|format| LineFormat::new(home.baud, format));
    tour(tester, lines)
}
