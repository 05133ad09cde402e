//! A scan: inputs into the device, outputs out of it, its time-outs.

use board_support::{Sampler, boards::SLOTS, fault, pac::Interrupt};
use firmware::{device::IoPort, lamps::TICK_MS};
use heapless::spsc::Producer;
use modio_drivers::{IoModule, ModuleError};
use rtic::Mutex;

use crate::{
    board::{BOARD, Device},
    clock,
    every::Every,
    installed::Installed,
    line::Line,
    log::Event,
};

/// Scans between two beats of the background, and between two proofs of life.
const SCANS_PER_BACKGROUND: u8 = TICK_MS as u8;
const SCANS_PER_PROOF: u8 = 100;

/// The modules, and what their scans are about.
pub struct Scanning {
    modules: [Installed; SLOTS],
    /// Of the settings that the modules were configured with.
    revision: u16,
    sampler: Sampler,
    background_beat: Every,
    proof_beat: Every,
}

impl Scanning {
    /// Configures the modules and drives their outputs for the first time. The sampler serves their analog lines.
    pub fn new(mut modules: [Installed; SLOTS], sampler: Sampler, device: &Device) -> Self {
        let ports = device.points.ports();
        for (module, port) in modules.iter_mut().zip(ports) {
            module.configure(port.settings());
            // A module that cannot be driven is told by the first scan.
            let _ = module.drive_outputs(port.channels());
        }
        Self {
            modules,
            revision: device.config.revision(),
            sampler,
            background_beat: Every::new(SCANS_PER_BACKGROUND),
            proof_beat: Every::new(SCANS_PER_PROOF),
        }
    }

    /// One scan. Whether it is that of a beat, and not only of a write.
    pub fn run(
        &mut self,
        line: &mut impl Mutex<T = Option<Line>>,
        device: &mut impl Mutex<T = &'static mut Device>,
        events: &mut Producer<'static, Event>,
    ) -> bool {
        let now = clock::millis();
        // Filled where they stand: a lock that returns them copies them once more, in every scan.
        let mut settings = None;
        let (mut channels, revision, uptime_s, beat, tripped) = device.lock(|device| {
            let passed = now.wrapping_sub(device.state.millis());
            let beat = passed > 0;
            let tripped = beat && device.tick(passed);
            let ports = device.points.ports().each_ref();
            let channels = ports.map(|port| *port.channels());
            // Together with the words, which are in the units that these settings say.
            let revision = device.config.revision();
            if revision != self.revision {
                settings = Some(ports.map(|port| *port.settings()));
            }
            (channels, revision, device.state.uptime_s(), beat, tripped)
        });
        self.revision = revision;
        if let Some(settings) = settings {
            for (module, settings) in self.modules.iter_mut().zip(&settings) {
                module.configure(settings);
            }
        }

        let mut results = [Ok(()); SLOTS];
        let modules = self.modules.iter_mut().zip(&channels);
        for ((module, channels), result) in modules.zip(&mut results) {
            *result = module.drive_outputs(channels);
        }
        if beat {
            self.sampler.run();
            let modules = self.modules.iter_mut().zip(&mut channels);
            for ((module, channels), result) in modules.zip(&mut results) {
                *result = ModuleError::in_either(*result, module.read_inputs(channels));
            }
        }
        let changed = device.lock(|device| {
            let words = self.revision == device.config.revision();
            let mut changed = [false; SLOTS];
            let ports = device.points.ports_mut().iter_mut().zip(&mut changed);
            for ((port, changed), (channels, result)) in ports.zip(channels.iter().zip(&results)) {
                if beat {
                    port.scanned(channels, words);
                }
                *changed = take_failures(port, *result, beat);
            }
            changed
        });

        for ((port, changed), result) in BOARD.ports().zip(changed).zip(results) {
            if changed {
                tell(
                    events,
                    match result {
                        Ok(()) => Event::ModuleGood(port),
                        Err(error) => Event::ModuleFails(port, error),
                    },
                );
            }
        }
        if tripped {
            tell(events, Event::CommunicationLost);
        }
        if beat {
            fault::keep_uptime(uptime_s);
            self.look_at_line(line, device, events);
        }
        // At once when outputs may have changed: they may be the DAC's.
        if self.background_beat.is_due() || !beat || tripped {
            rtic::pend(Interrupt::EXTI0);
        }
        beat
    }

    fn look_at_line(
        &mut self,
        line: &mut impl Mutex<T = Option<Line>>,
        device: &mut impl Mutex<T = &'static mut Device>,
        events: &mut Producer<'static, Event>,
    ) {
        let repaired = line.lock(|line| line.as_mut().is_some_and(Line::take_repaired));
        if repaired {
            device.lock(|device| {
                let repairs = &mut device.state.line_repairs;
                *repairs = repairs.saturating_add(1);
            });
            tell(events, Event::LineRepaired);
        }
        if self.proof_beat.is_due() {
            // A silent line gives these two no reason to run. Called for nothing they do
            // nothing, but show that they could.
            rtic::pend(Interrupt::USART1);
            rtic::pend(Interrupt::EXTI3);
        }
    }
}

/// Takes note of the channels that failed. Whether others did before.
fn take_failures(port: &mut IoPort, result: Result<(), ModuleError>, beat: bool) -> bool {
    let before = port.failing();
    let failed = result.map_or_else(ModuleError::channels, |()| 0);
    // Only a whole scan shows that all is well.
    let now = if beat { failed } else { failed | before };
    port.set_failing(now);
    now != before
}

fn tell(events: &mut Producer<'static, Event>, event: Event) {
    // A full queue loses a log line, no more.
    let _ = events.enqueue(event);
}
