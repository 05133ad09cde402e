//! A flash into which the simulator writes loader and image, and `modio-sim` with them.

use std::{fs, path::Path, process::Command};

use register_map::{configuration::MODULE, update::Slot};
use sim::board::{Firmware, InSlot, MODIO_02};

use crate::{
    in_slots::{START, answers, holding},
    rig::{PORT, file},
};

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn programmed_board_starts_like_one_that_was_started_once() {
    let boot = (MODIO_02.board.layout().boot.first - 0x0800_0000) as usize;
    let boot = boot..boot + 2 * MODIO_02.part.page_size;
    let files = [
        ("modio-02.modio", Slot::A),
        ("modio-a.image", Slot::A),
        ("modio-b.image", Slot::B),
    ];
    for (name, starts) in files {
        let loader = sim::Image::read(&file("loader")).expect("the loader can be read");
        let image = InSlot::read(&MODIO_02, &file(name)).expect("an image for the modio-02");
        let firmware = Firmware::Loaded(loader, image);
        let mut flash = vec![0xFF; MODIO_02.part.flash_size];
        firmware.program(&MODIO_02, &mut flash, false).unwrap();
        assert!(MODIO_02.store(&mut flash, &[(MODULE + PORT - 1, 1)]));
        let state = flash[boot.clone()].to_vec();
        let mut rig = holding(flash, 1);
        assert_eq!(rig.board.running_slot(), None, "the loader");
        answers(&mut rig, START).expect(name);
        assert_eq!(rig.board.running_slot(), Some(starts), "{name}");
        assert_eq!(rig.board.resets(), 0, "no signature is checked");
        assert_eq!(
            rig.board.flash()[boot.clone()],
            state,
            "the loader keeps it"
        );
        let log = rig.board.take_log();
        assert!(log.starts_with("modio "), "{log:?}");
    }
}

/// Runs `modio-sim` for a moment with a flash file, and returns what it reports on stderr.
fn run(flash: &Path, options: &[&str]) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_modio-sim"));
    command.args([
        "--for",
        "10ms",
        "--tcp",
        "127.0.0.1:0",
        "--http",
        "127.0.0.1:0",
    ]);
    let output = command.arg("--flash").arg(flash).args(options).output();
    let output = output.expect("modio-sim can be started");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{said}");
    said
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn flash_file_changes_between_an_image_alone_and_a_loader_with_one_line() {
    let directory = tempfile::tempdir().unwrap();
    let flash = directory.path().join("flash");
    let [elf, loader, update] = ["modio", "loader", "modio-02.modio"].map(file);
    let alone = ["--elf", elf.to_str().unwrap()];
    let loaded = [
        "--loader",
        loader.to_str().unwrap(),
        "--image",
        update.to_str().unwrap(),
    ];
    let module = || {
        MODIO_02
            .configured(&fs::read(&flash).unwrap(), PORT as u8)
            .name()
    };
    let four_outputs = [&alone[..], &["--module", "4do"]].concat();
    assert_eq!(run(&flash, &four_outputs), "");
    for (options, part) in [
        (&loaded[..], "replace an image that runs alone"),
        (&loaded[..], ""),
        (&alone[..], "replaces the loader"),
        (&alone[..], ""),
    ] {
        let said = run(&flash, options);
        assert!(
            said.contains(part) && said.lines().count() == usize::from(!part.is_empty()),
            "{said}"
        );
        assert_eq!(module(), "4do");
    }
}
