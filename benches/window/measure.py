#!/usr/bin/env python3
"""Rays a second of a solve with the window open, as a share of the same solve without one.

    benches/window/measure.py CAPTURE [--seconds 30] [--runs 3] [--preset reference] [--size 1280x800] [--relit target/release/relit]

The two run in turn for the same time, so that both see the same machine. The window is a real one on a virtual screen (Xvfb, drawn
by the software renderer where there is no graphics card); it is left alone, then told by its keys to save. Rays are those of the
solver alone, seconds are wall time from the end of loading to the save, so that everything that the window costs counts. Needs Xvfb
and xdotool. Give a preset that goes on for longer than the time.
"""

import argparse
import json
import os
import pathlib
import statistics
import subprocess
import tempfile
import time


def rate(folder):
    report = json.loads((folder / "report.json").read_text())
    seconds = report["seconds"] - report["seconds_load"] - report["seconds_write"]
    return report["rays"] / seconds / 1e6, report["stopped_because"], seconds, report["seconds_load"]


def headless(relit, capture, preset, seconds, work):
    out = work / "headless"
    subprocess.run([relit, "solve", capture, "--preset", preset, "--time", str(seconds), "--views", "none", "--out", out],
                   check=True, capture_output=True)
    return rate(out)


def keys(*arguments):
    return subprocess.run(["xdotool", *arguments], capture_output=True, text=True, check=False).stdout.split()


def window(relit, capture, preset, seconds, load, work):
    out = work / "window"
    started = time.monotonic()
    program = subprocess.Popen([relit, capture, "--preset", preset], cwd=work, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        found = []
        while not found and time.monotonic() - started < 60:
            time.sleep(0.3)
            found = keys("search", "--onlyvisible", "--name", "^relit")
        keys("windowfocus", found[-1])
        time.sleep(max(0.0, load + seconds - 4.0 - (time.monotonic() - started)))
        # The sheet is opened and filled beforehand, so that only the last key is on time.
        keys("key", "ctrl+s")
        time.sleep(1.0)
        keys("key", "ctrl+a")
        keys("type", "--delay", "15", str(out))
        time.sleep(max(0.0, load + seconds - (time.monotonic() - started)))
        keys("key", "Return")
        while not (out / "report.json").exists():
            if program.poll() is not None or time.monotonic() - started > load + seconds + 300:
                raise SystemExit("the window did not save")
            time.sleep(0.3)
        time.sleep(0.5)
        return rate(out)
    finally:
        program.kill()
        program.wait()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture")
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--preset", default="reference")
    parser.add_argument("--size", default="1280x800")
    parser.add_argument("--relit", default="target/release/relit")
    options = parser.parse_args()
    relit, capture = os.path.abspath(options.relit), os.path.abspath(options.capture)

    with tempfile.TemporaryDirectory() as folder:
        read, write = os.pipe()
        screen = subprocess.Popen(["Xvfb", "-displayfd", str(write), "-screen", "0", f"{options.size}x24"], pass_fds=[write],
                                  stderr=subprocess.DEVNULL)
        try:
            os.environ["DISPLAY"] = ":" + os.read(read, 16).decode().strip()
            os.environ["XDG_CONFIG_HOME"] = os.environ["XDG_STATE_HOME"] = os.environ["XDG_RUNTIME_DIR"] = folder
            os.environ.pop("WAYLAND_DISPLAY", None)
            print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} at the start, {options.preset}, screen of {options.size}")
            print("| run | headless, Mrays/s | window open, Mrays/s | share |\n| --- | --- | --- | --- |")
            shares = []
            for run in range(options.runs):
                with tempfile.TemporaryDirectory() as work:
                    work = pathlib.Path(work)
                    # The second run of a pair goes first in the next one, against drift.
                    if run % 2 == 0:
                        alone = headless(relit, capture, options.preset, options.seconds, work)
                        shown = window(relit, capture, options.preset, options.seconds, alone[3], work)
                    else:
                        shown = window(relit, capture, options.preset, options.seconds, 0.5, work)
                        alone = headless(relit, capture, options.preset, shown[2], work)
                    if shown[1] is not None or alone[1] != "time":
                        print(f"the solve ended by itself ({alone[1]}, {shown[1]}); name a longer preset or fewer seconds")
                    shares.append(shown[0] / alone[0])
                    print(f"| {run + 1} | {alone[0]:.3f} | {shown[0]:.3f} | {shares[-1]:.2f} |", flush=True)
            print(f"median share {statistics.median(shares):.2f} ({min(shares):.2f}–{max(shares):.2f}); "
                  f"load {os.getloadavg()[0]:.1f} at the end")
        finally:
            screen.kill()
            screen.wait()


if __name__ == "__main__":
    main()
