#!/usr/bin/env python3
"""Replays the same shadow rays with Ringlight's visibility and with Embree, in turn, and counts the rays that differ.

  embree_replay.py [--sets office.m16,office.m64] [--threads 1] [--runs 3] [--rounds 3] [--width 16] [--shuffle]

Environment: RINGBENCH_DATA the folder with the .tris and .rays files, EMBREE_RAYS the Embree runner, EMBREE_LIB its
library, REPLAY our replay example (default: built by cargo into this repository's target folder).
Prints one JSON object per set: rates in million rays/s (the best of the rounds, and all of them), the rays that
differ, and their share. Rates are of wall clock: run it on an idle machine. --shuffle puts each shooter's receivers in
random order for both.
"""
import argparse, array, json, os, random, struct, subprocess, sys, tempfile

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))


def need(name):
    if name not in os.environ:
        sys.exit(f"{name} is not set; see --help")
    return os.environ[name]


def words(path):
    read = array.array("Q")
    with open(path, "rb") as file:
        read.frombytes(file.read())
    if sys.byteorder == "big":
        read.byteswap()
    return read


def shuffled(path, to):
    """Writes the ray set with the receivers of each shooter in random order, the same every time."""
    with open(path, "rb") as file:
        data = bytearray(file.read())
    shooters, cells, receivers, pairs = struct.unpack_from("<4Q", data, 8)
    starts_at = 48 + 12 * (shooters * cells + receivers)
    starts = struct.unpack_from(f"<{shooters + 1}Q", data, starts_at)
    first = starts_at + 8 * (shooters + 1)
    order = array.array("I")
    order.frombytes(bytes(data[first:first + 4 * pairs]))
    for begin, end in zip(starts, starts[1:]):
        part = list(order[begin:end])
        random.Random(1).shuffle(part)
        order[begin:end] = array.array("I", part)
    data[first:first + 4 * pairs] = order.tobytes()
    with open(to, "wb") as file:
        file.write(data)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sets", default="office.m16,office.m64")
    for name, default in ("threads", 1), ("runs", 3), ("rounds", 3), ("width", 16):
        parser.add_argument("--" + name, type=int, default=default)
    parser.add_argument("--shuffle", action="store_true")
    options = parser.parse_args()
    data, embree = need("RINGBENCH_DATA"), need("EMBREE_RAYS")
    need("EMBREE_LIB")
    replay = os.environ.get("REPLAY")
    if not replay:
        build = ["cargo", "build", "--release", "-q", "-p", "ringlight-visibility", "--example", "replay"]
        subprocess.run(build, cwd=ROOT, check=True)
        replay = os.path.join(os.environ.get("CARGO_TARGET_DIR", os.path.join(ROOT, "target")), "release/examples/replay")

    for name in options.sets.split(","):
        scene, rays = os.path.join(data, name.split(".")[0] + ".tris"), os.path.join(data, name + ".rays")
        ours, theirs = [], []
        with tempfile.TemporaryDirectory() as folder:
            masks, bits = os.path.join(folder, "masks"), os.path.join(folder, "bits")
            if options.shuffle:
                shuffled(rays, os.path.join(folder, "rays"))
                rays = os.path.join(folder, "rays")
            run = lambda *command: subprocess.run(command, check=True, capture_output=True, text=True).stdout
            threads = ["--threads", str(options.threads)]
            for _ in range(options.rounds):
                ours.append(json.loads(run(replay, scene, rays, *threads, "--runs", str(options.runs), "--masks", masks)))
                line = run(embree, scene, rays, *threads, "--width", str(options.width), "--repeat", str(options.runs),
                           "--bits", bits)
                theirs.append(line.strip().split(","))
            visible, blocked = words(masks), words(bits)
        if len(visible) != len(blocked):
            sys.exit(f"{name}: {len(visible)} masks but {len(blocked)} of Embree's")
        cells = ours[0]["rays"] // len(visible)
        every = (1 << cells) - 1
        differ = sum(bin(a ^ b ^ every).count("1") for a, b in zip(visible, blocked))
        ratio = lambda a, b: round(a / b, 3)
        rates, embree_rates = [o["mrays_per_second"] for o in ours], [float(t[12]) for t in theirs]
        print(json.dumps({
            "set": name, "shuffled": options.shuffle, "threads": options.threads, "rays": ours[0]["rays"], "blocked": ours[0]["blocked"],
            "embree_blocked": int(theirs[0][5]), "differing_rays": differ, "differing_share": differ / ours[0]["rays"],
            "mrays_per_second": max(rates), "embree_mrays_per_second": max(embree_rates),
            "ratio": ratio(max(rates), max(embree_rates)), "rounds": rates, "embree_rounds": embree_rates,
            "build_seconds": min(o["build_seconds"] for o in ours), "embree_build_seconds": min(float(t[7]) for t in theirs),
            "bytes_per_triangle": ours[0]["bytes_per_triangle"],
        }))


if __name__ == "__main__":
    main()
