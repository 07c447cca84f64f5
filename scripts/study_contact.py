#!/usr/bin/env python3
"""Measure the contact step: penetration with and without it, its cost, and its Lipschitz constant.

    FACEPOSER_CAPTURES=FOLDER python scripts/study_contact.py --json F                    # the built-in characters
    FACEPOSER_CAPTURES=FOLDER python scripts/study_contact.py man rig.npz --poses 200     # others, fewer poses

Poses are those of the library from -100 to 200 %, evenly spaced frames of a take that nothing was learned from, and
samples of the prior at 1.5 times its spread about its mean. Steadiness is the maximum change of the correction over the
vertices per maximum change of the pose, a Lipschitz constant, along the frames of the take and along straight paths
between poses of the library.
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.errors import FacePoserError
from faceposer.interchange.reading import read_performance
from faceposer.model.contact.measure import penetration_mm
from faceposer.model.face_model import FaceModel
from faceposer.poses import applying
from faceposer.poses.library import starter_poses
from faceposer.session.opening import load_model

Array = NDArray[np.float64]

CHARACTERS = ("man", "woman", "low", "creature")
TAKE = "alex_rom_4.csv"
STRENGTHS = np.linspace(applying.LEAST_STRENGTH, applying.GREATEST_STRENGTH, 13)
SPREAD = 1.5
ALLOWED_MM = 0.1
SEED = 0
# For the steadiness: number of consecutive frames, steps of a straight path, and paths.
_FRAMES, _STEPS, _PATHS = 600, 60, 10
# Smallest relevant motion, in the character's unit; smaller ones are dominated by rounding.
_SHOWS = 1e-4


def library(model: FaceModel) -> tuple[Array, list[str]]:
    """Return the applicable poses of the library at all ``STRENGTHS``, shape (n, r), and their names."""
    poses, names = [], []
    for entry in starter_poses():
        if entry.pose is not None and applying.weights_on(entry.pose, model.character) is not None:
            for strength in STRENGTHS:
                poses.append(applying.applied(model, model.neutral(), entry.pose, float(strength)))
                names.append(f"{entry.pose.name} {100 * strength:.0f} %")
    return np.array(poses), names


def take(model: FaceModel, path: Path) -> Array | None:
    """Return the frames of the take ``path``, shape (F, r), or None if the face lacks its shapes."""
    try:
        return read_performance(path, model).performance.coefficients
    except FacePoserError:
        return None


def draws(model: FaceModel, count: int) -> Array:
    """Return samples of the prior at ``SPREAD`` times its spread, shape (``count``, r)."""
    mean, _ = model.mixture.moments()
    poses: Array = mean + SPREAD * (model.mixture.draws(count, np.random.default_rng(SEED)) - mean)
    return poses


def depths(model: FaceModel, poses: Array, names: Sequence[str]) -> tuple[dict[str, Any], Array]:
    """Return the depths of ``poses``, (n, r), without and with contact, and the milliseconds of the step, (n,)."""
    rows: dict[str, list[dict[str, float]]] = {"without": [], "with": []}
    milliseconds = np.zeros(len(poses))
    moved, untouched = 0.0, 0
    for i, pose in enumerate(poses):
        before = model.instance(pose)
        after = before.copy()
        # Time of this thread only, independent of other programs.
        began = time.thread_time()
        model.contact.apply(after)
        milliseconds[i] = 1e3 * (time.thread_time() - began)
        moved = max(moved, float(np.linalg.norm(after - before, axis=1).max()))
        untouched += bool(np.array_equal(after, before))
        for which, vertices in (("without", before), ("with", after)):
            rows[which].append(penetration_mm(model, vertices))
    kinds = list(rows["with"][0]) if rows["with"] else []
    return {
        "poses": len(poses),
        "untouched": untouched,
        "moved_mm": 10.0 * moved,
        "depths": [
            {"kind": kind, "contact": which} | summary(np.array([row[kind] for row in rows[which]]), names)
            for kind in kinds
            for which in ("without", "with")
        ],
    }, milliseconds


def summary(depth: Array, names: Sequence[str]) -> dict[str, Any]:
    """Return the summary of ``depth``, millimetres in each pose, shape (n,)."""
    deepest = int(depth.argmax())
    return {
        "median_mm": float(np.median(depth)),
        "q95_mm": float(np.quantile(depth, 0.95)),
        "max_mm": float(depth[deepest]),
        "share_over": float((depth > ALLOWED_MM).mean()),
        "deepest": names[deepest],
    }


def steadiness(model: FaceModel, paths: Iterator[Array]) -> dict[str, float]:
    """Return the change of the correction per change of the pose along ``paths``, of shape (n, r) each."""
    ratios = []
    for path in paths:
        before: tuple[Array, Array] | None = None
        for pose in path:
            shape = model.instance(pose)
            added = model.contact.apply(shape.copy()) - shape
            if before is not None:
                step = float(np.linalg.norm(shape - before[0], axis=1).max())
                if step > _SHOWS:
                    ratios.append(float(np.linalg.norm(added - before[1], axis=1).max()) / step)
            before = shape, added
    return {"median": float(np.median(ratios)), "q99": float(np.quantile(ratios, 0.99)), "max": float(np.max(ratios))}


def straight_paths(poses: Array) -> Iterator[Array]:
    """Yield straight paths between random pairs of ``poses``, (n, r), in ``_STEPS`` steps each."""
    order = np.random.default_rng(SEED).permutation(len(poses))[: _PATHS + 1]
    for first, last in pairwise(order):
        yield np.linspace(poses[first], poses[last], _STEPS + 1)


def study(model: FaceModel, captures: Path | None, count: int) -> dict[str, Any]:
    """Return all measurements of one character, with at most ``count`` poses of the take and of the prior."""
    began = time.thread_time()
    model.contact  # noqa: B018 (made once, and timed)
    result: dict[str, Any] = {"prepared_s": time.thread_time() - began, "sets": {}, "steadiness": {}}
    poses, names = library(model)
    sets: dict[str, tuple[Array, Sequence[str]]] = {"library": (poses, names)}
    frames = None if captures is None else take(model, captures / TAKE)
    if frames is not None:
        chosen = np.unique(np.linspace(0, len(frames) - 1, count).round().astype(int))
        sets["take"] = frames[chosen], [f"frame {i + 1}" for i in chosen]
        middle = len(frames) // 2
        result["steadiness"]["take"] = steadiness(model, iter([frames[middle : middle + _FRAMES]]))
    sets["prior"] = draws(model, count), [f"draw {i}" for i in range(count)]
    result["steadiness"]["paths"] = steadiness(model, straight_paths(poses))
    for name, (of_set, its_names) in sets.items():
        found, milliseconds = depths(model, of_set, its_names)
        found["ms"] = {"median": float(np.median(milliseconds)), "q95": float(np.quantile(milliseconds, 0.95))}
        result["sets"][name] = found
    return result


def show(name: str, result: dict[str, Any]) -> None:
    """Print the measurements of one character."""
    print(f"{name}: prepared in {result['prepared_s']:.2f} s")
    for which, found in result["sets"].items():
        print(
            f"  {which}: {found['poses']} poses, {found['untouched']} untouched, skin moved {found['moved_mm']:.1f} mm "
            f"at most, {found['ms']['median']:.2f} ms (95 %: {found['ms']['q95']:.2f})"
        )
        for row in found["depths"]:
            print(
                f"    {row['kind']:14} {row['contact']:8} max {row['max_mm']:6.3f} mm, 95 % {row['q95_mm']:6.3f}, over "
                f"{ALLOWED_MM} mm: {100 * row['share_over']:5.1f} %  ({row['deepest']})"
            )
    for which, ratios in result["steadiness"].items():
        print(
            f"  steadiness, {which}: median {ratios['median']:.2f}, 99 % {ratios['q99']:.2f}, max {ratios['max']:.2f}"
        )


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "characters", nargs="*", default=CHARACTERS, help="names or files (default: the built-in characters)"
    )
    parser.add_argument("--poses", type=int, default=1000, help="poses of the take and of the prior (default: 1000)")
    parser.add_argument("--json", type=Path, metavar="F", help="file to write all measurements to")
    options = parser.parse_args()
    captures = os.environ.get("FACEPOSER_CAPTURES")
    if not captures:
        print(f"poses of the take are skipped; set FACEPOSER_CAPTURES to the folder with {TAKE}", file=sys.stderr)
    results = {}
    for name in options.characters:
        results[name] = study(load_model(name), Path(captures) if captures else None, options.poses)
        show(Path(name).stem, results[name])
        sys.stdout.flush()
    if options.json is not None:
        options.json.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
