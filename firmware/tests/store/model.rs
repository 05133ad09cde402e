//! Random device histories compared with the simplest model: a start finds what was saved last.

use firmware::config::Settings;
use proptest::prelude::*;

use crate::flash::{Mess, MockFlash};
use crate::running::{fullest_settings, random_settings, save, start};

#[derive(Clone, Debug)]
enum Event {
    Save(u64, usize),
    SaveAll(u64),
    Restart,
    /// The power is cut in the operation after this many, leaving this mess.
    Cut(usize, Mess),
}

fn mess() -> impl Strategy<Value = Mess> {
    prop_oneof![
        Just(Mess::Untouched),
        Just(Mess::Complete),
        any::<u64>().prop_map(Mess::Sprinkled),
        (0..=1024usize).prop_map(Mess::Front),
        (0..=1024usize).prop_map(Mess::Back),
        any::<u64>().prop_map(Mess::Noise),
    ]
}

fn event() -> impl Strategy<Value = Event> {
    prop_oneof![
        5 => (0..40u64, 0..60usize).prop_map(|(seed, size)| Event::Save(seed, size)),
        1 => (0..4u64).prop_map(Event::SaveAll),
        2 => Just(Event::Restart),
        4 => (0..120usize, mess()).prop_map(|(after, mess)| Event::Cut(after, mess)),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_start_finds_what_was_saved_last(life in prop::collection::vec(event(), 1..40)) {
        let mut flash = MockFlash::erased();
        // The next start must find one of these.
        let (mut old, mut new) = (Settings::defaults(), Settings::defaults());
        let mut store = None;
        for event in life {
            if store.is_none() {
                let (loaded, started) = start(&mut flash);
                prop_assert!(!loaded.invalid && loaded.rejected == 0);
                prop_assert!(loaded.settings == old || loaded.settings == new);
                store = started.ok();
                // A start that is interrupted selects neither.
                if store.is_some() {
                    (old, new) = (loaded.settings.clone(), loaded.settings);
                }
            }
            let settings = match event {
                Event::Save(seed, size) => random_settings(seed, size),
                Event::SaveAll(seed) => fullest_settings(seed),
                Event::Restart => {
                    flash.power_on();
                    store = None;
                    continue;
                }
                Event::Cut(after, mess) => {
                    flash.cut = Some((after, mess));
                    continue;
                }
            };
            match store.as_mut().map(|store| save(store, &mut flash, &settings)) {
                // The power was cut during the start.
                None => flash.power_on(),
                Some(Ok(_)) => (old, new) = (settings.clone(), settings),
                Some(Err(_)) => {
                    new = settings;
                    flash.power_on();
                    store = None;
                }
            }
        }
    }
}
