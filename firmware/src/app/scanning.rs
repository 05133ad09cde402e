//! A scan: copies inputs into the device and outputs to the modules, and runs the time-outs.

use board_support::{Sampler, boards::SLOTS, device::interrupt, kept};
use firmware::{alive, device::IoPort, leds::TICK_MS};
use heapless::spsc::Producer;
use modio_drivers::{CHANNELS, Channels, DacLink, ModuleError};
use rtic::Mutex;

use crate::{
    board::{B, BOARD, Device},
    clock,
    every::Every,
    installed::Installed,
    keeping::Kept,
    log::Event,
    upkeep,
};

/// Scans per run of the background task, and scans per check that every other task still runs.
const SCANS_PER_BACKGROUND: u8 = TICK_MS as u8;
const SCANS_PER_PROOF: u8 = 16;
/// The modules and the state of their scans.
pub struct Scanning {
    modules: [Installed; SLOTS],
    /// Revision of the settings that the modules were configured with.
    revision: u16,
    sampler: Sampler,
    /// Seconds from power-on to the start.
    powered_s: u32,
    /// What a reset keeps of the outputs.
    kept: Kept,
    background_beat: Every,
    proof_beat: Every,
    /// The task that was asked for its mark last.
    asked: usize,
}

impl Scanning {
    /// Configures the modules and drives their outputs for the first time. The sampler samples their analog lines.
    pub fn new(
        mut modules: [Installed; SLOTS],
        sampler: Sampler,
        device: &mut Device,
        dacs: &mut [DacLink; SLOTS],
        powered_s: u32,
    ) -> Self {
        for (slot, (module, dac)) in modules.iter_mut().zip(dacs.iter_mut()).enumerate() {
            let channels = driven(device, slot, 0);
            if let Some(port) = device.points.ports().get(slot) {
                module.driver().configure(port.settings());
                // If a module cannot be driven, the first scan reports it.
                let _ = module.driver().drive_outputs(&channels, dac);
            }
        }
        let kept = Kept::begin(device, dacs);
        Self {
            kept,
            modules,
            revision: device.config.revision(),
            sampler,
            powered_s,
            background_beat: Every::new(SCANS_PER_BACKGROUND),
            proof_beat: Every::new(SCANS_PER_PROOF),
            asked: 0,
        }
    }

    /// Runs one scan. Returns whether the clock has advanced since the last scan. A write causes a scan without
    /// that.
    pub fn run(
        &mut self,
        device: &mut impl Mutex<T = &'static mut Device>,
        dacs: &mut impl Mutex<T = [DacLink; SLOTS]>,
        events: &mut Producer<'static, Event>,
    ) -> bool {
        let now = clock::millis();
        let (passed, tripped) = device.lock(|device| {
            let passed = now.wrapping_sub(device.state.millis());
            (passed, passed > 0 && device.tick(passed))
        });
        let beat = passed > 0;
        if beat && BOARD.has_links() {
            // Under a lock for each slot, because requests wait for it.
            (0..SLOTS).for_each(|slot| device.lock(|device| device.run_links(slot)));
        }
        let mut channels = [Channels::new(); SLOTS];
        let mut coils = [0; SLOTS];
        let (uptime_s, held) = device.lock(|device| {
            // Under the same lock as the words, because the settings define the units of the words.
            let revision = device.config.revision();
            if self.revision != revision {
                self.revision = revision;
                for (module, port) in self.modules.iter_mut().zip(device.points.ports()) {
                    module.driver().configure(port.settings());
                }
            }
            for (slot, channels) in channels.iter_mut().enumerate() {
                *channels = driven(device, slot, passed);
            }
            for (coils, port) in coils.iter_mut().zip(device.points.ports()) {
                *coils = port.channels().bits() & !port.pulsing();
            }
            let held = [device.held_outputs(), device.outputs_at_safe()];
            (device.state.uptime_s(), held)
        });

        let mut results = [Ok(()); SLOTS];
        let modules = self.modules.iter_mut().zip(&channels);
        dacs.lock(|dacs| {
            for (((module, channels), result), dac) in
                modules.zip(&mut results).zip(dacs.iter_mut())
            {
                *result = module.driver().drive_outputs(channels, dac);
            }
            if BOARD.has_links() {
                self.kept.keep(&coils, dacs, held);
            }
        });
        let mut codes = [[None; CHANNELS]; SLOTS];
        if beat {
            codes = self.sampler.run();
            let modules = self.modules.iter_mut().zip(&mut channels).zip(&codes);
            for (((module, channels), codes), result) in modules.zip(&mut results) {
                *result =
                    ModuleError::in_either(*result, module.driver().read_inputs(channels, codes));
            }
        }
        device.lock(|device| {
            let words = self.revision == device.config.revision();
            let scanned = channels.iter().zip(&codes).zip(results);
            for (slot, ((channels, codes), result)) in scanned.enumerate() {
                let Some(port) = device.points.ports_mut().get_mut(slot) else {
                    continue;
                };
                let changed = take_failures(port, result, beat);
                if beat {
                    device.scanned(slot, channels, codes, words, passed);
                    if let Some(port) = device.points.ports().get(slot) {
                        kept::keep_pulses(slot, port.pulses());
                    }
                }
                if changed {
                    let number = BOARD.first_port + slot as u16;
                    let event = match result {
                        Ok(()) => Event::ModuleGood(number),
                        Err(error) => Event::ModuleFails(number, error),
                    };
                    enqueue(events, event);
                }
            }
        });
        if tripped {
            enqueue(events, Event::CommunicationLost);
        }
        if beat {
            kept::keep_uptime(self.powered_s.wrapping_add(uptime_s));
            self.look_after_tasks(device, events);
        }
        // Run the background immediately when outputs may have changed: they may be those of a DAC.
        if self.background_beat.is_due() || !beat || tripped {
            rtic::pend(interrupt::EXTI0);
        }
        beat
    }

    /// Reports repairs, and asks every other task for its mark.
    fn look_after_tasks(
        &mut self,
        device: &mut impl Mutex<T = &'static mut Device>,
        events: &mut Producer<'static, Event>,
    ) {
        if upkeep::take_repaired() {
            device.lock(|device| {
                let repairs = &mut device.state.line_repairs;
                *repairs = repairs.saturating_add(1);
            });
            enqueue(events, Event::LineRepaired);
        }
        if self.proof_beat.is_due() {
            // On a silent line nothing triggers these tasks. Without a cause they only set their marks. One after
            // another, because a byte waits for all interrupts that are pended together.
            let mut tasks = [
                interrupt::LINE,
                interrupt::TIM2,
                interrupt::TIM1_CC,
                interrupt::SECOND,
                interrupt::SERVE,
                interrupt::EXTI4,
            ]
            .into_iter();
            self.asked = (self.asked + 1) % tasks.len();
            if let Some(task) = tasks.nth(self.asked) {
                rtic::pend(task);
            }
            // An interrupt has run by now.
            alive::end_interrupts(kept::marks());
        }
    }
}

/// Returns the channels of a slot to drive, `ms` milliseconds after the last scan.
#[inline(always)]
fn driven(device: &mut Device, slot: usize, ms: u32) -> Channels {
    let bits = device.drive(slot, ms);
    let mut channels = Channels::new();
    if let Some(port) = device.points.ports().get(slot) {
        channels = *port.channels();
        channels.set_bits(u8::MAX, bits);
    }
    channels
}

/// Stores which channels failed. Returns whether that differs from before.
fn take_failures(port: &mut IoPort<B>, result: Result<(), ModuleError>, beat: bool) -> bool {
    let before = port.failing();
    let failed = result.map_or_else(ModuleError::channels, |()| 0);
    // Only a scan that also reads the inputs can show that a channel works again.
    let now = if beat { failed } else { failed | before };
    port.set_failing(now);
    now != before
}

fn enqueue(events: &mut Producer<'static, Event>, event: Event) {
    // When the queue is full, only a log line is lost.
    let _ = events.enqueue(event);
}
