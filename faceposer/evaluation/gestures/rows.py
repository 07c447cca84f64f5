"""Rows of the study: one gesture on one character, with measures and limits."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from faceposer.evaluation.gestures.gesture import Gesture
from faceposer.evaluation.gestures.hand import Hand, Performed, PriorSettings, has_places
from faceposer.evaluation.gestures.measures import FaceChange
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.contact.measure import penetration_mm
from faceposer.model.face_model import FaceModel
from faceposer.solve.priors import PRIORS

Row = dict[str, Any]
#: Largest angle between the two eyes for every gesture and prior, in degrees.
GAZE_DEG = 1.0
#: Largest penetration of surfaces, in millimetres.
PENETRATION_MM = 0.1


def perform(model: FaceModel, gesture: Gesture, settings: PriorSettings | None = None) -> Performed:
    """Perform ``gesture`` on the neutral face of ``model``."""
    return Hand(model, settings).perform(gesture)


def row_of(performed: Performed, character: str, gaze: dict[str, float | None] | None = None) -> Row:
    """Return the row of a gesture.

    Args:
        performed: Result of the gesture.
        character: Name of the character in the row.
        gaze: Angle between the eyes for each prior, in degrees; None for the prior of ``performed`` only.
    """
    gesture, change = performed.gesture, FaceChange(performed)
    pulled = np.array([drawn.pulled_px for drawn in performed.drawn])
    shares = np.divide(performed.residuals_px, np.maximum(pulled, 1e-6))
    # Pins without a displacement have no relative residual.
    worst = int(np.argmax(np.where(pulled > 1.0, shares, -1.0)))
    must: dict[str, Row] = {}
    must_not: dict[str, Row] = {}
    for limit in gesture.limits:
        for name, value in change.values(limit.unit).items():
            bound = "at_least" if limit.at_least is not None else "at_most"
            (must if bound == "at_least" else must_not)[name] = {
                _kind(name): _rounded(value),
                bound: getattr(limit, bound),
                "missed_by": _rounded(limit.missed_by(value)),
                "holds": limit.holds(value),
            }
    other = change.other_side() if gesture.other_side is not None else None
    spill = change.spill_mm(gesture.concerned)
    degrees = gaze if gaze is not None else {performed.prior: change.gaze_deg()}
    # Characters without eyes and teeth have nothing to measure.
    penetration = max(penetration_mm(performed.model, performed.vertices).values(), default=None)
    bounds = {
        "residual": _bound(float(shares[worst]), gesture.residual),
        "other_side": _bound(other, gesture.other_side),
        "spill": _bound(spill, gesture.spill_mm),
        "gaze": None,
        "penetration": _bound(penetration, PENETRATION_MM),
    }
    angles = {prior: angle for prior, angle in degrees.items() if angle is not None}
    if angles:
        widest = max(angles, key=lambda prior: angles[prior])
        bounds["gaze"] = (_bound(angles[widest], GAZE_DEG) or {}) | {"prior": widest}
    entries = [*must.values(), *must_not.values(), *(b for b in bounds.values() if b is not None)]
    return {
        "character": character,
        "gesture": gesture.name,
        "actions": len(gesture.actions),
        "pulled_px": _rounded(float(pulled[worst])),
        "residual_px": _rounded(performed.residuals_px[worst]),
        "must_move": must,
        "must_not_move": must_not,
        "other_side": _rounded(other),
        "spill_mm": _rounded(spill),
        "penetration_mm": _rounded(penetration),
        "gaze_deg": {prior: _rounded(value) for prior, value in degrees.items()},
        "limits": {name: bound for name, bound in bounds.items() if bound is not None},
        "solve_ms": _rounded(float(np.median(performed.solve_ms)) if performed.solve_ms else None),
        "solves_ms": _rounded(sum(performed.solve_ms)),
        "weights": {n: _rounded(w) for n, w in sorted(change.weights.items(), key=lambda x: -abs(x[1])) if w >= 0.02},
        "holds": all(entry["holds"] for entry in entries),
    }


def study(
    character: str, model: FaceModel, gestures: Sequence[Gesture], settings: PriorSettings
) -> Iterator[tuple[Performed, Row]]:
    """Perform each of the ``gestures`` for which the face has the places, and yield the result with its row.

    Each is performed with the other priors as well, to measure the gaze.
    """
    for gesture in gestures:
        if not has_places(model.character, gesture):
            continue
        performed = perform(model, gesture, settings)
        gaze: dict[str, float | None] = {}
        for prior in PRIORS:
            other = settings.under(prior)
            result = performed if other == settings else perform(model, gesture, other)
            gaze[prior] = FaceChange(result).gaze_deg()
        yield performed, row_of(performed, character, gaze)


def missed(row: Row) -> list[str]:
    """Return the missed limits of ``row``, each as name, value and limit, the farthest first.

    If both sides are limited, the worse represents both.
    """
    worst: dict[str, tuple[float, str]] = {}
    for entries in (row["must_move"], row["must_not_move"], row["limits"]):
        for name, entry in entries.items():
            if entry["holds"]:
                continue
            value = next(entry[key] for key in ("weight", "mm", "share", "value") if key in entry)
            sign, limit = ("≥", entry["at_least"]) if "at_least" in entry else ("≤", entry["at_most"])
            label = f"{name} ({entry['prior']} prior)" if "prior" in entry else _without_side(name, entries)
            excess = entry["missed_by"] / max(abs(limit), 0.05)
            worst[label] = max(worst.get(label, (0.0, "")), (excess, f"{label} {value:.2g} ({sign} {limit:g})"))
    return [text for _, text in sorted(worst.values(), reverse=True)]


def _without_side(name: str, entries: Row) -> str:
    """Return ``name`` without its side if ``entries`` has the other side as well."""
    for own, other, none in (
        ("Left", "Right", ""),
        ("Right", "Left", ""),
        ("_left_", "_right_", "_"),
        ("_right_", "_left_", "_"),
    ):
        if own in name and name.replace(own, other) in entries:
            return name.replace(own, none)
    return name


def _kind(name: str) -> str:
    if name in ARKIT_SHAPES:
        return "weight"
    return "share" if name.startswith("lids_") and name.endswith(("_close", "_open")) else "mm"


def _bound(value: float | None, limit: float | None) -> Row | None:
    """Return the entry of ``value`` with the upper ``limit``, or None without a value or a limit."""
    if value is None or limit is None:
        return None
    excess = max(value - limit, 0.0)
    return {"value": _rounded(value), "at_most": limit, "missed_by": _rounded(excess), "holds": value <= limit}


def _rounded(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.4g}")
