//! `update`, with units that the test serves, and with the loader and the image in the simulator.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use modioctl::bus::adu::Framing;
use modioctl::update::File;
use register_map::Module;
use register_map::codes::FaultKind;
use register_map::fault;
use register_map::update::{DEVELOPMENT_KEY, Slot, State};

use crate::program::{At, Ran, has, modioctl};
use crate::served::{Modio, serve_requests, serve_unit};
use crate::unit::{Unit, update_file};

#[allow(dead_code, reason = "the tests of the plan use the rest")]
#[path = "../../src/update/tests/model.rs"]
mod model;
#[allow(dead_code, reason = "the tests of the file use the rest")]
#[path = "../../src/update/tests/sample.rs"]
mod sample;

use model::{Flaw, Model};

mod failing;
mod keys;

/// Blocks of the image.
const BLOCKS: usize = 100;

/// A line with units.
struct Line {
    units: Arc<Mutex<Vec<Model>>>,
    /// PDUs of all requests that write.
    written: Arc<Mutex<Vec<Vec<u8>>>>,
    at: At,
    folder: tempfile::TempDir,
}

impl Line {
    /// Serves units 1 to `count`, after a change of each.
    fn new(count: u8, change: impl FnMut(&mut Model)) -> Self {
        Self::with(count, change, false, usize::MAX)
    }

    /// The same, with an adapter that may return what it sends. The connection is lost after `cut` writes.
    fn with(count: u8, change: impl FnMut(&mut Model), echo: bool, cut: usize) -> Self {
        let fault = [
            (fault::KIND, FaultKind::Panic.code()),
            (fault::PROGRAM_COUNTER, 0x0801),
            (fault::PROGRAM_COUNTER + 1, 0x2344),
            (fault::UPTIME + 1, 3),
        ];
        let mut units: Vec<_> = (1..=count).map(Model::new).collect();
        for unit in &mut units {
            unit.modio.fixed.extend(fault);
            unit.page = Duration::from_millis(2);
            unit.restart = Duration::from_millis(400);
        }
        units.iter_mut().for_each(change);
        let units = Arc::new(Mutex::new(units));
        let written = Arc::default();
        let at = At::tcp(serve(&units, &written, echo, cut));
        let folder = tempfile::tempdir().unwrap();
        Self {
            units,
            written,
            at,
            folder,
        }
    }

    /// Returns the path of a file for a modio-02.
    fn file(&self) -> PathBuf {
        file(self.folder.path(), 0)
    }

    fn words(&self, words: &str) -> String {
        let file = self.file();
        format!("--baud 921600 --timeout 200ms {words}").replace("FILE", file.to_str().unwrap())
    }

    /// The same with a file that is signed with this key.
    fn run_by(&self, key: u32, words: &str) -> crate::program::Ran {
        let file = file(self.folder.path(), key);
        self.run(&words.replace("FILE", file.to_str().unwrap()))
    }

    fn run(&self, words: &str) -> crate::program::Ran {
        self.at.run(&self.words(words))
    }

    fn blocks(&self) -> usize {
        let written = self.written.lock().unwrap();
        written.iter().filter(|pdu| pdu.len() > 100).count()
    }
}

/// Writes the file of an update of a modio-02 by the key with this number, 0 for none. Returns its path.
fn file(folder: &Path, key: u32) -> PathBuf {
    let path = folder.join(format!("modio-02-{key}.modio"));
    let images = Slot::ALL.map(|slot| sample::image(slot, BLOCKS * 128 - 512));
    let images = images.map(|image| sample::signed(image, key));
    std::fs::write(&path, sample::file(images)).unwrap();
    path
}

/// Serves units on a line. The connection is lost after this number of requests that write.
fn serve(
    units: &Arc<Mutex<Vec<Model>>>,
    written: &Arc<Mutex<Vec<Vec<u8>>>>,
    echo: bool,
    cut: usize,
) -> SocketAddr {
    let (units, written) = (Arc::clone(units), Arc::clone(written));
    let begin = Instant::now();
    serve_requests(move |unit, pdu| {
        if matches!(pdu[0], 6 | 0x15) {
            let mut written = written.lock().unwrap();
            if written.len() == cut {
                return None;
            }
            written.push(pdu.to_vec());
        }
        let mut units = units.lock().unwrap();
        let mut bytes = match echo {
            true => Framing::Rtu.frame(0, unit, pdu),
            false => Vec::new(),
        };
        let answers = units
            .iter_mut()
            .filter_map(|known| known.take(unit, pdu, begin.elapsed()));
        // All units take a broadcast.
        let answer = answers.collect::<Vec<_>>().pop();
        if let Some(answer) = answer {
            bytes.extend(Framing::Rtu.frame(0, unit, &answer));
        }
        Some(bytes)
    })
}

#[test]
fn units_are_updated_together_and_again_only_when_it_is_forced() {
    let line = Line::new(3, |_| ());
    let text = line.run("update FILE --units 1-3").fine();
    let done = "0.1.2 (00030004) -> 0.3.1 (1a2b3c4d) in slot B, confirmed";
    has(
        &text,
        &[&format!("unit 3: {done}"), "for 100 of the image:"],
    );
    let sent = line.blocks();
    assert!((BLOCKS..BLOCKS + 60).contains(&sent), "{sent}");
    let file = File::read(&line.file()).unwrap();
    for unit in line.units.lock().unwrap().iter() {
        let content: Vec<_> = unit.content.iter().map(|block| block.unwrap()).collect();
        assert_eq!(content, file.image(Slot::B).blocks);
        assert!(!unit.trial);
    }
    let text = line.run("update FILE --units 1-3").fine();
    let again = "unit 2: 0.3.1 (1a2b3c4d) in slot B, it runs that already";
    has(&text, &[again]);
    assert_eq!(line.blocks(), sent);
    let text = line
        .run("--json update FILE --unit 2 --force --unicast")
        .fine();
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(json["units"][0]["slot"], "A");
    assert_eq!(json["units"][0]["result"], "confirmed");
    assert!(json["seconds"]["blocks"].as_f64().unwrap() > 0.1, "{json}");
}

#[test]
fn blocks_are_broadcast_unless_something_answers_and_an_echo_is_no_answer() {
    for is_echo in [true, false] {
        let answers = |unit: &mut Model| {
            if !is_echo {
                unit.flaw = Flaw::AnswersBroadcasts;
            }
        };
        let text = Line::with(2, answers, is_echo, usize::MAX);
        let text = text.run("update FILE --units 1-2").fine();
        has(&text, &["unit 1: 0.1.2", "unit 2: 0.1.2"]);
        assert_eq!(text.contains("to each unit alone"), !is_echo, "{text}");
    }
}

#[test]
fn nothing_is_sent_unless_the_file_suits_every_unit() {
    let line = Line::new(3, |unit| {
        unit.floor = u16::from(unit.address == 2);
        unit.trial = unit.address == 3;
    });
    let text = line.run("update FILE --units 1-3").failed(2);
    has(&text, &["nothing was sent: ", "unit 2 takes only firmware"]);
    has(&text, &["; unit 3 runs 0.1.2 (00030004) on trial: "]);
    let text = line.run("--retries 0 update FILE --units 1,9").failed(3);
    has(&text, &["nothing was sent: unit 9 does not answer"]);
    line.run("update /nowhere.modio").failed(2);
    line.run("update FILE --unit 1 --poll nonsense").failed(2);
    line.run("update").failed(2);
    line.run("update --status FILE").failed(2);
    assert_eq!(line.written.lock().unwrap().len(), 0);
}

#[test]
fn what_is_in_a_file_is_shown_without_a_unit() {
    let folder = tempfile::tempdir().unwrap();
    let run = |key, options: &str| {
        let file = file(folder.path(), key);
        let mut command = modioctl(&[]);
        command.args(options.split_whitespace());
        Ran::of(
            &command
                .args(["update", "--show"])
                .arg(file)
                .output()
                .unwrap(),
        )
    };
    let images = File::read(&file(folder.path(), 0)).unwrap().images;
    let [a, b] = images.map(|image| image.crc);
    let text = run(DEVELOPMENT_KEY, "").fine();
    let rows: Vec<_> = text.lines().map(str::trim_end).collect();
    assert_eq!(
        rows,
        [
            "board    modio-02",
            "version  0.3.1",
            "commit   1a2b3c4d",
            "epoch    0",
            "key      11fa5ab8, a development key, which everybody has",
            &format!("slot A   12800 bytes, CRC-32 {a:08x}"),
            &format!("slot B   12800 bytes, CRC-32 {b:08x}"),
        ]
    );
    has(
        &run(1, "").fine(),
        &["key      00000001, which this program does not know"],
    );
    has(&run(0, "").fine(), &["key      none: it is not signed"]);
    let json: serde_json::Value = serde_json::from_str(&run(0x0A, "--json").fine()).unwrap();
    assert_eq!(
        (&json["key"], &json["key_name"]),
        (&"0000000a".into(), &().into())
    );
    assert_eq!(json["images"][1]["bytes"], 12800);
    let line = Line::new(0, |_| ());
    for wrong in [
        "--show",
        "--show FILE --status",
        "--show FILE --units 1",
        "--show FILE --end-first-key",
    ] {
        line.run(&format!("update {wrong}")).failed(2);
    }
}

#[test]
fn a_unit_without_a_loader_cannot_be_updated() {
    // Register UPDATE is 0.
    let address = serve_unit(Modio::modio_02(Module::Di4));
    let line = Line::new(0, |_| ());
    let at = At::tcp(address);
    for words in ["update FILE", "update --back"] {
        let text = at.run(&line.words(words)).failed(2);
        has(
            &text,
            &["unit 1 has no loader, so it cannot be updated over the line"],
        );
    }
}

#[test]
fn status_shows_both_slots_and_the_way_back_exchanges_them() {
    let line = Line::new(2, |unit| {
        if unit.address == 1 {
            unit.state = State::Confirmed;
            unit.images[1] = [0x0100, 7, 0, 0xAAAA, 0xBBBB, 20, 0, 0];
        }
    });
    let text = line.run("update --status --units 1-2").fine();
    has(
        &text,
        &["modio-02  A     0.1.2 (00030004)  confirmed  1.0.7 (aaaabbbb), confirmed"],
    );
    let json: serde_json::Value =
        serde_json::from_str(&line.run("--json update --status --units 1-2").fine()).unwrap();
    assert_eq!(json[1]["other"], "empty");
    let text = line.run("update --back --units 1-2").failed(2);
    has(
        &text,
        &["nothing was sent: unit 2 has nothing to go back to"],
    );
    let text = line.run("update --back").fine();
    has(
        &text,
        &["unit 1: 0.1.2 (00030004) -> 1.0.7 (aaaabbbb) in slot B, confirmed"],
    );
    assert_eq!(line.blocks(), 0);
}

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn a_unit_takes_the_image_for_its_other_slot_and_goes_back() {
    let unit = Unit::with(1, &["--module", "4di"]);
    let at = At::port(unit.pty.display());
    at.run("config set BAUD=115200").fine();
    at.run("config save").fine();
    at.run("reboot").fine();
    let run = |words: &str| at.run(&format!("--baud 115200 update {words}")).fine();
    let file = update_file();
    let file = file.display();
    has(
        &run(&file.to_string()),
        &["in slot A, it runs that already"],
    );
    let text = run(&format!("{file} --force --poll p5.1"));
    has(
        &text,
        &[
            "p5.1 off",
            "unit 1: ",
            "in slot B, confirmed",
            " blocks sent for ",
        ],
    );
    has(&run("--status"), &["1     modio-02  B     "]);
    has(&run("--back"), &["in slot A, confirmed"]);
    let text = at.run("--baud 115200 info").fine();
    has(&text, &["slot A runs, confirmed; slot B confirmed"]);
}
