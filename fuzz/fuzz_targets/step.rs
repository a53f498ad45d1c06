#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| grassfire_fuzz::read("x.step", data));
