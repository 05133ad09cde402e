//! Tests of the configuration store on a strict mock flash, with power cuts at every possible place.

mod cuts;
mod flash;
mod outputs;
mod running;
mod vectors;
mod wear;

/// Bytes of a page of the STM32F103CB.
const PAGE_SIZE: usize = 1024;
