#!/usr/bin/env python3
"""Renders a room with three rough objects among diffuse ones by Mitsuba 3, as a capture with its truth.

    pip install mitsuba
    DRJIT_LIBLLVM_PATH=... benches/rough/make.py CAPTURE [--plastic | --diffuse] [--samples 512] [--size 160]
    relit solve CAPTURE --out DIR && benches/rough/judge.py CAPTURE DIR

The rough objects scatter as relit's formulas say, written here as a BSDF of their own; all else is Mitsuba. With --plastic
they are Mitsuba's `roughplastic` (GGX, linear) of the same reflectance at normal incidence. It differs from relit's lobe: its Fresnel term is that of a
dielectric where relit takes Schlick's with the same reflectance at normal incidence, and its base loses light in the
interface. The albedo in truth.json is therefore what relit's base would have to have to reflect as much of light that leaves
straight up: the ratio is found by quadrature. With --diffuse the same three objects are diffuse: none may get a lobe.
"""
import argparse
import json
import math
import os

import mitsuba as mi
import drjit as dr
import numpy as np

mi.set_variant("llvm_ad_rgb" if os.environ.get("DRJIT_LIBLLVM_PATH") else "scalar_rgb")

WIDTH, HEIGHT, DEPTH = 4.0, 2.6, 5.0
ALBEDO = {
    "floor": [0.45, 0.36, 0.28],
    "ceiling": [0.80, 0.80, 0.78],
    "wall-left": [0.60, 0.25, 0.18],
    "wall-right": [0.25, 0.45, 0.60],
    "wall-back": [0.70, 0.68, 0.60],
    "wall-front": [0.62, 0.66, 0.60],
    "stool": [0.20, 0.20, 0.45],
    "shelf": [0.55, 0.50, 0.30],
    "table": [0.45, 0.28, 0.14],
    "ball": [0.15, 0.35, 0.20],
    "cabinet": [0.35, 0.30, 0.40],
}
# GGX roughness and specular reflectance at normal incidence.
ROUGH = {"table": (0.10, 0.04), "ball": (0.25, 0.14), "cabinet": (0.50, 0.25)}
LAMP = [17.0, 15.0, 12.0]
CAMERAS = [
    ((2.0, 1.6, 4.6), (2.0, 0.7, 1.5)),
    ((0.4, 1.5, 4.5), (2.5, 0.7, 1.8)),
    ((3.6, 1.7, 4.4), (1.3, 0.6, 1.5)),
    ((3.5, 1.6, 0.5), (1.2, 0.6, 3.6)),
    ((0.5, 1.7, 0.4), (2.8, 0.6, 3.8)),
    ((2.0, 1.5, 0.3), (2.0, 0.7, 4.0)),
    ((3.6, 1.4, 2.2), (0.4, 0.8, 2.4)),
    ((0.3, 1.3, 2.6), (3.6, 0.9, 2.8)),
    ((2.2, 2.2, 3.9), (1.8, 0.4, 1.8)),
    ((1.4, 1.0, 1.2), (3.0, 0.9, 3.6)),
    ((0.8, 2.1, 3.3), (2.6, 0.6, 2.0)),
    ((2.6, 1.1, 1.0), (1.0, 1.9, 4.6)),
]


class Rough(mi.BSDF):
    """A GGX lobe (height-correlated Smith, Schlick) over a diffuse base: f cos is

    albedo (1 - F0) cos_i/pi (1 - r(cos_o)) (1 - r(cos_i)) / (1 - mean r) + (F0 + (1 - F0) (1 - wo.h)^5) D G2 / (4 cos_o)
    with r(c) = (1 - 0.85 c)^5.
    """

    def __init__(self, properties):
        mi.BSDF.__init__(self, properties)
        self.alpha = float(properties["alpha"])
        self.specular = float(properties["specular"])
        self.albedo = mi.Color3f(properties["albedo"])
        self.normals = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, self.alpha, True)
        flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
        self.m_components = [flags]
        self.m_flags = flags

    def value_and_density(self, wi, wo):
        above = (wi.z > 0) & (wo.z > 0)
        h = dr.normalize(wi + wo)
        a2 = self.alpha**2
        q = (h.x * h.x + h.y * h.y) / a2 + h.z * h.z
        distribution = 1 / (math.pi * a2 * q * q)

        def smith(w):
            return dr.sqrt(w.z * w.z + a2 * (w.x * w.x + w.y * w.y))

        fresnel = self.specular + (1 - self.specular) * (1 - dr.clip(dr.dot(wi, h), 0, 1)) ** 5
        lobe = fresnel * 0.5 * distribution * wo.z / (wo.z * smith(wi) + wi.z * smith(wo))

        def taken(cosine):
            return 1 - (1 - 0.85 * cosine) ** 5

        mean = (1 - 0.15**6 * (1 + 6 * 0.85)) / (21 * 0.85**2)
        coupling = wo.z / math.pi * taken(wi.z) * taken(wo.z) / (1 - mean)
        value = self.albedo * ((1 - self.specular) * coupling) + lobe
        density = 0.5 * self.normals.pdf(wi, h) / (4 * dr.dot(wo, h)) + 0.5 * wo.z / math.pi
        return dr.select(above, value, 0), dr.select(above, density, 0)

    def upwards(self, si, wo):
        side = dr.select(si.wi.z < 0, -1.0, 1.0)
        return side, mi.Vector3f(si.wi.x, si.wi.y, si.wi.z * side), mi.Vector3f(wo.x, wo.y, wo.z * side)

    def sample(self, ctx, si, sample1, sample2, active):
        side, wi, _ = self.upwards(si, si.wi)
        h, _ = self.normals.sample(wi, sample2)
        wo = dr.select(sample1 < 0.5, mi.reflect(wi, h), mi.warp.square_to_cosine_hemisphere(sample2))
        value, density = self.value_and_density(wi, wo)
        drawn = mi.BSDFSample3f()
        drawn.wo = mi.Vector3f(wo.x, wo.y, wo.z * side)
        drawn.pdf = density
        drawn.eta = 1.0
        drawn.sampled_type = mi.UInt32(+mi.BSDFFlags.GlossyReflection)
        drawn.sampled_component = 0
        usable = active & (density > 0)
        return drawn, dr.select(usable, value / density, 0)

    def eval(self, ctx, si, wo, active):
        _, wi, wo = self.upwards(si, wo)
        return dr.select(active, self.value_and_density(wi, wo)[0], 0)

    def pdf(self, ctx, si, wo, active):
        _, wi, wo = self.upwards(si, wo)
        return dr.select(active, self.value_and_density(wi, wo)[1], 0)

    def eval_pdf(self, ctx, si, wo, active):
        _, wi, wo = self.upwards(si, wo)
        value, density = self.value_and_density(wi, wo)
        return dr.select(active, value, 0), dr.select(active, density, 0)

    def to_string(self):
        return f"Rough[{self.alpha}, {self.specular}]"


mi.register_bsdf("rough", lambda properties: Rough(properties))


def refraction(specular):
    """The index of refraction of a dielectric that reflects so much at normal incidence."""
    root = math.sqrt(specular)
    return (1 + root) / (1 - root)


def room():
    """Triangles of each object: fronts look into the room, or outwards of what stands in it."""
    objects = {}

    def quad(name, a, b, c, d):
        objects.setdefault(name, []).extend([(a, b, c), (a, c, d)])

    def block(name, low, high, turn=0.0):
        (x0, y0, z0), (x1, y1, z1) = low, high
        cx, cz = (x0 + x1) / 2, (z0 + z1) / 2
        cos, sin = math.cos(turn), math.sin(turn)

        def at(x, y, z):
            return (cx + (x - cx) * cos + (z - cz) * sin, y, cz - (x - cx) * sin + (z - cz) * cos)

        quad(name, at(x0, y0, z1), at(x1, y0, z1), at(x1, y1, z1), at(x0, y1, z1))
        quad(name, at(x1, y0, z0), at(x0, y0, z0), at(x0, y1, z0), at(x1, y1, z0))
        quad(name, at(x1, y0, z1), at(x1, y0, z0), at(x1, y1, z0), at(x1, y1, z1))
        quad(name, at(x0, y0, z0), at(x0, y0, z1), at(x0, y1, z1), at(x0, y1, z0))
        quad(name, at(x0, y1, z1), at(x1, y1, z1), at(x1, y1, z0), at(x0, y1, z0))
        quad(name, at(x0, y0, z0), at(x1, y0, z0), at(x1, y0, z1), at(x0, y0, z1))

    w, h, d = WIDTH, HEIGHT, DEPTH
    quad("floor", (0, 0, 0), (0, 0, d), (w, 0, d), (w, 0, 0))
    quad("ceiling", (0, h, 0), (w, h, 0), (w, h, d), (0, h, d))
    quad("wall-left", (0, 0, 0), (0, h, 0), (0, h, d), (0, 0, d))
    quad("wall-right", (w, 0, 0), (w, 0, d), (w, h, d), (w, h, 0))
    quad("wall-back", (0, 0, d), (0, h, d), (w, h, d), (w, 0, d))
    quad("wall-front", (0, 0, 0), (w, 0, 0), (w, h, 0), (0, h, 0))
    block("table", (1.5, 0.0, 1.9), (2.7, 0.7, 2.7), 0.3)
    block("cabinet", (3.3, 0.0, 3.0), (3.95, 1.5, 4.4))
    block("stool", (0.5, 0.0, 1.1), (0.95, 0.5, 1.55), 0.5)
    block("shelf", (0.03, 1.2, 3.2), (0.35, 1.6, 4.4))
    lamp = 0.5
    y, (cx, cz) = h - 0.02, (1.8, 2.4)
    quad("lamp", (cx - lamp, y, cz - lamp), (cx + lamp, y, cz - lamp), (cx + lamp, y, cz + lamp), (cx - lamp, y, cz + lamp))

    # A ball of facets.
    rings, segments, radius, center = 16, 32, 0.38, np.array([1.1, 0.38, 3.4])

    def on_ball(i, j):
        theta, phi = math.pi * i / rings, 2 * math.pi * j / segments
        return tuple(center + radius * np.array([math.sin(theta) * math.cos(phi), math.cos(theta), -math.sin(theta) * math.sin(phi)]))

    for i in range(rings):
        for j in range(segments):
            a, b, c, e = on_ball(i, j), on_ball(i + 1, j), on_ball(i + 1, j + 1), on_ball(i, j + 1)
            if i > 0:
                objects.setdefault("ball", []).append((a, b, e))
            if i < rings - 1:
                objects.setdefault("ball", []).append((b, c, e))
    return objects


def plastic(alpha, specular, albedo):
    return {
        "type": "roughplastic",
        "distribution": "ggx",
        "alpha": alpha,
        "int_ior": refraction(specular),
        "ext_ior": 1.0,
        "nonlinear": False,
        "diffuse_reflectance": {"type": "rgb", "value": albedo},
    }


def bsdf(name, kind):
    if name in ROUGH and kind == "plastic":
        own = plastic(*ROUGH[name], ALBEDO[name])
    elif name in ROUGH and kind == "rough":
        alpha, specular = ROUGH[name]
        return {"type": "rough", "alpha": alpha, "specular": specular, "albedo": {"type": "rgb", "value": ALBEDO[name]}}
    else:
        own = {"type": "diffuse", "reflectance": {"type": "rgb", "value": ALBEDO.get(name, [0.0] * 3)}}
    return {"type": "twosided", "own": own}


def base_ratio(alpha, specular):
    """What roughplastic's white base reflects straight up, over what relit's does: (1 - F0) (1 - 0.15^5)."""
    white = mi.load_dict(plastic(alpha, specular, [1.0] * 3) | {"specular_reflectance": 0.0})
    side, total = 64, 0.0
    for i in range(side):
        # Even in the squared cosine: the value over cos/pi averages to the share reflected.
        z = math.sqrt((i + 0.5) / side)
        interaction = mi.SurfaceInteraction3f()
        interaction.wi = mi.Vector3f(0, 0, 1)
        interaction.n = [0, 0, 1]
        interaction.sh_frame = mi.Frame3f([0, 0, 1])
        value = white.eval(mi.BSDFContext(), interaction, mi.Vector3f(math.sqrt(1 - z * z), 0, z))
        total += float(np.array(value).ravel()[0]) * math.pi / z
    return total / side / ((1 - specular) * (1 - 0.15**5))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("capture")
    parser.add_argument("--diffuse", dest="kind", action="store_const", const="diffuse", default="rough")
    parser.add_argument("--plastic", dest="kind", action="store_const", const="plastic")
    parser.add_argument("--samples", type=int, default=512)
    parser.add_argument("--size", type=int, default=160)
    arguments = parser.parse_args()
    out = arguments.capture
    os.makedirs(f"{out}/images", exist_ok=True)
    objects = room()

    # The mesh, each triangle with its own corners: flat shading.
    scene = {"type": "scene", "integrator": {"type": "path", "max_depth": 64, "rr_depth": 16}}
    with open(f"{out}/mesh.obj", "w") as file:
        count = 0
        for name, triangles in objects.items():
            file.write(f"o {name}\n")
            corners = np.array(triangles, np.float32).reshape(-1, 3)
            for v in corners:
                file.write("v %.7g %.7g %.7g\n" % tuple(v))
            for i in range(len(triangles)):
                file.write("f %d %d %d\n" % tuple(count + 3 * i + k + 1 for k in range(3)))
            count += len(corners)
            mesh = mi.Mesh(name, len(corners), len(triangles), has_vertex_normals=False)
            parameters = mi.traverse(mesh)
            parameters["vertex_positions"] = corners.ravel()
            parameters["faces"] = np.arange(len(corners), dtype=np.uint32)
            parameters.update()
            path = f"{out}/{name}.ply"
            mesh.write_ply(path)
            scene[name] = {"type": "ply", "filename": path, "face_normals": True, "bsdf": bsdf(name, arguments.kind)}
            if name == "lamp":
                scene[name]["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": LAMP}}
    loaded = mi.load_dict(scene)
    for name in objects:
        os.remove(f"{out}/{name}.ply")

    width, height = arguments.size, arguments.size * 3 // 4
    focal = 0.6 * width
    frames = []
    for index, (center, target) in enumerate(CAMERAS):
        transform = mi.ScalarTransform4f().look_at(origin=list(center), target=list(target), up=[0, 1, 0])
        sensor = mi.load_dict({
            "type": "perspective",
            "fov": math.degrees(2 * math.atan(width / 2 / focal)),
            "fov_axis": "x",
            "to_world": transform,
            "film": {
                "type": "hdrfilm",
                "width": width,
                "height": height,
                "rfilter": {"type": "box"},
                "pixel_format": "rgb",
                "component_format": "float32",
            },
            "sampler": {"type": "independent", "sample_count": arguments.samples},
        })
        image = mi.render(loaded, sensor=sensor, seed=index)
        mi.Bitmap(image).write(f"{out}/images/{index:03d}.exr")
        center = np.array(center)
        z = center - np.array(target)
        z /= np.linalg.norm(z)
        x = np.cross([0, 1, 0], z)
        x /= np.linalg.norm(x)
        matrix = np.eye(4)
        matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = x, np.cross(z, x), z, center
        frames.append({"file_path": f"images/{index:03d}.exr", "transform_matrix": matrix.tolist()})
    with open(f"{out}/transforms.json", "w") as file:
        json.dump({
            "camera_model": "PINHOLE", "w": width, "h": height, "fl_x": focal, "fl_y": focal,
            "cx": width / 2, "cy": height / 2, "mesh_path": "mesh.obj", "frames": frames,
        }, file)
    truth = {}
    for name in objects:
        rough = name in ROUGH and arguments.kind != "diffuse"
        alpha = ROUGH[name][0] if rough else None
        ratio = base_ratio(*ROUGH[name]) if rough and arguments.kind == "plastic" else 1.0
        emission = LAMP if name == "lamp" else [0.0] * 3
        albedo = [a * ratio for a in ALBEDO.get(name, [0.0] * 3)]
        truth[name] = {"albedo": albedo, "emission": emission, "roughness": alpha, "textured": False}
    with open(f"{out}/truth.json", "w") as file:
        json.dump({"objects": truth}, file)


if __name__ == "__main__":
    main()
