//! Runs `dapple_fuzz::read_environment` under cargo-fuzz.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| dapple_fuzz::read_environment(data));
