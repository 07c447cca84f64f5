"""Numbers of one method over a set of trials."""

import time
from collections.abc import Callable, Mapping

import numpy as np

from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.map_solver import Solution
from scripts.evaluation.trials import Trial

Method = Callable[[list[PointConstraint]], tuple[FaceModel, Solution]]
Row = dict[str, object]


def judge(name: str, method: Method, trials: list[Trial], count: int, noise_px: float) -> Row:
    """Return the errors of the whole face, and the time of a cold solve."""
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


def judge_region(
    name: str,
    method: Method,
    trials: list[Trial],
    vertices: Mapping[str, np.ndarray],
    region: str,
    count: int,
    noise_px: float,
) -> Row:
    """Return the errors where all points lie in ``region``, and what the method does to the regions without any.

    Lengths are in millimetres for a subject in centimetres. Of the regions without constraints, ``moved_mm`` is how far
    their vertices move, ``truth_moved_mm`` how far they did in the frames, and ``elsewhere_relative`` the error there
    relative to leaving them neutral: above 1 it would be better not to touch them. Every mean is one over vertices and
    trials together.

    Args:
        name: Of the method.
        method: Solves.
        trials: All of the same ``region``, ``count`` and ``noise_px``.
        vertices: Vertex ids of each region; all other vertices are left out, except for ``error_3d_relative``.
        region: Where the constraints lie.
        count: Points of each trial.
        noise_px: Standard deviation of the targets.
    """
    others = {other: ids for other, ids in vertices.items() if other != region}
    elsewhere = np.concatenate(list(others.values()))
    own = vertices[region]
    keys = ("whole", "whole_neutral", "own", "own_neutral", "else", "else_neutral", "else_moved")
    sums, worse, worse_else = dict.fromkeys(keys, 0.0), 0, 0
    moved = dict.fromkeys(others, 0.0)
    for trial in trials:
        model, solution = method(trial.constraints)
        pose, neutral = model.instance(solution.coefficients), model.subject.vertices
        error = np.linalg.norm(pose - trial.truth, axis=1)
        neutral_error = np.linalg.norm(trial.truth - neutral, axis=1)
        motion = np.linalg.norm(pose - neutral, axis=1)
        found = {
            "whole": error.mean(),
            "whole_neutral": neutral_error.mean(),
            "own": error[own].mean(),
            "own_neutral": neutral_error[own].mean(),
            "else": error[elsewhere].mean(),
            "else_neutral": neutral_error[elsewhere].mean(),
            "else_moved": motion[elsewhere].mean(),
        }
        for key, value in found.items():
            sums[key] += float(value)
        worse += bool(found["whole"] > found["whole_neutral"])
        worse_else += bool(found["else"] > found["else_neutral"])
        for other, ids in others.items():
            moved[other] += float(motion[ids].mean())
    n = len(trials)
    return {
        "method": name,
        "constraint": "point",
        "region": region,
        "count": count,
        "noise_px": noise_px,
        "poses": n,
        "error_3d_relative": round(sums["whole"] / sums["whole_neutral"], 4),
        "own_relative": round(sums["own"] / sums["own_neutral"], 4),
        "worse_than_neutral": round(worse / n, 4),
        "moved_mm": round(10.0 * sums["else_moved"] / n, 4),
        "truth_moved_mm": round(10.0 * sums["else_neutral"] / n, 4),
        "elsewhere_relative": round(sums["else"] / sums["else_neutral"], 4),
        "elsewhere_worse": round(worse_else / n, 4),
        "moved_by_region_mm": {other: round(10.0 * value / n, 4) for other, value in moved.items()},
    }
