//! The end of the first key: an image that the second key signed, once it is confirmed, revokes the first.

use super::*;

/// File 2: CRC-32 of both images, numbers of both keys, and whether the first key is revoked.
fn behind_the_images(rig: &mut Rig) -> Vec<u16> {
    rig.records(status::CRCS.start, 9)
}

fn words(bytes: &[u8]) -> Vec<u16> {
    let pairs = bytes.as_chunks().0;
    pairs.iter().copied().map(u16::from_be_bytes).collect()
}

fn crc_of(image: &[u8]) -> Vec<u16> {
    let [a, b, c, d] = [3, 2, 1, 0].map(|n| image[CRC + n]);
    words(&[a, b, c, d])
}

/// Updates slot A, which does not run, and returns how the unit then stands.
fn update_a(rig: &mut Rig, image: &[u8]) -> (usize, Status) {
    rig.prepare();
    rig.send(Slot::A, image);
    rig.board.run_for(Time::from_ms(50));
    assert_eq!(rig.order(Command::Finish), Ok(()));
    after(rig)
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn confirmed_image_by_the_second_key_ends_the_first() {
    let mut rig = running();
    let keys = [number(FIRST_KEY), number(SECOND_KEY)].map(|number| words(&number));
    let by_second = signed_by(SECOND_KEY, 1, |_| {});
    let known = |other: Vec<u16>, revoked: u16| {
        [crc_of(&image(0)), other, keys.concat(), vec![revoked]].concat()
    };
    assert_eq!(behind_the_images(&mut rig), known(vec![0; 2], 0));
    rig.update(&by_second);
    assert_eq!(after(&mut rig).0, 1);
    let here = |revoked| {
        let [own, other] = [&by_second, &image(0)].map(|image| crc_of(image));
        [own, other, keys.concat(), vec![revoked]].concat()
    };
    assert_eq!(behind_the_images(&mut rig), here(0), "on trial");
    assert_eq!(rig.order(Command::Confirm), Ok(()));
    rig.board.run_for(ERASE);
    assert_eq!(behind_the_images(&mut rig), here(1));

    // No way leads back to an image by the first key.
    assert_eq!(rig.order(Command::GoBack), Err(6));
    let mut switched = holding(rig.board.flash().to_vec(), 254);
    answers_as(&mut switched, 255, START).expect("it starts");
    assert_eq!(runs_from(&mut switched), 1);
    let (slot, status) = update_a(&mut rig, &image(0));
    assert_eq!((slot, status.state, status.reason), (1, REJECTED, 8));
    let (slot, _) = update_a(&mut rig, &signed_by(SECOND_KEY, 0, |_| {}));
    assert_eq!(slot, 0);
    assert_eq!(rig.order(Command::Confirm), Ok(()));
    rig.board.run_for(ERASE);
    assert_eq!(rig.order(Command::GoBack), Ok(()));
}

/// Each round writes the boot state three times.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn loop_of_going_back_ends_with_the_budget_of_saves() {
    let mut rig = starting(UPDATED.clone());
    answers(&mut rig, START).expect("it starts");
    let mut rounds = 0;
    while rig.order(Command::GoBack) == Ok(()) {
        rounds += 1;
        after(&mut rig);
        assert_eq!(rig.order(Command::Confirm), Ok(()));
        rig.board.run_for(ERASE);
        assert!(rounds < 30, "without end");
    }
    assert!((19..=21).contains(&rounds), "{rounds}");
    assert_eq!(rig.order(Command::GoBack), Err(6));
    rig.board.run_for(Time::from_secs(61));
    assert_eq!(rig.order(Command::GoBack), Ok(()));
}
