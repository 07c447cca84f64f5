#!/usr/bin/env python3
"""Measure how well in-betweens restore captured motion of which only some frames are keys.

    FACEPOSER_CAPTURES=FOLDER python scripts/study_inbetweens.py --json inbetweens.json
    FACEPOSER_CAPTURES=FOLDER python scripts/study_inbetweens.py --tune

The prior is learned from take 3, and the motion is that of take 4 of the same performer: all runs of 300 frames without
tracking jumps. Every 5th, 10th or 20th frame is a key, and the frames between them are restored by linear interpolation
of the meshes, by monotone cubics of the rig weights, and by splines of feature points. With --tune, settings of the
splines are compared on both folds of take 3 instead.

  error   mean distance to the true face in millimetres, over the frames between keys and the vertices of the regions
  jerk    root mean square of the third difference from frame to frame, mm, of the same vertices
  beyond  root mean square of the part of a rig weight that is outside the range of its two keys, in hundredths
  ms      time of a frame once the keys are known
"""

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[variable] = "1"

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.animation.keyframes import Key, Keyframes
from faceposer.evaluation.setting import StudyContext
from faceposer.evaluation.takes import FOLDS
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.character_file import load_character
from faceposer.model.face_model import FaceModel
from faceposer.sketch.inbetweens import COMPONENTS, DIMENSIONS, TENSION, PointFaces, PointSpline
from faceposer.sketch.training_poses import FEW_POSES, MANY_POSES, TrainingPoses
from faceposer.training.capture import read_capture
from scripts.study_animation import TEST, TRAIN, Study, jump_free_runs

SPACINGS = (5, 10, 20)
N_FRAMES = 300
Array = np.ndarray
#: Restores the poses at times, given the animation of the keys.
Method = Callable[[FaceModel, Keyframes, Array], Array]


def linear(_model: FaceModel, keyframes: Keyframes, times: Array) -> Array:
    """Return linear interpolations of the keys, which are those of the meshes."""
    poses = np.stack([key.pose for key in keyframes.keys])
    i = np.clip(np.searchsorted(keyframes.frames, times, side="right") - 1, 0, len(poses) - 2)
    places = np.array(keyframes.frames, dtype=np.float64)
    shares = ((times - places[i]) / (places[i + 1] - places[i]))[:, None]
    return (1.0 - shares) * poses[i] + shares * poses[i + 1]


def ours(model: FaceModel, keyframes: Keyframes, times: Array) -> Array:
    """Return monotone cubics of the rig weights."""
    return replace(keyframes, inbetweens="poses").sampled(model, times)


def feature_points(model: FaceModel, keyframes: Keyframes, times: Array) -> Array:
    """Return splines of feature points."""
    return replace(keyframes, inbetweens="feature points").sampled(model, times)


def mapped_alone(model: FaceModel, keyframes: Keyframes, times: Array) -> Array:
    """Return splines of feature points as in the paper: with its number of poses, and keys not restored."""
    poses = np.stack([key.pose for key in keyframes.keys])
    faces = PointFaces.fit(TrainingPoses.of(model, FEW_POSES), FEW_POSES)
    return PointSpline(faces, np.array(keyframes.frames, dtype=np.float64), poses).poses_at(times)


METHODS: dict[str, Method] = {
    "meshes, linear": linear,
    "rig weights, monotone cubics": ours,
    "feature points": feature_points,
    "feature points, 36 poses, keys not restored": mapped_alone,
}


def key_animation(truth: Array, spacing: int) -> Keyframes:
    """Return the animation with every ``spacing``-th frame of ``truth``, (F, r), as a key."""
    last = (len(truth) - 1) // spacing * spacing
    return Keyframes(tuple(Key.of(frame, truth[frame]) for frame in range(0, last + 1, spacing)), 30.0, last + 1)


def measures(study: Study, method: Method, truth: Array, spacing: int) -> dict[str, float]:
    """Return the errors of ``method`` for the motion ``truth``, (F, r), with a key at every ``spacing``-th frame."""
    model, keyframes = study.model, key_animation(truth, spacing)
    times = np.arange(keyframes.length, dtype=np.float64)
    method(model, keyframes, times[:1])
    began = time.perf_counter()
    poses = method(model, keyframes, times)
    seconds = time.perf_counter() - began
    between = times % spacing != 0
    places = study.face_places
    offsets = places(poses - truth[: len(poses)])[between]
    return {
        "error": float(np.linalg.norm(offsets, axis=2).mean()),
        "jerk": _rms(np.diff(places(poses), 3, axis=0)),
        "jerk of truth": _rms(np.diff(places(truth), 3, axis=0)),
        "beyond": 100.0 * _beyond(model, keyframes, poses),
        "ms": 1e3 * seconds / len(times),
    }


def _rms(offsets: Array) -> float:
    return float(np.sqrt((offsets**2).sum(axis=-1).mean()))


def _beyond(model: FaceModel, keyframes: Keyframes, poses: Array) -> float:
    weights = poses @ model.subspace.directions.T
    squares = 0.0
    for first, second in pairwise(keyframes.frames):
        ends = np.sort(weights[[first, second]], axis=0)
        part = weights[first:second]
        squares += float((np.maximum(part - ends[1], 0.0) ** 2 + np.maximum(ends[0] - part, 0.0) ** 2).sum())
    return float(np.sqrt(squares / weights[:-1].size))


def mean(rows: Iterable[dict[str, float]]) -> dict[str, float]:
    """Return the means of measures, root mean squares for those that are."""
    table = list(rows)
    totals = {key: np.array([row[key] for row in table]) for key in table[0]}
    plain = ("error", "ms")
    return {
        key: float(values.mean() if key in plain else np.sqrt((values**2).mean())) for key, values in totals.items()
    }


def shown(name: str, found: dict[str, float]) -> str:
    """Return a line of the table."""
    cells = [f"{found['error']:.3f}", f"{found['jerk']:.2f}", f"{found['beyond']:.1f}"]
    return f"| {name} | " + " | ".join([*cells, f"{found['ms']:.3f}"]) + " |"


def truths(study: Study, path: Path, part: tuple[float, float] = (0.0, 1.0)) -> list[Array]:
    """Return the poses of all runs of a take, each of shape (300, r): the nearest ones of the subspace."""
    runs = jump_free_runs(study.setting, path, N_FRAMES, part)
    return [weights @ study.model.subspace.projection.T for _, weights in runs]


def study_methods(folder: Path) -> dict[str, Any]:
    """Print the tables and return their values."""
    studied = Study(StudyContext.of(load_character("man"), [read_capture(folder / TRAIN).with_shapes(ARKIT_SHAPES)]))
    runs = truths(studied, folder / TEST)
    result: dict[str, Any] = {"runs": len(runs)}
    for spacing in SPACINGS:
        result[str(spacing)] = found = {
            name: mean(measures(studied, method, truth, spacing) for truth in runs) for name, method in METHODS.items()
        }
        print(f"\nA key every {spacing} frames; jerk of the truth {found['feature points']['jerk of truth']:.2f}\n")
        print("| | error | jerk | beyond | ms |\n| --- | --- | --- | --- | --- |")
        for name, of_method in found.items():
            print(shown(name, of_method), flush=True)
    return result


def settings() -> Iterator[tuple[str, int, int, int, float]]:
    """Yield name, number of training poses, dimensions, components and tension of the settings to compare."""
    chosen = (MANY_POSES, DIMENSIONS, COMPONENTS, TENSION)
    yield "chosen", *chosen
    for dimensions in (4, 8, 12, 20, 30, 40, 60):
        yield f"{dimensions} dimensions", *chosen[:1], dimensions, *chosen[2:]
    for components in (1, 2, 3, 5):
        yield f"{components} components", *chosen[:2], components, *chosen[3:]
    for tension in (0.0, 0.25, 0.5):
        yield f"tension {tension:g}", *chosen[:3], tension
    yield f"{FEW_POSES} training poses", FEW_POSES, *chosen[1:]


def tune(folder: Path) -> dict[str, Any]:
    """Print the errors of settings on the folds of take 3, and return them."""
    take = read_capture(folder / TRAIN).with_shapes(ARKIT_SHAPES)
    folds = []
    for (begin, end), tested in FOLDS.values():
        part = slice(round(begin * len(take.weights)), round(end * len(take.weights)))
        studied = Study(StudyContext.of(load_character("man"), [replace(take, weights=take.weights[part])]))
        folds.append((studied, truths(studied, folder / TRAIN, tested)))
    result: dict[str, Any] = {}
    heads = [f"{quantity} at {spacing}" for spacing in SPACINGS for quantity in ("error", "jerk", "beyond")]
    print("| | " + " | ".join(heads) + " |\n| --- |" + " --- |" * len(heads))

    def row(name: str, method_of: Callable[[Study], Method]) -> None:
        cells, result[name] = [], {}
        for spacing in SPACINGS:
            rows = [measures(one, method_of(one), truth, spacing) for one, runs in folds for truth in runs]
            result[name][spacing] = found = mean(rows)
            cells += [f"{found[key]:.3f}" for key in ("error", "jerk", "beyond")]
        print(f"| {name} | " + " | ".join(cells) + " |", flush=True)

    for name, method in list(METHODS.items())[:2]:
        row(name, lambda _, method=method: method)  # type: ignore[misc]
    for name, *setting in settings():
        row(name, lambda one, setting=setting: _spline_method(one.model, *setting))  # type: ignore[misc]
    return result


def _spline_method(model: FaceModel, count: int, dimensions: int, components: int, tension: float) -> Method:
    faces = PointFaces.fit(TrainingPoses.of(model, count), dimensions, components)

    def method(model: FaceModel, keyframes: Keyframes, times: Array) -> Array:
        poses = np.stack([key.pose for key in keyframes.keys])
        spline = PointSpline(faces, np.array(keyframes.frames, dtype=np.float64), poses, tension)
        rest = Keyframes(
            tuple(Key.of(key.frame, residual) for key, residual in zip(keyframes.keys, spline.residuals, strict=True)),
            length=keyframes.length,
        )
        return spline.poses_at(times) + rest.sampled(model, times)

    return method


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="file to write the numbers to")
    parser.add_argument("--tune", action="store_true", help="compare settings on the folds of take 3")
    options = parser.parse_args()
    folder = os.environ.get("FACEPOSER_CAPTURES")
    if not folder or not (Path(folder) / TEST).is_file():
        sys.exit(f"Set FACEPOSER_CAPTURES to the folder with {TRAIN} and {TEST}.")
    result = tune(Path(folder)) if options.tune else study_methods(Path(folder))
    if options.json is not None:
        options.json.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
