"""The scenes through Sunglint and Mitsuba: radiance of uniform patches, with its standard error from the seeds.

A patch passes if the two differ by less than 0.2 % or 4 standard errors of the difference, whichever is larger; one whose
standard error exceeds 1 % decides nothing. Writes compare.csv and compare.json into --out. Exit code 1 if a patch or a
camera fails.
"""

import argparse
import csv
import json
import pathlib
import sys
import time

import numpy as np

from renderers import integrator, mitsuba_image, mitsuba_ray, mitsuba_scene, sunglint_hit, sunglint_images
from scenes import ALGORITHMS, HERE, SCENES

BINARY = HERE.parents[2] / "target" / "release" / "sunglint"
WITHIN, ERRORS, NOISY, ROUNDING = 0.002, 4.0, 0.01, 1e-5
SUN_WEIGHT, MORE = 3.0, 4  # of Mitsuba: the sun among the emitters; times the samples


def statistics(images, window):
    """Mean of the patch and its standard error, from one independent image a seed."""
    means = np.array([image[window].mean() for image in images])
    return means.mean(), means.std(ddof=1) / np.sqrt(len(means))


def compared(ours, theirs, window):
    (a, s_a), (b, s_b) = statistics(ours, window), statistics(theirs, window)
    s = np.hypot(s_a, s_b)
    verdict = "noisy" if s > NOISY * abs(b) else "pass" if abs(a - b) <= max(WITHIN * abs(b), ERRORS * s) else "FAIL"
    return dict(ours=a, ours_error=s_a, mitsuba=b, mitsuba_error=s_b,
                percent=100 * (a / b - 1) if b else 0.0 if a == 0 else np.inf,
                errors=(a - b) / max(s, ROUNDING * abs(b)) if b else 0.0, verdict=verdict)


def camera_apart(binary, scene, path, loaded):
    """Largest distance between what the middles of a grid of pixels meet, in widths of the pixel there."""
    apart = []
    ifov = 2 * np.tan(np.radians(0.5 * scene.field_of_view)) / scene.pixels[0]
    for x in np.linspace(0, scene.pixels[0] - 1, 5).astype(int):
        for y in np.linspace(0, scene.pixels[1] - 1, 5).astype(int):
            ours, (origin, along, theirs) = sunglint_hit(binary, path, (x, y)), mitsuba_ray(loaded, scene.pixels, (x, y))
            if ours is None or theirs is None:
                assert ours is None and theirs is None, (scene.name, x, y)
                continue
            to = ours - origin
            apart.append(np.linalg.norm(to - (to @ along) * along) / (ifov * (to @ along)))
            assert abs(np.linalg.norm(theirs - origin) / np.linalg.norm(to) - 1) < 1e-3, (scene.name, x, y)
    return max(apart)


def main():
    args = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    args.add_argument("--algorithm", choices=ALGORITHMS, default="full")
    args.add_argument("--scenes", nargs="+", choices=SCENES, default=list(SCENES))
    args.add_argument("--seeds", type=int, default=16)
    args.add_argument("--samples", type=float, default=1.0, help="times those of the scene")
    args.add_argument("--out", type=pathlib.Path, default=pathlib.Path("out/transport"))
    args.add_argument("--binary", type=pathlib.Path, default=BINARY)
    args = args.parse_args()
    rows, cameras = [], {}
    for scene in (SCENES[name] for name in args.scenes):
        samples = max(16, round(args.samples * scene.samples))
        start = time.time()
        ours = sunglint_images(args.binary, scene, args.algorithm, args.out, samples, args.seeds)
        between = time.time()
        loaded = mitsuba_scene(scene, sun_weight=SUN_WEIGHT)
        cameras[scene.name] = camera_apart(args.binary, scene, args.out / f"{scene.name}.glint", loaded)
        print(f"{scene.name}: {samples} samples, {args.seeds} seeds; middles of pixels {cameras[scene.name]:.1e} px apart")
        for name, case in scene.cases.items():
            if case.caustics and args.algorithm != "full":
                print(f"  {name}: not in `{args.algorithm}`")
                continue
            theirs = [mitsuba_image(loaded, integrator(case), MORE * samples, seed + 1) for seed in range(args.seeds)]
            for patch in case.patches or scene.patches:
                row = compared(ours[name], theirs, scene.window(patch))
                rows.append(dict(scene=scene.name, case=name, patch=patch, **row))
                print(f"  {name + ', ' + patch:40s} {row['ours']:10.4f} +- {row['ours_error']:7.4f} "
                      f"{row['mitsuba']:10.4f} +- {row['mitsuba_error']:7.4f} {row['percent']:+8.3f} % "
                      f"{row['errors']:+6.1f} SE  {row['verdict']}", flush=True)
        print(f"  {between - start:.0f} s and {time.time() - between:.0f} s")
    said = dict(algorithm=args.algorithm, seeds=args.seeds, camera_px=cameras, patches=rows)
    (args.out / "compare.json").write_text(json.dumps(said, indent=1) + "\n")
    with open(args.out / "compare.csv", "w", newline="") as file:
        table = csv.DictWriter(file, rows[0].keys())
        table.writeheader()
        table.writerows(rows)
    counts = {v: sum(r["verdict"] == v for r in rows) for v in ("pass", "FAIL", "noisy")}
    print(", ".join(f"{n} {v}" for v, n in counts.items()))
    sys.exit(int(counts["FAIL"] > 0 or max(cameras.values()) > 0.01))


if __name__ == "__main__":
    main()
