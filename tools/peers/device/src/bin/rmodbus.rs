//! The server on crate rmodbus.

#![no_std]
#![no_main]

#[cortex_m_rt::entry]
fn main() -> ! {
    rivals::run(peers::rmodbus::Rmodbus::default())
}
