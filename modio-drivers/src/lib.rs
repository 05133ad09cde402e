//! Drivers of the plug-in I/O modules.
//!
//! A module has four channels. Its driver implements [`IoModule`]: once a millisecond it brings what
//! its inputs show into [`Channels`] and drives its outputs as [`Channels`] says, in the way
//! [`ChannelSettings`] asks for. That is all the rest of the device sees of a module, so a new module
//! is one new file here.
//!
//! | module | driver | over |
//! |---|---|---|
//! | none | [`Absent`] | - |
//! | 4DI | [`Di4`] | [`InputPin`](embedded_hal::digital::InputPin) |
//! | 4DO | [`Do4`] | [`OutputPin`](embedded_hal::digital::OutputPin) |
//! | 2Relay | [`Relay2`] | both |
//! | 4AI | [`Ai4`] | [`AnalogSource`] |
//! | 4AO | [`Ao4`] | [`DacLink`], served by a [`DacWorker`] over [`I2c`](embedded_hal::i2c::I2c) |
//! | 2AI2AO | [`Ai2Ao2`] | both of these |
//!
//! Drivers know nothing of Modbus or of the board, do no floating point, cannot panic and wait for
//! nothing: what is slow or can stall, the DAC's bus, is left to [`DacWorker`], which a background
//! task runs.

#![no_std]
#![forbid(unsafe_code)]

mod ai2ao2;
mod ai4;
mod analog_inputs;
mod analog_source;
mod ao4;
mod channels;
mod dac;
mod dac_link;
mod debounce;
mod di4;
mod do4;
pub mod input_status;
mod io_module;
mod low_pass;
pub mod ntc;
mod relay2;
pub mod scale;
mod settings;

pub use ai2ao2::Ai2Ao2;
pub use ai4::Ai4;
pub use analog_inputs::{POLLS_PER_SCAN, STALLED_SCANS};
pub use analog_source::AnalogSource;
pub use ao4::Ao4;
pub use channels::{CHANNELS, ChannelStatus, Channels, Kind};
pub use dac::{DAC_ADDRESS, DacError, DacWorker};
pub use dac_link::DacLink;
pub use debounce::{DEBOUNCE_DEFAULT_MS, DEBOUNCE_MAX_MS};
pub use di4::Di4;
pub use do4::Do4;
pub use io_module::{Absent, IoModule, ModuleError};
pub use low_pass::{LOW_PASS_DEFAULT, LOW_PASS_MAX};
pub use relay2::{JUMPER_DEBOUNCE_MS, Relay2};
pub use settings::{ChannelSettings, Range, Scale};
