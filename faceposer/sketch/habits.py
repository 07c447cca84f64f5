"""Habits of people who draw: which of the lines that lie close together a stroke near them is.

The density of poses hardly tells the line of a smile from a lower lip that is drawn up, or a raised lower lid from a
lowered upper one, since a drawing exaggerates what the shapes of a character can do. People move the ends of a line
far, but draw its middle about where they see the line. The place of a stroke's middle among the present lips or lids
thus decides between them.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.sketch.curve_density import FACE_SIZE, FeatureRows
from faceposer.sketch.openness import OPEN, resting_gap
from faceposer.sketch.outlines import is_closed

Array = NDArray[np.float64]

#: Lines that are easily taken for each other, and the closed lines that consist of some of them.
FAMILIES = (
    ("mouth line", "outer lower lip", "outer upper lip", "inner lower lip", "inner upper lip", "mouth outline"),
    *((f"{side} upper lid", f"{side} lower lid", f"{side} eye outline", f"{side} brow") for side in ("left", "right")),
)
_LOWER_LIPS = ("outer lower lip", "inner lower lip")
# Log odds of the line of a closed mouth against lower lips where the middle of a stroke lies on it, before and after
# other lines of the mouth are drawn.
_LINE, _LINE_AFTER_LIPS = 2.5, 1.5
# Log prior of the outline of a mouth or an eye for a closed stroke around its middle; greatest distance of the ends of
# such a stroke as a share of its length; its widths, as shares of that of the mouth or the eye.
_LOOP, _CLOSED, _LOOP_SPANS = 80.0, 0.12, (0.6, 1.35)
# Log prior of the lower lid where the middle of a stroke lies on it; share of the way down to it from which this holds
# if the upper lid has not been drawn.
_LOWER_LID, _NEAR_LOWER = 0.9, 0.76
# Share of the way from the line of the mouth to the lower and to the upper edge of the lips up to which a stroke is on
# the line, and from which it is not; least height of a lip, in units of the hand.
_LOWER, _UPPER, _LEAST_LIP = (0.45, 0.65), (0.25, 0.5), 14.0
# Middle of a line along its chord; extents of a stroke from corner to corner, as shares of the mouth's width.
_MIDDLE, _SPANS = (0.3, 0.7), (0.75, 1.6)


def family_of(feature: str) -> tuple[str, ...]:
    """Return the features that a stroke along ``feature`` may also be, itself among them."""
    return next((family for family in FAMILIES if feature in family), (feature,))


@dataclass(frozen=True)
class Habits:
    """What the place of a stroke on the present face tells.

    Attributes:
        log_priors: Log prior of features, 0 for those not named.
        on_line: 1 if the stroke lies on the line of the closed mouth, 0 if not, and between.
    """

    log_priors: Mapping[str, float]
    on_line: float


def as_drawn(names: Sequence[str], log_evidence: Array, habits: Habits) -> Array:
    """Return the log evidence of features, shape (n,), as people draw them.

    A stroke on the line of the closed mouth may turn up or down as far as it likes: its evidence for this line is at
    least that for a lower lip, in proportion to ``on_line``.

    Args:
        names: The features.
        log_evidence: Log evidence of each by the density of poses, shape (n,).
        habits: What the place of the stroke tells.
    """
    if "mouth line" not in names:
        return log_evidence
    raised, at = log_evidence.copy(), names.index("mouth line")
    lower = max((float(log_evidence[names.index(lip)]) for lip in _LOWER_LIPS if lip in names), default=-np.inf)
    raised[at] += habits.on_line * max(lower - float(raised[at]), 0.0)
    return raised


def habits_of(
    rows: FeatureRows, pose: Array, camera: Camera, unit: float, samples: Array, drawn: Collection[str]
) -> Habits:
    """Return what the place of a stroke on the present face tells.

    Args:
        rows: The lines of the character.
        pose: Present pose, shape (r,).
        camera: Camera of the stroke.
        unit: The unit of the hand in its pixels.
        samples: Even samples of the stroke in units of the hand about the principal point, shape (n, 2).
        drawn: Features that have been drawn before.
    """
    found: dict[str, float] = {}
    on_line = 0.0

    def line(name: str) -> Array:
        run = rows.tracks[name].rows
        places = rows.neutral[run] + rows.jacobian[run] @ pose
        return (camera.project(places) - camera.principal_point) / unit

    mouth = ("mouth line", "outer lower lip", "outer upper lip")
    first = not {"mouth line", "inner upper lip", "inner lower lip"} & set(drawn)
    if first and all(name in rows.tracks for name in mouth) and _gap(rows, pose, "mouth") < OPEN:
        on_line = _on_line(samples, *(line(name) for name in mouth))
        found["mouth line"] = on_line * (_LINE_AFTER_LIPS if set(FAMILIES[0]) & set(drawn) else _LINE)
    if is_closed(samples, _CLOSED):
        for name in ("mouth outline", "left eye outline", "right eye outline"):
            if name in rows.tracks and _surrounds(samples, line(name)):
                found[name] = _LOOP
    for side in ("left", "right"):
        lids = f"{side} upper lid", f"{side} lower lid"
        if all(name in rows.tracks for name in lids):
            upper, lower = (_across(samples, line(name), line(lids[1])) for name in lids)
            if not len(upper):
                continue
            gaps = float(np.abs(upper).mean()), float(np.abs(lower).mean())
            # Between the lids, the first stroke closes the eye; the next one raises the lower lid.
            near = _NEAR_LOWER if lids[0] not in drawn else 0.5
            if gaps[0] > near * (gaps[0] + gaps[1]):
                found[lids[1]] = _LOWER_LID
    return Habits(found, on_line)


def _gap(rows: FeatureRows, pose: Array, name: str) -> float:
    """Return the distance of lips or lids in ``pose``, in units of the hand."""
    run = rows.gap_slices.get(name)
    if run is None:
        return 0.0
    moved = float(rows.gaps[0][run].mean(axis=0)[1] @ pose) * FACE_SIZE / max(rows.size, 1e-12)
    return resting_gap(rows, name) + moved


def _on_line(samples: Array, middle: Array, lower: Array, upper: Array) -> float:
    """Return 1 if ``samples`` span the mouth with their middle on the line ``middle``, 0 if not, and between."""
    along, _ = _in_chord(samples, middle)
    if not _SPANS[0] < float(np.ptp(along)) < _SPANS[1]:
        return 0.0
    offsets = _across(samples, middle, middle)
    if not len(offsets):
        return 0.0
    offset = float(offsets.mean())
    # Offsets of the edge of the lip on that side.
    edge = -float(_across(middle, lower if offset > 0.0 else upper, middle).mean())
    share = abs(offset) / max(abs(edge), _LEAST_LIP)
    on, off = _LOWER if offset > 0.0 else _UPPER
    return float(np.clip((off - share) / (off - on), 0.0, 1.0))


def _surrounds(samples: Array, outline: Array) -> bool:
    """Return True if closed ``samples`` go once around the middle of ``outline``, about as wide as it."""
    extents = float(np.ptp(samples[:, 0])) / max(float(np.ptp(outline[:, 0])), 1e-9)
    offsets = samples - 0.5 * (outline.min(axis=0) + outline.max(axis=0))
    angles = np.unwrap(np.arctan2(offsets[:, 1], offsets[:, 0]))
    return _LOOP_SPANS[0] < extents < _LOOP_SPANS[1] and 1.6 * np.pi < abs(angles[-1] - angles[0]) < 2.4 * np.pi


def _in_chord(points: Array, line: Array) -> tuple[Array, Array]:
    """Return the places of ``points`` along the chord of ``line``, 0 and 1 at its ends, and their offsets across."""
    chord = line[-1] - line[0]
    length = max(float(np.hypot(*chord)), 1e-9)
    x, y = (points - line[0]) @ chord / length**2, (points - line[0]) @ np.array([-chord[1], chord[0]]) / length
    return x, y


def _across(points: Array, line: Array, chord: Array) -> Array:
    """Return the offsets of ``points`` from ``line`` across the ``chord`` of another, where they are in its middle."""
    along, offsets = _in_chord(points, chord)
    at, height = _in_chord(line, chord)
    order = np.argsort(at, kind="stable")
    inside = (along > _MIDDLE[0]) & (along < _MIDDLE[1])
    return np.asarray(offsets[inside] - np.interp(along[inside], at[order], height[order]))
