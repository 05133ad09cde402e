//! Cuts the power in every single operation of simulated device histories, and tries every state that the cut may
//! leave. The next start must find the complete old or new configuration, and later saves must work.

use firmware::store::{Operation, Page, Pages, Store, WriteError};

use crate::PAGE_SIZE;
use crate::flash::{Fault, MESSES, Mess, MockFlash};
use crate::running::{
    Settings, fullest_settings, random_settings, save, settings, start, start_well,
};

enum Event {
    Save(Box<Settings>),
    Spare,
    Restart,
}
use Event::{Restart, Save, Spare};

/// A place for a power cut: the flash before an operation, the operation, and the configurations that a start may
/// find after the cut.
struct Place {
    before: MockFlash,
    operation: Operation,
    old: Settings,
    new: Settings,
}

/// Returns three of the messes, different ones for each place.
fn some_messes(index: usize) -> impl Iterator<Item = Mess> {
    MESSES
        .into_iter()
        .cycle()
        .skip(index * 3 % MESSES.len())
        .take(3)
}

/// Runs a history without a power cut, from the first start on, and returns every place for a cut.
fn live(flash: MockFlash, first: &Settings, life: &[Event]) -> Vec<Place> {
    let mut flash = flash;
    let mut places = Vec::new();
    let mut note = |flash: &mut MockFlash, old: &Settings, new: &Settings| {
        for (before, operation) in flash.journal.replace(Vec::new()).unwrap_or_default() {
            let (old, new) = (*old, *new);
            places.push(Place {
                before,
                operation,
                old,
                new,
            });
        }
    };
    flash.journal = Some(Vec::new());
    let mut stored = *first;
    let (loaded, mut store) = start_well(&mut flash);
    assert_eq!(loaded.settings, stored);
    note(&mut flash, &stored, &stored);
    for event in life {
        match event {
            Save(settings) => {
                save(&mut store, &mut flash, settings).unwrap();
                note(&mut flash, &stored, settings);
                stored = **settings;
            }
            Spare => {
                store.make_spare(&mut flash).unwrap();
                assert!(store.has_spare());
                note(&mut flash, &stored, &stored);
            }
            Restart => {
                let loaded;
                (loaded, store) = start_well(&mut flash);
                assert_eq!(loaded.settings, stored);
                assert!(!loaded.invalid && loaded.rejected == 0);
                note(&mut flash, &stored, &stored);
            }
        }
    }
    places
}

/// Cuts the power, starts again, and expects the old or the new configuration. Then checks that everything still
/// works.
fn cut_and_recover(place: &Place, mess: Mess) {
    let mut flash = place.before.clone();
    flash.cut_in(place.operation, mess);
    flash.power_on();
    let what = format!("{:?} {mess:?}", place.operation);

    let (loaded, _) = start_well(&mut flash);
    assert!(!loaded.invalid && loaded.rejected == 0, "{what}");
    let found = loaded.settings;
    assert!(found == place.old || found == place.new, "{what}");

    flash.power_on();
    let (again, mut store) = start_well(&mut flash);
    assert!(
        again.settings == found,
        "{what}: the next start finds another configuration"
    );

    let next = settings(&[(0x0101, 12), (0x0160, 2000)]);
    let erases = flash.erases;
    save(&mut store, &mut flash, &next).unwrap();
    assert_eq!(
        flash.erases, erases,
        "{what}: erased while the line is served"
    );
    flash.power_on();
    assert!(start_well(&mut flash).0.settings == next, "{what}");
}

fn cut_everywhere(flash: MockFlash, first: &Settings, life: &[Event]) -> usize {
    let places = live(flash, first, life);
    for place in &places {
        MESSES.iter().for_each(|mess| cut_and_recover(place, *mess));
    }
    places.len()
}

/// Number of times a page is larger than one of 1 KiB.
const PAGES_OF_1_KIB: usize = PAGE_SIZE / 1024;

fn saves(sizes: impl IntoIterator<Item = usize>) -> Vec<Event> {
    let settings = (1..).zip(sizes);
    settings
        .map(|(seed, size)| Save(Box::new(random_settings(seed, size))))
        .collect()
}

#[test]
fn cut_in_the_first_start_and_the_first_saves_is_recovered() {
    let mut life = saves([0, 1, 5]);
    life.push(Restart);
    let cuts = cut_everywhere(MockFlash::erased(), &Settings::defaults(), &life);
    assert!(cuts > 4 + 7 + 3 * 7, "{cuts}");
}

#[test]
fn cut_in_a_save_of_every_setting_is_recovered() {
    let life = [Save(Box::new(fullest_settings(1))), Restart];
    let places = live(MockFlash::erased(), &Settings::defaults(), &life);
    assert!(places.len() > 400, "{}", places.len());
    for (index, place) in places.iter().enumerate() {
        some_messes(index).for_each(|mess| cut_and_recover(place, mess));
    }
}

#[test]
fn cut_in_saves_that_fill_both_pages_without_a_restart_is_recovered() {
    let life = saves([60, 50, 40, 90, 100, 10, 80, 70, 60].repeat(2 * PAGES_OF_1_KIB));
    let places = live(MockFlash::erased(), &Settings::defaults(), &life);
    let erases = places
        .iter()
        .filter(|place| matches!(place.operation, Operation::Erase(_)));
    let erases = erases.count();
    assert!(erases > 2, "{erases} erases");
    for (index, place) in places.iter().enumerate() {
        let erase = matches!(place.operation, Operation::Erase(_));
        let messes = some_messes(index).chain(MESSES.into_iter().filter(|_| erase));
        messes.for_each(|mess| cut_and_recover(place, mess));
    }
}

/// As on a device that never stops: the other page is erased after every change of pages.
#[test]
fn cut_in_an_erase_between_saves_is_recovered_and_saves_never_erase() {
    let mut life = Vec::new();
    for save in saves([60, 50, 40, 90, 100, 10, 80, 70, 60].repeat(2 * PAGES_OF_1_KIB)) {
        life.extend([save, Spare]);
    }
    let places = live(MockFlash::erased(), &Settings::defaults(), &life);
    let is_erase = |place: &&Place| matches!(place.operation, Operation::Erase(_));
    let (idle, saving): (Vec<_>, Vec<_>) = places
        .iter()
        .filter(is_erase)
        .partition(|place| place.old == place.new);
    // The first start erases one page.
    assert!(
        idle.len() > 3 && saving.is_empty(),
        "{} {}",
        idle.len(),
        saving.len()
    );
    for (index, place) in places.iter().enumerate() {
        if place.old == place.new {
            MESSES.iter().for_each(|mess| cut_and_recover(place, *mess));
        } else if index % 7 == 0 {
            some_messes(index).for_each(|mess| cut_and_recover(place, mess));
        }
    }
}

#[test]
fn cut_in_the_compaction_and_the_erases_of_a_start_is_recovered() {
    let mut life = saves(vec![25; 9 * PAGES_OF_1_KIB - 3]);
    life.push(Restart);
    life.extend(saves([25, 25]));
    life.push(Restart);
    let places = live(MockFlash::erased(), &Settings::defaults(), &life);
    // Only a start compacts.
    let in_starts: Vec<_> = places
        .iter()
        .filter(|place| place.old == place.new)
        .collect();
    assert!(in_starts.len() > 60, "{}", in_starts.len());
    for place in in_starts {
        MESSES.iter().for_each(|mess| cut_and_recover(place, *mess));
    }
}

/// The first start was interrupted on either page, so that this page has to be erased. The mock flash refuses
/// programming after an interrupted erase, and only that page reads as delivered.
#[test]
fn cut_in_the_erase_before_the_very_first_record_is_recovered() {
    let half_marked = MockFlash::with(&[0x6F], &[0x6F]);
    let places = live(half_marked, &Settings::defaults(), &[]);
    assert!(matches!(places[0].operation, Operation::Erase(_)));
    for place in places {
        let mut flash = place.before;
        flash.cut_in(place.operation, Mess::Complete);
        flash.power_on();
        let (loaded, _) = start_well(&mut flash);
        assert!(loaded.settings == Settings::defaults() && !loaded.invalid);
    }
}

/// A second cut during the start after the first cut. A start selects the old or the new configuration once it is
/// complete.
#[test]
fn cut_in_the_start_after_a_cut_is_recovered() {
    let life = saves([2, 3]);
    for place in live(MockFlash::erased(), &Settings::defaults(), &life) {
        for (index, mess) in MESSES.into_iter().enumerate() {
            let mut flash = place.before.clone();
            flash.cut_in(place.operation, mess);
            flash.power_on();
            flash.journal = Some(Vec::new());
            let _ = start(&mut flash);
            for (before, operation) in flash.journal.take().unwrap() {
                let second = Place {
                    before,
                    operation,
                    old: place.old,
                    new: place.new,
                };
                cut_and_recover(&second, MESSES[(index + 3) % MESSES.len()]);
            }
        }
    }
}

/// The half-word reads as erased at the start and differently at the save. The program cannot foresee that, so the
/// flash refuses the save. The stored settings remain, and the next save uses another place.
#[test]
fn cut_in_a_half_word_that_then_reads_as_erased_only_at_the_start_is_recovered() {
    let old = settings(&[(0x0141, 0x1111)]);
    let new = settings(&[(0x0141, 0x2222)]);
    let places = live(
        MockFlash::erased(),
        &Settings::defaults(),
        &[Save(Box::new(old)), Save(Box::new(new))],
    );
    let first = places.iter().find(|place| place.old == old).unwrap();
    let mut refused = 0;
    for starts in 1..1000 {
        let mut flash = first.before.clone();
        flash.cut_in(first.operation, Mess::Noise(1));
        // The half-word's content depends on how often the power has returned.
        for _ in 0..starts {
            flash.power_on();
        }
        // Every second read finds the page differently: here the reads at the start differ from those of the save.
        if starts % 2 == 0 {
            let _ = Pages::page(&flash, Page::First);
        }
        let mut store = Store::open(&flash);
        let loaded = store.load(&flash);
        let _ = Pages::page(&flash, Page::First);
        store.prepare(&mut flash).unwrap();
        assert!(loaded.settings == old && !loaded.invalid, "{starts}");
        if let Err(failure) = save(&mut store, &mut flash, &new) {
            assert!(
                matches!(failure, WriteError::Flash(Fault::NotErased)),
                "{starts}: {failure:?}"
            );
            refused += 1;
            flash.power_on();
            let loaded;
            (loaded, store) = start_well(&mut flash);
            assert!(loaded.settings == old && !loaded.invalid, "{starts}");
            if save(&mut store, &mut flash, &new).is_err() {
                save(&mut store, &mut flash, &new).unwrap();
            }
        }
        flash.power_on();
        assert!(start_well(&mut flash).0.settings == new, "{starts}");
    }
    assert!(refused > 10, "{refused}");
}

/// A setting that was saved once, long ago, is copied by every compaction.
#[test]
fn a_setting_that_never_changes_is_kept_over_any_number_of_compactions() {
    let mut flash = MockFlash::erased();
    let (_, mut store) = start_well(&mut flash);
    for round in 0..200 * PAGES_OF_1_KIB as u16 {
        let now = settings(&[(0x0141, 0xBEEF), (0x0160, 2000 + round)]);
        save(&mut store, &mut flash, &now).unwrap();
        if round % 7 == 0 {
            let loaded;
            (loaded, store) = start_well(&mut flash);
            assert!(loaded.settings == now, "{round}");
        }
    }
    assert!(
        flash.erases[0] > 2 && flash.erases[1] > 2,
        "{:?}",
        flash.erases
    );
}
