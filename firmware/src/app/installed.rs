//! The modules installed in the slots.

use core::array;

use board_support::{
    DacBus, IoPin, OwnDac, Sampler,
    boards::{BOARD, PortKind, SLOTS, SlotPins},
    fitted::{self, Fitted},
};
use modio_drivers::{
    Absent, Ai2Ao2, Ai4, Ao4, Code, DacLink, DacWorker, Di4, Do4, IoModule, Relay2,
};
use register_map::Module;
use rtic::Mutex;

/// A module and the lines of its slot, configured for it.
pub enum Installed {
    None(Absent),
    Di4(Di4<IoPin>),
    Do4(Do4<IoPin>),
    Relay2(Relay2<IoPin, IoPin>, Proof),
    Ai4(Ai4, AnalogProof),
    Ao4(Ao4, AnalogProof),
    Ai2Ao2(Ai2Ao2, AnalogProof),
}

/// Proof that the board has slots. Other boards do not have this module.
type Proof = <fitted::Slots as Fitted>::Proof;
/// Proof that the board has analog inputs or outputs.
type AnalogProof = <fitted::Analog as Fitted>::Proof;

impl Installed {
    /// Configures the slot for a module. `analog` is for the slot's inputs of the ADC.
    fn new(module: Module, slot: &SlotPins, analog: &mut [Option<u8>; 4]) -> Self {
        let module = match slot.kind {
            _ if BOARD.has_slots() => module,
            PortKind::Slot { .. } => module,
            PortKind::AnalogInputs(_) => Module::Ai4,
            PortKind::AnalogOutputs(_) => Module::Ao4,
            PortKind::Analog(_) if module == Module::Ai2Ao2 => Module::Ai2Ao2,
            PortKind::Analog(_) => Module::Ai4,
            PortKind::Inputs => Module::Di4,
            PortKind::Outputs => Module::Do4,
        };
        match (module, fitted::Slots::proof(), fitted::Analog::proof()) {
            (Module::Di4, ..) => Self::Di4(Di4::new(slot.digital(4))),
            (Module::Do4, ..) => Self::Do4(Do4::new(slot.digital(0))),
            (Module::Relay2, Some(proof), _) => {
                let [jumper1, jumper2, coil1, coil2] = slot.digital(2);
                Self::Relay2(Relay2::new([jumper1, jumper2], [coil1, coil2]), proof)
            }
            (Module::Ai4, _, Some(proof)) => {
                *analog = slot.analog(4);
                Self::Ai4(Ai4::default(), proof)
            }
            (Module::Ao4, _, Some(proof)) => Self::Ao4(Ao4::default(), proof),
            (Module::Ai2Ao2, _, Some(proof)) => {
                *analog = slot.analog(2);
                Self::Ai2Ao2(Ai2Ao2::default(), proof)
            }
            (Module::None | Module::Relay2 | Module::Ai4 | Module::Ao4 | Module::Ai2Ao2, ..) => {
                Self::None(Absent)
            }
        }
    }

    /// Returns the driver of the module.
    pub fn driver(&mut self) -> &mut dyn IoModule {
        match self {
            Self::None(module) => module,
            Self::Di4(module) => module,
            Self::Do4(module) => module,
            Self::Relay2(module, _) => module,
            Self::Ai4(module, _) => module,
            Self::Ao4(module, _) => module,
            Self::Ai2Ao2(module, _) => module,
        }
    }
}

/// The DACs of the slots, which the background task serves.
pub struct AnalogOutputs {
    bus: DacBus,
    own: Option<OwnDac>,
    /// One for each slot. Without codes from a module, it does not use the bus.
    workers: [DacWorker; SLOTS],
}

impl AnalogOutputs {
    /// Sends pending output values to the DACs.
    pub fn work(&mut self, dacs: &mut impl Mutex<T = [DacLink; SLOTS]>) {
        if let Some(own) = &mut self.own {
            for (slot, link) in dacs.lock(|dacs| *dacs).iter().enumerate() {
                if let Some(codes) = link.wanted {
                    own.write(slot, codes.map(Code::get));
                }
            }
        }
        if fitted::Slots::proof().is_none() {
            return;
        }
        let links = dacs.lock(|dacs| *dacs);
        for (worker, link) in self.workers.iter_mut().zip(links) {
            // After an error the bus is recovered before its next transfer.
            let _ = worker.work(&mut self.bus, link.wanted);
        }
        dacs.lock(|dacs| {
            for (dac, worker) in dacs.iter_mut().zip(&self.workers) {
                dac.failed = worker.failed();
            }
        });
    }
}

/// Configures every slot for its module.
pub fn install(
    modules: &[Module],
    sampler: &mut Sampler,
    bus: DacBus,
    own: Option<OwnDac>,
) -> ([Installed; SLOTS], AnalogOutputs) {
    let workers = array::from_fn(|index| match BOARD.slots[index].kind {
        PortKind::Slot { dac_address } => DacWorker::new(dac_address),
        _ => DacWorker::new(0),
    });
    let installed = array::from_fn(|index| {
        Installed::new(
            modules.get(index).copied().unwrap_or(Module::None),
            &BOARD.slots[index],
            &mut sampler.inputs[index],
        )
    });
    (installed, AnalogOutputs { bus, own, workers })
}
