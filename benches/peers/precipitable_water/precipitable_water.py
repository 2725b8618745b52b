"""Precipitable water of two ascents, by MetPy and by a sum of vapour density over height with Bolton's saturation pressure.

Prints the numbers that crates/atmosphere/src/sounding.rs tests against.
"""

import csv
from pathlib import Path

import metpy
import metpy.calc
import numpy as np
from metpy.units import units

DATA = Path(__file__).resolve().parents[3] / "crates/atmosphere/tests/data"

print("MetPy", metpy.__version__)
for name in ("buf_19890628_00z", "buf_20060414_00z"):
    with open(DATA / f"{name}.csv") as file:
        rows = [row for row in csv.DictReader(line for line in file if not line.startswith("#")) if row["dewpoint_c"]]
    p, z, t, dew = (
        np.array([float(row[key]) for row in rows])
        for key in ("pressure_hpa", "height_m_msl", "temperature_c", "dewpoint_c")
    )
    water = metpy.calc.precipitable_water(p * units.hPa, dew * units.degC).to("mm").magnitude
    # MetPy integrates the mixing ratio; dp/g is the mass of moist air, to which the specific humidity belongs.
    share = metpy.calc.specific_humidity_from_dewpoint(p * units.hPa, dew * units.degC).magnitude
    specific = -np.trapezoid(share, 100.0 * p) / 9.80665
    vapour = 6.112 * np.exp(17.67 * dew / (dew + 243.5))  # hPa, Bolton 1980, eq. 10
    density = 100.0 * vapour / (461.5 * (t + 273.15))  # kg m-3
    print(f"{name}: MetPy {water:.3f} mm, its specific humidity {specific:.3f} mm, by hand {np.trapezoid(density, z):.3f} mm")
