#!/usr/bin/env python3
"""Error at random places of a scene's surfaces, beside path-traced irradiance there: what one sees, wherever elements have their middles.

  random_points.py reference HARNESS SCENE -o POINTS [--count 4000] [--samples 16384] [--seed 1]
  random_points.py compare POINTS PROBED

HARNESS is the folder with scenes.py, compare.py and build/ref_pt, its Python environment in use and EMBREE_LIB set; the scene must have been
written (`scenes.py SCENE`, into HARNESS/data or $RINGBENCH_DATA). `reference` draws places evenly by area, leaves out those that the
harness calls ambiguous, and writes x,y,z,nx,ny,nz, irradiance and its standard error. PROBED is the table of `ringlight probe --how surface
--points POINTS`. `compare` prints the relative RMSE with the reference's error taken off in squares: of all places that have light, and without the
worst 0.3, 1 and 3 % of them.
"""

import argparse
import os
import subprocess
import sys
import tempfile

import numpy as np

COLUMNS = "x,y,z,nx,ny,nz,area,e_r,e_g,e_b,s_r,s_g,s_b"


def reference(arguments):
    """Writes the places and their irradiance."""
    sys.path.insert(0, arguments.harness)
    from compare import mask
    from scenes import DATA, Scene

    scene, random = Scene(arguments.scene), np.random.default_rng(arguments.seed)
    of = random.choice(len(scene.ec), size=int(1.2 * arguments.count), p=scene.ea / scene.ea.sum())
    corners = scene.ev[of].reshape(len(of), 4, 3)
    u, v = random.uniform(0.02, 0.98, (2, len(of), 1))
    a, b, c, d = corners.transpose(1, 0, 2)
    places = a * (1 - u) * (1 - v) + b * u * (1 - v) + c * u * v + d * (1 - u) * v
    drawn = Scene.__new__(Scene)
    drawn.__dict__.update(scene.__dict__)
    drawn.ec, drawn.en, drawn.ep = places, scene.en[of], scene.ep[of]
    kept = np.flatnonzero(mask(drawn))[: arguments.count]
    # The path tracer takes elements: thousandths of the scene's, about the places.
    tiny = (places[:, None] + 1e-3 * (corners - corners.mean(1)[:, None]))[kept]
    with tempfile.TemporaryDirectory() as folder:
        name = os.path.join(folder, "points.pt")
        with open(name, "wb") as out:
            out.write(b"RLPTSC01")
            np.array([len(scene.rho), len(scene.q), len(kept)], np.uint64).tofile(out)
            np.array([scene.eps], np.float32).tofile(out)
            np.concatenate([scene.rho, scene.exi], 1).astype(np.float32).tofile(out)
            scene.m.astype(np.uint32).tofile(out)
            tiny.reshape(len(kept), *scene.ev.shape[1:]).astype(np.float32).tofile(out)
        tracer = os.path.join(arguments.harness, "build", "ref_pt")
        triangles = os.path.join(DATA, arguments.scene + ".tris")
        more = ["--spp", str(arguments.samples), "--seed", str(100 + arguments.seed)]
        subprocess.run([tracer, name, triangles, name + ".raw", *more], check=True)
        found = np.fromfile(name + ".raw", np.float32).reshape(-1, 6)
    table = np.hstack([places[kept], scene.en[of][kept], np.ones((len(kept), 1)), found])
    np.savetxt(arguments.output, table, delimiter=",", header=COLUMNS, comments="", fmt="%.7g")


def compare(arguments):
    """Prints how what is probed differs."""
    points, probed = (np.genfromtxt(name, delimiter=",", names=True) for name in (arguments.points, arguments.probed))
    channels = lambda table, what: np.stack([table[what + c] for c in "rgb"], 1)
    exact, noise, found = channels(points, "e_"), channels(points, "s_"), channels(probed, "e_")
    lit = ~np.isnan(found).any(1)
    exact, noise, found = exact[lit], noise[lit], found[lit]
    squares = np.sort(((found - exact) ** 2).mean(1) - (noise**2).mean(1))[::-1]
    without = lambda share: max(squares[int(share * len(squares)) :].mean(), 0) ** 0.5 / exact.mean()
    bias = (found - exact).mean() / exact.mean()
    print(f"{lit.sum()} of {len(lit)} places have light, the reference is good to {(noise**2).mean() ** 0.5 / exact.mean():.2%}")
    print(f"rmse {without(0):.2%}, without the worst 0.3 % {without(0.003):.2%}, 1 % {without(0.01):.2%}, 3 % {without(0.03):.2%}, bias {bias:.2%}")


parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
verbs = parser.add_subparsers(required=True)
verb = verbs.add_parser("reference")
verb.set_defaults(run=reference)
verb.add_argument("harness")
verb.add_argument("scene")
verb.add_argument("-o", "--output", required=True)
verb.add_argument("--count", type=int, default=4000)
verb.add_argument("--samples", type=int, default=16384)
verb.add_argument("--seed", type=int, default=1)
verb = verbs.add_parser("compare")
verb.set_defaults(run=compare)
verb.add_argument("points")
verb.add_argument("probed")
arguments = parser.parse_args()
arguments.run(arguments)
