#!/usr/bin/env python3
"""How well photographs that no fit has seen are rendered again: PSNR and SSIM of every eighth one.

    benches/photographs/measure.py CAPTURE [--time 300s] [--samples 32] [--relit target/release/relit] [--pictures DIR] [--free]

Solves with `--hold-out 8`, renders frames 0, 8, 16, … and compares sRGB values from 0 to 1 at 270 × 180 pixels: one gain
a channel is fitted on the left half of each picture, the right half is scored, every pixel whose ray hits the mesh counts.
`--free` scores a free colour for each triangle beside it, the mean of what the other photographs show of it at the exposures that
relit found, and one colour for each segment, the mean of what they show of that: no light, no materials, nothing that an object
could be put into.
For captures with a mesh in PLY or OBJ and pinhole cameras. Needs `pip install mitsuba scipy pillow trimesh`; `DRJIT_LIBLLVM_PATH` as for
benches/mitsuba.
"""

import argparse
import json
import pathlib
import subprocess
import tempfile

import mitsuba as mi
import numpy as np
import trimesh
from PIL import Image
from scipy.ndimage import gaussian_filter
from scipy.spatial import KDTree

mi.set_variant("llvm_ad_rgb")
WIDTH, HEIGHT = 270, 180


def to_srgb(x):
    x = np.clip(x, 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def to_linear(x):
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)


def reduced(picture):
    """Means over blocks of pixels."""
    height, width = picture.shape[:2]
    down = min(width // WIDTH, height // HEIGHT)
    picture = picture[: HEIGHT * down, : WIDTH * down]
    return picture.reshape(HEIGHT, down, WIDTH, down, 3).mean((1, 3))


def ssim(a, b, mask):
    a, b = a.mean(2), b.mean(2)
    blur = lambda x: gaussian_filter(x, 1.5)
    ma, mb = blur(a), blur(b)
    va, vb, c = blur(a * a) - ma * ma, blur(b * b) - mb * mb, blur(a * b) - ma * mb
    values = ((2 * ma * mb + 1e-4) * (2 * c + 9e-4)) / ((ma**2 + mb**2 + 1e-4) * (va + vb + 9e-4))
    return values[mask].mean()


def triangles(scene, transforms, frame):
    """The triangle that the central ray of each pixel meets; -1 where it meets none."""
    lens = {key: frame.get(key, transforms.get(key)) for key in ("fl_x", "fl_y", "cx", "cy", "w", "h")}
    pose = np.array(frame["transform_matrix"])
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
    x, y = x * lens["w"] / WIDTH, y * lens["h"] / HEIGHT
    local = np.stack([(x - lens["cx"]) / lens["fl_x"], -(y - lens["cy"]) / lens["fl_y"], -np.ones_like(x)], -1)
    directions = local.reshape(-1, 3) @ pose[:3, :3].T
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    origins = np.repeat(pose[:3, 3][None], len(directions), 0)
    ray = mi.Ray3f(mi.Point3f(origins.T.astype("f4")), mi.Vector3f(directions.T.astype("f4")))
    met = scene.ray_intersect_preliminary(ray)
    return np.where(np.array(met.is_valid()), np.array(met.prim_index).astype(np.int64), -1).reshape(HEIGHT, WIDTH)


def linear(capture, frame):
    """A photograph in linear light, reduced."""
    pixels = np.array(Image.open(capture / frame["file_path"]).convert("RGB"))
    return reduced(to_linear(pixels / 255.0))


def segments(scene, results):
    """The segment of each triangle: the object of `scene.glb` whose triangle lies where it does."""
    found = list(trimesh.load(results / "scene.glb").geometry.values())
    tree = KDTree(np.concatenate([part.triangles_center for part in found]))
    numbers = np.repeat(np.arange(len(found)), [len(part.faces) for part in found])
    middles = []
    for shape in scene.shapes():
        parameters = mi.traverse(shape)
        corners = np.array(parameters["vertex_positions"]).reshape(-1, 3)
        middles.append(corners[np.array(parameters["faces"]).reshape(-1, 3)].mean(1))
    return numbers[tree.query(np.concatenate(middles))[1]]


def free_colors(scene, transforms, capture, exposures, group):
    """For each group of triangles the mean of what the photographs that are not held out show of it; the mean of all where none does."""
    count = group.max() + 1
    sums, seen = np.zeros((count, 3)), np.zeros(count)
    for index, frame in enumerate(transforms["frames"]):
        if index % 8:
            met = triangles(scene, transforms, frame)
            shown = (linear(capture, frame) / exposures[index])[met >= 0]
            of = group[met[met >= 0]]
            seen += np.bincount(of, minlength=count)
            for c in range(3):
                sums[:, c] += np.bincount(of, shown[:, c], count)
    known = seen > 0
    colors = np.empty((count, 3))
    colors[known] = sums[known] / seen[known, None]
    colors[~known] = colors[known].mean(0)
    return colors[group]


def gains(rendered, photograph, mask):
    """One factor a channel with the least squared error in sRGB."""
    found = np.ones(3)
    for c in range(3):
        r, p = rendered[mask][:, c], photograph[mask][:, c]
        found[c] = (to_linear(p) * r).sum() / max((r * r).sum(), 1e-9)
        for width in (0.6, 0.15, 0.05):
            tried = found[c] * np.exp(np.linspace(-width, width, 61))
            found[c] = tried[int(np.argmin([((to_srgb(g * r) - p) ** 2).mean() for g in tried]))]
    return found


def score(rendered, photograph, mask):
    """What is shown at the gains of the left half, with its squared error on the right half and the pixels that count there."""
    left = np.arange(WIDTH)[None, :] < WIDTH // 2
    shown = to_srgb(rendered * gains(rendered, photograph, mask & left))
    scored = mask & ~left
    return shown, ((shown[scored] - photograph[scored]) ** 2).mean(), scored


def decibels(squares):
    each = -10 * np.log10(np.array(squares))
    return f"mean {each.mean():.2f} dB, of the pooled error {-10 * np.log10(np.mean(squares)):.2f} dB"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture", type=pathlib.Path)
    parser.add_argument("--relit", default="target/release/relit")
    parser.add_argument("--time", default="300s")
    parser.add_argument("--samples", default="32", help="paths a pixel of the renderings")
    parser.add_argument("--pictures", type=pathlib.Path, help="writes photograph and rendering side by side")
    parser.add_argument("--free", action="store_true", help="scores a free colour for each triangle too")
    options = parser.parse_args()
    transforms = json.loads((options.capture / "transforms.json").read_text())
    mesh = options.capture / transforms["mesh_path"]
    scene = mi.load_dict({"type": "scene", "mesh": {"type": mesh.suffix[1:], "filename": str(mesh)}})
    squares, similar, covered = [], [], []
    free = {"a free colour for each triangle": [], "one colour for each segment": []}
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([options.relit, "solve", options.capture, "--hold-out", "8", "--time", options.time, "--views", "none",
                        "--out", folder], check=True, capture_output=True)
        report = json.loads((pathlib.Path(folder) / "report.json").read_text())
        print(f"solved in {report['seconds_solve']:.0f} s ({report['stopped_because']})", flush=True)
        exposures = np.array(report.get("exposures") or np.ones((len(transforms["frames"]), 3)))
        colors = []
        if options.free:
            each = np.arange(sum(shape.face_count() for shape in scene.shapes()))
            groups = [each, segments(scene, pathlib.Path(folder))]
            colors = [free_colors(scene, transforms, options.capture, exposures, group) for group in groups]
        for index in range(0, len(transforms["frames"]), 8):
            frame = transforms["frames"][index]
            file = pathlib.Path(folder) / "rendered.exr"
            subprocess.run([options.relit, "render", folder, "--frame", str(index), "--spp", options.samples, "--out", file],
                           check=True, capture_output=True)
            rendered = mi.Bitmap(str(file)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32)
            photograph = to_srgb(linear(options.capture, frame))
            met = triangles(scene, transforms, frame)
            shown, square, scored = score(reduced(np.array(rendered)), photograph, met >= 0)
            squares.append(square)
            similar.append(ssim(shown, photograph, scored))
            covered.append((met >= 0).mean())
            line = f"frame {index:3}: {-10 * np.log10(square):5.2f} dB, SSIM {similar[-1]:.3f}"
            for (what, found), shown_by in zip(free.items(), colors):
                found.append(score(np.where((met >= 0)[..., None], shown_by[met], 0), photograph, met >= 0)[1])
                line += f", {what} {-10 * np.log10(found[-1]):5.2f} dB"
            print(line, flush=True)
            if options.pictures:
                options.pictures.mkdir(parents=True, exist_ok=True)
                both = (np.concatenate([photograph, shown], 1) * 255).astype(np.uint8)
                Image.fromarray(both).save(options.pictures / f"{index:03}.png")
    print(f"{decibels(squares)}, SSIM {np.mean(similar):.3f}, rays that hit the mesh {np.mean(covered):.2f}")
    for what, found in free.items():
        if found:
            print(f"{what}: {decibels(found)}")


if __name__ == "__main__":
    main()
