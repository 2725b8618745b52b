"""BRDFs of the land-surface models RPV, Ross-Li (RTLS) and Hapke by Eradiate's radiometric kernel.

Writes eradiate_rpv.csv, eradiate_rtls.csv and eradiate_hapke.csv into --out (default: the peers of the tests of the
crate `reflectance`). Every value is held against the published equations in double precision, below; the hot spot of
every model is found to lie at relative azimuth 0.
"""

import argparse
import math
import pathlib
from importlib.metadata import version

import mitsuba as mi
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
OUT = HERE.parents[2] / "crates" / "reflectance" / "tests" / "peers"
SEED, ROWS, FAINTEST = 20250611, 200, 1e-6
NEAR_DEG = 6.0  # every fourth pair of rows lies this near the hot spot


def evaluated(model, incident_deg, view_deg, azimuth_deg):
    """f [sr^-1]; eval contains the cosine of the outgoing direction. Directions point away from the surface."""
    ti, to, phi = (math.radians(a) for a in (incident_deg, view_deg, azimuth_deg))
    at = mi.SurfaceInteraction3f()
    at.wi = mi.Vector3f(math.sin(ti), 0.0, math.cos(ti))
    view = mi.Vector3f(math.sin(to) * math.cos(phi), math.sin(to) * math.sin(phi), math.cos(to))
    return float(model.eval(mi.BSDFContext(), at, view)[0]) / math.cos(to)


def loaded(kind, surface):
    return mi.load_dict({"type": kind, **surface})


def rpv_surface(rng, i):
    rho_0 = round(rng.uniform(0.01, 0.5), 6)
    surface = {"rho_0": rho_0, "k": round(rng.uniform(0.4, 1.2), 6), "g": round(rng.uniform(-0.4, 0.3), 6)}
    free = round(rng.uniform(0.0, 1.0), 6)
    return {**surface, "rho_c": rho_0 if i % 2 == 0 else free}


def rtls_surface(rng, _):
    return {"f_iso": round(rng.uniform(0.05, 0.5), 6), "f_vol": round(rng.uniform(0.0, 0.3), 6),
            "f_geo": round(rng.uniform(0.0, 0.1), 6), "h": 2.0, "b": 1.0, "r": 1.0}


def hapke_surface(rng, i):
    theta = round(rng.uniform(0.0, 30.0), 6)  # deg
    return {"w": round(rng.uniform(0.1, 0.95), 6), "b": round(rng.uniform(0.1, 0.6), 6),
            "c": round(rng.uniform(0.0, 1.0), 6), "theta": theta if i % 2 == 0 else 0.0,
            "B_0": round(rng.uniform(0.0, 1.0), 6), "h": round(rng.uniform(0.02, 0.3), 6)}


def cos_phase(ti, to, phi):
    return math.cos(ti) * math.cos(to) + math.sin(ti) * math.sin(to) * math.cos(phi)


def phase(ti, to, phi):
    """Angle between the directions, exact near 0 too: the chord is 2 sin(x/2)."""
    chord2 = 4 * (math.sin((ti - to) / 2) ** 2 + math.sin(ti) * math.sin(to) * math.sin(phi / 2) ** 2)
    return 2 * math.asin(min(1.0, math.sqrt(chord2) / 2))


def tangent_distance2(ti, to, phi):
    """tan^2 + tan^2 - 2 tan tan cos phi, without cancellation."""
    a, b = math.tan(ti), math.tan(to)
    return (a - b) ** 2 + 4 * a * b * math.sin(phi / 2) ** 2


def rpv(ti, to, phi, rho_0, k, g, rho_c):
    """Rahman, Pinty & Verstraete 1993, with rho_c of the four-parameter form; rho_c = rho_0 is the original."""
    mu_i, mu_o = math.cos(ti), math.cos(to)
    lobe = (1 - g * g) / (1 + 2 * g * cos_phase(ti, to, phi) + g * g) ** 1.5
    hot_spot = 1 + (1 - rho_c) / (1 + math.sqrt(tangent_distance2(ti, to, phi)))
    return rho_0 / math.pi * (mu_i * mu_o * (mu_i + mu_o)) ** (k - 1) * lobe * hot_spot


def rtls(ti, to, phi, f_iso, f_vol, f_geo, h=2.0, b=1.0, r=1.0):
    """Ross-Thick, Li-Sparse reciprocal: Lucht, Schaaf & Strahler 2000. Not clamped: may be negative."""
    x = phase(ti, to, phi)
    volume = ((math.pi / 2 - x) * math.cos(x) + math.sin(x)) / (math.cos(ti) + math.cos(to)) - math.pi / 4
    ti, to = (math.atan(b / r * math.tan(t)) for t in (ti, to))
    secants = 1 / math.cos(ti) + 1 / math.cos(to)
    across = math.tan(ti) * math.tan(to) * math.sin(phi)
    t = math.acos(min(1.0, h / b * math.sqrt(tangent_distance2(ti, to, phi) + across ** 2) / secants))
    overlap = (t - math.sin(t) * math.cos(t)) * secants / math.pi
    geometric = overlap - secants + 0.5 * (1 + cos_phase(ti, to, phi)) / (math.cos(ti) * math.cos(to))
    return (f_iso + f_vol * volume + f_geo * geometric) / math.pi


def h_function(x, w):
    """Hapke 2002: the approximation to Chandrasekhar's H for isotropic scattering."""
    y = math.sqrt(1 - w)
    r0 = (1 - y) / (1 + y)
    return 1 / (1 - w * x * (r0 + 0.5 * (1 - 2 * r0 * x) * math.log((1 + x) / x)))


def h_function_1981(x, w):
    return (1 + 2 * x) / (1 + 2 * x * math.sqrt(1 - w))


def roughened(i, e, psi, theta):
    """Hapke 1984: effective cosines mu_0e and mu_e, and the shadowing function S. psi in 0..pi, theta the mean slope.

    Equation numbers are those of Hapke 1993 (Theory of Reflectance and Emittance Spectroscopy), which repeats them.
    """
    if theta == 0:
        return math.cos(i), math.cos(e), 1.0
    tan = math.tan(theta)
    chi = 1 / math.sqrt(1 + math.pi * tan * tan)  # 12.45a

    def e1(x):  # 12.45b
        return math.exp(-2 / (math.pi * tan * math.tan(x))) if x > 0 else 0.0

    def e2(x):  # 12.45c
        return math.exp(-1 / (math.pi * (tan * math.tan(x)) ** 2)) if x > 0 else 0.0

    def eta(x):  # 12.48, 12.49: the effective cosine at psi = 0 of the direction seen alone
        return chi * (math.cos(x) + math.sin(x) * tan * e2(x) / (2 - e1(x)))

    # Of the two directions the one farther from the normal hides more: it leads the denominator.
    far, near = max(i, e), min(i, e)
    below = 2 - e1(far) - psi / math.pi * e1(near)
    sin2 = math.sin(psi / 2) ** 2
    mu_near = chi * (math.cos(near) + math.sin(near) * tan * (math.cos(psi) * e2(far) + sin2 * e2(near)) / below)
    mu_far = chi * (math.cos(far) + math.sin(far) * tan * (e2(far) - sin2 * e2(near)) / below)
    mu_0e, mu_e = (mu_near, mu_far) if i <= e else (mu_far, mu_near)  # 12.46, 12.47; 12.52, 12.53
    f = math.exp(-2 * math.tan(psi / 2)) if psi < math.pi else 0.0  # 12.51
    # 12.50, 12.54
    shadowing = mu_e / eta(e) * math.cos(i) / eta(i) * chi / (1 - f + f * chi * math.cos(near) / eta(near))
    return mu_0e, mu_e, shadowing


def hapke(ti, to, phi, w, b, c, theta, B_0, h, h_of=h_function):
    """r / mu_0, r of Hapke 1993 eq. 12.55 but for H. theta in degrees, as the kernel takes it."""
    psi = abs(math.remainder(phi, 2 * math.pi))
    g = phase(ti, to, psi)
    surge = B_0 / (1 + math.tan(g / 2) / h)
    forward, backward = ((1 - b * b) / (1 + 2 * s * b * math.cos(g) + b * b) ** 1.5 for s in (1, -1))
    scattered = (1 - c) * forward + c * backward
    mu_0e, mu_e, shadowing = roughened(ti, to, psi, math.radians(theta))
    multiple = h_of(mu_0e, w) * h_of(mu_e, w) - 1
    r = w / (4 * math.pi) * mu_0e / (mu_0e + mu_e) * ((1 + surge) * scattered + multiple) * shadowing
    return r / math.cos(ti)


MODELS = {  # surfaces, equations, steepest zenith [deg], a surface with a hot spot
    "rpv": (rpv_surface, rpv, 80.0, {"rho_0": 0.2, "k": 0.8, "g": -0.1, "rho_c": 0.2}),
    "rtls": (rtls_surface, rtls, 70.0, {"f_iso": 0.2, "f_vol": 0.1, "f_geo": 0.03, "h": 2.0, "b": 1.0, "r": 1.0}),
    "hapke": (hapke_surface, hapke, 80.0, {"w": 0.5, "b": 0.3, "c": 0.4, "theta": 20.0, "B_0": 1.0, "h": 0.1}),
}
NOTES = {
    "rpv": ["RPV (Rahman, Pinty & Verstraete 1993): g is Theta, rho_c the amplitude in the hot spot factor alone."],
    "rtls": ["Ross-Thick, Li-Sparse reciprocal (Lucht, Schaaf & Strahler 2000), h, b and r of its crowns."],
    "hapke": ["Hapke with H of 2002, shadow hiding B_0 and h, double Henyey-Greenstein b and c (share c backward) and the",
              "macroscopic roughness of 1984, mean slope angle theta [deg]."],
}


def geometry_deg(rng, steepest, near):
    if not near:
        return rng.uniform(0, steepest), rng.uniform(0, steepest), rng.uniform(0, 360)
    incident = rng.uniform(NEAR_DEG, steepest - NEAR_DEG)
    return incident, incident + rng.uniform(-NEAR_DEG, NEAR_DEG), rng.uniform(-NEAR_DEG, NEAR_DEG) % 360


def confirm_hot_spot(kind, surface):
    """The brightest view in the ring of the source's zenith angle is that at relative azimuth 0.

    A thousandth of a degree off: where the directions coincide, RTLS may be NaN (it takes acos of 1 + rounding).
    """
    model = loaded(kind, surface)
    ring = [evaluated(model, 40.0, 40.001, a) for a in range(360)]
    assert int(np.argmax(ring)) == 0
    print(f"{kind}: f at azimuths 0, 90, 180: " + ", ".join(f"{ring[a]:.5f}" for a in (0, 90, 180)))


def report_definitions():
    """What the kernel does where definitions differ."""
    bare = {"rho_0": 0.2, "k": 0.8, "g": -0.1}
    implied, given = (evaluated(loaded("rpv", s), 30, 50, 70) for s in (bare, {**bare, "rho_c": 0.2}))
    print(f"rpv without rho_c over rho_c = rho_0: {implied / given - 1:.1e}")
    dark = loaded("rtls", {"f_iso": 0.0, "f_vol": 0.0, "f_geo": 0.1})
    print(f"rtls of f_geo 0.1 alone at 60, 60, 150 deg: {evaluated(dark, 60, 60, 150):.5f}, not clamped")
    tall = {"f_iso": 0.2, "f_vol": 0.1, "f_geo": 0.03, "h": 2.5, "b": 1.5, "r": 0.9}
    at = (35.0, 50.0, 70.0)
    own = rtls(*(math.radians(a) for a in at), **tall)
    print(f"rtls with h 2.5, b 1.5, r 0.9 from the equations: {evaluated(loaded('rtls', tall), *at) / own - 1:.1e}")
    for kind, (_, _, _, surface) in MODELS.items():
        model = loaded(kind, surface)
        there, back = evaluated(model, 30, 60, 50), evaluated(model, 60, 30, 50)
        print(f"{kind}: reciprocal to {abs(there / back - 1):.1e}")


def main():
    args = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    args.add_argument("--out", type=pathlib.Path, default=OUT)
    args = args.parse_args()
    mi.set_variant("scalar_mono_double")
    report_definitions()
    for number, (kind, (surface_of, equations, steepest, typical)) in enumerate(MODELS.items()):
        confirm_hot_spot(kind, typical)
        rng = np.random.default_rng([SEED, number])
        rows, apart, older = [], [], []
        while len(rows) < ROWS:
            i = len(rows)
            surface = surface_of(rng, i)
            angles = [round(a, 6) for a in geometry_deg(rng, steepest, near=i // 2 % 4 == 0)]
            f = evaluated(loaded(kind, surface), *angles)
            if not f > FAINTEST:
                continue
            at = [math.radians(a) for a in angles]
            apart.append((abs(f / equations(*at, **surface) - 1), f, i, *angles))
            if kind == "hapke":
                older.append(abs(f / hapke(*at, **surface, h_of=h_function_1981) - 1))
            rows.append(",".join([*(f"{x:g}" if x == int(x) else repr(float(x)) for x in [*surface.values(), *angles]),
                                  f"{f:.15e}"]))
        print(f"{kind}: from the equations at most {max(apart)[0]:.1e}, rms "
              f"{np.sqrt(np.mean([a[0] ** 2 for a in apart])):.1e}; f from {min(a[1] for a in apart):.1e} to "
              f"{max(a[1] for a in apart):.1e}" + (f"; with H of 1981 at most {max(older):.1e}" if older else ""))
        for row in sorted(apart, reverse=True)[:3]:
            print("  %.1e: f %.3e row %d incident %.2f view %.2f azimuth %.2f" % row)
        assert max(apart)[0] < 1e-10
        notes = [
            *NOTES[kind],
            "Angles are of directions away from the surface; relative azimuth 0: sensor on the side of the source.",
            f"eradiate-mitsuba {version('eradiate-mitsuba')} (BSD-3-Clause), scalar_mono_double; made by",
            "benches/peers/reflectance/eradiate_kernels.py",
        ]
        header = ",".join([*typical, "incident_zenith_deg", "view_zenith_deg", "relative_azimuth_deg", "brdf_per_sr"])
        path = args.out / f"eradiate_{kind}.csv"
        path.write_text("\n".join([*(f"# {n}" for n in notes), header, *rows]) + "\n")
        print(f"{path.name}: {len(rows)} rows, {path.stat().st_size / 1024:.0f} KB")


if __name__ == "__main__":
    main()
