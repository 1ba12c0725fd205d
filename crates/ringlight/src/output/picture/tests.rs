use super::*;
use crate::output::fixture::{mixed, over_ranks, read, solve_refined};
use crate::output::scenes::{automatic, draw};
use crate::output::{Projection, View, scenes};
use crate::ring::{Rings, Routing};
use crate::scene::Material;
use crate::smooth::Smooth;
use crate::solve::Spread;
use glam::DVec3;
use std::io::Cursor;

const PERSPECTIVE: Projection = Projection::Perspective { vertical_field_of_view: 0.6 };

fn towards(eye: [f64; 3], target: [f64; 3]) -> View {
    View::towards(eye.into(), target.into(), PERSPECTIVE).unwrap()
}

/// Down on the lamp scene's floor, past the lamp.
fn floor_view() -> View {
    towards([1.3, 1.0, 1.3], [1.3, 0.0, 1.29])
}

fn options(view: View) -> PictureOptions {
    PictureOptions { samples_per_axis: 2, ..PictureOptions::new(view, 24, 16) }
}

#[test]
fn the_radiance_of_a_lit_square_is_its_reflectance_times_its_irradiance_over_pi() {
    // One element, so that there is nothing to interpolate.
    let solution = scenes::solved(scenes::LAMP_OVER_FLOOR, 10.0);
    let floor = (0..solution.mesh.patch_count() as u32)
        .map(|id| solution.mesh.patch(id))
        .find(|p| p.normal.y > 0.99 && p.area > 10.0)
        .unwrap();
    let irradiance = solution.irradiance(floor.first_element);
    assert!(irradiance[0] > 0.1);
    let picture = draw(&solution, &options(floor_view()));
    let expected = irradiance.map(|e| 0.5 * e / std::f32::consts::PI);
    for pixel in &picture.linear {
        for c in 0..3 {
            assert!((pixel[c] / expected[c] - 1.0).abs() < 1e-5, "{pixel:?} for {expected:?}");
        }
    }
}

#[test]
fn a_lamp_shows_its_own_radiance_and_nothing_shows_black() {
    let solution = scenes::solved(scenes::LAMP_OVER_FLOOR, 1.0);
    let picture = draw(&solution, &options(towards([0.0, 1.5, 0.0], [0.0, 2.0, 0.01])));
    assert!(picture.linear.iter().flatten().all(|l| (l / 10.0 - 1.0).abs() < 1e-5));
    let picture = draw(&solution, &options(towards([0.0, 3.0, 0.0], [0.0, 9.0, 0.0])));
    assert!(picture.linear.iter().all(|&l| l == [0.0; 3]) && picture.shown.iter().all(|&s| s == [0; 3]));
}

#[test]
fn the_sky_is_seen_above_the_horizon_only() {
    let mut solution = scenes::solved(scenes::LAMP_OVER_FLOOR, 1.0);
    solution.settings.sky = Some([3.0, 4.0, 5.0]);
    let picture = draw(&solution, &options(towards([0.0, 5.0, 0.0], [9.0, 5.0, 0.0])));
    assert_eq!(picture.linear[0], [3.0, 4.0, 5.0]);
    assert_eq!(picture.linear[24 * 16 - 1], [0.0; 3]);
}

#[test]
fn ambient_light_is_added_to_the_irradiance() {
    let solution = scenes::solved(scenes::LAMP_OVER_FLOOR, 1.0);
    let plain = options(floor_view());
    let ambient = PictureOptions { ambient: [2.0, 0.0, 0.0], ..plain.clone() };
    let [plain, ambient] = [plain, ambient].map(|o| draw(&solution, &o));
    for (with, without) in ambient.linear.iter().zip(&plain.linear) {
        assert!((with[0] - without[0] - 0.5 * 2.0 / std::f32::consts::PI).abs() < 1e-5);
        assert_eq!(with[1], without[1]);
    }
}

#[test]
fn half_of_what_is_behind_is_seen_through_a_surface_that_covers_half() {
    let mut solution = scenes::solved(scenes::LAMP_OVER_FLOOR, 1.0);
    // The lamp, seen from above, hides the floor; now it lets half of it through.
    let lamp = solution.description.surfaces.iter().position(|s| &*s.name == "lamp").unwrap();
    let view = options(towards([0.0, 4.0, 0.0], [0.0, 0.0, 0.01]));
    let opaque = draw(&solution, &view).linear[24 * 8 + 12];
    solution.mesh.occluder.coverage[lamp] = 0.5;
    let material = solution.description.surfaces[lamp].material as usize;
    solution.description.materials[material].transmission = 0.5;
    let through = draw(&solution, &view).linear[24 * 8 + 12];
    let floor = draw(&solution, &options(towards([0.0, 1.9, 0.0], [0.0, 0.0, 0.01]))).linear[24 * 8 + 12];
    for c in 0..3 {
        assert!((through[c] - opaque[c] - 0.5 * floor[c]).abs() < 0.02 * floor[c], "{through:?} {opaque:?} {floor:?}");
    }
}

#[test]
fn the_picture_is_the_same_on_one_thread_and_on_two() {
    let solution = scenes::solved(scenes::ROOM, 1.0);
    let files = [1, 2].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let view = automatic(&solution, 1.5);
            let picture = draw(&solution, &options(view));
            let mut bytes = Vec::new();
            write_png(&picture, &mut bytes).unwrap();
            let mut exr = Cursor::new(Vec::new());
            write_exr(&picture, &mut exr).unwrap();
            (bytes, exr.into_inner())
        })
    });
    assert_eq!(files[0], files[1]);
}

/// The room with a wall on its floor, which cuts corners of the floor's elements off from each other.
fn room_with_wall() -> Solution {
    scenes::solved(&(scenes::ROOM.to_owned() + WALL), 0.5)
}

const WALL: &str = "v 11 0 3\nv 13 0 3\nv 13 1 3\nv 11 1 3\nusemtl grey\no screen\nf -4 -3 -2 -1\n";

/// Lets half of the light through the surfaces of this name.
fn make_see_through(solution: &mut Solution, name: &str) {
    let surface = solution.description.surfaces.iter().position(|s| &*s.name == name).unwrap();
    solution.mesh.occluder.coverage[surface] = 0.5;
    let shared = solution.description.surfaces[surface].material as usize;
    let material = Material { transmission: 0.5, ..solution.description.materials[shared].clone() };
    solution.description.surfaces[surface].material = solution.description.materials.len() as u32;
    solution.description.materials.push(material);
}

#[test]
fn the_picture_is_the_same_on_one_rank_and_on_many_however_it_is_divided() {
    let opaque = room_with_wall();
    let mut see_through = opaque.clone();
    make_see_through(&mut see_through, "screen");
    let mixed = solve_refined(read(&(scenes::ROOM.to_owned() + WALL)), [1.0, 0.5], 0.01, mixed([1, 2, 4]));
    for solution in [opaque, see_through, mixed] {
        let smooth = Smooth::new(&solution);
        let split = (0..solution.mesh.element_count() as u32).filter(|&element| smooth.is_split(element)).count();
        assert!(split > 0, "a wall cuts corners off");
        let one = draw(&solution, &options(automatic(&solution, 1.5)));
        let over = |ranks, rings| Spread::new(Rings::new(ranks, rings).unwrap());
        let small = Spread { routing: Routing::All, packet_size: 7, window: 2, ..over(4, 1) };
        let spreads =
            [over(1, 1), over(2, 1), over(2, 2), over(3, 1), over(3, 2), over(3, 3), over(8, 1), over(8, 3), small];
        for (spread, split) in spreads.iter().flat_map(|s| [Split::Tiles, Split::Scanlines].map(|split| (s, split))) {
            let drawn = over_ranks(&solution, spread, |ring, ranks| {
                let view = View::automatic(&solution, 1.5, ring, ranks)?;
                render(&solution, &PictureOptions { split, ..options(view) }, ring, ranks)
            });
            let Drawn { picture, loads, .. } = drawn.unwrap();
            assert!(picture == one, "{split:?} {spread:?}");
            assert_eq!(loads.len(), spread.rings.ranks());
            assert_eq!(loads.iter().map(|load| load.pixels).sum::<u64>(), 24 * 16);
            assert!(loads.iter().map(|load| load.searched).sum::<u64>() > 0);
        }
    }
}

#[test]
fn a_see_through_surface_takes_a_ray_more() {
    let opaque = room_with_wall();
    let mut see_through = opaque.clone();
    make_see_through(&mut see_through, "screen");
    let rays = [opaque, see_through].map(|solution| {
        let spread = Spread::new(Rings::new(2, 1).unwrap());
        // Straight at the screen, which fills the picture.
        let view = towards([12.0, 0.5, 4.0], [12.0, 0.5, 3.0]);
        let drawn = over_ranks(&solution, &spread, |ring, ranks| render(&solution, &options(view), ring, ranks));
        drawn.unwrap().loads.iter().map(|load| load.rays).sum::<u64>()
    });
    let samples = 24 * 16 * 5;
    assert_eq!(rays, [samples, 2 * samples], "four of each pixel and one of the rough picture");
}

#[test]
fn each_rank_keeps_its_share_of_the_light_between_the_samples() {
    // Walls in many pieces, as models have them: of one facet each, a rank would have at least one.
    let solution = scenes::solved(&tiled_floor(48), 1.0);
    let kept = |ranks: usize| {
        let spread = Spread::new(Rings::one(ranks));
        let drawn = over_ranks(&solution, &spread, |ring, ranks| {
            render(&solution, &options(towards([24.0, 30.0, 24.0], [24.0, 0.0, 24.01])), ring, ranks)
        });
        let most = |of: fn(&PictureLoad) -> u64, loads: &[PictureLoad]| loads.iter().map(of).max().unwrap();
        let loads = drawn.unwrap().loads;
        [most(|load| load.light_bytes, &loads), most(|load| load.light_bytes_while_found, &loads)]
    };
    let whole = kept(1);
    for ranks in [2, 3, 8] {
        let [light, while_found] = kept(ranks);
        let share = whole.map(|bytes| bytes as f64 / ranks as f64);
        assert!((light as f64) < 1.02 * share[0], "{light} of {} on {ranks}", whole[0]);
        // With that of the facets around.
        assert!((while_found as f64) < 1.5 * share[1], "{while_found} of {} on {ranks}", whole[1]);
    }
}

/// So many by so many separate squares of a metre, and a lamp above them.
fn tiled_floor(side: u32) -> String {
    let mut obj = String::from("o floor\nusemtl grey\n");
    for (x, z) in (0..side).flat_map(|x| (0..side).map(move |z| (x, z))) {
        let corners = [(x, z), (x, z + 1), (x + 1, z + 1), (x + 1, z)];
        obj += &corners.map(|(x, z)| format!("v {x} 0 {z}\n")).concat();
        obj += "f -4 -3 -2 -1\n";
    }
    obj + "v 20 9 20\nv 28 9 20\nv 28 9 28\nv 20 9 28\no lamp\nusemtl lamp\nf -4 -3 -2 -1\n"
}

#[test]
fn a_lamps_edge_is_as_smooth_as_any_other() {
    let solution = scenes::solved(scenes::LAMP_OVER_FLOOR, 1.0);
    // The lamp's edge, seen from below; half of the picture is nothing.
    let view = towards([0.507, 0.5, 0.0], [0.5, 2.0, 0.0]);
    let picture = draw(&solution, &PictureOptions::new(view, 24, 16));
    let mut shades: Vec<u8> = picture.shown.iter().map(|s| s[0]).collect();
    shades.sort();
    shades.dedup();
    assert!(shades.len() > 2 && shades.first() == Some(&0), "{shades:?}");
}

#[test]
fn files_hold_what_the_picture_holds() {
    let solution = scenes::solved(scenes::ROOM, 1.0);
    let view = automatic(&solution, 1.5);
    let picture = draw(&solution, &options(view));
    let mut png = Vec::new();
    write_png(&picture, &mut png).unwrap();
    let read = image::load_from_memory(&png).unwrap().into_rgb8();
    assert_eq!(read.dimensions(), (24, 16));
    assert_eq!(read.as_raw().as_slice(), picture.shown.as_flattened());
    let mut bytes = Cursor::new(Vec::new());
    write_exr(&picture, &mut bytes).unwrap();
    bytes.set_position(0);
    use exr::prelude::*;
    let read = exr::image::read::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| (size.width(), vec![[0.0f32; 3]; size.area()]),
            |(width, pixels), at, (r, g, b): (f32, f32, f32)| pixels[at.y() * *width + at.x()] = [r, g, b],
        )
        .first_valid_layer()
        .all_attributes()
        .from_buffered(bytes)
        .unwrap();
    assert_eq!(read.layer_data.channel_data.pixels.1, picture.linear);
}

#[test]
fn the_legend_has_the_range_of_the_illuminance_in_the_picture() {
    let solution = scenes::solved(scenes::ROOM, 1.0);
    let view = automatic(&solution, 1.5);
    let plain = PictureOptions::new(view, 240, 160);
    let false_colour = Some(FalseColour { unit: Unit::WattsPerSquareMetre, ..FalseColour::default() });
    let picture = draw(&solution, &PictureOptions { false_colour, ..plain });
    let scale = picture.scale.unwrap();
    let brightest = (0..solution.mesh.element_count() as u32)
        .map(|e| f64::from(crate::quantity::photometric(solution.irradiance(e))))
        .fold(0.0, f64::max);
    assert!(scale.high <= 5.0 * brightest && scale.high > 0.0 && scale.unit == Unit::WattsPerSquareMetre);
    assert!(picture.shown.contains(&[255; 3]), "numbers are white");
    let lowest = Scale::colour_at(0.0).map(|x| x as u8);
    let highest = Scale::colour_at(1.0).map(|x| x as u8);
    assert!(picture.shown.contains(&lowest) && picture.shown.contains(&highest));
}

#[test]
fn every_sample_of_a_pixel_has_its_own_row_and_column() {
    for side in 1..=16 {
        let places = places(side);
        for axis in 0..2 {
            let mut along: Vec<f64> = places.iter().map(|p| p[axis]).collect();
            along.sort_by(f64::total_cmp);
            let step = 1.0 / f64::from(side * side);
            assert!(along.iter().enumerate().all(|(k, x)| (x - (k as f64 + 0.5) * step).abs() < 1e-12));
        }
    }
}

#[test]
fn an_orthographic_picture_shows_lengths_to_scale() {
    let solution = scenes::solved(scenes::LAMP_OVER_FLOOR, 1.0);
    // From below, 4 m high: the lamp of 1 m is a quarter of the picture's height.
    let projection = Projection::Orthographic { half_height: 2.0 };
    let view = View::towards(DVec3::new(0.0, 0.5, 0.0), DVec3::new(0.0, 2.0, 0.0), projection).unwrap();
    let picture = draw(&solution, &PictureOptions { samples_per_axis: 1, ..PictureOptions::new(view, 40, 40) });
    let lamp = picture.linear.iter().filter(|l| l[0] > 9.0).count();
    assert_eq!(lamp, 100);
}

#[test]
fn textures_are_shown_in_full_although_elements_know_their_mean_only() {
    let mut solution = scenes::solved(scenes::LAMP_OVER_FLOOR, 10.0);
    // Black and white halves along u.
    let mut png = Vec::new();
    let texels = image::RgbImage::from_raw(2, 1, vec![0, 0, 0, 255, 255, 255]).unwrap();
    texels.write_to(&mut Cursor::new(&mut png), image::ImageFormat::Png).unwrap();
    solution.images = vec![Some(crate::resources::Bytes::new(png))];
    let (name, media_type) = ("halves.png".into(), "image/png".into());
    solution.description.images = vec![crate::solution::ImageReference { name, media_type, hash: String::new() }];
    let wrap = [crate::scene::Wrap::Clamp; 2];
    let surface = solution.description.surfaces.iter().position(|s| &*s.name == "floor").unwrap();
    let material = solution.description.surfaces[surface].material as usize;
    let texture = crate::scene::Texture { image: 0, wrap, nearest: true };
    solution.description.materials[material].base_texture = Some(texture);
    // u grows with x.
    let facet = solution.mesh.facets.iter_mut().find(|f| f.surface as usize == surface).unwrap();
    solution.mesh.base_uv = vec![facet.corners.map(|c| [(c.x + 2.0) / 4.2, 0.0])].into();
    facet.base_uv = 0;
    let view = towards([0.1, 1.0, 0.9], [0.1, 0.0, 0.89]);
    let picture = draw(&solution, &options(view));
    let row = &picture.linear[24 * 8..24 * 9];
    assert!(row[..12].iter().all(|l| *l == [0.0; 3]), "{row:?}");
    assert!(row[12..].iter().all(|l| l[0] > 0.1 && (l[0] / row[12][0] - 1.0).abs() < 1e-3), "{row:?}");
    // Without its image the texture is left out.
    solution.images = vec![None];
    assert!(draw(&solution, &options(view)).linear[24 * 8][0] > 0.1);
}

#[test]
fn a_front_is_seen_although_another_surfaces_back_lies_in_the_same_place() {
    let square = "v -1 0 1\nv 1 0 1\nv 1 0 -1\nv -1 0 -1\n";
    for obj in [
        "o down\nusemtl grey\nf 4 3 2 1\no up\nusemtl lamp\nf 1 2 3 4\n",
        "o up\nusemtl lamp\nf 1 2 3 4\no down\nusemtl grey\nf 4 3 2 1\n",
    ] {
        let mut scene = crate::output::fixture::read(&format!("{square}{obj}"));
        scene.materials.iter_mut().for_each(|m| m.double_sided = false);
        let solution = crate::output::fixture::solve(scene, 1.0, 0.01);
        let above = draw(&solution, &options(towards([0.1, 1.0, 0.1], [0.1, 0.0, 0.09])));
        assert!(above.linear.iter().all(|l| (l[0] / 10.0 - 1.0).abs() < 1e-5));
        let below = draw(&solution, &options(towards([0.1, -1.0, 0.1], [0.1, 0.0, 0.09])));
        assert!(below.linear.iter().all(|l| *l == [0.0; 3]));
    }
}
