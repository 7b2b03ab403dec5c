//! Runs `dapple_fuzz::triangle_soup` under cargo-fuzz.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| dapple_fuzz::triangle_soup(data));
