"""Reference values of the sun's position, sunrise and sunset, and SPECTRL2, from pvlib.

Writes three CSV files into --out (default: the test data of the crate `atmosphere`):

  sun_position_pvlib.csv   200 random places and times 1950-2050, pvlib.spa.solar_position (NREL SPA)
  sun_events_pvlib.csv     24 places and days, pvlib.solarposition.sun_rise_set_transit_spa, and roots of its SPA
  spectrl2_pvlib.csv       ten states of the air at all 122 wavelengths, pvlib.spectrum.spectrl2

The seed is fixed, so the pvlib of requirements.txt makes the same files again.
"""

import argparse
import pathlib

import numpy as np
import pandas as pd
import pvlib
from scipy.optimize import brentq

HERE = pathlib.Path(__file__).resolve().parent
OUT = HERE.parents[2] / "crates" / "atmosphere" / "tests" / "data"
EPOCH = 2440587.5  # Julian date of 1970-01-01 00:00 UTC


def write(path, notes, frame):
    made_by = f"pvlib {pvlib.__version__} (BSD-3-Clause), made by benches/peers/sun_and_spectrl2/make_reference.py"
    lines = [f"# {line}" for line in [*notes, made_by]]
    path.write_text("\n".join(lines) + "\n" + frame.to_csv(index=False))
    print(f"{path.name}: {len(frame)} rows")


def positions(rng):
    """Places uniform on the sphere; times uniform to the second; pvlib's own estimate of delta T."""
    rows = []
    first = pd.Timestamp("1950-01-01", tz="UTC").timestamp()
    last = pd.Timestamp("2051-01-01", tz="UTC").timestamp()
    while len(rows) < 200:
        unix = float(np.floor(rng.uniform(first, last)))
        latitude = round(float(np.degrees(np.arcsin(rng.uniform(-1, 1)))), 4)
        longitude = round(float(rng.uniform(-180, 180)), 4)
        elevation = round(float(rng.uniform(0, 4000)), 1)
        pressure = round(float(pvlib.atmosphere.alt2pres(elevation)) / 100 * rng.uniform(0.97, 1.02), 2)
        temperature = round(float(rng.uniform(-30, 40)), 2)
        when = pd.Timestamp(unix, unit="s", tz="UTC")
        delta_t = float(pvlib.spa.calculate_deltat(when.year, when.month))
        (apparent_zenith, zenith, *_, azimuth, _) = pvlib.spa.solar_position(
            np.array([unix]), latitude, longitude, elevation, pressure, temperature, delta_t, 0.5667)
        distance = pvlib.spa.earthsun_distance(np.array([unix]), delta_t, 1)
        rows.append((when.strftime("%Y-%m-%dT%H:%M:%SZ"), f"{unix / 86400 + EPOCH:.9f}", latitude, longitude,
                     elevation, pressure, temperature, f"{zenith[0]:.7f}", f"{apparent_zenith[0]:.7f}",
                     f"{azimuth[0]:.7f}", f"{np.atleast_1d(distance)[0]:.9f}", f"{delta_t:.2f}", when.day_of_year))
    return pd.DataFrame(rows, columns=[
        "time_utc", "julian_date", "latitude_deg", "longitude_deg", "elevation_m", "pressure_hpa", "temperature_degc",
        "zenith_deg", "apparent_zenith_deg", "azimuth_deg", "earth_sun_distance_au", "delta_t_s", "day_of_year"])


EVENTS = [  # latitude, longitude, day; pvlib takes the day at the place's own mean solar time
    (43.0846, -77.6743, "1992-06-18"), (43.0846, -77.6743, "1992-12-21"), (0.0, 0.0, "2000-03-20"),
    (0.0, 100.0, "2010-09-23"), (-33.86, 151.21, "2021-01-01"), (-33.86, 151.21, "2021-07-01"),
    (51.48, 0.0, "1985-05-05"), (35.68, 139.69, "2030-10-10"), (-54.8, -68.3, "2019-06-21"),
    (60.17, 24.94, "2015-06-21"), (64.15, -21.94, "2024-12-21"), (65.0, 25.47, "2024-06-01"),
    (19.82, -155.47, "2045-04-04"), (-1.29, 36.82, "1970-11-11"), (27.99, 86.93, "2012-05-19"),
    (-77.85, 166.67, "2018-10-01"), (-45.03, 168.66, "2003-02-14"), (78.22, 15.63, "2020-03-10"),
    (78.22, 15.63, "2020-10-10"), (55.75, 37.62, "1961-04-12"),
    (78.22, 15.63, "2020-06-21"), (78.22, 15.63, "2020-12-21"), (-77.85, 166.67, "2018-12-21"),
    (69.65, 18.96, "2022-12-21"),
]


def crossing(approximate, latitude, longitude):
    """The time near `approximate` (unix) at which pvlib's SPA has the sun's centre at -0.8333 deg, unrefracted."""
    when = pd.Timestamp(approximate, unit="s")
    delta_t = float(pvlib.spa.calculate_deltat(when.year, when.month))

    def above(unix):
        found = pvlib.spa.solar_position(np.array([unix]), latitude, longitude, 0, 0, 12, delta_t, 0.5667)
        return 90 - found[1][0] + 0.8333

    return brentq(above, approximate - 900, approximate + 900, xtol=1e-3)


def events():
    rows = []
    for latitude, longitude, day in EVENTS:
        # A whole number of hours near the place's solar time, so that the civil day holds the noon.
        zone_h = round(longitude / 15)
        zone = pd.Timestamp(day).tz_localize(f"Etc/GMT{-zone_h:+d}" if zone_h else "UTC")
        found = pvlib.solarposition.sun_rise_set_transit_spa(pd.DatetimeIndex([zone]), latitude, longitude, delta_t=None)
        start = zone.timestamp() / 86400 + EPOCH

        def julian(column, refine=False):
            value = found[column].iloc[0]
            if pd.isna(value):
                return ""
            unix = crossing(value.timestamp(), latitude, longitude) if refine else value.timestamp()
            return f"{unix / 86400 + EPOCH:.8f}"

        rows.append((day, zone_h, latitude, longitude, f"{start:.8f}", julian("sunrise", True), julian("sunset", True),
                     julian("transit"), julian("sunrise"), julian("sunset")))
    return pd.DataFrame(rows, columns=["day", "zone_h", "latitude_deg", "longitude_deg", "day_start_jd", "sunrise_jd",
                                       "sunset_jd", "transit_jd", "sunrise_direct_jd", "sunset_direct_jd"])


CASES = [  # zenith, pressure hPa, water g/cm2, ozone atm-cm, AOD 500, albedo, day, omega 400, alpha, omega', g
    (30.0, 1013.0, 1.42, 0.344, 0.27, 0.2, 172, 0.945, 1.14, 0.095, 0.65),
    (0.0, 1013.0, 4.12, 0.277, 0.10, 0.0, 1, 0.945, 1.14, 0.095, 0.65),
    (60.0, 850.0, 0.85, 0.380, 0.05, 0.8, 20, 0.945, 1.14, 0.095, 0.65),
    (75.0, 995.0, 2.92, 0.332, 0.40, 0.2, 210, 0.945, 1.14, 0.095, 0.65),
    (85.0, 1013.0, 1.00, 0.300, 0.20, 0.1, 265, 0.945, 1.14, 0.095, 0.65),
    (88.5, 1020.0, 0.42, 0.376, 0.08, 0.6, 60, 0.945, 1.14, 0.095, 0.65),
    (45.0, 620.0, 0.30, 0.290, 0.02, 0.3, 355, 0.980, 1.60, 0.050, 0.70),
    (20.0, 1005.0, 5.00, 0.260, 1.20, 0.15, 150, 0.850, 0.80, 0.150, 0.60),
    (50.0, 1013.0, 2.08, 0.345, 0.60, 0.25, 91, 0.900, 0.30, 0.095, 0.75),
    (68.0, 940.0, 1.50, 0.400, 0.00, 0.5, 300, 0.945, 1.14, 0.095, 0.65),
]


def spectra():
    rows = []
    for case, (zenith, pressure, water, ozone, aod, albedo, day, omega, alpha, factor, g) in enumerate(CASES):
        air_mass = pvlib.atmosphere.get_relative_airmass(zenith, model="kasten1966")
        distance = pvlib.irradiance.get_extra_radiation(day, method="spencer", solar_constant=1)
        out = pvlib.spectrum.spectrl2(
            apparent_zenith=np.array([zenith]), aoi=np.array([zenith]), surface_tilt=0, ground_albedo=albedo,
            surface_pressure=pressure * 100, relative_airmass=np.array([air_mass]), precipitable_water=water,
            ozone=ozone, aerosol_turbidity_500nm=aod, dayofyear=np.array([day]), scattering_albedo_400nm=omega,
            alpha=alpha, wavelength_variation_factor=factor, aerosol_asymmetry_factor=g)
        for wavelength, direct, diffuse in zip(out["wavelength"], out["dni"][:, 0], out["dhi"][:, 0]):
            rows.append((case, zenith, f"{air_mass:.10g}", pressure, water, ozone, aod, albedo, f"{distance:.10g}",
                         omega, alpha, factor, g, wavelength, f"{direct * 1e3:.9g}", f"{diffuse * 1e3:.9g}"))
    return pd.DataFrame(rows, columns=[
        "case", "apparent_zenith_deg", "relative_air_mass", "pressure_hpa", "water_g_cm2", "ozone_atm_cm", "aod_500nm",
        "ground_albedo", "irradiance_factor", "single_scattering_albedo", "turbidity_exponent",
        "albedo_wavelength_factor", "asymmetry", "wavelength_nm", "direct_normal_w_m2_um", "diffuse_w_m2_um"])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=pathlib.Path, default=OUT, help="folder that takes the three files")
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    write(out / "sun_position_pvlib.csv",
          ["Sun positions by NREL's SPA: 200 random places and times 1950-2050 (seed 19920618).",
           "Refraction with the stated pressure and temperature, 0.5667 deg at the horizon; delta T as pvlib estimates it."],
          positions(np.random.default_rng(19920618)))
    write(out / "sun_events_pvlib.csv",
          ["Sunrise, sunset and transit by NREL's SPA (upper limb, standard refraction); empty where there is none.",
           "sunrise_jd, sunset_jd: where pvlib.spa.solar_position has the centre at -0.8333 deg; *_direct_jd: as printed by",
           "sun_rise_set_transit_spa, which interpolates and errs by minutes where the event falls into the next UTC day.",
           "day_start_jd is the start of the civil day in the zone zone_h; Julian dates are UTC."],
          events())
    write(out / "spectrl2_pvlib.csv",
          ["SPECTRL2 (Bird & Riordan 1986) on the level: direct at normal incidence and diffuse.",
           "irradiance_factor is pvlib's (Spencer 1971) Earth-Sun factor on E_s; air mass after Kasten 1966."],
          spectra())


if __name__ == "__main__":
    main()
