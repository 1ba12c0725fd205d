//! A temporary folder with a small scene in it, and the command to use on it.

use assert_cmd::Command;
use std::path::PathBuf;
use tempfile::TempDir;

/// A folder with `box.obj`: a closed room of 2 m with a lamp under its ceiling and a table.
pub struct Workshop {
    folder: TempDir,
}

/// Sizes at which the box is solved in a blink.
pub const COARSE: [&str; 6] = ["--patch-size", "1", "--element-size", "0.25", "--cells", "4"];

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

    /// `ringlight bake box.obj` at coarse sizes.
    pub fn bake(&self, arguments: &str) -> Command {
        let mut command = self.ringlight("bake box.obj");
        command.args(COARSE).args(arguments.split_whitespace());
        command
    }

    /// A process of its own that bakes and can be killed.
    #[cfg(unix)]
    pub fn start_baking(&self, arguments: &str) -> std::process::Child {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_ringlight"));
        command.current_dir(self.folder.path()).args(["bake", "box.obj"]).args(COARSE);
        command.args(arguments.split_whitespace()).stderr(std::process::Stdio::null()).spawn().unwrap()
    }
}
