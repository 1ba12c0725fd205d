#!/usr/bin/env python3
"""Load of the ranks that draw a picture, by how it is divided: CSV, and a check that all pictures are the same.

    render_load.py RINGLIGHT SOLUTION [CAMERA...] > benches/results/DATE-render.csv

Each rank is a ring of its own, so that what it looks at is what its own rays cost. Counts, not times: any machine gives
the same.
"""

import json
import pathlib
import subprocess
import sys
import tempfile

FIELDS = ["pixels", "rays", "searched", "elements_asked", "light_bytes", "light_bytes_while_found"]


def main(ringlight, solution, *cameras):
    print("solution,camera,ranks,split,rank," + ",".join(FIELDS))
    with tempfile.TemporaryDirectory() as folder:
        png, report = pathlib.Path(folder, "a.png"), pathlib.Path(folder, "a.json")
        for camera in cameras or ("automatic",):
            chosen = [] if camera == "automatic" else ["--camera", camera]
            pictures = set()
            for ranks in (1, 2, 3, 8):
                for split in ("tiles", "scanlines"):
                    way = ["--ranks", str(ranks), "--rings", str(ranks), "--split", split, "--report", str(report)]
                    command = [ringlight, "render", solution, "-o", str(png), "--force", *chosen, *way]
                    subprocess.run(command, check=True)
                    pictures.add(png.read_bytes())
                    picture = json.loads(report.read_text())["picture"]
                    for rank, load in enumerate(picture["ranks"]):
                        row = [pathlib.Path(solution).stem, camera, ranks, split, rank, *(load[f] for f in FIELDS)]
                        print(*row, sep=",")
                    ratios = ", ".join(f"{name} {value:.3f}" for name, value in picture["max_over_mean"].items())
                    print(f"{camera}: {ranks} ranks by {split}: max/mean {ratios}", file=sys.stderr)
            if len(pictures) != 1:
                sys.exit(f"{camera}: the pictures are not the same")


if __name__ == "__main__":
    main(*sys.argv[1:])
