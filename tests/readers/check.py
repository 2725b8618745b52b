"""Products as the field's own readers see them: GDAL, Spectral Python, OpenEXR.

    python3 check.py OVERHEAD LOCAL

OVERHEAD and LOCAL are folders into which overhead.glint and local.glint of this folder were rendered. Checked are names,
units, wavelengths, widths, values (equal to the bit between EXR and ENVI), sun and time, calibration, and the map: where
GDAL puts each corner against where the sensor stands, to 1e-6 of a pixel.
"""

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy
import OpenEXR
import spectral.io.envi

TIME = "1992-06-18T160000Z"
BANDS = ["green", "red", "nir"]
RADIANCE = "W m-2 sr-1 um-1"
MIDDLE = (282240.0, 4773600.0)  # of the overhead sensors
HEIGHT = 900.0

checks = 0


def hold(claim, condition, *shown):
    """A check that names itself where it fails."""
    global checks
    checks += 1
    if not condition:
        sys.exit(f"{claim}: {', '.join(map(str, shown))}")


def gdal(path):
    return json.loads(subprocess.run(["gdalinfo", "-json", path], check=True, capture_output=True, text=True).stdout)


def gdal_values(path, x, y):
    asked = ["gdallocationinfo", "-valonly", str(path), str(x), str(y)]
    return [float(value) for value in subprocess.run(asked, check=True, capture_output=True, text=True).stdout.split()]


def exr(path):
    with OpenEXR.File(str(path), separate_channels=True) as file:
        part = file.parts[0]
        return dict(part.header), {name: numpy.array(channel.pixels) for name, channel in part.channels.items()}


def same(a, b):
    return a.shape == b.shape and a.astype(numpy.float32).tobytes() == b.astype(numpy.float32).tobytes()


def image(folder, name, unit, dtype):
    """An ENVI image beside its EXR: names, units, wavelengths and every sample. Returns the ENVI metadata."""
    header, channels = exr(folder / f"{name}.exr")
    envi = spectral.io.envi.open(str(folder / f"{name}.hdr"), str(folder / f"{name}.img"))
    meta = envi.metadata
    hold("band names", meta["band names"] == BANDS, name, meta["band names"])
    hold("channels of the EXR", header["sunglint:channels"].split(", ") == BANDS and set(channels) == set(BANDS), name)
    hold("units", meta["data units"] == unit and header["sunglint:units"] == ", ".join([unit] * 3), name)
    hold("wavelengths", numpy.allclose(envi.bands.centers, [540, 645, 820], atol=1e-6), envi.bands.centers)
    hold("unit of wavelengths", envi.bands.band_unit == "Nanometers", envi.bands.band_unit)
    hold("widths", numpy.allclose(envi.bands.bandwidths, [80, 90, 160], atol=1e-6), envi.bands.bandwidths)
    hold("wavelengths of the EXR", header["sunglint:wavelengths_nm"].split(", ") == meta["wavelength"], name)
    hold("widths of the EXR", header["sunglint:fwhm_nm"].split(", ") == meta["fwhm"], name)
    hold("acquisition time", meta["acquisition time"] == "1992-06-18T16:00:00Z", meta.get("acquisition time"))
    elevation, azimuth = float(meta["sun elevation"]), float(meta["sun azimuth"])
    hold("sun", 60 < elevation < 70 and 120 < azimuth < 150, elevation, azimuth)
    samples = numpy.asarray(envi.load(dtype=dtype, scale=False))
    info = gdal(folder / f"{name}.img")
    kind = {"f": "Float32", "u": "UInt16"}[numpy.dtype(dtype).kind]
    hold("type of samples", all(band["type"] == kind for band in info["bands"]), info["bands"][0]["type"])
    for i, band in enumerate(BANDS):
        hold("band name in GDAL", info["bands"][i]["description"].split()[0] == band, info["bands"][i]["description"])
        hold("EXR and ENVI agree", same(samples[:, :, i], channels[band]), name, band)
    for x, y in [(0, 0), (samples.shape[1] - 1, samples.shape[0] - 1), (17, 5)]:
        values = gdal_values(folder / f"{name}.img", x, y)
        expected = [float(channels[band][y, x]) for band in BANDS]
        hold("values in GDAL", numpy.allclose(values, expected, rtol=2e-7, equal_nan=True), values, expected)
    return meta


def corner(heading_deg, east, north, right, ahead):
    """A point `right` and `ahead` of a middle, in m."""
    sin, cos = math.sin(math.radians(heading_deg)), math.cos(math.radians(heading_deg))
    return east + right * cos + ahead * sin, north - right * sin + ahead * cos


def map_of(path, size, pixel, top_deg, middle):
    """GDAL's map: an image of `size` pixels of `pixel` m whose top points to `top_deg`, its middle at `middle`."""
    info = gdal(path)
    g = info["geoTransform"]
    hold("size", info["size"] == list(size), info["size"])
    for x, y in [(0, 0), (size[0], 0), (0, size[1]), (size[0], size[1])]:
        found = (g[0] + g[1] * x + g[2] * y, g[3] + g[4] * x + g[5] * y)
        right, ahead = (x - size[0] / 2) * pixel[0], (size[1] / 2 - y) * pixel[1]
        expected = corner(top_deg, *middle, right, ahead)
        off = math.dist(found, expected) / min(pixel)
        hold("corner within 1e-6 pixel", off < 1e-6, path, (x, y), found, expected, off)
    return info


def overhead(out):
    run = out / "e"
    for name, top in [("north", 0.0), ("turned", 37.0), ("back", 200.0), ("frame", 300.0), ("scan", 300.0)]:
        folder = run / name / TIME
        meta = image(folder, "radiance", RADIANCE, numpy.float32)
        pixel, middle = (0.5, 0.5), MIDDLE
        if name == "frame":
            pixel = (2 * HEIGHT * math.tan(math.radians(1.5)) / 96,) * 2
        if name == "scan":  # flies to 120 deg, so that its top is behind; the first line is centred on its position
            middle = corner(120.0, *MIDDLE, 0.0, 0.5 * (64 / 2 - 0.5))
        info = map_of(folder / "radiance.img", (96, 64), pixel, top, middle)
        crs = info["coordinateSystem"]["wkt"]
        hold("UTM zone 18 north", 'UTM zone 18N' in crs.replace("_", " ") and "WGS 84" in crs, crs)
        solar = [float(value) for value in meta["solar irradiance"]]
        hold("solar irradiance", 1700 < solar[0] < 2000 and 900 < solar[2] < 1200, solar)
        header, _ = exr(folder / "radiance.exr")
        transform = [float(value) for value in header["sunglint:geotransform"].split(", ")]
        hold("geotransform of the EXR", numpy.allclose(transform, info["geoTransform"], rtol=1e-12, atol=1e-9), transform)
        hold("map info of the EXR", "UTM" in header["sunglint:map_info"], header["sunglint:map_info"])

        # A truth map and the map of the header put pixels in one place (f32 holds northings to 0.5 m).
        _, truth = exr(run / name / "truth.exr")
        for x, y in [(0, 0), (95, 63)]:
            east = transform[0] + transform[1] * (x + 0.5) + transform[2] * (y + 0.5)
            hold("truth and map agree", abs(east - truth["x"][y, x]) < 0.02, name, east, truth["x"][y, x])

        counts = image(folder, "counts", "DN", numpy.uint16)
        _, dn = exr(folder / "counts.exr")
        hold("whole numbers in the EXR", dn["red"].dtype == numpy.uint32, dn["red"].dtype)
        gain = [float(value) for value in counts["data gain values"]]
        offset = [float(value) for value in counts["data offset values"]]
        _, radiance = exr(folder / "radiance.exr")
        for i, band in enumerate(BANDS):
            calibrated = gain[i] * dn[band].mean() + offset[i]
            ratio = calibrated / radiance[band].mean()
            hold("counts calibrate to radiance", abs(ratio - 1) < 0.05, name, band, ratio)
        info = gdal(folder / "counts.img")
        scale = [(band["scale"], band["offset"]) for band in info["bands"]]
        hold("calibration in GDAL", numpy.allclose(scale, list(zip(gain, offset)), rtol=1e-6), scale)

        image(folder, "reflectance_factor", "1", numpy.float32)
        _, factor = exr(folder / "reflectance_factor.exr")
        hold("grass in green", 0.06 < numpy.median(factor["green"]) < 0.12, numpy.median(factor["green"]))

    # Turned and not square: readers differ in what `rotation` means, so only the EXR says where it lies.
    folder = run / "stretched" / TIME
    image(folder, "radiance", RADIANCE, numpy.float32)
    hold("no map info of a turned oblong", "\nmap info" not in (folder / "radiance.hdr").read_text())
    header, _ = exr(folder / "radiance.exr")
    transform = [float(value) for value in header["sunglint:geotransform"].split(", ")]
    pixel = math.hypot(transform[1], transform[4]), math.hypot(transform[2], transform[5])
    hold("its pixels", numpy.allclose(pixel, (0.5, 0.625), rtol=1e-9), pixel)

    folder = run / "oblique" / TIME
    image(folder, "radiance", RADIANCE, numpy.float32)
    info = gdal(folder / "radiance.img")
    hold("no map of an oblique view", "coordinateSystem" not in info or not info["coordinateSystem"]["wkt"], info)
    hold("no map info", "map info" not in (folder / "radiance.hdr").read_text())


def local(out):
    info = map_of(out / "e/above" / TIME / "radiance.img", (40, 32), (0.5, 0.5), 40.0, corner(10.0, 0, 0, 100, 200))
    crs = info["coordinateSystem"]["wkt"]
    hold("transverse Mercator about the site", "Transverse Mercator" in crs and "43.0846" in crs and "-77.6743" in crs, crs)
    # The middle of the map lies 224 m from the site: by the sphere's metres a degree within 0.5 %.
    ring = info["wgs84Extent"]["coordinates"][0][:4]
    longitude, latitude = (sum(point[i] for point in ring) / 4 for i in (0, 1))
    east, north = corner(10.0, 0, 0, 100, 200)
    off = ((longitude + 77.6743) * 111320 * math.cos(math.radians(43.0846)) - east, (latitude - 43.0846) * 111100 - north)
    hold("the map lies at the site", math.hypot(*off) < 1.5, off)


overhead(Path(sys.argv[1]))
local(Path(sys.argv[2]))
print(f"readers: {checks} checks hold")
