//! Tests of the radio with a simulated module.

mod fake_module;

use embedded_hal_nb::serial::{self, ErrorKind};

use super::*;
use fake_module::*;

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
