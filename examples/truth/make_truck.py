#!/usr/bin/env python3
"""Writes truck.obj: a pickup truck of the early 1990s, low in polygons, our own making (CC0 1.0).

Metres, z up, +y ahead, origin on the ground under the middle. Every part is a closed surface of convex planar polygons,
counter-clockwise seen from outside; parts overlap by a centimetre or more and share no plane. Usage:

    python3 make_truck.py > truck.obj
"""

from math import cos, pi, sin

HALF_WIDTH = 0.90  # of the body
INNER = 0.69       # of the bed, and where the wheel wells end
REAR, FRONT = -2.42, 2.42
SILL, RAIL, FLOOR = 0.38, 1.00, 0.72  # heights of underside, bed rail, bed floor
AXLES = (-1.50, 1.55)
TYRE, RIM, ARCH = 0.37, 0.21, 0.46    # radii

parts = []  # (name, [(material, [corner, ...]), ...])


def body():
    """Three strips side by side, each between an underside and a top that are lines over the same stations along y."""
    well = []
    for axle in AXLES:
        arc = [(axle - ARCH * cos(pi * k / 8), SILL + ARCH * sin(pi * k / 8)) for k in range(9)]
        well += [(y, z if 0 < k < 8 else SILL) for k, (y, z) in enumerate(arc)]
    hood = [(0.95, RAIL), (2.30, 0.94), (FRONT, 0.84)]
    tailgate, cab = -2.34, -0.42
    steps = [(REAR, RAIL, RAIL), (tailgate, RAIL, RAIL), (tailgate, RAIL, FLOOR), (cab, RAIL, FLOOR), (cab, RAIL, RAIL)]

    def between(points, y):
        for (y0, z0), (y1, z1) in zip(points, points[1:]):
            if y0 <= y <= y1:
                return z0 + (z1 - z0) * (y - y0) / (y1 - y0)
        return points[0][1] if y < points[0][0] else points[-1][1]

    # A station: y, underside of the outer strips, top of the outer strips, top of the middle strip.
    stations = [(y, SILL, outer, middle) for y, outer, middle in steps]
    for y in sorted({y for y, _ in well} | {y for y, _ in hood}):
        low = next((z for at, z in well if at == y), SILL)
        top = between(hood, y)
        stations.append((y, low, top, FLOOR if tailgate < y < cab else top))
    stations.sort(key=lambda station: station[0])  # stable: the two stations of a step keep their order

    faces = []

    def face(material, corners):
        distinct = [c for i, c in enumerate(corners) if c != corners[i - 1]]
        if len(distinct) > 2:
            faces.append((material, distinct))

    strips = [(-HALF_WIDTH, -INNER, 2), (-INNER, INNER, 3), (INNER, HALF_WIDTH, 2)]
    for a, b in zip(stations, stations[1:]):
        (ya, low_a, out_a, mid_a), (yb, low_b, out_b, mid_b) = a, b
        for left, right, top in strips:
            za, zb = a[top], b[top]
            bed = top == 3 and tailgate <= ya and yb <= cab
            face("Trim" if bed else "Paint", [(left, ya, za), (right, ya, za), (right, yb, zb), (left, yb, zb)])
            ua, ub = (SILL, SILL) if top == 3 else (low_a, low_b)
            face("Trim", [(left, yb, ub), (right, yb, ub), (right, ya, ua), (left, ya, ua)])
        for side in (-1, 1):
            def wall(material, x, lower_a, lower_b, upper_a, upper_b, outwards):
                corners = [(x, ya, lower_a), (x, yb, lower_b), (x, yb, upper_b), (x, ya, upper_a)]
                face(material, corners if outwards == (side > 0) else corners[::-1])
            wall("Paint", side * HALF_WIDTH, low_a, low_b, out_a, out_b, True)
            wall("Trim", side * INNER, SILL, SILL, low_a, low_b, True)       # inner side of a wheel well
            wall("Trim", side * INNER, mid_a, mid_b, out_a, out_b, False)    # inner side of the bed
    for left, right, top in strips:
        (y0, z0), (y1, z1) = (stations[0][0], stations[0][top]), (stations[-1][0], stations[-1][top])
        face("Paint", [(left, y0, SILL), (right, y0, SILL), (right, y0, z0), (left, y0, z0)])
        face("Paint", [(right, y1, SILL), (left, y1, SILL), (left, y1, z1), (right, y1, z1)])
    parts.append(("body", faces))


def cab():
    """A frustum sunk into the body; each side is a frame about a window."""
    low = [(-0.86, -0.40, 0.98), (0.86, -0.40, 0.98), (0.86, 1.02, 0.98), (-0.86, 1.02, 0.98)]
    high = [(-0.68, -0.28, 1.70), (0.68, -0.28, 1.70), (0.68, 0.42, 1.70), (-0.68, 0.42, 1.70)]
    faces = [("Trim", low[::-1]), ("Paint", high)]
    for i in range(4):
        a, b, c, d = low[i], low[(i + 1) % 4], high[(i + 1) % 4], high[i]

        def at(u, v):
            bottom = [p + (q - p) * u for p, q in zip(a, b)]
            top = [p + (q - p) * u for p, q in zip(d, c)]
            return tuple(p + (q - p) * v for p, q in zip(bottom, top))

        window = [at(0.08, 0.14), at(0.92, 0.14), at(0.92, 0.90), at(0.08, 0.90)]
        frame = [a, b, c, d]
        faces.append(("Glass", window))
        for k in range(4):
            n = (k + 1) % 4
            faces.append(("Paint", [frame[k], frame[n], window[n], window[k]]))
    parts.append(("cab", faces))


def wheel(name, side, axle):
    """A tyre about a hub, axis along x; one corner stands on the ground."""
    n = 16
    outer, inner = side * 0.88, side * 0.70

    def ring(x, radius):
        return [(x, axle + radius * sin(2 * pi * k / n), TYRE - radius * cos(2 * pi * k / n)) for k in range(n)]

    tread_out, tread_in, hub = ring(outer, TYRE), ring(inner, TYRE), ring(outer, RIM)
    faces = [("Chrome", hub), ("Tyre", tread_in[::-1])]
    for k in range(n):
        m = (k + 1) % n
        faces.append(("Tyre", [tread_out[k], tread_out[m], hub[m], hub[k]]))
        faces.append(("Tyre", [tread_in[k], tread_in[m], tread_out[m], tread_out[k]]))
    parts.append((name, [(material, corners if side > 0 else corners[::-1]) for material, corners in faces]))


def block(name, material, x, y, z):
    (x0, x1), (y0, y1), (z0, z1) = x, y, z
    sides = [
        [(x0, y0, z0), (x0, y1, z0), (x1, y1, z0), (x1, y0, z0)],
        [(x0, y0, z1), (x1, y0, z1), (x1, y1, z1), (x0, y1, z1)],
        [(x0, y0, z0), (x1, y0, z0), (x1, y0, z1), (x0, y0, z1)],
        [(x1, y1, z0), (x0, y1, z0), (x0, y1, z1), (x1, y1, z1)],
        [(x0, y1, z0), (x0, y0, z0), (x0, y0, z1), (x0, y1, z1)],
        [(x1, y0, z0), (x1, y1, z0), (x1, y1, z1), (x1, y0, z1)],
    ]
    parts.append((name, [(material, corners) for corners in sides]))


body()
cab()
for axle, end in zip(AXLES, ("rear", "front")):
    wheel(f"wheel_{end}_left", -1, axle)
    wheel(f"wheel_{end}_right", 1, axle)
    block(f"axle_{end}", "Trim", (-0.71, 0.71), (axle - 0.06, axle + 0.06), (0.31, 0.43))
block("bumper_front", "Chrome", (-0.87, 0.87), (2.36, 2.50), (0.43, 0.58))
block("bumper_rear", "Chrome", (-0.87, 0.87), (-2.50, -2.36), (0.43, 0.58))
block("grille", "Trim", (-0.50, 0.50), (2.37, 2.435), (0.63, 0.79))
for side, name in ((-1, "left"), (1, "right")):
    block(f"headlamp_{name}", "Glass", sorted((side * 0.56, side * 0.82)), (2.38, 2.44), (0.64, 0.78))
    block(f"taillamp_{name}", "Trim", sorted((side * 0.73, side * 0.88)), (-2.43, -2.38), (0.66, 0.92))
    block(f"mirror_{name}", "Trim", sorted((side * 0.80, side * 1.03)), (0.70, 0.78), (1.04, 1.20))

index, lines = {}, []
for name, faces in parts:
    lines.append(f"o {name}")
    material = None
    for of, corners in sorted(faces, key=lambda face: face[0]):
        if of != material:
            material = of
            lines.append(f"usemtl {of}")
        corners = [" ".join(f"{round(c, 6) + 0.0:.6f}" for c in corner) for corner in corners]
        lines.append("f " + " ".join(str(index.setdefault(corner, len(index) + 1)) for corner in corners))
print("# A pickup truck, metres, z up, +y ahead. Written by make_truck.py; CC0 1.0, no rights reserved.")
print("\n".join(f"v {corner}" for corner in index))
print("\n".join(lines))
