"""BRDF of a rough conductor by Mitsuba 3, for the microfacet models.

Writes mitsuba_rough_conductor.csv into --out (default: the peers of the tests of the crate `reflectance`). Mitsuba's
scalar_rgb computes in single precision: directions and parameters are rounded to it first and the angles of the rounded
directions printed, and the closed form in double precision says how far Mitsuba's own rounding reaches.
"""

import argparse
import math
import pathlib
from importlib.metadata import version

import mitsuba as mi
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
OUT = HERE.parents[2] / "crates" / "reflectance" / "tests" / "peers"
SEED, ROWS, STEEPEST_DEG, FAINTEST = 20250611, 200, 85.0, 1e-6
ALPHA, N, K = (0.03, 0.8), (0.1, 4.0), (0.0, 8.0)
DISTRIBUTIONS = ["beckmann", "ggx"]


def toward(zenith, azimuth):
    return np.array([math.sin(zenith) * math.cos(azimuth), math.sin(zenith) * math.sin(azimuth), math.cos(zenith)])


def geometry(rng, alpha, specular):
    """Directions to source and sensor, away from the surface. `specular`: the half vector is drawn from the lobe."""
    steepest, turn = math.radians(STEEPEST_DEG), 2 * math.pi
    while True:
        incident = toward(rng.uniform(0, steepest), rng.uniform(0, turn))
        if specular:
            half = toward(math.atan(alpha * math.sqrt(-math.log(1 - rng.uniform(0, 0.95)))), rng.uniform(0, turn))
            view = 2 * (incident @ half) * half - incident
        else:
            view = toward(rng.uniform(0, steepest), rng.uniform(0, turn))
        if view[2] >= math.cos(steepest):
            return incident.astype(np.float32), view.astype(np.float32)


def angles_deg(incident, view):
    """Of directions rounded to single precision: zeniths, and azimuth of the view less that of the source."""
    (ix, iy, iz), (vx, vy, vz) = incident.astype(np.float64), view.astype(np.float64)
    turned = math.atan2(ix * vy - iy * vx, ix * vx + iy * vy)
    incident_zenith, view_zenith = math.atan2(math.hypot(ix, iy), iz), math.atan2(math.hypot(vx, vy), vz)
    return tuple(math.degrees(a) for a in (incident_zenith, view_zenith, turned % (2 * math.pi)))


def evaluated(distribution, alpha, n, k, incident, view):
    """f [sr^-1] by Mitsuba, whose eval contains the cosine of the outgoing direction."""
    conductor = mi.load_dict({
        "type": "roughconductor", "distribution": distribution, "sample_visible": True, "alpha": float(alpha),
        "eta": {"type": "rgb", "value": [float(n)] * 3}, "k": {"type": "rgb", "value": [float(k)] * 3},
        "specular_reflectance": {"type": "rgb", "value": [1.0] * 3},
    })
    at = mi.SurfaceInteraction3f()
    at.wi = mi.Vector3f(*(float(x) for x in incident))
    value = conductor.eval(mi.BSDFContext(), at, mi.Vector3f(*(float(x) for x in view)))
    assert value[0] == value[1] == value[2]
    return float(value[0])


def fresnel(n, k, mu):
    """Unpolarised reflectance of a conductor n + ik."""
    sin2 = 1 - mu * mu
    t = n * n - k * k - sin2
    a2b2 = math.sqrt(t * t + 4 * n * n * k * k)
    a = math.sqrt(max(0.0, 0.5 * (a2b2 + t)))
    s = (a2b2 - 2 * a * mu + mu * mu) / (a2b2 + 2 * a * mu + mu * mu)
    p = s * (mu * mu * a2b2 - 2 * a * mu * sin2 + sin2 ** 2) / (mu * mu * a2b2 + 2 * a * mu * sin2 + sin2 ** 2)
    return 0.5 * (s + p)


def masking(distribution, alpha, zenith, exact):
    """Smith's G1. Of Beckmann: Walter et al. 2007, the rational fit eq. 27 or (exact) eq. 26; of GGX: eq. 34."""
    slope = alpha * math.tan(zenith)
    if distribution == "ggx":
        return 2 / (1 + math.hypot(1, slope))
    a = 1 / slope if slope > 0 else math.inf
    if exact:
        return 2 / (1 + math.erf(a) + math.exp(-a * a) / (a * math.sqrt(math.pi)))
    return 1.0 if a >= 1.6 else (3.535 * a + 2.181 * a * a) / (1 + 2.276 * a + 2.577 * a * a)


def closed_form(distribution, alpha, n, k, incident_deg, view_deg, azimuth_deg, exact=False, correlated=False):
    """F D G / (4 cos cos) in double precision, G = G1 G1 (or height-correlated) from the printed numbers."""
    ti, to, phi = (math.radians(a) for a in (incident_deg, view_deg, azimuth_deg))
    incident, view = toward(ti, 0.0), toward(to, phi)
    half = (incident + view) / np.linalg.norm(incident + view)
    cos2 = half[2] ** 2
    tan2 = (half[0] ** 2 + half[1] ** 2) / cos2
    if distribution == "beckmann":
        d = math.exp(-tan2 / alpha ** 2) / (math.pi * alpha ** 2 * cos2 ** 2)
    else:
        d = alpha ** 2 / (math.pi * cos2 ** 2 * (alpha ** 2 + tan2) ** 2)
    gi, go = (masking(distribution, alpha, t, exact) for t in (ti, to))
    g = 1 / (1 / gi + 1 / go - 1) if correlated else gi * go
    return fresnel(n, k, float(incident @ half)) * d * g / (4 * incident[2] * view[2])


def main():
    args = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    args.add_argument("--out", type=pathlib.Path, default=OUT)
    args = args.parse_args()
    mi.set_variant("scalar_rgb")
    rng = np.random.default_rng(SEED)
    rows = []
    for distribution in DISTRIBUTIONS:
        apart, fit, joint = [], [], []
        for i in range(ROWS):
            alpha = np.float32(math.exp(rng.uniform(*map(math.log, ALPHA))))
            n, k = np.float32(rng.uniform(*N)), np.float32(rng.uniform(*K))
            f = 0.0
            while f <= FAINTEST:
                incident, view = geometry(rng, float(alpha), specular=i % 2 == 0)
                f = evaluated(distribution, alpha, n, k, incident, view)
                angles = angles_deg(incident, view)
                f /= math.cos(math.radians(angles[1]))
            surface = (distribution, *(float(x) for x in (alpha, n, k)))
            own = closed_form(*surface, *angles)
            apart.append((abs(f / own - 1), f, *surface, *angles))
            fit.append(abs(own / closed_form(*surface, *angles, exact=True) - 1))
            joint.append(abs(own / closed_form(*surface, *angles, correlated=True) - 1))
            rows.append(",".join([distribution, *(f"{x:.17g}" for x in (*surface[1:], *angles)), f"{f:.9e}"]))
        print(f"{distribution}: Mitsuba from the closed form at most {max(apart)[0]:.1e}, rms "
              f"{np.sqrt(np.mean([a[0] ** 2 for a in apart])):.1e}; f from {min(a[1] for a in apart):.1e} to "
              f"{max(a[1] for a in apart):.1e}")
        print(f"  for comparison, in the closed form: rational G1 from exact G1 at most {max(fit):.1e}, "
              f"separable G from height-correlated at most {max(joint):.1e}")
        for row in sorted(apart, reverse=True)[:4]:
            print("  %.1e: f %.3e %s alpha %.4f n %.3f k %.3f incident %.2f view %.2f azimuth %.2f" % row)
        assert max(apart)[0] < 1e-5

    notes = [
        "BRDF of a rough conductor n + ik with an isotropic Beckmann or GGX distribution of roughness alpha: unpolarised",
        "Fresnel, G separable, G = G1 G1 with Smith's G1 (of Beckmann Walter et al. 2007 eq. 27, a rational fit). Angles are of",
        "directions away from the surface; relative azimuth 0: sensor on the side of the source, 180: forward. The inputs",
        "are exact in single precision, in which Mitsuba computes.",
        f"mitsuba {version('mitsuba')} (BSD-3-Clause), scalar_rgb; made by benches/peers/reflectance/mitsuba_rough_conductor.py",
    ]
    header = "distribution,alpha,n,k,incident_zenith_deg,view_zenith_deg,relative_azimuth_deg,brdf_per_sr"
    path = args.out / "mitsuba_rough_conductor.csv"
    path.write_text("\n".join([*(f"# {n}" for n in notes), header, *rows]) + "\n")
    print(f"{path.name}: {len(rows)} rows, {path.stat().st_size / 1024:.0f} KB")


if __name__ == "__main__":
    main()
