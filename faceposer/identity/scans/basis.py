"""What is fitted to a scan: a linear model of heads with expressions, and how far a scan can be trusted where."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.mesh import VertexNormals
from faceposer.geometry.nearest_surface import NearestSurface
from faceposer.geometry.picking import SurfacePoints
from faceposer.identity.character import character_of
from faceposer.identity.model import IdentityModel
from faceposer.identity.scans.visibility import visible_shares
from faceposer.identity.template import head_template
from faceposer.landmarks.reference import reference
from faceposer.model.character import Character
from faceposer.model.character_file import load_character

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Shapes that may be in a scan, with the prior's mean of their weights. Smiles, open mouths and raised brows are small;
#: lids are often closed.
EXPRESSIONS = {
    **dict.fromkeys(("eyeBlinkLeft", "eyeBlinkRight"), 0.5),
    **dict.fromkeys(("mouthSmileLeft", "mouthSmileRight"), 0.25),
    "jawOpen": 0.15,
    **dict.fromkeys(("browInnerUpLeft", "browInnerUpRight", "browOuterUpLeft", "browOuterUpRight"), 0.06),
    **dict.fromkeys(("browDownLeft", "browDownRight", "mouthFrownLeft", "mouthFrownRight"), 0.05),
    **dict.fromkeys(("eyeWideLeft", "eyeWideRight", "eyeSquintLeft", "eyeSquintRight"), 0.05),
    **dict.fromkeys(("mouthLowerDownLeft", "mouthLowerDownRight", "noseSneerLeft", "noseSneerRight"), 0.04),
    **dict.fromkeys(("mouthUpperUpLeft", "mouthUpperUpRight", "mouthStretchLeft", "mouthStretchRight"), 0.05),
    **dict.fromkeys(("mouthPucker", "mouthFunnel", "cheekPuffLeft", "cheekPuffRight"), 0.03),
    **dict.fromkeys(("mouthLeft", "mouthRight", "jawForward", "jawLeft", "jawRight"), 0.03),
}
# Trust in a scan's surface by region of the head: hair covers the scalp, clothes the neck, lids move.
_TRUST = {
    "scalp": 0.1,
    "neck": 0.03,
    **dict.fromkeys(("ear_left", "ear_right"), 0.4),
    **dict.fromkeys(("lids_left", "lids_right"), 0.3),
    **dict.fromkeys(("lip_upper", "lip_lower"), 0.5),
}
# Heights over the neck's end, in centimetres, between which the trust rises: where it ends differs from scan to scan.
_NECK = (5.0, 7.5)
# Share of the directions that see a vertex, below which a scan is not trusted, and from which it fully is.
_HIDDEN, _OPEN = 0.35, 0.75
# Farthest that a point of the man's face may lie from his skin, in centimetres.
_ON_SKIN = 0.3


@dataclass(frozen=True, eq=False)
class HeadBasis:
    """A linear model of the skin of heads: mean + Σ_k b_k modes_k + Σ_e w_e expressions_e, in centimetres.

    Attributes:
        mean: Mean head, shape (N, 3).
        modes: Offsets per standard deviation, shape (K, N, 3).
        segments: Weights of the segments, which sum to one at each vertex, shape (S, N).
        expressions: Offsets at full strength, shape (E, N, 3).
        expression_names: Their names.
        expression_means: Means of the prior of their weights, shape (E,).
        triangles: Vertex ids, shape (T, 3).
        n_control: Number of vertices of the control mesh, which come first and are dense enough for modes.
        trust: How far a scan's surface is trusted at each vertex, 0 to 1, shape (N,).
        landmarks: The 468 landmarks on the surface; those off the skin have no say.
        on_skin: Mask of the landmarks that lie on the skin, shape (468,).
        feature_points: Vertex of each MPEG-4 feature point on the skin.
    """

    mean: Array
    modes: Array
    segments: Array
    expressions: Array
    expression_names: tuple[str, ...]
    expression_means: Array
    triangles: NDArray[np.int32]
    n_control: int
    trust: Array
    landmarks: SurfacePoints
    on_skin: Mask
    feature_points: dict[str, int]

    @cached_property
    def normals(self) -> VertexNormals:
        """Normals of heads of this topology."""
        return VertexNormals(self.triangles, len(self.mean))

    def head(self, shape: Array, local: Array | None = None) -> Array:
        """Return the vertices, (N, 3), of the head with the coefficients ``shape``, (K,).

        Args:
            shape: Coefficients in standard deviations, (K,).
            local: Deviations from them in each segment, shape (S, K).
        """
        head: Array = self.mean + np.tensordot(shape, self.modes, 1)
        if local is not None:
            for weights, deviation in zip(self.segments, local, strict=True):
                head += weights[:, None] * np.tensordot(deviation, self.modes, 1)
        return head

    def offsets(self, weights: Array) -> Array:
        """Return the offsets, (N, 3), of expressions with ``weights``, (E,)."""
        result: Array = np.tensordot(weights, self.expressions, 1)
        return result


def basis_of(model: IdentityModel) -> HeadBasis:
    """Return the basis of ``model``, whose topology is that of the built-in man.

    Raises:
        FacePoserError: If his file is missing or damaged.
    """
    template = model.template or head_template()
    mean = template.skin(model.mean_vertices)
    man, average = load_character("man"), character_of(mean, name="average", title="Average")
    names = tuple(name for name in EXPRESSIONS if name in average.shape_names)
    rows = [average.shape_names.index(name) for name in names]
    points, apart = NearestSurface(template.rest, template.triangles, np.arange(len(template.triangles))).points(
        reference().places
    )
    n = template.n_skin
    segments = np.ones((1, n)) if model.segments is None else template.skin(model.segments.weights.T).T
    return HeadBasis(
        mean=mean,
        modes=model.skin_basis,
        segments=np.clip(segments, 0.0, None) / np.clip(segments, 0.0, None).sum(axis=0),
        expressions=average.shapes[rows, :n].astype(np.float64),
        expression_names=names,
        expression_means=np.array([EXPRESSIONS[name] for name in names]),
        triangles=template.triangles,
        n_control=template.n_control,
        trust=_trust(man, n),
        landmarks=points,
        on_skin=apart < _ON_SKIN,
        feature_points={name: vertex for name, vertex in man.feature_points.items() if vertex < n},
    )


def region_mask(character: Character, names: Sequence[str], n: int) -> Mask:
    """Return the mask, (n,), of the vertices in any of the regions ``names``."""
    mask = np.zeros(n, dtype=bool)
    for name in names:
        ids = character.regions.get(name, np.zeros(0, dtype=np.int32))
        mask[ids[ids < n]] = True
    return mask


def _trust(character: Character, n: int) -> Array:
    trust = np.ones(n)
    for name, value in _TRUST.items():
        trust[region_mask(character, [name], n)] = value
    height = character.vertices[:n, 1] - character.vertices[:n, 1].min()
    trust *= np.clip((height - _NECK[0]) / (_NECK[1] - _NECK[0]), 0.0, 1.0)
    solid = character.triangles[character.solid_triangles]
    shares = visible_shares(character.vertices.astype(np.float64), solid, n)
    return trust * np.clip((shares - _HIDDEN) / (_OPEN - _HIDDEN), 0.0, 1.0)
