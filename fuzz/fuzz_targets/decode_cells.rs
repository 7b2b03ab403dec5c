//! Runs `dapple_fuzz::decode_cells` under cargo-fuzz.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| dapple_fuzz::decode_cells(data));
