#!/usr/bin/env python3
"""How often the reported standard errors cover the true errors: over independently rendered photographs of the built-in room.

    benches/coverage/measure.py [--seeds 20] [--samples 64] [--preset balanced] [--relit target/release/relit]

Each seed renders the room anew and solves it with that seed, knowing nothing of the truth. Prints, for albedo a channel,
which share of the errors lies within one and within two reported standard errors, over all objects that are scored,
over those of one colour, and over those that have a texture in truth.
"""

import argparse
import json
import pathlib
import statistics
import subprocess
import tempfile


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--relit", default="target/release/relit")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--samples", type=int, default=64, help="paths a pixel of the photographs")
    parser.add_argument("--preset", default="balanced")
    parser.add_argument("--set", nargs="*", default=[], help="further arguments of relit solve")
    options = parser.parse_args()

    groups = {"all": [], "one colour": [], "textured": []}
    by_object, seconds = {}, []
    for seed in range(1, options.seeds + 1):
        with tempfile.TemporaryDirectory() as folder:
            capture, out = pathlib.Path(folder) / "room", pathlib.Path(folder) / "out"
            subprocess.run([options.relit, "demo", "--out", capture, "--seed", str(seed), "--width", "160",
                            "--samples", str(options.samples)], check=True, capture_output=True)
            subprocess.run([options.relit, "solve", capture, "--preset", options.preset, "--seed", str(seed),
                            "--views", "none", "--out", out, *options.set], check=True, capture_output=True)
            truth = json.loads((capture / "truth.json").read_text())["objects"]
            report = json.loads((out / "report.json").read_text())
            scores = subprocess.run([options.relit, "evaluate", out, "--truth", capture, "--json"],
                                    check=True, capture_output=True, text=True)
        seconds.append(report["seconds_solve"])
        here = []
        for name, score in json.loads(scores.stdout)["per_object"].items():
            if not score["scored"]:
                continue
            errors = zip(score["albedo"], score["albedo_true"], report["objects"][name]["albedo_stderr"])
            z = [abs(found - true) / stderr for found, true, stderr in errors if stderr]
            groups["all"] += z
            groups["textured" if truth[name].get("textured") else "one colour"] += z
            by_object.setdefault(name, []).extend(z)
            here += z
        print(f"seed {seed}: {within(here, 1):.2f} within one, {within(here, 2):.2f} within two, "
              f"{seconds[-1]:.1f} s", flush=True)

    print(f"\n{options.seeds} seeds, {options.preset}, median {statistics.median(seconds):.1f} s")
    for name, z in groups.items():
        if z:
            print(f"{name}: {within(z, 1):.3f} within one, {within(z, 2):.3f} within two, of {len(z)}")
    worst = sorted(by_object.items(), key=lambda item: within(item[1], 2))[:8]
    print("least covered: " + ", ".join(f"{name} {within(z, 2):.2f}" for name, z in worst))


def within(z, bound):
    return sum(x <= bound for x in z) / len(z)


if __name__ == "__main__":
    main()
