//! The wires of a bench, between boards in the simulator on one line. Right wires pass; wrong ones fail, each with its
//! reason. All outputs are restored.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use conformance::cases::of_bench;
use conformance::endpoint::exact_line::{ExactLine, Transport};
use conformance::endpoint::sim::{Fitting, InProcess, board};
use conformance::frame::Mode;
use conformance::hil::bench_file::BenchFile;
use conformance::run::{Outcome, Verdict, run_until};
use conformance::tester::Tester;
use modbus_line::exact::{Reply, Request};
use register_map::{Module, configuration};
use sim::{Channel, Time};

use super::{modio_02, probed};

/// A wire between two channels: board and channel of the output, those of the input, and the input as a part of the output.
type Wire = ([usize; 2], [usize; 2], f64);

/// What the first wire, a digital one, does wrong.
#[derive(Clone, Copy, Debug)]
enum Fault {
    /// It is interrupted for 8 ms, 8 ms after each rise. A FILTER of 5 ms does not remove this.
    Bounces,
    /// It does not carry the pulse that begins with this rise; the first rise is 1.
    Drops(usize),
}

/// Boards on one line. The first one is unit 1, the next one unit 2.
struct Boards {
    boards: Vec<InProcess>,
    wires: Vec<Wire>,
    fault: Option<Fault>,
    /// Whether the output of the first wire is on, how often it has been switched on, and when the last time.
    on: bool,
    rises: usize,
    last_rise: Time,
}

impl Boards {
    fn new(boards: &[Fitting], wires: &[Wire]) -> Self {
        let boards = boards
            .iter()
            .map(|fitting| board(fitting).expect("the image can be read"));
        Self {
            boards: boards.collect(),
            wires: wires.to_vec(),
            fault: None,
            on: false,
            rises: 0,
            last_rise: Time::ZERO,
        }
    }

    /// The same boards, with this fault of the first wire.
    fn with(mut self, fault: Fault) -> Self {
        self.fault = Some(fault);
        self
    }

    /// Returns what the first wire carries while its output is on, or off.
    fn first_carries(&mut self, on: bool) -> bool {
        let now = self.boards[0].board.now();
        if on && !self.on {
            self.rises += 1;
            self.last_rise = now;
        }
        self.on = on;
        let interrupted = self.last_rise + Time::from_ms(8)..self.last_rise + Time::from_ms(16);
        match self.fault {
            Some(Fault::Bounces) => on && !interrupted.contains(&now),
            Some(Fault::Drops(rise)) => on && self.rises != rise,
            None => on,
        }
    }

    /// Sets inputs to the values of their outputs.
    fn carry(&mut self) {
        for n in 0..self.wires.len() {
            let ([from, output], [to, input], gain) = self.wires[n];
            let mut output = self.boards[from].board.channel(output);
            if let (0, Channel::Do { on }) = (n, &mut output) {
                *on = self.first_carries(*on);
            }
            let to = &mut self.boards[to].board;
            let set = match output {
                Channel::Do { on } => to.set_energised(input, on),
                Channel::Ao { code } => {
                    // 3300 mV at the pin of an input give code 4095.
                    let millivolts = f64::from(code) / 4095.0 * 3300.0 * gain;
                    to.set_millivolts(input, millivolts.round() as u16)
                }
                other => panic!("{other:?} is no output"),
            };
            set.expect("there is such an input");
        }
    }

    /// Sends a request to all boards.
    fn ask_all(&mut self, request: &Request) -> Result<Reply, String> {
        let mut replies = self.boards.iter_mut().map(|board| board.ask(request));
        let mut reply = replies.next().expect("a board")?;
        for other in replies {
            // One of them sends at most.
            if let (Reply::Events(_, events), Reply::Events(_, more)) = (&mut reply, other?) {
                events.extend(more);
            }
        }
        self.carry();
        Ok(reply)
    }
}

impl Transport for Boards {
    fn ask(&mut self, request: &Request) -> Result<Reply, String> {
        let &Request::Run(mut left) = request else {
            return self.ask_all(request);
        };
        // The wires carry each millisecond.
        let mut all = Vec::new();
        loop {
            let step = left.min(Duration::from_millis(1));
            let reply = self.ask_all(&Request::Run(step))?;
            let Reply::Events(now, events) = reply else {
                return Ok(reply);
            };
            all.extend(events);
            left -= step;
            if left.is_zero() {
                return Ok(Reply::Events(now, all));
            }
        }
    }
}

/// Tests the wires of the bench file, and ends the run after so many of them. The outputs of unit 1, of which the first is
/// not at its lowest value, must be restored. Returns the outcomes.
fn tested(boards: Boards, file: &str, stop_after: usize) -> Vec<Outcome> {
    let mut line = ExactLine::new(boards).expect("hello");
    let mut target = probed(&mut line, 1, Mode::Rtu);
    target.hil.wires = BenchFile::parse(file, None).expect("a bench file").wires;
    let mut tester = Tester::new(&mut line, &target);
    let set = match (target.bits, target.words) {
        (Some(span), _) => tester.set_bits(span.first, &[true, false]),
        (None, Some(words)) => tester.set_words(words.span.first, &[1234, 0]),
        (None, None) => panic!("unit 1 has outputs"),
    };
    set.expect("they can be set");
    let before = tester.snapshot();
    let stop = AtomicBool::new(false);
    let mut left = stop_after;
    let mut outcomes = Vec::new();
    let count = |outcome: &Outcome| {
        left -= usize::from(outcome.name != outcome.case.name);
        stop.store(left == 0, Ordering::Relaxed);
    };
    run_until(&mut line, &target, &of_bench(), &stop, count, &mut outcomes).expect("it works");
    let after = Tester::new(&mut line, &target).snapshot();
    assert_eq!(after, before, "the outputs are restored");
    outcomes
}

/// Tests the wires. Each text is the beginning of the name of an outcome, in order, and a part of the reason if it failed.
#[track_caller]
fn assert_wires(boards: Boards, file: &str, wanted: &[[&str; 2]]) {
    assert_outcomes(&tested(boards, file, usize::MAX), wanted);
}

#[track_caller]
fn assert_outcomes(outcomes: &[Outcome], wanted: &[[&str; 2]]) {
    let parts = outcomes
        .iter()
        .filter(|outcome| outcome.name != outcome.case.name);
    let parts: Vec<&Outcome> = parts.collect();
    assert_eq!(parts.len(), wanted.len(), "{parts:#?}");
    for (outcome, [name, reason]) in parts.into_iter().zip(wanted) {
        let came = match &outcome.verdict {
            Verdict::Failed(failure) => format!("{}; {}", failure.came, failure.wanted),
            _ => String::new(),
        };
        let right = came.contains(reason) && reason.is_empty() == came.is_empty();
        assert!(outcome.name.starts_with(name) && right, "{outcome:#?}");
    }
}

const WIRES: &str = r"
[[wire]]
from = { point = 0x0010 }
to = { unit = 2, point = 0x0010 }
pulses = 5

[[wire]]
from = { point = 0x0011 }
to = { unit = 2, point = 0x0011 }
";

fn digital(wires: &[Wire]) -> Boards {
    let second = Fitting {
        dip: 2,
        ..modio_02(Module::Di4)
    };
    Boards::new(&[modio_02(Module::Do4), second], wires)
}

const FIRST: Wire = ([0, 1], [1, 1], 1.0);
const SECOND: Wire = ([0, 2], [1, 2], 1.0);

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn wires_and_pulses_between_two_boards_pass_and_a_missing_or_crossed_wire_fails() {
    let good = ["wires/unit 1 point 0x0010 to unit 2 point 0x0010", ""];
    let pulses = ["pulses/unit 1 point 0x0010 to unit 2", ""];
    let outcomes = tested(digital(&[FIRST, SECOND]), WIRES, usize::MAX);
    assert_outcomes(
        &outcomes,
        &[good, ["wires/unit 1 point 0x0011", ""], pulses],
    );
    let notes: Vec<&str> = outcomes
        .iter()
        .map(|outcome| outcome.note.as_str())
        .collect();
    assert!(
        notes.iter().any(|note| note.starts_with("on after ")),
        "{notes:?}"
    );
    assert!(notes.contains(&"5 pulses"), "{notes:?}");

    let missing = ["wires/", "unit 2 point 0x0011 stays off"];
    assert_wires(digital(&[FIRST]), WIRES, &[good, missing, pulses]);

    // The second input follows the first output.
    let crossed = ["wires/", "unit 2 point 0x0011 changed to on as well"];
    let both = [FIRST, ([0, 1], [1, 2], 1.0)];
    assert_wires(digital(&both), WIRES, &[crossed, missing, pulses]);

    let other_unit = WIRES.replace("unit = 2, point = 0x0011", "unit = 3, point = 0x0011");
    let silent = ["wires/", "an answer from unit 3"];
    assert_wires(
        digital(&[FIRST, SECOND]),
        &other_unit,
        &[good, silent, pulses],
    );

    let inverted = WIRES.replace("pulses = 5", "inverted = true");
    let off = ["wires/", "unit 2 point 0x0010 stays off"];
    let second = ["wires/unit 1 point 0x0011", ""];
    assert_wires(digital(&[FIRST, SECOND]), &inverted, &[off, second]);
}

/// The wire carries the level each time that it is asked for, so only the count shows it.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn wire_that_bounces_passes_but_its_pulses_are_counted_twice() {
    let second = ["wires/unit 1 point 0x0011", ""];
    let twice = ["pulses/", "counted 10; 5 pulses counted"];
    let boards = digital(&[FIRST, SECOND]).with(Fault::Bounces);
    assert_wires(boards, WIRES, &[["wires/", ""], second, twice]);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn pulse_that_a_wire_does_not_carry_fails() {
    let second = ["wires/unit 1 point 0x0011", ""];
    let missing = ["pulses/", "unit 2 point 0x0010 stays off; on within 100ms"];
    // The output is on at the start, in the test of the wire, and when it is restored. The third pulse is missing.
    let boards = digital(&[FIRST, SECOND]).with(Fault::Drops(6));
    assert_wires(boards, WIRES, &[["wires/", ""], second, missing]);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn interrupt_between_two_wires_restores_the_outputs() {
    let outcomes = tested(digital(&[FIRST, SECOND]), WIRES, 1);
    assert_outcomes(&outcomes, &[["wires/unit 1 point 0x0010", ""]]);
    let rest = outcomes
        .last()
        .map(|outcome| (outcome.name.as_str(), &outcome.verdict));
    let interrupted = Verdict::Skipped("interrupted".to_owned());
    assert_eq!(rest, Some(("wires/each", &interrupted)));
}

const ANALOG: &str = r"
[[analog]]
from = { point = 0x0012 }
to = { point = 0x0010 }
tolerance = 20

[[analog]]
from = { point = 0x0013 }
to = { point = 0x0011 }
tolerance = 20
";

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn analog_wires_of_one_board_pass_and_wrong_ones_fail() {
    let first: Wire = ([0, 3], [0, 1], 1.0);
    let second = |gain| ([0, 4], [0, 2], gain);
    let boards = |wires: &[Wire]| Boards::new(&[modio_02(Module::Ai2Ao2)], wires);
    let good = ["analog/unit 1 point 0x0012 to unit 1 point 0x0010", ""];
    let both = [first, second(1.0)];
    let outcomes = tested(boards(&both), ANALOG, usize::MAX);
    assert_outcomes(&outcomes, &[good, ["analog/unit 1 point 0x0013", ""]]);
    let noted = |outcome: &Outcome| outcome.note.starts_with("largest difference ");
    assert!(outcomes.iter().any(noted), "{outcomes:#?}");

    // 1 % of 4095 is 41 codes, the tolerance 20.
    let inexact = ["analog/", "+-20"];
    assert_wires(boards(&[first, second(0.99)]), ANALOG, &[good, inexact]);

    let missing = ["analog/", "unit 1 point 0x0011 is 0 after"];
    assert_wires(boards(&[first]), ANALOG, &[good, missing]);

    let crossed = ["analog/", "unit 1 point 0x0011 changed from 0 to 40"];
    let wires = [first, ([0, 3], [0, 2], 1.0)];
    assert_wires(
        boards(&wires),
        ANALOG,
        &[crossed, ["analog/", "is 0 after"]],
    );

    let scaled = Fitting {
        settings: vec![(configuration::SCALE + 0x10, 1)],
        ..modio_02(Module::Ai2Ao2)
    };
    let scaled = Boards::new(&[scaled], &both);
    let differs = ["analog/", "the same signal and scale"];
    assert_wires(
        scaled,
        ANALOG,
        &[differs, ["analog/unit 1 point 0x0013", ""]],
    );
}
