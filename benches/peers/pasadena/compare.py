"""A MODTRAN channel table and two measured targets over Pasadena against `sunglint explain`.

Needs the folder of the data (README.md says which); prints what docs/VALIDATION.md states.
"""

import argparse
import csv
import json
import pathlib
import subprocess
import tempfile

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
BINARY = HERE.parents[2] / "target" / "release" / "sunglint"
# Between the bands of gases [nm].
WINDOWS = [(402, 425), (440, 460), (480, 500), (545, 565), (608, 624), (660, 682), (745, 756), (776, 788), (860, 886),
           (990, 1000)]
SCENE = """glint 1
site {{ latitude 34.139 deg, longitude -118.128 deg, elevation {ground} m }}
collect {{ at 2017-11-08 18:42:27 +00:00 }}
weather {{ profile {profile}, aerosol {aerosol}, aod {aod}, water {water} g/cm2, ozone 0.3 atm-cm }}
atmosphere layered
material target {{ ideal {{ diffuse {reflectance} }} }}
{around}
sensor nadir {{ position (0 0 {height}) m, depression 90 deg, field_of_view 0.1 deg, pixels 1 x 1
{bands}
}}
"""


def read(path):
    with open(path) as lines:
        return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def column(rows, name):
    return np.array([float(row[name]) for row in rows])


def explain(binary, centres, widths, **air):
    """Radiance at the sensor [W m-2 sr-1 um-1] and cos(sun) E_s/pi of every channel."""
    bands = "\n".join(f"  band c{i} centre {c:.3f} nm fwhm {w:.3f} nm" for i, (c, w) in enumerate(zip(centres, widths)))
    with tempfile.TemporaryDirectory() as folder:
        scene = pathlib.Path(folder) / "pasadena.glint"
        if (around := air.pop("around", None)) is None:
            around = "ground target"
        else:  # a field of 40 m in ground of another reflectance
            around = f"material around {{ ideal {{ diffuse {around} }} }}\nground around\n" \
                     "panel target size (40 40) m at (0 0 0.01) m facing up"
        scene.write_text(SCENE.format(bands=bands, around=around, **air))
        found = subprocess.run([binary, "explain", scene, "--pixel", "0,0", "--json", "--quiet"], check=True,
                               capture_output=True, text=True)
    found = json.loads(found.stdout)["bands"]
    terms = [band["terms"] for band in found]
    cosine = np.cos(np.radians(terms[0]["sun_incidence_deg"]))
    return np.array([band["radiance"] for band in found]), cosine / np.pi * np.array([t["solar_irradiance"] for t in terms])


def table(args):
    rows = [row for row in read(args.data / "truth_pasadena2017" / "modtran_black_ground_channels.csv")
            if 400 <= float(row["wavelength_nm"]) <= 1000]
    for water in sorted({row["h2o_g_cm2"] for row in rows}):
        own = [row for row in rows if row["h2o_g_cm2"] == water]
        centres, widths = column(own, "wavelength_nm"), column(own, "channel_width_nm")
        air = dict(ground=args.ground, height=args.sensor - args.ground, aod=0.10, water=water, aerosol=args.aerosol,
                   profile="midlatitude_summer")
        (dark, scale), (grey, _), (bright, _) = (explain(args.binary, centres, widths, reflectance=r, **air)
                                                 for r in (0, 0.2, 0.5))
        # L - L0 = r (A + B) C / (1 - r S) at two r.
        p, q = (grey - dark) / 0.2, (bright - dark) / 0.5
        s = (q - p) / (0.5 * q - 0.2 * p)
        found = {"path": dark / scale, "A+B": p * (1 - 0.2 * s) / scale, "S": s}
        due_scale = 1e4 * column(own, "cossun_toa_over_pi_W_cm2_sr_um")
        path = column(own, "path_radiance_multiple_W_cm2_sr_um") + column(own, "path_radiance_single_W_cm2_sr_um")
        due = {"path": 1e4 * path / due_scale, "A+B": column(own, "a_direct_coeff") + column(own, "b_diffuse_coeff"),
               "S": column(own, "spherical_albedo")}
        print(f"MODTRAN, water {water} g/cm2: ours less the table's, percent, in windows (E0 of the table)")
        print("  window nm      path    A + B        S   our E0")
        for low, high in WINDOWS:
            here = (centres >= low) & (centres <= high)
            off = [100 * (found[k][here].mean() / due[k][here].mean() - 1) for k in found]
            light = 100 * (scale[here].mean() / due_scale[here].mean() - 1)
            print(f"  {low:4}-{high:4}  {off[0]:+8.2f} {off[1]:+8.2f} {off[2]:+8.2f} {light:+8.2f}")
        for k in found:
            print(f"  {k}: root mean square over all channels {100 * np.sqrt(np.mean((found[k] / due[k] - 1) ** 2)):.2f} %")
        if args.verbose:
            for i, c in enumerate(centres):
                print(f"    {c:7.2f} " + " ".join(f"{k} {found[k][i]:.5f} {due[k][i]:.5f}" for k in found))


def spectrum(rows, nm):
    return np.interp(nm, column(rows, "wavelength_nm"), column(rows, "reflectance"))


def surroundings(args):
    """As the language writes it, or nothing."""
    if not args.around:
        return None
    if len(args.around) == 1 and args.around[0][0].isdigit():
        return args.around[0]
    nm = np.arange(380, 1051, 10)
    mean = np.mean([spectrum(read(args.data / "reflectance" / f"{name}.csv"), nm) for name in args.around], 0)
    return "[" + ", ".join(f"{a} nm {r:.4f}" for a, r in zip(nm, mean)) + "]"


def targets(args):
    photometer = read(args.data / "truth_pasadena2017" / "sunphotometer_aod.csv")
    wavelength, depth = column(photometer, "wavelength_nm"), column(photometer, "tau_aerosol")
    aod = float(np.exp(np.interp(np.log(550), np.log(wavelength), np.log(depth))))
    if args.aod is not None:
        aod = args.aod
    measured = [row for row in read(args.data / "truth_pasadena2017" / "at_sensor_radiance.csv")
                if 400 <= float(row["wavelength_nm"]) <= 1000]
    centres, widths = column(measured, "wavelength_nm"), column(measured, "fwhm_nm")
    water = np.array([1.25, 1.75, 2.25, 2.75])
    print(f"AVIRIS-NG: optical depth of the aerosol at 550 nm {aod:.4f}")
    for name, file in [("BeckmanLawn", "lawn_green_pasadena"), ("AstroGreenBaseball", "turf_green_artificial_field")]:
        due = 10 * column(measured, f"L_{name}_uW_cm2_sr_nm")
        curve = read(args.data / "reflectance" / f"{file}.csv")
        curve = ", ".join(f"{row['wavelength_nm']} nm {row['reflectance']}" for row in curve
                          if 360 <= float(row["wavelength_nm"]) <= 1100)
        found = {}
        for w in water:
            found[w], _ = explain(args.binary, centres, widths, ground=args.ground, height=args.sensor - args.ground,
                                  aod=aod, water=w, aerosol=args.aerosol, profile="midlatitude_summer",
                                  reflectance=f"[{curve}]", around=surroundings(args))
        # Water from the band at 0.94 um against its shoulders.
        band = (centres > 925) & (centres < 960)
        shoulder = ((centres > 860) & (centres < 890)) | (centres > 990)
        ratio = [found[w][band].mean() / found[w][shoulder].mean() for w in water]
        fit = float(np.interp(due[band].mean() / due[shoulder].mean(), ratio[::-1], water[::-1]))
        for label, w in [("1.75 g/cm2", 1.75), ("nearest to the fit", water[np.argmin(abs(water - fit))])]:
            off = found[w] / due - 1
            print(f"  {name}, water {label} (fit {fit:.2f}, taken {w}): root mean square {100 * np.sqrt(np.mean(off ** 2)):.2f} %, "
                  f"mean {100 * off.mean():+.2f} %")
        print("   ", ", ".join(f"{low}-{high} {100 * (found[w][here].mean() / due[here].mean() - 1):+.1f} %"
                               for low, high in WINDOWS for here in [(centres >= low) & (centres <= high)]))
        if args.verbose:
            for c, l, t in zip(centres, found[w], due):
                print(f"    {c:7.2f} {l:8.3f} {t:8.3f} {100 * (l / t - 1):+6.1f}")


def main():
    args = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    args.add_argument("--data", type=pathlib.Path, required=True)
    args.add_argument("--binary", type=pathlib.Path, default=BINARY)
    args.add_argument("--ground", type=float, default=350.0, help="elevation of the ground [m]")
    args.add_argument("--sensor", type=float, default=2300.0, help="altitude of the sensor above the sea [m]")
    args.add_argument("--aerosol", default="rural")
    args.add_argument("--around", nargs="+", help="reflectance of what surrounds the targets, a number or spectra of the "
                      "data's folder `reflectance` in equal shares [the targets' own]")
    args.add_argument("--aod", type=float, help="optical depth over the targets [the photometer's]")
    args.add_argument("--targets", action="store_true", help="only the measured targets")
    args.add_argument("--verbose", action="store_true")
    args = args.parse_args()
    if not args.targets:
        table(args)
    targets(args)


if __name__ == "__main__":
    main()
