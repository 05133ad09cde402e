//! Times of links, without a master and while flash is erased. Inputs of ports 2 and 4 switch output 4 of port 1.

use std::ops::RangeInclusive;

use register_map::codes::LinkAction;
use register_map::configuration::{BAUD, COMM_TIMEOUT, FILTER, SAFE};
use register_map::links;
use sim::line::{Format, Settings};
use sim::{Module, Time};

use crate::fitted::{LINES, change, fitted, outputs};
use crate::rig::Rig;
use crate::saving::{SLOWEST, large};

const MODULES: [Module; 4] = [Module::Do4, Module::Di4, Module::None, Module::Di4];
/// The point of the output.
const LAMP: u16 = 3;
/// Points of input 1 of port 2 and of input 2 of port 4.
const BUTTONS: [u16; 2] = [4, 13];

/// From an edge of an input to that of the output, in us: 0 to 1 ms until the scan, and the scan's work.
const ON_TIME: RangeInclusive<u64> = 0..=2_000;

/// Time after a power-on after which the inputs have values.
const READY: Time = Time::from_ms(1_200);

/// Returns settings by which both inputs, without debounce, switch the output.
fn linked(action: LinkAction) -> Vec<(u16, u16)> {
    let mut settings = Vec::new();
    for (second, button) in [(false, BUTTONS[0]), (true, BUTTONS[1])] {
        settings.push((FILTER + button, 0));
        let link = links::of_point(LAMP, second);
        settings.extend([(link, button), (link + 1, action.code())]);
    }
    settings
}

/// Presses or releases a button. Returns the time in us until the output has changed, and its new level.
fn press(rig: &mut Rig, (port, channel): (u8, usize), pressed: bool) -> Option<(u64, bool)> {
    let (line, pin) = LINES[0][3];
    rig.board.watch_pin(line, pin);
    let now = rig.board.now();
    let set = change(rig, port, |slot| slot.set_energised(channel, pressed));
    set.unwrap();
    rig.board.run_for(Time::from_ms(60));
    let edges = rig.board.pin_edges(line, pin).iter();
    let edges: Vec<_> = edges.filter(|(at, _)| *at > now).collect();
    assert!(edges.len() <= 1, "the output has {} edges", edges.len());
    edges
        .first()
        .map(|(at, level)| ((*at - now).as_us(), *level))
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_lamp_with_two_buttons_changes_within_2_ms() {
    let mut rig = fitted(MODULES, &linked(LinkAction::Toggle));
    rig.board.run_for(READY);
    for n in 0..12 {
        // At any phase between two scans.
        rig.board.run_for(Time::from_us(n * 137));
        let button = if n % 3 == 0 { (2, 1) } else { (4, 2) };
        let (took, level) = press(&mut rig, button, true).unwrap();
        assert!(ON_TIME.contains(&took), "{took} us");
        assert_eq!(level, n % 2 == 0);
        assert_eq!(press(&mut rig, button, false), None);
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn output_follows_within_2_ms_while_the_line_is_dead() {
    let mut settings = linked(LinkAction::FollowAlone);
    settings.push((COMM_TIMEOUT, 1));
    let mut rig = fitted(MODULES, &settings);
    rig.board.run_for(READY);
    for n in 0..8 {
        rig.board.run_for(Time::from_us(n * 137));
        let (took, level) = press(&mut rig, (2, 1), n % 2 == 0).unwrap();
        assert!(ON_TIME.contains(&took), "{took} us");
        assert_eq!(level, n % 2 == 0);
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn output_follows_at_most_an_erase_later_during_a_save() {
    let links = linked(LinkAction::Follow);
    let mut settings = large();
    settings.retain(|(address, _)| links.iter().all(|(own, _)| own != address));
    settings.extend(links);
    let mut rig = fitted(MODULES, &settings);
    rig.board.set_flash_durations(SLOWEST);
    // START has switched the output on, until the inputs have values.
    rig.board.run_for(READY);
    press(&mut rig, (2, 1), true).unwrap();
    let mut longest = 0;
    for n in 0..16 {
        rig.configure(FILTER + 7, &[10 + n]);
        rig.write(0x0108, &[1]).unwrap();
        rig.board.run_for(Time::from_ms(u64::from(n) * 4));
        let (took, _) = press(&mut rig, (2, 1), n % 2 == 1).unwrap();
        assert!(took <= ON_TIME.end() + SLOWEST.erase.as_us(), "{took} us");
        longest = longest.max(took);
    }
    assert!(longest > 20_000, "no erase: {longest} us");
}

/// Returns the edges of the output since the pin is watched.
fn edges(rig: &Rig) -> usize {
    let (line, pin) = LINES[0][3];
    rig.board.pin_edges(line, pin).len()
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn pin_of_a_held_output_has_no_edge_while_a_master_writes_the_opposite_nor_at_a_trip() {
    for action in [LinkAction::Follow, LinkAction::Invert] {
        let mut settings = linked(action);
        settings.extend([(BAUD, 1152), (COMM_TIMEOUT, 3)]);
        if action == LinkAction::Follow {
            // SAFE is the opposite of what the link wants, too.
            settings.push((SAFE + LAMP, 1));
        }
        let mut rig = fitted(MODULES, &settings);
        rig.settings(Settings {
            baud: 115_200,
            format: Format::N2,
        });
        rig.board.run_for(READY);
        let on = outputs(&rig, 1)[3];
        assert_eq!(on, action == LinkAction::Invert);
        let (line, pin) = LINES[0][3];
        rig.board.watch_pin(line, pin);
        let before = edges(&rig);
        let mut next = rig.board.now();
        for n in 0..100 {
            rig.write_bits(LAMP, &[!on]).unwrap();
            // At any phase between two scans.
            next += Time::from_us(20_000 + n * 7);
            rig.board.run_until(next);
        }
        rig.board.run_for(Time::from_ms(1_000));
        assert!(rig.status(1), "the watchdog has expired");
        assert_eq!(edges(&rig), before, "{action:?}");
    }
}
