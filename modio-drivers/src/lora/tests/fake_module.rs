//! A module as its manual describes it, and the radio with it.

extern crate std;
use core::convert::Infallible;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::vec::Vec;

use embedded_hal::digital;
use embedded_hal_nb::serial::ErrorKind;

use super::super::*;

/// A module as its manual describes it, as far as the driver meets it.
pub(super) struct Module {
    pub(super) parameters: [u8; 5],
    pub(super) mode: [bool; 2],
    /// Time until AUX is high, in ms.
    pub(super) busy: u32,
    /// Time for which AUX is low after a change of the mode, in ms.
    pub(super) change: u32,
    pub(super) command: Vec<u8>,
    pub(super) output: VecDeque<Result<u8, ErrorKind>>,
    pub(super) commands: Vec<Vec<u8>>,
    /// Reply to C0, without the parameters.
    pub(super) acknowledge: &'static [u8],
    pub(super) answers: bool,
    /// Bits that the module does not keep.
    pub(super) lost: u8,
    /// The module is there. Otherwise AUX has the level of the pull.
    pub(super) fitted: bool,
    pub(super) pull: bool,
}

#[derive(Clone)]
pub(super) struct Shared(pub(super) Rc<RefCell<Module>>);

impl Module {
    pub(super) fn receive(&mut self, byte: u8) {
        self.command.push(byte);
        let parameters = match *self.command {
            [STORE, a, b, c, d, e] => Some([a, b, c, d, e]),
            [0xC1, 0xC1, 0xC1] => None,
            _ => return,
        };
        self.commands.push(core::mem::take(&mut self.command));
        if !self.fitted || !self.answers || self.mode != [true; 2] {
            return;
        }
        if let Some(parameters) = parameters {
            self.parameters = parameters.map(|byte| byte & !self.lost);
            self.busy = 30;
            self.output
                .extend(self.acknowledge.iter().map(|byte| Ok(*byte)));
        } else {
            self.output.push_back(Ok(STORE));
            self.output
                .extend(self.parameters.iter().map(|byte| Ok(*byte)));
        }
    }
}

impl ErrorType for Shared {
    type Error = ErrorKind;
}

impl Read<u8> for Shared {
    fn read(&mut self) -> nb::Result<u8, ErrorKind> {
        match self.0.borrow_mut().output.pop_front() {
            Some(byte) => byte.map_err(nb::Error::Other),
            None => Err(nb::Error::WouldBlock),
        }
    }
}

impl Write<u8> for Shared {
    fn write(&mut self, byte: u8) -> nb::Result<(), ErrorKind> {
        self.0.borrow_mut().receive(byte);
        Ok(())
    }

    fn flush(&mut self) -> nb::Result<(), ErrorKind> {
        Ok(())
    }
}

pub(super) struct ModePin(pub(super) Shared, pub(super) usize);

impl digital::ErrorType for ModePin {
    type Error = Infallible;
}

impl OutputPin for ModePin {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.set_state(PinState::Low)
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.set_state(PinState::High)
    }

    fn set_state(&mut self, state: PinState) -> Result<(), Infallible> {
        let mut module = self.0.0.borrow_mut();
        assert_eq!(
            module.busy, 0,
            "the mode is changed while the module is free"
        );
        module.mode[self.1] = state == PinState::High;
        if self.1 == 1 {
            module.busy = module.change;
        }
        Ok(())
    }
}

pub(super) struct Aux(pub(super) Shared);

impl digital::ErrorType for Aux {
    type Error = Infallible;
}

impl InputPin for Aux {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        let module = self.0.0.borrow();
        Ok(if module.fitted {
            module.busy == 0
        } else {
            module.pull
        })
    }

    fn is_low(&mut self) -> Result<bool, Infallible> {
        self.is_high().map(|high| !high)
    }
}

impl OutputPin for Aux {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.0.borrow_mut().pull = false;
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.0.borrow_mut().pull = true;
        Ok(())
    }
}

pub(super) type Radio = Lora<Shared, ModePin, Aux>;

pub(super) const SETTINGS: LoraSettings = match LoraSettings::new(7, 23, 2, 3) {
    Some(settings) => settings,
    None => unreachable!(),
};

/// Longest time for which the module may be busy in service, in ms.
pub(super) const BUSY_MS: u16 = 9 * 600 + START_MS;

/// A radio with a module in its factory state, which starts for 100 ms.
pub(super) fn radio() -> (Shared, Radio) {
    let module = Shared(Rc::new(RefCell::new(Module {
        parameters: [0x00, 0x00, 0x1A, 0x17, 0x44],
        mode: [true; 2],
        busy: 100,
        change: 20,
        command: Vec::new(),
        output: VecDeque::new(),
        commands: Vec::new(),
        acknowledge: &[STORE, 0x00, 0x07, 0x1A, 0x17, 0x47],
        answers: true,
        lost: 0,
        fitted: true,
        pull: true,
    })));
    let pins = [0, 1].map(|pin| ModePin(module.clone(), pin));
    let lora = Lora::new(module.clone(), pins, Aux(module.clone()), SETTINGS, 0);
    (module, lora)
}

/// Lets a millisecond pass.
pub(super) fn pass(module: &Shared, lora: &mut Radio) {
    {
        let mut module = module.0.borrow_mut();
        module.busy = module.busy.saturating_sub(1);
    }
    lora.poll(1);
}

/// Lets time pass, a millisecond for each call of `poll`, until the radio is ready or has failed. Returns the time.
pub(super) fn run(module: &Shared, lora: &mut Radio) -> u32 {
    for ms in 1..100_000 {
        pass(module, lora);
        if lora.is_ready() || lora.has_failed() {
            return ms;
        }
    }
    panic!("the set-up does not end");
}

pub(super) fn commands(module: &Shared) -> Vec<Vec<u8>> {
    core::mem::take(&mut module.0.borrow_mut().commands)
}
