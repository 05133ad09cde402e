//! Descriptions that a unit sends: [`modio_fuzz::description`].
#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| modio_fuzz::description::run(input));
