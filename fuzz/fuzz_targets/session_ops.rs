//! Runs `dapple_fuzz::session_ops` under cargo-fuzz.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| dapple_fuzz::session_ops(data));
