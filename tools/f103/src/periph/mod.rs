//! The register blocks of the STM32F103, one in each file, modelled after their sections of RM0008.

pub mod adc;
pub mod afio;
pub mod can;
pub mod clocks;
pub mod crc;
pub mod dac;
pub mod dbgmcu;
pub mod dma;
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
