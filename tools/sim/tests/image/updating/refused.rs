//! Images that must not start, and attacks.

use super::*;

/// Returns images for slot B that the loader refuses, each with the reason.
fn refused_images() -> [(&'static str, u16, Vec<u8>); 7] {
    let with = |at: usize, bits: u8| {
        let mut image = image(1);
        image[at] ^= bits;
        image
    };
    let whole = |mut image: Vec<u8>| {
        with_crc(&mut image);
        image
    };
    let signed = |mut image: Vec<u8>| {
        sign(&mut image, FIRST_KEY);
        image
    };
    [
        ("version", 8, whole(with(9, 1))),
        ("commit", 8, whole(with(24, 1))),
        ("signature", 8, with(SIGNATURE, 1)),
        ("key of somebody else", 8, with(SIGNATURE + 63, 0x10)),
        ("signed, but another hash", 7, signed(with(HASH, 1))),
        ("signed, but other code", 7, signed(with(20_000, 0x80))),
        ("last byte", 7, whole(with(image(1).len() - 1, 1))),
    ]
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn an_image_that_is_not_genuine_is_refused_and_the_old_one_runs() {
    for (what, reason, image) in refused_images() {
        let mut rig = with_changes(&image);
        let (slot, status) = after(&mut rig);
        let refused = (slot, status.state, status.reason);
        assert_eq!(refused, (0, REJECTED, reason), "{what}");
        assert_eq!(rig.order(Command::GoBack), Err(6), "{what}");
        assert_eq!(rig.order(Command::Finish), Err(6), "{what}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn an_image_that_is_not_intact_is_refused_without_a_restart() {
    let mut rig = running();
    let last = image(1).len() - 1;
    let changed = |at: usize| {
        let mut image = image(1);
        image[at] ^= 1;
        image
    };
    for (what, reason, image) in [("code", 6, changed(last)), ("zero area", 1, changed(511))] {
        rig.prepare();
        rig.send(Slot::B, &image);
        rig.board.run_for(ERASE);
        assert_eq!(rig.order(Command::Finish), Ok(()));
        rig.board.run_for(ERASE);
        let status = rig.update_status();
        assert_eq!((status.state, status.reason), (1, reason), "{what}");
        assert_eq!(status.missing, status.blocks, "{what}");
        assert_eq!(rig.board.resets(), 1, "that of the first start");
    }
    // What is right already is not written again.
    rig.send(Slot::B, &image(1));
    rig.board.run_for(ERASE);
    assert_eq!(rig.update_status().missing, 0);
    assert_eq!(rig.order(Command::Finish), Ok(()));
    assert_eq!(after(&mut rig).0, 1);
}

/// Attack: a slot that was confirmed is prepared and filled with code that is not signed, and then chosen in every way.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn code_that_is_not_signed_is_never_started() {
    let mut rig = starting(UPDATED.clone());
    assert_eq!(after(&mut rig).0, 1);
    // Slot A was confirmed.
    let mut forged = image(0);
    forged[20_000] ^= 1;
    with_crc(&mut forged);
    rig.prepare();
    rig.send(Slot::A, &forged);
    rig.board.run_for(ERASE);
    assert_eq!(rig.order(Command::GoBack), Err(6));
    let mut switched = holding(rig.board.flash().to_vec(), 254);
    switched.patience = ERASE;
    answers_as(&mut switched, 255, START).expect("it starts");
    assert_eq!(runs_from(&mut switched), 1);
    // The image that runs is damaged.
    let mut flash = rig.board.flash().to_vec();
    let b = (LAYOUT.board.layout().slots[1] - 0x0800_0000) as usize;
    flash[b + 20_000] ^= 1;
    let mut damaged = holding(flash, 1);
    damaged.board.run_for(CHECK);
    assert!(damaged.board.leds().fault && damaged.board.pc() < LAYOUT.board.layout().slots[0]);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn an_image_of_an_older_epoch_is_never_started() {
    let epoch = |slot, epoch| signed(slot, |image| image[6] = epoch);
    let mut rig = unit_of([&epoch(0, 2), &[]]);
    assert_eq!(
        rig.records(5, 1),
        [2],
        "the floor is that of the first image"
    );
    rig.update(&epoch(1, 1));
    let (slot, status) = after(&mut rig);
    assert_eq!((slot, status.state, status.reason), (0, REJECTED, 5));
    updated(&mut rig, &epoch(1, 3));
    assert_eq!(rig.records(5, 1), [3]);
    // The image in slot A is confirmed, and below the floor now.
    assert_eq!(rig.update_status().state, CONFIRMED);
    assert_eq!(rig.order(Command::GoBack), Err(6));
    let mut switched = holding(rig.board.flash().to_vec(), 254);
    answers_as(&mut switched, 255, START).expect("it starts");
    assert_eq!(runs_from(&mut switched), 1);
}
