//! Image headers and the boot state: [`modio_fuzz::update`].
#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| modio_fuzz::update::run(input));
