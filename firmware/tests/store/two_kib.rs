//! The same tests on a flash whose pages have 2 KiB.

mod cuts;
mod flash;
mod outputs;
mod running;
mod vectors;
mod wear;

/// Bytes of a page of the STM32F103RC.
const PAGE_SIZE: usize = 2048;
