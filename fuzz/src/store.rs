//! Target `store`: two flash pages of any content, then the life of a device: saves, starts, spares
//! made, the power cut in any operation with any mess, a half-word worn out.
//!
//! Every start finds what was saved last, or, after a cut in a save, that or what was there before,
//! whole. The flash of firmware's tests takes no programming that RM0008 3.3 does not allow. In the end,
//! unless the flash is worn, a save works at once, without an erase, and the next start finds it.
//!
//! ```text
//!   script: base of the sequence numbers (4 bytes), two pages, events
//!   event:  0 save              seed, size     1 save of every setting  seed
//!           2 a start                          3 a cut      so many operations later, mess
//!           4 a spare is made                  5 wear       place (2 bytes; top bit: second page)
//!           6 save of two settings  4 bytes    7 save of what is stored
//! ```

use firmware::config::Settings;
use firmware::store::{Loaded, Page, Store, StoreError};
use register_map::board::MODIO_02;

use crate::PAGE_SIZE;
use crate::flash::{Fault, Mess, MockFlash};
use crate::pages::{self, Found};
use crate::running::{fullest_settings, random_settings, save};
use crate::script::Script;

/// More than fill both pages several times.
const MOST_EVENTS: usize = 60;

/// Target `store`.
pub fn run(input: &[u8]) {
    let mut script = Script::new(input);
    let base = script.word();
    let pages = [0; 2].map(|_| pages::page(&mut script, base));
    let mut life = Life {
        expected: pages::read(&pages),
        flash: MockFlash::holding(pages),
        store: None,
        refusals: 0,
    };
    for _ in 0..MOST_EVENTS {
        let Some(tag) = script.tag() else { break };
        life.event(tag & 7, &mut script);
    }
    life.must_go_on();
}

struct Life {
    flash: MockFlash,
    /// What the next start may find.
    expected: Vec<Found>,
    /// While the power is on.
    store: Option<Store>,
    /// Operations that the flash refused.
    refusals: usize,
}

impl Life {
    fn event(&mut self, event: u8, script: &mut Script<'_>) {
        match event {
            0 => {
                let (seed, size) = (script.byte(), script.byte() % 60);
                self.save(&random_settings(u64::from(seed), usize::from(size)));
            }
            1 => self.save(&fullest_settings(u64::from(script.byte()))),
            2 => {
                self.power_cycle();
                self.start();
            }
            3 => {
                let after = usize::from(script.byte());
                self.flash.cut = Some((after, mess(script)));
            }
            4 => {
                self.start();
                let spare = self
                    .store
                    .as_mut()
                    .map(|store| store.make_spare(&mut self.flash));
                self.bear(spare);
            }
            5 => {
                let place = script.half();
                let page = if place >> 15 == 0 {
                    Page::First
                } else {
                    Page::Second
                };
                // What is worn once stays so.
                let offset = usize::from(place) * 2 % PAGE_SIZE;
                self.flash.worn.get_or_insert((page, offset));
            }
            6 => {
                let [a, b] = [0; 2].map(|_| (0x0100 | u16::from(script.byte()), script.half()));
                self.save(&Settings::load(&MODIO_02, [a, b].into_iter()).0);
            }
            _ => {
                self.start();
                let stored = self.expected[0].settings.clone();
                self.save(&stored);
            }
        }
    }

    fn power_cycle(&mut self) {
        self.flash.power_on();
        self.store = None;
        let reads_otherwise = self.flash.unsteady.contains(&true);
        if reads_otherwise && pages::nothing_good(&self.flash.pages) {
            // What an erase that was cut short has left looks like something stored one time and like
            // nothing the next.
            self.expected = vec![Found::good(&Settings::defaults()), Found::damaged()];
        }
    }

    /// Starts, unless it has; again, if the power is cut meanwhile.
    fn start(&mut self) {
        while self.store.is_none() {
            let mut store = Store::open(&self.flash);
            // A start that is cut short decides nothing.
            self.check(store.load(&MODIO_02, &self.flash));
            let prepared = store.prepare(&mut self.flash);
            if prepared.is_ok() {
                let found = self.check(store.load(&MODIO_02, &self.flash));
                self.decide(found);
            }
            self.store = Some(store);
            self.bear(Some(prepared));
        }
    }

    fn check(&self, loaded: Loaded) -> Found {
        let found = Found {
            settings: loaded.settings,
            invalid: loaded.invalid,
            rejected: loaded.rejected,
        };
        assert!(
            self.expected.contains(&found),
            "found {found:?} in place of {:?}",
            self.expected
        );
        found
    }

    fn decide(&mut self, found: Found) {
        // Records without an order among them may still be there after a cut.
        if self.expected.len() <= 2 {
            self.expected = vec![found];
        }
    }

    /// A cut ends this life; a worn flash may refuse.
    fn bear<T>(&mut self, result: Option<Result<T, StoreError<Fault>>>) {
        if matches!(result, Some(Err(_))) && pages::nothing_good(&self.flash.pages) {
            // The defaults that the first start stores are not there: it was cut short, or the flash is
            // worn. Then what is left of an erase or a save is all there is.
            self.expected.push(Found::damaged());
        }
        match result {
            None | Some(Ok(_)) => {}
            Some(Err(StoreError::Flash(_, Fault::PowerCut))) => self.power_cycle(),
            // Only a half-word whose program was cut off is refused. What was stored still is.
            Some(Err(StoreError::Flash(_, Fault::NotErased))) => self.refusals += 1,
            Some(Err(StoreError::Worn(..))) => assert!(self.flash.worn.is_some(), "not worn"),
        }
    }

    fn save(&mut self, settings: &Settings) {
        self.start();
        let Some(store) = &mut self.store else { return };
        let saved = save(store, &mut self.flash, settings);
        match saved {
            Ok(_) => self.expected = vec![Found::good(settings)],
            // Where the second seal is worn out, the record counts already.
            Err(_) => self.expected.push(Found::good(settings)),
        }
        self.bear(Some(saved));
    }

    /// The device works whatever has been.
    fn must_go_on(&mut self) {
        self.power_cycle();
        self.start();
        if self.flash.worn.is_some() {
            return;
        }
        self.must_save(&random_settings(7, 9));
        self.must_save(&fullest_settings(3));
    }

    /// A save is done at once and without an erase. Each page may refuse one, where the program of its next half-word
    /// was once cut off; the save after that takes another place.
    fn must_save(&mut self, settings: &Settings) {
        let (erases, refusals) = (self.flash.erases, self.refusals);
        loop {
            let before = self.refusals;
            self.save(settings);
            if self.refusals == before {
                break;
            }
            assert!(self.refusals <= refusals + 2, "both pages refused");
        }
        assert_eq!(self.expected, [Found::good(settings)], "it is saved");
        assert!(
            self.flash.erases == erases || self.refusals == refusals + 2,
            "erased while the line was served"
        );
        self.power_cycle();
        self.start();
    }
}

fn mess(script: &mut Script<'_>) -> Mess {
    let kind = script.byte();
    let operand = script.half();
    let place = usize::from(operand) % (PAGE_SIZE + 1);
    match kind % 6 {
        0 => Mess::Untouched,
        1 => Mess::Complete,
        2 => Mess::Sprinkled(u64::from(operand)),
        3 => Mess::Front(place),
        4 => Mess::Back(place),
        _ => Mess::Noise(u64::from(operand)),
    }
}
