//! Commands that end in the middle, because the unit stops to answer or refuses one of several requests.

use register_map::Module;
use register_map::codes::Command;
use register_map::configuration::{COMMAND, LORA_ADDRESS, MODULE};
use register_map::state::{STATUS, status};

use crate::program::{At, Ran, has};
use crate::served::{Answers, Modio, serve_requests, serve_unit};

/// Exception of a unit that allows no value.
const REFUSES: Option<u8> = Some(3);

/// Runs the words of a command with a modio-02 that has a 4do. The unit does not answer the first request that begins like
/// this, and those that follow, or refuses it with an exception. FILE is a file with three settings.
fn run(words: &str, request: &[u8], exception: Option<u8>) -> Ran {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("unit.toml");
    let settings = "COMM_TIMEOUT = 2.5\nCOMM_SOURCE = 1\nLORA_ADDRESS = 7\n";
    std::fs::write(&file, settings).unwrap();
    let mut server = Modio::modio_02(Module::Do4);
    let request = request.to_vec();
    let mut is_gone = false;
    let unit = serve_requests(move |unit, pdu| {
        let is_it = pdu.starts_with(&request);
        is_gone |= is_it && exception.is_none();
        Some(match exception {
            _ if is_gone => Vec::new(),
            Some(code) if is_it => {
                modioctl::bus::adu::Framing::Rtu.frame(0, unit, &[pdu[0] | 0x80, code])
            }
            _ => server.response(unit, pdu),
        })
    });
    let words = words.replace("FILE", file.to_str().unwrap());
    At::tcp(unit).run(&format!("--timeout 500ms --retries 0 {words}"))
}

/// Returns the beginning of a request that writes a register, and all of one that writes this value.
fn write(address: u16, value: Option<u16>) -> Vec<u8> {
    let mut request = vec![6];
    request.extend(address.to_be_bytes());
    request.extend(value.map(u16::to_be_bytes).unwrap_or_default());
    request.truncate(if value.is_some() { 5 } else { 3 });
    request
}

fn order(command: Command) -> Vec<u8> {
    write(COMMAND, Some(command.code()))
}

#[test]
fn a_unit_that_is_lost_in_the_middle_of_a_command_leaves_a_report_of_what_is_done() {
    let bit = [5, 0, 17];
    let setting = write(LORA_ADDRESS, None);
    let module = write(MODULE + 4, None);
    let [save, restart, defaults] =
        [Command::Save, Command::Restart, Command::LoadDefaults].map(order);
    let saved = "`modioctl reboot` brings the saved settings back";
    let cases: [(&str, &[u8], &str); 12] = [
        (
            "write p5.1=1 p5.2=1 p5.3=1",
            &bit,
            "; at least 1 of 3 values are written",
        ),
        (
            "write p5.2=1 p5.3=1",
            &bit,
            "; some of the values may be written",
        ),
        (
            "config set COMM_TIMEOUT=1 COMM_SOURCE=1 LORA_ADDRESS=7",
            &setting,
            "; at least 2 of 3 settings are written and nothing is saved: ",
        ),
        (
            "config import FILE",
            &setting,
            "; at least 2 of 3 settings are written and nothing is saved: ",
        ),
        (
            "config import FILE",
            &save,
            "; all settings are written, and may be saved: repeat the import",
        ),
        ("config save", &save, "; the settings may be saved"),
        (
            "config reset",
            &defaults,
            "; the factory settings may be in force and nothing is saved: ",
        ),
        (
            "config reset",
            &save,
            "; the factory settings are in force, and may be saved: repeat the command",
        ),
        (
            "module set 5 4di",
            &module,
            "; p5.module may be written and nothing is saved: ",
        ),
        (
            "module set 5 4di",
            &save,
            "; p5.module is written, and may be saved: repeat the command",
        ),
        (
            "module set 5 4di",
            &restart,
            "; p5.module is saved, and in force after the next restart",
        ),
        (
            "address 00000001 7",
            &[],
            "; it may have address 7 now: `modioctl scan --fast` shows the addresses",
        ),
    ];
    for (words, request, told) in cases {
        let text = run(words, request, None).failed(3);
        has(&text, &[" does not answer at ", told]);
        let is_undone = told.ends_with("nothing is saved: ");
        assert_eq!(text.contains(saved), is_undone, "{words}: {text}");
    }
}

#[test]
fn a_unit_that_refuses_one_of_several_requests_has_not_carried_it_out() {
    let bit = [5, 0, 17];
    let [save, defaults] = [Command::Save, Command::LoadDefaults].map(order);
    let cases: [(&str, &[u8], &str); 6] = [
        (
            "write p5.1=1 p5.2=1 p5.3=1",
            &bit,
            "; 1 of 3 values are written\n",
        ),
        ("write p5.2=1 p5.3=1", &bit, "; nothing is written\n"),
        (
            "config import FILE",
            &save,
            "; all settings are written and nothing is saved: ",
        ),
        (
            "config reset",
            &save,
            "; the factory settings are in force and nothing is saved: ",
        ),
        ("config reset", &defaults, "; nothing has changed\n"),
        (
            "module set 5 4di",
            &save,
            "; p5.module is written and nothing is saved: ",
        ),
    ];
    for (words, request, told) in cases {
        let text = run(words, request, REFUSES).failed(1);
        has(&text, &["exception 03", told]);
    }
}

#[test]
fn a_save_that_the_unit_puts_off_may_still_be_made() {
    let unit = Modio::modio_02(Module::Do4).with([(STATUS, status::UNSAVED)]);
    let text = At::tcp(serve_unit(unit)).run("config save").failed(1);
    has(
        &text,
        &["the settings are not saved", "; the settings may be saved"],
    );
}
