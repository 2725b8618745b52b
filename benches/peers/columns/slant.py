"""Optical depth of the air along the ray to the sun, by quadrature through the continuous profile.

Nothing is shared with the crate but the profile, its aerosol table and the ozone coefficient: refractivity goes with
p/T, Bouguer's law n r sin z = const gives dtau = beta dh/cos z and the refraction -dn/n tan z, in steps of sqrt(h).
Writes slant_depths.csv; prints how far straight rays err.
"""

import argparse
import csv
import pathlib

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
CRATE = HERE.parents[2] / "crates" / "atmosphere"
RADIUS, TOP = 6371.23e3, 100e3  # m; the radius of LOWTRAN 7
UM = 0.55
APPARENT_DEG = [0.0, 60.0, 75.0, 80.0, 85.0, 87.0, 88.0, 89.0, 89.5, 90.0]
LOSCHMIDT = 2.6868e19


def read(name):
    lines = [line for line in (CRATE / "data" / name).read_text().splitlines() if not line.startswith("#")]
    return list(csv.DictReader(lines))


def exponential(z, values, h):
    """Straight in the logarithm between levels."""
    return np.exp(np.interp(h, z, np.log(np.maximum(values, 1e-300))))


def bodhaine(um):
    """The fit of Bodhaine et al. 1999, eq. 30 [cm2]."""
    s = um ** -2
    return 1e-28 * (1.0455996 - 341.29061 * s - 0.90230850 / s) / (1 + 0.0027059889 * s - 85.968563 / s)


class Air:
    def __init__(self, profile, visibility_km):
        rows = read(f"profile_afgl1986_{profile}.csv")
        column = lambda name: np.array([float(row[name]) for row in rows])
        self.z = 1e3 * column("z_km")
        self.n, self.p, self.t = column("n_air_cm3"), column("p_hpa"), column("t_k")
        self.o3 = 1e-6 * column("o3_ppmv") * self.n
        self.rayleigh = 100 * bodhaine(UM)  # per m and per cm-3
        ozone = read("gas_lowtran7_band_model.csv")
        wavenumber = np.array([float(row["wavenumber_cm1"]) for row in ozone])
        coefficient = np.array([float(row["o3_per_atm_cm"]) for row in ozone])
        order = np.argsort(wavenumber)
        self.ozone = np.interp(1e4 / UM, wavenumber[order], coefficient[order]) * 100 / LOSCHMIDT
        table = read("aerosol_profiles_lowtran7.csv")
        names = list(table[0])
        self.haze_z = 1e3 * np.array([float(row[names[0]]) for row in table])
        rows = np.array([[float(row[n]) if row[n] else 0.0 for n in names] for row in table])
        surface = 3.912 / visibility_km - 1e3 * self.rayleigh * self.n[0]
        low, high = [i for i in (1, 2, 3, 4, 5) if rows[0, i] <= surface][-1:] + [0]
        high = low + 1
        t = (surface - rows[0, low]) / (rows[0, high] - rows[0, low])
        boundary = rows[:, low] + t * (rows[:, high] - rows[:, low])
        troposphere = np.where(low == 1, rows[:, 8] + t * (rows[:, 9] - rows[:, 8]), rows[:, 9])
        z = self.haze_z
        self.haze = 1e-3 * np.select([z <= 2e3, z <= 10e3, z <= 30e3], [boundary, troposphere, rows[:, 14]], rows[:, 18])

    def extinction(self, h):
        haze = exponential(self.haze_z, self.haze, h)
        molecules = self.rayleigh * exponential(self.z, self.n, h)
        return haze + molecules + self.ozone * exponential(self.z, self.o3, h)

    def refractivity(self, h):
        """Edlen 1966 at 15 C and 1013.25 hPa, with density."""
        s = UM ** -2
        standard = 1e-8 * (8342.13 + 2406030 / (130 - s) + 15997 / (38.9 - s))
        return standard * 288.15 / 1013.25 * exponential(self.z, self.p / self.t, h)


def along(air, apparent_deg, bent=True, steps=400_000):
    """Optical depth and true zenith angle [deg] of the ray that is seen at a zenith angle."""
    edges = TOP * np.linspace(0, 1, steps + 1) ** 2  # h = u^2 takes the root at the horizon away
    u = np.sqrt(edges / TOP)
    um = 0.5 * (u[1:] + u[:-1])
    h, dh = TOP * um ** 2, 2 * TOP * um * (u[1:] - u[:-1])
    n = 1 + (air.refractivity(h) if bent else 0 * h)
    n0 = 1 + (air.refractivity(np.zeros(1))[0] if bent else 0)
    sine = n0 * RADIUS * np.sin(np.radians(apparent_deg)) / (n * (RADIUS + h))
    cosine = np.sqrt((1 - sine) * (1 + sine))
    depth = np.sum(air.extinction(h) / cosine * dh)
    dn = np.diff(air.refractivity(edges)) if bent else 0 * h
    return depth, apparent_deg + np.degrees(np.sum(-dn / n * sine / cosine))


def main():
    args = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    args.add_argument("--out", type=pathlib.Path, default=CRATE / "tests" / "data")
    args = args.parse_args()
    rows = []
    for profile, visibility in [("us_standard_1976", 23.0), ("midlatitude_summer", 23.0), ("subarctic_winter", 10.0)]:
        air = Air(profile, visibility)
        coarse = 0.0
        for zenith in APPARENT_DEG:
            depth, true = along(air, zenith)
            straight, _ = along(air, zenith, bent=False)
            coarse = max(coarse, abs(along(air, zenith, steps=200_000)[0] / depth - 1))
            rows.append(f"{profile},{visibility},{zenith},{true:.6f},{depth:.7f},{straight:.7f}")
        print(f"{profile}: half the steps move depths by {coarse:.0e}")
        for true in (85.0, 88.0, 90.0):
            seen = true
            for _ in range(30):
                seen += true - along(air, seen, steps=50_000)[1]
            bent, straight = along(air, seen)[0], along(air, true, bent=False)[0]
            plane = along(air, 0.0)[0] / max(1e-9, np.cos(np.radians(true)))
            print(f"  true zenith {true}: seen at {seen:.3f}, depth {bent:.4f}; straight rays err in transmittance by "
                  f"{100 * np.expm1(bent - straight):+.1f} %, a flat Earth by {100 * np.expm1(bent - plane):+.1f} %")
    notes = ["# Optical depth at 0.55 um from the ground to the sun: air, ozone and rural aerosol, no NO2, no O2-O2.",
             "# apparent_deg is where the refracted ray is seen, true_deg where it comes from; straight: the same without",
             "# refraction at apparent_deg. Made by benches/peers/columns/slant.py"]
    header = "profile,visibility_km,apparent_deg,true_deg,depth,depth_straight"
    (args.out / "slant_depths.csv").write_text("\n".join([*notes, header, *rows]) + "\n")


if __name__ == "__main__":
    main()
