"""Seconds that CDISORT (nanodisort) takes for what `layered` solves: 121 wavelengths of a 33-layer column, one sun.

Prints JSON: the median of --repeats runs, one thread, by streams. Run beside `cargo bench -p sunglint-atmosphere` on an
otherwise idle machine:

  OMP_NUM_THREADS=1 venv/bin/python time_disort.py
"""

import argparse
import importlib.util
import json
import platform
import statistics
import time

import nanodisort
import numpy as np

LAYERS = 33
EDGES_KM = np.append(np.arange(0.0, 26.0), [30.0, 35.0, 40.0, 45.0, 50.0, 60.0, 70.0, 100.0])[::-1]
WAVELENGTHS_UM = np.linspace(0.4, 1.0, 121)
MU0, ALBEDO, HAZE_G, HAZE_ALBEDO, HAZE_KM = 0.6, 0.2, 0.65, 0.95, 2.0
MOMENTS = 128
RUNS = [(8, 104), (16, 208)]  # streams, directions: half up and half down at every level


def shares(scale):
    """Of an exponential's vertical depth, by layer from the top down."""
    below = 1 - np.exp(-EDGES_KM / scale)
    return (below[:-1] - below[1:]) / below[0]


def column(um):
    """Optical depth, single scattering albedo [layer] and moments [moment, layer] at a wavelength [um]."""
    rayleigh = 0.00864 * um ** -4.07 * shares(8.0)  # about the depth of air
    haze = 0.2 * (um / 0.55) ** -1.3 * shares(HAZE_KM) * (EDGES_KM[1:] < 10)
    # A made-up absorber that swings from none to strong over the spectrum, as bands do.
    absorption = 0.5 * np.sin(20 * um) ** 8 * shares(3.0)
    scattering = rayleigh + HAZE_ALBEDO * haze
    depth = rayleigh + haze + absorption
    chi = HAZE_G ** np.arange(MOMENTS + 1)[:, None] * (HAZE_ALBEDO * haze)
    chi[0] += rayleigh
    chi[2] += 0.1 * rayleigh
    return depth, scattering / depth, chi / scattering


def disort(streams, directions, levels):
    """One DisortState a spectrum, solved at every wavelength in turn; radiances at `levels` boundaries."""
    ds = nanodisort.DisortState()
    per_side, azimuths = directions // 2 // 13, np.linspace(0.0, 180.0, 13)
    ds.usrtau, ds.usrang = True, True
    ds.nstr, ds.nlyr, ds.nmom, ds.ntau = streams, LAYERS, MOMENTS, levels
    ds.numu, ds.nphi = 2 * per_side, len(azimuths)
    ds.lamber, ds.planck, ds.onlyfl, ds.quiet, ds.spher = True, False, False, True, False
    ds.intensity_correction, ds.old_intensity_correction, ds.accur = True, True, 0.0
    ds.allocate()
    ds.fbeam, ds.umu0, ds.phi0, ds.fisot, ds.albedo = 1.0, MU0, 0.0, 0.0, ALBEDO
    mu = np.polynomial.legendre.leggauss(per_side)[0] / 2 + 0.5
    ds.umu, ds.phi = np.concatenate([-mu[::-1], mu]), azimuths
    columns = [column(um) for um in WAVELENGTHS_UM]

    def run():
        total = 0.0
        for depth, albedo, chi in columns:
            ds.dtauc, ds.ssalb, ds.pmom = depth, albedo, chi
            boundaries = np.concatenate([[0.0], np.cumsum(depth)])
            ds.utau = boundaries if levels > 2 else boundaries[[0, -1]]
            ds.solve()
            total += float(np.asarray(ds.uu).sum())
        assert np.isfinite(total)
    return run


def sasktran(streams, directions):
    """Plane-parallel discrete ordinates of SASKTRAN2; from space downward alone, half the directions, at the top."""
    import sasktran2 as sk
    config = sk.Config()
    config.num_streams, config.num_stokes, config.num_threads = streams, 1, 1
    config.num_singlescatter_moments = MOMENTS
    config.multiple_scatter_source = sk.MultipleScatterSource.DiscreteOrdinates
    config.delta_m_scaling = True
    z = EDGES_KM[::-1] * 1e3
    shells, flat = sk.InterpolationMethod.LowerInterpolation, sk.GeometryType.PlaneParallel
    geometry = sk.Geometry1D(MU0, 0.0, 6371e3, z, shells, flat)
    per_side, azimuths = directions // 2 // 13, np.linspace(0.0, np.pi, 13)
    looks = sk.ViewingGeometry()
    for mu in np.polynomial.legendre.leggauss(per_side)[0] / 2 + 0.5:
        for azimuth in azimuths:
            looks.add_ray(sk.GroundViewingSolar(MU0, azimuth, mu, 200e3))
    engine = sk.Engine(config, geometry, looks)
    columns = [column(um) for um in WAVELENGTHS_UM]
    factor = (2 * np.arange(MOMENTS) + 1)[:, None]

    def run():
        atmosphere = sk.Atmosphere(geometry, config, numwavel=len(columns), calculate_derivatives=False)
        for i, (depth, albedo, chi) in enumerate(columns):
            up = slice(None, None, -1)
            extinction = depth[up] / np.diff(z)
            atmosphere.storage.total_extinction[:, i] = np.append(extinction, extinction[-1])
            atmosphere.storage.ssa[:, i] = np.append(albedo[up], albedo[0])
            atmosphere.leg_coeff.a1[:, :, i] = (factor * chi[:MOMENTS])[:, np.append(np.arange(LAYERS)[up], 0)]
        atmosphere.surface.albedo[:] = ALBEDO
        found = engine.calculate_radiance(atmosphere)["radiance"].values
        assert np.all(np.isfinite(found)) and np.all(found > 0)
    return run


def median(run, repeats):
    run()
    seconds = []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        seconds.append(time.perf_counter() - start)
    return round(statistics.median(seconds), 4)


def main():
    args = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    args.add_argument("--repeats", type=int, default=5)
    args = args.parse_args()
    out = {"machine": platform.processor() or platform.machine(), "wavelengths": len(WAVELENGTHS_UM), "layers": LAYERS,
           "nanodisort": nanodisort.__version__, "runs": []}
    for streams, directions in RUNS:
        for levels in (2, LAYERS + 1):
            seconds = median(disort(streams, directions, levels), args.repeats)
            out["runs"].append({"solver": "CDISORT", "streams": streams, "directions": directions, "levels": levels,
                                "seconds": seconds})
        if importlib.util.find_spec("sasktran2"):
            seconds = median(sasktran(streams, directions), args.repeats)
            out["runs"].append({"solver": "SASKTRAN2", "streams": streams, "directions": directions // 2, "levels": 1,
                                "seconds": seconds})
    print(json.dumps(out, indent=1))


if __name__ == "__main__":
    main()
