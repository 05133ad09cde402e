//! The module in the slot, whichever it is.

use board_support::{AnalogLines, DacBus, Slot, SlotInput, SlotOutput};
use modio_drivers::{
    Absent, Ai2Ao2, Ai4, Ao4, CHANNELS, ChannelSettings, Channels, DacError, DacLink, DacWorker,
    Di4, Do4, IoModule, Kind, ModuleError, Relay2,
};
use register_map::Module;

use crate::converter::Converter;

/// Between the scan, which commands analog outputs, and the background, which brings them to the DAC.
static DAC_LINK: DacLink = DacLink::new();

/// A module with its slot's lines set up for it.
pub enum Installed {
    None(Absent),
    Di4(Di4<SlotInput>),
    Do4(Do4<SlotOutput>),
    Relay2(Relay2<SlotInput, SlotOutput>),
    Ai4(Ai4<Converter>),
    Ao4(Ao4<'static>),
    Ai2Ao2(Ai2Ao2<'static, Converter>),
}

impl Installed {
    /// Sets the slot up for a module.
    pub fn new(module: Module, slot: Slot) -> Self {
        match module {
            Module::None => Self::None(Absent),
            Module::Di4 => Self::Di4(Di4::new(slot.into_inputs())),
            Module::Do4 => Self::Do4(Do4::new(slot.into_outputs_low())),
            Module::Relay2 => {
                let (jumpers, coils) = slot.into_relay();
                Self::Relay2(Relay2::new(jumpers, coils))
            }
            Module::Ai4 => Self::Ai4(Ai4::new(Converter(slot.into_analog(AnalogLines::Four)))),
            Module::Ao4 => Self::Ao4(Ao4::new(&DAC_LINK)),
            Module::Ai2Ao2 => {
                let inputs = Converter(slot.into_analog(AnalogLines::Two));
                Self::Ai2Ao2(Ai2Ao2::new(inputs, &DAC_LINK))
            }
        }
    }

    fn driver(&self) -> &dyn IoModule {
        match self {
            Self::None(module) => module,
            Self::Di4(module) => module,
            Self::Do4(module) => module,
            Self::Relay2(module) => module,
            Self::Ai4(module) => module,
            Self::Ao4(module) => module,
            Self::Ai2Ao2(module) => module,
        }
    }

    fn driver_mut(&mut self) -> &mut dyn IoModule {
        match self {
            Self::None(module) => module,
            Self::Di4(module) => module,
            Self::Do4(module) => module,
            Self::Relay2(module) => module,
            Self::Ai4(module) => module,
            Self::Ao4(module) => module,
            Self::Ai2Ao2(module) => module,
        }
    }
}

impl IoModule for Installed {
    fn kinds(&self) -> [Kind; CHANNELS] {
        self.driver().kinds()
    }

    fn configure(&mut self, settings: &[ChannelSettings; CHANNELS]) {
        self.driver_mut().configure(settings);
    }

    fn read_inputs(&mut self, channels: &mut Channels) -> Result<(), ModuleError> {
        self.driver_mut().read_inputs(channels)
    }

    fn drive_outputs(&mut self, channels: &Channels) -> Result<(), ModuleError> {
        self.driver_mut().drive_outputs(channels)
    }
}

/// The slow side of a module with analog outputs.
pub struct AnalogOutputs(DacWorker<DacBus>);

impl AnalogOutputs {
    /// The DAC of this module, if it has one.
    pub fn of(module: Module, bus: DacBus) -> Option<Self> {
        match module {
            Module::Ao4 | Module::Ai2Ao2 => Some(Self(DacWorker::new(bus))),
            Module::None | Module::Di4 | Module::Do4 | Module::Relay2 | Module::Ai4 => None,
        }
    }

    /// Brings to the DAC what is to be brought.
    pub fn work(&mut self) {
        match self.0.work(&DAC_LINK) {
            Ok(_) => {}
            // The bus frees itself before its next transfer.
            Err(DacError::NotAnswering(_) | DacError::Bus(_)) => {}
        }
    }
}
