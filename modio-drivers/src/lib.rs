#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

mod ai2ao2;
mod ai4;
mod analog_inputs;
mod ao4;
mod channels;
mod code;
mod dac;
mod debounce;
mod di4;
mod digital;
mod do4;
pub mod input_status;
mod io_module;
mod lora;
mod low_pass;
pub mod ntc;
mod relay2;
pub mod scale;
mod settings;

pub use ai2ao2::Ai2Ao2;
pub use ai4::Ai4;
pub use analog_inputs::{Codes, STALLED_SCANS};
pub use ao4::Ao4;
pub use channels::{CHANNELS, Channels};
pub use code::Code;
pub use dac::{DacLink, DacWorker};
pub use di4::Di4;
pub use do4::Do4;
pub use io_module::{Absent, IoModule, ModuleError};
pub use lora::{Lora, LoraSettings};
pub use register_map::codes::{ChannelStatus, Scale, Signal};
pub use register_map::points::Kind;
pub use relay2::{JUMPER_DEBOUNCE_MS, Relay2};
pub use settings::ChannelSettings;
