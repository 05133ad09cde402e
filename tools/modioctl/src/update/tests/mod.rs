//! Tests of the plan with models of units on a line.

mod bus;
mod model;
pub(super) mod sample;

use register_map::codes::Command;
use register_map::update::{Reason, Slot, State};

use super::file::File;
use super::file::tests::of_blocks;
use super::{Campaign, Fault, Stage, Status, Step, Unit};
use bus::Bus;
use model::Flaw;

/// Blocks of the image: about as many as that of a modio-02 has.
const BLOCKS: usize = 420;

/// Runs whose times are averaged.
const RUNS: u64 = 10;

/// Returns the units of a line that are to take the image for slot B.
fn units(bus: &Bus, file: &File, stage: Stage) -> Vec<Unit> {
    let words = file.image(Slot::B).words;
    let units = bus.units.iter();
    units
        .map(|unit| Unit::new(unit.address, Slot::B, words, stage))
        .collect()
}

/// Updates the units of a line. Returns the plan at its end.
fn update(bus: &mut Bus, unicast: bool) -> Campaign {
    let file = of_blocks(BLOCKS);
    let units = units(bus, &file, Stage::Waiting);
    let mut campaign = Campaign::new(&file.image(Slot::B).blocks, units, unicast);
    bus.run(&mut campaign);
    for (unit, model) in campaign.units().iter().zip(&bus.units) {
        if unit.stage == Stage::Done {
            let content: Vec<_> = model.content.iter().map(|block| block.unwrap()).collect();
            assert_eq!(content, file.image(Slot::B).blocks);
            assert_eq!((model.runs, model.trial), (Slot::B, false));
        }
    }
    campaign
}

fn stages(campaign: &Campaign) -> Vec<Stage> {
    campaign.units().iter().map(|unit| unit.stage).collect()
}

#[test]
fn on_a_clean_line_the_time_does_not_depend_on_the_number_of_units() {
    for baud in [9600, 19_200, 57_600, 115_200] {
        for count in [1, 30] {
            let mut bus = Bus::new(baud, count);
            let campaign = update(&mut bus, false);
            assert_eq!(stages(&campaign), vec![Stage::Done; count.into()]);
            let ratio = bus.ratio(BLOCKS);
            assert!(ratio <= 1.3, "{baud} bit/s, {count} units: {ratio:.3}");
        }
    }
}

#[test]
fn bit_errors_cost_what_is_missing_anywhere() {
    for (errors, rates) in [
        ([10.0, 0.0], [(9600, 1.6), (19_200, 1.6), (115_200, 1.6)]),
        ([0.0, 10.0], [(9600, 1.7), (19_200, 1.7), (115_200, 1.9)]),
    ] {
        for (baud, most) in rates {
            let ratios = (0..RUNS).map(|seed| {
                let mut bus = Bus::new(baud, 30);
                bus.errors = errors;
                bus.random.seed(seed);
                let campaign = update(&mut bus, false);
                assert_eq!(stages(&campaign), [Stage::Done; 30]);
                bus.ratio(BLOCKS)
            });
            let ratio = ratios.sum::<f64>() / RUNS as f64;
            assert!(ratio <= most, "{errors:?} at {baud} bit/s: {ratio:.3}");
        }
    }
}

#[test]
fn on_a_bad_line_every_unit_is_updated_in_the_end() {
    for unicast in [false, true] {
        let mut bus = Bus::new(115_200, 3);
        bus.errors = [100.0, 100.0];
        let campaign = update(&mut bus, unicast);
        assert_eq!(stages(&campaign), [Stage::Done; 3], "{unicast}");
    }
}

#[test]
fn blocks_are_sent_as_slowly_as_the_flash_and_an_adapter_that_joins_them_need() {
    for (baud, joins, again) in [(921_600, 0, 10), (115_200, 10, 120)] {
        let mut bus = Bus::new(baud, 2);
        bus.joins = std::time::Duration::from_millis(joins);
        let campaign = update(&mut bus, false);
        assert_eq!(stages(&campaign), [Stage::Done; 2]);
        let (sent, _) = campaign.blocks();
        assert!(sent < BLOCKS + again, "{baud} bit/s: {sent}");
    }
}

#[test]
fn blocks_are_sent_to_each_unit_alone_when_something_answers_broadcasts_or_they_do_not_arrive() {
    let mut answers = Bus::new(115_200, 3);
    answers.units[1].flaw = Flaw::AnswersBroadcasts;
    let mut drops = Bus::new(115_200, 3);
    drops.drops_broadcasts = true;
    for mut bus in [answers, drops] {
        let campaign = update(&mut bus, false);
        assert!(campaign.is_unicast());
        assert_eq!(stages(&campaign), [Stage::Done; 3]);
        let (sent, _) = campaign.blocks();
        assert!(sent < 3 * BLOCKS + 40, "{sent}");
    }
}

#[test]
fn a_unit_that_restarts_begins_again_and_one_that_is_gone_does_not_hold_up_the_others() {
    let mut bus = Bus::new(115_200, 4);
    bus.units[1].flaw = Flaw::RestartsAfter(100);
    bus.units[2].flaw = Flaw::GoneAfter(200);
    bus.units[3].flaw = Flaw::RestartsAfter(20);
    let campaign = update(&mut bus, false);
    let (done, gone) = (Stage::Done, Stage::Failed(Fault::Silent));
    assert_eq!(stages(&campaign), [done, done, gone, done]);
    assert!(!campaign.is_unicast());
    let (sent, _) = campaign.blocks();
    assert!(sent < 2 * BLOCKS + 10, "{sent}");
}

#[test]
fn a_host_that_was_interrupted_sends_only_what_is_missing() {
    let file = of_blocks(BLOCKS);
    for unicast in [false, true] {
        let mut bus = Bus::new(115_200, 2);
        let blocks = &file.image(Slot::B).blocks;
        let mut first = Campaign::new(blocks, units(&bus, &file, Stage::Waiting), unicast);
        while first.blocks().0 < 250 {
            assert!(bus.step(&mut first));
        }
        bus.now += std::time::Duration::from_secs(1);
        let mut second = Campaign::new(blocks, units(&bus, &file, Stage::Receiving), unicast);
        bus.run(&mut second);
        assert_eq!(stages(&second), [Stage::Done; 2]);
        let left = if unicast { 2 * BLOCKS } else { BLOCKS } - 250;
        let (sent, _) = second.blocks();
        assert!((left..left + 10).contains(&sent), "{sent} of {left}");
    }
}

#[test]
fn blocks_of_a_unit_that_another_line_has_prepared_are_sent_after_it_is_prepared_again() {
    let file = of_blocks(BLOCKS);
    let mut bus = Bus::new(115_200, 1);
    // The model takes no blocks, and reports that it receives.
    bus.units[0].state = State::Receiving;
    bus.units[0].flaw = Flaw::RestartsAfter(1);
    let units = units(&bus, &file, Stage::Receiving);
    let mut campaign = Campaign::new(&file.image(Slot::B).blocks, units, false);
    bus.run(&mut campaign);
    assert_eq!(stages(&campaign), [Stage::Done]);
}

#[test]
fn a_wrong_crc_is_repaired_once_and_a_rejected_image_is_reported() {
    let mut bus = Bus::new(115_200, 3);
    bus.units[0].flaw = Flaw::WrongCrc;
    bus.units[1].flaw = Flaw::Rejects(Reason::Signature);
    bus.units[2].flaw = Flaw::ConfirmsLate;
    let campaign = update(&mut bus, false);
    let rejected = Stage::Failed(Fault::Rejected(Reason::Signature));
    assert_eq!(stages(&campaign), [Stage::Done, rejected, Stage::Done]);
    let text = Fault::Rejected(Reason::Signature).to_string();
    assert!(text.contains("signature is not by a key"), "{text}");
}

#[test]
fn only_an_image_whose_check_was_interrupted_is_started_again_and_only_once() {
    for (reason, starts) in [(Reason::Interrupted, 2), (Reason::NotConfirmed, 1)] {
        let mut bus = Bus::new(115_200, 1);
        bus.units[0].flaw = Flaw::Rejects(reason);
        let campaign = update(&mut bus, false);
        let rejected = Stage::Failed(Fault::Rejected(reason));
        assert_eq!(stages(&campaign), [rejected]);
        let orders = bus.units[0].orders.iter();
        let finishes = orders.filter(|order| **order == Command::Finish);
        assert_eq!(finishes.count(), starts, "{reason:?}");
    }
}

/// The blocks of the other program are the same ones here.
#[test]
fn a_unit_that_another_program_has_updated_is_done_and_is_not_prepared_again() {
    // The unit is away for less time than until it is given up, and for more.
    for restart in [1, 9] {
        let file = of_blocks(BLOCKS);
        let mut bus = Bus::new(115_200, 1);
        bus.units[0].flaw = Flaw::UpdatedAfter(200);
        bus.units[0].restart = std::time::Duration::from_secs(restart);
        let units = units(&bus, &file, Stage::Waiting);
        let mut campaign = Campaign::new(&file.image(Slot::B).blocks, units, false);
        bus.run(&mut campaign);
        assert_eq!(stages(&campaign), [Stage::Done], "{restart} s");
        let orders = [Command::Prepare, Command::Confirm];
        assert_eq!(bus.units[0].orders, orders, "{restart} s");
    }
}

#[test]
fn a_unit_that_comes_back_is_updated_and_has_all_the_time_to_restart() {
    let mut bus = Bus::new(115_200, 1);
    bus.units[0].flaw = Flaw::AwayAfter(200);
    bus.units[0].restart = std::time::Duration::from_secs(15);
    let campaign = update(&mut bus, false);
    assert_eq!(stages(&campaign), [Stage::Done]);
}

/// Returns a line with a unit whose other slot holds a confirmed image by this key, and the plan to go back to it.
fn back(key: u32, unicast: bool) -> (Bus, Campaign) {
    let older = [0x0002, 0, 0, 7, 8, 200, (key >> 16) as u16, key as u16];
    let mut bus = Bus::new(9600, 1);
    (bus.units[0].state, bus.units[0].images[1]) = (State::Confirmed, older);
    let campaign = Campaign::new(&[], vec![Unit::back(1, Slot::B, older)], unicast);
    (bus, campaign)
}

#[test]
fn a_slot_that_has_aged_gets_one_order_to_go_back() {
    let (mut bus, mut campaign) = back(0, false);
    bus.units[0].flaw = Flaw::Rotten;
    bus.run(&mut campaign);
    assert_eq!(stages(&campaign), [Stage::Failed(Fault::Aged)]);
    assert_eq!(bus.units[0].orders, [Command::GoBack]);
}

/// The image crashes when it is asked for its version, so the unit goes back before the image is confirmed.
#[test]
fn a_unit_that_goes_back_before_it_is_confirmed_reports_why() {
    let file = of_blocks(20);
    let image = file.image(Slot::B);
    let unit = Unit::new(1, Slot::B, image.words, Stage::OnTrial);
    let mut campaign = Campaign::new(&image.blocks, vec![unit], false);
    let mut bus = Bus::new(115_200, 1);
    bus.units[0].state = State::Rejected(Reason::NotConfirmed);
    bus.run(&mut campaign);
    let rejected = Stage::Failed(Fault::Rejected(Reason::NotConfirmed));
    assert_eq!(stages(&campaign), [rejected]);
}

#[test]
fn the_way_back_needs_no_blocks_and_is_confirmed() {
    let mut bus = Bus::new(9600, 2);
    let older = [0x0002, 0, 0, 7, 8, 200, 0, 0];
    for unit in &mut bus.units {
        (unit.state, unit.images[1]) = (State::Confirmed, older);
    }
    let mut units: Vec<_> = [1, 2].map(|unit| Unit::back(unit, Slot::B, older)).into();
    // An image that was exchanged since it was looked at is not kept.
    bus.units[1].images[1][1] = 9;
    units.truncate(2);
    let mut campaign = Campaign::new(&[], units, false);
    bus.run(&mut campaign);
    let other = Stage::Failed(Fault::OtherImage);
    assert_eq!(stages(&campaign), [Stage::Done, other]);
    assert_eq!(campaign.blocks(), (0, 0));
    assert_eq!([0, 1].map(|unit| bus.units[unit].trial), [false, true]);
}

/// Behind a gateway: the answer to the order is lost, and the gateway repeats nothing, so the program does. The unit has
/// restarted by then, and its lock is closed.
#[test]
fn a_repeated_order_to_go_back_is_refused_and_has_been_carried_out() {
    let (mut bus, mut campaign) = back(0, true);
    bus.units[0].restart = std::time::Duration::from_millis(200);
    bus.loses = Some(Command::GoBack);
    bus.run(&mut campaign);
    assert_eq!(stages(&campaign), [Stage::Done]);
    assert_eq!(bus.units[0].orders, [Command::GoBack, Command::Confirm]);
}

#[test]
fn an_order_to_go_back_that_is_always_refused_is_reported_as_refused() {
    let keys = [0x0101_FFFF, 0x0202_EEEE];
    let (mut bus, mut campaign) = back(keys[0], false);
    (bus.units[0].keys, bus.units[0].revoked) = (keys, true);
    bus.run(&mut campaign);
    let refused = Fault::Refused("the order to start the image", 6);
    assert_eq!(stages(&campaign), [Stage::Failed(refused)]);
}

#[test]
fn a_gateway_that_is_busy_when_a_unit_is_on_trial_is_asked_again() {
    let file = of_blocks(20);
    let image = file.image(Slot::B);
    for (busy, ends) in [
        (3, Stage::Done),
        (50, Stage::Failed(Fault::Refused("to open the lock", 6))),
    ] {
        let mut bus = Bus::new(9600, 1);
        let unit = &mut bus.units[0];
        (unit.runs, unit.images[0], unit.trial) = (Slot::B, image.words, true);
        bus.busy = busy;
        let unit = Unit::new(1, Slot::B, image.words, Stage::OnTrial);
        let mut campaign = Campaign::new(&image.blocks, vec![unit], true);
        bus.run(&mut campaign);
        assert_eq!(stages(&campaign), [ends]);
    }
}

/// Returns the records of a unit that runs this image from slot B.
fn runs(image: [u16; 8], crc: u32) -> Status {
    let mut words = vec![0; 28];
    words[4] = 2;
    words[8..16].copy_from_slice(&image);
    (words[24], words[25]) = ((crc >> 16) as u16, crc as u16);
    Status::of(&words).unwrap()
}

#[test]
fn another_build_of_the_same_commit_is_another_image() {
    let words = of_blocks(20).image(Slot::B).words;
    let stage = |own, reported| {
        let mut unit = Unit::new(1, Slot::B, words, Stage::Restarting).of_crc(own);
        unit.restarts(&runs(words, reported));
        unit.stage
    };
    for (own, reported) in [(5, 5), (0, 5), (5, 0)] {
        assert_eq!(stage(own, reported), Stage::OnTrial, "{own} {reported}");
    }
    assert_eq!(stage(5, 6), Stage::Failed(Fault::OtherImage));
}

#[test]
fn a_unit_that_was_away_before_the_order_to_start_is_not_blamed_for_an_old_image() {
    let words = of_blocks(20).image(Slot::B).words;
    let mut status = runs(words, 0);
    status.slot = Slot::A;
    status.state = Some(State::Rejected(Reason::NotConfirmed));
    let mut unit = Unit::new(1, Slot::B, words, Stage::Waiting);
    for _ in 0..4 {
        unit.silent();
    }
    unit.look_again();
    unit.answered();
    unit.restarts(&status);
    assert_eq!(unit.stage, Stage::Receiving);
    unit.reports(&status);
    assert_eq!(unit.stage, Stage::Waiting, "it is prepared");
}

#[test]
fn orders_before_the_start_do_not_count_against_the_confirmation() {
    let words = of_blocks(20).image(Slot::B).words;
    let mut unit = Unit::new(1, Slot::B, words, Stage::Confirming);
    for _ in 0..4 {
        unit.count_order(Fault::Restarts);
    }
    for _ in 0..4 {
        unit.unconfirmed();
    }
    assert_eq!(unit.stage, Stage::OnTrial, "the order is given again");
}

/// Returns an answer to this request with these words; for some values of `kind` none, an exception or anything.
fn false_answer(
    random: &mut fastrand::Rng,
    pdu: &[u8],
    words: &[u16],
    kind: u8,
) -> Option<Vec<u8>> {
    match kind {
        0 => None,
        1 => Some(vec![pdu[0] | 0x80, random.u8(0..8)]),
        2 => Some((0..random.usize(0..8)).map(|_| random.u8(..)).collect()),
        _ if matches!(pdu[0], 6 | 0x15) => Some(pdu.to_vec()),
        _ => {
            let mut answer = vec![pdu[0], 0];
            answer.extend([0, 6].iter().filter(|_| pdu[0] == 0x14));
            let count = usize::from(pdu[pdu.len() - 1]);
            answer.extend(words[..count].iter().flat_map(|word| word.to_be_bytes()));
            Some(answer)
        }
    }
}

#[test]
fn false_answers_end_the_plan() {
    let file = of_blocks(20);
    let image = file.image(Slot::B);
    let mut random = fastrand::Rng::with_seed(1);
    for run in (0..=99).cycle().take(4000) {
        let stages = [
            Stage::Waiting,
            Stage::Receiving,
            Stage::Restarting,
            Stage::OnTrial,
        ];
        let units = (1..4).map(|unit| {
            let stage = random.choice(stages).unwrap();
            Unit::new(unit, Slot::B, image.words, stage)
        });
        let units = units.collect();
        let mut campaign = Campaign::new(&image.blocks, units, random.bool());
        let word = || random.choice([0, 1, 2, 3, 5, 6, 20, 0xFFFF]).unwrap();
        let words: Vec<_> = std::iter::repeat_with(word).take(28).collect();
        let mut steps = 0;
        while let Some(step) = campaign.next_step() {
            let answer = match step {
                Step::Ask { pdu, .. } => {
                    // In half of the runs a unit always says the same.
                    let kind = random.u8(0..30) + 30 * (run % 2);
                    false_answer(&mut random, &pdu, &words, kind)
                }
                Step::Probe(_) => random.bool().then(|| vec![1]),
                _ => None,
            };
            campaign.take_answer(answer.as_deref());
            steps += 1;
            assert!(steps < 50_000, "run {run}: {:?}", campaign.units());
        }
    }
}
