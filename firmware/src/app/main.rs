//! The device: tasks, what they share, and nothing else.
//!
//! | task | bound to | priority | duty, and what an overrun costs |
//! |---|---|---|---|
//! | `beat` | TIM4, 1 kHz | 4 | the device's clock; the line's response delay and its check; sets `scan` off. Late, the clock is late |
//! | `uart` | USART1 | 4 | a byte in or out, driver off at the end. At 921600 bit/s a byte comes every 12 us; later than that and it is lost, which the receiver reports and the frame pays for |
//! | `gap` | TIM2 | 4 | t1.5 and t3.5. Late, it makes the silence longer, never shorter |
//! | `limit` | TIM1_CC | 4 | cuts off a reply that does not end. Late, the driver is on for longer |
//! | `serve` | EXTI3, pended by `gap` and `uart` | 3 | a closed frame becomes a response; an order is carried out when its response is out. Late, the response is late |
//! | `scan` | EXTI1, pended by `beat` and by a write | 2 | inputs into the device, outputs out of it, its time-outs. Late, it makes up for the time |
//! | `background` | EXTI0, pended every 10 ms and on orders | 1 | DAC transfers, configuration store, LEDs, log. May be late at no cost |
//! | `idle` | - | - | feeds the watchdog when all of the above have been alive; sleeps |
//!
//! The tasks of priority 4 run from RAM with all they call (`memory.x`): while flash is erased or programmed they go
//! on, and the others wait, for up to 40 ms.
//!
//! `serve`, `scan` and `background` are software tasks in all but name: each is bound to an interrupt that
//! nothing else uses. Pended while its handler runs, an interrupt comes again, where a second spawn
//! would be refused and the request left lying; and no executor's panic is linked.

#![no_std]
#![no_main]

mod background;
mod board;
mod clock;
mod converter;
mod every;
mod installed;
mod line;
mod log;
mod orders;
mod pages;
mod persistence;
mod rtt;
mod scanning;
mod serving;
mod signals;
mod start;
mod trap;

#[rtic::app(device = board_support::pac, peripherals = true)]
mod app {
    use core::mem::MaybeUninit;

    use board_support::{ScanTimer, Watchdog, fault, pac::Interrupt, stack::LowWater};
    use firmware::alive::{self, Task};
    use heapless::spsc::{Consumer, Producer, Queue};
    use modbus_server::Adu;

    use crate::{
        background::Background, board::Device, clock, line::Line, log::Event, orders::Orders,
        scanning::Scanning, serving::Serving, signals::Signals, start,
    };

    #[shared]
    struct Shared {
        /// `None` while SW01 shows no unit address: the line is not served.
        line: Option<Line>,
        /// Built where it stays: it is too large to be moved over the stack.
        device: &'static mut Device,
        /// A request for this unit has been served since the LEDs were last set.
        activity: bool,
        /// What requests have ordered of the background.
        orders: Orders,
    }

    #[local]
    struct Local {
        scan_timer: ScanTimer,
        serving: Serving,
        scanning: Scanning,
        events: Producer<'static, Event>,
        background_work: Background,
        logged: Consumer<'static, Event>,
        watchdog: Watchdog,
    }

    #[init(local = [
        adus: [Adu; 2] = [const { Adu::new() }; 2],
        device: MaybeUninit<Device> = MaybeUninit::uninit(),
        queue: Queue<Event, 8> = Queue::new(),
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        let mut started = start::up(cx.device, &cx.core.SCB, cx.local.adus, cx.local.device);
        let (events, logged) = cx.local.queue.split();
        started.scan_timer.start();
        started.watchdog.arm();
        (
            Shared {
                line: started.line,
                activity: false,
                orders: Orders::default(),
                device: started.device,
            },
            Local {
                scan_timer: started.scan_timer,
                serving: Serving::new(started.server, started.unit, started.frame_gap_ms),
                scanning: started.scanning,
                events,
                background_work: Background {
                    analog_outputs: started.analog_outputs,
                    persistence: started.persistence,
                    signals: Signals::new(started.leds, started.trouble),
                    log: started.log,
                    stack: LowWater::new(),
                },
                logged,
                watchdog: started.watchdog,
            },
        )
    }

    #[idle(local = [watchdog])]
    fn idle(cx: idle::Context) -> ! {
        loop {
            if alive::take_all(fault::marks()) {
                cx.local.watchdog.feed();
            }
            rtic::export::wfi();
        }
    }

    #[task(binds = USART1, priority = 4, shared = [line])]
    fn uart(mut cx: uart::Context) {
        alive::begin(fault::marks(), Task::Line);
        let sent = cx
            .shared
            .line
            .lock(|line| line.as_mut().is_some_and(Line::on_uart));
        if sent {
            // An order may have waited for this.
            rtic::pend(Interrupt::EXTI3);
        }
    }

    #[task(binds = TIM2, priority = 4, shared = [line])]
    fn gap(mut cx: gap::Context) {
        alive::begin(fault::marks(), Task::Line);
        let waits = cx.shared.line.lock(|line| {
            line.as_mut()
                .is_some_and(|line| line.on_gap(clock::millis()))
        });
        if waits {
            rtic::pend(Interrupt::EXTI3);
        }
    }

    #[task(binds = TIM1_CC, priority = 4, shared = [line])]
    fn limit(mut cx: limit::Context) {
        alive::begin(fault::marks(), Task::Line);
        cx.shared
            .line
            .lock(|line| line.as_mut().map(Line::on_limit));
    }

    #[task(binds = TIM4, priority = 4, local = [scan_timer], shared = [line])]
    fn beat(mut cx: beat::Context) {
        alive::begin(fault::marks(), Task::Line);
        cx.local.scan_timer.take_beat();
        clock::advance();
        cx.shared
            .line
            .lock(|line| line.as_mut().map(Line::on_millisecond));
        rtic::pend(Interrupt::EXTI1);
    }

    #[task(binds = EXTI3, priority = 3, local = [serving], shared = [line, device, activity, orders])]
    fn serve(cx: serve::Context) {
        alive::begin(fault::marks(), Task::Serve);
        let mut shared = cx.shared;
        let served = cx
            .local
            .serving
            .run(&mut shared.line, &mut shared.device, &mut shared.orders);
        if served {
            shared.activity.lock(|activity| *activity = true);
        }
        alive::end(fault::marks(), Task::Serve);
    }

    #[task(binds = EXTI1, priority = 2, local = [scanning, events], shared = [line, device])]
    fn scan(cx: scan::Context) {
        let mark = alive::look(fault::marks(), Task::Scan);
        alive::begin(fault::marks(), Task::Scan);
        alive::end_line(fault::marks());
        let mut shared = cx.shared;
        let beat = cx
            .local
            .scanning
            .run(&mut shared.line, &mut shared.device, cx.local.events);
        if beat {
            alive::end(fault::marks(), Task::Scan);
        } else {
            // Only the beats show that it is alive.
            alive::put_back(fault::marks(), Task::Scan, mark);
        }
    }

    #[task(binds = EXTI0, priority = 1, local = [background_work, logged], shared = [device, activity, orders])]
    fn background(cx: background::Context) {
        alive::begin(fault::marks(), Task::Background);
        let mut shared = cx.shared;
        cx.local.background_work.run(
            &mut shared.device,
            &mut shared.activity,
            &mut shared.orders,
            cx.local.logged,
        );
        alive::end(fault::marks(), Task::Background);
    }
}
