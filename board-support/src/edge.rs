//! Falling edges of a receiving pin that no timer captures, by an external interrupt.
//!
//! The handler reads the count of the line's free-running timer, TIM1. So an edge is late by as long as the handler
//! waits, at most 8.5 us. An arbitration allows for 24 us, and a silence only needs to know that the line has fallen.
//!
//! The handler has the priority of the line's interrupts, so these and the handler do not interrupt each other. It is no
//! task of the application: which interrupt it has depends on the pin. Its number is lower than that of every UART, so
//! of two that wait, the edge is handled first.
//!
//! Each interrupt costs about 0.7 us, and noise may raise one every two bits. They would take a third of the processor's
//! time at 921600 bit/s while a reply is made. So the interrupt is enabled only while the times of edges matter. An edge
//! is noted without it, too, because its pending bit stays set.

use core::sync::atomic::{AtomicBool, AtomicU16, Ordering};

use cortex_m::interrupt::InterruptNumber;
use stm32f1xx_hal::pac;

use crate::{pin::Pin, vectors};

/// The count at the last edge, and whether there was one since the last was forgotten.
static COUNT: AtomicU16 = AtomicU16::new(0);
static FELL: AtomicBool = AtomicBool::new(false);

/// The edges of a pin. No other pin with this number can have edges.
#[derive(Clone, Copy)]
pub(crate) struct Edge(pub Pin);

/// The interrupt of an external line (RM0008 table 63).
#[derive(Clone, Copy)]
struct Irq(u16);

// SAFETY: the number is that of an interrupt of the part.
unsafe impl InterruptNumber for Irq {
    fn number(self) -> u16 {
        self.0
    }
}

impl Edge {
    const fn bit(self) -> u32 {
        1 << self.0.number()
    }

    /// Enters the handler in the vector table in RAM, and gives the interrupt the priority of the frame-gap timer's.
    /// The clock of the alternate-function block must be on.
    pub(crate) fn start(self, handler: extern "C" fn()) {
        let irq = Irq(self.0.edge_interrupt());
        vectors::set(irq.0, handler);
        self.set_up();
        // SAFETY: only this priority is changed, and the interrupt is disabled.
        unsafe {
            let mut core = cortex_m::Peripherals::steal();
            core.NVIC
                .set_priority(irq, pac::NVIC::get_priority(pac::Interrupt::TIM2));
        }
    }

    /// Enables the interrupt, or disables it. An edge that has waited in between is handled after it was enabled.
    // The registers are written here, because the function of the HAL may be in flash.
    #[inline(always)]
    pub(crate) fn set_interrupt(self, on: bool) {
        let number = usize::from(self.0.edge_interrupt());
        let bit = 1 << (number % 32);
        // SAFETY: the registers always exist, and writing 0 leaves the other interrupts as they are (PM0056 4.3.2, 4.3.3).
        // The handler shares only atomics, and only with tasks of the same priority.
        unsafe {
            let nvic = &*pac::NVIC::PTR;
            let registers = if on { &nvic.iser } else { &nvic.icer };
            if let Some(register) = registers.get(number / 32) {
                register.write(bit);
            }
        }
    }

    /// Sets every register up.
    #[inline(always)]
    pub(crate) fn set_up(self) {
        // SAFETY: the registers always exist.
        let (afio, exti) = unsafe { (&*pac::AFIO::ptr(), &*pac::EXTI::ptr()) };
        let shift = u32::from(self.0.number() % 4) * 4;
        let port = (self.0.port() as u32) << shift;
        // SAFETY: a port is a number of four bits (RM0008 9.4.3), and these registers have a bit for each line.
        unsafe {
            match self.0.number() / 4 {
                0 => afio.exticr1().write(|w| w.bits(port)),
                1 => afio.exticr2().write(|w| w.bits(port)),
                2 => afio.exticr3().write(|w| w.bits(port)),
                _ => afio.exticr4().write(|w| w.bits(port)),
            };
            exti.rtsr().write(|w| w.bits(0));
            exti.ftsr().write(|w| w.bits(self.bit()));
            exti.imr().write(|w| w.bits(self.bit()));
        }
    }

    /// Stores the time of an edge that waits.
    #[inline(always)]
    pub(crate) fn take(self) {
        // SAFETY: the registers always exist. Reading has no side effect, and PR is only written here.
        let (exti, timer) = unsafe { (&*pac::EXTI::ptr(), &*pac::TIM1::ptr()) };
        if exti.pr().read().bits() & self.bit() != 0 {
            self.acknowledge();
            COUNT.store(timer.cnt().read().cnt().bits(), Ordering::Relaxed);
            FELL.store(true, Ordering::Relaxed);
        }
    }

    /// Forgets that there was an edge, also one that waits.
    #[inline(always)]
    pub(crate) fn clear(self) {
        self.acknowledge();
        self.forget_taken();
    }

    /// Forgets the edge that was taken last. One that waits stays.
    #[inline(always)]
    pub(crate) fn forget_taken(self) {
        FELL.store(false, Ordering::Relaxed);
    }

    #[inline(always)]
    fn acknowledge(self) {
        // SAFETY: the register always exists; writing 1 clears this bit, and 0 leaves the others (RM0008 10.3.6).
        unsafe { &*pac::EXTI::ptr() }
            .pr()
            .write(|w| unsafe { w.bits(self.bit()) });
    }

    /// Returns whether there was an edge since the last was forgotten.
    #[inline(always)]
    pub(crate) fn fell(self) -> bool {
        self.take();
        FELL.load(Ordering::Relaxed)
    }

    /// Returns the count at the last edge.
    #[inline(always)]
    pub(crate) fn count(self) -> u16 {
        self.take();
        COUNT.load(Ordering::Relaxed)
    }
}
