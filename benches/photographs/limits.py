#!/usr/bin/env python3
"""What limits photographs rendered again: scores of a free colour for each triangle with one hindrance after the other taken away.

    benches/photographs/limits.py CAPTURE DIR

DIR holds the results of `relit solve CAPTURE --hold-out 8 --out DIR`. A triangle's colour is the mean of what the photographs that are
not held out show of it: no light, no materials, so that geometry, poses, blur, exposure and coverage are all that hold it back. Scored
as by measure.py, with exposures at one, with those that relit found, with the vignetting that it found, and with the poses of the
photographs that are not held out refined against the colours of the others. Then the squared error by kind of pixel.
"""

import argparse
import json
import pathlib

import mitsuba as mi
import numpy as np
from scipy.ndimage import gaussian_filter

from measure import HEIGHT, WIDTH, decibels, linear, score, to_srgb

ROUNDS = 6
JUMP = 0.03


class Scan:
    def __init__(self, capture):
        self.transforms = json.loads((capture / "transforms.json").read_text())
        frames = self.transforms["frames"]
        mesh = capture / self.transforms["mesh_path"]
        self.scene = mi.load_dict({"type": "scene", "mesh": {"type": mesh.suffix[1:], "filename": str(mesh)}})
        self.count = sum(shape.face_count() for shape in self.scene.shapes())
        self.taken = [linear(capture, frame).reshape(-1, 3) for frame in frames]
        lens = {key: self.transforms[key] for key in ("fl_x", "fl_y", "cx", "cy", "w", "h")}
        self.fx, self.fy = lens["fl_x"] * WIDTH / lens["w"], lens["fl_y"] * HEIGHT / lens["h"]
        y, x = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
        self.x = ((x - lens["cx"] * WIDTH / lens["w"]) / self.fx).ravel()
        self.y = ((y - lens["cy"] * HEIGHT / lens["h"]) / self.fy).ravel()
        self.poses = [np.array(frame["transform_matrix"]) for frame in frames]
        self.hits = [self.cast(pose) for pose in self.poses]
        self.fitted = [index for index in range(len(frames)) if index % 8]
        self.held_out = range(0, len(frames), 8)

    def cast(self, pose):
        """Triangle (-1 for none) and depth behind each pixel."""
        local = np.stack([self.x, -self.y, -np.ones_like(self.x)], -1)
        directions, origins = local @ pose[:3, :3].T, np.repeat(pose[:3, 3][None], len(local), 0)
        ray = mi.Ray3f(mi.Point3f(origins.T.astype("f4")), mi.Vector3f(directions.T.astype("f4")))
        met = self.scene.ray_intersect_preliminary(ray)
        valid = np.array(met.is_valid())
        return np.where(valid, np.array(met.prim_index).astype(np.int64), -1), np.where(valid, np.array(met.t), 0)

    def sums(self, factors, frames):
        sums, seen = np.zeros((self.count, 3)), np.zeros(self.count)
        for index in frames:
            met = self.hits[index][0]
            good = met >= 0
            shown = (self.taken[index] / factors[index])[good]
            seen += np.bincount(met[good], minlength=self.count)
            for c in range(3):
                sums[:, c] += np.bincount(met[good], shown[:, c], self.count)
        return sums, seen

    def colors(self, factors):
        sums, seen = self.sums(factors, self.fitted)
        known = seen > 0
        colors = np.empty_like(sums)
        colors[known] = sums[known] / seen[known, None]
        colors[~known] = colors[known].mean(0)
        return colors, seen

    def scored(self, factors, colors):
        """Index, photograph, what is shown of it, squared error and scored pixels of each held-out photograph."""
        found = []
        for index in self.held_out:
            met = self.hits[index][0].reshape(HEIGHT, WIDTH)
            rendered = np.where((met >= 0)[..., None], colors[met], 0) * factors[index].reshape(HEIGHT, WIDTH, 3)
            photograph = to_srgb(self.taken[index]).reshape(HEIGHT, WIDTH, 3)
            found.append((index, photograph, *score(rendered, photograph, met >= 0)))
        return found

    def aligned(self, index, factors, sums, seen):
        """Moves a photograph's camera by one robust Gauss-Newton step towards what the others show; returns the median shift in pixels."""
        met, depth = self.hits[index]
        own, own_seen = self.sums(factors, [index])
        others = seen - own_seen
        colors = (sums - own) / np.maximum(others, 1)[:, None]
        known = (met >= 0) & (others[np.maximum(met, 0)] > 0)
        model = np.where(known[:, None], to_srgb(colors[np.maximum(met, 0)] * factors[index]), 0).mean(1)
        picture = np.where(known, to_srgb(self.taken[index]).mean(1), 0)
        shaped = lambda values: values.reshape(HEIGHT, WIDTH).astype(float)
        weight = gaussian_filter(shaped(known), 1)
        smooth = lambda values: gaussian_filter(shaped(values), 1) / np.maximum(weight, 1e-3)
        model, picture = smooth(model), smooth(picture)
        down, right = np.gradient(0.5 * (model + picture))
        flat = np.hypot(*np.gradient(shaped(depth))) < JUMP * shaped(depth)
        used = (shaped(known) > 0) & (weight > 0.9) & flat
        z = shaped(depth)[used]
        points = np.stack([shaped(self.x)[used] * z, shaped(self.y)[used] * z, z], 1)
        # How the pictures of the points move with the camera: turns about its axes, then steps along them.
        moves = np.zeros((len(z), 6, 2))
        for axis in range(3):
            unit = np.eye(3)[axis]
            for column, moved in ((axis, -np.cross(unit, points)), (3 + axis, -np.repeat(unit[None], len(z), 0))):
                moves[:, column, 0] = self.fx * (moved[:, 0] - points[:, 0] / z * moved[:, 2]) / z
                moves[:, column, 1] = self.fy * (moved[:, 1] - points[:, 1] / z * moved[:, 2]) / z
        slopes = -(right[used][:, None] * moves[:, :, 0] + down[used][:, None] * moves[:, :, 1])
        residual = (picture - model)[used]
        scale = 1.4826 * np.median(np.abs(residual))
        robust = 1 / (1 + (residual / (2 * scale)) ** 2) ** 2
        matrix = (slopes * robust[:, None]).T @ slopes
        step = np.linalg.solve(matrix + 1e-6 * np.diag(np.diag(matrix)), (slopes * robust[:, None]).T @ residual)
        # From x right, y down, z forwards to the pose's axes.
        turn, along = step[:3] * [1, -1, -1], step[3:] * [1, -1, -1]
        angle = np.linalg.norm(turn)
        cross = np.array([[0, -turn[2], turn[1]], [turn[2], 0, -turn[0]], [-turn[1], turn[0], 0]])
        change = np.eye(4)
        change[:3, :3] += np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * cross @ cross
        change[:3, 3] = along
        self.poses[index] = self.poses[index] @ change
        self.hits[index] = self.cast(self.poses[index])
        return np.median(np.hypot(*np.einsum("nkc,k->cn", moves, step)))


def kinds(scan, index, photograph, seen):
    """Masks of the kinds of pixels, each pixel in the first that fits."""
    met, depth = (values.reshape(HEIGHT, WIDTH) for values in scan.hits[index])
    times = np.where(met >= 0, seen[np.maximum(met, 0)], 0)
    jump = np.hypot(*np.gradient(depth)) > JUMP * np.maximum(depth, 1e-3)
    edge = np.hypot(*np.gradient(photograph.mean(2))) > 0.06
    yield "on triangles that no other photograph shows", times == 0
    yield "on triangles that others show in three pixels or fewer", times <= 3
    yield "at silhouettes", jump
    yield "at edges of the photograph", edge
    yield "saturated", photograph.max(2) > 0.98
    yield "others", np.ones_like(jump)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture", type=pathlib.Path)
    parser.add_argument("results", type=pathlib.Path)
    options = parser.parse_args()
    scan = Scan(options.capture)
    report = json.loads((options.results / "report.json").read_text())
    ones = np.ones((len(scan.taken), 1, 3))
    factors = ones if report["exposures"] is None else np.array(report["exposures"])[:, None, :]
    cosine = (1 + scan.x**2 + scan.y**2) ** -0.5
    lens = cosine[:, None] ** np.array(report.get("vignetting") or [0.0] * 3)
    dimmed = factors * lens
    for name, used in (("as they are", ones * lens**0), ("at the exposures found", factors * lens**0), ("and the vignetting found", dimmed)):
        print(f"{name}: {decibels([square for *_, square, _ in scan.scored(used, scan.colors(used)[0])])}")
    for turn in range(ROUNDS):
        sums, seen = scan.sums(dimmed, scan.fitted)
        shifts = [scan.aligned(index, dimmed, sums, seen) for index in scan.fitted]
        if turn == 0:
            print(f"a first step towards the others moves the pictures by {np.median(shifts):.2f} pixels in the median")
    colors, seen = scan.colors(dimmed)
    found = scan.scored(dimmed, colors)
    print(f"and poses refined: {decibels([square for *_, square, _ in found])}")
    pixels, errors = {}, {}
    for index, photograph, shown, _, scored in found:
        left = scored.copy()
        squared = ((shown - photograph) ** 2).mean(2)
        for name, mask in kinds(scan, index, photograph, seen):
            of_kind = mask & left
            left &= ~mask
            pixels[name] = pixels.get(name, 0) + of_kind.sum()
            errors[name] = errors.get(name, 0) + squared[of_kind].sum()
    print("| pixels | share | of the squared error | by themselves |\n| --- | --- | --- | --- |")
    for name, count in pixels.items():
        share, error = count / sum(pixels.values()), errors[name] / sum(errors.values())
        print(f"| {name} | {share:.1%} | {error:.0%} | {-10 * np.log10(errors[name] / count):.1f} dB |")


if __name__ == "__main__":
    main()
