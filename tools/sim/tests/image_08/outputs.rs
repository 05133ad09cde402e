//! The stage of the outputs: DEAD_TIME, MAX_ON and MIN_OFF on the pins of a 4DO in port 2.

use fastrand::Rng;
use register_map::codes::{ChannelStatus, Command, LinkAction};
use register_map::configuration::{AS_IT_WAS, COMM_TIMEOUT, COMMAND, FILTER, SAFE, START};
use register_map::links;
use register_map::stage::{DEAD_TIME, MAX_ON, MIN_OFF};
use register_map::state::CHANNEL_STATUS;
use sim::{Channel, Module, Time};

use crate::fitted::{LINES, change, channels, fitted, fitted_with, outputs};
use crate::in_slots::{CHECK, image};
use crate::kept_outputs::put_beside;
use crate::rig::Rig;
use crate::stage::{Pair, RATE, at_rate, play_histories, play_scenarios};

const MODULES: [Module; 4] = [Module::Di4, Module::Do4, Module::None, Module::None];
/// The point of the first output.
const FIRST: u16 = 4;

const PAIR: Pair = Pair {
    first: FIRST,
    inputs: 0,
    unit: |settings| fitted(MODULES, settings),
    set: |rig, input, on| change(rig, 1, |slot| slot.set_energised(input + 1, on)).unwrap(),
    terminals: |rig| {
        let [one, two, three, _] = outputs(rig, 2);
        [one, two, three]
    },
};

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn scenarios_of_a_pair_have_their_terminals() {
    let played = play_scenarios(&PAIR);
    assert!(played >= 10, "{played}");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn histories_of_a_pair_have_every_change_of_a_terminal() {
    let changes = play_histories(&PAIR);
    assert!(changes > 100, "{changes}");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn relay_by_hand_switches_the_other_one_of_its_pair_off_and_it_waits() {
    let modules = [Module::Relay2, Module::None, Module::None, Module::None];
    let mut rig = fitted(modules, &[(DEAD_TIME + 2, 10)]);
    let energised = |rig: &Rig| {
        let is_on = |channel| {
            matches!(
                channel,
                Channel::Relay {
                    energised: true,
                    ..
                }
            )
        };
        let [one, two, ..] = channels(rig, 1).map(is_on);
        [one, two]
    };
    let hand = |rig: &mut Rig, manual| {
        change(rig, 1, |slot| slot.set_manual(1, manual)).unwrap();
        // The debounce of the jumper is 20 ms.
        rig.board.run_for(Time::from_ms(23));
    };
    rig.write_bit(3, true).unwrap();
    rig.board.run_for(Time::from_ms(3));
    assert_eq!(energised(&rig), [false, true]);
    hand(&mut rig, true);
    assert!(!energised(&rig)[1]);
    assert_eq!(
        rig.register(CHANNEL_STATUS + 3),
        ChannelStatus::Waits.code()
    );
    hand(&mut rig, false);
    rig.board.run_for(Time::from_ms(90));
    assert_eq!(energised(&rig), [false; 2]);
    rig.board.run_for(Time::from_ms(10));
    assert_eq!(energised(&rig), [false, true]);
}

/// An output whose order waits at a reset has it after the reset, where START is *as it was*.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn order_that_waits_outlasts_resets() {
    let mut rig = fitted(
        MODULES,
        &[(MIN_OFF + FIRST, 10), (START + FIRST, AS_IT_WAS)],
    );
    rig.tolerant = true;
    rig.board.run_for(Time::from_ms(1_500));
    rig.write_bit(FIRST, true).unwrap();
    for _ in 0..3 {
        rig.board.run_for(Time::from_ms(100));
        rig.board.reset();
        rig.board.run_for(Time::from_ms(300));
        assert!(!outputs(&rig, 2)[0]);
        assert_eq!(
            rig.register(CHANNEL_STATUS + FIRST),
            ChannelStatus::Waits.code()
        );
    }
    rig.board.run_for(Time::from_ms(1_000));
    assert!(outputs(&rig, 2)[0]);
}

/// Does something to the unit that a plant can do. It may refuse.
fn disturb(rig: &mut Rig, random: &mut Rng) {
    let output = FIRST + random.u16(0..4);
    match random.u8(0..100) {
        0..50 => {
            let bits: Vec<_> = (0..4).map(|_| random.bool()).collect();
            rig.write_bits(FIRST, &bits).unwrap();
        }
        50..60 => rig.write_bit(output, random.bool()).unwrap(),
        60..81 => {
            let (channel, on) = (random.usize(1..=4), random.bool());
            change(rig, 1, |slot| slot.set_energised(channel, on)).unwrap();
        }
        81..85 => rig.configure(MAX_ON + output, &[random.u16(0..5)]),
        85..88 => rig.configure(MIN_OFF + output, &[random.u16(0..3)]),
        88..90 => rig.configure(SAFE + output, &[random.u16(0..2)]),
        90..92 => rig.configure(START + output, &[*random.choice(&[0, 1, 0xFFFE]).unwrap()]),
        92..97 => {
            let actions = [
                LinkAction::Toggle,
                LinkAction::Set,
                LinkAction::Pulse,
                LinkAction::Follow,
                LinkAction::Invert,
            ];
            let action = random.choice(actions).unwrap();
            let words = [random.u16(0..4), action.code(), random.u16(1..3), 0];
            rig.configure(links::of_point(output, random.bool()), &words);
        }
        _ => order(rig, Command::Save),
    }
}

/// Gives an order that the unit may refuse: the budget of saves may be used up.
fn order(rig: &mut Rig, command: Command) {
    rig.unlock();
    let _ = rig.write(COMMAND, &[command.code()]);
}

/// Starts the unit again in some way.
fn restart(rig: &mut Rig, random: &mut Rng, update: bool) {
    rig.board.run_for(Time::from_ms(500));
    match random.u8(0..3) {
        _ if update => {
            order(rig, Command::GoBack);
            rig.board.run_for(CHECK);
        }
        0 => rig.board.reset(),
        1 => rig.power_cycle(),
        _ => order(rig, Command::Restart),
    }
    rig.board.run_for(Time::from_ms(300));
    rig.board.line().take_received();
    if update {
        order(rig, Command::Confirm);
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn terminals_of_a_pair_keep_dead_time_in_ten_thousand_requests_links_saves_starts_and_updates() {
    let mut settings = vec![RATE, (DEAD_TIME + FIRST, 5), (COMM_TIMEOUT, 1)];
    settings.extend((0..4).map(|input| (FILTER + input, 0)));
    let mut rig = fitted_with(MODULES, &settings, |flash| put_beside(flash, &image(1)));
    rig.tolerant = true;
    at_rate(&mut rig);
    let pins = [LINES[1][0], LINES[1][1]];
    for (line, pin) in pins {
        rig.board.watch_pin(line, pin);
    }
    let mut random = Rng::with_seed(54);
    let mut images = 0;
    // When DEAD_TIME became what it is, and its value in 10 ms.
    let mut dead = vec![(Time::ZERO, 5)];
    for n in 1..=10_000 {
        disturb(&mut rig, &mut random);
        if n % 50 == 0 {
            let change = [Command::DropChanges, Command::Save][random.usize(0..2)];
            rig.configure(DEAD_TIME + FIRST, &[random.u16(5..9)]);
            order(&mut rig, change);
            dead.push((rig.board.now(), rig.register(DEAD_TIME + FIRST)));
        }
        if n % 100 == 0 {
            let (now, before) = (rig.board.now(), rig.board.running_slot());
            // An update needs a save, and the budget of saves ends.
            restart(&mut rig, &mut random, n <= 1_000);
            images += usize::from(rig.board.running_slot() != before);
            dead.push((now, rig.register(DEAD_TIME + FIRST)));
        }
        if n == 9_500 {
            // Erases the other slot.
            order(&mut rig, Command::Prepare);
        }
        // Sometimes longer than COMM_TIMEOUT.
        let pause = random.u64(0..20) * if random.u8(0..20) == 0 { 10 } else { 1 };
        rig.board.run_for(Time::from_ms(pause));
    }
    assert!(images >= 5, "{images}");

    let edges = (0..2).flat_map(|n| {
        let (line, pin) = pins[n];
        rig.board
            .pin_edges(line, pin)
            .iter()
            .map(move |(at, on)| (*at, n, *on))
    });
    let mut edges: Vec<_> = edges.collect();
    edges.sort();
    let (mut on, mut off) = ([false; 2], [Time::ZERO; 2]);
    let mut switched = [0; 2];
    for (at, n, level) in edges {
        if level && !on[n] {
            assert!(!on[1 - n], "both at {at:?}");
            let now = dead.iter().rev().find(|(from, _)| *from <= at);
            let (_, tens) = now.expect("the first one");
            let apart = at - off[1 - n];
            // From scan to scan, by the crystal.
            assert!(
                apart >= Time::from_ms(u64::from(*tens) * 10 - 1),
                "{apart:?} at {at:?}"
            );
            switched[n] += 1;
        } else if !level && on[n] {
            off[n] = at;
        }
        on[n] = level;
    }
    assert!(switched.iter().all(|count| *count > 100), "{switched:?}");
}
