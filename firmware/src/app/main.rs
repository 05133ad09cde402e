//! The device: the tasks and the resources they share.
//!
//! docs/architecture.md has a table of the tasks, with what it costs when one is late.
//!
//! The tasks of priority 4 run from RAM with all that they call (`memory.x`). They continue while flash is erased
//! or programmed; the others wait for up to 40 ms, on clones of the part 400.
//!
//! `serve`, `scan`, `second` and `background` act as software tasks, but each is bound to an interrupt that nothing else
//! uses. docs/decisions.md says why.
//!
//! LINE, SECOND and SERVE are names in the board's row in crate register-map.

#![no_std]
#![no_main]

mod background;
mod board;
mod clock;
mod every;
mod fault_record;
mod installed;
mod keeping;
mod line_setup;
mod log;
mod persistence;
mod rtt;
mod scanning;
mod second;
mod serving;
mod start;
mod trap;
mod updating;
mod upkeep;

#[rtic::app(device = board_support::device, peripherals = true)]
mod app {
    use core::mem::MaybeUninit;

    use board_support::{ScanTimer, SecondUart, Watchdog, boards::SLOTS, device::interrupt, kept};
    use firmware::alive::{self, Task};
    use heapless::spsc::{Consumer, Producer, Queue};
    use modbus_server::Adu;
    use modio_drivers::DacLink;

    use crate::{
        background::Background,
        board::Device,
        clock,
        line_setup::Line,
        log::Event,
        scanning::Scanning,
        second::{Polling, Second, on_interrupt},
        serving::Serving,
        start,
        upkeep::Upkeep,
    };

    #[shared]
    struct Shared {
        /// `None` while SW01 is set to no unit address: the line is not served.
        line: Option<Line>,
        /// `None` while the radio is off, and on a board without a second line.
        second: Option<Second>,
        second_uart: Option<SecondUart>,
        /// Built in place, because it is too large to be moved over the stack.
        device: &'static mut Device,
        /// What the scan and the background task exchange about each slot's DAC.
        dacs: [DacLink; SLOTS],
    }

    #[local]
    struct Local {
        scan_timer: ScanTimer,
        upkeep: Upkeep,
        serving: Serving,
        scanning: Scanning,
        has_second: bool,
        events: Producer<'static, Event>,
        background_work: Background,
        logged: Consumer<'static, Event>,
        watchdog: Watchdog,
    }

    #[init(local = [
        adus: [Adu; 2] = [const { Adu::new() }; 2],
        // No master sends a request while its last one is being served, and the air is half duplex.
        second_adus: [Adu; 1] = [const { Adu::new() }; 1],
        device: MaybeUninit<Device> = MaybeUninit::uninit(),
        queue: Queue<Event, 8> = Queue::new(),
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        let memory = start::Memory {
            device: cx.local.device,
            adus: cx.local.adus,
            second_adus: cx.local.second_adus,
        };
        let mut started = start::up(cx.device, &cx.core.SCB, memory);
        let (events, logged) = cx.local.queue.split();
        started.scan_timer.start();
        started.watchdog.arm();
        let has_second = started.second.is_some();
        let upkeep = Upkeep::new(started.line.is_some(), has_second);
        (
            Shared {
                line: started.line,
                second: started.second,
                second_uart: started.second_uart,
                dacs: started.dacs,
                device: started.device,
            },
            Local {
                has_second,
                scan_timer: started.scan_timer,
                upkeep,
                serving: started.serving,
                scanning: started.scanning,
                events,
                background_work: started.background,
                logged,
                watchdog: started.watchdog,
            },
        )
    }

    #[idle(local = [watchdog])]
    fn idle(cx: idle::Context) -> ! {
        loop {
            if alive::take_all(kept::marks()) {
                cx.local.watchdog.refresh();
            }
            rtic::export::wfi();
        }
    }

    #[task(binds = LINE, priority = 4, shared = [line])]
    fn uart(mut cx: uart::Context) {
        alive::begin(kept::marks(), Task::Uart);
        let waits = cx.shared.line.lock(|line| {
            line.as_mut()
                .is_some_and(|line| line.on_uart(clock::millis))
        });
        if waits {
            // Also after a reply, because a command may have waited for its end.
            rtic::pend(interrupt::SERVE);
        }
    }

    #[task(binds = TIM2, priority = 4, shared = [line])]
    fn gap(mut cx: gap::Context) {
        alive::begin(kept::marks(), Task::Gap);
        let waits = cx.shared.line.lock(|line| {
            line.as_mut()
                .is_some_and(|line| line.on_gap(clock::millis()))
        });
        if waits {
            rtic::pend(interrupt::SERVE);
        }
    }

    #[task(binds = TIM1_CC, priority = 4, shared = [line])]
    fn alarm(mut cx: alarm::Context) {
        alive::begin(kept::marks(), Task::Alarm);
        cx.shared
            .line
            .lock(|line| line.as_mut().map(Line::on_alarm));
    }

    #[task(binds = TIM4, priority = 4, local = [scan_timer, upkeep], shared = [line, second_uart])]
    fn beat(mut cx: beat::Context) {
        if cx.local.upkeep.helps() {
            alive::begin(kept::marks(), Task::Beat);
        }
        cx.local.scan_timer.take_beat();
        clock::advance();
        let (upkeep, scan_timer) = (cx.local.upkeep, cx.local.scan_timer);
        let second = cx.shared.line.lock(|line| upkeep.run(line, scan_timer));
        if second {
            cx.shared
                .second_uart
                .lock(|uart| uart.as_mut().map(SecondUart::set_up));
        }
        rtic::pend(interrupt::EXTI1);
    }

    #[task(binds = SECOND, priority = 4, shared = [second_uart])]
    fn second_uart(mut cx: second_uart::Context) {
        alive::begin(kept::marks(), Task::SecondUart);
        cx.shared
            .second_uart
            .lock(|uart| uart.as_mut().map(on_interrupt));
    }

    #[task(
        binds = SERVE,
        priority = 3,
        local = [serving],
        shared = [line, second, device],
    )]
    fn serve(cx: serve::Context) {
        alive::begin(kept::marks(), Task::Serve);
        let mut shared = cx.shared;
        cx.local
            .serving
            .run(&mut shared.line, &mut shared.second, &mut shared.device);
        alive::end(kept::marks(), Task::Serve);
    }

    #[task(binds = EXTI1, priority = 2, local = [scanning, has_second, events], shared = [device, dacs])]
    fn scan(cx: scan::Context) {
        alive::begin(kept::marks(), Task::Scan);
        alive::end_interrupts(kept::marks());
        let mut shared = cx.shared;
        let beat = cx
            .local
            .scanning
            .run(&mut shared.device, &mut shared.dacs, cx.local.events);
        alive::end(kept::marks(), Task::Scan);
        if beat && *cx.local.has_second {
            rtic::pend(interrupt::EXTI4);
        }
    }

    #[task(binds = EXTI4, priority = 2, local = [polling: Polling = Polling::new()], shared = [second, device])]
    fn second(cx: second::Context) {
        alive::begin(kept::marks(), Task::Second);
        let mut shared = cx.shared;
        let waits = cx.local.polling.run(&mut shared.second, &mut shared.device);
        if waits {
            rtic::pend(interrupt::SERVE);
        }
        alive::end(kept::marks(), Task::Second);
    }

    #[task(binds = EXTI0, priority = 1, local = [background_work, logged], shared = [device, dacs])]
    fn background(cx: background::Context) {
        alive::begin(kept::marks(), Task::Background);
        let mut shared = cx.shared;
        cx.local
            .background_work
            .run(&mut shared.device, &mut shared.dacs, cx.local.logged);
        alive::end(kept::marks(), Task::Background);
    }
}
