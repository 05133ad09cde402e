//! Target `store`: two flash pages with any content, then a device history: saves, starts, erased spare pages, a
//! power cut in any operation that leaves any mess, a worn half-word.
//!
//! Every start must find what was saved last or, after a power cut in a save, the old or the new configuration,
//! complete, and in the same way the outputs that were recorded last. The mock flash of firmware's tests refuses any programming that RM0008 3.3 does not allow. At the end,
//! unless the flash is worn, a save works immediately and without an erase, and the next start finds it.
//!
//! ```text
//!   script: base of the sequence numbers (4 bytes), two pages, events
//!   event:  0 save              seed, size     1 save of every setting  seed
//!           2 a start                          3 a cut      number of operations before it, mess
//!           4 erase the spare page             5 wear       place (2 bytes; top bit: second page)
//!           6 save of two settings  4 bytes    7 save of what is stored
//!           8 a record of outputs   round
//! ```

use firmware::store::{Page, WriteError};

use crate::PAGE_SIZE;
use crate::flash::{Fault, Mess, MockFlash};
use crate::pages::{self, Found};
use crate::running::{
    Loaded, Outputs, Settings, Store, fullest_settings, outputs, random_settings, record, save,
    stored,
};
use crate::script::Script;

/// Enough events to fill both pages several times.
const MOST_EVENTS: usize = 60;

/// Target `store`.
pub fn run(input: &[u8]) {
    let mut script = Script::new(input);
    let base = script.word();
    let pages = [0; 2].map(|_| pages::page(&mut script, base));
    let mut life = Life {
        expected: pages::read(&pages),
        outputs: vec![Outputs::new()],
        flash: MockFlash::holding(pages),
        store: None,
        refusals: 0,
    };
    for _ in 0..MOST_EVENTS {
        let Some(tag) = script.tag() else { break };
        life.event(
            match tag & 15 {
                8 => 8,
                _ => tag & 7,
            },
            &mut script,
        );
    }
    life.must_go_on();
}

struct Life {
    flash: MockFlash,
    /// Configurations that the next start may find.
    expected: Vec<Found>,
    /// Stored outputs that the next start may find.
    outputs: Vec<Outputs>,
    /// The store while the power is on.
    store: Option<Store>,
    /// Number of operations that the flash refused.
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
                self.handle(spare);
            }
            5 => {
                let place = script.half();
                let page = if place >> 15 == 0 {
                    Page::First
                } else {
                    Page::Second
                };
                // A worn-out half-word stays worn for the rest of the run.
                let offset = usize::from(place) * 2 % PAGE_SIZE;
                self.flash.worn.get_or_insert((page, offset));
            }
            6 => {
                let [a, b] = [0; 2].map(|_| (0x0100 | u16::from(script.byte()), script.half()));
                self.save(&Settings::load([a, b].into_iter()).0);
            }
            8 => self.record(&outputs(script.byte().into())),
            _ => {
                self.start();
                let stored = self.expected[0].settings;
                self.save(&stored);
            }
        }
    }

    fn power_cycle(&mut self) {
        self.flash.power_on();
        self.store = None;
        let reads_otherwise = self.flash.unsteady.contains(&true);
        if reads_otherwise && pages::nothing_good(&self.flash.pages) {
            // An interrupted erase may leave data that looks like something stored at one start and like nothing at
            // the next.
            self.expected = vec![Found::good(&Settings::defaults()), Found::damaged()];
        }
    }

    /// Starts the device unless it is running. Starts it again if the power is cut during the start.
    fn start(&mut self) {
        while self.store.is_none() {
            let mut store = Store::open(&self.flash);
            // An interrupted start selects no configuration.
            self.check(store.load(&self.flash));
            let prepared = store.prepare(&mut self.flash);
            let outputs = stored(&store, &self.flash);
            assert!(self.outputs.contains(&outputs), "found {outputs:?}");
            if prepared.is_ok() {
                let found = self.check(store.load(&self.flash));
                self.decide(found);
                self.outputs = vec![outputs];
            }
            self.store = Some(store);
            self.handle(Some(prepared));
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
        // After a power cut, records without an order may still exist.
        if self.expected.len() <= 2 {
            self.expected = vec![found];
        }
    }

    /// Handles the result of an operation: a power cut stops the device, and a worn flash may refuse.
    fn handle<T>(&mut self, result: Option<Result<T, WriteError<Fault>>>) {
        if matches!(result, Some(Err(_))) && pages::nothing_good(&self.flash.pages) {
            // The defaults that the first start stores are missing, because the start was interrupted or the flash
            // is worn. Only the remains of an erase or a save exist.
            self.expected.push(Found::damaged());
        }
        match result {
            None | Some(Ok(_)) => {}
            Some(Err(WriteError::Flash(Fault::PowerCut))) => self.power_cycle(),
            // The flash only refuses a half-word whose programming was interrupted. The stored configuration
            // remains.
            Some(Err(WriteError::Flash(Fault::NotErased))) => self.refusals += 1,
            Some(Err(WriteError::Worn)) => assert!(self.flash.worn.is_some(), "not worn"),
        }
    }

    fn save(&mut self, settings: &Settings) {
        self.start();
        let Some(store) = &mut self.store else { return };
        let saved = save(store, &mut self.flash, settings);
        match saved {
            Ok(_) => self.expected = vec![Found::good(settings)],
            // The record already counts when the second seal is worn out.
            Err(_) => self.expected.push(Found::good(settings)),
        }
        self.handle(Some(saved));
    }

    fn record(&mut self, outputs: &Outputs) {
        self.start();
        let Some(store) = &mut self.store else { return };
        let recorded = record(store, &mut self.flash, outputs);
        match recorded {
            Ok(true) => self.outputs = vec![outputs.clone()],
            Ok(false) => {}
            // The record already counts when the second seal is worn out.
            Err(_) => self.outputs.push(outputs.clone()),
        }
        self.handle(Some(recorded));
    }

    /// Checks that the device still works after all events.
    fn must_go_on(&mut self) {
        self.power_cycle();
        self.start();
        if self.flash.worn.is_some() {
            return;
        }
        self.must_save(&random_settings(7, 9));
        self.must_save(&fullest_settings(3));
    }

    /// Checks that a save works immediately and without an erase. Each page may refuse one save, when the
    /// programming of its next half-word was once interrupted; the next save then uses another place.
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
        assert_eq!(
            self.expected,
            [Found::good(settings)],
            "the settings are saved"
        );
        assert!(
            self.flash.erases == erases || self.refusals == refusals + 2,
            "erased while the line was served"
        );
        self.power_cycle();
        self.start();
    }
}

/// Returns what a power cut leaves of the operation.
pub(crate) fn mess(script: &mut Script<'_>) -> Mess {
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
