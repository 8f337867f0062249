#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| relit_fuzz::object_mtl(bytes));
