//! A temporary folder with a small scene in it, and the command to use on it.

use assert_cmd::Command;
use std::path::PathBuf;
use tempfile::TempDir;

/// A folder with `box.obj`: a closed room of 2 m with a lamp under its ceiling and a table.
pub struct Workshop {
    folder: TempDir,
}

/// Sizes at which the box is solved in a blink, by plain refinement.
pub const COARSE: [&str; 8] = ["--solver", "plain", "--cells", "4", "--patch-size", "1", "--element-size", "0.25"];

/// Sizes at which the box keeps plain refinement busy, with `--until 0`, until it is stopped.
pub const ENDLESS: [&str; 8] = ["--solver", "plain", "--cells", "4", "--patch-size", "0.2", "--element-size", "0.1"];

/// What reads a solution or a scene, and the endings of what it writes.
pub const READERS: [(&str, &[&str]); 6] = [
    ("probe part.ringlight --points points.csv", &["csv"]),
    ("probe part.ringlight --points points.csv --how surface", &["csv"]),
    ("probe part.ringlight --grid table@0.2", &["png", "csv"]),
    ("render part.ringlight --size 64x40", &["png", "exr"]),
    ("export part.ringlight --size 48x32 --false-colour lux", &["glb", "vtu", "png"]),
    ("viewfactors box.obj --per face", &["csv", "npy"]),
];

const MATERIALS: &str = "\
newmtl white
Kd 0.7 0.6 0.5
newmtl lamp
Kd 0.1 0.1 0.1
Ke 10 9 8
";

const BOX: &str = "\
mtllib box.mtl
v 0 0 0
v 2 0 0
v 2 0 2
v 0 0 2
v 0 2 0
v 2 2 0
v 2 2 2
v 0 2 2
v 0.8 1.9 0.8
v 1.2 1.9 0.8
v 1.2 1.9 1.2
v 0.8 1.9 1.2
v 0.5 0.7 0.5
v 1.5 0.7 0.5
v 1.5 0.7 1.5
v 0.5 0.7 1.5
g room
usemtl white
f 1 4 3 2
f 5 6 7 8
f 1 2 6 5
f 4 8 7 3
f 1 5 8 4
f 2 3 7 6
g table
f 13 16 15 14
g lamp
usemtl lamp
f 9 10 11 12
";

impl Workshop {
    pub fn new() -> Workshop {
        let workshop = Workshop { folder: tempfile::tempdir().unwrap() };
        workshop.put("box.obj", BOX);
        workshop.put("box.mtl", MATERIALS);
        workshop
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn put(&self, name: &str, content: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), content).unwrap();
    }

    pub fn bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap()
    }

    pub fn json(&self, name: &str) -> serde_json::Value {
        serde_json::from_slice(&self.bytes(name)).unwrap()
    }

    /// All files in the folder, hidden ones too, sorted.
    pub fn files(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.folder.path()).unwrap();
        let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// `ringlight` with arguments separated by spaces, run in the folder.
    pub fn ringlight(&self, arguments: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_ringlight"));
        command.current_dir(self.folder.path()).args(arguments.split_whitespace());
        command.timeout(std::time::Duration::from_secs(120));
        command
    }

    /// `ringlight bake box.obj` at coarse sizes, by plain refinement.
    pub fn bake(&self, arguments: &str) -> Command {
        let mut command = self.ringlight("bake box.obj");
        command.args(COARSE).args(arguments.split_whitespace());
        command
    }

    /// The same with sizes at which it goes on for long.
    pub fn bake_endlessly(&self, arguments: &str) -> Command {
        let mut command = self.ringlight("bake box.obj --until 0");
        command.args(ENDLESS).args(arguments.split_whitespace());
        command
    }

    /// What `ringlight inspect box.obj` foretells.
    pub fn inspect(&self, arguments: &str) -> serde_json::Value {
        let run = self.ringlight(&format!("inspect box.obj --json --rays-per-second 1e6 {arguments}")).assert().code(0);
        serde_json::from_slice(&run.get_output().stdout).unwrap()
    }

    /// A solution `part.ringlight` and a table `points.csv` to probe it at.
    pub fn prepare_readers(&self) {
        self.bake("-o part.ringlight --until 0.05").assert().code(0);
        let row = |k: u32| {
            let [x, y, z] = [0.618, 0.755, 0.57].map(|step| 0.1 + 1.8 * (f64::from(k) * step).fract());
            if k.is_multiple_of(2) { format!("{x},0,{z},0,1,0\n") } else { format!("{x},{y},{z},0.5,-1,0.25\n") }
        };
        self.put("points.csv", "x,y,z,nx,ny,nz\n".to_owned() + &(0..150).map(row).collect::<String>());
    }

    /// Flags for outputs of one name with these endings.
    pub fn named(endings: &[&str], name: &str) -> String {
        endings.iter().map(|ending| format!("-o {name}.{ending} ")).collect()
    }

    /// A process of its own that bakes and can be killed.
    #[cfg(unix)]
    pub fn start_baking_endlessly(&self, arguments: &str) -> std::process::Child {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_ringlight"));
        command.current_dir(self.folder.path()).args(["bake", "box.obj", "--until", "0"]).args(ENDLESS);
        command.args(arguments.split_whitespace()).stderr(std::process::Stdio::null()).spawn().unwrap()
    }
}
