#!/usr/bin/env python3
"""CPU time of group shooting against the number of elements: one row of CSV for each scene, and a plot.

  growth.py HARNESS [--scenes office floor3x2 floor9x6 ...] [--error E] [--threads N] [-o CSV]
  growth.py --plot CSV SVG

HARNESS is the folder of the path tracing harness, whose scenes must have been written with `--obj` (into HARNESS/data or
$RINGBENCH_DATA). Patches and elements are as large as the harness's own in the office, 0.207 m. Rows are appended to the CSV (default:
benches/results/DATE-growth.csv). The plot has both axes logarithmic, one line for each version and error, with its exponent: the slope
of the straight line of least squares. RINGLIGHT names the command (default: target/release/ringlight). Needs nothing but Python.
"""
import argparse, csv, datetime, json, math, os, subprocess, sys, tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
COMMAND = os.environ.get("RINGLIGHT", os.path.join(HERE, "..", "target", "release", "ringlight"))
SIZE = "0.207095707784"
COLUMNS = ["version", "scene", "error", "elements", "threads", "cpu", "wall", "rays", "peak_memory_bytes"]


def run(data, scene, arguments):
    with tempfile.TemporaryDirectory() as folder:
        report = os.path.join(folder, "report.json")
        command = [COMMAND, "bake", os.path.join(data, f"{scene}.obj"), "--unit", "m", "--quiet", "--report", report]
        command += ["-o", os.path.join(folder, "s.ringlight"), "--patch-size", SIZE, "--element-size", SIZE]
        command += ["--error", str(arguments.error), "--threads", str(arguments.threads)]
        process = subprocess.Popen(command)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode != 0:
            sys.exit(f"exit code {process.returncode}: {' '.join(command)}")
        with open(report) as file:
            told = json.load(file)
    return {"version": arguments.version, "scene": scene, "error": arguments.error, "elements": told["scene"]["elements"],
            "threads": arguments.threads, "cpu": round(usage.ru_utime + usage.ru_stime, 2),
            "wall": round(told["seconds"]["total"], 2), "rays": told["solve"]["rays"],
            "peak_memory_bytes": told["peak_memory_bytes"]}


def exponent(points):
    """Slope of the straight line of least squares through the logarithms."""
    logs = [(math.log(x), math.log(y)) for x, y in points]
    mx, my = (sum(values) / len(logs) for values in zip(*logs))
    return sum((x - mx) * (y - my) for x, y in logs) / sum((x - mx) ** 2 for x, _ in logs)


def plot(rows, path):
    lines = {}
    for row in rows:
        lines.setdefault((row["version"], row["error"]), []).append((float(row["elements"]), float(row["cpu"])))
    everything = [point for points in lines.values() for point in points]
    low, high = ([math.floor(math.log10(min(v))) for v in zip(*everything)], [math.ceil(math.log10(max(v))) for v in zip(*everything)])
    at = lambda x, y: (80 + 480 * (math.log10(x) - low[0]) / (high[0] - low[0]), 380 - 340 * (math.log10(y) - low[1]) / (high[1] - low[1]))
    svg = ['<svg xmlns="http://www.w3.org/2000/svg" width="760" height="440" font-family="sans-serif" font-size="12">',
           '<rect width="760" height="440" fill="white"/>']
    for axis, name in ((0, "elements"), (1, "CPU seconds")):
        for k in range(low[axis], high[axis] + 1):
            (x1, y1), (x2, y2) = (at(10**k, 10 ** low[1]), at(10**k, 10 ** high[1])) if axis == 0 else (at(10 ** low[0], 10**k), at(10 ** high[0], 10**k))
            svg.append(f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="#ddd"/>')
            place = f'x="{x1:.1f}" y="398" text-anchor="middle"' if axis == 0 else f'x="72" y="{y1 + 4:.1f}" text-anchor="end"'
            svg.append(f"<text {place}>{10**k:g}</text>")
        place = 'x="320" y="425" text-anchor="middle"' if axis == 0 else 'x="20" y="24"'
        svg.append(f"<text {place}>{name}</text>")
    for i, ((version, error), points) in enumerate(sorted(lines.items())):
        colour = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#000000"][i % 5]
        path_of = " ".join(f"{x:.1f},{y:.1f}" for x, y in (at(*point) for point in sorted(points)))
        svg.append(f'<polyline points="{path_of}" fill="none" stroke="{colour}" stroke-width="2"/>')
        svg += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="{colour}"/>' for x, y in (at(*point) for point in points)]
        slope = f", exponent {exponent(points):.2f}" if len(points) > 1 else ""
        svg.append(f'<text x="580" y="{60 + 40 * i}" fill="{colour}">{version}, error {error}</text>')
        svg.append(f'<text x="580" y="{76 + 40 * i}" fill="{colour}">{slope.lstrip(", ")}</text>')
    with open(path, "w") as file:
        file.write("\n".join(svg + ["</svg>"]) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("harness", nargs="?")
    parser.add_argument("--scenes", nargs="+", default=["office", "floor3x2", "floor9x6"])
    parser.add_argument("--error", type=float, default=0.01)
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--version", default="now", help="what the rows call the command")
    parser.add_argument("--plot", nargs=2, metavar=("CSV", "SVG"))
    parser.add_argument("-o", "--output", default=os.path.join(HERE, "results", f"{datetime.date.today()}-growth.csv"))
    arguments = parser.parse_args()
    if arguments.plot:
        with open(arguments.plot[0], newline="") as file:
            return plot(list(csv.DictReader(file)), arguments.plot[1])
    if not arguments.harness:
        parser.error("which harness?")
    data = os.environ.get("RINGBENCH_DATA", os.path.join(arguments.harness, "data"))
    fresh = not os.path.exists(arguments.output)
    with open(arguments.output, "a", newline="") as file:
        table = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        if fresh:
            table.writeheader()
        for scene in arguments.scenes:
            row = run(data, scene, arguments)
            table.writerow(row)
            file.flush()
            print(row)


if __name__ == "__main__":
    main()
