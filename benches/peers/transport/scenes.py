"""The scenes of the comparison, each described once: as a Sunglint scene, and as polygons for Mitsuba.

`python scenes.py` writes the .glint files beside this script; `--algorithm split` writes them for the other algorithm.
Metres, degrees; z up, azimuth clockwise from north. Irradiance in W m-2 um-1, radiance in W m-2 sr-1 um-1.
"""

import argparse
import math
import os
import pathlib
from dataclasses import dataclass, field

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
TRUCK = HERE.parents[2] / "examples" / "truth" / "truck.obj"
SUN_RADIUS = math.radians(0.2666)  # docs/CONVENTIONS.md
ALGORITHMS = {
    "full": "full {{ sun {sun}, depth {depth}, caustics {caustics} }}",
    "cached": "full {{ sun {sun}, depth {depth}, caustics {caustics}, indirect cached }}",
    # Every approximation lifted: the whole diffuse exchange, but no caustics.
    "split": "split {{ reading corrected, sky directional, background average, background_sky own, background_lobes all, "
             "glint conserving, sun {sun}, depth {depth} }}",
}


@dataclass
class Case:
    """What one experiment changes. A depth of None is unlimited."""

    depth: int | None = None
    caustics: bool = False
    patches: list | None = None  # names; None: all of the scene's


@dataclass
class Scene:
    name: str
    title: str
    materials: dict  # name: ("diffuse" | "specular", reflectance)
    parts: list  # (statements of the language, [(material, corners)])
    position: tuple
    look_at: tuple
    field_of_view: float  # across
    pixels: tuple
    patches: dict  # name: (point of its middle, (width, height) in pixels), well inside one facet
    cases: dict
    samples: int  # a pixel, of each of the seeds
    irradiance: float = 0.0  # of the sun, at normal incidence
    zenith: float = 0.0
    azimuth: float = 180.0
    sun: str = "disk"
    radiance: float = 0.0  # of the sky, at the zenith
    sky: str = "isotropic"
    objects: list = field(default_factory=list)  # statements that declare them

    def polygons(self):
        return [polygon for _, polygons in self.parts for polygon in polygons]

    def to_sun(self):
        t, a = math.radians(self.zenith), math.radians(self.azimuth)
        return np.array([math.sin(t) * math.sin(a), math.sin(t) * math.cos(a), math.cos(t)])

    def window(self, patch):
        """Rows and columns of a patch: its middle seen by the camera."""
        (point, (width, height)) = self.patches[patch]
        ahead = np.subtract(self.look_at, self.position)
        ahead = ahead / np.linalg.norm(ahead)
        right = np.cross(ahead, (0, 0, 1))
        right = right / np.linalg.norm(right)
        d = np.subtract(point, self.position)
        scale = 0.5 * self.pixels[0] / math.tan(math.radians(0.5 * self.field_of_view)) / (d @ ahead)
        x = round(0.5 * self.pixels[0] + scale * (d @ right) - 0.5 * width)
        y = round(0.5 * self.pixels[1] - scale * (d @ np.cross(right, ahead)) - 0.5 * height)
        assert 0 <= x and x + width <= self.pixels[0] and 0 <= y and y + height <= self.pixels[1], patch
        return slice(y, y + height), slice(x, x + width)

    def glint(self, algorithm, folder, samples, seeds=1):
        """The scene's text, for a file in `folder`."""
        truck = os.path.relpath(TRUCK, folder).replace(os.sep, "/")
        text = lambda v: "(" + " ".join(f"{x:g}" for x in v) + ")"
        sun = f"zenith {self.zenith:g} deg azimuth {self.azimuth:g} deg" if self.irradiance else "none"
        lines = ["glint 1", "", f"# Written by scenes.py. {self.title}", f"collect {{ sun {sun} }}",
                 f"atmosphere none {{ solar_irradiance {self.irradiance:g} W/m2/um, sky_radiance {self.radiance:g} "
                 f"W/m2/sr/um, sky {self.sky} }}", ""]
        lines += [f"material {m} {{ ideal {{ {kind} {value:g} }} }}" for m, (kind, value) in self.materials.items()]
        lines += ["", *(line.replace("TRUCK", truck) for line in self.objects), *(part for part, _ in self.parts), "",
                  "sensor camera {", f"  position {text(self.position)} m", f"  look_at {text(self.look_at)} m",
                  f"  field_of_view {self.field_of_view:g} deg", f"  pixels {self.pixels[0]} x {self.pixels[1]}",
                  "  band b 549..551 nm", "}", ""]
        for name, case in self.cases.items():
            words = dict(sun=self.sun, depth=case.depth or "unlimited", caustics="on" if case.caustics else "off")
            seed = "1" if seeds == 1 else f"sweep [{', '.join(str(i + 1) for i in range(seeds))}]"
            lines += [f"experiment {name} {{", f"  algorithm {ALGORITHMS[algorithm].format(**words)}",
                      f"  samples {samples}", f"  seed {seed}", "}"]
        return "\n".join(lines) + "\n"


# ---- parts: the statement, and the same in corners


def vector(v):
    return "(" + " ".join(f"{x:g}" for x in v) + ") m"


def rectangle(centre, right, up, size):
    r, u = np.asarray(right) * 0.5 * size[0], np.asarray(up) * 0.5 * size[1]
    return [np.asarray(centre) + s * r + t * u for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))]


def facet(material, *corners):
    return (f"facet {material} " + " ".join(vector(c)[:-2] for c in corners) + " m",
            [(material, [np.array(c, float) for c in corners])])


def ground(material, height=0.0, half=2000.0):
    """Endless there; here so wide that what lies beyond is less than 1e-6 of what a wall sees."""
    corners = rectangle((0, 0, height), (1, 0, 0), (0, 1, 0), (2 * half, 2 * half))
    return f"ground {material} height {height:g} m", [(material, corners)]


def panel(material, size, at, toward, said):
    n = np.asarray(toward, float) / np.linalg.norm(toward)
    right = np.array([-n[1], n[0], 0.0])
    right = right / np.linalg.norm(right) if np.linalg.norm(right) > 1e-12 else np.array([1.0, 0, 0])
    return (f"panel {material} size {vector(size)} at {vector(at)} {said}",
            [(material, rectangle(at, right, np.cross(n, right), size))])


def tilted(material, size, at, slope, aspect):
    b, a = math.radians(slope), math.radians(aspect)
    toward = (math.sin(b) * math.sin(a), math.sin(b) * math.cos(a), math.cos(b))
    return panel(material, size, at, toward, f"slope {slope:g} deg aspect {aspect:g} deg")


def turned(corners, at, heading):
    """Heading is clockwise from north, +y ahead."""
    h = math.radians(heading)
    to_east, to_north = np.array([math.cos(h), -math.sin(h), 0]), np.array([math.sin(h), math.cos(h), 0])
    return [np.asarray(at) + c[0] * to_east + c[1] * to_north + np.array([0, 0, c[2]]) for c in corners]


def box(material, size, at, heading=0.0):
    x, y, z = (0.5 * s for s in size)
    faces = []
    for axis in range(3):
        for side in (-1, 1):
            normal, right, up = np.zeros(3), np.zeros(3), np.zeros(3)
            normal[axis], right[(axis + 1) % 3], up[(axis + 2) % 3] = side, side, 1
            r, u = right * (x, y, z), up * (x, y, z)
            centre = normal * (x, y, z) + (0, 0, z)
            faces.append((material, turned([centre + s * r + t * u for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))],
                                           at, heading)))
    pose = f" heading {heading:g} deg" if heading else ""
    return f"box {material} size {vector(size)} at {vector(at)}{pose}", faces


def mesh(path, materials, at, heading):
    """Polygons of an OBJ file in metres, z up."""
    corners, faces, material = [], [], "*"
    for line in path.read_text().splitlines():
        word, *rest = line.split() or [""]
        if word == "v":
            corners.append(np.array([float(x) for x in rest[:3]]))
        elif word == "usemtl":
            material = rest[0]
        elif word == "f":
            polygon = [corners[int(x.split("/")[0]) - 1] for x in rest]
            faces.append((materials.get(material, materials["*"]), turned(polygon, at, heading)))
    return faces


# ---- the scenes


def plane_and_wall():
    return Scene(
        name="plane_and_wall",
        title="A plane and a wall of two greys under sun and uniform sky.",
        materials={"plane": ("diffuse", 0.4), "wall": ("diffuse", 0.6)},
        parts=[facet("plane", (-5, -5, 0), (5, -5, 0), (5, 5, 0), (-5, 5, 0)),
               box("wall", (4, 0.3, 2.5), (0, 1, 0))],
        position=(3, -10, 6), look_at=(0, 0, 0.8), field_of_view=40, pixels=(96, 72), samples=512,
        irradiance=1500, zenith=50, azimuth=215, radiance=80,
        patches={"wall, low": ((0, 0.85, 0.4), (10, 3)), "wall, high": ((0, 0.85, 2), (10, 4)),
                 "plane, open": ((-2, -3.5, 0), (8, 6)), "plane before the wall": ((0, 0.3, 0), (10, 2)),
                 "plane in shadow": ((2.7, 2.6, 0), (3, 2))},
        cases={"all": Case()},
    )


def mirror_and_wall():
    wall = [facet("light", (-2, 0, 0), (0, 0, 0), (0, 0, 3), (-2, 0, 3)),
            facet("dark", (0, 0, 0), (2, 0, 0), (2, 0, 3), (0, 0, 3))]
    return Scene(
        name="mirror_and_wall",
        title="A level mirror before a wall of two greys; the sun (a point) shines on the wall by way of the mirror.",
        materials={"light": ("diffuse", 0.6), "dark": ("diffuse", 0.1), "mirror": ("specular", 0.85)},
        parts=[*wall, facet("mirror", (-1.5, -2.5, 0.1), (1.5, -2.5, 0.1), (1.5, -0.3, 0.1), (-1.5, -0.3, 0.1))],
        position=(0, -12, 5), look_at=(0, -0.5, 1), field_of_view=25, pixels=(96, 72), samples=512,
        irradiance=1500, zenith=45, azimuth=180, sun="point",
        patches={"light": ((-0.7, 0, 1.6), (8, 8)), "dark": ((0.7, 0, 1.6), (8, 8)), "light, beside": ((-1.77, 0, 1.6), (3, 8)),
                 "dark, beside": ((1.77, 0, 1.6), (3, 8)), "light in the mirror": ((-0.6, -1.2, 0.1), (8, 4)),
                 "dark in the mirror": ((0.6, -1.2, 0.1), (8, 4))},
        # Paths from the sun cannot end in a mirror.
        cases={"caustics_off": Case(), "caustics_on": Case(caustics=True, patches=["light", "dark", "light, beside",
                                                                                  "dark, beside"])},
    )


def courtyard():
    walls = [facet("stone", (-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0))]
    ring = [(-2, -2), (2, -2), (2, 2), (-2, 2)]
    for (x0, y0), (x1, y1) in zip(ring, ring[1:] + ring[:1]):
        walls.append(facet("stone", (x0, y0, 0), (x1, y1, 0), (x1, y1, 4), (x0, y0, 4)))
    return Scene(
        name="courtyard",
        title="An open box of reflectance 0.8 under sun and sky: one more reflection at a time.",
        materials={"stone": ("diffuse", 0.8)},
        parts=walls,
        position=(0.3, -0.9, 9), look_at=(0, 0.6, 1), field_of_view=42, pixels=(72, 72), samples=512,
        irradiance=1500, zenith=40, azimuth=200, radiance=80,
        patches={"floor, lit": ((1.2, 1.65, 0), (6, 3)), "floor in shadow": ((-0.6, -1.2, 0), (8, 6)),
                 "wall, lit": ((0, 2, 2.6), (10, 5)), "wall, low": ((0.4, 2, 0.9), (10, 3)),
                 "wall in shadow": ((-2, 0.4, 1.5), (5, 8))},
        cases={**{f"depth_{n}": Case(depth=n) for n in (1, 2, 3, 4, 8)}, "depth_unlimited": Case()},
    )


def tilted_panels():
    slopes = (0, 30, 60, 90, 120)
    return Scene(
        name="tilted_panels",
        title="Panels of five slopes under the overcast sky L0 (1 + 2 cos theta)/3, black below the horizon.",
        materials={"grey": ("diffuse", 0.5)},
        parts=[tilted("grey", (1, 1), (3 * i - 6, 0, 2), slope, 180) for i, slope in enumerate(slopes)],
        position=(0, -20, 8), look_at=(0, 0, 2), field_of_view=42, pixels=(192, 48), samples=512,
        radiance=90, sky="overcast",
        patches={f"{slope} deg": ((3 * i - 6, 0, 2), (5, 2) if slope in (0, 120) else (5, 5))
                 for i, slope in enumerate(slopes)},
        cases={"all": Case()},
    )


def penumbra():
    """The edge is 30 m up; the shadow lies at the origin, where single precision is finest."""
    return Scene(
        name="penumbra",
        title="The edge of a tall box's shadow under the sun's disk alone: 0.56 m of penumbra along y.",
        materials={"grey": ("diffuse", 0.5)},
        parts=[facet("grey", (-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)), box("grey", (10, 4, 30), (0, -32, 0))],
        position=(0, -0.5, 2), look_at=(0, 0, 0), field_of_view=24, pixels=(64, 64), samples=512,
        irradiance=1500, zenith=45, azimuth=180,
        patches={f"y = {y} m": ((0, y, 0), (40, 2)) for y in (-0.32, -0.2, -0.1, 0, 0.1, 0.2, 0.32)},
        cases={"depth_1": Case(depth=1)},
    )


TRUTH = {
    "lawn": 0.10, "blacktop": 0.09, "brick": 0.20, "shed_light": 0.60, "shed_dark": 0.08, "wood": 0.45, "roofing": 0.12,
    "concrete": 0.40, "mirror": 0.85, "truck_paint": 0.42, "glass": 0.10, "chrome": 0.60, "rubber": 0.04, "trim": 0.05,
    "grey_06": 0.06, "grey_12": 0.12, "grey_20": 0.20, "grey_35": 0.35, "grey_50": 0.50, "grey_95": 0.95, "red": 0.40,
    "green": 0.09, "blue": 0.07,
}


def truth(mirrors):
    """examples/truth in one band: all Lambertian under the sun's disk, or with its mirrors under a point sun."""
    eye = np.array([0, -28, 16.0])
    specular = {"mirror", "glass", "chrome"} if mirrors else set()
    panels = [("grey_06", -5, 2), ("grey_12", -3, 2), ("grey_20", -1, 2), ("grey_35", 1, 2), ("grey_50", 3, 2),
              ("grey_95", 5, 2), ("red", -4, 6), ("green", -2, 6), ("blue", 0, 6)]
    at = np.array([-2, 14.6, 0])
    shed = [("shed_light", [(-2, 0, 0), (0, 0, 0), (0, 0, 2.4), (-2, 0, 2.4)]),
            ("shed_dark", [(0, 0, 0), (2, 0, 0), (2, 0, 2.4), (0, 0, 2.4)]),
            ("wood", [(2, 0, 0), (2, 3, 0), (2, 3, 2.4), (2, 0, 2.4)]),
            ("wood", [(2, 3, 0), (-2, 3, 0), (-2, 3, 2.4), (2, 3, 2.4)]),
            ("wood", [(-2, 3, 0), (-2, 0, 0), (-2, 0, 2.4), (-2, 3, 2.4)]),
            ("roofing", [(-2, 0, 2.4), (2, 0, 2.4), (2, 3, 2.4), (-2, 3, 2.4)])]
    maps = {"Paint": "truck_paint", "Glass": "glass", "Chrome": "chrome", "Tyre": "rubber", "*": "trim"}
    return Scene(
        name="truth_mirrors" if mirrors else "truth_lambert",
        title="The scene of examples/truth in one band, " + (
            "its mirrors, glass and chrome planar mirrors; point sun, no caustics." if mirrors
            else "every surface Lambertian."),
        materials={m: ("specular" if m in specular else "diffuse", r) for m, r in TRUTH.items()},
        objects=["object shed {", *(f"  {facet(m, *corners)[0]}" for m, corners in shed), "}",
                 'object truck {', '  mesh "TRUCK" unit m {',
                 *(f'    map "{name}" to {material}' for name, material in maps.items()), "  }", "}"],
        parts=[ground("lawn", -0.05),
               facet("blacktop", (-16, -12, 0), (16, -12, 0), (16, 26, 0), (-16, 26, 0)),
               box("brick", (60, 20, 15), (0, -38.6, 0)),
               *(panel(m, (1.2, 1.2), (x, y, 0.75), eye - (x, y, 0.75), "facing camera") for m, x, y in panels),
               (f"place shed at {vector(at)}", [(m, [at + c for c in corners]) for m, corners in shed]),
               panel("mirror", (3.6, 3), (-1.8, 12.4, 0.1), (0, 0, 1), "facing up"),
               ("place truck at (6 10 0) m heading 60 deg", mesh(TRUCK, maps, (6, 10, 0), 60)),
               box("concrete", (1.2, 1.2, 0.9), (-7, 8, 0), 20), box("wood", (1, 1, 1), (-6.6, 13, 0), -15)],
        position=tuple(eye), look_at=(0, 9, 0), field_of_view=27, pixels=(640, 480), samples=32,
        irradiance=1500, zenith=60, azimuth=250, sun="point" if mirrors else "disk", radiance=80,
        patches={**{m: ((x, y, 0.75), (24, 24)) for m, x, y in panels}, "shed, light": ((-3, 14.6, 1.2), (30, 24)),
                 "shed, dark": ((-1, 14.6, 1.2), (30, 24)), "mirror, left": ((-2.9, 12.4, 0.1), (24, 12)),
                 "mirror, right": ((-0.9, 12.4, 0.1), (24, 12)), "lawn": ((-8, 31, -0.05), (40, 12)),
                 "blacktop": ((0, -1.5, 0), (60, 24)), "blacktop in the shed's shadow": ((1.7, 16.6, 0), (24, 8)),
                 "concrete, top": ((-7, 8, 0.9), (12, 4)), "truck, hood": ((7.65, 10.95, 0.958), (10, 4))},
        cases={"all": Case()},
    )


SCENES = {scene.name: scene for scene in (plane_and_wall(), mirror_and_wall(), courtyard(), tilted_panels(), penumbra(),
                                          truth(False), truth(True))}


def main():
    args = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    args.add_argument("--algorithm", choices=ALGORITHMS, default="full")
    args.add_argument("--out", type=pathlib.Path, default=HERE)
    args = args.parse_args()
    for scene in SCENES.values():
        (args.out / f"{scene.name}.glint").write_text(scene.glint(args.algorithm, args.out, scene.samples))


if __name__ == "__main__":
    main()
