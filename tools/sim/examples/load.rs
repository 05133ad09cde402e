//! Measures what virtual boards cost: the share of a core's time that they need to keep real time.
//!
//! ```text
//! cargo run --release --ignore-rust-version -p sim --example load -- IMAGE [BOARDS [SECONDS]]
//! ```
//!
//! IMAGE is the firmware's ELF file for the modio-02. BOARDS (30) share a line in the last lines of the table, each of
//! which takes so many SECONDS (5) of virtual time. Before that each board starts and answers two requests, so that
//! the translation of the firmware's code is not in the figure.

use std::fs;
use std::time::{Duration, Instant};

use modbus_frames::adu::Framing;
use register_map::configuration;
use sim::board::MODIO_02;
use sim::line::Settings;
use sim::{Board, Bus, Config, Image, Module, Time};

fn main() -> Result<(), String> {
    let mut arguments = std::env::args_os().skip(1);
    let path = arguments.next().ok_or("usage: load IMAGE [BOARDS]")?;
    let image = Image::read(path.as_ref()).map_err(|error| error.to_string())?;
    let boards = match arguments.next() {
        Some(number) => number
            .to_str()
            .and_then(|number| number.parse().ok())
            .filter(|number| (1..=247).contains(number))
            .ok_or("BOARDS is a number from 1 to 247")?,
        None => 30,
    };
    let span = match arguments.next() {
        Some(number) => number
            .to_str()
            .and_then(|number| number.parse().ok())
            .filter(|number| (1..=3600).contains(number))
            .ok_or("SECONDS is a number from 1 to 3600")?,
        None => 5,
    };
    println!("boards  baud    master                  share of a core  wall time  replies");
    for (boards, baud) in [(1, 9600), (1, 115_200), (boards, 19_200)] {
        for polled in [false, true] {
            if (boards, baud, polled) != (1, 9600, true) {
                report(&image, boards, baud, polled, Time::from_secs(span))?;
            }
        }
    }
    Ok(())
}

fn report(image: &Image, boards: u8, baud: u32, polled: bool, span: Time) -> Result<(), String> {
    let mut bus = bus(image, boards, baud).map_err(|error| error.to_string())?;
    for unit in (1..=boards).chain(1..=boards) {
        if !poll(&mut bus, unit) {
            return Err(format!("unit {unit} does not answer"));
        }
    }
    let (wall, cpu) = (Instant::now(), cpu_time());
    let end = bus.now() + span;
    let mut replies = 0;
    if polled {
        for unit in (1..=boards).cycle() {
            if bus.now() >= end {
                break;
            }
            replies += u32::from(poll(&mut bus, unit));
        }
    } else {
        bus.run_until(end);
    }
    let wall = wall.elapsed();
    let cpu = match (cpu, cpu_time()) {
        (Some(before), Some(after)) => after.saturating_sub(before),
        _ => wall,
    };
    let share = |time: Duration| 100.0 * time.as_secs_f64() / span.as_secs_f64();
    println!(
        "{boards:6}  {baud:<6}  {:22}  {:13.1} %  {:7.1} %  {replies:7}",
        if polled {
            "polls, t3.5 between"
        } else {
            "silent"
        },
        share(cpu),
        share(wall),
    );
    Ok(())
}

/// Boards with the addresses 1 and up, a 4DI plugged into each, started.
fn bus(image: &Image, boards: u8, baud: u32) -> Result<Bus, sim::Error> {
    let settings: Vec<_> = configuration::modules([(MODIO_02.slots[0].port, Module::Di4)])
        .chain([(configuration::BAUD, (baud / 100) as u16)])
        .collect();
    let boards = (1..=boards).map(|dip| {
        let config = Config {
            dip,
            flash: MODIO_02.flash_with(&settings),
            ..Config::default()
        };
        Board::new(image, config)
    });
    let mut bus = Bus::new(boards.collect::<Result<_, _>>()?);
    bus.line().set_settings(Settings {
        baud,
        ..Settings::default()
    });
    bus.run_for(Time::from_ms(200));
    Ok(bus)
}

/// Reads the unit's inputs. Whether it answers.
fn poll(bus: &mut Bus, unit: u8) -> bool {
    let point = register_map::points::first(MODIO_02.board.first_port);
    let [high, low] = point.to_be_bytes();
    let request = Framing::Rtu.frame(0, unit, &[2, high, low, 0, 4]);
    let now = bus.now();
    let sent = bus.line().send(now, &request);
    let settings = bus.line().settings();
    let patience = sent + Time::from_ms(20);
    let mut reply = Vec::new();
    // Unit, function, count, the inputs, CRC.
    while reply.len() < 6 && bus.now() < patience {
        bus.run_for(settings.characters(1));
        reply.extend(
            bus.line()
                .take_received()
                .iter()
                .map(|received| received.byte),
        );
    }
    // The last character is there before its last stop bit ends.
    bus.run_for(settings.frame_silence() + settings.characters(1));
    Framing::Rtu.open(&reply).is_some()
}

/// The time that the process has spent on a core, where the system shows it.
fn cpu_time() -> Option<Duration> {
    let mut total = Duration::ZERO;
    for thread in fs::read_dir("/proc/self/task").ok()? {
        let text = fs::read_to_string(thread.ok()?.path().join("schedstat")).ok()?;
        total += Duration::from_nanos(text.split(' ').next()?.parse().ok()?);
    }
    Some(total)
}
