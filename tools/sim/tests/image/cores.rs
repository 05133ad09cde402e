//! A board whose core reuses code that it translated for another board runs like a board with a new core: the same
//! instructions at the same instants, the same edges on the line, the same memories.

use sim::{Config, Corner, Finding, Module, Time, line::Received};

use crate::bench::{self, Bench, FIRST, adu, config, corner, symbol};

/// Number of boards that are made to find a used core: other tests of this process may take the core that was left.
const TRIES: usize = 1_000;

/// State of a board at an instant.
#[derive(Debug, PartialEq, Eq)]
struct State {
    now: Time,
    instructions: u64,
    cycles: u64,
    registers: Vec<Option<u32>>,
    ram: Vec<u8>,
    flash: Vec<u8>,
    driver: Vec<(Time, bool)>,
    received: Vec<Received>,
    log: String,
    findings: Vec<Finding>,
    resets: u32,
}

impl State {
    fn of(bench: &mut Bench) -> Self {
        let board = &mut bench.board;
        Self {
            now: board.now(),
            instructions: board.instructions(),
            cycles: board.cycles(),
            registers: (0..=22).map(|number| board.register(number)).collect(),
            ram: board.ram().to_vec(),
            flash: board.flash().to_vec(),
            driver: board.line().driver_edges().collect(),
            received: board.line().take_received(),
            log: board.take_log(),
            findings: board.findings().to_vec(),
            resets: board.resets(),
        }
    }
}

fn with_core(new_core: bool) -> Config {
    let mut config = config(Module::Di4, &[]);
    config.chip.new_core = new_core;
    config
}

/// Runs a start, requests, a save, a power cut during a save, and a reset. Returns the board's state at many instants.
fn run(mut bench: Bench) -> Vec<State> {
    bench.tolerant = true;
    let mut states = Vec::new();
    let run_on = |bench: &mut Bench, states: &mut Vec<State>, milliseconds: u64| {
        for _ in 0..milliseconds {
            bench.board.run_for(Time::from_us(1_003));
            states.push(State::of(bench));
        }
    };
    let requests: [&[u8]; 5] = [
        &[1, 1, 0, FIRST, 0, 4],
        // Unlock, change a filter, save.
        &[1, 6, 1, 0, 0x5A, 0x17],
        &[1, 6, 1, 0x20 + FIRST, 0, 99],
        &[1, 6, 1, 8, 0, 1],
        &[1, 3, 1, 0, 0, 9],
    ];
    run_on(&mut bench, &mut states, 150);
    for round in 0..2 {
        for request in requests {
            let now = bench.board.now();
            bench.board.line().send(now, &adu(request));
            run_on(&mut bench, &mut states, 40);
        }
        if round == 0 {
            bench.board.reset();
            run_on(&mut bench, &mut states, 120);
            bench.board.cut_in_flash_operation(3, 0.5);
        }
    }
    bench.board.power_off();
    run_on(&mut bench, &mut states, 3);
    bench.board.power_on();
    run_on(&mut bench, &mut states, 150);
    states
}

/// Leaves a core that has run other code at another corner.
fn leave_a_core(left: usize) {
    let corner = if corner() == Corner::Slow {
        Corner::Fast
    } else {
        Corner::Slow
    };
    let mut config = Config {
        dip: 0xFF,
        module: Module::Ao4,
        ..with_core(false)
    };
    config.chip.corner = corner;
    config.chip.crystal = left.is_multiple_of(2);
    let mut board = bench::board(config);
    board.run_for(Time::from_ms(120));
    // Replace the code that the core runs: in flash from its first instruction on, and in SRAM.
    let start = symbol("Reset") & !1;
    board.patch_code(start, &[0xFE, 0xE7].repeat(64)).unwrap();
    let ram = board.ram().len();
    board.ram_mut()[..ram / 2].fill(0xBF);
    board.run_for(Time::from_ms(30));
    board.reset();
    board.run_for(Time::from_ms(5));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn the_run_is_the_same_on_a_new_core_and_on_one_that_another_board_has_used() {
    let new = Bench::cold(with_core(true));
    assert!(!new.board.core_is_used());
    let expected = run(new);
    let traffic = expected
        .iter()
        .map(|state| state.received.len())
        .sum::<usize>();
    assert!(traffic > 50, "{traffic} characters");
    let mut compared = 0;
    for left in 0..TRIES {
        leave_a_core(left);
        let bench = Bench::cold(with_core(false));
        if !bench.board.core_is_used() {
            continue;
        }
        let states = run(bench);
        let differs = expected.iter().zip(&states).position(|(a, b)| a != b);
        if let Some(at) = differs {
            let [was, is] = [&expected[at], &states[at]].map(|state| {
                let State {
                    now,
                    instructions,
                    cycles,
                    ..
                } = state;
                (
                    *now,
                    *instructions,
                    *cycles,
                    state.log.clone(),
                    state.registers.clone(),
                )
            });
            panic!("board {left}, state {at}: {was:?} became {is:?}");
        }
        assert_eq!(expected.len(), states.len());
        compared += 1;
        if compared == 3 {
            return;
        }
    }
    panic!("no board received a used core");
}
