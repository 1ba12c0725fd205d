#!/usr/bin/env python3
"""Plain refinement whose cells are chosen by the light at stake, beside 16 cells for all: rays, and error against 64 cells of patches
four times finer.

  plain_precision.py RINGLIGHT SCENE --element E [--until U] [--errors 0.02 0.04] [-o CSV] [-- more flags of bake]

Writes a line for each way: rays, CPU seconds, relative RMSE of the elements' irradiance by area, its bias, and the error relative to
each element's own light (at least 2 % of the median). A patch has four elements along a side; the reference has elements of half their
size, of which each counts for the nearest that faces alike.
"""

import argparse
import csv
import json
import os
import resource
import subprocess
import tempfile

import numpy as np


def bake(arguments, name, folder, flags):
    """Bakes one way; gives the report, CPU seconds, and the elements' table."""
    solution, report, table = (os.path.join(folder, f"{name}.{ending}") for ending in ("ringlight", "json", "csv"))
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [arguments.ringlight, "bake", arguments.scene, "-o", solution, "--report", report, "--quiet", "--solver", "plain"]
    command += ["--until", arguments.until, "--threads", "2", *flags, *arguments.more]
    code = subprocess.run(command).returncode
    assert code in (0, 4), f"{command}: {code}"
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([arguments.ringlight, "export", solution, "-o", table, "--quiet"], check=True)
    with open(table) as file:
        rows = list(csv.DictReader(file))
    columns = {name: np.array([float(row[name] or 0) for row in rows]) for name in ("e", "area", "x", "y", "z", "nx", "ny", "nz")}
    with open(report) as file:
        told = json.load(file)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return told, cpu, columns


def averaged(fine, coarse):
    """Light of the fine elements, averaged over the coarse ones that they are nearest to; not a number where there is none."""
    place = lambda table: np.stack([table[name] for name in ("x", "y", "z")], 1)
    facing = lambda table: np.stack([table[name] for name in ("nx", "ny", "nz")], 1).round(2) + 0.0
    light, area = np.zeros(len(coarse["e"])), np.zeros(len(coarse["e"]))
    normals, which = np.unique(facing(coarse), axis=0, return_inverse=True)
    of_fine = {tuple(normal): i for i, normal in enumerate(normals)}
    group = np.array([of_fine.get(tuple(normal), -1) for normal in facing(fine)])
    for number in range(len(normals)):
        there, here = np.flatnonzero(which.ravel() == number), np.flatnonzero(group == number)
        targets = place(coarse)[there]
        for part in np.array_split(here, len(here) * len(there) // 20_000_000 + 1):
            away = ((place(fine)[part][:, None] - targets[None]) ** 2).sum(2)
            nearest = there[away.argmin(1)]
            np.add.at(light, nearest, fine["e"][part] * fine["area"][part])
            np.add.at(area, nearest, fine["area"][part])
    return np.where(area > 0, light / np.maximum(area, 1e-30), np.nan)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("ringlight")
    parser.add_argument("scene")
    parser.add_argument("--element", type=float, required=True)
    parser.add_argument("--until", default="0.02")
    parser.add_argument("--errors", nargs="+", default=["0.01", "0.02", "0.04"])
    parser.add_argument("-o", "--output")
    parser.add_argument("more", nargs="*")
    arguments = parser.parse_args()
    ways = {"cells 16": ["--cells", "16"], **{f"error {e}": ["--error", e] for e in arguments.errors}}
    with tempfile.TemporaryDirectory() as folder:
        sizes = lambda element, patch: ["--element-size", str(element), "--patch-size", str(patch)]
        finer = ["--cells", "64", *sizes(arguments.element / 2, arguments.element)]
        told, cpu, exact = bake(arguments, "reference", folder, finer)
        lines = [("reference", told["solve"]["rays"], round(cpu, 1), 0, 0, 0)]
        wanted = None
        for way, flags in ways.items():
            told, cpu, table = bake(arguments, "way", folder, [*flags, *sizes(arguments.element, 4 * arguments.element)])
            if wanted is None:
                wanted = averaged(exact, table)
                known = np.isfinite(wanted)
                share, wanted = table["area"][known] / table["area"][known].sum(), wanted[known]
                usual, mean = np.median(wanted[wanted > 0]), (share * wanted).sum()
            found = table["e"][known]
            off = found - wanted
            own = off / np.maximum(wanted, 0.02 * usual)
            rmse, bias, of_own = (share * off**2).sum() ** 0.5 / mean, (share * off).sum() / mean, (share * own**2).sum() ** 0.5
            lines.append((way, told["solve"]["rays"], round(cpu, 1), *(f"{100 * x:.3f}" for x in (rmse, bias, of_own))))
            print(os.path.basename(arguments.scene), *lines[-1], flush=True)
            for ending in ("ringlight", "csv", "json"):
                os.remove(os.path.join(folder, f"way.{ending}"))
    if arguments.output:
        with open(arguments.output, "a", newline="") as file:
            table = csv.writer(file)
            if file.tell() == 0:
                table.writerow(["scene", "way", "rays", "cpu", "rmse_percent", "bias_percent", "own_percent"])
            table.writerows((os.path.basename(arguments.scene), *line) for line in lines)


if __name__ == "__main__":
    main()
