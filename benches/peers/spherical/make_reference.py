"""Single scattering in a spherical atmosphere by SASKTRAN2, for the rays of `layered`.

Writes into --out (default: the test data of the crate `atmosphere`):

  spherical_columns.csv            the columns as homogeneous shells
  spherical_single_scattering.csv  radiances from the ground upward and from space downward

SASKTRAN2 integrates over the shells of its altitude grid, so every homogeneous shell is cut in CUTS; the change from
half as many is extrapolated, and a quadrature of our own along the rays confirms some.
"""

import argparse
import pathlib
from importlib.metadata import version

import numpy as np
import sasktran2 as sk

HERE = pathlib.Path(__file__).resolve().parent
OUT = HERE.parents[2] / "crates" / "atmosphere" / "tests" / "data"
RADIUS, TOP, OBSERVER = 6371e3, 100e3, 200e3  # m
SHELLS, CUTS, MOMENTS = 50, 32, 96
SUNS_DEG = [30.0, 60.0, 75.0, 85.0, 88.0]
VIEWS_DEG = [0.0, 60.0, 75.0, 80.0, 85.0, 87.0, 89.0]
AZIMUTHS_DEG = [0.0, 90.0, 180.0]
MOLECULES_M, HAZE_M, HAZE_G, HAZE_ALBEDO = 8000.0, 2000.0, 0.7, 0.95
COLUMNS = {"rayleigh_0.1": (0.1, 0.0), "rayleigh_0.36": (0.36, 0.0), "hazy": (0.1, 0.2)}  # vertical depths: air, haze


def below(z, scale):
    """Of an exponential that ends at TOP, the share below z."""
    return np.expm1(-z / scale) / np.expm1(-TOP / scale)


def density(z, scale):
    return np.exp(-z / scale) / scale / -np.expm1(-TOP / scale)


def radiances(edges, cuts, sun, rays, smooth):
    """[ray, column]: in homogeneous shells, or (smooth) with extinction straight between the altitudes of the grid."""
    z = np.concatenate([*(np.linspace(a, b, cuts, endpoint=False) for a, b in zip(edges[:-1], edges[1:])), [TOP]])
    config = sk.Config()
    config.num_streams, config.num_stokes, config.num_singlescatter_moments = 2, 1, MOMENTS
    config.multiple_scatter_source = sk.MultipleScatterSource.NoSource
    config.single_scatter_source = sk.SingleScatterSource.Exact
    between = sk.InterpolationMethod.LinearInterpolation if smooth else sk.InterpolationMethod.LowerInterpolation
    mu0 = np.cos(np.radians(sun))
    geometry = sk.Geometry1D(mu0, 0.0, RADIUS, z, between, sk.GeometryType.Spherical)
    looks = sk.ViewingGeometry()
    for way, view, azimuth in rays:
        mu, azimuth = np.cos(np.radians(view)), np.radians(azimuth)
        if way == "down":
            looks.add_ray(sk.SolarAnglesObserverLocation(mu0, azimuth, mu, 0.0))
        else:
            looks.add_ray(sk.GroundViewingSolar(mu0, azimuth, mu, OBSERVER))
    atmosphere = sk.Atmosphere(geometry, config, numwavel=len(COLUMNS), calculate_derivatives=False)
    orders = np.arange(MOMENTS)[:, None]
    for i, (air, haze) in enumerate(COLUMNS.values()):
        if smooth:
            air, haze = air * density(z, MOLECULES_M), haze * density(z, HAZE_M)
        else:
            shells = [d * np.diff(below(edges, h)) / np.diff(edges) for d, h in [(air, MOLECULES_M), (haze, HAZE_M)]]
            air, haze = (np.append(np.repeat(k, cuts), k[-1]) for k in shells)
        scattering = air + HAZE_ALBEDO * haze
        atmosphere.storage.total_extinction[:, i] = air + haze
        atmosphere.storage.ssa[:, i] = scattering / (air + haze)
        rayleigh = np.where(orders == 0, 1.0, np.where(orders == 2, 0.5, 0.0))  # (2l+1) chi_l
        hg = (2 * orders + 1) * HAZE_G ** orders
        atmosphere.leg_coeff.a1[:, :, i] = (rayleigh * air + hg * HAZE_ALBEDO * haze) / scattering
    atmosphere.surface.albedo[:] = 0
    found = sk.Engine(config, geometry, looks).calculate_radiance(atmosphere)
    return found["radiance"].values.reshape(len(COLUMNS), len(rays)).T


def quadrature(edges, column, sun, ray):
    """The same by Gauss-Legendre along the ray between shells, E P / 4 pi, without SASKTRAN2."""
    way, view, azimuth = ray
    depths = [d * np.diff(below(edges, h)) for d, h in zip(COLUMNS[column], (MOLECULES_M, HAZE_M))]
    k = np.sum(depths, 0) / np.diff(edges)
    radii = RADIUS + edges

    def crossings(r, mu):
        """Distances at which a ray from radius r, cosine mu, leaves shells; upward, or past its lowest point."""
        lowest = r * np.sqrt(1 - mu * mu)
        if mu < 0 and lowest < RADIUS:
            return None
        half = np.sqrt(np.maximum(radii ** 2 - lowest ** 2, 0.0))
        at = np.concatenate([-r * mu + half, -r * mu - half])
        return np.unique(np.concatenate([[0.0], at[at > 1e-6]]))

    def depth(r, mu, until=None):
        at = crossings(r, mu)
        if at is None:
            return np.inf
        if until is not None:
            at = np.append(at[at < until], until)
        middle = 0.5 * (at[1:] + at[:-1])
        z = np.sqrt(r * r + middle ** 2 + 2 * r * mu * middle) - RADIUS
        return np.sum(np.diff(at) * k[np.clip(np.searchsorted(edges, z) - 1, 0, SHELLS - 1)])

    mu0, mu, azimuth = np.cos(np.radians(sun)), np.cos(np.radians(view)), np.radians(azimuth)
    # x: horizontal direction in which the beam travels. out: from the ground along the line of sight.
    sign = -1.0 if way == "down" else 1.0
    flat = sign * np.sin(np.radians(view))
    out = np.array([flat * np.cos(azimuth), flat * np.sin(azimuth), mu])
    to_sun = np.array([-np.sqrt(1 - mu0 * mu0), 0.0, mu0])
    travel = -out if way == "down" else out
    cos = float(travel @ -to_sun)
    phase = [0.75 * (1 + cos * cos), (1 - HAZE_G ** 2) / (1 + HAZE_G ** 2 - 2 * HAZE_G * cos) ** 1.5]
    at = crossings(RADIUS, mu)
    whole = depth(RADIUS, mu)
    # Where the ray goes into the Earth's shadow the integrand breaks off within a shell.
    nodes, weights = np.polynomial.legendre.leggauss(64 if sun > 85 and way == "up" and azimuth < 1 else 12)
    total = 0.0
    for shell, (a, b) in enumerate(zip(at[:-1], at[1:])):
        scattered = depths[0][shell] * phase[0] + HAZE_ALBEDO * depths[1][shell] * phase[1]
        scattered /= edges[shell + 1] - edges[shell]
        for x, w in zip(nodes, weights):
            s = 0.5 * (a + b) + 0.5 * (b - a) * x
            point = np.array([0.0, 0.0, RADIUS]) + s * out
            r = np.linalg.norm(point)
            walked = depth(RADIUS, mu, s)
            path = walked if way == "down" else whole - walked
            total += 0.5 * (b - a) * w * scattered * np.exp(-path - depth(r, float(point @ to_sun) / r))
    return total / (4 * np.pi)


def main():
    args = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    args.add_argument("--out", type=pathlib.Path, default=OUT)
    args = args.parse_args()
    edges = TOP * (np.arange(SHELLS + 1) / SHELLS) ** 2
    # `way`: where the light goes. Straight up and down the azimuth says nothing.
    rays = [(way, view, azimuth) for way in ("down", "up") for view in VIEWS_DEG for azimuth in AZIMUTHS_DEG
            if view > 0 or azimuth == 0]
    rows, worst, apart = [], [], []
    for sun in SUNS_DEG:
        # Of second order in the cuts: two of them give the limit.
        half, fine = (radiances(edges, cuts, sun, rays, False) for cuts in (CUTS // 2, CUTS))
        limit = fine + (fine - half) / 3
        coarse, finer = (radiances(edges, cuts, sun, rays, True) for cuts in (CUTS // 4, CUTS // 2))
        smooth = finer + (finer - coarse) / 3
        for i, column in enumerate(COLUMNS):
            for j, (way, view, azimuth) in enumerate(rays):
                moved = abs(fine[j, i] / limit[j, i] - 1)
                worst.append((moved, abs(smooth[j, i] / finer[j, i] - 1), column, sun, *rays[j]))
                rows.append(f"{column},{sun},{way},{view},{azimuth:.0f},{limit[j, i]:.8e},{moved:.0e},"
                            f"{smooth[j, i]:.8e}")
                if view in (0.0, 80.0, 89.0) and azimuth != 90.0:
                    own = quadrature(edges, column, sun, rays[j])
                    apart.append((abs(own / limit[j, i] - 1), column, sun, *rays[j]))
        print(sun, max(worst)[:2], max(apart))
    for row in sorted(worst, reverse=True)[:8]:
        print("cuts %.1e, smooth %.1e: %s sun %g %s view %g azimuth %g" % row)
    for row in sorted(apart, reverse=True)[:8]:
        print("own quadrature %.1e: %s sun %g %s view %g azimuth %g" % row)
    assert max(apart)[0] < 2e-4

    made_by = f"# SASKTRAN2 {version('sasktran2')}, made by benches/peers/spherical/make_reference.py"
    shells = []
    for column, depths in COLUMNS.items():
        air, haze = (d * np.diff(below(edges, h)) for d, h in zip(depths, (MOLECULES_M, HAZE_M)))
        for i in range(SHELLS):
            shells.append(f"{column},{edges[i]:.6g},{edges[i + 1]:.6g},{air[i]:.12e},{haze[i]:.12e}")
    for name, notes, header, lines in [
        ("spherical_columns.csv",
         [f"# Homogeneous shells around a sphere of radius {RADIUS:.0f} m, from the ground up; vertical extinction depths.",
          f"# Air: Rayleigh, P = 3/4 (1 + cos^2). Haze: Henyey-Greenstein g = {HAZE_G}, albedo {HAZE_ALBEDO}.",
          f"# Cut from exponentials of scale height {MOLECULES_M:.0f} m (air), {HAZE_M:.0f} m (haze) that end at the top."],
         "column,bottom_m,top_m,air,haze", shells),
        ("spherical_single_scattering.csv",
         ["# Radiance of single scattering per unit irradiance of the beam; black ground, no refraction, scalar.",
          "# propagation: down, seen from the ground; up, seen from space. Angles are those at the ground point.",
          "# dphi_deg: azimuth of the light's propagation less that of the beam's propagation; 0 is forward scattering",
          f"# radiance: in the shells of spherical_columns.csv; difference: how far {CUTS} cuts a shell are from that limit",
          "# radiance_smooth: in the exponentials that the shells are cut from"],
         "column,sun_zenith_deg,propagation,view_zenith_deg,dphi_deg,radiance,difference,radiance_smooth", rows),
    ]:
        path = args.out / name
        path.write_text("\n".join([*notes, made_by, header, *lines]) + "\n")
        print(f"{path.name}: {len(lines)} rows, {path.stat().st_size / 1024:.0f} KB")


if __name__ == "__main__":
    main()
