use super::read;
use crate::resources::{Bytes, Resources};
use crate::scene::{Alpha, Scene, SceneError, SourceTriangle, Wrap};
use proptest::prelude::*;
use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};

/// Files held in memory.
#[derive(Default)]
struct Files(HashMap<&'static str, Vec<u8>>);

impl Resources for Files {
    fn read(&self, path: &str) -> io::Result<Bytes> {
        self.0.get(path).cloned().map(Bytes::new).ok_or_else(|| io::Error::from(io::ErrorKind::NotFound))
    }
}

/// Files of a folder.
struct Folder(PathBuf);

impl Resources for Folder {
    fn read(&self, path: &str) -> io::Result<Bytes> {
        std::fs::read(self.0.join(path)).map(Bytes::new)
    }
}

const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";

fn parse(obj: &str, files: &[(&'static str, &[u8])]) -> Result<Scene, SceneError> {
    let files = Files(files.iter().map(|(name, bytes)| (*name, bytes.to_vec())).collect());
    read("folder/scene.obj", Bytes::new(obj.as_bytes().to_vec()), &files, 1.0)
}

fn triangles(scene: &Scene, surface: usize) -> Vec<SourceTriangle> {
    let mut triangles = Vec::new();
    scene.geometry.triangles(surface, &mut |triangle| triangles.push(triangle)).unwrap();
    assert_eq!(triangles.len() as u64, scene.surfaces[surface].triangles);
    triangles
}

fn area(triangle: &SourceTriangle) -> f64 {
    let [a, b, c] = triangle.position.map(glam::DVec3::from);
    (b - a).cross(c - a).length() / 2.0
}

fn codes(scene: &Scene) -> Vec<(&str, u64, &str)> {
    scene.warnings.0.iter().map(|w| (w.code.as_str(), w.count, &*w.first_place.at)).collect()
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";

#[test]
fn objects_groups_and_materials_become_nodes_and_surfaces() {
    let obj = format!(
        "\u{feff}# a comment \\\nmtllib a b.mtl two.MTL\r\nmtllib \"missing.mtl\"\r{SQUARE}o table\nf 1 2 3\n\
         g legs\nusemtl wood\nf 1 2 \\\r\n 3 4 # quad\nf -4/1/7 -3//1 -2/3\no table\ng legs\nf 1 2 3\ng\nusemtl \nf 1 2 3\n\
         l 1 2\ns off\nweird 1\nf 1 2\n"
    );
    let scene = parse(&obj, &[("a b.mtl", b"newmtl wood\nKd .5\n"), ("two.MTL", b"newmtl wood\nKd 1 0 0")]).unwrap();
    assert_eq!(scene.name, "scene");
    let nodes: Vec<_> = scene.nodes.iter().map(|node| (node.name.as_str(), node.parent)).collect();
    assert_eq!(nodes, [("table", None), ("legs", Some(0))]);
    let surfaces: Vec<_> = scene.surfaces.iter().map(|s| (&*s.name, s.node, s.material, s.triangles)).collect();
    assert_eq!(surfaces, [("table", 0, 0, 2), ("legs", 1, 1, 4)]);
    let faces = |surface| triangles(&scene, surface).iter().map(|triangle| triangle.face).collect::<Vec<_>>();
    assert_eq!((faces(0), faces(1)), (vec![0, 4], vec![1, 1, 2, 3]));
    assert_eq!(scene.surfaces[1].place.to_string(), "folder/scene.obj: line 16");
    assert_eq!(scene.materials[1].base_colour, [0.5, 0.5, 0.5, 1.0]);
    assert!(scene.materials.iter().all(|material| material.double_sided));
    assert_eq!(
        codes(&scene),
        [
            ("duplicate-material", 1, "line 1"),
            ("missing-material-file", 1, "line 3"),
            ("unknown-statement", 1, "line 27"),
            ("short-face", 1, "line 28"),
            ("missing-material", 1, "line 13"),
        ]
    );
}

#[test]
fn materials_are_read_with_their_maps() {
    let mtl =
        b"newmtl m\nKd 0.1 0.2 0.3\nKe 4 5 6\nTr 0.25\nmap_Kd -blendu on -s 2 3 1 -o 0.5 -clamp on sub\\a b.png\n\
        map_Ke sub/../sub/a b.png\nnewmtl leaf\nd 1\nTr 1\nmap_Kd leaf.png\nmap_d leaf.png\nillum 7\n\
        newmtl far\nKd xyz 0.9505 1 1.089\nmap_Kd C:\\x.png\nnewmtl up\nKd 0 0 0\nKs 1 1 1\nmap_Kd ../up.png\n\
        newmtl text\nKd spectral a.rfl 1\nmap_Kd sub/text.png\nmap_d x.png\nnewmtl gone\nmap_Kd gone.png\n";
    let obj = format!(
        "mtllib sub.mtl\n{SQUARE}usemtl m\nf 1/1 2/2 3/3\nf 1 2 3\nusemtl leaf\nf 1/1 2/2 3/3\nusemtl far\nf 1 2 3\n\
         usemtl up\nf 1 2 3\nusemtl text\nf 1 2 3\nusemtl gone\nf 1 2 3\n"
    );
    let files: [(&str, &[u8]); 4] =
        [("sub.mtl", mtl), ("sub/a b.png", PNG), ("leaf.png", b"RIFF....WEBP"), ("sub/text.png", b"text")];
    let scene = parse(&obj, &files).unwrap();
    let [m, leaf, far, up, text, gone] = &scene.materials[..] else { panic!() };
    assert_eq!((m.base_colour, m.emission, m.alpha), ([0.1, 0.2, 0.3, 0.75], [4.0, 5.0, 6.0], Alpha::Blend));
    assert_eq!(m.base_texture.unwrap().wrap, [Wrap::Clamp; 2]);
    assert_eq!(m.emission_texture.unwrap().image, m.base_texture.unwrap().image);
    assert_eq!((leaf.base_colour, leaf.alpha), ([1.0; 4], Alpha::Mask(0.5)));
    assert!(far.base_colour.iter().all(|channel| (channel - 1.0).abs() < 1e-3));
    assert_eq!(up.base_colour[0], 0.0);
    assert_eq!((text.base_colour[0], gone.base_colour[0]), (0.8, 0.8));
    let images: Vec<_> = scene.images.iter().map(|image| (image.name.as_str(), image.media_type.as_str())).collect();
    assert_eq!(images, [("sub/a b.png", "image/png"), ("leaf.png", "image/webp")]);
    let [textured, bare] = triangles(&scene, 0)[..] else { panic!() };
    assert_eq!(textured.base_uv, [[0.5, 1.0], [2.5, 1.0], [2.5, -2.0]]);
    assert_eq!(textured.emission_uv, [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]);
    assert_eq!(bare.emission_uv, [[0.0, 1.0]; 3]);
    let codes: Vec<_> = codes(&scene).into_iter().map(|(code, count, _)| (code, count)).collect();
    assert_eq!(
        codes,
        [
            ("spectral-colour", 1),
            ("glass", 1),
            ("path-outside", 2),
            ("black-texture", 1),
            ("specular-only", 1),
            ("texture-format", 1),
            ("alpha-map", 1),
            ("missing-texture", 1),
            ("missing-texture-coordinates", 1),
        ]
    );
}

#[test]
fn lengths_names_and_colours() {
    let bytes = b"o caf\xe9\nv 1000 0 0 .5 .25 2\nv 0 1000 0\nv 0 0 1000 1\nf 1 2 3\n".to_vec();
    let scene = read("x", Bytes::new(bytes), &Files::default(), 0.001).unwrap();
    assert_eq!(scene.nodes[0].name, "caf\u{e9}");
    assert!(scene.surfaces[0].has_colours);
    let triangle = triangles(&scene, 0)[0];
    assert_eq!(triangle.position, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    assert_eq!(triangle.colour, [[0.5, 0.25, 1.0, 1.0], [1.0; 4], [1.0; 4]]);
    assert_eq!(codes(&scene)[0], ("vertex-colour-range", 1, "line 2"));
}

#[test]
fn errors_say_where() {
    let cases = [
        ("v 0 0 0\n", "folder/scene.obj: no faces; expected at least one statement f with three corners"),
        ("v 0 0\n", "folder/scene.obj: line 1: \"0 0\"; expected three coordinates"),
        ("\n\nv 0 nan 0\n", "folder/scene.obj: line 3: \"nan\"; expected a finite number"),
        ("v 0 1e400 0\n", "folder/scene.obj: line 1: \"1e400\"; expected a finite number"),
        ("v 0 1,5 0\n", "folder/scene.obj: line 1: \"1,5\"; expected a finite number"),
        ("v 0 0 0\nf 1 1 2\n", "folder/scene.obj: line 2: index \"2\"; expected one of the 1 vertices so far"),
        ("v 0 0 0\nf 1 1 0\n", "folder/scene.obj: line 2: index \"0\"; expected one of the 1 vertices so far"),
        ("v 0 0 0\nf 1 1 -2\n", "folder/scene.obj: line 2: index \"-2\"; expected one of the 1 vertices so far"),
        (
            "v 0 0 0\nf 1/1 1 1\n",
            "folder/scene.obj: line 2: index \"1\"; expected one of the 0 texture coordinates so far",
        ),
        ("vt\n", "folder/scene.obj: line 1: vt without numbers; expected one to three"),
        ("mtllib bad.mtl\n", "bad.mtl: line 2: \"x\"; expected a finite number"),
        ("mtllib dark.mtl\n", "dark.mtl: line 2: \"-1 0 0\"; expected a colour without negative channels"),
    ];
    let files: [(&str, &[u8]); 2] = [("bad.mtl", b"newmtl a\nKd x"), ("dark.mtl", b"newmtl a\nKe -1 0 0")];
    for (obj, message) in cases {
        assert_eq!(parse(obj, &files).unwrap_err().to_string(), message);
    }
}

/// A scene of the shared set, if it is there.
fn shared(path: &str, unit: f64) -> Option<Scene> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scenes").join(path);
    let Ok(bytes) = std::fs::read(&path) else {
        println!("skipped: {} is missing", path.display());
        return None;
    };
    let folder = Folder(path.parent().unwrap().to_owned());
    Some(read(path.file_name().unwrap().to_str().unwrap(), Bytes::new(bytes), &folder, unit).unwrap())
}

#[test]
fn shared_scenes_have_their_triangles() {
    let scenes = [
        ("cornell_box/cornell_box.obj", 38, 5),
        ("ctk_church/ctk_church.obj", 1246, 9),
        ("veach_ajar_obj/veach_ajar.obj", 4546, 10),
        ("pandora/pandora.obj", 60810, 206),
        ("robustness/obj/issue-295-trianguation-failure.obj", 28, 1),
        ("robustness/obj/cube-vertexcol.obj", 12, 3),
        ("robustness/obj/issue-162-smoothing-group.obj", 12, 2),
        ("robustness/obj/catmark_torus_creases0.obj", 64, 1),
        ("robustness/obj/mtllib-multiple-files-issue-112.obj", 1, 1),
    ];
    for (path, count, materials) in scenes {
        let Some(scene) = shared(path, 1.0) else { continue };
        let found: usize = (0..scene.surfaces.len()).map(|surface| triangles(&scene, surface).len()).sum();
        println!("{path}: {found} triangles, {:?}", codes(&scene));
        assert_eq!((found, scene.materials.len()), (count, materials), "{path}");
    }
}

#[test]
fn shared_scenes_keep_textures_units_and_areas() {
    if let Some(scene) = shared("veach_ajar_obj/veach_ajar.obj", 1.0) {
        assert_eq!((scene.images.len(), scene.nodes.len(), codes(&scene).len()), (3, 16, 0));
        assert_eq!(scene.materials.iter().filter(|material| material.base_texture.is_some()).count(), 3);
    }
    if let Some(scene) = shared("cornell_box/cornell_box.obj", 0.001) {
        let light = scene.materials.iter().position(|material| material.emission[0] > 0.0).unwrap();
        let surface = scene.surfaces.iter().position(|surface| surface.material == light as u32).unwrap();
        let sum: f64 = triangles(&scene, surface).iter().map(area).sum();
        assert!((sum - 0.13 * 0.105).abs() < 1e-9, "{sum}");
    }
    if let Some(scene) = shared("robustness/obj/mtllib-multiple-files-issue-112.obj", 1.0) {
        let codes: Vec<_> = codes(&scene).iter().map(|(code, count, _)| (*code, *count)).collect::<Vec<_>>();
        assert_eq!(codes, [("missing-material-file", 2), ("missing-texture", 1), ("black-texture", 1)]);
    }
    if let Some(scene) = shared("robustness/obj/issue-295-trianguation-failure.obj", 1.0) {
        // Three unit cubes in a bar: its surface is 14 unit squares.
        let sum: f64 = triangles(&scene, 0).iter().map(area).sum();
        assert!((sum - 14.0).abs() < 1e-9, "{sum}");
    }
}

#[test]
fn our_cornell_box_is_read() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let bytes = Bytes::new(std::fs::read(folder.join("cornell_box.obj")).unwrap());
    let scene = read("cornell_box.obj", bytes, &Folder(folder), 1.0).unwrap();
    assert_eq!((scene.surfaces.len(), scene.materials.len(), codes(&scene).len()), (8, 4, 0));
    let areas: Vec<f64> = (0..8).map(|surface| triangles(&scene, surface).iter().map(area).sum()).collect();
    assert!((areas[1] + areas[2] - 0.556 * 0.5592).abs() < 1e-12 && (areas[2] - 0.13 * 0.105).abs() < 1e-12);
    assert!(scene.materials[scene.surfaces[2].material as usize].emission[0] > 20.0);
}

const WHOLE: &str = "mtllib a.mtl b c.mtl\nv 0 0 0\nv 4 0 0 1 0 .5\nv 4 4 0\nv 2 1 0\nv 0 4 0\nvt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\n\
    o one\ng two three\nusemtl m\ns 1\nf 1/1/1 2/2/1 3/3/1 4/1/1 5/2/1\nf -1 -2 \\\n -3\nf 1//1 2//1 3//1\nusemtl n\nl 1 2\nf 3 2 1\n";
const MATERIALS: &str = "newmtl m\nKd 0.5 0.5 0.5\nKe 1 1 1\nd 0.5\nmap_Kd -s 1 1 1 -o 0 0 -mm 0 1 t.png\nmap_d t.png\n\
    newmtl n\nKd xyz 1 1 1\nTr 0.5\nillum 7\nmap_Ke -clamp on t.png\n";

fn mutated(text: &str, edits: &[(usize, Option<u8>)], end: usize) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    for &(at, byte) in edits {
        let at = at % bytes.len().max(1);
        match byte {
            Some(byte) => bytes.insert(at, byte),
            None => drop(bytes.remove(at)),
        }
    }
    bytes.truncate(end);
    bytes
}

fn edits() -> impl Strategy<Value = Vec<(usize, Option<u8>)>> {
    let byte = prop_oneof![any::<u8>(), prop::sample::select(b" \n\\/-0123456789.e#vfotgd".to_vec())];
    prop::collection::vec((any::<usize>(), prop::option::of(byte)), 0..12)
}

proptest! {
    #[test]
    fn damaged_files_never_panic(
        obj in edits(), mtl in edits(), obj_end in 0usize..400, mtl_end in 0usize..300, unit in prop::num::f64::ANY,
    ) {
        let obj = mutated(WHOLE, &obj, obj_end.max(100));
        let files = Files(HashMap::from([("a.mtl", mutated(MATERIALS, &mtl, mtl_end)), ("t.png", PNG.to_vec())]));
        for unit in [1.0, unit] {
            if let Ok(scene) = read("x.obj", Bytes::new(obj.clone()), &files, unit) {
                for surface in 0..scene.surfaces.len() {
                    for triangle in triangles(&scene, surface) {
                        prop_assert!(triangle.position.as_flattened().iter().all(|x| x.is_finite()));
                    }
                }
            }
        }
    }

    #[test]
    fn noise_never_panics(obj in prop::collection::vec(any::<u8>(), 0..300)) {
        let _ = read("x.obj", Bytes::new(obj), &Files::default(), 1.0);
    }
}
