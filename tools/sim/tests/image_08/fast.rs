//! Function 70 on a bus: units arbitrate with real start bits, different crystals and late interrupts.

use register_map::codes::Baud;
use register_map::configuration::{BAUD, FILTER, FORMAT};
use sim::{Board, Config, Module, Time};

use crate::fast_master::Master;
use crate::rig::{self, FIRST, PORT, config, corner};
use crate::saving::{SLOWEST, large};

/// A unit: its switch and the error of its crystal in ppm; `None` without a crystal.
type Unit = (u8, Option<i32>);

/// Returns a master with these units.
fn master(baud: Baud, format_code: u16, units: &[Unit]) -> Master {
    let boards = units.iter().zip(0..).map(|(unit, n)| {
        let stored = [(BAUD, baud.code()), (FORMAT, format_code)];
        board(*unit, n, &stored)
    });
    Master::new(baud, format_code, boards.collect())
}

fn board((dip, ppm): Unit, n: u8, stored: &[(u16, u16)]) -> Board {
    let mut config = Config {
        dip,
        ..config(Module::Di4, stored)
    };
    config.chip.corner = corner();
    config.chip.unique_id[11] = n;
    match ppm {
        Some(ppm) => config.chip.crystal_hz = (8_000_000 + 8 * ppm) as u32,
        None => config.chip.crystal = false,
    }
    rig::board(config)
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_scan_finds_every_unit_once_also_two_with_one_address() {
    let units = [
        (17, Some(200)),
        (5, Some(-200)),
        (17, Some(0)),
        (200, Some(-100)),
        (0, Some(150)),
    ];
    for (baud, format) in [
        (Baud::B1200, 0),
        (Baud::B9600, 0),
        (Baud::B19200, 3),
        (Baud::B115200, 0),
        (Baud::B230400, 2),
        (Baud::B921600, 0),
        (Baud::B921600, 1),
    ] {
        let mut master = master(baud, format, &units);
        let found = master.find_all();
        let mut sorted = found.clone();
        sorted.sort_unstable();
        assert_eq!(
            found, sorted,
            "the lowest serial number comes first: {baud:?}"
        );
        let mut addresses: Vec<u8> = found.iter().map(|(_, unit)| *unit).collect();
        addresses.sort_unstable();
        assert_eq!(addresses, [0, 5, 17, 17, 200], "{baud:?}");
        // Each is reached by its serial number.
        for (serial, unit) in found {
            let request = [
                &[0xFD, 0x46, 8],
                &serial.to_be_bytes()[..],
                &[3, 2, 6, 0, 1],
            ]
            .concat();
            let (reply, _) = master.ask(&request, 0).expect("a reply");
            assert_eq!(reply[..3], [0xFD, 0x46, 9]);
            assert_eq!(reply[7..], [3, 2, 0, unit]);
        }
    }
}

/// Changes input `channel` (1 to 4) of unit `n` on the bus.
fn set_input(master: &mut Master, n: usize, channel: usize, on: bool) {
    let board = master.bus.board_mut(n);
    let change = board.change_slot(PORT as u8, |slot| slot.set_energised(channel, on));
    change.expect("the port has a slot").expect("an input");
}

/// Switches the report of the start off and the events of the inputs of a unit on: 1 low, 2 high priority.
fn switch_on(master: &mut Master, unit: u8, setting: u8) {
    let mut request = vec![unit, 0x46, 0x18, 13, 0x0F, 0, 0, 1, 0, 2, 0, FIRST, 4];
    request.extend([setting; 4]);
    let (reply, _) = master.ask(&request, 0).expect("a reply");
    assert_eq!(reply, [unit, 0x46, 0x18, 2, 0, 0b1111]);
}

/// Fetches until nobody has events. Returns unit, number of the input and level of each event.
fn fetch_all(master: &mut Master) -> Vec<(u8, u8, u8)> {
    let (mut events, mut last) = (Vec::new(), (0, 0));
    loop {
        let reply = master.fetch(last.0, last.1);
        let [unit, 0x46, 0x11, flag, _, _, packet @ ..] = &reply[..] else {
            assert_eq!(reply, [0xFD, 0x46, 0x12]);
            return events;
        };
        last = (*unit, *flag);
        // A master that knows nothing of it polls between.
        let poll = master.ask(&[*unit, 2, 0, FIRST, 0, 4], 0);
        assert_eq!(poll.expect("a reply").0[..2], [*unit, 2]);
        // The packet with the start, which was not confirmed, is sent again.
        for event in packet.chunks(5).filter(|event| *event != [0, 0x0F, 0, 0]) {
            let [1, 2, 0, id, level] = event else {
                panic!("{packet:02X?}");
            };
            events.push((*unit, id - FIRST + 1, *level));
        }
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn events_come_from_the_unit_that_has_them_high_ones_first() {
    // The last one has no crystal: it takes no part, and does not disturb the others.
    let units = [(1, Some(-200)), (2, Some(200)), (247, Some(0)), (3, None)];
    for (baud, format) in [(Baud::B9600, 0), (Baud::B115200, 1), (Baud::B921600, 0)] {
        let mut master = master(baud, format, &units);
        // Each unit reports its start first.
        assert_eq!(master.fetch(0, 0), [1, 0x46, 0x11, 0, 1, 4, 0, 0x0F, 0, 0]);
        for (unit, setting) in [(1, 1), (2, 2), (247, 1), (3, 2)] {
            switch_on(&mut master, unit, setting);
        }
        let states = fetch_all(&mut master);
        let all = |units: &[u8]| -> Vec<_> {
            units
                .iter()
                .flat_map(|unit| (1..=4).map(|n| (*unit, n, 0)))
                .collect()
        };
        assert_eq!(states, all(&[2, 1, 247]), "{baud:?}");
        for _ in 0..2 {
            assert_eq!(fetch_all(&mut master), []);
        }
        for level in [1, 0] {
            for n in 0..4 {
                set_input(&mut master, n, 2, level == 1);
            }
            master.bus.run_for(Time::from_ms(20));
            let expected = [2, 1, 247].map(|unit| (unit, 2, level));
            assert_eq!(fetch_all(&mut master), expected, "{baud:?}");
            for unit in [1, 2, 3, 247] {
                let (reply, _) = master.ask(&[unit, 2, 0, FIRST, 0, 4], 0).expect("a reply");
                assert_eq!(reply, [unit, 2, 1, level << 1], "{baud:?}");
            }
        }
        // No error was counted, also by the unit that takes no part.
        for unit in [1, 2, 3, 247] {
            for counter in [0x31, 0x37, 0x38] {
                let request = [unit, 4, 2, counter, 0, 1];
                let (reply, _) = master.ask(&request, 0).expect("a reply");
                assert_eq!(reply, [unit, 4, 2, 0, 0], "{baud:?} {counter:02X}");
            }
        }
    }
}

/// A unit serves a fetch that it has received during an erase of flash only after it. By then another unit may be asked.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn unit_that_erases_flash_during_a_fetch_speaks_into_no_later_answer() {
    for baud in [Baud::B115200, Baud::B921600] {
        let stored = [&large()[..], &[(BAUD, baud.code())]].concat();
        let boards = [(1, Some(0)), (2, Some(0))];
        let boards = boards
            .iter()
            .zip(0..)
            .map(|(unit, n)| board(*unit, n, &stored));
        let mut master = Master::new(baud, 0, boards.collect());
        master.bus.board_mut(0).set_flash_durations(SLOWEST);
        for unit in [1, 2] {
            switch_on(&mut master, unit, 1);
        }
        fetch_all(&mut master);
        let mut erases = 0;
        for n in 0..18 {
            set_input(&mut master, 0, 2, n % 2 == 0);
            master.bus.run_for(Time::from_ms(100));
            for (register, value) in [(0x0100, 0x5A17), (FILTER, 10 + n), (0x0108, 1)] {
                let [high, low] = u16::to_be_bytes(register);
                let [first, second] = u16::to_be_bytes(value);
                let request = [1, 6, high, low, first, second];
                assert_eq!(master.ask(&request, 0).expect("a reply").0, request);
            }
            // Every second save erases a page after its record, when the watchdog was refreshed: the unit misses a fetch.
            let last = master.bus.now() + Time::from_ms(200);
            let mut served = true;
            while served && master.bus.now() < last {
                master
                    .bus
                    .run_for(Time::from_us(3_000 + 300 * u64::from(n)));
                served = master.fetch(0, 0)[0] == 1;
            }
            let end = master.bus.now() + Time::from_ms(60);
            while master.bus.now() < end {
                let answer = master.ask(&[2, 2, 0, FIRST, 0, 4], 0);
                assert_eq!(answer, Some((vec![2, 2, 1, 0], vec![])), "{baud:?} {n}");
            }
            erases += u32::from(!served);
            // It is reported by the next fetch, or again.
            let edge = (1, 2, u8::from(n % 2 == 0));
            assert_eq!(fetch_all(&mut master), [edge], "{baud:?} {n}");
        }
        assert!(erases > 5, "{baud:?}: {erases}");
    }
}
