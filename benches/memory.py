#!/usr/bin/env python3
"""Bakes generated scenes on one rank and on many MPI ranks, and prints how much private memory each took.

  memory.py [--triangles N] [--forms glb,nodes,obj] [--ranks N] [--folder DIR] [--results FILE] [-- FLAGS]

Scenes are made in the folder (default: a temporary one) if they are missing, by `cargo xtask large-scene`. The one rank keeps
what is large in scratch files, as many ranks do. For each scene the largest rank's peak is held against
1.3 × (one rank alone) / ranks + 50 MiB; the exit code is 1 if one is above. Lines are appended to the results, if given.

Environment: RINGLIGHT the command, built with the feature mpi (default: target/release/ringlight of this repository).
FLAGS go to `bake`. Peaks are of private memory (RssAnon), sampled, as reports tell them; they do not depend on how busy the
machine is.
"""
import argparse, csv, json, os, subprocess, sys, tempfile

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
COMMAND = os.environ.get("RINGLIGHT", os.path.join(ROOT, "target", "release", "ringlight"))
COLUMNS = ["form", "triangles", "elements", "shots", "ranks", "foretold_mib", "peak_mib_alone", "peak_mib_first", "peak_mib_most",
           "allowed_mib", "same_solution"]
MIB = 2**20


def scene(folder, form, triangles):
    path = os.path.join(folder, f"{triangles}-{form}.{'obj' if form == 'obj' else 'glb'}")
    if not os.path.exists(path):
        make = ["cargo", "run", "--release", "--quiet", "--package", "xtask", "--", "large-scene", str(triangles), form, path]
        subprocess.run(make, cwd=ROOT, check=True)
    return path


def bake(path, folder, ranks, flags):
    """What the report says of a run on so many ranks."""
    report, solution = os.path.join(folder, "report.json"), os.path.join(folder, "out.ringlight")
    run = [COMMAND, "bake", path, "-o", solution, "--report", report, "--scratch", folder, "--quality", "draft",
           "--solver", "plain", "--max-shots", "3", "--quiet", "--force"] + flags
    environment = dict(os.environ, OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1",
                       OMPI_MCA_rmaps_base_oversubscribe="1", OMPI_MCA_mpi_yield_when_idle="1")
    if ranks > 1:
        run = ["mpirun", "-n", str(ranks)] + run + ["--rings", "1"]
    subprocess.run(run, env=environment, check=True, stdout=subprocess.DEVNULL)
    with open(report) as file:
        return json.load(file)


def foretold(path, folder, ranks):
    """The memory of each of so many ranks in one ring, as `inspect` foretells it, MiB; none if it does not."""
    run = [COMMAND, "inspect", path, "--json", "--solver", "plain", "--quality", "draft", "--scratch", folder,
           "--rays-per-second", "1e6"]
    found = json.loads(subprocess.run(run, check=True, capture_output=True).stdout)["memory_per_rank"]
    fitting = [m["bytes"] / MIB for m in found if (m["ranks"], m["rings"]) == (ranks, 1)]
    return round(fitting[0], 1) if fitting else None


def measure(form, arguments, folder, flags):
    path = scene(folder, form, arguments.triangles)
    alone, many = (bake(path, folder, ranks, flags) for ranks in (1, arguments.ranks))
    peaks = [rank["peak_memory_bytes"] / MIB for rank in many["ranks"]]
    total = alone["peak_memory_bytes"] / MIB
    return {
        "form": form, "triangles": many["scene"]["triangles"], "elements": many["scene"]["elements"],
        "shots": many["solve"]["shots"], "ranks": arguments.ranks, "foretold_mib": foretold(path, folder, arguments.ranks),
        "peak_mib_alone": round(total, 1), "peak_mib_first": round(peaks[0], 1), "peak_mib_most": round(max(peaks), 1),
        "allowed_mib": round(1.3 * total / arguments.ranks + 50, 1),
        "same_solution": alone["solution_digest"] == many["solution_digest"],
    }


parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--triangles", type=int, default=1_000_000)
parser.add_argument("--forms", default="glb,nodes,obj")
parser.add_argument("--ranks", type=int, default=8)
parser.add_argument("--folder")
parser.add_argument("--results")
split = sys.argv.index("--") if "--" in sys.argv else len(sys.argv)
arguments, flags = parser.parse_args(sys.argv[1:split]), sys.argv[split + 1:]
fine = True
print(*(f"{column:>15}" for column in COLUMNS))
with tempfile.TemporaryDirectory() as temporary:
    folder = arguments.folder or temporary
    for form in arguments.forms.split(","):
        line = measure(form, arguments, folder, flags)
        fine &= line["peak_mib_most"] <= line["allowed_mib"] and line["same_solution"]
        print(*(f"{line[column]!s:>15}" for column in COLUMNS), flush=True)
        if arguments.results:
            new = not os.path.exists(arguments.results)
            with open(arguments.results, "a", newline="") as file:
                writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
                writer.writerows(([dict(zip(COLUMNS, COLUMNS))] if new else []) + [line])
sys.exit(0 if fine else 1)
