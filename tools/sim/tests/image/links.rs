//! Times of links and of the log of edges, without a master and while flash is erased.
//!
//! The module is a 2relay, because it has inputs and outputs: the jumper of relay 2, debounced for 20 ms, switches the
//! coil of relay 1.

use std::ops::RangeInclusive;

use register_map::codes::LinkAction;
use register_map::configuration::{COMM_TIMEOUT, FILTER};
use register_map::{edges, links};
use sim::{Module, Time};

use crate::bench::{Bench, SLOT};
use crate::saving::{SLOWEST, large};

/// The pin of the coil of relay 1.
const COIL: (char, u8) = ('A', 2);

/// From an edge of the jumper to that of the coil, in us: 19 to 20 ms of debounce, and the next scan.
const ON_TIME: RangeInclusive<u64> = 19_000..=22_000;

/// Returns settings with a link from the jumper of relay 2 to the coil of relay 1.
fn link(action: LinkAction) -> [(u16, u16); 2] {
    let first = links::of_point(SLOT + 2, false);
    [(first, SLOT + 1), (first + 1, action.code())]
}

/// Moves the jumper of relay 2. Returns the time in us until the coil has followed.
fn follow(bench: &mut Bench, manual: bool) -> u64 {
    bench.board.watch_pin(COIL.0, COIL.1);
    let now = bench.board.now();
    bench.board.set_manual(2, manual).unwrap();
    bench.board.run_for(Time::from_ms(100));
    let edges = bench.board.pin_edges(COIL.0, COIL.1).iter();
    let edges: Vec<_> = edges.filter(|(at, _)| *at > now).collect();
    let [&(at, level)] = edges[..] else {
        panic!("the coil has {} edges", edges.len());
    };
    assert_eq!(level, manual);
    (at - now).as_us()
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn output_follows_within_2_ms_of_the_debounced_edge_while_the_line_is_dead() {
    let alone = link(LinkAction::FollowAlone);
    let settings = [&alone[..], &[(COMM_TIMEOUT, 1)]].concat();
    let mut bench = Bench::set_up(Module::Relay2, &settings);
    for n in 0..16 {
        // At any phase between two scans.
        bench.board.run_for(Time::from_us(n * 137));
        let took = follow(&mut bench, n % 2 == 0);
        assert!(ON_TIME.contains(&took), "{took} us");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn output_follows_at_most_an_erase_later_during_a_save() {
    let settings = [&large()[..], &link(LinkAction::Follow)].concat();
    let mut bench = Bench::set_up(Module::Relay2, &settings);
    bench.board.set_flash_durations(SLOWEST);
    // START may have switched the coil on.
    bench.board.set_manual(2, true).unwrap();
    bench.board.run_for(Time::from_ms(100));
    let mut longest = 0;
    for n in 0..16 {
        bench.configure(FILTER + SLOT + 3, &[10 + n]);
        bench.write(0x0108, &[1]).unwrap();
        bench.board.run_for(Time::from_ms(u64::from(n) * 4));
        let took = follow(&mut bench, n % 2 == 1);
        let most = ON_TIME.end() + SLOWEST.erase.as_us();
        assert!((*ON_TIME.start()..=most).contains(&took), "{took} us");
        longest = longest.max(took);
    }
    assert!(longest > 30_000, "no erase: {longest} us");
}

/// Returns the newest edge of the log: its first record and its uptime.
fn newest_edge(bench: &mut Bench) -> (u16, u32) {
    let first = edges::log::END - edges::log::RECORDS;
    let groups = crate::self_description::request(&[(edges::log::FILE, first, 3)]);
    let reply = bench.request(&groups).unwrap();
    let [_, 7, 6, a, b, c, d, e, f] = reply[..] else {
        panic!("{reply:02X?}");
    };
    (u16::from_be_bytes([a, b]), u32::from_be_bytes([c, d, e, f]))
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn edges_have_their_time_and_those_inside_an_erase_are_marked() {
    let mut bench = Bench::set_up(Module::Di4, &large());
    bench.configure(FILTER + SLOT, &[2]);
    bench.board.set_flash_durations(SLOWEST);
    let mut reference = None;
    let mut late = 0;
    for n in 0..16 {
        let saves = n > 4;
        if saves {
            bench.configure(FILTER + SLOT + 3, &[10 + n]);
            bench.write(0x0108, &[1]).unwrap();
            bench.board.run_for(Time::from_ms(u64::from(n) * 4));
        }
        let now = bench.board.now();
        let level = n % 2 == 0;
        bench.board.set_energised(1, level).unwrap();
        bench.board.run_for(Time::from_ms(150));
        let (mark, ms) = newest_edge(&mut bench);
        assert_eq!(mark & !edges::log::LATE, SLOT | u16::from(level) << 8);
        assert_eq!(bench.long(edges::LAST_EDGE + 2 * SLOT), ms);
        let (first, first_ms) = *reference.get_or_insert((now, ms));
        let expected = (now - first).as_ms() as u32 + first_ms;
        let off = i64::from(ms) - i64::from(expected);
        if mark & edges::log::LATE == 0 {
            assert!((-1..=1).contains(&off), "{off} ms");
        } else {
            assert!(saves && (-1..=41).contains(&off), "{off} ms");
            late += 1;
        }
    }
    assert!(late > 0, "no erase");
}
