//! Updates that do not end as they should.

use register_map::codes::Command;
use register_map::state::status;

use super::*;

#[test]
fn a_unit_whose_settings_are_not_saved_is_left_out_unless_that_is_forced() {
    let line = Line::new(3, |unit| {
        unit.status = [0, status::UNSAVED][usize::from(unit.address == 2)];
        (unit.state, unit.images[1]) = (State::Confirmed, [0x0100, 7, 0, 1, 1, 20, 0, 0]);
    });
    let left_out = |ran: Ran| {
        let text = ran.failed(1);
        let why = "modioctl: unit 2 has settings in force that are not saved";
        has(&text, &[why, "`modioctl config save`", "--force"]);
        assert!(line.units.lock().unwrap()[1].orders.is_empty());
    };
    let ran = line.run("update FILE --units 1-3");
    has(&ran.out, &["unit 1: 0.1.2 (00030004) -> 0.3.1 (1a2b3c4d)"]);
    has(
        &ran.out,
        &["unit 2: 0.1.2 (00030004), not updated to 0.3.1"],
    );
    has(&ran.out, &["unit 3: 0.1.2 (00030004) -> 0.3.1 (1a2b3c4d)"]);
    left_out(ran);
    left_out(line.run("update --back --unit 2"));
    let text = line.run("update --back --force --unit 2").fine();
    has(&text, &["unit 2: 0.1.2 (00030004) -> 1.0.7 (00010001)"]);
    let text = line.run("update FILE --force --unit 2").fine();
    has(&text, &["-> 0.3.1 (1a2b3c4d) in slot A, confirmed"]);
    // A unit that runs the firmware is not restarted.
    line.run("update FILE --unit 2").fine();
}

#[test]
fn firmware_that_crashes_is_started_by_one_order_and_ends_with_the_fault_record() {
    let crashes = Flaw::Rejects(register_map::update::Reason::NotConfirmed);
    let line = Line::new(1, |unit| unit.flaw = crashes);
    let text = line.run("update FILE").failed(1);
    let why = "modioctl: unit 1 rejected the image (it was started twice and not confirmed), and runs the previous one: ";
    has(&text, &[why]);
    let record = "; its last fault, perhaps of before: panic, program counter 0x08012344, 3 s after its start";
    has(&text, &[record]);
    assert!(!text.contains("same command"), "{text}");
    let orders = [Command::Prepare, Command::Finish];
    assert_eq!(line.units.lock().unwrap()[0].orders, orders);
}

#[test]
fn a_line_that_is_lost_reports_which_units_are_updated_and_which_are_not() {
    // Unit 1 takes the image for slot A, and is updated first: 100 blocks and some orders.
    let other_slot = |unit: &mut Model| {
        if unit.address == 1 {
            unit.runs = Slot::B;
        }
    };
    let line = Line::with(2, other_slot, false, BLOCKS + 40);
    let ran = line.run("update FILE --units 1-2");
    let rows = [
        "unit 1: 0.1.2 (00030004) -> 0.3.1 (1a2b3c4d) in slot A, confirmed",
        "unit 2: 0.1.2 (00030004), the update to 0.3.1 (1a2b3c4d) is not finished",
    ];
    has(&ran.out, &rows);
    let text = ran.failed(5);
    has(
        &text,
        &[" is lost ", "; the same command goes on where it stopped"],
    );
}

#[test]
fn after_ctrl_c_the_same_command_sends_what_is_missing() {
    let line = Line::new(2, |_| ());
    let words = line.words("update FILE --units 1-2 --unicast --poll p5.1");
    let mut running = line.at.start(&words);
    running.out.wait_for("p5.1 off");
    while line.blocks() < 50 {
        std::thread::sleep(Duration::from_millis(1));
    }
    running.interrupt();
    let ran = running.end();
    assert_eq!(ran.status, 130, "{ran:?}");
    has(&ran.err, &["the same command goes on where it stopped"]);
    let sent = line.blocks();
    let text = line.run("update FILE --units 1-2").fine();
    has(&text, &["unit 1: 0.1.2", "unit 2: 0.1.2"]);
    // Unit 2 had no block.
    let more = line.blocks() - sent;
    assert!(more < BLOCKS + 60, "{more} after {sent}");
}

#[test]
fn a_unit_that_drops_out_is_reported_and_the_others_go_on() {
    let line = Line::new(3, |unit| match unit.address {
        2 => unit.flaw = Flaw::GoneAfter(60),
        3 => unit.flaw = Flaw::Rejects(register_map::update::Reason::Signature),
        _ => (),
    });
    let ran = line.run("--retries 0 update FILE --units 1-3");
    assert_eq!(ran.status, 1, "{ran:?}");
    has(
        &ran.out,
        &[
            "unit 1: 0.1.2 (00030004) -> ",
            "unit 2: 0.1.2 (00030004), not updated to ",
        ],
    );
    has(
        &ran.err,
        &["modioctl: unit 2 does not answer any more: check power"],
    );
    has(
        &ran.err,
        &["modioctl: unit 3 rejected the image (its signature is not by a key"],
    );
    assert_eq!(ran.err.lines().count(), 2, "{ran:?}");
}
