//! Load of the processor while a master sends requests without a pause: each request is sent as soon as t3.5 has
//! passed after the last response.

use register_map::codes::Mode;
use register_map::configuration::BETA;
use register_map::{Module, Row};
use serde::Serialize;
use sim::{Corner, Image, Time};

use crate::framing::{adu, is_adu};
use crate::unit::{BACKGROUND, BYTE, GAP, SCAN, SERVE, Unit};

/// Duration of the measurement.
const SPAN: Time = Time::from_ms(1_000);

/// Exceptions of the image's tasks (RM0008 table 63) and their purpose.
const TASKS: [(u32, &str); 6] = [
    (BYTE, "byte (USART1)"),
    (GAP, "frame gap (TIM2)"),
    (SERVE, "serve (EXTI3)"),
    (16 + 30, "beat (TIM4)"),
    (SCAN, "scan (EXTI1)"),
    (BACKGROUND, "background (EXTI0)"),
];

/// The load of the processor in one case.
#[derive(Clone, Debug, Serialize)]
pub struct Load {
    /// Corner of the part.
    pub corner: &'static str,
    /// Baud rate in bit/s.
    pub baud: u32,
    /// The request.
    pub request: &'static str,
    /// Number of requests in [`SPAN`], all answered.
    pub answered: u32,
    /// Part of the time during which the processor was awake, in percent.
    pub awake_percent: f64,
    /// Longest latency of every interrupt, in microseconds of virtual time.
    pub longest_waits_us: Vec<(&'static str, f64)>,
}

/// Measures the load at a corner of the part and a rate in units of 100 bit/s.
///
/// # Errors
///
/// When the unit does not answer a request.
pub fn measure(
    image: &Image,
    board: &Row,
    corner: Corner,
    hundreds: u16,
    long: bool,
) -> Result<Load, String> {
    let mut unit = Unit::new(image, board, Module::Di4, corner, hundreds, Mode::Rtu)?;
    let (name, count) = if long {
        ("03, 125 registers", 125)
    } else {
        ("03, 1 register", 1)
    };
    let [high, low] = BETA.to_be_bytes();
    let request = adu(Mode::Rtu, &[3, high, low, 0, count]);
    unit.board.measure_waits(true);
    let before = unit.board.core_time();
    let end = unit.board.now() + SPAN;
    let mut answered = 0;
    while unit.board.now() < end {
        if !is_adu(Mode::Rtu, &unit.back_to_back(&request)) {
            return Err(format!(
                "request {} at {hundreds}00 bit/s without pauses is not answered",
                answered + 1
            ));
        }
        answered += 1;
    }
    let load = unit.board.core_time().since(before).load();
    let waits = TASKS.map(|(exception, name)| {
        let longest = unit.board.wait(exception as usize).longest;
        (name, longest.as_secs_f64() * 1e6)
    });
    Ok(Load {
        corner: corner.name(),
        baud: u32::from(hundreds) * 100,
        request: name,
        answered,
        awake_percent: load * 100.0,
        longest_waits_us: waits.into(),
    })
}
