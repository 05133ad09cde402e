//! Saving while the line is busy: at 115200 bit/s, with each request as soon after the last reply as a master may send
//! it, no request is lost, and the driver is off in time.

use register_map::{codes::Baud, configuration, fault};
use sim::{Corner, Module, Time, periph::flash::Durations, soc::map::Block};

use crate::rig::{FIRST, PAGE_SIZE, Rig, SLOT, adu, corner, pages};

const FILTER: u16 = 0x0120 + SLOT;
const UNSAVED: u16 = 8;

/// The longest durations of flash operations (DS5319 table 28).
pub const SLOWEST: Durations = Durations {
    erase: Time::from_ms(40),
    program: Time::from_us(70),
};

/// Settings by point, each with a value that is not the default: the register of the first point and the value.
const BLOCKS: [(u16, u16); 6] = [
    (0x0160, 4000),
    (0x01A0, 1),
    (0x01C0, 1),
    (0x0120, 7),
    (0x0180, 1),
    (0x01E0, 1),
];

/// Returns settings whose record fills two fifths of a page: the third record goes to the other page, and a start makes
/// room.
pub fn large() -> Vec<(u16, u16)> {
    // Three blocks need 400 bytes, six need 800.
    let blocks = BLOCKS.iter().take(3 * PAGE_SIZE / 1024);
    let pairs = blocks.map(|&(first, value)| (0..32).map(move |n| (first + n, value)));
    pairs.flatten().collect()
}

/// A master that sends requests without a pause and counts them.
struct Master {
    rig: Rig,
    asked: u32,
    late: Vec<Time>,
}

impl Master {
    fn new(module: Module, settings: &[(u16, u16)]) -> Self {
        let settings = [&[(0x0101, 1152)], settings].concat();
        let mut rig = Rig::set_up(module, &settings);
        rig.board.set_flash_durations(SLOWEST);
        Self {
            rig,
            asked: 0,
            late: Vec::new(),
        }
    }

    /// Sends a request and returns the reply. Stores the delay of a late reply.
    fn ask(&mut self, pdu: &[u8]) -> Vec<u8> {
        self.asked += 1;
        let (reply, late) = self.rig.hurry(Time::ZERO, &adu(&[&[1], pdu].concat()));
        // Programming a half-word may delay the reply by the duration of the operation.
        if late > Time::from_us(320) {
            self.late.push(late);
        }
        assert_eq!(
            reply[..2],
            [1, pdu[0]],
            "request {}: {reply:02X?}",
            self.asked
        );
        reply[2..reply.len() - 2].to_vec()
    }

    fn write(&mut self, address: u16, value: u16) {
        let [[a, b], [c, d]] = [address, value].map(u16::to_be_bytes);
        self.ask(&[6, a, b, c, d]);
    }

    /// Requests a save and sends requests until it is complete.
    fn save(&mut self) {
        self.write(0x0108, 1);
        let from = self.asked;
        loop {
            // Short and long requests, reads and writes.
            self.ask(&[1, 0, FIRST, 0, 4]);
            self.ask(&[3, 1, 0x20, 0, 32]);
            self.ask(&[16, 3, 0x30, 0, 2, 4, 0, 0, 0, 0]);
            let status = self.ask(&[3, 0x02, 0x0A, 0, 1]);
            if u16::from_be_bytes([status[1], status[2]]) & UNSAVED == 0 {
                return;
            }
            assert!(self.asked - from < 4_000, "the save never ends");
        }
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn no_request_goes_unanswered_while_saves_run_one_after_another() {
    let mut master = Master::new(Module::Di4, &[]);
    master.write(0x0100, 0x5A17);
    let operations = master.rig.board.flash_operations();
    for n in 0..20 {
        master.write(FILTER + n % 4, 10 + n);
        master.save();
    }
    let programmed = master.rig.board.flash_operations() - operations;
    assert!(programmed > 20 * 8, "only {programmed} operations");
    // Twenty small records fit in a page, so nothing is erased.
    assert_eq!(master.late, [], "a reply was late");
    assert_eq!(master.rig.register(0x0231), 0, "no bus error was seen");
    assert_eq!(master.rig.register(0x0237), 0, "no character was lost");
    master.rig.power_cycle();
    assert_eq!(master.rig.registers(FILTER, 4), Ok(vec![26, 27, 28, 29]));
}

/// The page that is no longer needed is erased after the save. One reply is late by the rest of the erase at the end of
/// the request, and nothing is lost.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn erases_of_many_saves_lose_no_request() {
    let mut master = Master::new(Module::Di4, &large());
    master.write(0x0100, 0x5A17);
    for n in 0..14 {
        master.write(FILTER + n % 4, 10 + n);
        master.save();
    }
    let late = &master.late;
    assert!(
        (5..=8).contains(&late.len()),
        "one late reply for every two saves: {late:?}"
    );
    // A request that ends with the start of an erase waits for all of it.
    let most = SLOWEST.erase + Time::from_us(50);
    assert!(late.iter().all(|late| *late < most), "{late:?}");
    assert_eq!(master.rig.register(0x0231), 0, "no bus error was seen");
    assert_eq!(master.rig.register(0x0237), 0, "no character was lost");
    assert_eq!(master.rig.board.resets(), 0);
    master.rig.power_cycle();
    assert_eq!(master.rig.registers(FILTER, 4), Ok(vec![22, 23, 20, 21]));
}

/// No request is served while the background task holds the device, nor while code in RAM programs the flash, which
/// takes the time of the flash operation.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_save_of_all_settings_holds_requests_off_for_at_most_26_us_at_a_time_48_at_the_slow_corner() {
    const BACKGROUND: u32 = 16 + 6;
    const XPSR: usize = 16;
    const BASEPRI: usize = 20;
    let mut master = Master::new(Module::Di4, &large());
    master.write(0x0100, 0x5A17);
    master.write(FILTER, 10);
    let board = &mut master.rig.board;
    let operations = board.flash_operations();
    let request = adu(&[1, 6, 0x01, 0x08, 0, 1]);
    let now = board.now();
    board.line().send(now, &request);
    let (mut longest, mut since) = (Time::ZERO, None);
    let end = now + Time::from_ms(60);
    while board.now() < end {
        board.step(1);
        let in_background = board.register(XPSR).unwrap_or_default() & 0x1FF == BACKGROUND;
        let programs = board.pc() >= 0x2000_0000;
        if in_background && !programs && board.register(BASEPRI) != Some(0) {
            let begin = *since.get_or_insert(board.now());
            longest = longest.max(board.now() - begin);
        } else {
            since = None;
        }
    }
    assert!(
        board.flash_operations() > operations + 190,
        "the save is complete"
    );
    let most = if corner() == Corner::Slow { 48 } else { 26 };
    assert!(
        longest < Time::from_us(most),
        "a lock was held for {longest}"
    );
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn line_is_set_up_again_during_an_erase_by_code_that_does_not_wait() {
    const BRR: u32 = 0x08;
    let mut rig = Master::new(Module::Di4, &large()).rig;
    let mut repaired = 0;
    for n in 0..4 {
        rig.configure(FILTER, &[10 + n]);
        let before = rig.board.flash_operations();
        rig.write(0x0108, &[1]).unwrap();
        let mut last = before;
        for _ in 0..100 {
            rig.board.run_for(Time::from_ms(1));
            let operations = rig.board.flash_operations();
            // Before the save has begun, an interrupt may run from RAM, too.
            let erases = rig.board.pc() >= 0x2000_0000 && operations == last && operations > before;
            last = operations;
            if erases {
                rig.board.upset(Block::Usart1, BRR, 1 << 10);
                rig.board.run_for(Time::from_ms(10));
                assert_eq!(rig.board.flash_operations(), last, "the erase has ended");
                repaired += 1;
                break;
            }
        }
        rig.board.run_for(Time::from_ms(150));
        rig.assert_answers(1);
    }
    assert!(repaired > 0, "no erase");
    assert_eq!(rig.register(fault::LINE_REPAIRS), repaired);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_restart_waits_for_a_running_save() {
    let mut rig = Rig::set_up(Module::Di4, &[]);
    rig.tolerant = true;
    rig.configure(FILTER, &[77]);
    rig.write(0x0108, &[1]).unwrap();
    rig.write(0x0108, &[2]).unwrap();
    rig.started();
    assert_eq!(rig.board.resets(), 1);
    assert_eq!(rig.register(FILTER), 77);
}

/// Other units communicate without a pause while settings are saved and pages are erased: the unit receives every
/// frame.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn no_byte_is_lost_at_any_rate_while_saves_run() {
    for baud in Baud::ALL
        .iter()
        .filter(|baud| baud.bits_per_second() >= 57_600)
    {
        let settings = [&[(configuration::BAUD, baud.code())], &large()[..]].concat();
        let mut rig = Rig::set_up(Module::Di4, &settings);
        rig.board.set_flash_durations(SLOWEST);
        for n in 0..3 {
            rig.configure(FILTER, &[10 + n]);
            assert_eq!(rig.ask(1, &[8, 0, 10, 0, 0]), Some(vec![8, 0, 10, 0, 0]));
            let operations = rig.board.flash_operations();
            rig.write(0x0108, &[1]).unwrap();
            // A read of another unit and its reply, repeated.
            let request = adu(&[2, 3, 0, 0, 0, 100]);
            let reply = adu(&[&[2, 3, 200][..], &[0x5A; 200]].concat());
            let end = rig.board.now() + Time::from_ms(200);
            let mut sent = 0;
            while rig.board.now() < end {
                for frame in [&request, &reply] {
                    let now = rig.board.now();
                    let over = rig.board.line().send(now, frame);
                    // The silence counts from the interrupt of the last byte, which may have waited: up to 8.5 us at the
                    // slow corner. A start bit that is already there then counts as part of the frame.
                    rig.board.run_until(over + rig.t35() + rig.characters(2));
                    sent += 1;
                }
            }
            let operations = rig.board.flash_operations() - operations;
            assert!(operations > 190, "{baud:?}: {operations} operations");
            let counted = rig.ask(1, &[8, 0, 11, 0, 0]).expect("a reply");
            let counted = u16::from_be_bytes([counted[3], counted[4]]);
            // The unit has also received the request to save and the request that reads the counter.
            assert_eq!(counted, sent + 2, "{baud:?}, save {n}");
            let errors = rig.ask(1, &[8, 0, 12, 0, 0]).expect("a reply");
            assert_eq!(errors, [8, 0, 12, 0, 0], "{baud:?}");
        }
    }
}

/// All tasks except those in RAM stop during an erase: the clocks correct for it.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn uptime_and_communication_watchdog_are_right_over_many_erases() {
    let mut master = Master::new(Module::Do4, &large());
    master.write(0x0100, 0x5A17);
    master.write(configuration::COMM_TIMEOUT, 1);
    let rig = &mut master.rig;
    rig.write_bits(SLOT, &[true; 4]).unwrap();
    // Waits until the uptime shows another second. Returns the time, about 20 ms late, and that second.
    let next_second = |rig: &mut Rig| {
        rig.patience = Time::ZERO;
        let was = rig.long(0x0208);
        loop {
            let second = rig.long(0x0208);
            if second != was {
                return (rig.board.now(), u64::from(second));
            }
        }
    };
    let (from, first) = next_second(rig);
    let spare = |rig: &Rig| {
        let flash = rig.board.flash();
        pages().map(|page| flash[page][2..].iter().all(|b| *b == 0xFF))
    };
    let mut erases = 0;
    rig.patience = Time::from_ms(50);
    for n in 0..20 {
        rig.configure(FILTER, &[10 + n]);
        let before = spare(rig);
        rig.write(0x0108, &[1]).unwrap();
        // A request every 90 ms keeps a time-out of 100 ms from tripping, even during an erase.
        for _ in 0..6 {
            let next = rig.sent + Time::from_ms(90);
            rig.board.run_until(next);
            assert!(rig.ask(1, &[1, 0, FIRST, 0, 4]).is_some());
        }
        erases += u32::from(spare(rig) != before);
    }
    assert!(erases > 5, "{erases} erases");
    assert!(!rig.status(1), "the communication watchdog has not tripped");
    let (until, last) = next_second(rig);
    let (passed, counted) = ((until - from).as_ms(), 1000 * (last - first));
    assert!(
        counted.abs_diff(passed) <= 100,
        "{counted} ms of {passed} ms"
    );
    // Without requests the watchdog trips.
    rig.board.run_for(Time::from_ms(110));
    assert!(rig.status(1));
}
