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

mod clock;
mod converter;
mod every;
mod installed;
mod line;
mod log;
mod pages;
mod persistence;
mod rtt;
mod signals;
mod start;
mod trap;

#[rtic::app(device = board_support::pac, peripherals = true)]
mod app {
    use core::mem::MaybeUninit;

    use board_support::{ScanTimer, Watchdog, fault, pac::Interrupt, stack};
    use firmware::{
        alive::{self, Task},
        device::Device,
        lamps::TICK_MS,
        start_up::LOADER_UNIT,
    };
    use heapless::spsc::{Consumer, Producer, Queue};
    use modbus_server::{Adu, Outcome, Server};
    use modio_drivers::{ChannelSettings, IoModule, ModuleError};
    use register_map::codes::Command;

    use crate::{
        clock,
        every::Every,
        installed::{AnalogOutputs, Installed},
        line::Line,
        log::{Event, Log},
        persistence::Persistence,
        signals::Signals,
        start,
    };

    /// Scans between two beats of the background, and between two proofs of life.
    const SCANS_PER_BACKGROUND: u8 = TICK_MS as u8;
    const SCANS_PER_PROOF: u8 = 100;

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

    /// A save and a restart may be ordered before the background takes either: neither replaces the other.
    #[derive(Default)]
    pub struct Orders {
        save: bool,
        restart: bool,
    }

    #[local]
    struct Local {
        server: Server,
        frame_gap_ms: u32,
        module: Installed,
        settings: [ChannelSettings; 4],
        scan_timer: ScanTimer,
        events: Producer<'static, Event>,
        background_beat: Every,
        proof_beat: Every,
        analog_outputs: Option<AnalogOutputs>,
        persistence: Persistence,
        signals: Signals,
        log: Log,
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
        let settings = *started.device.points.settings();
        (
            Shared {
                line: started.line,
                activity: false,
                orders: Orders::default(),
                device: started.device,
            },
            Local {
                server: started.server,
                frame_gap_ms: started.frame_gap_ms,
                module: started.module,
                settings,
                scan_timer: started.scan_timer,
                events,
                background_beat: Every::new(SCANS_PER_BACKGROUND),
                proof_beat: Every::new(SCANS_PER_PROOF),
                analog_outputs: started.analog_outputs,
                persistence: started.persistence,
                signals: Signals::new(started.leds, started.trouble),
                log: started.log,
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
        let waits = cx
            .shared
            .line
            .lock(|line| line.as_mut().is_some_and(Line::on_gap));
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

    #[task(binds = EXTI3, priority = 3, local = [server, frame_gap_ms], shared = [line, device, activity, orders])]
    fn serve(cx: serve::Context) {
        alive::begin(fault::marks(), Task::Serve);
        let serve::SharedResources {
            mut line,
            mut device,
            mut activity,
            mut orders,
            ..
        } = cx.shared;
        let serve::LocalResources {
            server,
            frame_gap_ms,
            ..
        } = cx.local;
        let delay_ms = if server.unit() == LOADER_UNIT {
            // The loader mode is to be found by a master with any time-out.
            0
        } else {
            device.lock(|device| device.config.response_delay_ms())
        };
        // The unit address leaves while all that follows is being done.
        let (silent, request) = line.lock(|line| {
            line.as_mut().map_or((true, None), |line| {
                (!line.is_replying(), line.take(server, delay_ms))
            })
        });

        // An order of the last request, whose reply is out or never comes.
        if silent {
            let left = device.lock(|device| {
                let order = device.take_order()?;
                device.carry_out(order)
            });
            if let Some(order) = left {
                orders.lock(|orders| match order {
                    Command::Save => orders.save = true,
                    Command::Restart => orders.restart = true,
                    _ => {}
                });
                rtic::pend(Interrupt::EXTI0);
            }
        }

        let Some(request) = request else {
            alive::end(fault::marks(), Task::Serve);
            return;
        };
        let decided = device.lock(|device| request.decide(server, &**device));
        let Some(answered) = line.lock(|line| line.as_mut().map(|line| line.answer(decided)))
        else {
            return;
        };
        let committed = answered.commit(server);
        let decision = *committed.decision();
        let served = device.lock(|device| {
            if Device::shows_counters(&decision.work) {
                device.state.counters = server.counters();
            }
            // In listen-only mode the outputs are to fall to SAFE.
            if !matches!(decision.outcome, Outcome::NoRequest | Outcome::NotObeyed) {
                device.request_seen(committed.ended().wrapping_sub(*frame_gap_ms));
            }
            committed.carry_out(server, &mut **device)
        });
        line.lock(|line| line.as_mut().map(|line| line.finish(served)));
        if decision.work.writes() {
            rtic::pend(Interrupt::EXTI1);
            if decision.reply.is_none() {
                // No reply to wait for: an order is carried out now.
                rtic::pend(Interrupt::EXTI3);
            }
        }
        activity.lock(|activity| *activity = true);
        alive::end(fault::marks(), Task::Serve);
    }

    #[task(
        binds = EXTI1, priority = 2,
        local = [module, settings, events, background_beat, proof_beat],
        shared = [line, device],
    )]
    fn scan(cx: scan::Context) {
        let mark = alive::look(fault::marks(), Task::Scan);
        alive::begin(fault::marks(), Task::Scan);
        alive::end_line(fault::marks());
        let scan::LocalResources {
            module,
            settings,
            events,
            background_beat,
            proof_beat,
            ..
        } = cx.local;
        let scan::SharedResources {
            mut line,
            mut device,
            ..
        } = cx.shared;
        let now = clock::millis();

        let (mut channels, wanted, uptime_s, beat, tripped) = device.lock(|device| {
            let passed = now.wrapping_sub(device.state.millis());
            let tripped = passed > 0 && device.tick(passed);
            let wanted = *device.points.settings();
            let uptime_s = device.state.uptime_s();
            (
                *device.points.channels(),
                wanted,
                uptime_s,
                passed > 0,
                tripped,
            )
        });
        if *settings != wanted {
            *settings = wanted;
            module.configure(settings);
        }
        let mut result = module.drive_outputs(&channels);
        if beat {
            result = ModuleError::in_either(result, module.read_inputs(&mut channels));
        }
        let changed = device.lock(|device| {
            if beat {
                device.points.scanned(&channels, settings);
            }
            let was_failing = device.points.failing();
            let failed = result.map_or_else(ModuleError::channels, |()| 0);
            // Only a whole scan shows that all is well.
            let is_failing = if beat { failed } else { failed | was_failing };
            device.points.set_failing(is_failing);
            is_failing != was_failing
        });

        // A full queue loses a log line, no more.
        if changed {
            let _ = events.enqueue(match result {
                Ok(()) => Event::ModuleGood,
                Err(error) => Event::ModuleFails(error),
            });
        }
        if tripped {
            let _ = events.enqueue(Event::CommunicationLost);
        }
        if beat {
            fault::keep_uptime(uptime_s);
            let repaired = line.lock(|line| line.as_mut().is_some_and(Line::take_repaired));
            if repaired {
                device.lock(|device| {
                    let repairs = &mut device.state.line_repairs;
                    *repairs = repairs.saturating_add(1);
                });
                let _ = events.enqueue(Event::LineRepaired);
            }
            if proof_beat.is_due() {
                // A silent line gives these two no reason to run. Called for nothing they do
                // nothing, but show that they could.
                rtic::pend(Interrupt::USART1);
                rtic::pend(Interrupt::EXTI3);
            }
        }
        // At once when outputs may have changed: they may be the DAC's.
        if background_beat.is_due() || !beat || tripped {
            rtic::pend(Interrupt::EXTI0);
        }
        if beat {
            alive::end(fault::marks(), Task::Scan);
        } else {
            // Only the beats show that it is alive.
            alive::put_back(fault::marks(), Task::Scan, mark);
        }
    }

    #[task(
        binds = EXTI0, priority = 1,
        local = [analog_outputs, persistence, signals, log, logged],
        shared = [device, activity, orders],
    )]
    fn background(cx: background::Context) {
        alive::begin(fault::marks(), Task::Background);
        let background::SharedResources {
            mut device,
            mut activity,
            mut orders,
            ..
        } = cx.shared;
        let background::LocalResources {
            analog_outputs,
            persistence,
            signals,
            log,
            logged,
            ..
        } = cx.local;

        if let Some(outputs) = analog_outputs {
            outputs.work();
        }

        let Orders { save, restart } = orders.lock(core::mem::take);
        if save {
            persistence.begin(&mut device);
        }
        if restart {
            persistence.restart_when_done();
        }
        if let Some(event) = persistence.work(&mut device) {
            log.event(event);
        }
        if persistence.wants_erase() {
            persistence.erase();
        }

        let free = stack::free_low_water();
        let (failing, millis) = device.lock(|device| {
            device.state.stack_free = free;
            (device.points.failing() != 0, device.state.millis())
        });
        signals.show(millis, failing, || activity.lock(core::mem::take));
        while let Some(event) = logged.dequeue() {
            log.event(event);
        }
        alive::end(fault::marks(), Task::Background);
    }
}
