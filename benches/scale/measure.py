#!/usr/bin/env python3
"""Seconds and peak memory of `relit solve` over triangles, photographs and objects.

    cargo build --release -p scale-bench
    benches/scale/measure.py [--quick] [--relit target/release/relit] [--out benches/scale]

Writes scale.csv and, where matplotlib is installed, scale.png. Captures are halls with boxes, made for the purpose; one
number grows at a time. A solve that takes longer than --limit seconds is ended and marked so.
"""

import argparse
import csv
import json
import os
import pathlib
import shutil
import subprocess
import tempfile

# Triangles, photographs, objects.
BASE = {"triangles": 30_000, "photographs": 30, "objects": 30}
SWEEPS = {
    "triangles": [10_000, 100_000, 1_000_000, 10_000_000],
    "photographs": [10, 30, 100, 300, 1000],
    "objects": [10, 100, 1000, 3000, 10_000],
}
QUICK = {"triangles": [10_000, 100_000, 1_000_000], "photographs": [10, 100], "objects": [10, 100, 1000]}


def solve(relit, maker, sizes, preset, limit):
    """What the report says of one capture, or None where the limit ended the solve."""
    with tempfile.TemporaryDirectory() as folder:
        capture, out = pathlib.Path(folder) / "capture", pathlib.Path(folder) / "out"
        made = subprocess.run([maker, capture, *(str(sizes[k]) for k in ("triangles", "photographs", "objects"))],
                              check=True, capture_output=True, text=True)
        command = [relit, "solve", capture, "--preset", preset, "--views", "none", "--out", out]
        try:
            process = subprocess.run(command, capture_output=True, text=True, timeout=limit)
        except subprocess.TimeoutExpired:
            return made.stdout.split(), None
        if process.returncode:
            return made.stdout.split(), {"error": process.stderr.strip().splitlines()[-1:]}
        return made.stdout.split(), json.loads((out / "report.json").read_text())


def plot(rows, path):
    try:
        import matplotlib
        matplotlib.use("Agg")
        from matplotlib import pyplot
    except ImportError:
        print("no plot: matplotlib is not installed")
        return
    figure, axes = pyplot.subplots(1, 3, figsize=(12, 3.6), sharey=True)
    for axis, name in zip(axes, SWEEPS):
        here = [r for r in rows if r["sweep"] == name and r["seconds"] != ""]
        x = [r[name] for r in here]
        axis.loglog(x, [r["load_seconds"] for r in here], "o:", label="loading, s")
        axis.loglog(x, [r["seconds"] for r in here], "o-", label="solving, s")
        axis.loglog(x, [r["peak_mib"] / 1024 for r in here], "s--", label="peak memory, GiB")
        axis.set_xlabel(name)
        axis.grid(True, which="both", alpha=0.3)
    axes[0].legend()
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--relit", default="target/release/relit")
    parser.add_argument("--maker", default="target/release/scale-bench")
    parser.add_argument("--preset", default="balanced")
    parser.add_argument("--limit", type=float, default=600.0, help="seconds after which a solve is ended")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path(__file__).parent)
    options = parser.parse_args()
    for program in (options.relit, options.maker):
        if not shutil.which(program):
            parser.error(f"{program} is not there: build it first")

    rows = []
    fields = ["sweep", "triangles", "photographs", "objects", "load_seconds", "seconds", "peak_mib", "mrays_per_second", "load_average", "ended"]
    with open(options.out / "scale.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, fields)
        writer.writeheader()
        for sweep, values in (QUICK if options.quick else SWEEPS).items():
            for value in values:
                sizes = {**BASE, sweep: value}
                load = os.getloadavg()[0]
                (triangles, objects), report = solve(options.relit, options.maker, sizes, options.preset, options.limit)
                row = {"sweep": sweep, "triangles": int(triangles), "photographs": sizes["photographs"],
                       "objects": int(objects), "load_average": round(load, 1),
                       "load_seconds": "", "seconds": "", "peak_mib": "", "mrays_per_second": ""}
                if report is None:
                    row["ended"] = f"not within {options.limit:g} s"
                elif "error" in report:
                    row["ended"] = " ".join(report["error"])
                else:
                    row |= {"load_seconds": round(report["seconds_load"], 3), "seconds": round(report["seconds_solve"], 3),
                            "peak_mib": round(report["peak_memory_bytes"] / 2**20),
                            "mrays_per_second": round(report["rays_per_second"] / 1e6, 3),
                            "ended": report["stopped_because"]}
                writer.writerow(row)
                file.flush()
                rows.append(row)
                print(row, flush=True)
    plot(rows, options.out / "scale.png")


if __name__ == "__main__":
    main()
