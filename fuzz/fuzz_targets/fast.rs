//! Function 70 on a whole device: [`modio_fuzz::fast`].
#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| modio_fuzz::fast::run(input));
