//! The time of an edge, also while flash is erased.

use register_map::configuration::FILTER;
use register_map::edges;
use sim::{Module, Time};

use crate::rig::{Rig, SLOT};
use crate::saving::{SLOWEST, large};

/// Returns the newest edge of the log: its first record and its uptime.
fn newest_edge(rig: &mut Rig) -> (u16, u32) {
    let first = edges::log::END - edges::log::RECORDS;
    let groups = crate::self_description::request(&[(edges::log::FILE, first, 3)]);
    let reply = rig.request(&groups).unwrap();
    let [_, 7, 6, a, b, c, d, e, f] = reply[..] else {
        panic!("{reply:02X?}");
    };
    (u16::from_be_bytes([a, b]), u32::from_be_bytes([c, d, e, f]))
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn edges_have_their_time_and_those_inside_an_erase_are_marked() {
    let mut rig = Rig::set_up(Module::Di4, &large());
    rig.configure(FILTER + SLOT, &[2]);
    rig.board.set_flash_durations(SLOWEST);
    let mut reference = None;
    let mut late = 0;
    for n in 0..16 {
        let saves = n > 4;
        if saves {
            rig.configure(FILTER + SLOT + 3, &[10 + n]);
            rig.write(0x0108, &[1]).unwrap();
            rig.board.run_for(Time::from_ms(u64::from(n) * 4));
        }
        let now = rig.board.now();
        let level = n % 2 == 0;
        rig.board.set_energised(1, level).unwrap();
        rig.board.run_for(Time::from_ms(150));
        let (mark, ms) = newest_edge(&mut rig);
        assert_eq!(mark & !edges::log::LATE, SLOT | u16::from(level) << 8);
        assert_eq!(rig.long(edges::LAST_EDGE + 2 * SLOT), ms);
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
