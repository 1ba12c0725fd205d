#![no_main]

use ringlight::resources::Bytes;
use ringlight::scene::Image;
use ringlight::scene::texture::TextureImage;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let bytes = Bytes::new(data.to_vec());
    let _ = TextureImage::decode(&Image { name: "fuzz".into(), media_type: String::new(), bytes });
});
