//! The configuration store on a strict mock of its flash, with the power cut wherever it can be.

mod cuts;
mod flash;
mod model;
mod running;
mod vectors;
mod wear;

/// Bytes of a page of the STM32F103CB.
const PAGE_SIZE: usize = 1024;
