//! What an image must be so that the loader of a modio starts it: [`genuine`].
//!
//! The program of this package is the loader itself. Its decisions are those of crate `boot-state`.

#![no_std]

pub mod genuine;
