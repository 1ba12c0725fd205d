#!/usr/bin/env python3
"""View factors of pairs of unit squares: Ringlight beside pyviewfactor, in one session, and how many times faster it is.

  view_factors.py PEER.py [PYTHON] [EXAMPLE]

PEER.py prints pyviewfactor's cases as CSV lines `case,exact,value,relative error,ms per pair` and is run by PYTHON (default:
this one), which has to have pyviewfactor and pyvista. EXAMPLE is the built example `view_factors` (default:
target/release/examples/view_factors of this repository). Times are of wall clock: run it on an idle machine.
"""
import csv, math, os, subprocess, sys

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
if len(sys.argv) < 2 or sys.argv[1] in ("-h", "--help"):
    sys.exit(__doc__)
peer = os.path.abspath(sys.argv[1])
python = sys.argv[2] if len(sys.argv) > 2 else sys.executable
example = sys.argv[3] if len(sys.argv) > 3 else os.path.join(ROOT, "target", "release", "examples", "view_factors")



def parallel(d):
    """Howell C-11 for unit squares."""
    x = 1 / d
    p = math.sqrt(1 + x * x)
    return 2 / (math.pi * x * x) * (math.log(p * p / math.sqrt(1 + 2 * x * x)) + 2 * x * p * math.atan(x / p) - 2 * x * math.atan(x))


def perpendicular(h):
    """Howell C-14 for rectangles 1 x 1 and 1 x h with a common edge."""
    h2 = h * h
    s = 1 + h2
    log = (2 * s / (1 + s)) * ((1 + s) / (2 * s)) * (h2 * (1 + s) / (s * s)) ** h2
    return 1 / math.pi * (math.atan(1) + h * math.atan(1 / h) - math.sqrt(s) * math.atan(1 / math.sqrt(s)) + math.log(log) / 4)


exact = {f"parallel d={d}": parallel(d) for d in (.1, .5, 1, 3, 10)}
exact |= {"perpendicular common edge": perpendicular(1), "perpendicular gap 0.1": perpendicular(1.1) - perpendicular(.1)}

theirs = subprocess.run([python, peer], cwd=os.path.dirname(peer), capture_output=True, text=True, check=True).stdout
ours = subprocess.run([example], capture_output=True, text=True, check=True).stdout
found = {row["case"]: row for row in csv.DictReader(ours.splitlines())}

print("case,exact,pyviewfactor relative error,Ringlight relative error,pyviewfactor us,Ringlight us,times faster")
ratios = []
for row in csv.reader(theirs.splitlines()):
    if len(row) != 5 or row[0] not in found:
        continue
    case, _, _, error, milliseconds = row
    mine = found[case]
    ratios.append(float(milliseconds) / float(mine["ms per pair"]))
    print(f"{case},{exact[case]:.12f},{error},{float(mine['value']) / exact[case] - 1:+.1e},{float(milliseconds) * 1e3:.1f},"
          f"{float(mine['ms per pair']) * 1e3:.3f},{ratios[-1]:.0f}")
if not ratios:
    sys.exit(f"{peer} printed no case that the example knows:\n{theirs}")
screen = found["half screen"]
print(f"half screen: Ringlight {float(screen['value']):.7f} +- {float(screen['error estimate']):.1e}, "
      f"{float(screen['ms per pair']) * 1e3:.0f} us; pyviewfactor:")
print("\n".join(line for line in theirs.splitlines() if "screen" in line or "cells" in line or "whole squares" in line))
print(f"times faster, unobstructed pairs: smallest {min(ratios):.0f}, median {sorted(ratios)[len(ratios) // 2]:.0f}")
