//! `update` and the keys that sign images.

use modio_description::{checksum, describe};
use register_map::board::MODIO_02;
use register_map::state::{BUILD, DESCRIPTION_CRC};

use super::*;

/// Numbers of the keys of a loader.
const KEYS: [u32; 2] = [0x0101_FFFF, 0x0202_EEEE];

#[test]
fn a_file_by_the_second_key_ends_the_first_only_when_that_is_asked_for() {
    let [first, second] = KEYS;
    let line = Line::new(3, |unit| {
        // Unit 3 has ended its first key before.
        (unit.keys, unit.revoked) = (KEYS, unit.address == 3);
    });
    let text = line.run_by(second, "update FILE --units 1-3").failed(2);
    let asks = "nothing was sent: the file is signed with the second key of units 1-2, so it ends the first key there";
    has(&text, &[asks, ": give --end-first-key"]);
    let text = line
        .run_by(first, "update FILE --units 1-3 --end-first-key")
        .failed(2);
    has(&text, &["unit 1 keeps its first key, ", "; unit 2 keeps"]);
    has(&text, &["; unit 3 takes no file by its first key"]);
    assert_eq!(line.written.lock().unwrap().len(), 0);

    // Also when the unit runs that file already.
    let runs = Line::new(1, |unit| unit.keys = KEYS);
    let image = File::read(&file(runs.folder.path(), first)).unwrap().images[0].clone();
    let set = |unit: &mut Model| (unit.images[0], unit.crcs[0]) = (image.words, image.crc);
    set(&mut runs.units.lock().unwrap()[0]);
    has(
        &runs.run_by(first, "update FILE").fine(),
        &["it runs that already"],
    );
    let text = runs.run_by(first, "update FILE --end-first-key").failed(2);
    has(&text, &["unit 1 keeps its first key, 0101ffff: "]);

    let ran = line.run_by(second, "update FILE --units 1-3 --end-first-key");
    has(
        &ran.err,
        &["ends the first key of units 1-2, for good: neither SW01 = 254 nor 0xB004"],
    );
    let done = "0.1.2 (00030004) -> 0.3.1 (1a2b3c4d) in slot B, confirmed";
    has(&ran.fine(), &[&format!("unit 1: {done}")]);
    assert!(line.units.lock().unwrap().iter().all(|unit| unit.revoked));
    let ended =
        "modioctl: the first key is ended in units 1-3: only the second signs updates there\n";
    assert_eq!(line.run("update --status --units 1-3").err, ended);
    let json = line.run("--json update --status").fine();
    has(&json, &["\"first_key_ended\": true"]);
}

#[test]
fn units_that_accept_a_development_key_are_named_in_one_line() {
    let line = Line::new(4, |unit| unit.development = unit.address != 3);
    let names = |ran: &Ran, units: &str| {
        let line =
            format!("modioctl: a development key, which everybody has, is accepted by {units}: ");
        assert!(ran.err.starts_with(&line), "{ran:?}");
        assert_eq!(ran.err.lines().count(), 1, "{ran:?}");
    };
    names(&line.run("update --status --units 1-4"), "units 1-2, 4");
    names(&line.run("update FILE --units 1,3"), "unit 1");
    let ran = line.run("update --status --units 3");
    assert_eq!(ran.err, "", "no development key");
    let json: serde_json::Value =
        serde_json::from_str(&line.run("--json update --status --units 3-4").fine()).unwrap();
    assert_eq!(
        [0, 1].map(|unit: usize| &json[unit]["development"]),
        [&false, &true]
    );
}

#[test]
fn info_names_a_development_key_that_the_loader_accepts_and_a_version_that_is_no_release() {
    for (build, accepts, version) in [(0b1010, true, "0.1.0"), (0b1_0010, false, "0.1.0-dev")] {
        // The unit does not serve its description, so the program must know it.
        let description = describe(&MODIO_02, version, |_| Module::Di4);
        let crc = (DESCRIPTION_CRC, checksum(&description.encode()));
        let unit = Modio::modio_02(Module::Di4).with([(BUILD, build), crc]);
        let address = serve_unit(unit);
        let text = At::tcp(address).run("info").fine();
        let row = text.lines().find(|line| line.starts_with("  build "));
        let row = row.unwrap();
        let says = row.contains("the loader accepts the development key");
        assert_eq!(says, accepts, "{row}");
        let no_release = version.ends_with("-dev");
        assert_eq!(row.contains("no release"), no_release, "{row}");
    }
}
