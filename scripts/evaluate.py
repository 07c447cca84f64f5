#!/usr/bin/env python3
"""Judge the prior on a take that it never saw, against what it is to be better than.

    FACEPOSER_CAPTURES=FOLDER python scripts/evaluate.py --json evaluation.json

Trained on take 3, tested on take 4 (section 9 of the paper): from the neutral face, random visible points that move are
given the pixels that they have in an unseen frame, exactly or with the 1.5 px by which a hand misses; the pose found
is compared with the frame. All methods see the same constraints under the same camera and run the same solver.

  mfa        what ships: mixture seen from the start pose, regions loosely coupled, rig weights bounded
  mfa-plain  mixture by plain maximum likelihood, K = 30, q = 10, as in the paper: its modes are where they are
  ppca       one Gaussian, same examples and subspace
  pca        no prior, in the subspace of 99 % of the variance, which suits it best
  mfa-paper  mfa-plain as the paper has it: raw frames, subspace of 99 % of the variance (for comparison)
"""

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[variable] = "1"

import argparse
import json
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from faceposer.geometry.camera import Camera, OrbitView
from faceposer.geometry.mesh import VertexNormals
from faceposer.geometry.picking import SurfacePoint, pick
from faceposer.model.capture import read_capture
from faceposer.model.expression_statistics import ExpressionStatistics
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.model.subject import ARKIT_SHAPES
from faceposer.model.subject_file import load_subject
from faceposer.model.training import Recipe, augment, clean, fit_statistics
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.map_solver import Solution, solve
from faceposer.solve.problem import PoseProblem

TRAIN, TEST = "alex_rom_3.csv", "alex_rom_4.csv"
COUNTS = (1, 2, 4, 8, 16, 32)
NOISE_PX = (0.0, 1.5)
SIZE = (800, 800)
MOVES_PX = 1.0
Method = Callable[[list[PointConstraint]], tuple[FaceModel, Solution]]


@dataclass(frozen=True)
class Trial:
    """One test: constraints from a frame, and the vertices of that frame."""

    constraints: list[PointConstraint]
    truth: np.ndarray
    neutral_error: float


def plain_statistics(examples: np.ndarray, recipe: Recipe) -> ExpressionStatistics:
    """Return statistics by maximum likelihood alone."""
    plain = replace(recipe, n_components=30, n_factors=10, fit_shrinkage=0.0, blend=0.0)
    return fit_statistics(examples, ARKIT_SHAPES, plain, "")


def dimensions_of_energy(model: FaceModel, energy: float) -> int:
    """Return how many components have the share ``energy`` of the variance."""
    return int(np.searchsorted(np.cumsum(model.subspace.variances) / model.subspace.variances.sum(), energy)) + 1


def make_methods(subject_name: str, frames: np.ndarray, recipe: Recipe) -> tuple[dict[str, Method], FaceModel]:
    """Return all methods, trained on ``frames``, and the model of the one that ships."""
    subject = load_subject(subject_name)
    examples = augment(frames, ARKIT_SHAPES, recipe)
    ours = build_face_model(subject, fit_statistics(examples, ARKIT_SHAPES, recipe, ""))
    plain = build_face_model(subject, plain_statistics(examples, recipe))
    paper_statistics = plain_statistics(frames, recipe)
    wide = build_face_model(subject, paper_statistics, len(ARKIT_SHAPES), "plain")
    paper = build_face_model(subject, paper_statistics, dimensions_of_energy(wide, 0.99), "plain")
    gaussian = ours.mixture.as_gaussian()

    def as_the_paper(model: FaceModel, **options: object) -> Method:
        return lambda constraints: (model, solve(PoseProblem(model, constraints, **options)))  # type: ignore[arg-type]

    return {
        "mfa": lambda constraints: (ours, solve(PoseProblem(ours, constraints))),
        "mfa-plain": as_the_paper(plain, mixture=plain.mixture),
        "ppca": as_the_paper(ours, mixture=gaussian),
        "pca": as_the_paper(paper, prior_weight=0.0),
        "mfa-paper": as_the_paper(paper, mixture=paper.mixture),
    }, ours


def visible_anchors(model: FaceModel, camera: Camera) -> list[tuple[int, SurfacePoint]]:
    """Return the vertices of the skin that the camera sees on the neutral face, a third of them, with their points."""
    subject = model.subject
    vertices = subject.vertices
    skin = subject.part("skin")
    normals = VertexNormals(subject.triangles, len(vertices))(vertices)
    facing = np.einsum("nd,nd->n", normals, camera.center - vertices) > 0.2 * np.linalg.norm(camera.center)
    candidates = [v for v in range(*skin.vertices) if facing[v]][::3]
    # Only triangles of the front can hide a point that faces the camera.
    front = subject.triangles[facing[subject.triangles].any(axis=1)]
    anchors = []
    for vertex, pixel in zip(candidates, camera.project(vertices[candidates]).tolist(), strict=True):
        hit = pick(vertices, front, camera, (pixel[0], pixel[1]))
        if hit is not None and np.linalg.norm(vertices[front[hit.face]] - vertices[vertex], axis=1).min() < 0.5:
            anchors.append((vertex, SurfacePoint.at_vertex(subject.triangles, vertex)))
    return anchors


def make_trials(
    model: FaceModel, frames: np.ndarray, camera: Camera, count: int, noise_px: float, poses: int, seed: int
) -> list[Trial]:
    """Return ``poses`` trials of ``count`` points each, from frames in which enough of the face moves."""
    rng = np.random.default_rng([seed, count])
    subject = model.subject
    anchors = visible_anchors(model, camera)
    vertex_ids = np.array([vertex for vertex, _ in anchors])
    rest = camera.project(subject.vertices[vertex_ids])
    trials: list[Trial] = []
    for frame in rng.permutation(len(frames)):
        truth = subject.vertices + np.tensordot(frames[frame].astype(np.float32), subject.shapes, axes=1)
        pixels = camera.project(truth[vertex_ids])
        moving = np.flatnonzero(np.hypot(*(pixels - rest).T) > MOVES_PX)
        if len(moving) < 100:
            continue
        chosen = rng.choice(moving, count, replace=False)
        targets = pixels[chosen] + noise_px * rng.standard_normal((count, 2))
        constraints = [
            PointConstraint(anchors[i][1], (float(u), float(v)), camera)
            for i, (u, v) in zip(chosen, targets, strict=True)
        ]
        neutral_error = float(np.linalg.norm(truth - subject.vertices, axis=1).mean())
        trials.append(Trial(constraints, truth, neutral_error))
        if len(trials) == poses:
            break
    return trials


def judge(name: str, method: Method, trials: list[Trial], count: int, noise_px: float) -> dict[str, object]:
    """Return one row of the result."""
    errors, pixels, times, worse = [], [], [], 0
    for trial in trials:
        began = time.perf_counter()
        model, solution = method(trial.constraints)
        times.append((time.perf_counter() - began) * 1e3)
        error = float(np.linalg.norm(model.instance(solution.coefficients) - trial.truth, axis=1).mean())
        errors.append(error)
        pixels.append(float(np.mean(solution.residuals_px)))
        worse += error > trial.neutral_error
    neutral = float(np.mean([trial.neutral_error for trial in trials]))
    return {
        "method": name,
        "constraint": "point",
        "count": count,
        "noise_px": noise_px,
        "poses": len(trials),
        "error_3d": round(float(np.mean(errors)), 5),
        "error_3d_relative": round(float(np.mean(errors)) / neutral, 4),
        "error_2d_px": round(float(np.mean(pixels)), 4),
        "worse_than_neutral": round(worse / len(trials), 4),
        "ms": round(float(np.median(times)), 3),
    }


def print_table(rows: list[dict[str, object]], key: str, noise_px: float) -> None:
    """Print one value of all methods by the number of points."""
    methods = list(dict.fromkeys(str(row["method"]) for row in rows))
    for method in methods:
        values = [row[key] for row in rows if row["method"] == method and row["noise_px"] == noise_px]
        print(f"  {method:11}" + "".join(f"{value:9.3f}" for value in values))


def main() -> None:
    """Train, test and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="write the rows to this file")
    parser.add_argument("--subject", default="man", help="face to pose (default: man)")
    parser.add_argument("--poses", type=int, default=200, help="test frames per count (default: 200)")
    parser.add_argument("--seed", type=int, default=0, help="of frames, points and noise (default: 0)")
    options = parser.parse_args()
    folder = os.environ.get("FACEPOSER_CAPTURES")
    if not folder:
        sys.exit("Set FACEPOSER_CAPTURES to the folder with the capture files.")

    recipe = Recipe()
    train, test = (clean(read_capture(Path(folder) / take), recipe) for take in (TRAIN, TEST))
    began = time.perf_counter()
    methods, ours = make_methods(options.subject, train, recipe)
    print(f"trained on {len(train)} frames in {time.perf_counter() - began:.0f} s, {ours.n_coefficients} coefficients")
    vertices = ours.subject.vertices
    camera = OrbitView.preset(vertices.min(axis=0), vertices.max(axis=0)).camera(SIZE)

    rows = []
    for noise_px in NOISE_PX:
        for count in COUNTS:
            trials = make_trials(ours, test, camera, count, noise_px, options.poses, options.seed)
            rows += [judge(name, method, trials, count, noise_px) for name, method in methods.items()]
    print("points     " + "".join(f"{count:9}" for count in COUNTS))
    for noise_px in NOISE_PX:
        for key, title in (
            ("error_3d_relative", "3D error, neutral face = 1"),
            ("worse_than_neutral", "share of poses worse than the neutral face"),
            ("error_2d_px", "2D error, px"),
            ("ms", "median ms"),
        ):
            print(f"{title}; targets off by {noise_px} px")
            print_table(rows, key, noise_px)

    print("What the subspace cannot make of each shape at full strength, the worst ten:")
    unreached = sorted(ours.unreached().items(), key=lambda item: -item[1])
    for name, share in unreached[:10]:
        print(f"  {name:22}{100 * share:6.1f} %")
    if options.json:
        data = {"subject": options.subject, "train": TRAIN, "test": TEST, "rows": rows, "unreached": dict(unreached)}
        options.json.write_text(json.dumps(data, indent=1) + "\n")


if __name__ == "__main__":
    main()
