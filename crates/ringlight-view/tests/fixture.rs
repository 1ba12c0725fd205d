//! A round as the server sends it, kept in `viewer/tests/round.bin`, from which the page's tests read it: so both sides of the
//! protocol are held to the same bytes.

use ringlight::column::Store;
use ringlight::mesh::{self, Mesh, MeshOptions};
use ringlight::resources::{Bytes, Resources};
use ringlight::scene::{self, ReadOptions, Wrap};
use ringlight::shooting::ElementLight;
use ringlight_view::protocol::{self, Camera, Hello, Load, Status, Surface, Texture};
use ringlight_view::{Server, display};
use std::path::Path;
use std::sync::Arc;
use tungstenite::Message;
use tungstenite::client::IntoClientRequest;

/// A floor with a board lying in it, so that one covers the other there, and a triangular lamp above.
const SCENE: &str = "\
mtllib scene.mtl
v 0 0 0
v 2 0 0
v 2 0 -1
v 0 0 -1
v 0.5 1 -0.5
v 1 1 -0.5
v 0.5 1 -0.75
v 0.5 0 0
v 0.5 0 -1
vt 0 0
vt 2 0
vt 2 1
vt 0 1
g floor
usemtl tiles
f 1/1 2/2 3/3 4/4
g lamp
usemtl lamp
f 5 7 6
g board
usemtl grey
f 1 8 9 4
";

const MATERIALS: &str = "newmtl grey\nKd 0.25 0.5 0.75\nnewmtl lamp\nKd 0.1 0.1 0.1\nKe 100 200 300\n\
    newmtl tiles\nKd 0.25 0.5 0.75\nmap_Kd white.png\n";

/// One white pixel.
const WHITE: &[u8] = &[
    137, 80, 78, 71, 13, 10, 26, 10, 0, 0, 0, 13, 73, 72, 68, 82, 0, 0, 0, 1, 0, 0, 0, 1, 8, 2, 0, 0, 0, 144, 119, 83,
    222, 0, 0, 0, 12, 73, 68, 65, 84, 120, 156, 99, 248, 255, 255, 63, 0, 5, 254, 2, 254, 13, 239, 70, 184, 0, 0, 0, 0,
    73, 69, 78, 68, 174, 66, 96, 130,
];

struct Materials;

impl Resources for Materials {
    fn read(&self, path: &str) -> std::io::Result<Bytes> {
        Ok(Bytes::new(if path == "white.png" { WHITE } else { MATERIALS.as_bytes() }))
    }
}

fn mesh() -> (Mesh, Vec<Surface>) {
    let bytes = Bytes::new(SCENE.as_bytes().to_vec());
    let scene = scene::read("scene.obj", bytes, &Materials, &ReadOptions::default()).unwrap();
    let options = MeshOptions { patch_size: Some(1.0), element_size: Some(0.5), ..MeshOptions::default() };
    let mut mesh = mesh::build(&scene, &options, Store::Heap).unwrap();
    let hierarchy = Arc::new(mesh::hierarchy(&mesh));
    mesh::find_valid_samples(&mut mesh, &hierarchy);
    let texture =
        Texture { image: 0, wrap: [Wrap::Repeat, Wrap::Mirror], nearest: true, factor: [1.0; 3], cutoff: 0.5 };
    let of = |name: &str| Surface { name: name.into(), texture: (name == "floor").then(|| texture.clone()) };
    (mesh, scene.surfaces.iter().map(|surface| of(&surface.name)).collect())
}

/// Element k has irradiance (k + 1, (k + 1)/2, 100000 + 100 k).
fn light(mesh: &Mesh, cluster: u32) -> Vec<u8> {
    let elements = mesh.clusters[cluster as usize].elements.clone();
    let of = |k: u32| [k as f32 + 1.0, (k as f32 + 1.0) / 2.0, 1e5 + 100.0 * k as f32];
    let light: Vec<_> = elements.map(|k| ElementLight { shot: of(k), ..ElementLight::default() }).collect();
    display::light(mesh, cluster, &light)
}

/// Text or binary (0 or 1), the length, and the content of each message of the first round.
fn round() -> Vec<u8> {
    let (mesh, surfaces) = mesh();
    let clusters = 0..mesh.clusters.len() as u32;
    let server = Server::open("127.0.0.1:0").unwrap();
    let stage = server.stage();
    let identity = [[1., 0., 0., 0.], [0., 1., 0., 0.], [0., 0., 1., 0.], [0., 0., 0., 1.]];
    let hello = Hello {
        protocol: protocol::VERSION,
        version: "0",
        name: "scene".into(),
        clusters: mesh.clusters.len(),
        patches: mesh.patch_count(),
        elements: mesh.element_count(),
        ranks: 3,
        until: 0.01,
        bounds: [[0.0, 0.0, -1.0], [2.0, 1.0, 0.0]],
        surfaces,
        cameras: vec![Camera { name: "eye".into(), matrix: identity, field_of_view: 1.0, half_height: 0.0 }],
        live: true,
        ..Hello::default()
    };
    stage.begin(&hello, Vec::new(), clusters.clone().map(|cluster| display::geometry(&mesh, cluster)).collect());
    stage.status(&Status { shots: 12, ranks: vec![Load { busy: 0.5, wait: 0.25 }; 3], ..Status::default() });
    stage.light(clusters.clone().map(|cluster| (cluster, light(&mesh, cluster))).collect());
    stage.places(protocol::places(&mesh, &clusters.map(|k| k % 3).collect::<Vec<_>>(), |facet| facet as usize % 3));
    let address = server.link().trim_start_matches("http://").trim_end_matches('/').to_owned();
    let mut request = format!("ws://{address}/stream").into_client_request().unwrap();
    request.headers_mut().insert("origin", format!("http://{address}").parse().unwrap());
    let (mut stream, _) = tungstenite::client(request, std::net::TcpStream::connect(&address).unwrap()).unwrap();
    let mut bytes = Vec::new();
    loop {
        let (kind, content) = match stream.read().unwrap() {
            Message::Text(text) => (0u8, text.as_bytes().to_vec()),
            Message::Binary(content) => (1, content.to_vec()),
            other => panic!("{other:?}"),
        };
        bytes.push(kind);
        bytes.extend_from_slice(&(content.len() as u32).to_le_bytes());
        bytes.extend_from_slice(&content);
        if kind == 1 && content.is_empty() {
            return bytes;
        }
    }
}

#[test]
fn the_page_is_tested_with_what_the_server_sends() {
    let (kept, found) = (Path::new(env!("CARGO_MANIFEST_DIR")).join("../../viewer/tests/round.bin"), round());
    if std::fs::read(&kept).ok().as_ref() != Some(&found) {
        let beside = Path::new(env!("CARGO_TARGET_TMPDIR")).join("round.bin");
        std::fs::write(&beside, &found).unwrap();
        panic!("the protocol has changed; if that is meant, copy {} to {}", beside.display(), kept.display());
    }
}
