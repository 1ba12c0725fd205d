//! Materials, textures, lights and cameras of glTF, each feature in the smallest scene that shows it.

mod support;

use ringlight::scene::{Alpha, LightKind, Wrap};
use serde_json::{Value, json};
use support::{Builder, TRIANGLE, all, codes, one_triangle, scene_of, tiny_png};

#[test]
fn textures_are_transformed_and_wrapped() {
    let mut builder = Builder::default();
    let position = builder.vectors(&TRIANGLE, 3);
    let unused = builder.vectors(&[0.0; 6], 2);
    let uv = builder.vectors(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0], 2);
    let image = builder.view(&tiny_png());
    // The specification's example: the lower left quarter of the image, turned clockwise.
    let transform =
        json!({ "offset": [0, 1], "rotation": std::f64::consts::FRAC_PI_2, "scale": [0.5, 0.5], "texCoord": 1 });
    let document = json!({
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{
            "attributes": { "POSITION": position, "TEXCOORD_0": unused, "TEXCOORD_1": uv }, "material": 0,
        }] }],
        "materials": [{
            "pbrMetallicRoughness": { "metallicFactor": 0, "baseColorTexture":
                { "index": 0, "texCoord": 0, "extensions": { "KHR_texture_transform": transform } } },
            "emissiveFactor": [1, 1, 1],
            "emissiveTexture": { "index": 1, "texCoord": 1 },
        }],
        "samplers": [{ "wrapS": 33071, "wrapT": 33648, "magFilter": 9728 }],
        "textures": [{ "source": 0, "sampler": 0 }, { "extensions": { "EXT_texture_webp": { "source": 0 } } }],
        "images": [{ "bufferView": image, "mimeType": "image/png" }],
    });
    let scene = scene_of(builder, document);
    let triangle = all(&scene)[0];
    for (uv, expected) in triangle.base_uv.iter().zip([[0.0, 1.0], [0.0, 0.5], [0.5, 1.0]]) {
        assert!((uv[0] - expected[0]).abs() < 1e-6 && (uv[1] - expected[1]).abs() < 1e-6, "{uv:?} {expected:?}");
    }
    assert_eq!(triangle.emission_uv, [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]);
    let base = scene.materials[0].base_texture.expect("a texture");
    assert_eq!((base.wrap, base.nearest), ([Wrap::Clamp, Wrap::Mirror], true));
    let emission = scene.materials[0].emission_texture.expect("a texture");
    assert_eq!((emission.wrap, emission.nearest, emission.image), ([Wrap::Repeat; 2], false, 0));
    assert_eq!((scene.images.len(), scene.images[0].media_type.as_str()), (1, "image/png"));
}

#[test]
fn textures_that_are_missing_leave_the_factor() {
    let material = |image: Value| {
        let mut builder = Builder::default();
        let position = builder.vectors(&TRIANGLE, 3);
        let document = json!({
            "nodes": [{ "mesh": 0 }],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": position }, "material": 0 }] }],
            "materials": [{ "pbrMetallicRoughness":
                { "metallicFactor": 0, "baseColorFactor": [0.5, 0.25, 0.125, 1.0], "baseColorTexture": { "index": 0 } } }],
            "textures": [{ "source": 0 }],
            "images": [image],
        });
        scene_of(builder, document)
    };
    for (image, code) in [
        (json!({ "uri": "nowhere.png" }), "missing-texture"),
        (json!({}), "missing-texture"),
        (json!({ "uri": "data:image/png;base64,AAAA" }), "unsupported-image"),
    ] {
        let scene = material(image);
        assert_eq!(codes(&scene), [code]);
        assert_eq!(scene.materials[0].base_texture, None);
        assert_eq!(scene.materials[0].base_colour, [0.5, 0.25, 0.125, 1.0]);
    }
}

#[test]
fn materials_as_far_as_diffuse_light_needs_them() {
    let scene = |materials: Value| {
        let count = materials.as_array().expect("a list").len();
        let mut builder = Builder::default();
        let position = builder.vectors(&TRIANGLE, 3);
        let primitives: Vec<Value> = (0..count)
            .map(|material| json!({ "attributes": { "POSITION": position }, "material": material }))
            .collect();
        let document =
            json!({ "nodes": [{ "mesh": 0 }], "meshes": [{ "primitives": primitives }], "materials": materials });
        scene_of(builder, document)
    };
    let scene = scene(json!([
        { "name": "lamp", "emissiveFactor": [1, 0.5, 0], "doubleSided": true, "extras": 3, "extensions":
            { "KHR_materials_emissive_strength": { "emissiveStrength": 100 }, "KHR_materials_unlit": {} } },
        { "alphaMode": "MASK", "pbrMetallicRoughness": { "metallicFactor": 0 } },
        { "alphaMode": "BLEND", "alphaCutoff": 0.1, "pbrMetallicRoughness": { "metallicFactor": 0.25 },
            "extensions": { "KHR_materials_transmission": { "transmissionFactor": 0.75 } } },
        { "pbrMetallicRoughness": { "baseColorFactor": [0.1, 0.1, 0.1, 1] }, "extensions":
            { "KHR_materials_pbrSpecularGlossiness": { "diffuseFactor": [0.5, 0.25, 0.125, 0.5] } } },
        { "pbrMetallicRoughness": { "metallicFactor": 0, "baseColorFactor": [2, -1, 0.5, 1] } },
    ]));
    let [lamp, mask, glass, glossy, wild] = &scene.materials[..] else { panic!("five materials") };
    assert_eq!((lamp.emission, lamp.double_sided, lamp.extras.clone()), ([100.0, 50.0, 0.0], true, Some(json!(3))));
    assert_eq!((mask.alpha, mask.base_colour), (Alpha::Mask(0.5), [1.0; 4]));
    assert_eq!((glass.alpha, glass.transmission), (Alpha::Blend, 0.75));
    assert_eq!(glossy.base_colour, [0.5, 0.25, 0.125, 0.5]);
    assert_eq!(wild.base_colour, [1.0, 0.0, 0.5, 1.0]);
    assert_eq!(codes(&scene), ["metal-as-diffuse", "specular-glossiness-as-diffuse", "colour-out-of-range"]);
}

#[test]
fn lights_shine_along_minus_z_of_their_node() {
    let scene = one_triangle(json!({
        "extensions": { "KHR_lights_punctual": { "lights": [
            { "name": "bulb", "type": "point", "color": [1, 0.5, 0.25], "intensity": 8, "range": 3 },
            { "type": "spot", "spot": { "outerConeAngle": 1.0471975511965976 } },
            { "type": "directional", "intensity": 1000 },
        ] } },
        "nodes": [
            { "mesh": 0, "children": [1, 2, 3] },
            { "translation": [1, 2, 3], "extensions": { "KHR_lights_punctual": { "light": 0 } } },
            { "extensions": { "KHR_lights_punctual": { "light": 1 } } },
            // A quarter turn about x turns −z down.
            { "rotation": [-std::f64::consts::FRAC_1_SQRT_2, 0.0, 0.0, std::f64::consts::FRAC_1_SQRT_2],
              "scale": [3, 3, 3], "extensions": { "KHR_lights_punctual": { "light": 2 } } },
        ],
    }));
    let [bulb, spot, sun] = &scene.lights[..] else { panic!("three lights") };
    assert_eq!((bulb.name.as_str(), bulb.intensity, bulb.node), ("bulb", [8.0, 4.0, 2.0], 1));
    assert_eq!(bulb.kind, LightKind::Point { position: [1.0, 2.0, 3.0], range: 3.0 });
    let LightKind::Spot { direction, inner_cosine, outer_cosine, range, .. } = spot.kind else { panic!("a spot") };
    assert_eq!((direction, inner_cosine, range), ([0.0, 0.0, -1.0], 1.0, f64::INFINITY));
    assert!((outer_cosine - 0.5).abs() < 1e-12);
    let LightKind::Directional { direction } = sun.kind else { panic!("a sun") };
    assert!((direction[1] + 1.0).abs() < 1e-12, "{direction:?}");
    assert_eq!(sun.intensity, [1000.0; 3]);
}

#[test]
fn cameras_lose_their_scale() {
    let scene = one_triangle(json!({
        "cameras": [
            { "type": "perspective", "perspective": { "yfov": 0.7, "aspectRatio": 1.5, "znear": 0.1 } },
            { "type": "orthographic", "name": "plan", "orthographic": { "xmag": 4, "ymag": 2, "znear": 0, "zfar": 9 } },
            { "type": "perspective", "perspective": { "yfov": 0 } },
        ],
        "nodes": [
            { "mesh": 0 }, { "name": "eye", "camera": 0, "scale": [2, 3, 4], "translation": [1, 2, 3] },
            { "camera": 1 }, { "camera": 2 },
        ],
    }));
    let [eye, plan] = &scene.cameras[..] else { panic!("two cameras") };
    assert_eq!((eye.name.as_str(), eye.vertical_field_of_view, eye.aspect), ("eye", 0.7, Some(1.5)));
    let expected = [[1., 0., 0., 0.], [0., 1., 0., 0.], [0., 0., 1., 0.], [1., 2., 3., 1.]];
    assert_eq!(eye.world, expected);
    assert_eq!((plan.name.as_str(), plan.half_height, plan.aspect), ("plan", 2.0, Some(2.0)));
    assert_eq!((scene.nodes[1].camera, scene.nodes[3].camera), (Some(0), None));
    assert_eq!(codes(&scene), ["camera-ignored"]);
}
