#!/usr/bin/env python3
"""What it costs the solver to be watched: CPU time of bakes with a page that takes all it can, and without.

    python3 benches/view_cost.py target/release/ringlight scenes/office.glb [ROUNDS] [FLAGS ...]

The page is this script: it takes each update as soon as it comes. CPU times are those of the command (user and system,
all threads), as the system counts them for a process that has ended; runs with and without a page take turns.
"""

import os
import re
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import time


def watch(address):
    """Takes all updates until the server ends; their number and size."""
    host, port = address.rsplit(":", 1)
    stream = socket.create_connection((host, int(port)))
    stream.sendall(
        f"GET /stream HTTP/1.1\r\nHost: {address}\r\nOrigin: http://{address}\r\nConnection: Upgrade\r\n"
        "Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n".encode()
    )
    answers = stream.makefile("rb")
    while answers.readline().strip():
        pass
    rounds, light, size = 0, 0, 0
    while head := answers.read(2):
        length = head[1] & 127
        if length >= 126:
            length = int.from_bytes(answers.read(2 if length == 126 else 8), "big")
        content = answers.read(length)
        kind = head[0] & 15
        size += length
        if kind == 2 and length == 0:
            rounds += 1
            # "ready", masked with zeros.
            stream.sendall(b"\x81\x87\0\0\0\0" + b'"ready"')
        elif kind == 2 and content[:4] == struct.pack("<I", 2):
            light += 1
        elif kind == 8:
            break
    return rounds, light, size


def bake(program, scene, flags, watched):
    """CPU and wall seconds of a bake, and what its page took."""
    with tempfile.TemporaryDirectory() as folder:
        words = [program, "bake", scene, "-o", f"{folder}/a.ringlight", "--progress", "none", *flags]
        start = time.monotonic()
        child = subprocess.Popen(words + (["--view"] if watched else []), stderr=subprocess.PIPE, text=True)
        taken = (0, 0, 0)
        if watched:
            taken = watch(re.search(r"view: http://([^/]+)", child.stderr.readline()).group(1))
        _, status, usage = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        assert child.returncode == 0, child.stderr.read()
        return usage.ru_utime + usage.ru_stime, time.monotonic() - start, *taken


def main():
    program, scene = sys.argv[1:3]
    rounds = int(sys.argv[3]) if len(sys.argv) > 3 else 5
    runs = {watched: [] for watched in (False, True)}
    print("round,watched,cpu_seconds,wall_seconds,updates,updates_of_light,bytes")
    for number in range(rounds):
        for watched, taken in runs.items():
            taken.append(bake(program, scene, sys.argv[4:], watched))
            cpu, wall, *page = taken[-1]
            print(f"{number},{int(watched)},{cpu:.3f},{wall:.3f},{','.join(map(str, page))}", flush=True)
    without, beside = (statistics.median(run[0] for run in runs[watched]) for watched in (False, True))
    print(f"# median CPU time {without:.3f} s alone, {beside:.3f} s watched: {100 * (beside / without - 1):+.2f} %")


main()
