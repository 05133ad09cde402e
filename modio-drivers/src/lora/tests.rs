extern crate std;
use core::convert::Infallible;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::vec::Vec;

use embedded_hal::digital;
use embedded_hal_nb::serial::{self, ErrorKind};

use super::*;

/// A module as its manual describes it, as far as the driver meets it.
struct Module {
    parameters: [u8; 5],
    mode: [bool; 2],
    /// Time until AUX is high, in ms.
    busy: u32,
    /// Time for which AUX is low after a change of the mode, in ms.
    change: u32,
    command: Vec<u8>,
    output: VecDeque<Result<u8, ErrorKind>>,
    commands: Vec<Vec<u8>>,
    /// Reply to C0, without the parameters.
    acknowledge: &'static [u8],
    answers: bool,
    /// Bits that the module does not keep.
    lost: u8,
    /// The module is there. Otherwise AUX has the level of the pull.
    fitted: bool,
    pull: bool,
}

#[derive(Clone)]
struct Shared(Rc<RefCell<Module>>);

impl Module {
    fn receive(&mut self, byte: u8) {
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

struct ModePin(Shared, usize);

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

struct Aux(Shared);

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

impl AuxPin for Aux {
    fn pull(&mut self, level: PinState) {
        self.0.0.borrow_mut().pull = level.into();
    }
}

type Radio = Lora<Shared, ModePin, Aux>;

const SETTINGS: LoraSettings = match LoraSettings::new(7, 23, 2, 3) {
    Some(settings) => settings,
    None => unreachable!(),
};

/// Longest time for which the module may be busy in service, in ms.
const BUSY_MS: u16 = 9 * 600 + START_MS;

/// A radio with a module in its factory state, which starts for 100 ms.
fn radio() -> (Shared, Radio) {
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
fn pass(module: &Shared, lora: &mut Radio) {
    {
        let mut module = module.0.borrow_mut();
        module.busy = module.busy.saturating_sub(1);
    }
    lora.poll(1);
}

/// Lets time pass, a millisecond for each call of `poll`, until the radio is ready or has failed. Returns the time.
fn run(module: &Shared, lora: &mut Radio) -> u32 {
    for ms in 1..100_000 {
        pass(module, lora);
        if lora.is_ready() || lora.has_failed() {
            return ms;
        }
    }
    panic!("the set-up does not end");
}

fn commands(module: &Shared) -> Vec<Vec<u8>> {
    core::mem::take(&mut module.0.borrow_mut().commands)
}

const SET_ALL: &[u8] = &[0xC0, 0x00, 0x07, 0x1A, 0x17, 0x47];

#[test]
fn module_with_other_parameters_gets_them_and_is_checked() {
    let (module, mut lora) = radio();
    run(&module, &mut lora);
    assert!(lora.is_ready());
    assert_eq!(commands(&module), [&READ[..], SET_ALL, &READ[..]]);
    assert_eq!(module.0.borrow().mode, [false; 2], "normal mode");
    assert_eq!(module.0.borrow().parameters, *SETTINGS.parameters());
}

#[test]
fn module_with_the_right_parameters_is_not_written() {
    for head in [STORE, SET] {
        let (module, mut lora) = radio();
        module.0.borrow_mut().parameters = *SETTINGS.parameters();
        module.0.borrow_mut().answers = head == STORE;
        while commands(&module).is_empty() {
            module.0.borrow_mut().busy = 0;
            lora.poll(1);
        }
        if head == SET {
            let reply = core::iter::once(SET).chain(*SETTINGS.parameters());
            module.0.borrow_mut().output.extend(reply.map(Ok));
        }
        run(&module, &mut lora);
        assert!(lora.is_ready());
        assert!(commands(&module).is_empty());
    }
}

#[test]
fn any_reply_to_the_written_parameters_is_accepted() {
    for acknowledge in [&b""[..], b"OK\r\n", &[0xFF; 20]] {
        let (module, mut lora) = radio();
        module.0.borrow_mut().acknowledge = acknowledge;
        run(&module, &mut lora);
        assert!(lora.is_ready(), "{acknowledge:?}");
    }
}

#[test]
fn parameters_that_the_module_does_not_keep_are_a_failure() {
    let (module, mut lora) = radio();
    module.0.borrow_mut().lost = 0x02;
    run(&module, &mut lora);
    assert!(lora.has_failed());
}

#[test]
fn parameters_are_written_three_times_at_most_until_the_radio_is_ready() {
    let (module, mut lora) = radio();
    module.0.borrow_mut().lost = 0x02;
    let run_for = |lora: &mut Radio, ms: u32| {
        for _ in 0..ms {
            pass(&module, lora);
        }
        let commands = commands(&module);
        let stores = commands.iter().filter(|command| command[0] == STORE);
        (stores.count(), commands.len())
    };
    let (stores, asked) = run_for(&mut lora, 100_000);
    assert_eq!(stores, 3);
    assert!(asked > 10, "the module is still asked");
    module.0.borrow_mut().lost = 0;
    module.0.borrow_mut().parameters = *SETTINGS.parameters();
    assert_eq!(run_for(&mut lora, 10_000).0, 0);
    assert!(lora.is_ready());
    // Another module, with other parameters.
    module.0.borrow_mut().parameters[1] = 0;
    module.0.borrow_mut().fitted = false;
    run_for(&mut lora, BUSY_MS.into());
    module.0.borrow_mut().fitted = true;
    assert_eq!(run_for(&mut lora, 10_000).0, 1);
    assert!(lora.is_ready());
}

#[test]
fn module_that_is_removed_in_service_is_a_failure() {
    let (module, mut lora) = radio();
    run(&module, &mut lora);
    assert!(lora.is_ready());
    module.0.borrow_mut().fitted = false;
    for _ in 1..BUSY_MS {
        lora.poll(1);
        assert!(lora.is_ready());
    }
    lora.poll(1);
    // It is asked again and again, and fails again and again.
    for _ in 0..3 {
        assert!(lora.has_failed());
        for _ in 0..RETRY_MS {
            lora.poll(1);
        }
        run(&module, &mut lora);
    }
    module.0.borrow_mut().fitted = true;
    for _ in 0..RETRY_MS {
        lora.poll(1);
    }
    run(&module, &mut lora);
    assert!(lora.is_ready());
}

#[test]
fn module_that_may_still_be_sending_is_left_alone() {
    let (module, _) = radio();
    module.0.borrow_mut().busy = 0;
    let pins = [0, 1].map(|pin| ModePin(module.clone(), pin));
    let mut lora = Lora::new(module.clone(), pins, Aux(module.clone()), SETTINGS, 600);
    // AUX is low until the last of some packets, which then takes another 600 ms.
    module.0.borrow_mut().busy = 4_000;
    for _ in 0..4_000 + 598 {
        pass(&module, &mut lora);
        assert_eq!(lora.step, Step::Starting);
    }
    run(&module, &mut lora);
    assert!(lora.is_ready());
}

#[test]
fn late_call_does_not_count_as_time_for_which_aux_was_high() {
    let (module, mut lora) = radio();
    module.0.borrow_mut().busy = 1;
    lora.poll(1);
    module.0.borrow_mut().busy = 0;
    lora.poll(40);
    assert_eq!(lora.step, Step::Starting);
    lora.poll(SETTLED_MS);
    assert_eq!(lora.step, Step::Sleeping);
}

#[test]
fn silent_module_is_a_failure_and_is_asked_again() {
    let (module, mut lora) = radio();
    module.0.borrow_mut().answers = false;
    let ms = run(&module, &mut lora);
    assert!(lora.has_failed());
    assert!((600..700).contains(&ms), "{ms} ms");
    module.0.borrow_mut().answers = true;
    for _ in 0..RETRY_MS {
        assert!(lora.has_failed());
        lora.poll(1);
    }
    run(&module, &mut lora);
    assert!(lora.is_ready());
}

#[test]
fn module_that_stays_busy_is_a_failure() {
    let (module, mut lora) = radio();
    module.0.borrow_mut().busy = 100_000;
    assert_eq!(run(&module, &mut lora), START_MS.into());
    assert!(lora.has_failed());

    let (module, mut lora) = radio();
    run(&module, &mut lora);
    module.0.borrow_mut().busy = 100_000;
    for _ in 1..BUSY_MS {
        lora.poll(1);
        assert!(lora.is_ready());
    }
    lora.poll(1);
    assert!(lora.has_failed());
}

#[test]
fn busy_module_in_normal_mode_may_be_busy_again_and_again() {
    let (module, mut lora) = radio();
    run(&module, &mut lora);
    for _ in 0..10 {
        module.0.borrow_mut().busy = 1;
        for _ in 1..BUSY_MS {
            lora.poll(1);
        }
        module.0.borrow_mut().busy = 0;
        lora.poll(1);
        assert!(lora.is_ready());
    }
}

#[test]
fn damaged_reply_is_a_failure() {
    let (module, mut lora) = radio();
    module.0.borrow_mut().answers = false;
    while commands(&module).is_empty() {
        module.0.borrow_mut().busy = 0;
        lora.poll(1);
    }
    let reply = [STORE, 0, 7].map(Ok).into_iter();
    let damaged = reply.chain([Err(ErrorKind::FrameFormat)]);
    module.0.borrow_mut().output.extend(damaged);
    run(&module, &mut lora);
    assert!(lora.has_failed());
}

#[test]
fn bytes_received_before_the_radio_is_ready_are_discarded() {
    let (module, mut lora) = radio();
    module.0.borrow_mut().output.extend([Ok(0xC0), Ok(0x55)]);
    run(&module, &mut lora);
    assert!(lora.is_ready());
    assert_eq!(lora.read(), Err(nb::Error::WouldBlock));
    module.0.borrow_mut().output.push_back(Ok(0x11));
    assert_eq!(lora.read(), Ok(0x11));
}

#[test]
fn uart_that_always_reports_an_error_does_not_stop_the_driver() {
    struct Broken;
    impl ErrorType for Broken {
        type Error = ErrorKind;
    }
    impl serial::Read<u8> for Broken {
        fn read(&mut self) -> nb::Result<u8, ErrorKind> {
            Err(nb::Error::Other(ErrorKind::Overrun))
        }
    }
    impl serial::Write<u8> for Broken {
        fn write(&mut self, _: u8) -> nb::Result<(), ErrorKind> {
            Err(nb::Error::Other(ErrorKind::Other))
        }
        fn flush(&mut self) -> nb::Result<(), ErrorKind> {
            Ok(())
        }
    }
    let (module, _) = radio();
    module.0.borrow_mut().busy = 0;
    module.0.borrow_mut().change = 0;
    let pins = [0, 1].map(|pin| ModePin(module.clone(), pin));
    let mut lora = Lora::new(Broken, pins, Aux(module.clone()), SETTINGS, 0);
    for _ in 0..100 {
        lora.poll(1);
    }
    assert!(lora.has_failed());
}
