//! The module in the slot, whichever it is.

use board_support::{Slot, SlotInput, SlotOutput};
use modio_drivers::{
    Absent, CHANNELS, ChannelSettings, Channels, Di4, Do4, IoModule, Kind, ModuleError,
};
use register_map::Module;

/// A module with its slot's lines set up for it.
pub enum Installed {
    None(Absent),
    Di4(Di4<SlotInput>),
    Do4(Do4<SlotOutput>),
}

impl Installed {
    /// Sets the slot up for a module. The flag is false for one that this firmware cannot drive yet:
    /// the slot's lines then stay floating and it has no points.
    pub fn new(module: Module, slot: Slot) -> (Self, bool) {
        match module {
            Module::Di4 => (Self::Di4(Di4::new(slot.into_inputs())), true),
            Module::Do4 => (Self::Do4(Do4::new(slot.into_outputs_low())), true),
            Module::None => (Self::None(Absent), true),
            Module::Relay2 | Module::Ai4 | Module::Ao4 | Module::Ai2Ao2 => {
                (Self::None(Absent), false)
            }
        }
    }

    fn driver(&mut self) -> &mut dyn IoModule {
        match self {
            Self::None(module) => module,
            Self::Di4(module) => module,
            Self::Do4(module) => module,
        }
    }
}

impl IoModule for Installed {
    fn kinds(&self) -> [Kind; CHANNELS] {
        match self {
            Self::None(module) => module.kinds(),
            Self::Di4(module) => module.kinds(),
            Self::Do4(module) => module.kinds(),
        }
    }

    fn configure(&mut self, settings: &[ChannelSettings; CHANNELS]) {
        self.driver().configure(settings);
    }

    fn read_inputs(&mut self, channels: &mut Channels) -> Result<(), ModuleError> {
        self.driver().read_inputs(channels)
    }

    fn drive_outputs(&mut self, channels: &Channels) -> Result<(), ModuleError> {
        self.driver().drive_outputs(channels)
    }
}
