//! The device: tasks, what they share, and nothing else.
//!
//! | task | bound to | priority | duty, and what an overrun costs |
//! |---|---|---|---|
//! | `uart` | USART1 | 4 | a byte in or out, driver off at the end. At 921600 bit/s a byte comes every 12 us; later than that and it is lost, which the receiver reports and the frame pays for |
//! | `gap` | TIM2 | 4 | t1.5 and t3.5. Late, it makes the silence longer, never shorter |
//! | `serve` | EXTI3, pended by `gap` | 3 | a closed frame becomes a response. Late, the response is late |
//! | `scan` | TIM4, 1 kHz, and pended by a write | 2 | inputs into the process image, outputs out of it. A missed beat stretches the debounce by 1 ms |
//! | `background` | software, every 10 ms | 1 | LEDs and log. May be late at no cost |
//! | `idle` | - | - | feeds the watchdog when all of the above have been alive; sleeps |
//!
//! `serve` is bound to an interrupt nothing else uses rather than spawned: an interrupt pended while
//! its handler runs comes again, where a second spawn would be refused and the request left lying.

#![no_std]
#![no_main]

mod installed;
mod line;
mod log;
mod trap;

#[rtic::app(device = board_support::pac, peripherals = true, dispatchers = [EXTI0])]
mod app {
    use board_support::{
        GapEvent, Leds, ScanTimer, Watchdog, board, flash, pac::Interrupt, uart::LineSettings,
    };
    use firmware::{
        alive::{Alive, Task},
        image::ProcessImage,
        lamps::{Lamps, Trouble},
        start_up::{self, Address},
    };
    use heapless::spsc::{Consumer, Producer, Queue};
    use modbus_server::{Adu, Server, Work, rtu};
    use modio_drivers::IoModule;
    use register_map::preset;

    use crate::{
        installed::Installed,
        line::Line,
        log::{Event, Log},
    };

    /// Scans between two beats of the background, and between two proofs of life.
    const SCANS_PER_BACKGROUND: u8 = firmware::lamps::TICK_MS as u8;
    const SCANS_PER_PROOF: u8 = 100;

    static ALIVE: Alive = Alive::new();

    #[shared]
    struct Shared {
        /// `None` while SW01 shows no unit address: the line is not served.
        line: Option<Line>,
        image: ProcessImage,
        /// A request for this unit has been served since the LEDs were last set.
        activity: bool,
    }

    #[local]
    struct Local {
        server: Server,
        module: Installed,
        scan_timer: ScanTimer,
        events: Producer<'static, Event>,
        failing: bool,
        until_background: u8,
        until_proof: u8,
        lamps: Lamps,
        leds: Leds,
        log: Log,
        logged: Consumer<'static, Event>,
        standing: Trouble,
        watchdog: Watchdog,
    }

    #[init(local = [
        adus: [Adu; 2] = [const { Adu::new() }; 2],
        queue: Queue<Event, 8> = Queue::new(),
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        let mut log = Log::new();
        let mut board = board::setup(cx.device);
        let address = Address::from_dip(board.dip);
        let wanted = start_up::module(flash::read(preset::ADDRESS), option_env!("MODIO_MODULE"));
        let (module, drivable) = Installed::new(wanted, board.slot);
        log.start(&crate::log::Start {
            address,
            dip: board.dip,
            module: wanted,
            drivable,
            clock: board.clock,
            reset_cause: board.reset_cause,
        });

        let settings = LineSettings::FACTORY;
        let line = address.unit().and_then(|unit| {
            let gaps = rtu::Gaps::standard(settings.baud, settings.format.bits() as u8);
            let (uart, gap) = board.line.start(settings, gaps.t15, gaps.t35)?;
            Some(Line::new(uart, gap, unit, cx.local.adus))
        });

        let (events, logged) = cx.local.queue.split();
        board.scan_timer.start();
        board.watchdog.start();
        (
            Shared {
                line,
                image: ProcessImage::new(module.kinds()),
                activity: false,
            },
            Local {
                server: Server::new(address.unit().unwrap_or_default()),
                module,
                scan_timer: board.scan_timer,
                events,
                failing: false,
                until_background: 0,
                until_proof: 0,
                lamps: Lamps::new(),
                leds: board.leds,
                log,
                logged,
                standing: Trouble::at_start(address, drivable, board.clock.is_crystal()),
                watchdog: board.watchdog,
            },
        )
    }

    #[idle(local = [watchdog])]
    fn idle(cx: idle::Context) -> ! {
        loop {
            if ALIVE.take_all() {
                cx.local.watchdog.feed();
            }
            rtic::export::wfi();
        }
    }

    #[task(binds = USART1, priority = 4, shared = [line])]
    fn uart(mut cx: uart::Context) {
        cx.shared.line.lock(|line| {
            if let Some(line) = line {
                line.on_uart();
            }
        });
        ALIVE.mark(Task::Line);
    }

    #[task(binds = TIM2, priority = 4, shared = [line])]
    fn gap(mut cx: gap::Context) {
        let request = cx.shared.line.lock(|line| {
            let line = line.as_mut()?;
            match line.gap.take_event() {
                GapEvent::T15 => line.on_t15(),
                GapEvent::T35 => return line.on_t35(),
                GapEvent::Nothing => {}
            }
            None
        });
        if request.is_some() {
            rtic::pend(Interrupt::EXTI3);
        }
    }

    #[task(binds = EXTI3, priority = 3, local = [server], shared = [line, image, activity])]
    fn serve(cx: serve::Context) {
        ALIVE.mark(Task::Serve);
        let serve::SharedResources {
            mut line,
            mut image,
            mut activity,
            ..
        } = cx.shared;
        let server = cx.local.server;
        let mut on_line = |f: &mut dyn FnMut(&mut Line)| line.lock(|line| line.as_mut().map(f));

        let mut request = None;
        on_line(&mut |line| request = line.take_request());
        let Some(adu) = request else {
            return;
        };
        let decision = image.lock(|image| server.decide(adu, image));
        // The head leaves while the rest is being done.
        if let Some(head) = decision.reply {
            on_line(&mut |line| line.start_reply(head));
        }
        image.lock(|image| server.carry_out(&decision, adu, image));
        server.commit(&decision);
        let mut adu = Some(adu);
        on_line(&mut |line| {
            if let Some(adu) = adu.take() {
                line.finish_reply(adu, decision.reply.is_some());
            }
        });
        if matches!(
            decision.work,
            Work::WriteBits { .. } | Work::WriteWords { .. }
        ) {
            rtic::pend(Interrupt::TIM4);
        }
        activity.lock(|activity| *activity = true);
    }

    #[task(
        binds = TIM4, priority = 2,
        local = [module, scan_timer, events, failing, until_background, until_proof],
        shared = [image],
    )]
    fn scan(mut cx: scan::Context) {
        let scan::LocalResources {
            module,
            scan_timer,
            events,
            failing,
            until_background,
            until_proof,
            ..
        } = cx.local;
        let beat = scan_timer.take_beat();

        let mut channels = cx.shared.image.lock(|image| image.channels());
        let mut result = module.drive_outputs(&channels);
        if beat {
            result = result.and(module.read_inputs(&mut channels));
        }
        cx.shared
            .image
            .lock(|image| image.scanned(&channels, result.is_err()));

        if result.is_err() != *failing {
            *failing = result.is_err();
            // A full queue loses a log line, no more.
            let _ = events.enqueue(match result {
                Ok(()) => Event::ModuleGood,
                Err(error) => Event::ModuleFails(error),
            });
        }
        if beat {
            ALIVE.mark(Task::Scan);
            if every(until_background, SCANS_PER_BACKGROUND) {
                // Still at the last one: it comes ten milliseconds later.
                let _ = background::spawn();
            }
            if every(until_proof, SCANS_PER_PROOF) {
                // A silent line gives these two no reason to run. Called for nothing they do
                // nothing, but show that they could.
                rtic::pend(Interrupt::USART1);
                rtic::pend(Interrupt::EXTI3);
            }
        }
    }

    /// True once every `period` calls.
    fn every(left: &mut u8, period: u8) -> bool {
        let now = *left == 0;
        *left = if now { period - 1 } else { *left - 1 };
        now
    }

    #[task(priority = 1, local = [lamps, leds, log, logged, standing], shared = [image, activity])]
    async fn background(cx: background::Context) {
        let background::SharedResources {
            mut image,
            mut activity,
            ..
        } = cx.shared;
        let background::LocalResources {
            lamps,
            leds,
            log,
            logged,
            standing,
            ..
        } = cx.local;
        let request = activity.lock(core::mem::take);
        let failing = image.lock(|image| image.failing());
        let lit = lamps.tick(request, standing.or_module(failing));
        leds.set_activity(lit.activity);
        leds.set_fault(lit.fault);
        leds.set_run(lit.run);
        while let Some(event) = logged.dequeue() {
            log.event(event);
        }
        ALIVE.mark(Task::Background);
    }
}
