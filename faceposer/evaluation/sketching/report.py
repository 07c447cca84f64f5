"""Rows and tables of the study of sketching."""

from collections import Counter
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.evaluation.setting import StudyContext
from faceposer.evaluation.sketching.hand_errors import HandErrors
from faceposer.evaluation.sketching.study import (
    COUNTS,
    VIEWS,
    SketchingStudy,
    Tally,
    expressions,
    row_of,
    trials_of,
    view_camera,
)
from faceposer.model.feature_curves import FEATURES

Array = NDArray[np.float64]
Document = dict[str, Any]

#: Methods by which faces follow from strokes, in the order of tables.
METHODS = ("paper", "map", "map-corrected", "map-local", "true-points", "stroke-tool")
# Ends of the ranges of probability of the table of reliability.
_BINS = (0.0, 0.5, 0.8, 0.9, 0.97, 0.99, 1.0)
# Scribbles of each kind per pose.
_SCRIBBLES = 2


def study_rows(
    setting: StudyContext,
    frames: Array,
    poses: int,
    trainings: Sequence[int],
    recognitions: Sequence[str],
    errors: HandErrors,
    seed: int,
    progress: Callable[[str], None],
    any_order: bool = False,
) -> list[Document]:
    """Run all conditions on one character.

    Args:
        setting: The face, and the performances to learn from.
        frames: Frames of the unseen take, rig weights of shape (F, S).
        poses: Number of poses.
        trainings: Numbers of training poses.
        recognitions: Methods of recognition.
        errors: Errors of the hand.
        seed: Seed of poses and strokes.
        progress: Called with a line at a time.
        any_order: True if strokes are drawn in random order, not from above to below.

    Returns:
        A document for each number of training poses and method of recognition: its rows, the list of recognised
        strokes, and the share of accepted scribbles.
    """
    trials = trials_of(setting, expressions(setting, frames, poses, seed), errors, seed, any_order=any_order)
    progress(f"{len(trials)} trials on {setting.character.name}")
    given = {(view, count): Tally() for view in VIEWS for count in COUNTS}
    documents = []
    for training in trainings:
        study = SketchingStudy(setting, training)
        if training == trainings[0]:
            for trial in trials:
                study.run_given(trial, given[trial.view, trial.count])
        for recognition in recognitions:
            tallies = {key: Tally() for key in given}
            for trial in trials:
                study.run(trial, recognition, tallies[trial.view, trial.count])
            rows = []
            for (view, count), tally in tallies.items():
                key = {
                    "character": setting.character.name,
                    "view": view,
                    "strokes": count,
                    "recognition": recognition,
                    "training": training,
                }
                rows += [row_of(tally, method, key, given[view, count], progress) for method in METHODS]
            rng = np.random.default_rng(seed + 1)
            shares = [
                study.accepted(view_camera(setting, view), _SCRIBBLES * poses, rng, recognition) for view in VIEWS
            ]
            kinds = {kind: round(float(np.mean([share[kind] for share in shares])), 4) for kind in shares[0]}
            documents.append(
                {
                    "training": training,
                    "recognition": recognition,
                    "rows": rows,
                    "strokes": [stroke for tally in tallies.values() for stroke in tally.features],
                    "points": [error for tally in tallies.values() for error in tally.points],
                    "scribbles": {
                        "training": training,
                        "recognition": recognition,
                        "accepted": round(float(np.mean(list(kinds.values()))), 4),
                        "kinds": kinds,
                    },
                }
            )
    return documents


def confusion_of(results: Sequence[Document]) -> list[Document]:
    """Return the confusion table of each condition: counts of true and recognised features."""
    tables = []
    for training, recognition, strokes in _pooled(results):
        counts = Counter((true, found or "none") for true, found, _, _ in strokes)
        names = [*FEATURES, "none"]
        first = [true == found for true, found, _, number in strokes if number == 0]
        tables.append(
            {
                "training": training,
                "recognition": recognition,
                "strokes": len(strokes),
                "feature_accuracy": round(float(np.mean([true == found for true, found, _, _ in strokes])), 4),
                "feature_accuracy_first_stroke": round(float(np.mean(first)), 4),
                "point_accuracy": round(
                    float(np.mean([e <= 1.0 for r in _of(results, training, recognition) for e in r["points"]])), 4
                ),
                "counts": {
                    true: {found: counts[true, found] for found in names if counts[true, found]} for true in FEATURES
                },
            }
        )
    return tables


def reliability_of(results: Sequence[Document]) -> list[Document]:
    """Return the table of reliability of each condition: how often candidates of a probability are right."""
    tables = []
    for training, recognition, strokes in _pooled(results):
        probabilities = np.array([probability for _, _, probability, _ in strokes])
        right = np.array([true == found for true, found, _, _ in strokes])
        bins = []
        for low, high in pairwise(_BINS):
            inside = (probabilities >= low) & (probabilities < (high if high < 1.0 else 2.0))
            if inside.any():
                bins.append(
                    {
                        "from": low,
                        "to": high,
                        "strokes": int(inside.sum()),
                        "mean_probability": round(float(probabilities[inside].mean()), 4),
                        "right": round(float(right[inside].mean()), 4),
                    }
                )
        tables.append({"training": training, "recognition": recognition, "bins": bins})
    return tables


def _of(results: Sequence[Document], training: int, recognition: str) -> list[Document]:
    return [r for r in results if (r["training"], r["recognition"]) == (training, recognition)]


def _pooled(results: Sequence[Document]) -> list[tuple[int, str, list[tuple[str, str | None, float, int]]]]:
    keys = dict.fromkeys((result["training"], result["recognition"]) for result in results)
    return [
        (training, recognition, [stroke for r in _of(results, training, recognition) for stroke in r["strokes"]])
        for training, recognition in keys
    ]


def summary(document: Document) -> str:
    """Return the main results of a study as text."""
    lines = ["training recognition strokes  method         view           feature  point  error  ci95            ms"]
    for row in document["rows"]:
        low, high = row["ci95"]
        shares = "  ".join(f"{row[key]:5.3f}" for key in ("feature_accuracy", "point_accuracy", "error_3d_relative"))
        lines.append(
            f"{row['training']:8d} {row['recognition']:11s} {row['strokes']:7d}  {row['method']:13s}  "
            f"{row['view']:13s}  {shares}  {low:.3f} to {high:.3f}  {row['ms']:5.1f}"
        )
    for table in document["confusion"]:
        lines.append(
            f"{table['recognition']} with {table['training']} poses: {table['feature_accuracy']:.1%} of "
            f"{table['strokes']} features right ({table['feature_accuracy_first_stroke']:.1%} of first strokes), "
            f"{table['point_accuracy']:.1%} of points within one neighbour"
        )
        for true, counts in table["counts"].items():
            wrong = {found: count for found, count in counts.items() if found != true}
            if wrong:
                lines.append(f"  {true}: {sum(counts.values())} drawn, {wrong}")
    for shares in document["scribbles_accepted"]:
        lines.append(
            f"{shares['recognition']} with {shares['training']} poses accepts {shares['accepted']:.1%} of scribbles: "
            f"{shares['kinds']}"
        )
    for table in document["reliability"]:
        lines.append(f"{table['recognition']} with {table['training']} poses:")
        lines += [
            f"  probability {b['mean_probability']:.3f}: {b['right']:.3f} right of {b['strokes']}"
            for b in table["bins"]
        ]
    return "\n".join(lines)
