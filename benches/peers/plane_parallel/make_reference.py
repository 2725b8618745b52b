"""Scalar plane-parallel radiative transfer by CDISORT (nanodisort): what the solver of `layered` is tested against.

Writes into --out (default: the test data of the crate `atmosphere`):

  plane_parallel_suns.csv      id, cosine of the sun's zenith angle, ground albedo, irradiance of the beam
  plane_parallel_problems.csv  the columns: absorption and scattering optical depth by layer and component
  plane_parallel_fluxes.csv    direct and diffuse fluxes at the top, in the middle and at the bottom
  plane_parallel.csv           radiances there

Every problem is solved twice, with STREAMS and half as many; the difference is written beside every value.
"""

import argparse
import pathlib
from concurrent.futures import ProcessPoolExecutor

import nanodisort
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
OUT = HERE.parents[2] / "crates" / "atmosphere" / "tests" / "data"
STREAMS = 128
MOMENTS = 400
E = 1.0
VIEWS_DEG = np.array([0.0, 20.0, 40.0, 60.0, 75.0, 85.0])
AZIMUTHS_DEG = np.array([0.0, 45.0, 90.0, 135.0, 180.0])
INNER_VIEWS_DEG = (0.0, 60.0, 85.0)  # what is kept of the middle
INNER_AZIMUTHS_DEG = (0.0, 90.0, 180.0)


def rayleigh(depth):
    return ("rayleigh", 0.0, depth)


def hg(g, depth):
    return ("hg", g, depth)


def haze(g, omega, depth):
    """One layer of one scatterer."""
    return [(depth * (1 - omega), [hg(g, depth * omega)])]


# Layers from the top down: (absorption, [(component, g, scattering)]).
MIXED = [
    (0.02, [rayleigh(0.10)]),
    (0.03, [rayleigh(0.12), hg(0.65, 0.15)]),
    (0.01, [rayleigh(0.05), hg(0.75, 0.40)]),
]
CLOUDED = [
    (0.05, [rayleigh(0.08)]),
    (0.00, [rayleigh(0.02), hg(0.85, 2.50)]),
    (0.10, [rayleigh(0.15), hg(0.50, 0.20), hg(0.75, 0.10)]),
]


def problems():
    """(id, layers, sun zenith [deg], albedo)"""
    out = []
    for depth, zenith, albedo in [
        (0.1, 30, 0.0), (0.1, 60, 0.3), (0.1, 80, 0.0), (0.1, 1, 0.8), (0.5, 0, 0.0), (0.5, 30, 0.3), (0.5, 60, 0.0),
        (0.5, 80, 0.8), (1.0, 1, 0.0), (1.0, 30, 0.8), (1.0, 60, 0.3), (1.0, 80, 0.0),
    ]:
        out.append((f"rayleigh_{depth}_sun{zenith}_a{albedo}", [(0.0, [rayleigh(depth)])], zenith, albedo))
    for g, omega, depth, zenith, albedo in [
        (0.0, 0.9, 1.0, 30, 0.0), (0.0, 0.99, 0.1, 60, 0.3), (0.0, 1.0, 1.0, 60, 0.0), (0.0, 1.0, 5.0, 30, 0.8),
        (0.5, 0.9, 0.1, 30, 0.0), (0.5, 0.99, 1.0, 60, 0.0), (0.5, 1.0, 1.0, 0, 0.3), (0.5, 1.0, 5.0, 60, 0.0),
        (0.7, 0.9, 1.0, 60, 0.3), (0.7, 0.99, 0.1, 30, 0.0), (0.7, 0.99, 1.0, 80, 0.0), (0.7, 1.0, 0.1, 80, 0.8),
        (0.7, 1.0, 1.0, 30, 0.0), (0.7, 1.0, 5.0, 1, 0.3), (0.85, 0.9, 0.1, 60, 0.0), (0.85, 0.9, 5.0, 30, 0.0),
        (0.85, 0.99, 1.0, 30, 0.3), (0.85, 1.0, 1.0, 60, 0.0), (0.85, 1.0, 5.0, 60, 0.8),
    ]:
        out.append((f"hg{g}_omega{omega}_{depth}_sun{zenith}_a{albedo}", haze(g, omega, depth), zenith, albedo))
    for name, layers, runs in [
        ("mixed", MIXED, [(0, 0.3), (30, 0.0), (60, 0.3), (80, 0.0), (30, 0.8)]),
        ("clouded", CLOUDED, [(1, 0.0), (30, 0.3), (60, 0.8), (80, 0.3)]),
    ]:
        out += [(f"{name}_sun{zenith}_a{albedo}", layers, zenith, albedo) for zenith, albedo in runs]
    return out


def moments(component, g):
    """chi_l with P = sum (2l+1) chi_l P_l; Rayleigh without depolarisation."""
    if component == "rayleigh":
        chi = np.zeros(MOMENTS + 1)
        chi[0], chi[2] = 1.0, 0.1
        return chi
    return g ** np.arange(MOMENTS + 1)


def solve(layers, mu0, albedo, streams, zeniths=VIEWS_DEG, azimuths=AZIMUTHS_DEG):
    """Levels (optical depth), fluxes [level, (direct, down, up)], radiances [level, (up, down), view, azimuth]."""
    depth = np.array([absorption + sum(part[2] for part in parts) for absorption, parts in layers])
    scattering = np.array([sum(part[2] for part in parts) for _, parts in layers])
    chi = np.stack([sum(s * moments(c, g) for c, g, s in parts) / sum(s for *_, s in parts) for _, parts in layers], 1)
    levels = np.array([0.0, depth.sum() / 2, depth.sum()])
    mu = np.cos(np.radians(zeniths))

    ds = nanodisort.DisortState()
    # These two before allocate(): it sizes the arrays by them.
    ds.usrtau, ds.usrang = True, True
    ds.nstr, ds.nlyr, ds.nmom, ds.ntau = streams, len(layers), MOMENTS, len(levels)
    ds.numu, ds.nphi = 2 * len(mu), len(azimuths)
    ds.lamber, ds.planck, ds.onlyfl, ds.quiet, ds.spher = True, False, False, True, False
    # Nakajima & Tanaka 1988: single scattering with all moments in place of the truncated ones.
    ds.intensity_correction, ds.old_intensity_correction = True, True
    ds.accur = 0.0
    ds.allocate()
    ds.fbeam, ds.umu0, ds.phi0, ds.fisot, ds.albedo = E, mu0, 0.0, 0.0, albedo
    ds.dtauc, ds.ssalb, ds.pmom, ds.utau = depth, scattering / depth, chi, levels
    # DISORT's cosines are those of propagation, up positive, and ascend.
    ds.umu, ds.phi = np.concatenate([-mu, mu[::-1]]), azimuths
    ds.solve()

    uu = np.asarray(ds.uu)
    assert uu.shape == (2 * len(mu), len(levels), len(azimuths)), uu.shape
    radiance = np.stack([uu[len(mu):][::-1], uu[:len(mu)]])  # [(up, down), view, level, azimuth]
    fluxes = np.stack([np.asarray(ds.rfldir), np.asarray(ds.rfldn), np.asarray(ds.flup)], 1)
    return levels, fluxes, radiance.transpose(2, 0, 1, 3)


def both(problem):
    _, layers, zenith, albedo = problem
    mu0 = np.cos(np.radians(zenith))
    out = []
    for streams in (STREAMS, STREAMS // 2):
        try:
            out.append(solve(layers, mu0, albedo, streams))
        except RuntimeError as error:  # the sun stands too near a quadrature angle
            assert "beam angle" in str(error), error
            out.append(solve(layers, mu0, albedo, streams - 2))
    return out


def check_convention():
    """dphi = 0 is forward: single scattering of a forward-peaked haze is brightest along the beam."""
    _, _, radiance = solve(haze(0.7, 1.0, 0.01), 0.5, 0.0, 64)
    view = list(VIEWS_DEG).index(60.0)
    down = radiance[2, 1, view]
    assert down.argmax() == 0 and down[0] > 100 * down[-1], down
    # tau/mu0 exp(-tau/mu0) P(1)/(4 pi), the layer being thin
    g, tau = 0.7, 0.01
    single = E * tau / 0.5 * np.exp(-tau / 0.5) * (1 + g) / (1 - g) ** 2 / (4 * np.pi)
    assert abs(down[0] / single - 1) < 0.02, (down[0], single)


def write(path, notes, header, rows):
    made_by = [f"CDISORT by nanodisort {nanodisort.__version__}, {STREAMS} streams and {MOMENTS} moments, made by "
               "benches/peers/plane_parallel/make_reference.py"]
    path.write_text("\n".join([*(f"# {line}" for line in [*notes, *made_by]), header, *rows]) + "\n")
    print(f"{path.name}: {len(rows)} rows, {path.stat().st_size / 1024:.0f} KB")


def main():
    args = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    args.add_argument("--out", type=pathlib.Path, default=OUT)
    args.add_argument("--jobs", type=int, default=1)
    args = args.parse_args()
    check_convention()

    asked = problems()
    if args.jobs > 1:
        with ProcessPoolExecutor(args.jobs) as pool:
            found = list(pool.map(both, asked))
    else:
        found = list(map(both, asked))

    suns, columns, fluxes, radiances, worst = [], [], [], [], []
    for (name, layers, zenith, albedo), ((levels, flux, fine), (_, half_flux, half)) in zip(asked, found):
        mu0 = np.cos(np.radians(zenith))
        suns.append(f"{name},{mu0:.15g},{albedo},{E}")
        for i, (absorption, parts) in enumerate(layers):
            columns += [f"{name},{i},{absorption:.12g},{c},{g},{s:.12g}" for c, g, s in parts]
        for i, level in enumerate(["top", "middle", "bottom"]):
            values = ",".join(f"{v:.9e}" for v in flux[i])
            fluxes.append(f"{name},{level},{levels[i]:.12g},{values},{np.abs(flux[i] - half_flux[i]).max():.1e}")
            for j, way in enumerate(["up", "down"]):
                if (level, way) in [("top", "down"), ("bottom", "up")]:
                    continue  # nothing comes from space, and the ground is Lambertian
                for k, view in enumerate(VIEWS_DEG):
                    for m, azimuth in enumerate(AZIMUTHS_DEG):
                        if view == 0 and m > 0:
                            continue
                        if level == "middle" and (view not in INNER_VIEWS_DEG or azimuth not in INNER_AZIMUTHS_DEG):
                            continue
                        mu = np.cos(np.radians(view))
                        sines = np.sqrt((1 - mu * mu) * max(0.0, 1 - mu0 * mu0))
                        cos = (-mu if way == "up" else mu) * mu0 + sines * np.cos(np.radians(azimuth))
                        value, other = fine[i, j, k, m], half[i, j, k, m]
                        worst.append((abs(other / value - 1), name, level, way, view, azimuth))
                        radiances.append(f"{name},{level},{levels[i]:.12g},{way},{mu:.12g},{azimuth:.0f},"
                                         f"{min(1.0, max(-1.0, cos)):.9f},{value:.9e},{abs(other / value - 1):.0e}")
        # All light that enters a column without absorption leaves it or is absorbed by the ground.
        if all(absorption == 0 for absorption, _ in layers):
            net = flux[:, 0] + flux[:, 1] - flux[:, 2]
            assert np.ptp(net) < 1e-8, (name, net)

    beam = "mu0: cosine of the sun's zenith angle; E: irradiance of the beam on a surface facing it; Lambertian ground"
    write(args.out / "plane_parallel_suns.csv", [beam], "id,mu0,albedo,E", suns)
    write(args.out / "plane_parallel_problems.csv",
          ["Layers from the top down; optical depths of one layer. A layer with several components has one row each,",
           "its absorption repeated. rayleigh: P = 3/4 (1 + cos^2), no depolarisation; hg: Henyey-Greenstein of g"],
          "id,layer,absorption,component,g,scattering", columns)
    write(args.out / "plane_parallel_fluxes.csv",
          ["Fluxes through a horizontal surface: direct beam, diffuse down, diffuse up; middle is half the optical depth",
           f"difference: largest change of the three with {STREAMS // 2} streams"],
          "id,level,optical_depth,direct,diffuse_down,diffuse_up,difference", fluxes)
    write(args.out / "plane_parallel.csv",
          ["Diffuse radiance (without the direct beam) per steradian, of light that propagates up or down",
           "mu: cosine of the line of sight's zenith or nadir angle, positive",
           "dphi_deg: azimuth of the light's propagation less that of the beam's propagation; 0 is forward scattering",
           "cos_scattering: between the two directions of propagation",
           f"difference: relative change with {STREAMS // 2} streams"],
          "id,level,optical_depth,propagation,mu,dphi_deg,cos_scattering,radiance,difference", radiances)
    for row in sorted(worst, reverse=True)[:20]:
        print("%.1e %s %s %s %g %g" % row)


if __name__ == "__main__":
    main()
