//! What stands after the flags in the help texts.

/// Of the command.
pub const EXAMPLES: &str = "\
Examples:
  ringlight bake office.glb -o office-lit.glb -o office.png   bake a model and draw it
  ringlight inspect office.glb                                what is in it, how long it will take
  ringlight bake --help                                       every flag

Exit codes: 0 converged or --max-shots reached, 1 error, 2 usage, 3 bad scene, 4 stopped by --time-limit, from the page or for want of memory with valid
output, 130 interrupted and 143 terminated, both with valid output.";

/// Of `bake`.
pub const BAKE_EXAMPLES: &str = "\
Examples:
  ringlight bake office.glb -o office-lit.glb
  ringlight bake office.glb -o office.ringlight -o office.png --camera desk --report office.json
  ringlight bake office.glb -o office.ringlight --error 0.003                     finer than by default
  ringlight bake office.glb -o office.ringlight --solver plain --until 0.001      the paper's method
  ringlight bake house.obj --unit cm --sky 3000 -o house.csv --quality draft
  ringlight bake church.glb -o church.ringlight --checkpoint church-part.ringlight@30 --time-limit 3600
  mpirun -n 8 ringlight bake city.glb -o city.ringlight --memory-per-rank 4GiB      needs a build with MPI";

/// Of `resume`.
pub const RESUME_EXAMPLES: &str = "\
Examples:
  ringlight resume church-part.ringlight -o church.ringlight -o church-lit.glb --scene church.glb
  ringlight resume plain.ringlight --until 0.001 -o plain-finer.ringlight       what --solver plain has begun";

/// Of `export`.
pub const EXPORT_EXAMPLES: &str = "\
Examples:
  ringlight export office.ringlight -o office.csv -o office.vtu
  ringlight export office.ringlight -o office-lit.glb --scene office.glb --exposure 9";

/// Of `render`.
pub const RENDER_EXAMPLES: &str = "\
Examples:
  ringlight render office.ringlight -o desk.png --camera desk
  ringlight render office.ringlight -o lux.png --false-colour lux --camera '3,1.6,4;0,1,0;60' --size 1920x1080";

/// Of `probe`.
pub const PROBE_EXAMPLES: &str = "\
Points are a CSV file with a header and the columns x,y,z (world coordinates in metres, also where the scene was an OBJ file
in another unit) and nx,ny,nz (a normal of any length), in any order; other columns are ignored. Out comes CSV with
x,y,z,nx,ny,nz,e_r,e_g,e_b,e,status. The status is ok; inside (in solid geometry, or behind surfaces); or, with --how surface,
far. Without ok the columns e_* are empty.

Examples:
  ringlight probe office.ringlight --points desks.csv -o lux.csv
  ringlight probe office.ringlight --grid floor@0.25 --height 0.75 -o plane.png -o plane.csv
  ringlight probe office.ringlight --grid '0.5,0.75,0.5;5.5,0.75,3.5@0.25'
  ringlight probe office.ringlight --points centres.csv -o shown.csv --how surface";

/// Of `inspect`.
pub const INSPECT_EXAMPLES: &str = "\
Examples:
  ringlight inspect office.glb
  ringlight inspect office.glb --quality high --json";

/// Of `viewfactors`.
pub const VIEW_FACTOR_EXAMPLES: &str = "\
Faces see from their front, from which their corners run counter-clockwise; all faces block from both sides.

Examples:
  ringlight viewfactors room.obj -o F.csv                             a row for each object
  ringlight viewfactors room.obj -o F.csv --per face --errors E.csv   a row for each face, and error estimates
  ringlight viewfactors city.obj -o F.csv --per face --min 1e-5       only factors from 0.00001, a line each
  ringlight viewfactors room.glb -o F.npy --sides both --report F.json

Exit codes: 0 done, 1 error, 2 usage, 3 bad scene, 130 interrupted and 143 terminated, both without output.";

/// Of `view`.
pub const VIEW_EXAMPLES: &str = "\
Open the link that is printed. All flags are those of bake; a solution takes those that say where it runs and is shown.

Examples:
  ringlight view office.glb
  ringlight view office.glb --quality draft -o office-lit.glb        also writes it when the light is solved
  ringlight view office.ringlight --view=0.0.0.0:8080                others may watch, who have the link";

/// Of `completions`.
pub const COMPLETIONS_EXAMPLES: &str = "\
Examples:
  ringlight completions bash > ~/.local/share/bash-completion/completions/ringlight";
