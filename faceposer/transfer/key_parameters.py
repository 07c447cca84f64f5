"""Parameters of a face: the displacements of its feature points, reduced to their principal components.

Pyun et al. 2003, section 3.
"""

from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.character import Character
from faceposer.model.face_model import FaceModel

Array = NDArray[np.float64]

#: Parts of the face whose expressions are cloned separately: the whole face, its upper and lower half, or both brows,
#: both eyes and the lower face.
Regions = Literal["whole", "halves", "parts"]
REGIONS: tuple[Regions, ...] = get_args(Regions)

#: Eigenvalues of the covariance below this share of the largest are dropped by the paper, whose threshold has the same
#: value in the square of a unit that it does not state.
PAPER_THRESHOLD = 1e-5
#: Those below this share are rounding errors.
ROUNDING = 1e-12

#: The feature points of the paper's figure 7, as nearly as the names of MPEG-4 allow: 20 points of mouth, eyes, brows,
#: chin and cheeks.
PAPER_POINTS: tuple[str, ...] = (
    *("4.1", "4.2", "4.3", "4.4", "4.5", "4.6", "3.1", "3.2", "3.3", "3.4", "5.1", "5.2", "9.1", "9.2"),
    *("8.1", "8.2", "8.3", "8.4", "2.1", "9.12"),
)
# Points of ears, hairline and skull, which expressions move on few characters: by more than this share of the height.
_OFTEN_STILL, _MOVED = ("10.", "11."), 0.01
#: Least number of feature points from which expressions are known.
FEWEST_POINTS = 3
# Groups of points of the upper face: eyes and brows, ears and hairline; those on the left, as MPEG-4 numbers them.
_UPPER = ("3", "4", "10", "11")
_LEFT = frozenset(
    {"3.1", "3.3", "3.5", "3.7", "3.9", "3.11", "3.13", "4.1", "4.3", "4.5", "10.1", "10.3", "10.5", "11.3"}
)


def parameter_points(character: Character, names: Sequence[str] | None = None) -> tuple[str, ...]:
    """Return the feature points of ``character`` that describe its expressions, or those of ``names`` that it has.

    Raises:
        FacePoserError: If there are fewer than three.
    """
    known = character.feature_points
    if names is None:
        least = _MOVED * character.height
        chosen = tuple(name for name in known if not name.startswith(_OFTEN_STILL) or _motion(character, name) > least)
    else:
        chosen = tuple(name for name in names if name in known)
    if len(chosen) < FEWEST_POINTS:
        raise FacePoserError(
            f"The character {character.label} has {len(chosen)} of the feature points that cloning by examples needs, "
            "fewer than three; transfer by weights, or train it again with ARKit's shape names or from its examples."
        )
    return chosen


def _motion(character: Character, name: str) -> float:
    """Return the largest displacement of a feature point in any shape."""
    moved = character.shapes[:, character.feature_points[name]]
    return float(np.linalg.norm(moved, axis=1).max(initial=0.0))


def point_rows(model: FaceModel, names: Sequence[str]) -> Array:
    """Return the displacements of the feature points ``names`` per coefficient, shape (3 n, r)."""
    ids = np.array([model.character.feature_points[name] for name in names], dtype=np.intp)
    rows, _ = model.rows_of(SurfacePoints.at_vertices(ids))
    return rows.reshape(-1, model.n_coefficients)


def grouped(names: Sequence[str], regions: Regions) -> dict[str, tuple[str, ...]]:
    """Return the feature points ``names`` by the name of their region, without empty regions."""
    groups: dict[str, list[str]] = {}
    for name in names:
        group = name.split(".")[0]
        if regions == "whole":
            region = "face"
        elif group not in _UPPER:
            region = "lower face"
        elif regions == "halves":
            region = "upper face"
        else:
            region = f"{'left' if name in _LEFT else 'right'} {'eye' if group == '3' else 'brow'}"
        groups.setdefault(region, []).append(name)
    return {region: tuple(points) for region, points in groups.items()}


def feature_matrix(displacements: Array, threshold: float = PAPER_THRESHOLD) -> Array:
    """Return the principal components F of ``displacements``, (M, 3 n), of shape (n', 3 n) (eq. (2)).

    Args:
        displacements: Displacements of the feature points of each key, the base included.
        threshold: Share of the largest eigenvalue of their covariance below which components are dropped.
    """
    centred = displacements - displacements.mean(axis=0)
    _, sizes, axes = np.linalg.svd(centred, full_matrices=False)
    # The eigenvalues of the covariance are the squares of the singular values.
    kept = sizes**2 > threshold * sizes[0] ** 2
    components: Array = axes[kept]
    return components
