#!/usr/bin/env python3
"""Shows that a solution does not depend on ranks, rings, threads, packets, sharding, routing or transport.

  sameness.py [--launch threads,mpi] [--only NAME,...] [--shared FOLDER] [--quick]

Bakes scenes with few shots, at first on one rank, and compares the digest and all bytes of the solution of every other run
with that one's. For each scene: all N in 2, 3, 4, 6, 8, 16 with all R from 1 to N, with threads as ranks and with MPI; and
all pairs of the values of all options below. --quick leaves out all N and R but those of the pairs. Shared scenes lie in
`../shared/scenes` or the folder that is given; what is missing is said.

Prints a line of CSV a run and, behind #, a summary. The exit code is 1 if any run failed or differs.

Environment: RINGLIGHT the command (default: target/release/ringlight of this repository), built with `--features mpi` for
runs with MPI; MPIRUN the launcher (default: mpirun).
"""
import argparse, hashlib, itertools, json, os, subprocess, sys, tempfile, time

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
COMMAND = os.environ.get("RINGLIGHT", os.path.join(ROOT, "target", "release", "ringlight"))
LAUNCHER = os.environ.get("MPIRUN", "mpirun")
# Open MPI refuses root and more ranks than cores unless it is told otherwise; other implementations ignore this.
ENVIRONMENT = os.environ | {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
                            "OMPI_MCA_rmaps_base_oversubscribe": "1", "OMPI_MCA_mpi_yield_when_idle": "1"}
LIMIT = 900  # seconds a run may take

# Shots; flags; whether all N and R, or only those of the pairs. The box has a sun and textures, the living room of Godot a sun
# and bulbs, the large building a sun and panes, the grey and white living room cut-outs and panes.
OWN = {
    "office.glb": (40, "--patch-size 0.95 --element-size 0.4", True),
    "gallery.glb": (60, "--patch-size 1.2 --element-size 0.4", True),
}
SHARED = {
    "bakinglab_box/bakinglab_box.gltf": (60, "--patch-size 2.2 --element-size 0.6", True),
    "godot_living_room.glb": (60, "--patch-size 3 --element-size 0.9", True),
    "bimwhale_large_building.glb": (12, "", False),
    "living_room_grey_white/living_room_grey_white.gltf": (4, "", False),
}

# Values of which every pair is tried.
OPTIONS = {
    "ranks": [(2, 1), (3, 2), (4, 1), (4, 3), (6, 1), (6, 4), (8, 3), (16, 5)],
    "launch": ["threads", "mpi"], "threads": [1, 2], "packet_size": [1, 7, 200, 4096],
    "shards": ["spatial", "random"], "routing": ["boxes", "all"], "shooters_in_flight": [1, 3],
}
COLUMNS = ["scene", "launch", "ranks", "rings", "threads", "packet_size", "shards", "routing", "shooters_in_flight"]


def pairs(options):
    """Few combinations that hold every pair of values of two options: each time the one with most pairs not yet seen."""
    names = list(options)
    seen_in = lambda run: {((a, run[a]), (b, run[b])) for a, b in itertools.combinations(names, 2)}
    every = [dict(zip(names, values)) for values in itertools.product(*options.values())]
    missing, runs = set().union(*map(seen_in, every)), []
    while missing:
        runs.append(max(every, key=lambda run: len(seen_in(run) & missing)))
        missing -= seen_in(runs[-1])
    return runs


def bake(scene, shots, flags, run, folder):
    """Bakes; the digest that the report tells and a hash of the file, or what went wrong."""
    solution, report = os.path.join(folder, "a.ringlight"), os.path.join(folder, "a.json")
    line = [COMMAND, "bake", scene, "--quality", "draft", "--solver", "plain", "--max-shots", str(shots), "--until", "0",
            "--quiet", "--force", "-o", solution, "--report", report] + flags.split()
    for flag in ("rings", "threads", "packet_size", "shards", "routing", "shooters_in_flight"):
        if run.get(flag) is not None:
            line += ["--" + flag.replace("_", "-"), str(run[flag])]
    if run["launch"] == "mpi":
        line = [LAUNCHER, "-n", str(run["ranks"])] + line
    else:
        line += ["--ranks", str(run["ranks"])]
    for file in (solution, report):
        if os.path.exists(file):
            os.remove(file)
    try:
        done = subprocess.run(line, env=ENVIRONMENT, capture_output=True, text=True, timeout=LIMIT)
    except subprocess.TimeoutExpired:
        return None, f"did not end within {LIMIT} s"
    if done.returncode != 0:
        return None, f"exit code {done.returncode}: {' '.join((done.stdout + done.stderr).split())[:300]}"
    with open(report) as file:
        told = json.load(file)
    if len(told["ranks"]) != run["ranks"] or told["solve"]["shots"] != shots:
        return None, f"{len(told['ranks'])} ranks made {told['solve']['shots']} shots"
    with open(solution, "rb") as file:
        return (told["solution_digest"], hashlib.sha256(file.read()).hexdigest()), ""


def compare(scene, shots, flags, all_rings, launches, folder):
    """Makes all runs of a scene; how many are the same, and how many are not."""
    name = os.path.basename(scene)
    alone = {"launch": "threads", "ranks": 1, "rings": 1, "threads": 1}
    expected, same, other = {}, 0, 0
    runs = [alone | {"shooters_in_flight": k} for k in OPTIONS["shooters_in_flight"]]
    runs += [alone | {"threads": 2}] + [alone | {"launch": "mpi"}] * ("mpi" in launches)
    if all_rings:
        runs += [{"launch": launch, "ranks": ranks, "rings": rings} for launch in launches
                 for ranks in (2, 3, 4, 6, 8, 16) for rings in range(1, ranks + 1)]
    for run in pairs(OPTIONS | {"launch": launches}):
        runs.append(run | dict(zip(("ranks", "rings"), run["ranks"])))
    for run in runs:
        start = time.monotonic()
        found, words = bake(scene, shots, flags, run, folder)
        took = time.monotonic() - start
        first = expected.setdefault(run.get("shooters_in_flight", 1), found)
        if found is None or found != first:
            other, words = other + 1, words or "DIFFERS"
        else:
            same, words = same + 1, "same"
        digests = [part[:16] for part in found or ("", "")]
        row = [name] + [run.get(key, "default") for key in COLUMNS[1:]] + digests + [f"{took:.1f}", words]
        print(",".join(f'"{x}"' if "," in str(x) else str(x) for x in row), flush=True)
    print(f"# {name}: {shots} shots, {same} runs the same, {other} not", flush=True)
    return same, other


parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--launch", default="threads,mpi", type=lambda words: words.split(","))
parser.add_argument("--only", help="scenes whose path contains one of these words")
parser.add_argument("--shared", default=os.path.join(ROOT, "..", "shared", "scenes"))
parser.add_argument("--quick", action="store_true")
arguments = parser.parse_args()

scenes = [(os.path.join(ROOT, "scenes", name), *how) for name, how in OWN.items()]
scenes += [(os.path.join(arguments.shared, name), *how) for name, how in SHARED.items()]
print(",".join(COLUMNS + ["digest", "sha256", "seconds", "result"]))
total = [0, 0]
for scene, shots, flags, all_rings in scenes:
    if arguments.only and not any(word in scene for word in arguments.only.split(",")):
        continue
    if not os.path.exists(scene):
        print(f"# {os.path.basename(scene)}: left out, because it is not there")
        continue
    with tempfile.TemporaryDirectory() as folder:
        counts = compare(scene, shots, flags, all_rings and not arguments.quick, arguments.launch, folder)
    total = [a + b for a, b in zip(total, counts)]
print(f"# all: {total[0]} runs the same, {total[1]} not")
sys.exit(total[1] > 0 or total[0] == 0)
