"""Processor time to 1 % of noise a pixel on the truth scene: 640 x 480, sun zenith 60 deg, one band, one time.

Noise is the root of the mean over all pixels, edges too, of ((L - L_ref)/max(L_ref, floor))^2, floor 1 % of the mean, L_ref
the renderer's own reference, that of `full` for what interpolates; what the reference's own noise adds is taken off. Sunglint is asked for a number of samples, and for
an error over the image. Seconds are of the processor, user and
system, on one thread each, the least of --repeats. Mitsuba's scene is loaded and its kernel compiled before they count; Sunglint's are of the whole
program, reading and writing too. What was rendered stays in --out and is not rendered again. Writes a table there.
"""

import argparse
import csv
import hashlib
import pathlib
import resource
import shutil

import numpy as np

from compare import BINARY
from renderers import dr, envi, integrator, mitsuba_image, mitsuba_scene, sunglint
from scenes import ALGORITHMS, SCENES

GOAL, FLOOR = 0.01, 0.01
COUNTS = (16, 64, 144, 256, 400, 784, 1600)  # squares for Mitsuba's multijitter, multiples of 16 for our replicates
ERRORS = (4, 2, 1)  # % over the image
UNBIASED = {"cached": "full"}  # whose reference it is held against
SETTINGS = {  # of Mitsuba: sampler, weight of the sun among the emitters
    "multijitter, sun 3": ("multijitter", 3.0),
    "multijitter, sun 1": ("multijitter", 1.0),
    "independent, sun 3": ("independent", 3.0),
}


def processor(whose=resource.RUSAGE_SELF):
    used = resource.getrusage(whose)
    return used.ru_utime + used.ru_stime


def least_seconds(work, repeats, whose=resource.RUSAGE_SELF):
    """The least processor time that some work took, and what it gave."""
    seconds = []
    for _ in range(repeats):
        start = processor(whose)
        given = work()
        seconds.append(processor(whose) - start)
    return min(seconds), given


def sunglint_timed(args, scene, algorithm, accuracy, seed):
    """The image and its seconds."""
    folder = args.out / "sunglint"
    folder.mkdir(parents=True, exist_ok=True)
    text = scene.glint(algorithm, folder, 16).replace("  seed 1\n", f"  seed {seed}\n")
    text = text.replace("  samples 16\n", f"  {accuracy}\n")
    (path := folder / f"{scene.name}.glint").write_text(text)
    out = folder / f"{scene.name}_{algorithm}_{seed}_{hashlib.sha256(text.encode()).hexdigest()[:8]}"
    if not (timed := out / "processor_s").exists():
        def rendered():
            shutil.rmtree(out, ignore_errors=True)
            sunglint(args.binary, "render", path, "-o", out, "-q", "--threads", "1")

        seconds, _ = least_seconds(rendered, args.repeats, resource.RUSAGE_CHILDREN)
        timed.write_text(f"{seconds}\n")
    return envi(next((out / "all" / "camera").glob("*/radiance.img"))), float(timed.read_text())


def reference(path, image, seeds):
    """Mean over the seeds and its variance, a pixel; kept in `path`."""
    if not path.exists():
        mean, squares = 0.0, 0.0
        for i, seed in enumerate(seeds):  # Welford
            new = image(seed)
            change = new - mean
            mean = mean + change / (i + 1)
            squares = squares + change * (new - mean)
        np.save(path, np.stack([mean, squares / (len(seeds) - 1) / len(seeds)]).astype(np.float32))
    return np.load(path).astype(np.float64)


def noise(image, mean, variance):
    scale = np.maximum(mean, FLOOR * mean.mean())
    return np.sqrt(max(np.mean(((image - mean) ** 2 - variance) / scale ** 2), 0.0))


def seconds_at_goal(rows):
    """Seconds at the goal, a straight line in logarithms between, or through, the two counts next to it."""
    rows = sorted(rows, key=lambda r: r["seconds"])
    i = min(max(sum(r["noise"] > GOAL for r in rows), 1), len(rows) - 1)
    (n0, s0), (n1, s1) = ((np.log(r["noise"]), np.log(r["seconds"])) for r in rows[i - 1:i + 1])
    return float(np.exp(s0 + (np.log(GOAL) - n0) * (s1 - s0) / (n1 - n0)))


def main():
    args = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    args.add_argument("--algorithms", nargs="+", choices=ALGORITHMS, default=["full", "cached"])
    args.add_argument("--scene", choices=["truth_lambert", "truth_mirrors"], default="truth_lambert")
    args.add_argument("--settings", nargs="+", choices=SETTINGS, default=list(SETTINGS))
    args.add_argument("--most", type=int, default=400, help="samples a pixel")
    args.add_argument("--repeats", type=int, default=1, help="times that each is timed")
    args.add_argument("--reference", type=int, default=16, help="seeds of 256 samples")
    args.add_argument("--out", type=pathlib.Path, default=pathlib.Path("out/transport"))
    args.add_argument("--binary", type=pathlib.Path, default=BINARY)
    args = args.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    scene = SCENES[args.scene]
    key = hashlib.sha256(scene.glint("full", args.out, 0).encode()).hexdigest()[:8]
    seeds = range(1001, 1001 + args.reference)
    counts = [n for n in COUNTS if n <= args.most]
    rows = []

    def measured(renderer, setting, samples, image, seconds, due):
        rows.append(dict(renderer=renderer, setting=setting, samples=samples, seconds=seconds, noise=noise(image, *due)))
        print(f"{renderer:10s} {setting:20s} {samples:>5} {seconds:8.1f} s  {100 * rows[-1]['noise']:6.3f} %",
              flush=True)

    for algorithm in args.algorithms:
        by = UNBIASED.get(algorithm, algorithm)
        ours = reference(args.out / f"reference_{scene.name}_sunglint_{by}_{args.reference}_{key}.npy",
                         lambda seed: sunglint_timed(args, scene, by, "samples 256", seed)[0], seeds)
        for samples in counts:
            image, seconds = sunglint_timed(args, scene, algorithm, f"samples {samples}", 1)
            measured("sunglint", algorithm, samples, image, seconds, ours)
        for error in ERRORS:
            image, seconds = sunglint_timed(args, scene, algorithm, f"error {error} % over image", 1)
            measured("sunglint", algorithm + ", error", f"{error} %", image, seconds, ours)

    dr.set_thread_count(1)
    way = integrator(scene.cases["all"])
    loaded = {name: mitsuba_scene(scene, *SETTINGS[name]) for name in args.settings}
    best = loaded[args.settings[0]]
    theirs = reference(args.out / f"reference_{scene.name}_mitsuba_{args.reference}_{key}.npy",
                       lambda seed: mitsuba_image(best, way, 256, seed), seeds)
    for name in args.settings:
        mitsuba_image(loaded[name], way, counts[0], 1)  # compiles
        for samples in counts:
            seconds, image = least_seconds(lambda: mitsuba_image(loaded[name], way, samples, 1), args.repeats)
            measured("mitsuba", name, samples, image, seconds, theirs)

    apart = (ours[0] - theirs[0]) / np.maximum(theirs[0], FLOOR * theirs[0].mean())
    due = np.sqrt(np.mean((ours[1] + theirs[1]) / np.maximum(theirs[0], FLOOR * theirs[0].mean()) ** 2))
    print(f"references: mean {100 * apart.mean():+.4f} %, rms {100 * np.sqrt(np.mean(apart ** 2)):.3f} % apart, "
          f"{100 * due:.3f} % due to their noise")
    of = lambda renderer, setting: seconds_at_goal([r for r in rows if (r["renderer"], r["setting"]) == (renderer, setting)])
    at = {("sunglint", way): of("sunglint", way) for name in args.algorithms for way in (name, name + ", error")}
    at |= {("mitsuba", name): of("mitsuba", name) for name in args.settings}
    for (renderer, setting), seconds in at.items():
        print(f"1 % a pixel: {renderer}, {setting}: {seconds:.1f} s")
    rival = min(seconds for (renderer, _), seconds in at.items() if renderer == "mitsuba")
    for name in args.algorithms:
        own = min(at["sunglint", name], at["sunglint", name + ", error"])
        print(f"{name} at its best over mitsuba at its best: {own / rival:.2f}")
    with open(args.out / f"time_{scene.name}.csv", "w", newline="") as file:
        table = csv.DictWriter(file, rows[0].keys())
        table.writeheader()
        table.writerows(rows)


if __name__ == "__main__":
    main()
