#!/usr/bin/env python3
"""Writes the models, the terrain and the places of the suburb example; all of our own making (CC0 1.0).

    python3 make_suburb.py [FOLDER]

Two houses and three trees as OBJ (metres, z up, origin on the ground, +y ahead), a grid of heights and one of land cover
(ESRI ASCII, posts 2 m apart), and the places of houses, trees and trucks as CSV. Every solid is closed, its polygons
counter-clockwise seen from outside; leaves and needles are flat polygons seen from both sides.
"""

import random
import sys
from math import cos, exp, hypot, pi, sin, sqrt
from pathlib import Path

FOLDER = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
SPACING, POSTS = 2.0, 121                     # of the grids [m]
WEST, SOUTH = -120.0, -120.0                  # their south-west post
LAWN, STREET, PATH = 1, 2, 3                  # classes of land cover
STREET_Y, STREET_X, HALF_STREET = 0.0, -36.0, 4.0


class Model:
    """Polygons by material, vertices shared."""

    def __init__(self, name, about):
        self.name, self.about = name, about
        self.index, self.vertices, self.parts = {}, [], {}

    def face(self, material, corners):
        ids = []
        for corner in corners:
            key = tuple(round(c, 5) + 0.0 for c in corner)
            if key not in self.index:
                self.vertices.append(key)
                self.index[key] = len(self.vertices)
            if self.index[key] not in ids:
                ids.append(self.index[key])
        if len(ids) > 2:
            self.parts.setdefault(material, []).append(ids)

    def wall(self, a, b, bottom, top, openings=(), material="Wall"):
        """From a to b on the plan, outside on the right; openings are (material, from, to, sill, head) along the wall.

        The wall is cut into a grid of rectangles by the lines of all openings, so that no two faces share a plane and a
        place, and no corner stands on another's edge."""
        length = hypot(b[0] - a[0], b[1] - a[1])
        along = sorted({0.0, length} | {x for _, u, v, _, _ in openings for x in (u, v)})
        up = sorted({bottom, top} | {z for *_, s, h in openings for z in (s, h)})

        def at(u, z):
            t = u / length
            return (a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t, z)

        for u0, u1 in zip(along, along[1:]):
            for z0, z1 in zip(up, up[1:]):
                here = material
                for kind, u, v, sill, head in openings:
                    if u <= u0 and u1 <= v and sill <= z0 and z1 <= head:
                        here = kind
                self.face(here, [at(u0, z0), at(u1, z0), at(u1, z1), at(u0, z1)])

    def block(self, material, x0, x1, y0, y1, z0, z1, bottom=True):
        c = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
        for a, b in zip(c, c[1:] + c[:1]):
            self.face(material, [(*a, z0), (*b, z0), (*b, z1), (*a, z1)])
        self.face(material, [(*p, z1) for p in c])
        if bottom:
            self.face(material, [(*p, z0) for p in c[::-1]])

    def frustum(self, material, base, top, r0, r1, sides=8):
        ring = [(cos(2 * pi * k / sides), sin(2 * pi * k / sides)) for k in range(sides)]
        low = [(base[0] + r0 * x, base[1] + r0 * y, base[2]) for x, y in ring]
        high = [(top[0] + r1 * x, top[1] + r1 * y, top[2]) for x, y in ring]
        for k in range(sides):
            n = (k + 1) % sides
            # A side of a leaning frustum need not be planar: two triangles.
            self.face(material, [low[k], low[n], high[n]])
            self.face(material, [low[k], high[n], high[k]])
        self.face(material, low[::-1])
        self.face(material, high)

    def write(self):
        lines = [f"# {self.about}", "# Sunglint, CC0 1.0. Written by make_suburb.py; metres, z up.", f"o {self.name}"]
        lines += ["v " + " ".join(f"{c:.5f}".rstrip("0").rstrip(".") for c in v) for v in self.vertices]
        for material, faces in self.parts.items():
            lines.append(f"usemtl {material}")
            lines += ["f " + " ".join(map(str, face)) for face in faces]
        (FOLDER / f"{self.name}.obj").write_text("\n".join(lines) + "\n")


def slab(model, outline, thickness, material, edge):
    """A roof slab: its upper face, the same lower by a thickness, and its edges. `outline` counter-clockwise from above."""
    low = [(x, y, z - thickness) for x, y, z in outline]
    model.face(material, outline)
    model.face(edge, low[::-1])
    for a, b in zip(range(len(outline)), [*range(1, len(outline)), 0]):
        model.face(edge, [low[a], low[b], outline[b], outline[a]])


def house_gable():
    """Two storeys, 10 x 8 m, a gable roof with its ridge along x and a chimney; the front faces +y."""
    m = Model("house_gable", "A two-storey house with a gable roof, 10 x 8 m")
    w, d, eaves, ridge = 5.0, 4.0, 5.4, 8.0
    m.block("Foundation", -w - 0.05, w + 0.05, -d - 0.05, d + 0.05, -2.0, 0.35)
    base = 0.3
    window = lambda u, sill: ("Window", u, u + 1.2, sill, sill + 1.4)
    front = [window(1.0, 1.1), window(7.8, 1.1), ("Door", 4.4, 5.6, 0.35, 2.45)]
    front += [window(u, 3.6) for u in (1.0, 4.4, 7.8)]
    back = [window(u, sill) for u in (1.0, 4.4, 7.8) for sill in (1.1, 3.6)]
    side = [window(u, sill) for u in (1.4, 5.4) for sill in (1.1, 3.6)]
    corners = [(-w, -d), (w, -d), (w, d), (-w, d)]
    for (a, b), openings in zip(zip(corners, corners[1:] + corners[:1]), (back, side, front, side)):
        m.wall(a, b, base, eaves, openings)
    m.face("Wall", [(w, -d, eaves), (w, d, eaves), (w, 0, ridge)])
    m.face("Wall", [(-w, d, eaves), (-w, -d, eaves), (-w, 0, ridge)])
    over, rise = 0.5, (ridge - eaves) / d
    low = eaves - over * rise + 0.12
    for s in (-1, 1):
        edge = [(-w - over, s * (d + over), low), (w + over, s * (d + over), low)]
        top = [(w + over, 0, ridge + 0.12), (-w - over, 0, ridge + 0.12)]
        outline = edge + top
        slab(m, outline if s < 0 else outline[::-1], 0.1, "Roof", "Trim")
    m.block("Chimney", 2.4, 3.2, 0.8, 1.6, 6.2, 9.0)
    m.write()


def house_hip():
    """One storey, 14 x 9 m with a garage, under a hip roof; the front faces +y."""
    m = Model("house_hip", "A one-storey house with a garage and a hip roof, 14 x 9 m")
    w, d, eaves, ridge = 7.0, 4.5, 2.9, 5.3
    m.block("Foundation", -w - 0.05, w + 0.05, -d - 0.05, d + 0.05, -2.0, 0.25)
    base = 0.2
    window = lambda u, width=1.4: ("Window", u, u + width, 0.9, 2.3)
    # Along the front, u runs from +x to -x.
    front = [("Garage", 0.8, 5.6, 0.25, 2.4), ("Door", 7.0, 8.1, 0.25, 2.35), window(9.2, 2.2), window(12.0)]
    back = [window(u, 1.8) for u in (1.2, 4.8, 10.6)] + [("Door", 7.8, 9.4, 0.25, 2.35)]
    side = [window(2.0), window(5.6)]
    corners = [(-w, -d), (w, -d), (w, d), (-w, d)]
    for (a, b), openings in zip(zip(corners, corners[1:] + corners[:1]), (back, side, front, side)):
        m.wall(a, b, base, eaves, openings)
    over = 0.6
    x, y, r = w + over, d + over, w - d
    low, thick = eaves - 0.05, 0.12
    ring = [(-x, -y), (x, -y), (x, y), (-x, y)]
    peak = [(-r, 0, ridge), (r, 0, ridge)]
    eave = [(*p, low) for p in ring]
    under = [(*p, low - thick) for p in ring]
    m.face("Roof", [eave[0], eave[1], peak[1], peak[0]])
    m.face("Roof", [eave[1], eave[2], peak[1]])
    m.face("Roof", [eave[2], eave[3], peak[0], peak[1]])
    m.face("Roof", [eave[3], eave[0], peak[0]])
    for a, b in zip(range(4), (1, 2, 3, 0)):
        m.face("Trim", [under[a], under[b], eave[b], eave[a]])
    m.face("Trim", under[::-1])
    m.block("Chimney", -3.6, -2.9, -1.4, -0.7, 3.6, 5.9)
    m.write()


def turned(rng):
    """Two unit vectors that span a plane whose normal is uniform over the sphere (a spherical leaf distribution)."""
    z, a, b = 2 * rng.random() - 1, 2 * pi * rng.random(), 2 * pi * rng.random()
    s = sqrt(1 - z * z)
    n = (s * cos(a), s * sin(a), z)
    u = (-sin(a), cos(a), 0.0)
    v = (n[1] * u[2] - n[2] * u[1], n[2] * u[0] - n[0] * u[2], n[0] * u[1] - n[1] * u[0])
    c, d = cos(b), sin(b)
    p = tuple(c * i + d * j for i, j in zip(u, v))
    q = tuple(-d * i + c * j for i, j in zip(u, v))
    return p, q


def leaf(model, rng, centre, length, width):
    p, q = turned(rng)
    at = lambda s, t: tuple(c + s * length * i + t * width * j for c, i, j in zip(centre, p, q))
    model.face("Leaf", [at(-0.5, 0), at(0, -0.5), at(0.5, 0), at(0, 0.5)])


def broadleaf(name, about, seed, height, crown, radius, leaves, size):
    """Trunk, limbs and leaves: tufts scattered through an ellipsoid, denser towards its skin, as crowns are."""
    rng = random.Random(seed)
    m = Model(name, about)
    half = (height - crown) / 2
    middle = crown + half
    m.frustum("Bark", (0, 0, -0.5), (0, 0, middle), 0.018 * height, 0.01 * height)
    for k in range(7):
        a, lift = 2 * pi * (k + 0.4 * rng.random()) / 7, crown + (0.15 + 0.6 * rng.random()) * half
        reach = radius * (0.5 + 0.25 * rng.random())
        m.frustum("Bark", (0, 0, lift - 0.2 * half), (reach * cos(a), reach * sin(a), lift + 0.35 * half), 0.09, 0.03, 5)
    tufts = []
    while len(tufts) < leaves // 12:
        x, y, z = (2 * rng.random() - 1 for _ in range(3))
        r = sqrt(x * x + y * y + z * z)
        if 0.05 < r <= 1 and rng.random() < 0.25 + 0.75 * r * r:
            tufts.append((x * radius, y * radius, middle + z * half))
    for tuft in tufts:
        for _ in range(12):
            leaf(m, rng, tuple(c + rng.gauss(0, 0.3) for c in tuft), size, 0.7 * size)
    m.write()


def spruce():
    """Whorls of drooping boughs about a stem, each bough a fan of flat sprays."""
    rng = random.Random(3)
    m = Model("tree_spruce", "A spruce, 12 m")
    m.frustum("Bark", (0, 0, -0.5), (0, 0, 11.6), 0.22, 0.03, 7)
    whorls = 24
    for k in range(whorls):
        t = k / (whorls - 1)
        z, reach = 1.2 + 10.4 * t, 2.6 * (1 - t) ** 0.85 + 0.25
        boughs = 9 if t < 0.7 else 6
        for b in range(boughs):
            a = 2 * pi * (b + rng.random() * 0.6) / boughs + 0.37 * k
            droop, length = 0.28 + 0.12 * rng.random(), reach * (0.85 + 0.3 * rng.random())
            out = lambda s, side, rise=0.0: (
                s * length * cos(a) - side * sin(a), s * length * sin(a) + side * cos(a), z - droop * s * length + rise)
            width = 0.16 * length + 0.12
            for side in (-1, 1):
                spray = [out(0.05, 0), out(0.55, side * width, -0.08), out(1.0, 0)]
                m.face("Needle", spray if side > 0 else spray[::-1])
            m.face("Needle", [out(0.1, 0), out(0.95, 0), out(0.5, 0, -0.35)])
    m.write()


def height(x, y):
    """Of the ground: a hill in the north-east and gentle waves, level at the edges, where the plain goes on."""
    def inwards(t):
        t = min(1.0, (120 - abs(t)) / 35)
        return t * t * (3 - 2 * t)

    hill = 9 * exp(-((x - 55) ** 2 + (y - 60) ** 2) / (2 * 38 ** 2))
    waves = 1.4 + 0.6 * sin(x / 31) * cos(y / 27) + 0.5 * sin((x + y) / 55)
    return inwards(x) * inwards(y) * (hill + waves)


def on_street(x, y, margin=0.0):
    return abs(y - STREET_Y) <= HALF_STREET + margin or abs(x - STREET_X) <= HALF_STREET + margin


def grids(drives):
    posts = [(WEST + SPACING * i, SOUTH + SPACING * j) for j in reversed(range(POSTS)) for i in range(POSTS)]

    def cover(x, y):
        if on_street(x, y):
            return STREET
        return PATH if any(x0 <= x <= x1 and y0 <= y <= y1 for x0, x1, y0, y1 in drives) else LAWN

    def write(name, value):
        # Posts are the centres of cells.
        head = [f"ncols {POSTS}", f"nrows {POSTS}", f"xllcenter {WEST:g}", f"yllcenter {SOUTH:g}", f"cellsize {SPACING:g}"]
        rows = [" ".join(value(x, y) for x, y in posts[r * POSTS:(r + 1) * POSTS]) for r in range(POSTS)]
        (FOLDER / name).write_text("\n".join(head + rows) + "\n")

    write("heights.asc", lambda x, y: f"{height(x, y):.2f}")
    write("cover.asc", lambda x, y: str(cover(x, y)))


def places():
    """Houses along both streets, each facing its street; a drive and perhaps a truck before the hip-roofed ones; trees in the gardens."""
    rng = random.Random(1993)
    houses, drives, trucks, trees = {"gable": [], "hip": []}, [], [], {"oak": [], "birch": [], "spruce": []}
    stands = []
    lots = [(x, STREET_Y + s * 17.0, 180.0 if s > 0 else 0.0) for x in range(-108, 112, 24) for s in (-1, 1)]
    lots += [(STREET_X + s * 17.0, y, 270.0 if s > 0 else 90.0) for y in (-104, -80, -56, 56, 80, 104) for s in (-1, 1)]
    for x, y, heading in lots:
        if on_street(x, y, 9.0):
            continue
        kind = "hip" if rng.random() < 0.45 else "gable"
        x, y = x + rng.uniform(-1.5, 1.5), y + rng.uniform(-1, 1)
        houses[kind].append((x, y, (heading + rng.uniform(-4, 4)) % 360))
        stands.append((x, y))
        if kind == "hip":
            # The garage stands at the right of the front as seen from the street: local +x before turning.
            a = heading * pi / 180
            side, ahead = (cos(a), -sin(a)), (sin(a), cos(a))
            gx, gy = x + 3.8 * side[0], y + 3.8 * side[1]
            ex, ey = gx + 13 * ahead[0], gy + 13 * ahead[1]
            drives.append((min(gx, ex) - 1.9, max(gx, ex) + 1.9, min(gy, ey) - 1.9, max(gy, ey) + 1.9))
            if rng.random() < 0.7:
                trucks.append((gx + 8.2 * ahead[0], gy + 8.2 * ahead[1], (heading + 180 + rng.uniform(-3, 3)) % 360))
    for x in range(-112, 116, 19):
        if rng.random() < 0.5 and not on_street(x, 99, 4.0):
            trucks.append((x, STREET_Y - 2.6, 90.0 + rng.uniform(-1, 1)))
    wanted, tries, all_trees = 190, 0, []
    while len(all_trees) < wanted and tries < 20000:
        tries += 1
        x, y = rng.uniform(-116, 116), rng.uniform(-116, 116)
        if on_street(x, y, 3.5) or (x > 40 and y > 40):
            continue
        if any(hypot(x - a, y - b) < 11.5 for a, b in stands):
            continue
        if any(x0 - 2 <= x <= x1 + 2 and y0 - 2 <= y <= y1 + 2 for x0, x1, y0, y1 in drives):
            continue
        if any(hypot(x - a, y - b) < 6.5 for a, b in all_trees):
            continue
        all_trees.append((x, y))
        kind = rng.choices(("oak", "birch", "spruce"), (5, 4, 3))[0]
        trees[kind].append((x, y, rng.uniform(0, 360), rng.uniform(0.7, 1.25)))

    def write(name, rows, scaled=False):
        head = "x_m,y_m,heading_deg" + (",scale" if scaled else "")
        lines = [",".join(f"{v:.2f}" for v in row) for row in rows]
        (FOLDER / name).write_text("\n".join([head] + lines) + "\n")

    for kind, rows in houses.items():
        write(f"houses_{kind}.csv", rows)
    for kind, rows in trees.items():
        write(f"trees_{kind}.csv", rows, True)
    write("trucks.csv", trucks)
    return drives


house_gable()
house_hip()
broadleaf("tree_oak", "A broad crown on a short trunk, 11 m", 1, 11.0, 2.6, 4.2, 2400, 0.5)
broadleaf("tree_birch", "A slender crown, 13 m", 2, 13.0, 2.4, 2.2, 1500, 0.4)
spruce()
grids(places())
