use super::*;
use crate::output::scenes::{self, automatic};
use glam::Vec3Swizzles;

fn mesh() -> Mesh {
    Mesh { origin: [100.0, 0.0, 0.0], ..Mesh::default() }
}

#[test]
fn a_camera_given_as_text_is_in_world_coordinates_and_degrees() {
    let view = View::parse("100, 1.6 ,0; 100,1.6,-5 ;90", &mesh()).unwrap();
    assert_eq!(view.eye, DVec3::new(0.0, 1.6, 0.0));
    assert_eq!((view.forward, view.up, view.right), (DVec3::NEG_Z, DVec3::Y, DVec3::X));
    // At 90 degrees the upper edge is as high as it is far.
    assert!((DVec3::from(view.ray(0.0, 1.0).direction.map(f64::from)) - DVec3::new(0.0, 1.0, -1.0)).length() < 1e-6);
}

#[test]
fn looking_straight_down_has_an_upper_edge() {
    let view = View::parse("0,5,0;0,0,0;40", &mesh()).unwrap();
    assert_eq!((view.up, view.right), (DVec3::NEG_Z, DVec3::X));
}

#[test]
fn a_text_that_is_no_camera_is_refused_with_what_was_found() {
    for (text, found) in [
        ("1,2;3,4,5;40", "'1,2' has 2 numbers"),
        ("1,2,3;4,5,6", "2 parts between semicolons"),
        ("1,2,x;4,5,6;40", "'x' is not a number"),
        ("1,2,inf;4,5,6;40", "'inf' is not a number"),
        ("1,2,3;1,2,3;40", "eye and target are the same point"),
        ("1,2,3;4,5,6;180", "a field of view of 180°"),
        (";;", "'' is not a number"),
    ] {
        let error = View::parse(text, &mesh()).unwrap_err();
        assert_eq!(error, CameraError::Malformed { text: text.into(), found: found.into() });
        assert!(error.to_string().contains("expected \"ex,ey,ez;tx,ty,tz;fov\""));
    }
}

fn camera(name: &str, vertical_field_of_view: f64) -> Camera {
    let world = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 1.0, 5.0, 1.0]];
    Camera { name: name.into(), world, vertical_field_of_view, half_height: 2.0, aspect: None }
}

#[test]
fn an_unknown_name_is_refused_with_the_names_there_are() {
    let mut solution = scenes::solved(scenes::LAMP_OVER_FLOOR, 1.0);
    let error = View::choose(Some("door"), &solution).unwrap_err();
    assert!(error.to_string().starts_with("no camera is named 'door'; the scene has none"), "{error}");
    solution.description.cameras = vec![camera("window", 1.0), camera("", 0.0)];
    let error = View::choose(Some("door"), &solution).unwrap_err();
    assert!(error.to_string().contains("the scene has 'window', 'camera 1'"), "{error}");
    let view = View::choose(Some("camera 1"), &solution).unwrap().unwrap();
    assert_eq!(view.projection, Projection::Orthographic { half_height: 2.0 });
    let first = View::choose(None, &solution).unwrap().unwrap();
    assert_eq!(first.projection, Projection::Perspective { vertical_field_of_view: 1.0 });
}

#[test]
fn rays_of_an_orthographic_camera_are_parallel_and_span_its_height() {
    let view = View::of_camera(&camera("", 0.0), &Mesh::default()).unwrap();
    let (upper, lower) = (view.ray(0.5, 1.0), view.ray(0.5, -1.0));
    assert_eq!((upper.direction, lower.direction), ([0.0, 0.0, -1.0], [0.0, 0.0, -1.0]));
    assert_eq!((upper.origin, lower.origin), ([1.0, 3.0, 5.0], [1.0, -1.0, 5.0]));
}

#[test]
fn a_degenerate_camera_is_no_view() {
    let camera = Camera { world: [[0.0; 4]; 4], ..camera("", 1.0) };
    assert_eq!(View::of_camera(&camera, &Mesh::default()), None);
}

#[test]
fn the_automatic_camera_of_a_closed_room_is_inside() {
    let solution = scenes::solved(scenes::ROOM, 1.0);
    let view = automatic(&solution, 1.5);
    let eye = solution.mesh.to_world(view.eye);
    assert!(eye.cmpgt(DVec3::new(10.0, 0.0, 0.0)).all() && eye.cmplt(DVec3::new(14.0, 3.0, 5.0)).all(), "{eye}");
    assert!((eye.y - 1.6).abs() < 1e-6, "{eye}");
}

#[test]
fn the_automatic_camera_of_an_open_scene_stands_in_front_and_holds_all_of_it() {
    let solution = scenes::solved(scenes::LAMP_OVER_FLOOR, 1.0);
    let view = automatic(&solution, 1.5);
    assert!(view.eye.y > 0.0 && view.eye.xz().length() > 2.0, "{}", view.eye);
    let Projection::Perspective { vertical_field_of_view } = view.projection else { panic!("a perspective view") };
    let tangent = (vertical_field_of_view / 2.0).tan();
    for corner in solution.mesh.facets.iter().flat_map(|f| f.corners) {
        let seen = corner.as_dvec3() - view.eye;
        let depth = seen.dot(view.forward);
        assert!(depth > 0.0);
        assert!(seen.dot(view.up).abs() < tangent * depth && seen.dot(view.right).abs() < 1.5 * tangent * depth);
    }
}
