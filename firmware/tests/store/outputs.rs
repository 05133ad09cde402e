//! Records of outputs among saves, with power cuts at every possible place.

use firmware::store::Operation;
use register_map::board::Board;
use register_map::record::{OUTPUTS, encode_page, records};

use crate::flash::{MESSES, Mess, MockFlash};
use crate::running::{
    Loaded, Outputs, Settings, Store, fullest_settings, outputs, random_settings, record, save,
    settings, start_well, stored,
};
use crate::{B, PAGE_SIZE};

/// Settings and outputs.
type State = (Settings, Outputs);

/// Starts the device and returns what it finds.
fn found(flash: &mut MockFlash) -> (State, Store) {
    let mut store = Store::open(flash);
    let loaded: Loaded = store.load(flash);
    assert!(!loaded.invalid && loaded.rejected == 0);
    let first = stored(&store, flash);
    store.prepare(flash).unwrap();
    let outputs = stored(&store, flash);
    assert_eq!(outputs, first, "preparing the pages keeps the outputs");
    ((loaded.settings, outputs), store)
}

enum Event {
    Save(Box<Settings>),
    Record(Outputs),
    Spare,
    Restart,
}
use Event::{Record, Restart, Save, Spare};

/// A place for a power cut: the flash before an operation, the operation, and what a start may find after the cut.
struct Place {
    before: MockFlash,
    operation: Operation,
    old: State,
    new: State,
}

/// Runs a history without a power cut, from the first start on, and returns every place for a cut.
fn live(life: impl IntoIterator<Item = Event>) -> Vec<Place> {
    let mut flash = MockFlash::erased();
    let mut places = Vec::new();
    let (mut state, mut store) = found(&mut flash);
    flash.journal = Some(Vec::new());
    for event in life {
        let old = state.clone();
        match event {
            Save(settings) => {
                save(&mut store, &mut flash, &settings).unwrap();
                state.0 = *settings;
            }
            Record(outputs) => {
                record(&mut store, &mut flash, &outputs).unwrap();
                state.1 = outputs;
            }
            Spare => store.make_spare(&mut flash).unwrap(),
            Restart => {
                let now;
                (now, store) = found(&mut flash);
                assert!(now == state);
            }
        }
        assert_eq!(stored(&store, &flash), state.1);
        for (before, operation) in flash.journal.replace(Vec::new()).unwrap_or_default() {
            places.push(Place {
                before,
                operation,
                old: old.clone(),
                new: state.clone(),
            });
        }
    }
    places
}

/// Cuts the power, starts again, and expects the old or the new settings and outputs. Then checks that everything still
/// works.
fn cut_and_recover(place: &Place, mess: Mess) {
    let mut flash = place.before.clone();
    flash.cut_in(place.operation, mess);
    flash.power_on();
    let what = format!("{:?} {mess:?}", place.operation);
    let (state, _) = found(&mut flash);
    assert!(state == place.old || state == place.new, "{what}");
    flash.power_on();
    let (again, mut store) = found(&mut flash);
    assert!(
        again == state,
        "{what}: the next start finds something else"
    );

    let next = (settings(&[(0x0101, 12)]), vec![(OUTPUTS + 0x0280, 0x0F05)]);
    let saved = save(&mut store, &mut flash, &next.0);
    saved.unwrap_or_else(|failure| panic!("{what}: {failure:?} {store:?}"));
    let recorded = record(&mut store, &mut flash, &next.1);
    recorded.unwrap_or_else(|failure| panic!("{what}: {failure:?}"));
    flash.power_on();
    assert!(found(&mut flash).0 == next, "{what}");
}

/// Number of times a page is larger than one of 1 KiB.
const PAGES_OF_1_KIB: u16 = (PAGE_SIZE / 1024) as u16;

#[test]
fn cut_in_any_record_save_or_start_leaves_old_or_new_settings_and_outputs() {
    let mut life = Vec::new();
    for round in 0..120 * PAGES_OF_1_KIB {
        life.push(Record(outputs(round)));
        if round % 5 == 0 {
            let settings = random_settings(round.into(), 20);
            life.extend([Save(Box::new(settings)), Spare]);
        }
        if round % 25 == 0 {
            life.push(Restart);
        }
    }
    let places = live(life);
    let erases = places
        .iter()
        .filter(|place| matches!(place.operation, Operation::Erase(_)));
    let erases = erases.count();
    assert!(erases > 4, "{erases}");
    let messes = MESSES.iter().cycle();
    for (index, place) in places.iter().enumerate() {
        let messes = messes.clone().skip(index * 3 % MESSES.len());
        messes
            .take(2)
            .for_each(|mess| cut_and_recover(place, *mess));
    }
}

#[test]
fn cut_in_a_record_that_moves_to_the_other_page_leaves_old_or_new_outputs() {
    let mut life = vec![Save(Box::new(random_settings(3, 20)))];
    life.extend((0..40 * PAGES_OF_1_KIB).map(|round| Record(outputs(round))));
    let places = live(life);
    let page = |place: &Place| match place.operation {
        Operation::Program { page, .. } | Operation::Erase(page) => page,
    };
    let first = page(&places[0]);
    let moving: Vec<_> = places
        .iter()
        .skip_while(|place| page(place) == first)
        .take(200)
        .collect();
    assert!(moving.len() > 60, "{}", moving.len());
    for place in moving {
        MESSES.iter().for_each(|mess| cut_and_recover(place, *mess));
    }
}

#[test]
fn record_of_stored_outputs_programs_nothing() {
    let mut flash = MockFlash::erased();
    let (_, mut store) = found(&mut flash);
    assert!(record(&mut store, &mut flash, &outputs(1)).unwrap());
    let before = flash.operations();
    assert!(!record(&mut store, &mut flash, &outputs(1)).unwrap());
    let defaults = Settings::defaults();
    assert!(!save(&mut store, &mut flash, &defaults).unwrap());
    assert!(start_well(&mut flash).0.settings == defaults);
    assert_eq!(flash.operations(), before);
    assert!(record(&mut store, &mut flash, &outputs(2)).unwrap());
}

#[test]
fn without_valid_settings_no_outputs_are_stored() {
    let mut flash = MockFlash::erased();
    flash.pages[0][100] = 0;
    let (_, mut store) = start_well(&mut flash);
    assert!(!record(&mut store, &mut flash, &outputs(1)).unwrap());
    assert!(store.outputs(&flash).is_none());
}

/// With the other page erased whenever the caller can wait.
#[test]
fn largest_settings_and_outputs_fit_a_page_and_a_record_never_erases() {
    let mut flash = MockFlash::erased();
    let (_, mut store) = found(&mut flash);
    for round in 0..200 {
        let erases = flash.erases;
        if round % 10 == 0 {
            let settings = fullest_settings(u64::from(round) + 1);
            save(&mut store, &mut flash, &settings).unwrap();
        }
        record(&mut store, &mut flash, &outputs(round)).unwrap();
        assert_eq!(flash.erases, erases, "{round}");
        store.make_spare(&mut flash).unwrap();
        assert_eq!(stored(&store, &flash), outputs(round));
    }
}

/// Only the settings of a later firmware are lost by a save of this one, not by a record.
#[test]
fn settings_that_only_a_later_firmware_knows_survive_records_and_starts() {
    let pairs = [(0x0101, 12), (0x01D8, 7), (0x0500, 0x1234)];
    let mut page = [0xFF; PAGE_SIZE];
    let size = encode_page(5, &pairs, &mut page).unwrap();
    let mut flash = MockFlash::with(&page[..size], &[]);
    let (_, mut store) = start_well(&mut flash);
    for round in 1..100 * PAGES_OF_1_KIB {
        record(&mut store, &mut flash, &outputs(round)).unwrap();
        if round % 30 == 0 {
            (_, store) = start_well(&mut flash);
        }
    }
    assert!(flash.erases[0] > 0 && flash.erases[1] > 0);
    let newest = flash.pages.iter().flat_map(|page| records(page, B::ROW));
    let newest = newest
        .filter(|(_, record)| !record.holds_outputs())
        .max_by_key(|(_, record)| record.sequence);
    let kept = newest.unwrap().1.pairs();
    assert!(kept.filter(|(address, _)| *address < OUTPUTS).eq(pairs));
}

#[test]
fn settings_of_a_later_firmware_that_fill_a_page_leave_no_room_for_outputs() {
    let pairs: Vec<_> = (0..PAGE_SIZE as u16 / 4 - 8)
        .map(|n| (0x0500 + n, n))
        .collect();
    let mut page = [0xFF; PAGE_SIZE];
    let size = encode_page(5, &pairs, &mut page).unwrap();
    let mut flash = MockFlash::with(&page[..size], &[]);
    let (_, mut store) = start_well(&mut flash);
    assert!(record(&mut store, &mut flash, &outputs(0)).unwrap());
    let before = flash.operations();
    assert!(!record(&mut store, &mut flash, &outputs(3)).unwrap());
    assert_eq!(flash.operations(), before);
    assert_eq!(stored(&store, &flash), outputs(0));
}

/// The figures of docs/safety.md: erases of each page in 20 years with 80 records a day, each with other values, and
/// without and with a start after each tenth record.
#[test]
fn eighty_records_a_day_for_twenty_years_wear_a_page_as_documented() {
    if PAGE_SIZE < 2048 {
        // The parts that keep outputs have pages of 2 KiB.
        return;
    }
    let erases = [(20, 1), (20, 4), (60, 4), (20, 16)].map(|(changed, pairs)| {
        [false, true].map(|restarts| {
            let mut flash = MockFlash::erased();
            let (_, mut store) = found(&mut flash);
            let changed: Vec<_> = (0..changed).map(|n| (0x0160 + n, 2000)).collect();
            let changed = Settings::load(changed.into_iter()).0;
            save(&mut store, &mut flash, &changed).unwrap();
            let rounds = 3_000;
            for round in 0..rounds {
                let outputs: Vec<_> = (0..pairs).map(|n| (OUTPUTS + n, round)).collect();
                record(&mut store, &mut flash, &outputs).unwrap();
                store.make_spare(&mut flash).unwrap();
                if restarts && round % 10 == 0 {
                    (_, store) = start_well(&mut flash);
                }
            }
            let each = f64::from(flash.erases[0] as u32) / f64::from(rounds);
            (each * 80.0 * 365.25 * 20.0 / 100.0).round() as u32 * 100
        })
    });
    let documented = [[3300, 3700], [5100, 5800], [5300, 5800], [12_700, 14_600]];
    assert_eq!(erases, documented);
}
