//! The configuration store: [`modio_fuzz::store`].
#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| modio_fuzz::store::run(input));
