//! Textures, samplers and images that the lit model uses, each once.

use crate::scene::texture::TextureImage;
use crate::scene::{Image, Texture, Wrap};
use crate::solution::Solution;
use serde_json::{Value, json};
use std::collections::BTreeSet;

/// Collects textures as they are asked for.
pub struct Textures<'a> {
    solution: &'a Solution,
    /// Image (of the solution) and sampler of each texture.
    textures: Vec<(u32, usize)>,
    samplers: Vec<Value>,
    /// Images to embed, as numbers in the solution.
    images: Vec<u32>,
    /// Images that can be used.
    checked: BTreeSet<u32>,
    /// Images that cannot.
    missing: BTreeSet<u32>,
}

const WEBP: &str = "image/webp";

impl<'a> Textures<'a> {
    /// None yet.
    pub fn new(solution: &'a Solution) -> Textures<'a> {
        Textures {
            solution,
            textures: vec![],
            samplers: vec![],
            images: vec![],
            checked: BTreeSet::new(),
            missing: BTreeSet::new(),
        }
    }

    /// Whether a texture's image is at hand and can be decoded; images that cannot be used are counted.
    pub fn usable(&mut self, texture: &Texture) -> bool {
        let number = texture.image;
        if self.missing.contains(&number) || self.checked.contains(&number) {
            return self.checked.contains(&number);
        }
        let bytes = self.solution.images.get(number as usize).and_then(Option::as_ref);
        let usable = bytes.is_some_and(|bytes| {
            let image = Image { name: String::new(), media_type: String::new(), bytes: bytes.clone() };
            media_type(bytes).is_some() && TextureImage::decode(&image).is_ok()
        });
        if usable {
            self.checked.insert(number)
        } else {
            self.missing.insert(number)
        };
        usable
    }

    /// Number of images that were wanted and are not at hand.
    pub fn missing(&self) -> u64 {
        self.missing.len() as u64
    }

    /// Number of a texture in the file.
    pub fn number(&mut self, texture: &Texture) -> usize {
        // Of identical images only the first is written.
        let hash = |i: u32| self.solution.description.images.get(i as usize).map(|i| &i.hash);
        let same = |&i: &u32| i == texture.image || hash(i).is_some() && hash(i) == hash(texture.image);
        let image = (0..texture.image).find(|i| same(i) && self.bytes(*i).is_some()).unwrap_or(texture.image);
        let wrap = texture.wrap.map(|w| match w {
            Wrap::Repeat => 10_497,
            Wrap::Mirror => 33_648,
            Wrap::Clamp => 33_071,
        });
        let (magnify, minify) = if texture.nearest { (9728, 9984) } else { (9729, 9987) };
        let sampler = json!({ "magFilter": magnify, "minFilter": minify, "wrapS": wrap[0], "wrapT": wrap[1] });
        let sampler = place(&mut self.samplers, sampler);
        place(&mut self.images, image);
        place(&mut self.textures, (image, sampler))
    }

    /// The images to embed, in order.
    pub fn embedded(&self) -> impl Iterator<Item = &[u8]> {
        self.images.iter().map(|&i| self.bytes(i).unwrap_or_default())
    }

    /// Adds `samplers`, `images` and `textures` to a document; the images lie in the buffer views from `first_view` on.
    pub fn describe(&self, document: &mut Value, first_view: usize) {
        if self.textures.is_empty() {
            return;
        }
        document["samplers"] = json!(self.samplers);
        document["images"] = self
            .images
            .iter()
            .enumerate()
            .map(|(view, &i)| {
                let kind = self.bytes(i).and_then(media_type).unwrap_or("image/png");
                let name = self.solution.description.images.get(i as usize).map_or("", |i| i.name.as_str());
                json!({ "name": name, "mimeType": kind, "bufferView": first_view + view })
            })
            .collect();
        let mut webp = false;
        document["textures"] = self
            .textures
            .iter()
            .map(|&(image, sampler)| {
                let source = self.images.iter().position(|&i| i == image);
                if self.bytes(image).and_then(media_type) == Some(WEBP) {
                    webp = true;
                    json!({ "sampler": sampler, "extensions": { "EXT_texture_webp": { "source": source } } })
                } else {
                    json!({ "sampler": sampler, "source": source })
                }
            })
            .collect();
        if webp && let Some(used) = document["extensionsUsed"].as_array_mut() {
            used.push(json!("EXT_texture_webp"));
            document["extensionsRequired"] = json!(["EXT_texture_webp"]);
        }
    }

    fn bytes(&self, image: u32) -> Option<&[u8]> {
        self.solution.images.get(image as usize)?.as_deref()
    }
}

/// The place of a value in a list, at its end if it is new.
fn place<T: PartialEq>(list: &mut Vec<T>, value: T) -> usize {
    list.iter().position(|v| *v == value).unwrap_or_else(|| {
        list.push(value);
        list.len() - 1
    })
}

/// What the bytes are, whatever the scene says they are.
fn media_type(bytes: &[u8]) -> Option<&'static str> {
    match bytes {
        [0x89, b'P', b'N', b'G', ..] => Some("image/png"),
        [0xff, 0xd8, 0xff, ..] => Some("image/jpeg"),
        [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'E', b'B', b'P', ..] => Some(WEBP),
        _ => None,
    }
}
