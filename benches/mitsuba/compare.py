#!/usr/bin/env python3
"""relit against Mitsuba 3 on one capture, in one run: seconds to the same albedo error.

Mitsuba fits one albedo and one emission an object by path-replay gradients (prb) with Adam, over a stated grid of
settings; relit solves the same capture before and after. Truth is read for scoring, and to tell Mitsuba
which objects are lamps.

    DRJIT_LIBLLVM_PATH=/path/to/libLLVM.so benches/mitsuba/compare.py CAPTURE [--quick] [--relit target/release/relit]

Needs `pip install mitsuba` (3.9) and a libLLVM of 16 or later. The full grid takes about two hours (36 settings
of 180 s), --quick about eight minutes (6 settings of 60 s); --only runs the settings whose description holds a text.
Under `taskset` both programs use the given cores alone.
"""

import argparse
import json
import os
import pathlib
import platform
import struct
import subprocess
import sys
import tempfile
import time

import numpy as np

import drjit as dr
import mitsuba as mi

mi.set_variant("llvm_ad_rgb")
# With a pool of one thread, as on one core, Dr.Jit 1.5 waits for ever.
dr.set_thread_count(max(2, dr.thread_count()))

# What may emit, mode, loss, learning rate of albedo, of emission, samples a pixel (of each buffer). Rates fall to a
# hundredth by the end. "told" favours Mitsuba: it is told which objects are lamps, which relit has to find out; with
# "any" every object may emit, as in relit, and Adam's first steps make all of them lamps.
GRID = [
    (emitters, mode, loss, rates, samples)
    for emitters in ("told", "any")
    for mode in ("batch", "full")
    for loss in ("relative", "l1", "l2")
    for rates, samples in (((0.05, 0.5), 8), ((0.02, 0.2), 8), ((0.05, 0.5), 32))
]
QUICK = [
    ("told", "batch", "relative", (0.05, 0.5), 8),
    ("told", "batch", "relative", (0.02, 0.2), 8),
    ("told", "batch", "l1", (0.05, 0.5), 8),
    ("told", "batch", "l2", (0.05, 0.5), 8),
    ("told", "full", "relative", (0.05, 0.5), 8),
    ("any", "batch", "relative", (0.05, 0.5), 8),
]
PIXELS_PER_BATCH = 4096
DEPTH = 10
DECAY = 0.01


def read_objects(path):
    """Vertices and the triangles of each object of an OBJ file."""
    vertices, objects, name = [], {}, None
    for line in path.read_text().splitlines():
        word, *rest = line.split() or [""]
        if word == "v":
            vertices.append([float(x) for x in rest[:3]])
        elif word in ("o", "g"):
            name = rest[0]
        elif word == "f":
            corners = [int(corner.split("/")[0]) - 1 for corner in rest]
            fan = [(corners[0], corners[k], corners[k + 1]) for k in range(1, len(corners) - 1)]
            objects.setdefault(name, []).extend(fan)
    return np.array(vertices, np.float32), objects


def write_ply(path, vertices, triangles):
    used, faces = np.unique(np.array(triangles), return_inverse=True)
    faces = faces.reshape(-1, 3)
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(used)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    with open(path, "wb") as file:
        file.write(header.encode())
        file.write(vertices[used].astype("<f4").tobytes())
        for face in faces:
            file.write(struct.pack("<B3i", 3, *face))


def sensors_of(transforms):
    """One perspective camera a frame; the capture's cameras look down -z with y up."""
    sensors = []
    width, height = transforms["w"], transforms["h"]
    for frame in transforms["frames"]:
        pose = np.array(frame["transform_matrix"]) @ np.diag([-1.0, 1.0, -1.0, 1.0])
        sensors.append(mi.load_dict({
            "type": "perspective",
            "fov_axis": "x",
            "fov": float(np.degrees(2 * np.arctan(0.5 * width / transforms["fl_x"]))),
            "principal_point_offset_x": transforms["cx"] / width - 0.5,
            "principal_point_offset_y": transforms["cy"] / height - 0.5,
            "to_world": mi.ScalarTransform4f(pose.tolist()),
            "film": {"type": "hdrfilm", "width": width, "height": height, "pixel_format": "rgb",
                     "rfilter": {"type": "box"}, "sample_border": False},
            "sampler": {"type": "independent"},
        }))
    return sensors


def load(capture, folder, may_emit):
    """The scene with albedo 0.5 and no emission everywhere, cameras and photographs; `may_emit` says of an object's name
    whether it may become a lamp."""
    transforms = json.loads((capture / "transforms.json").read_text())
    vertices, objects = read_objects(capture / transforms.get("mesh_path", "mesh.obj"))
    scene = {"type": "scene", "integrator": {"type": "prb", "max_depth": DEPTH, "rr_depth": DEPTH + 1}}
    names = {}
    for index, (name, triangles) in enumerate(objects.items()):
        file = pathlib.Path(folder) / f"{index}.ply"
        write_ply(file, vertices, triangles)
        key = f"object{index}"
        names[key] = name
        scene[key] = {
            "type": "ply", "filename": str(file), "face_normals": True,
            "bsdf": {"type": "twosided", "bsdf": {
                "type": "diffuse", "reflectance": {"type": "rgb", "value": [0.5, 0.5, 0.5]}}},
        }
        if may_emit(name):
            scene[key]["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": [0.0, 0.0, 0.0]}}
    sensors = sensors_of(transforms)
    photographs = []
    for frame in transforms["frames"]:
        bitmap = mi.Bitmap(str(capture / frame["file_path"])).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32)
        photographs.append(mi.TensorXf(np.array(bitmap)))
    # Without this, equal materials are merged into one.
    return mi.load_dict(scene, optimize=False), names, sensors, photographs


def loss_of(kind, buffers, photograph, floor):
    if kind == "l1":
        return dr.mean(dr.abs(buffers[0] - photograph), axis=None)
    if kind == "l2":
        return dr.mean(dr.square(buffers[0] - photograph), axis=None)
    product = (buffers[0] - photograph) * (buffers[1] - photograph)
    return dr.mean(product / dr.square(photograph + floor), axis=None)


def fit(capture, setting, seconds, truth, writer):
    """Adam for a number of seconds; the (seconds, error) curve."""
    emitters, mode, loss_kind, rates, samples = setting
    is_lamp = {name: max(known["emission"]) > 0 for name, known in truth.items()}
    with tempfile.TemporaryDirectory() as folder:
        scene, names, sensors, photographs = load(capture, folder, lambda name: emitters == "any" or is_lamp[name])
    params = mi.traverse(scene)
    albedo = {key: f"{key}.bsdf.brdf_0.reflectance.value" for key in names}
    emission = {key: f"{key}.emitter.radiance.value" for key in names if f"{key}.emitter.radiance.value" in params}
    optimizer = mi.ad.Adam(lr=rates[0])
    for key in [*albedo.values(), *emission.values()]:
        optimizer[key] = params[key]
    params.update(optimizer)
    floor = 0.05 * float(np.mean([np.array(p).mean() for p in photographs]))
    loader = mi.ad.loaders.RayDataLoader(sensors, photographs, PIXELS_PER_BATCH, seed=1) if mode == "batch" else None
    scored = [key for key, name in names.items() if not is_lamp[name]]

    curve, iteration, start, last = [], 0, time.perf_counter(), 0.0
    while (elapsed := time.perf_counter() - start) < seconds:
        decay = DECAY ** (elapsed / seconds)
        optimizer.set_learning_rate({key: rates[0] * decay for key in albedo.values()})
        optimizer.set_learning_rate({key: rates[1] * decay for key in emission.values()})
        if loader:
            photograph, sensor = loader.next()
        else:
            frame = iteration % len(sensors)
            photograph, sensor = photographs[frame], sensors[frame]
        buffers = [
            mi.render(scene, params, sensor=sensor, spp=samples, seed=4 * iteration + 2 * k, seed_grad=4 * iteration + 2 * k + 1)
            for k in range(2 if loss_kind == "relative" else 1)
        ]
        dr.backward(loss_of(loss_kind, buffers, photograph, floor))
        optimizer.step()
        for key in albedo.values():
            optimizer[key] = dr.clip(optimizer[key], 0.0, 0.999)
        for key in emission.values():
            optimizer[key] = dr.maximum(optimizer[key], 0.0)
        params.update(optimizer)
        dr.eval(params)
        iteration += 1
        if iteration <= 2 or elapsed - last >= 0.5:
            errors = [
                np.abs(np.array(params[albedo[key]]).ravel() - np.array(truth[names[key]]["albedo"])).mean()
                for key in scored
            ]
            last = time.perf_counter() - start
            curve.append((last, float(np.mean(errors))))
            writer.write(f"{describe(setting)},{iteration},{last:.3f},{curve[-1][1]:.6f}\n")
    writer.flush()
    return iteration, curve


def describe(setting):
    emitters, mode, loss_kind, rates, samples = setting
    return f"{emitters} {mode} {loss_kind} {rates[0]}/{rates[1]} spp {samples}"


def solve(relit, capture, preset):
    """Seconds and albedo error of relit."""
    with tempfile.TemporaryDirectory() as out:
        subprocess.run([relit, "solve", capture, "--preset", preset, "--out", out, "--views", "none"],
                       check=True, capture_output=True)
        report = json.loads((pathlib.Path(out) / "report.json").read_text())
        scores = subprocess.run([relit, "evaluate", out, "--truth", capture, "--json"],
                                check=True, capture_output=True, text=True)
    return report["seconds_solve"], json.loads(scores.stdout)["albedo_mae"], report["rays_per_second"]


def reached(curve, error):
    """First second after which the curve stays at or below an error, or None."""
    answer = None
    for second, value in curve:
        if value > error:
            answer = None
        elif answer is None:
            answer = second
    return answer


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture", type=pathlib.Path)
    parser.add_argument("--relit", default="target/release/relit")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--only", default="", help="the settings that hold this text, such as 'told batch l2'")
    parser.add_argument("--seconds", type=float, help="budget of each setting")
    parser.add_argument("--out", default="mitsuba.csv")
    options = parser.parse_args()
    grid = [setting for setting in (QUICK if options.quick else GRID) if options.only in describe(setting)]
    if not grid:
        parser.error(f"--only: no setting holds {options.only!r}; a full run lists them all")
    seconds = options.seconds or (60.0 if options.quick else 180.0)
    truth = json.loads((options.capture / "truth.json").read_text())["objects"]

    print(f"Mitsuba {mi.__version__}, Dr.Jit {dr.__version__}, {platform.machine()}, {len(os.sched_getaffinity(0))} cores, "
          f"load {os.getloadavg()[0]:.1f} at the start")
    print(f"grid: {len(grid)} settings of {seconds:g} s, {PIXELS_PER_BATCH} pixels a batch or one photograph in turn, "
          f"depth {DEPTH}, rates falling to {DECAY:g} of the first")
    for setting in grid:
        print("  " + describe(setting))

    presets = ("preview", "balanced")
    ours = {preset: [solve(options.relit, options.capture, preset)] for preset in presets}
    curves = {}
    with open(options.out, "w") as writer:
        writer.write("setting,iteration,seconds,albedo_error\n")
        for setting in grid:
            iterations, curve = fit(options.capture, setting, seconds, truth, writer)
            curves[describe(setting)] = curve
            best = min(error for _, error in curve)
            print(f"{describe(setting):32} {iterations:6} iterations, first {curve[0][0]:.1f} s; "
                  f"error {best:.4f} at best, {curve[-1][1]:.4f} at the end", flush=True)
    for preset in presets:
        ours[preset].append(solve(options.relit, options.capture, preset))

    print(f"load {os.getloadavg()[0]:.1f} at the end\n\n| albedo error | relit | Mitsuba, best of the grid | ratio |\n| --- | --- | --- | --- |")
    start = min(curve[0][1] for curve in curves.values())
    lowest = min(curve[-1][1] for curve in curves.values())
    targets = sorted({e for e in (0.1, 0.05, 0.03, 0.02, 0.01, round(lowest * 1.0001, 5), 0.003) if e < start}, reverse=True)
    for error in targets:
        # The slower of the two runs of the quickest preset that is good enough in both.
        good = [max(run[0] for run in runs) for runs in ours.values() if max(run[1] for run in runs) <= error]
        times = {name: second for name, curve in curves.items() if (second := reached(curve, error)) is not None}
        mine = f"{min(good):.2f} s" if good else "not reached"
        if times:
            name = min(times, key=times.get)
            theirs = f"{times[name]:.1f} s ({name})"
        else:
            theirs = f"not within {seconds:g} s"
        ratio = f"{min(times.values()) / min(good):.0f}" if good and times else f"> {seconds / min(good):.0f}" if good else ""
        print(f"| {error:g} | {mine} | {theirs} | {ratio} |")
    for preset, runs in ours.items():
        print(f"relit {preset}: " + "; ".join(f"{s:.2f} s, error {e:.4f}, {r / 1e6:.2f} Mrays/s" for s, e, r in runs))


if __name__ == "__main__":
    sys.exit(main())
