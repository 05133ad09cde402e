//! The UARTs of the part as data: address, pins and clock, so that a board names one.
//!
//! The pins are those without remapping (RM0008 9.3.8). They lie beside each other in one configuration register.

use crate::pin::Pin;

/// A UART.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Usart {
    /// PA9 and PA10, with the clock of the core.
    Usart1,
    /// PA2 and PA3, with half the clock of the core.
    Usart2,
    /// PB10 and PB11, with half the clock of the core.
    Usart3,
    /// PC10 and PC11, with half the clock of the core; parts of high density only.
    Uart4,
}

impl Usart {
    /// Returns the base address (RM0008 table 3).
    #[must_use]
    pub const fn base(self) -> u32 {
        match self {
            Self::Usart1 => 0x4001_3800,
            Self::Usart2 => 0x4000_4400,
            Self::Usart3 => 0x4000_4800,
            Self::Uart4 => 0x4000_4C00,
        }
    }

    /// Returns the number of the interrupt (RM0008 table 63).
    #[must_use]
    pub const fn interrupt(self) -> u16 {
        match self {
            Self::Usart1 => 37,
            Self::Usart2 => 38,
            Self::Usart3 => 39,
            Self::Uart4 => 52,
        }
    }

    /// Returns the pin that transmits.
    #[must_use]
    pub const fn tx(self) -> Pin {
        match self {
            Self::Usart1 => Pin::a(9),
            Self::Usart2 => Pin::a(2),
            Self::Usart3 => Pin::b(10),
            Self::Uart4 => Pin::c(10),
        }
    }

    /// Returns the pin that receives.
    #[must_use]
    pub const fn rx(self) -> Pin {
        match self {
            Self::Usart1 => Pin::a(10),
            Self::Usart2 => Pin::a(3),
            Self::Usart3 => Pin::b(11),
            Self::Uart4 => Pin::c(11),
        }
    }

    /// Returns whether channel 3 of TIM1 captures the edges of the receiving pin. Those of another one raise an
    /// interrupt.
    #[must_use]
    pub const fn is_captured(self) -> bool {
        matches!(self, Self::Usart1)
    }
}

#[cfg(target_os = "none")]
mod registers {
    use stm32f1xx_hal::{
        pac::{self, usart1::RegisterBlock},
        rcc::{Enable, Reset},
    };

    use super::Usart;
    use crate::ClockSource;

    impl Usart {
        /// Returns the registers. The caller must own the UART. UART4 has the same ones, but some bits of them are
        /// reserved there (RM0008 27.6.8).
        #[inline(always)]
        pub(crate) const fn registers(self) -> &'static RegisterBlock {
            // SAFETY: the block is at this address and always exists, and no access to it can violate memory safety.
            unsafe { &*(self.base() as *const RegisterBlock) }
        }

        /// Turns the clock on and resets the UART.
        #[inline(always)]
        pub(crate) fn enable(self, rcc: &mut pac::RCC) {
            match self {
                Self::Usart1 => {
                    pac::USART1::enable(rcc);
                    pac::USART1::reset(rcc);
                }
                Self::Usart2 => {
                    pac::USART2::enable(rcc);
                    pac::USART2::reset(rcc);
                }
                Self::Usart3 => {
                    pac::USART3::enable(rcc);
                    pac::USART3::reset(rcc);
                }
                // The HAL has it for parts of high density only.
                Self::Uart4 => {
                    rcc.apb1enr().modify(|_, w| w.uart4en().set_bit());
                    rcc.apb1rstr().modify(|_, w| w.uart4rst().set_bit());
                    rcc.apb1rstr().modify(|_, w| w.uart4rst().clear_bit());
                }
            }
        }

        /// Returns the frequency of the UART's clock in Hz.
        pub(crate) const fn hz(self, clock: ClockSource) -> u32 {
            match self {
                Self::Usart1 => clock.core_hz(),
                Self::Usart2 | Self::Usart3 | Self::Uart4 => clock.apb1_hz(),
            }
        }
    }
}
