"""CDISORT against the discrete ordinates of SASKTRAN2: upward radiances at the top of three columns.

SASKTRAN2 integrates the source along a line of sight with an error of second order in the depth of a layer, so its layers
are cut. Prints the largest relative difference at each view zenith.
"""

import make_reference as reference
import numpy as np
import sasktran2 as sk

MOMENTS = 300


def sasktran(layers, mu0, albedo, streams, cuts):
    layers = [(a / cuts, [(c, g, s / cuts) for c, g, s in parts]) for a, parts in layers for _ in range(cuts)][::-1]
    config = sk.Config()
    config.num_streams, config.num_singlescatter_moments, config.delta_m_scaling = streams, MOMENTS, True
    config.multiple_scatter_source = sk.MultipleScatterSource.DiscreteOrdinates
    # The radius is huge, for the observer's angles are turned into a place around it even in a plane-parallel atmosphere.
    geometry = sk.Geometry1D(mu0, 0.0, 6371e7, np.arange(len(layers) + 1) * 1e3, sk.InterpolationMethod.LowerInterpolation,
                             sk.GeometryType.PlaneParallel)
    looks = sk.ViewingGeometry()
    for view in np.radians(reference.VIEWS_DEG):
        for azimuth in np.radians(reference.AZIMUTHS_DEG):
            looks.add_ray(sk.GroundViewingSolar(mu0, azimuth, np.cos(view), 200e3))
    atmosphere = sk.Atmosphere(geometry, config, numwavel=1, calculate_derivatives=False)
    for i, (absorption, parts) in enumerate([*layers, layers[-1]]):
        scattering = sum(s for *_, s in parts)
        chi = sum(s * reference.moments(c, g) for c, g, s in parts) / scattering
        atmosphere.storage.total_extinction[i, 0] = (absorption + scattering) / 1e3
        atmosphere.storage.ssa[i, 0] = scattering / (absorption + scattering)
        atmosphere.leg_coeff.a1[:, i, 0] = (2 * np.arange(MOMENTS) + 1) * chi[:MOMENTS]
    atmosphere.surface.albedo[:] = albedo
    found = sk.Engine(config, geometry, looks).calculate_radiance(atmosphere)["radiance"].values
    return found.reshape(len(reference.VIEWS_DEG), len(reference.AZIMUTHS_DEG))


RAYLEIGH = [(0.0, [reference.rayleigh(0.5)])]
for name, layers, zenith, albedo in [("mixed", reference.MIXED, 30, 0.3), ("clouded", reference.CLOUDED, 60, 0.8),
                                     ("rayleigh", RAYLEIGH, 60, 0.0)]:
    mu0 = np.cos(np.radians(zenith))
    radiance = reference.solve(layers, mu0, albedo, 60)[2][0, 0]
    for cuts in (1, 4, 16):
        apart = np.abs(sasktran(layers, mu0, albedo, 40, cuts) / radiance - 1).max(1)
        print(name, f"sun {zenith}, {cuts} cuts:", *(f"{v:g}: {a:.1e}" for v, a in zip(reference.VIEWS_DEG, apart)))
