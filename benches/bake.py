#!/usr/bin/env python3
"""Bakes our own scenes (and others named on the command line) and prints what the reports say, one line a scene.

  bake.py [SCENE ...] [-- FLAGS]

Environment: RINGLIGHT the command (default: target/release/ringlight of this repository). For the office the paper's
sizes are used (4738 patches, 17251 elements), for the furnace M = 64 and --until 0.0001, with the deviation of the
radiosity from 1, which is exact. Our own scenes are baked by plain refinement. Times are of wall clock: run it on an idle machine.
"""
import csv, json, math, os, subprocess, sys, tempfile

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
COMMAND = os.environ.get("RINGLIGHT", os.path.join(ROOT, "target", "release", "ringlight"))
OWN = {
    "office.glb": ["--solver", "plain", "--patch-size", "0.475", "--element-size", "0.1945"],
    "gallery.glb": ["--solver", "plain", "--patch-size", "0.6", "--element-size", "0.19"],
    "furnace.glb": ["--solver", "plain", "--patch-size", "0.5", "--element-size", "0.125", "--cells", "64", "--until", "0.0001"],
    "cornell_box.obj": ["--solver", "plain", "--patch-size", "0.05", "--element-size", "0.0125"],
}


def bake(scene, flags):
    with tempfile.TemporaryDirectory() as folder:
        report, table = os.path.join(folder, "report.json"), os.path.join(folder, "elements.csv")
        run = [COMMAND, "bake", scene, "-o", table, "--report", report, "--quiet"] + flags
        code = subprocess.run(run).returncode
        if code not in (0, 4):
            print(f"{os.path.basename(scene)}: exit code {code}")
            return
        with open(report) as file:
            r = json.load(file)
        solve, seconds, energy = r["solve"], r["seconds"], r["energy"]
        line = {
            "scene": os.path.basename(scene), "patches": r["scene"]["patches"], "elements": r["scene"]["elements"],
            "cells": r["settings"]["cells"], "until": r["settings"]["until"], "threads": r["settings"]["threads"],
            "shots": solve["shots"], "rays": solve["rays"], "unshot_share": round(solve["unshot_share"], 6),
            "seconds": {k: round(v, 3) for k, v in seconds.items()},
            "mrays_per_second": round(solve["rays"] / max(seconds["solve"], 1e-9) / 1e6, 2),
            "closure_error": round(energy["closure_error"], 6), "escaped": energy["escaped"],
            "peak_memory_mib": round(r["peak_memory_bytes"] / 2**20, 1), "digest": r["solution_digest"][:16],
        }
        if os.path.basename(scene) == "furnace.glb":
            with open(table, newline="") as file:
                rows = [row for row in csv.DictReader(file) if float(row["valid"]) > 0]
            off = sorted(abs(float(row[c]) - 1) for row in rows for c in ("b_r", "b_g", "b_b"))
            line["rms"] = round(math.sqrt(sum(x * x for x in off) / len(off)), 6)
            line["within_999"], line["worst"] = round(off[int(len(off) * 0.999)], 6), round(off[-1], 6)
        print(json.dumps(line), flush=True)


split = sys.argv.index("--") if "--" in sys.argv else len(sys.argv)
arguments, extra = sys.argv[1:split], sys.argv[split + 1:]
if arguments in (["-h"], ["--help"]):
    sys.exit(__doc__)
for scene in arguments or [os.path.join(ROOT, "scenes", name) for name in OWN]:
    bake(scene, OWN.get(os.path.basename(scene), []) + extra)
