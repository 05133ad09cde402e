//! A scan: inputs into the device, outputs out of it, its time-outs.

use board_support::{fault, pac::Interrupt};
use firmware::{device::Device, lamps::TICK_MS};
use heapless::spsc::Producer;
use modio_drivers::{ChannelSettings, IoModule, ModuleError};
use rtic::Mutex;

use crate::{clock, every::Every, installed::Installed, line::Line, log::Event};

/// Scans between two beats of the background, and between two proofs of life.
const SCANS_PER_BACKGROUND: u8 = TICK_MS as u8;
const SCANS_PER_PROOF: u8 = 100;

/// The module, and what its scans are about.
pub struct Scanning {
    module: Installed,
    settings: [ChannelSettings; 4],
    background_beat: Every,
    proof_beat: Every,
}

impl Scanning {
    /// The module has been configured with these settings.
    pub const fn new(module: Installed, settings: [ChannelSettings; 4]) -> Self {
        Self {
            module,
            settings,
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
        let (mut channels, wanted, uptime_s, beat, tripped) = device.lock(|device| {
            let passed = now.wrapping_sub(device.state.millis());
            let tripped = passed > 0 && device.tick(passed);
            let wanted = *device.points.settings();
            let uptime_s = device.state.uptime_s();
            (
                *device.points.channels(),
                wanted,
                uptime_s,
                passed > 0,
                tripped,
            )
        });
        if self.settings != wanted {
            self.settings = wanted;
            self.module.configure(&self.settings);
        }
        let mut result = self.module.drive_outputs(&channels);
        if beat {
            result = ModuleError::in_either(result, self.module.read_inputs(&mut channels));
        }
        let changed = device.lock(|device| {
            if beat {
                device.points.scanned(&channels, &self.settings);
            }
            let was_failing = device.points.failing();
            let failed = result.map_or_else(ModuleError::channels, |()| 0);
            // Only a whole scan shows that all is well.
            let is_failing = if beat { failed } else { failed | was_failing };
            device.points.set_failing(is_failing);
            is_failing != was_failing
        });

        if changed {
            tell(
                events,
                match result {
                    Ok(()) => Event::ModuleGood,
                    Err(error) => Event::ModuleFails(error),
                },
            );
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

fn tell(events: &mut Producer<'static, Event>, event: Event) {
    // A full queue loses a log line, no more.
    let _ = events.enqueue(event);
}
