"""Columns of `layered` by CDISORT (nanodisort), plane-parallel, with the same optical depths and phase functions.

Reads columns_layers.csv and columns_phases.csv, which the crate's own test hands over, and writes columns_disort.csv:
diffuse irradiance at the ground and radiances seen from the ground and from space.
"""

import argparse
import pathlib

import nanodisort
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
DATA = HERE.parents[2] / "crates" / "atmosphere" / "tests" / "data"
STREAMS, MOMENTS = 64, 1000
RUNS = [(30.0, 0.0), (60.0, 0.3), (75.0, 0.3)]  # sun's zenith angle [deg], ground albedo
VIEWS_DEG = np.array([0.0, 24.0, 48.0, 68.0, 77.5, 85.0])
AZIMUTHS_DEG = np.array([0.0, 45.0, 90.0, 135.0, 180.0])


def rows(path):
    lines = path.read_text().splitlines()
    angles = [line[2:] for line in lines if line.startswith("# 0;")]
    body = [line.split(",") for line in lines if not line.startswith("#")][1:]
    return np.array([float(x) for line in angles for x in line.split(";")]), body


def moments(angles, values):
    """chi_l of P whose logarithm is straight between angles, by Gauss-Legendre in each interval."""
    x, w = np.polynomial.legendre.leggauss(24)
    chi = np.zeros(MOMENTS + 1)
    for a, b, p, q in zip(angles[:-1], angles[1:], values[:-1], values[1:]):
        panels = max(1, int(np.ceil((b - a) * MOMENTS / (6 * np.pi))))
        edges = np.linspace(a, b, panels + 1)
        angle = (edges[:-1, None] + (edges[1:] - edges[:-1])[:, None] * 0.5 * (1 + x)).ravel()
        weight = np.repeat(0.5 * (edges[1:] - edges[:-1]), len(x)) * np.tile(w, panels)
        weight = 0.5 * weight * np.sin(angle) * np.exp(np.log(p) + (np.log(q / p)) * (angle - a) / (b - a))
        cos = np.cos(angle)
        p0, p1 = np.ones_like(cos), cos
        chi[0] += weight.sum()
        for k in range(1, MOMENTS + 1):
            chi[k] += weight @ p1
            p0, p1 = p1, ((2 * k + 1) * cos * p1 - k * p0) / (k + 1)
    return chi / chi[0]


def solve(absorption, scattering, chi, sun, albedo, streams):
    depth = absorption + scattering.sum(1)
    ds = nanodisort.DisortState()
    ds.usrtau, ds.usrang = True, True
    ds.nstr, ds.nlyr, ds.nmom, ds.ntau = streams, len(depth), MOMENTS, 2
    mu = np.cos(np.radians(VIEWS_DEG))
    ds.numu, ds.nphi = 2 * len(mu), len(AZIMUTHS_DEG)
    ds.lamber, ds.planck, ds.onlyfl, ds.quiet, ds.spher = True, False, False, True, False
    ds.intensity_correction, ds.old_intensity_correction = True, True
    ds.accur = 0.0
    ds.allocate()
    ds.fbeam, ds.umu0, ds.phi0, ds.fisot, ds.albedo = 1.0, np.cos(np.radians(sun)), 0.0, 0.0, albedo
    ds.dtauc, ds.ssalb = depth, np.minimum(scattering.sum(1) / depth, 1 - 1e-12)
    ds.pmom, ds.utau = (scattering @ chi / scattering.sum(1)[:, None]).T, np.array([0.0, depth.sum()])
    ds.umu, ds.phi = np.concatenate([-mu, mu[::-1]]), AZIMUTHS_DEG
    ds.solve()
    uu = np.asarray(ds.uu)
    return np.asarray(ds.rfldn)[1], uu[len(mu):, 0][::-1], uu[:len(mu), 1]


def both(*problem):
    out = []
    for streams in (STREAMS, STREAMS // 2):
        try:
            out.append(solve(*problem, streams))
        except RuntimeError as error:  # the sun stands too near a quadrature angle
            assert "beam angle" in str(error), error
            out.append(solve(*problem, streams - 2))
    return out


def main():
    args = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    args.add_argument("--out", type=pathlib.Path, default=DATA)
    args = args.parse_args()
    angles, phases = rows(DATA / "columns_phases.csv")
    _, layers = rows(DATA / "columns_layers.csv")
    out = []
    for name in dict.fromkeys(row[0] for row in layers):
        own = [row for row in layers if row[0] == name]
        absorption = np.array([float(row[3]) for row in own])
        scattering = np.array([[float(x) for x in row[4].split(";")] for row in own])
        chi = np.array([moments(np.radians(angles), np.array([float(x) for x in row[1].split(";")]))
                        for row in phases if row[0] == name])
        for sun, albedo in RUNS:
            (down, up, sky), (half_down, half_up, half_sky) = both(absorption, scattering, chi, sun, albedo)
            head = f"{name},{sun},{albedo}"
            out.append(f"{head},flux,,,{down:.9e},{abs(half_down / down - 1):.0e}")
            for way, fine, half in [("sky", sky, half_sky), ("up", up, half_up)]:
                for i, view in enumerate(VIEWS_DEG):
                    for j, azimuth in enumerate(AZIMUTHS_DEG[:1] if view == 0 else AZIMUTHS_DEG):
                        out.append(f"{head},{way},{view},{azimuth:.0f},{fine[i, j]:.6e},{abs(half[i, j] / fine[i, j] - 1):.0e}")
        print(name, flush=True)
    notes = [
        "Diffuse irradiance on the level at the ground (flux), and radiances seen from the ground (sky) and from space (up),",
        "of a beam of unit irradiance; view: zenith or nadir angle; dphi: between the directions in which light and beam",
        f"travel, 0 forward. difference: relative change with {STREAMS // 2} streams",
        f"CDISORT by nanodisort {nanodisort.__version__}, {STREAMS} streams and {MOMENTS} moments, made by "
        "benches/peers/columns/make_reference.py",
    ]
    text = [*(f"# {line}" for line in notes), "id,sun_deg,albedo,what,view_deg,dphi_deg,value,difference", *out]
    (args.out / "columns_disort.csv").write_text("\n".join(text) + "\n")


if __name__ == "__main__":
    main()
