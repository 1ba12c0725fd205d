#!/usr/bin/env python3
"""Bakes the path tracing harness's scenes and compares with its references: one row of CSV for each run.

  path_tracing.py HARNESS [--only cornell|office] [--set NAME ...] [--most-seconds S] [-o CSV] [--worst N] [--threads N]

HARNESS is the folder with scenes.py, compare.py and refs/; its scenes must have been written (`scenes.py cornell office`,
into HARNESS/data or $RINGBENCH_DATA). Each run bakes NAME.obj, probes the solution at the harness's element centres
(`ringlight probe --how surface`) and gives the relative RMSE over the elements that the harness keeps, as compare.py has it:
  rmse_raw  as measured                      rmse  the reference's own standard error taken off in squares
  bias      of the area-weighted mean        cpu   user and system time of the bake, all threads, seconds
Points that the probe finds inside things count as dark, as in the reference; `inside` is their number.
Rows are appended to the CSV (default: benches/results/DATE-path-tracing.csv), and runs that are there already are left
out, so that a stopped series goes on. Needs numpy; RINGLIGHT names the command (default: target/release/ringlight).
"""
import argparse, csv, datetime, importlib.util, json, os, subprocess, sys, tempfile, time
import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
COMMAND = os.environ.get("RINGLIGHT", os.path.join(HERE, "..", "target", "release", "ringlight"))
SETTINGS = ["scene", "patch", "element", "cells", "until", "error", "adapt"]
COLUMNS = ["series"] + SETTINGS + ["patches", "elements", "shots", "threads", "cpu", "wall", "rmse_raw", "rmse", "bias",
                                   "reference_error", "inside", "points", "worst"]

# The size of the harness's own elements in the office: then their middles are sample points. Patches of this size, too, keep
# the light of a wall above a shelf from shining out of what is behind the shelf.
OFFICE = 0.207095707784

# One discretisation of each scene (patch and element size in metres, cells, unshot share), and what is varied around it, one
# thing at a time. Patches of 100 m are the scenes' faces. `time` is for the curve of error against time: the fast runs have
# the harness's own elements, the last are as fine as 10 minutes on two cores allow.
BASE = {"cornell": (0.1, 0.011, 64, 0.001), "office": (OFFICE, OFFICE, 4, 0.002)}
VARIED = {
    "patch": {"cornell": (100, 0.3, 0.1, 0.05), "office": (100, 1, 0.42, OFFICE)},
    "element": {"cornell": (0.066, 0.033, 0.022, 0.011, 0.0055), "office": (OFFICE, OFFICE / 2)},
    "cells": {"cornell": (1, 4, 16, 64), "office": (1, 4, 16)},
    "until": {"cornell": (0.1, 0.03, 0.01, 0.003, 0.001, 0.0003), "office": (0.1, 0.03, 0.01, 0.004, 0.002, 0.001)},
}
TIME = {
    "cornell": [(100, 0.033, 4, 0.03), (100, 0.033, 16, 0.01), (100, 0.033, 64, 0.001), (0.05, 0.0055, 64, 0.0003)],
    "office": [(100, OFFICE, 4, 0.03), (100, OFFICE, 16, 0.01), (1, OFFICE, 4, 0.003), (OFFICE, OFFICE, 16, 0.0007)],
}
# Group shooting (`--solver group`): patch and element size, the error asked for, and how often elements may be cut in nine.
GROUP = {
    "cornell": [(0.033, 0.033, *how) for how in [(0.02, 0), (0.01, 0), (0.005, 0), (0.005, 1), (0.003, 1), (0.0015, 1)]],
    "office": [(OFFICE, OFFICE, *how) for how in [(0.03, 0), (0.01, 0), (0.01, 1), (0.007, 1), (0.005, 1)]],
}
SERIES = ["time", *VARIED, "group"]


def runs(names, only):
    """Settings of all runs of the named series, each once, with the names of all series it belongs to."""
    series = {}
    for scene in BASE:
        if only in (None, scene):
            for settings in TIME[scene]:
                series.setdefault((scene, *settings), []).append("time")
            for name, values in VARIED.items():
                for value in values[scene]:
                    settings = list(BASE[scene])
                    settings[SETTINGS.index(name) - 1] = value
                    series.setdefault((scene, *settings), []).append(name)
            for patch, element, error, adapt in GROUP[scene]:
                series.setdefault((scene, patch, element, "", "", error, adapt), []).append("group")
    for settings, of in series.items():
        if set(of) & set(names):
            yield " ".join(of), dict(zip(SETTINGS, (*settings, "", "")))


def timed(command, limit):
    """Runs a command; gives its CPU time and its wall time, seconds."""
    start = time.monotonic()
    process = subprocess.Popen(command)
    try:
        while True:
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
            if pid:
                break
            if time.monotonic() - start > limit:
                process.kill()
            time.sleep(0.02)
    except BaseException:
        process.kill()
        raise
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        raise RuntimeError(f"exit code {process.returncode}: {' '.join(command)}")
    return usage.ru_utime + usage.ru_stime, time.monotonic() - start


def compare(scene, reference, found):
    """Relative RMSE over the kept elements, as the harness's compare.py."""
    keep = scene.keep
    weight = (scene.ea[keep] / scene.ea[keep].sum())[:, None]
    exact, error, off = reference[keep, :3], reference[keep, 3:], found[keep] - reference[keep, :3]
    mean = (weight * exact).sum() / 3
    raw, own = (weight * off**2).sum() / 3, (weight * error**2).sum() / 3
    return {"rmse_raw": raw**0.5 / mean, "rmse": max(raw - own, 0) ** 0.5 / mean, "bias": (weight * off).sum() / 3 / mean,
            "reference_error": own**0.5 / mean, "points": int(keep.sum())}


def worst(scene, reference, found, count):
    """The elements with the largest share of the squared error: number, found and exact mean over RGB, share."""
    squares = (scene.ea[:, None] * (found - reference[:, :3]) ** 2).sum(1) * scene.keep
    order = np.argsort(-squares, kind="stable")[:count]
    return [(int(e), found[e].mean(), reference[e, :3].mean(), squares[e] / squares.sum()) for e in order]


def probe(solution, points, folder):
    """The irradiance that the solution shows at the points, and how many of them are inside things."""
    out = os.path.join(folder, "probed.csv")
    subprocess.run([COMMAND, "probe", solution, "--how", "surface", "--points", points, "-o", out, "--quiet"], check=True)
    with open(out, newline="") as file:
        rows = list(csv.DictReader(file))
    if any(row["status"] not in ("ok", "inside") for row in rows):
        raise RuntimeError("some points were found on no surface")
    light = [[float(row[c] or 0) for c in ("e_r", "e_g", "e_b")] for row in rows]
    return np.array(light), sum(row["status"] == "inside" for row in rows)


def run(harness, data, settings, arguments):
    scene, reference = settings["scene"], np.load(os.path.join(arguments.harness, "refs", f"{settings['scene']}.centre.ref.npy"))
    elements = harness.Scene(scene)
    with tempfile.TemporaryDirectory() as folder:
        points, solution = os.path.join(folder, "points.csv"), os.path.join(folder, "solution.ringlight")
        np.savetxt(points, np.hstack([elements.ec, elements.en]), "%.9g", ",", header="x,y,z,nx,ny,nz", comments="")
        report = os.path.join(folder, "report.json")
        command = [COMMAND, "bake", os.path.join(data, f"{scene}.obj"), "--unit", "m", "-o", solution, "--quiet", "--report", report]
        command += ["--patch-size", str(settings["patch"]), "--element-size", str(settings["element"])]
        command += ["--threads", str(arguments.threads)]
        if settings["error"]:
            command += ["--solver", "group", "--error", str(settings["error"]), "--adapt", str(settings["adapt"])]
        else:
            command += ["--solver", "plain", "--cells", str(settings["cells"]), "--until", str(settings["until"])]
        cpu, wall = timed(command, arguments.most_seconds)
        with open(report) as file:
            told = json.load(file)
        found, inside = probe(solution, points, folder)
    row = dict(settings, patches=told["scene"]["patches"], elements=told["scene"]["elements"], shots=told["solve"]["shots"],
               threads=arguments.threads, cpu=round(cpu, 3), wall=round(wall, 3), inside=inside)
    row.update({k: float(f"{v:.5g}") if isinstance(v, float) else v for k, v in compare(elements, reference.astype(float), found).items()})
    largest = worst(elements, reference.astype(float), found, max(arguments.worst, 3))
    row["worst"] = " ".join(f"{e}:{f:.4g}/{x:.4g}" for e, f, x, _ in largest[:3])
    for e, f, x, share in largest[:arguments.worst]:
        place, normal = elements.ec[e].round(3).tolist(), elements.en[e].round(2).tolist()
        print(f"  element {e} at {place}, normal {normal}: found {f:.4g}, exact {x:.4g}, {share:.1%} of the squared error")
    return row


def load(path):
    """The harness's scenes.py as a module."""
    spec = importlib.util.spec_from_file_location("harness_scenes", os.path.join(path, "scenes.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("harness")
    parser.add_argument("--only", choices=["cornell", "office"])
    parser.add_argument("--set", nargs="+", choices=SERIES, default=SERIES)
    parser.add_argument("--most-seconds", type=float, default=600, help="a bake that takes longer is stopped and left out")
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--worst", type=int, default=0, help="print so many of the elements that err most")
    parser.add_argument("-o", "--output")
    arguments = parser.parse_args()
    harness = load(arguments.harness)
    name = "group" if arguments.set == ["group"] else "path-tracing"
    path = arguments.output or os.path.join(HERE, "results", f"{datetime.date.today()}-{name}.csv")
    done, columns = set(), COLUMNS
    if os.path.exists(path):
        with open(path, newline="") as file:
            reader = csv.DictReader(file)
            done = {tuple(row.get(k, "") for k in SETTINGS) for row in reader}
            # Files from before there was group shooting have no column for its error.
            columns = reader.fieldnames
    fresh = not os.path.exists(path)
    with open(path, "a", newline="") as file:
        table = csv.DictWriter(file, columns, extrasaction="ignore", lineterminator="\n")
        if fresh:
            table.writeheader()
        for series, settings in runs(arguments.set, arguments.only):
            if tuple(str(settings[k]) for k in SETTINGS) in done:
                continue
            try:
                row = run(harness, harness.DATA, settings, arguments)
            except RuntimeError as error:
                print(f"{settings}: left out, {error}", file=sys.stderr)
                continue
            table.writerow(dict(row, series=series))
            file.flush()
            print(f"{settings}: {100 * row['rmse']:.3f} % in {row['cpu']:.1f} s of CPU", flush=True)


if __name__ == "__main__":
    main()
