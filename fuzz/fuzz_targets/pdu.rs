//! Requests through the server: [`modio_fuzz::pdu`].
#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| modio_fuzz::pdu::run(input));
