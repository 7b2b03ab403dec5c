//! Runs `dapple_fuzz::live_session` under cargo-fuzz.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| dapple_fuzz::live_session(data));
