#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| relit_fuzz::colmap_images(bytes));
