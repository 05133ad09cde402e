//! The Modbus TCP gateway and the capture file. Both are attached to the line, besides the endpoints for bytes.

use std::sync::mpsc::Sender;

use sim::options::Options;

use super::Event;
use super::capture::Capture;
use super::gateway::Gateway;
use super::scene::Scene;

/// The gateway and the capture file, each if an option asks for it.
pub struct Attached {
    /// `--modbus-tcp`.
    pub gateway: Option<Gateway>,
    /// `--record`.
    capture: Option<Capture>,
}

impl Attached {
    /// Attaches what the options name.
    ///
    /// # Errors
    ///
    /// In one line: the simulator cannot listen at an address, or cannot write a file.
    pub fn new(options: &Options, events: Sender<Event>) -> Result<Self, String> {
        Ok(Self {
            gateway: options
                .modbus_tcp
                .map(|address| Gateway::listen(address, events))
                .transpose()?,
            capture: options.record.as_deref().map(Capture::create).transpose()?,
        })
    }

    /// Passes new frames on to both. `halted` says that a debugger has halted the core, so that time stands still.
    pub fn update(&mut self, scene: &mut Scene, halted: bool) {
        if let Some(capture) = &mut self.capture {
            capture.update(scene.bus.line());
            if capture.failed() {
                self.capture = None;
            }
        }
        if let Some(gateway) = &mut self.gateway {
            gateway.update(scene, halted);
        }
    }
}
