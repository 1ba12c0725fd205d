#![no_main]

include!("read_scene.rs");

libfuzzer_sys::fuzz_target!(|data: &[u8]| read_scene("fuzz.obj", data));
