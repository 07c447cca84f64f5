#!/usr/bin/env python3
"""Compare energies of strokes: the paper's difference of images, distances in both directions, and in one.

    FACEPOSER_CAPTURES=FOLDER python scripts/compare_strokes.py --json strokes.json

Learned from take 3, tested on take 4, as in ``evaluate.py``. On the neutral face a stroke of 450 or 900 pixels is drawn
along a feature (brow, lip, cheek, lid); its target is the same line of the skin in an unseen frame. All methods start
from the neutral face and use the same solver.

  same     the target has the extent of the source
  longer   the target is a quarter longer, as when a hand does not stop at the end of the feature
  shorter  the target is a quarter shorter
  noisy    a deviation of the hand of 1.5 px, with the smoothing of the window
  far      as "same", on the lower lip and in frames with the jaw wide open

  image           the paper's energy, eqs. (12), (13) and (27)
  distance        the default: source to target, target to source, and centres
  forward         source to target only
  forward+centre  source to target, and centres
  both            source to target and target to source, without centres

With --constants, the constants of `distance` are halved and doubled one at a time.
"""

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[variable] = "1"

import argparse
import json
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.evaluation.feature_lines import FEATURE_LINES, feature_line, of_length, width_of
from faceposer.geometry.camera import Camera, OrbitView
from faceposer.geometry.strokes import resampled, smoothed
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.character_file import load_character
from faceposer.model.face_model import FaceModel, build_face_model, gram_of_weights
from faceposer.model.shape_names import weight_map
from faceposer.solve.constraints.stroke import StrokeConstraint, StrokeEnergy, as_pixels
from faceposer.solve.constraints.stroke_terms import StrokeDistanceTerm
from faceposer.solve.map_solver import solve
from faceposer.solve.problem import PoseProblem
from faceposer.training.capture import read_capture
from faceposer.training.expressions import Recipe, clean, learn_from_frames

TRAIN, TEST = "alex_rom_3.csv", "alex_rom_4.csv"
SIZE = (1280, 800)
PIXELS = (450, 900)
SITUATIONS = ("same", "longer", "shorter", "noisy", "far")
NOISE_PX = 1.5
# Least mean motion of a line; weight above which the jaw is wide open.
MOVES_PX, WIDE_OPEN = 3.0, 0.45
REGIONS = {
    "brow_left": "brow_left",
    "brow_right": "brow_right",
    "lip_upper": "lip_upper",
    "lip_lower": "lip_lower",
    "cheek_left": "cheek_left",
    "cheek_right": "cheek_right",
    "lid_left": "lids_left",
    "lid_right": "lids_right",
}


@dataclass(frozen=True)
class Method:
    """An energy, with factors on the terms of the distance energy.

    Attributes:
        energy: "distance" or "image".
        strength: Factor on all terms.
        reverse: Factor on the distances from target to source.
        centre: Factor on the term between the centres.
    """

    energy: StrokeEnergy = "distance"
    strength: float = 1.0
    reverse: float = 1.0
    centre: float = 1.0

    def problem(self, model: FaceModel, stroke: StrokeConstraint) -> PoseProblem:
        """Return the problem of posing ``model`` with ``stroke``."""
        stroke = replace(stroke, energy=self.energy, weight=self.strength)
        problem = PoseProblem(model, [stroke])
        n = len(stroke.points)
        for term in problem.terms:
            if isinstance(term, StrokeDistanceTerm):
                term.weights[2 * n : -2] *= self.reverse
                term.weights[-2:] *= self.centre
        return problem


METHODS = {
    "image": Method("image"),
    "distance": Method(),
    "forward": Method(reverse=0.0, centre=0.0),
    "forward+centre": Method(reverse=0.0),
    "both": Method(centre=0.0),
}
CONSTANTS = {
    f"{part} x {factor:g}": replace(Method(), **{part: factor})
    for part in ("strength", "reverse", "centre")
    for factor in (0.5, 2.0)
}


@dataclass(frozen=True, eq=False)
class Trial:
    """A stroke, the vertices of its frame, and the ids of the vertices to evaluate."""

    stroke: StrokeConstraint
    truth: np.ndarray
    region: np.ndarray


def target_of(line: np.ndarray, situation: str, rng: np.random.Generator) -> np.ndarray:
    """Return the drawn target, shape (m, 2), for a feature at ``line``, shape (n, 2)."""
    if situation in ("longer", "shorter"):
        return of_length(line, 1.25 if situation == "longer" else 0.75)
    if situation == "noisy":
        drawn = resampled(line, 4.0)
        return smoothed(drawn + NOISE_PX * rng.standard_normal(drawn.shape))
    return line


def make_trials(
    model: FaceModel, frames: np.ndarray, camera: Camera, situation: str, pixels: int, poses: int, seed: int
) -> Iterator[Trial]:
    """Yield ``poses`` trials, cycling through the lines, each from a different frame in which its line moves."""
    rng = np.random.default_rng([seed, SITUATIONS.index(situation), pixels])
    character = model.character
    jaw = character.shape_names.index("jawOpen")
    far = situation == "far"
    lines = ["lip_lower"] if far else list(FEATURE_LINES)
    sources = {}
    for name in lines:
        way = resampled(feature_line(model, character.vertices, camera, FEATURE_LINES[name]), 4.0)
        points, met = model.pick(model.neutral(), camera, way)
        stroke = StrokeConstraint(as_pixels(way), as_pixels(way), width_of(way, pixels), camera)
        sources[name] = stroke.resolved(model, model.neutral()), points, way[met]
    done = 0
    for frame in rng.permutation(len(frames)):
        if done == poses:
            return
        name = lines[done % len(lines)]
        stroke, points, rest = sources[name]
        if far and frames[frame, jaw] < WIDE_OPEN:
            continue
        truth = character.vertices + np.tensordot(frames[frame].astype(np.float32), character.shapes, axes=1)
        line = camera.project(points.positions(truth, model.triangles))
        if np.hypot(*(line - rest).T).mean() < MOVES_PX:
            continue
        done += 1
        target = as_pixels(target_of(line, situation, rng))
        yield Trial(replace(stroke, target=target), truth, character.regions[REGIONS[name]])


def judge(model: FaceModel, name: str, method: Method, trials: list[Trial]) -> dict[str, object]:
    """Return the results of ``method`` on ``trials``."""
    errors, neutral_errors, pixels, times, evaluations = [], [], [], [], []
    for trial in trials:
        began = time.perf_counter()
        solution = solve(method.problem(model, trial.stroke), model.neutral())
        times.append((time.perf_counter() - began) * 1e3)
        evaluations.append(solution.evaluations)
        truth = trial.truth[trial.region]
        reached = model.instance(solution.coefficients)[trial.region]
        errors.append(float(np.linalg.norm(reached - truth, axis=1).mean()))
        neutral = model.character.vertices[trial.region]
        neutral_errors.append(float(np.linalg.norm(neutral - truth, axis=1).mean()))
        # The same measure for all methods.
        pixels.append(trial.stroke.residual_px(model, solution.coefficients))
    return {
        "method": name,
        "poses": len(trials),
        "error_3d_relative": round(float(np.mean(errors) / np.mean(neutral_errors)), 4),
        "residual_px": round(float(np.mean(pixels)), 3),
        "worse_than_neutral": round(float(np.mean(np.greater(errors, neutral_errors))), 4),
        "ms": round(float(np.median(times)), 2),
        "evaluations": float(np.median(evaluations)),
    }


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="file to write the rows to")
    parser.add_argument("--character", default="man", help="character to pose (default: man)")
    parser.add_argument("--poses", type=int, default=80, help="test frames per situation (default: 80)")
    parser.add_argument("--examples", type=int, default=Recipe().n_examples, help="capture to learn the prior from")
    parser.add_argument("--seed", type=int, default=0, help="seed of frames and noise (default: 0)")
    parser.add_argument("--constants", action="store_true", help="also vary the constants of the distances")
    options = parser.parse_args()
    folder = os.environ.get("FACEPOSER_CAPTURES")
    if not folder:
        sys.exit("Set FACEPOSER_CAPTURES to the folder with the capture files.")

    recipe = replace(Recipe(), n_examples=options.examples)
    train, test = (clean(read_capture(Path(folder) / take), recipe) for take in (TRAIN, TEST))
    character = load_character(options.character)
    lift = weight_map(character.shape_names, ARKIT_SHAPES)
    if not lift.any(axis=0).all():
        sys.exit(f"The frames do not fit the character '{character.name}': it lacks some of ARKit's 52 shapes.")
    metric = gram_of_weights(load_character("man"), ARKIT_SHAPES)
    model = build_face_model(character, learn_from_frames(train, ARKIT_SHAPES, recipe, metric=metric))
    camera = OrbitView.preset(character.vertices.min(axis=0), character.vertices.max(axis=0)).camera(SIZE)

    methods = METHODS | (CONSTANTS if options.constants else {})
    rows = []
    print(f"{'':33}{'3D error':>9}{'px':>7}{'worse':>7}{'ms':>7}{'evals':>7}  (3D error of the neutral face = 1)")
    for pixels in PIXELS:
        for situation in SITUATIONS:
            trials = list(make_trials(model, test @ lift.T, camera, situation, pixels, options.poses, options.seed))
            print(f"{pixels} pixels, {situation}, {len(trials)} frames")
            for name, method in methods.items():
                found = judge(model, name, method, trials)
                rows.append({"pixels": pixels, "situation": situation, **found})
                values = (
                    f"{found['error_3d_relative']:9.3f}{found['residual_px']:7.2f}{found['worse_than_neutral']:7.3f}"
                )
                print(f"    {name:29}{values}{found['ms']:7.1f}{found['evaluations']:7.0f}", flush=True)
    if options.json:
        data = {"subject": options.character, "train": TRAIN, "test": TEST, "rows": rows}
        options.json.write_text(json.dumps(data, indent=1) + "\n")


if __name__ == "__main__":
    main()
