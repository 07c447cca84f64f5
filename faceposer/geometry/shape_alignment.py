"""Alignment of shapes with the neutral face by the vertices that keep still, and tests of plausible displacements."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import counted
from faceposer.geometry.alignment import determines_rotation, rigid_alignment
from faceposer.geometry.displacement_fields import Edges, in_random_order

if TYPE_CHECKING:
    # Imported late to shorten the start of the window.
    from scipy.spatial import cKDTree

Array = NDArray[np.float64]

# Lengths below are shares of the size of the neutral face.
_STILL = 1e-3
_MOVED = 0.02
# Share of still vertices from which a shape is known to lie on the neutral face, and least share after alignment.
_LIES = 0.3
_LEAST_STILL = 0.2
_ROUNDS = 40
# Displacements that no expression has: of most vertices, and of any vertex.
_MOST_MEDIAN = 0.1
_MOST = 1.0
# Largest displacement of a typical expression.
_MOST_TYPICAL = 0.12
# Vertices at the place of another one: tolerance, least number of moved vertices, share of them, size of the sample.
_COINCIDENT = 2e-5
_FEW = 10
_REORDERED = 0.5
_SAMPLE = 2000
# Displacements below this are errors of the alignment.
_NOISE = 2e-5
_MOST_NOTES = 4
# Bound on coordinates, which keeps their squares finite.
_LARGEST = 1e100
_MIRROR = np.array([-1.0, 1.0, 1.0])


@dataclass(frozen=True, eq=False)
class Alignment:
    """A shape laid on the neutral face.

    Attributes:
        vertices: Aligned positions, shape (N, 3).
        change: Description of the transform that was undone, such as "scaled by 100"; "" for none.
    """

    vertices: Array
    change: str = ""


def lay_on(vertices: Array, neutral: Array) -> Alignment:
    """Lay a shape on the neutral face by a similarity or a reflection, if it does not lie there already.

    The transform is estimated from the vertices that keep still, by iterated least squares in which the weight of a
    vertex falls with its residual.

    Args:
        vertices: Positions of the shape, shape (N, 3).
        neutral: Positions of the neutral face, in the same order, shape (N, 3).
    """
    size = _size(neutral)
    if not (np.abs(vertices) < _LARGEST).all():
        return Alignment(vertices)
    raw = _distances(vertices, neutral)
    share = float((raw <= _STILL * size).mean())
    if share >= _LIES or not (determines_rotation(vertices) and determines_rotation(neutral)):
        return Alignment(vertices)
    candidates = [(_robust_fit(vertices, neutral, size), False)]
    if float((_distances(candidates[0][0], neutral) <= _STILL * size).mean()) < _LEAST_STILL:
        candidates.append((_robust_fit(vertices * _MIRROR, neutral, size), True))
    best, mirrored = min(candidates, key=lambda found: float(np.median(_distances(found[0], neutral))))
    left = _distances(best, neutral)
    still = float((left <= _STILL * size).mean())
    clearly = still >= max(_LEAST_STILL, 2.0 * share + 0.1)
    # Scans have no still vertices, but those of another place are much farther away.
    nearer = float(np.median(raw)) > _MOVED * size and float(np.median(left)) < 0.25 * float(np.median(raw))
    if not (clearly or nearer):
        return Alignment(vertices)
    best = np.where((left <= _NOISE * size)[:, None], neutral, best)
    return Alignment(best, _description(vertices, best, neutral, mirrored, size))


def implausible(
    vertices: Array,
    neutral: Array,
    tree: "cKDTree | None" = None,
    edges: Edges | None = None,
    sized: bool = True,
) -> str:
    """Return why a shape cannot be an expression of the neutral face, as a clause; "" if it can.

    Args:
        vertices: Positions of the shape, shape (N, 3).
        neutral: Positions of the neutral face, shape (N, 3).
        tree: Search tree of ``neutral``, to save time with many shapes.
        edges: Edges of the mesh, shape (E, 2), to recognise displacements in another vertex order.
        sized: False for displacements in another unit, whose size says nothing.
    """
    size = _size(neutral)
    if not (np.abs(vertices) < _LARGEST).all():
        return "a vertex is too far away"
    distances = _distances(vertices, neutral)
    moved = np.flatnonzero(distances > 10.0 * _COINCIDENT * size)
    sample = moved[:: max(1, len(moved) // _SAMPLE)]
    if len(sample) >= _FEW and size > 0.0:
        nearest, _ = (tree or search_tree(neutral)).query(vertices[sample], distance_upper_bound=_COINCIDENT * size)
        if float(np.isfinite(nearest).mean()) > _REORDERED:
            return "its vertices are in another order"
    if edges is not None and in_random_order(vertices - neutral, edges, size):
        return "neighbouring vertices move in unrelated directions, as with displacements in another vertex order"
    return implausible_size(distances, size) if sized else ""


def in_another_unit(displacements: Sequence[NDArray[np.floating]], neutral: Array) -> bool:
    """Return True if most of the ``displacements``, (N, 3) each, are too large for the neutral face, (N, 3)."""
    size = _size(neutral)
    largest = [most for offsets in displacements if (most := float(np.abs(offsets).max(initial=0.0))) > 0.0]
    return bool(largest) and float(np.median(largest)) > _MOST_TYPICAL * size


def search_tree(neutral: Array) -> "cKDTree":
    """Return the search tree of the neutral face, (N, 3), for ``implausible``."""
    from scipy.spatial import cKDTree

    return cKDTree(neutral)


def implausible_size(distances: Array, size: float) -> str:
    """Return why displacements of a face cannot be an expression, as a clause; "" if they can.

    Args:
        distances: Lengths of the displacements of all vertices, shape (N,).
        size: Size of the neutral face.
    """
    most = float(distances.max(initial=0.0))
    if float(np.median(distances)) > _MOST_MEDIAN * size or most > _MOST * size:
        return f"its vertices move by up to {most / max(size, 1e-300):.2g} times the size of the face"
    if len(distances) >= _FEW and float(np.quantile(distances, _LEAST_STILL)) > _MOVED * size:
        return "no part of it keeps still"
    return ""


def still_share(vertices: Array, neutral: Array) -> float:
    """Return the share of the ``vertices`` of a shape, (N, 3), that keep still."""
    return float((_distances(vertices, neutral) <= _STILL * _size(neutral)).mean())


def _size(neutral: Array) -> float:
    return float(np.ptp(neutral, axis=0).max(initial=0.0)) if len(neutral) else 0.0


def _distances(vertices: Array, neutral: Array) -> Array:
    distances: Array = np.linalg.norm(vertices - neutral, axis=1)
    return distances


def _robust_fit(vertices: Array, neutral: Array, size: float) -> Array:
    """Return ``vertices`` after the similarity that brings most of them onto ``neutral``."""
    weights = np.ones(len(vertices))
    laid, before = vertices, np.inf
    for _ in range(_ROUNDS):
        try:
            laid = rigid_alignment(vertices, neutral, weights, scale=True).apply(vertices)
        except ValueError:  # too few vertices keep their weight
            return laid
        residuals = _distances(laid, neutral)
        spread = max(float(np.median(residuals)), 0.02 * _STILL * size)
        weights = 1.0 / (1.0 + (residuals / spread) ** 2) ** 2
        if abs(before - spread) <= 1e-4 * spread:
            break
        before = spread
    return laid


def _description(vertices: Array, laid: Array, neutral: Array, mirrored: bool, size: float) -> str:
    """Describe the transform from ``laid`` to ``vertices``."""
    source = laid * _MIRROR if mirrored else laid
    found = rigid_alignment(source, vertices, scale=True)
    # The reflection of a face along x leaves it turned about the same axis, which is no turn of its own.
    angle = float(np.degrees(np.arccos(np.clip((np.trace(found.rotation) - 1.0) / 2.0, -1.0, 1.0))))
    words = ["mirrored"] if mirrored else []
    if abs(float(found.scale) - 1.0) > 1e-3:
        words.append(f"scaled by {float(found.scale):.4g}")
    if angle > 0.1 and not mirrored:
        words.append(f"turned by {angle:.3g} degrees")
    if float(np.linalg.norm(vertices.mean(axis=0) / float(found.scale) - laid.mean(axis=0))) > _STILL * size and not (
        mirrored or angle > 0.1
    ):
        words.append("moved")
    return " and ".join(words) or "moved"


class AlignmentReport:
    """Collects how the shapes of a rig were aligned, for notes to the user."""

    def __init__(self) -> None:
        self._shapes: dict[str, list[str]] = {}

    def add(self, name: str, change: str) -> None:
        """Add the ``change`` of a shape, "" for none."""
        if change:
            self._shapes.setdefault(change, []).append(name)

    def notes(self) -> tuple[str, ...]:
        """Return a sentence for each kind of change, the most frequent first."""
        order = sorted(self._shapes.items(), key=lambda item: -len(item[1]))
        notes = []
        for change, names in order[:_MOST_NOTES]:
            plural = len(names) > 1
            notes.append(
                f"{len(names)} shapes were {change} against the neutral face (such as '{names[0][:60]}') and were laid "
                "on it by the vertices that keep still."
                if plural
                else f"The shape '{names[0][:60]}' was {change} against the neutral face and was laid on it by the "
                "vertices that keep still."
            )
        rest = sum(len(names) for _, names in order[_MOST_NOTES:])
        if rest:
            verb = "was" if rest == 1 else "were"
            notes.append(f"{counted(rest, 'further shape')} {verb} laid on the neutral face likewise.")
        return tuple(notes)
