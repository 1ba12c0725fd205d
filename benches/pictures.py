#!/usr/bin/env python3
"""Pictures side by side: what Ringlight bakes, what Mitsuba path-traces from the same camera, and ten times how they differ.

  pictures.py RINGLIGHT PEERS SCENE --camera 'ex,ey,ez;tx,ty,tz;fov' -o PNG [--size 480x360] [--samples 1024] [-- flags of bake]

PEERS is the folder of peer programs, with its Python environment in use. The left and the middle third are mapped alike (exposed by
the mean of Mitsuba's, gamma 2.2); the right one is grey where both agree. Prints the difference of the pictures' linear values, as a share of
their mean: all of it (root of the mean square), what of it is bias, and what of it changes from one pixel to the next less what
Mitsuba's noise brings (from two halves of its samples).
"""

import argparse
import os
import subprocess
import sys
import tempfile

import numpy as np


def mitsuba_picture(scene, camera, size, samples, seed):
    """Linear values of a path-traced picture."""
    import mitsuba as mi

    eye, target, fov = camera
    contents = {"type": "scene", "integrator": {"type": "path", "max_depth": -1, "rr_depth": 16}}
    for number, material in enumerate(scene.info["materials"]):
        quads = np.nonzero(scene.m == number)[0]
        if len(quads) == 0:
            continue
        properties = mi.Properties()
        properties["bsdf"] = mi.load_dict({"type": "diffuse", "reflectance": {"type": "rgb", "value": material["reflectance"]}})
        if max(material["exitance"]) > 0:
            radiance = [x / np.pi for x in material["exitance"]]
            properties["emitter"] = mi.load_dict({"type": "area", "radiance": {"type": "rgb", "value": radiance}})
        count = len(quads)
        mesh = mi.Mesh(f"m{number}", 4 * count, 2 * count, has_vertex_normals=False, has_vertex_texcoords=False, props=properties)
        first = (np.arange(count, dtype=np.uint32) * 4)[:, None]
        faces = np.concatenate([first + np.array(corners, np.uint32) for corners in ([0, 1, 2], [0, 2, 3])], 1)
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"], parameters["faces"] = scene.q[quads].reshape(-1), faces.reshape(-1)
        parameters.update()
        contents[f"m{number}"] = mesh
    contents["sensor"] = {
        "type": "perspective",
        "fov": fov,
        "fov_axis": "y",
        "to_world": mi.ScalarTransform4f().look_at(origin=eye, target=target, up=[0, 1, 0]),
        "film": {"type": "hdrfilm", "width": size[0], "height": size[1], "rfilter": {"type": "box"}},
    }
    return np.array(mi.render(mi.load_dict(contents), spp=samples, seed=seed))[..., :3].astype(float)


def own_picture(arguments, folder):
    """Linear values of a picture of a bake."""
    import mitsuba as mi

    solution, picture = (os.path.join(folder, name) for name in ("scene.ringlight", "picture.exr"))
    obj = os.path.join(os.environ["RINGBENCH_DATA"], arguments.scene + ".obj")
    bake = [arguments.ringlight, "bake", obj, "--unit", "m", "-o", solution, "--quiet", *arguments.more]
    render = [arguments.ringlight, "render", solution, "-o", picture, "--camera", arguments.camera, "--size", arguments.size, "--quiet"]
    subprocess.run(bake, check=True)
    subprocess.run([*render, "--exposure", "0"], check=True)
    return np.array(mi.Bitmap(picture).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32)).astype(float)


def jumps(picture):
    """Mean square of the change from a pixel to the next, halved: the variance of what is not the same in both."""
    across, down = np.diff(picture, axis=1), np.diff(picture, axis=0)
    return (np.mean(across**2) + np.mean(down**2)) / 4


def main():
    parser = argparse.ArgumentParser()
    for name in ("ringlight", "peers", "scene"):
        parser.add_argument(name)
    parser.add_argument("--camera", required=True)
    parser.add_argument("--size", default="480x360")
    parser.add_argument("--samples", type=int, default=1024)
    parser.add_argument("-o", "--output", required=True)
    parser.add_argument("--turn", type=int, default=0, help="quarter turns of what is written: cameras take y for up")
    end = sys.argv.index("--") if "--" in sys.argv else len(sys.argv)
    arguments = parser.parse_args(sys.argv[1:end])
    arguments.more = sys.argv[end + 1 :]
    sys.path.insert(0, arguments.peers)
    import mitsuba as mi
    from PIL import Image

    mi.set_variant("llvm_ad_rgb")
    from scenes import Scene

    eye, target, fov = arguments.camera.split(";")
    camera = [float(x) for x in eye.split(",")], [float(x) for x in target.split(",")], float(fov)
    size = [int(x) for x in arguments.size.split("x")]
    scene = Scene(arguments.scene, elements=False)
    halves = [mitsuba_picture(scene, camera, size, arguments.samples // 2, seed) for seed in (1, 2)]
    traced, noise = (halves[0] + halves[1]) / 2, (halves[0] - halves[1]) / 2
    with tempfile.TemporaryDirectory() as folder:
        baked = own_picture(arguments, folder)
    # Lamps are seen by few pixels and would count for all; and nothing is behind the scene.
    bright = traced.max(2)
    lamp = 10 * np.median(bright[bright > 0])
    shown = (bright > 0) & (bright < lamp) & (baked.max(2) < lamp)
    mean = traced[shown].mean()
    difference = np.where(shown[..., None], baked - traced, 0.0)
    variance = np.where(shown[..., None], noise, 0.0)
    share = shown.mean()
    square = max(np.mean(difference**2) - np.mean(variance**2), 0.0) / share
    edges = max(jumps(difference) - jumps(variance), 0.0) / share
    print(f"{arguments.scene}: {100 * square**0.5 / mean:.2f} % of the mean, bias {100 * difference.sum() / 3 / shown.sum() / mean:.2f} %, "
          f"from pixel to pixel {100 * edges**0.5 / mean:.2f} %; Mitsuba's noise {100 * (np.mean(variance**2) / share) ** 0.5 / mean:.2f} %")
    tone = lambda picture: np.clip(0.35 * picture / mean, 0, 1) ** (1 / 2.2)
    grey = np.clip(0.5 + 10 * difference / (2 * mean), 0, 1)
    pixels = (255 * np.concatenate([np.rot90(part, arguments.turn) for part in (tone(baked), tone(traced), grey)], 1) + 0.5).astype(np.uint8)
    Image.fromarray(pixels).save(arguments.output, optimize=True)


if __name__ == "__main__":
    main()
