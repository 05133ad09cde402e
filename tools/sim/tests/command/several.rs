//! Several boards, files of boards and scenarios, and `--fixed-line` in the running command.

use std::fs;
use std::time::Duration;

use super::unit::{BAUD, COMMAND, KEY, Unit};
use super::{ENDS, Running, endless_loop, eventually, get, post, refused, state};

/// The module of the modio-02's only port.
const MODULE: [u8; 5] = [3, 0x01, 0x14, 0, 1];

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn each_unit_answers_to_its_own_address_only() {
    let mut unit = Unit::start(&["--unit", "5:4do", "--unit", "7", "--module", "2relay"]);
    let names = get(&unit.http, "/api/boards");
    assert_eq!([&names[0]["name"], &names[1]["name"]], ["unit-5", "unit-7"]);
    for (address, code) in [(5, 2), (7, 3), (5, 2)] {
        let reply = unit.ask_unit(address, &MODULE, 4).unwrap();
        assert_eq!(reply, [3, 2, 0, code], "unit {address}");
    }
    unit.line
        .set_read_timeout(Some(Duration::from_millis(300)))
        .unwrap();
    assert_eq!(unit.try_unit(6, &MODULE, 4), None);
    // Only the unit without power does not answer.
    post(&unit.http, "/api/boards/unit-5/power", r#"{"on":false}"#);
    assert_eq!(unit.try_unit(5, &MODULE, 4), None);
    assert!(unit.ask_unit(7, &MODULE, 4).is_some());
    unit.end(ENDS[0]);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn units_answer_the_first_request_after_their_endpoints_were_announced() {
    let several = ["--unit", "1", "--unit", "2"];
    for (options, address) in [(&["--no-preset"][..], 1), (&several, 1), (&several, 2)] {
        let mut unit = Unit::start(options);
        let reply = unit.try_unit(address, &MODULE, 4);
        assert!(reply.is_some(), "unit {address} with {options:?}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn bus_file_gives_each_board_a_name_and_a_flash() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("plant.toml");
    let text = "[[board]]\nname = 'gate'\ndip = 1\nmodule = '4do'\nflash = 'gate.bin'\n[[board]]\ndip = 2\n";
    fs::write(&file, text).unwrap();
    let option = ["--bus", file.to_str().unwrap()];
    let mut unit = Unit::start(&option);
    unit.save_filter(50);
    assert_eq!(get(&unit.http, "/api/boards/gate/state")["module"], "4do");
    assert_eq!(get(&unit.http, "/api/boards/unit-2/state")["dip"], 2);
    unit.end(ENDS[0]);
    let mut again = Unit::start(&option);
    assert_eq!(again.read(0x0130), 50);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn fixed_line_keeps_its_rate_when_the_unit_changes_its_own() {
    let mut unit = Unit::start(&["--fixed-line"]);
    assert_eq!(unit.rate(), 9600);
    unit.write(KEY, 0x5A17);
    unit.write(BAUD, 192);
    unit.save();
    unit.write(COMMAND, 2);
    eventually("the unit does not start at another rate", || {
        state(&unit.http)["log_tail"].to_string().contains("19200")
    });
    assert_eq!(unit.rate(), 9600);
    unit.line
        .set_read_timeout(Some(Duration::from_millis(300)))
        .unwrap();
    for _ in 0..3 {
        assert_eq!(unit.try_unit(1, &MODULE, 4), None);
    }
}

#[test]
fn wrong_scenario_or_bus_file_is_refused_with_its_place() {
    let directory = tempfile::tempdir().unwrap();
    let elf = endless_loop(directory.path());
    let elf = elf.to_str().unwrap();
    let file = directory.path().join("wrong.toml");
    let name = file.to_str().unwrap();
    fs::write(&file, "[[step]]\nat = '1s'\nchannel = 9\nmanual = true\n").unwrap();
    refused(
        &["--elf", elf, "--scenario", name],
        &[name, "step 1", "1 to 4"],
    );
    refused(&["--elf", elf, "--bus", name], &[name, "line 1", "step"]);
    fs::write(&file, "[[board]]\ndip = 1\nslots = { 1 = '4do' }\n").unwrap();
    refused(&["--elf", elf, "--bus", name], &["no slot at port 1"]);
}

#[test]
fn boards_of_two_types_need_an_image_each() {
    let directory = tempfile::tempdir().unwrap();
    let elf = endless_loop(directory.path());
    let elf = elf.to_str().unwrap();
    let file = directory.path().join("plant.toml");
    fs::write(
        &file,
        "[[board]]\ndip = 1\n[[board]]\ndip = 2\nboard = 'modio-08'\n",
    )
    .unwrap();
    let file = file.to_str().unwrap();
    let first = format!("modio-02={elf}");
    refused(&["--bus", file, "--elf", &first], &["--elf"]);
    let second = format!("modio-08={elf}");
    let images = ["--elf", &first, "--elf", &second];
    let more = ["--bus", file, "--http", "127.0.0.1:0", "--for", "10ms"];
    let mut running = Running::start(&[&images[..], &more].concat());
    assert_eq!(running.end(), (Some(0), String::new()));
}
