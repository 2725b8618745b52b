"""A scene through either renderer: images [W m-2 sr-1 um-1] as arrays of float64."""

import json
import math
import pathlib
import subprocess
import tempfile

import mitsuba as mi
import numpy as np

from scenes import SUN_RADIUS

mi.set_variant("llvm_ad_mono")
import drjit as dr  # noqa: E402  (after the variant)

FAR = 1e6  # of the sun's disk [m]: its direction turns by less than 1e-5 rad over 10 m
ROWS = 2048  # of the sky's map: half of a row, 0.04 deg, about the horizon is between sky and nothing


# ---- Mitsuba


def sky_map(scene):
    """Rows from zenith to nadir, of the radiance at their middles; an even number, so that the horizon is between two."""
    theta = np.pi * np.arange(ROWS) / (ROWS - 1)
    law = (1 + 2 * np.cos(theta)) / 3 if scene.sky == "overcast" else np.ones(ROWS)
    rows = scene.radiance * np.where(theta < np.pi / 2, law, 0)
    return mi.Bitmap(np.repeat(rows.astype(np.float32), 16 * 3).reshape(ROWS, 16, 3))


def uniform(value):
    return {"type": "uniform", "value": float(value)}


def surface(kind, value):
    one_sided = ({"type": "diffuse", "reflectance": uniform(value)} if kind == "diffuse"
                 else {"type": "conductor", "material": "none", "specular_reflectance": uniform(value)})
    return {"type": "twosided", "bsdf": one_sided}


def write_ply(path, polygons):
    """Triangles with corners of their own: fans of convex polygons."""
    corners = np.array([c for p in polygons for i in range(1, len(p) - 1) for c in (p[0], p[i], p[i + 1])], np.float32)
    n = len(corners) // 3
    faces = np.zeros(n, [("count", "u1"), ("corner", "<i4", 3)])
    faces["count"], faces["corner"] = 3, np.arange(3 * n).reshape(n, 3)
    path.write_bytes((f"ply\nformat binary_little_endian 1.0\nelement vertex {3 * n}\nproperty float x\nproperty float y\n"
                      f"property float z\nelement face {n}\nproperty list uchar int vertex_indices\nend_header\n").encode()
                     + corners.astype("<f4").tobytes() + faces.tobytes())


def mitsuba_scene(scene, sampler="multijitter", sun_weight=1.0):
    with tempfile.TemporaryDirectory() as folder:
        said = {"type": "scene"}
        for name, (kind, value) in scene.materials.items():
            write_ply(path := pathlib.Path(folder) / f"{name}.ply", [corners for m, corners in scene.polygons() if m == name])
            said[name] = {"type": "ply", "filename": str(path), "face_normals": True, "bsdf": surface(kind, value)}
        if scene.irradiance and scene.sun == "point":
            said["sun"] = {"type": "directional", "direction": [float(-x) for x in scene.to_sun()],
                           "irradiance": uniform(scene.irradiance), "sampling_weight": sun_weight}
        elif scene.irradiance:
            pose = mi.ScalarTransform4f().look_at([float(FAR * x) for x in scene.to_sun()], [0, 0, 0], [0, 1, 0.1])
            radiance = scene.irradiance / (math.pi * math.sin(SUN_RADIUS) ** 2)
            said["sun"] = {"type": "disk", "to_world": pose.scale(FAR * math.tan(SUN_RADIUS)),
                           "emitter": {"type": "area", "radiance": uniform(radiance), "sampling_weight": sun_weight}}
        if scene.radiance:
            said["sky"] = {"type": "envmap", "bitmap": sky_map(scene),
                           "to_world": mi.ScalarTransform4f().rotate([1, 0, 0], 90)}
        pose = mi.ScalarTransform4f().look_at(*([float(x) for x in v] for v in (scene.position, scene.look_at, (0, 0, 1))))
        said["camera"] = {
            "type": "perspective", "fov_axis": "x", "fov": scene.field_of_view, "to_world": pose, "near_clip": 0.01,
            "sampler": {"type": sampler},
            "film": {"type": "hdrfilm", "width": scene.pixels[0], "height": scene.pixels[1], "pixel_format": "luminance",
                     "component_format": "float32", "rfilter": {"type": "box"}}}
        return mi.load_dict(said)


def integrator(case):
    """Mitsuba counts segments, we reflections. Light that a mirror throws on a diffuse surface needs paths from the sun."""
    return mi.load_dict({"type": "ptracer" if case.caustics else "path",
                         "max_depth": -1 if case.depth is None else case.depth + 1})


def mitsuba_image(loaded, way, samples, seed):
    return np.array(mi.render(loaded, integrator=way, spp=samples, seed=seed), np.float64)[:, :, 0]


def mitsuba_ray(loaded, pixels, pixel):
    """Origin and direction of the ray through a pixel's middle, and the point that it meets."""
    at = mi.Point2f(*(float((p + 0.5) / n) for p, n in zip(pixel, pixels)))
    ray, _ = loaded.sensors()[0].sample_ray(0, 0.5, at, mi.Point2f(0.5))
    met = loaded.ray_intersect(ray)
    d, p = (np.array(v, np.float64).ravel() for v in (ray.d, met.p))
    return loaded.sensors()[0].world_transform().translation().numpy().ravel().astype(np.float64), d, (
        p if bool(np.array(met.is_valid()).all()) else None)


# ---- Sunglint


def sunglint(binary, *args):
    return subprocess.run([binary, *args], check=True, capture_output=True, text=True).stdout


def envi(path):
    header = dict(line.split(" = ", 1) for line in path.with_suffix(".hdr").read_text().splitlines() if " = " in line)
    assert (header["data type"], header["bands"], header["byte order"]) == ("4", "1", "0")
    return np.fromfile(path, "<f4").reshape(int(header["lines"]), int(header["samples"])).astype(np.float64)


def sunglint_images(binary, scene, algorithm, folder, samples, seeds):
    """Per case the images of all seeds."""
    folder.mkdir(parents=True, exist_ok=True)
    (path := folder / f"{scene.name}.glint").write_text(scene.glint(algorithm, folder, samples, seeds))
    sunglint(binary, "render", path, "-o", folder / scene.name, "-q")
    runs = [f"seed={i + 1}" for i in range(seeds)] if seeds > 1 else ["."]
    return {name: [envi(next((folder / scene.name / name / run / "camera").glob("*/radiance.img"))) for run in runs]
            for name in scene.cases}


def sunglint_hit(binary, path, pixel):
    found = json.loads(sunglint(binary, "explain", path, "--pixel", f"{pixel[0]},{pixel[1]}", "--json", "-q"))["hit"]
    return found and np.array([found["x_m"], found["y_m"], found["z_m"]])
