//! The register blocks of the STM32F103, one in each file, modelled after their sections of RM0008.

pub mod adc;
pub mod afio;
pub mod clocks;
pub mod crc;
pub mod dbgmcu;
pub mod exti;
pub mod flash;
pub mod gpio;
pub mod i2c;
pub mod ident;
pub mod iwdg;
pub mod pwr;
pub mod rcc;
pub mod timer;
pub mod usart;
