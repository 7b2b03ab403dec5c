//! Runs `dapple_fuzz::load_scene` under cargo-fuzz.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| dapple_fuzz::load_scene(data));
