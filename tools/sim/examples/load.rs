//! Measures the load of virtual boards: the share of a host core that they need to keep real time.
//!
//! ```text
//! cargo run --release --ignore-rust-version -p sim --example load -- IMAGE [BOARDS [SECONDS]] [--lora]
//! ```
//!
//! Each line of the table has two measurements of the same boards, one after the other. The first one contains most of
//! the time for the translation of the firmware's code, which every board needs for itself.

use std::fs;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::Parser;
use modbus_line::adu::Framing;
use register_map::configuration;
use sim::board::MODIO_02;
use sim::line::{Settings, frame_silence};
use sim::radio::Parameters;
use sim::{Board, Bus, Config, Image, Module, Time};

#[derive(clap::Parser)]
struct Arguments {
    /// The firmware's ELF file for the modio-02
    image: PathBuf,

    /// Number of boards on one line, in the last three lines of the table
    #[arg(default_value_t = 30, value_parser = clap::value_parser!(u8).range(1..=247))]
    boards: u8,

    /// Virtual time of each measurement, in seconds
    #[arg(default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=3600))]
    seconds: u64,

    /// Fit every board with a LoRa module, which is idle
    #[arg(long)]
    lora: bool,
}

/// How the master polls the boards in turn.
#[derive(Clone, Copy)]
enum Master {
    Silent,
    /// Each board once a second, if the line is fast enough.
    EverySecond,
    /// The next request follows t3.5 after a reply.
    NoPause,
}

fn main() -> Result<(), String> {
    let arguments = Arguments::parse();
    let image = Image::read(&arguments.image).map_err(|error| error.to_string())?;
    let (boards, span) = (arguments.boards, arguments.seconds);
    let radio = arguments.lora.then_some(Parameters::FACTORY);
    println!("                                        first {span} s              next {span} s");
    println!(
        "boards  baud    master                   of a core  of time   of a core  of time  replies"
    );
    for (boards, baud, master) in [
        (1, 9600, Master::Silent),
        (1, 115_200, Master::Silent),
        (1, 115_200, Master::NoPause),
        (boards, 19_200, Master::Silent),
        (boards, 19_200, Master::EverySecond),
        (boards, 19_200, Master::NoPause),
    ] {
        report(&image, (boards, radio), baud, master, Time::from_secs(span))?;
    }
    Ok(())
}

/// Measures boards on one line from their start on, and prints a line of the table.
fn report(
    image: &Image,
    (boards, radio): (u8, Option<Parameters>),
    baud: u32,
    master: Master,
    span: Time,
) -> Result<(), String> {
    let mut bus = bus(image, boards, radio, baud).map_err(|error| error.to_string())?;
    for unit in 1..=boards {
        if !poll(&mut bus, unit) {
            return Err(format!("unit {unit} does not answer"));
        }
    }
    let first = measure(&mut bus, boards, master, span);
    let later = measure(&mut bus, boards, master, span);
    println!(
        "{boards:6}  {baud:<6}  {:23}  {:8.1} %  {:6.1} %  {:8.1} %  {:6.1} %  {:7}",
        match master {
            Master::Silent => "silent",
            Master::EverySecond => "polls each every second",
            Master::NoPause => "polls without pause",
        },
        first.cpu,
        first.wall,
        later.cpu,
        later.wall,
        later.replies,
    );
    Ok(())
}

/// What boards needed in a span of virtual time.
struct Load {
    /// Time of all host cores, in percent of the span.
    cpu: f64,
    /// Time that passed on the host, in percent of the span. At 100 % and below, boards keep real time.
    wall: f64,
    /// Replies that the master received.
    replies: u32,
}

/// Runs the boards for a span of virtual time.
fn measure(bus: &mut Bus, boards: u8, master: Master, span: Time) -> Load {
    let (wall, cpu) = (Instant::now(), cpu_time());
    let end = bus.now() + span;
    let pause = match master {
        Master::Silent => span,
        Master::EverySecond => Time::from_ps(Time::from_secs(1).as_ps() / u64::from(boards)),
        Master::NoPause => Time::ZERO,
    };
    let mut replies = 0;
    for unit in (1..=boards).cycle() {
        let next = bus.now() + pause;
        if !matches!(master, Master::Silent) {
            replies += u32::from(poll(bus, unit));
        }
        if bus.now() < next.min(end) {
            bus.run_until(next.min(end));
        }
        if bus.now() >= end {
            break;
        }
    }
    let wall = wall.elapsed();
    let cpu = match (cpu, cpu_time()) {
        (Some(before), Some(after)) => after.saturating_sub(before),
        _ => wall,
    };
    let share = |time: Duration| 100.0 * time.as_secs_f64() / span.as_secs_f64();
    Load {
        cpu: share(cpu),
        wall: share(wall),
        replies,
    }
}

/// Boards on one line with the addresses 1 and up and a 4DI each. Their firmware has started.
fn bus(image: &Image, boards: u8, radio: Option<Parameters>, baud: u32) -> Result<Bus, sim::Error> {
    let settings: Vec<_> = configuration::modules([(MODIO_02.slots[0].port, Module::Di4)])
        .chain([(configuration::BAUD, (baud / 100) as u16)])
        .collect();
    let boards = (1..=boards).map(|dip| {
        let mut config = Config {
            dip,
            radio,
            ..Config::default()
        };
        config.chip.flash = MODIO_02.flash_with(&settings);
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

/// Reads the inputs of a unit. Returns whether it answers.
fn poll(bus: &mut Bus, unit: u8) -> bool {
    let point = register_map::points::first(MODIO_02.board.first_port);
    let [high, low] = point.to_be_bytes();
    let request = Framing::Rtu.frame(0, unit, &[2, high, low, 0, 4]);
    let now = bus.now();
    let sent = bus.line().send(now, &request);
    let settings = bus.line().settings();
    let patience = sent + Time::from_ms(20);
    let mut reply = Vec::new();
    // A reply has 6 bytes: unit, function, count, inputs, CRC.
    while reply.len() < 6 && bus.now() < patience {
        bus.run_for(settings.characters(1));
        reply.extend(
            bus.line()
                .take_received()
                .iter()
                .map(|received| received.byte),
        );
    }
    // The last character is received before its last stop bit ends. Wait for that and for t3.5.
    bus.run_for(frame_silence(settings) + settings.characters(1));
    Framing::Rtu.open(&reply).is_some()
}

/// Returns the time that all threads of this process have spent on a core; `None` if the system does not show it.
fn cpu_time() -> Option<Duration> {
    let mut total = Duration::ZERO;
    for thread in fs::read_dir("/proc/self/task").ok()? {
        let text = fs::read_to_string(thread.ok()?.path().join("schedstat")).ok()?;
        total += Duration::from_nanos(text.split(' ').next()?.parse().ok()?);
    }
    Some(total)
}
