//! The receiver of an ASCII line: [`modio_fuzz::receiver`].
#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| modio_fuzz::receiver::ascii(input));
