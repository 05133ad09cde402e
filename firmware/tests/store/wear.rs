//! The wear of the flash, and the behaviour when the flash is worn out.

use firmware::store::{Page, WriteError};

use crate::flash::{MockFlash, Noise};
use crate::running::{
    Settings, fullest_settings, random_settings, save, settings, start, start_well,
};

#[test]
fn saving_what_is_stored_programs_nothing() {
    let mut flash = MockFlash::erased();
    let (_, mut store) = start_well(&mut flash);
    let before = flash.operations();
    assert!(!save(&mut store, &mut flash, &Settings::defaults()).unwrap());
    let settings = random_settings(1, 30);
    assert!(save(&mut store, &mut flash, &settings).unwrap());
    let after = flash.operations();
    assert!(after > before);
    for _ in 0..1000 {
        assert!(!save(&mut store, &mut flash, &settings).unwrap());
    }
    assert_eq!(flash.operations(), after);
}

#[test]
fn a_start_without_a_new_record_programs_nothing() {
    for settings in [settings(&[(0x0101, 12)]), fullest_settings(2)] {
        let mut flash = MockFlash::erased();
        let (_, mut store) = start_well(&mut flash);
        save(&mut store, &mut flash, &settings).unwrap();
        start_well(&mut flash);
        let before = flash.operations();
        for _ in 0..10 {
            start_well(&mut flash);
        }
        assert_eq!(flash.operations(), before);
    }
}

#[test]
fn an_erased_page_is_always_ready_for_the_largest_configuration() {
    for earlier in 0..60 {
        let mut flash = MockFlash::erased();
        let (_, mut store) = start_well(&mut flash);
        for seed in 0..earlier {
            save(&mut store, &mut flash, &random_settings(seed, 3)).unwrap();
        }
        let (_, mut store) = start_well(&mut flash);
        let before = flash.erases;
        let fullest = fullest_settings(earlier + 1);
        save(&mut store, &mut flash, &fullest).unwrap();
        assert_eq!(flash.erases, before, "after {earlier} saves");
        assert!(start_well(&mut flash).0.settings == fullest);
    }
}

#[test]
fn many_small_saves_share_an_erase() {
    let mut flash = MockFlash::erased();
    let (_, mut store) = start_well(&mut flash);
    for round in 0..1000 {
        save(&mut store, &mut flash, &settings(&[(0x0160, 2000 + round)])).unwrap();
    }
    let erases = flash.erases[0] + flash.erases[1];
    assert!(erases <= 1000 / 50 + 2, "{erases} erases");
}

#[test]
fn garbage_gives_the_defaults_and_is_reported_until_something_is_saved() {
    for seed in 0..200 {
        let mut flash = MockFlash::erased();
        let mut noise = Noise(seed);
        for page in 0..=(seed % 2) as usize {
            flash.pages[page].fill_with(|| noise.next() as u8);
        }
        for _ in 0..2 {
            let (loaded, _) = start_well(&mut flash);
            assert!(loaded.invalid && loaded.settings == Settings::defaults());
        }
        let (_, mut store) = start_well(&mut flash);
        let settings = random_settings(seed, 9);
        save(&mut store, &mut flash, &settings).unwrap();
        let (loaded, _) = start_well(&mut flash);
        assert!(!loaded.invalid && loaded.settings == settings);
    }
}

#[test]
fn a_worn_half_word_fails_a_save_and_keeps_the_stored_configuration() {
    let old = settings(&[(0x0141, 0x1111)]);
    let new = settings(&[(0x0141, 0x2222)]);
    let mut failures = 0;
    for page in [Page::First, Page::Second] {
        for offset in (0..64).step_by(2) {
            let mut flash = MockFlash::erased();
            let (_, mut store) = start_well(&mut flash);
            save(&mut store, &mut flash, &old).unwrap();
            flash.worn = Some((page, offset));
            match save(&mut store, &mut flash, &new) {
                Ok(saved) => assert!(saved),
                Err(error) => {
                    failures += 1;
                    assert_eq!(error, WriteError::Worn);
                    // The record already counts when the second seal is programmed.
                    let stored = store.load(&flash).settings;
                    assert!(stored == old || stored == new);
                    save(&mut store, &mut flash, &new).expect("elsewhere");
                }
            }
            let (loaded, _) = start(&mut flash);
            assert!(
                loaded.settings == new && !loaded.invalid,
                "{page:?} {offset}"
            );
        }
    }
    assert!(failures > 5, "{failures}");
}
