#!/usr/bin/env python3
"""Rays a second and seconds of `relit solve` for 1, 2, … threads, in turn, so that all see the same machine.

    benches/threads/measure.py CAPTURE [--threads 1,2] [--runs 5] [--relit target/release/relit]

Also checks that every number of threads gives the same estimate.
"""

import argparse
import hashlib
import json
import os
import pathlib
import statistics
import subprocess
import tempfile


def solve(relit, capture, preset, threads):
    with tempfile.TemporaryDirectory() as out:
        subprocess.run([relit, "solve", capture, "--preset", preset, "--threads", str(threads), "--views", "none", "--out", out],
                       check=True, capture_output=True)
        report = json.loads((pathlib.Path(out) / "report.json").read_text())
    objects = json.dumps(report["objects"], sort_keys=True)
    return report["seconds_solve"], report["rays_per_second"] / 1e6, hashlib.sha256(objects.encode()).hexdigest()[:12]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture")
    parser.add_argument("--threads", default="1,2")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--preset", default="balanced")
    parser.add_argument("--relit", default="target/release/relit")
    options = parser.parse_args()
    numbers = [int(n) for n in options.threads.split(",")]
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} at the start")
    runs = {n: [] for n in numbers}
    for _ in range(options.runs):
        for n in numbers:
            runs[n].append(solve(options.relit, options.capture, options.preset, n))

    print("| threads | seconds (least–most) | Mrays/s | speed-up, run by run |\n| --- | --- | --- | --- |")
    for n in numbers:
        seconds = [run[0] for run in runs[n]]
        ratio = statistics.median(first[0] / run[0] for first, run in zip(runs[numbers[0]], runs[n]))
        print(f"| {n} | {statistics.median(seconds):.2f} ({min(seconds):.2f}–{max(seconds):.2f}) "
              f"| {statistics.median(run[1] for run in runs[n]):.2f} | {ratio:.2f} |")
    estimates = {run[2] for each in runs.values() for run in each}
    print("all estimates are the same" if len(estimates) == 1 else f"{len(estimates)} different estimates")
    print(f"load {os.getloadavg()[0]:.1f} at the end")


if __name__ == "__main__":
    main()
