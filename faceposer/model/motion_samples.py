"""Places spread evenly over a face's skin: how much of the face a pose moves, at the cost of a few of its vertices."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.mesh import vertex_areas
from faceposer.model.character import Character
from faceposer.model.local_moments import RigDensity

Array = NDArray[np.float64]

_SAMPLES = 150
# Skin that no shape moves by more than this share of what moves most counts as bone.
_STILL = 1e-3
#: Centimetres of motion are meant for a head of this height from chin to crown.
HEAD_CM = 22.0


@dataclass(frozen=True, eq=False)
class MotionSamples:
    """How n places of the skin move with the coefficients of a face, in centimetres on a head of ``HEAD_CM``.

    Attributes:
        vertices: Shape (n,).
        areas: Share of the moving skin that each stands for, shape (n,), summing to 1.
        rows: Displacements by the coefficients, coordinates stacked, shape (3 n, r).
        single: The same, but of the muscles behind a pose alone: what others contract along with them is not counted
            (X = S L^-1 D with the shapes' displacements S, L of ``RigDensity.along`` and the weights' directions D).
        scale: Centimetres on such a head for each unit of the face.
    """

    vertices: NDArray[np.intp]
    areas: Array
    rows: Array
    single: Array
    scale: float

    @cached_property
    def single_by_place(self) -> NDArray[np.float32]:
        """``single`` by places, shape (n, 3, r), in single precision."""
        places: NDArray[np.float32] = self.single.reshape(len(self.areas), 3, -1).astype(np.float32)
        return places

    @cached_property
    def gram(self) -> Array:
        """Sum over the places of their area times X^T X, shape (r, r)."""
        return gram_of_places(self.single_by_place, self.areas)


def gram_of_places(rows: NDArray[np.float32], weights: Array) -> Array:
    """Return the sum over places of ``weights``, (n,), times X^T X for their ``rows`` X, (n, 3, r)."""
    # Single precision is enough for what one place weighs against another, and takes half of the time.
    scaled = (rows * np.sqrt(weights).astype(np.float32)[:, None, None]).reshape(-1, rows.shape[-1])
    return (scaled.T @ scaled).astype(np.float64)


def sample_motion(character: Character, density: RigDensity) -> MotionSamples:
    """Return places on the moving skin of ``character``, chosen by farthest points, and what they stand for."""
    scale = HEAD_CM / max(character.height, 1e-9)
    moved = density.shape_rows
    offsets = character.shapes[moved]
    most = np.sqrt(np.einsum("snd,snd->sn", offsets, offsets)).max(axis=0)
    skin = _skin(character) & (most > _STILL * most.max())
    if not skin.any():
        skin = most > _STILL * most.max()
    ids = np.flatnonzero(skin)
    areas = vertex_areas(character.vertices, character.triangles)[ids]
    places = character.vertices[ids].astype(np.float64)
    chosen, owners = _farthest(places, areas, min(_SAMPLES, len(ids)))
    shares = np.bincount(owners, areas, minlength=len(chosen))
    vertices = ids[chosen]
    moves = scale * offsets[:, vertices].astype(np.float64).transpose(1, 2, 0).reshape(-1, len(moved))
    single = moves @ np.linalg.solve(density.along, density.directions)
    return MotionSamples(
        vertices, shares / shares.sum(), moves @ density.directions, np.ascontiguousarray(single), scale
    )


def largest_motions(character: Character, rows: NDArray[np.intp]) -> Array:
    """Return how far the shapes ``rows`` move any place, shape (W,), in centimetres of the character.

    Eyes count: a gaze that takes the lids along is not what a pull on a lid means.
    """
    offsets = character.shapes[rows]
    squares = np.einsum("snd,snd->sn", offsets, offsets)
    largest = np.sqrt(squares.max(axis=1, initial=0.0)).astype(np.float64)
    return np.maximum(largest, 1e-9)


def _skin(character: Character) -> NDArray[np.bool_]:
    """Return which vertices are skin, shape (N,); all where no part is."""
    skin = np.zeros(len(character.vertices), dtype=bool)
    for part in character.parts:
        if part.material == "skin":
            skin[slice(*part.vertices)] = True
    return skin if skin.any() else ~skin


def _farthest(places: Array, areas: Array, n: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return ``n`` of the ``places``, (m, 3), each farthest from those before, and which of them owns each place."""
    chosen = np.empty(n, dtype=np.intp)
    chosen[0] = int(np.argmax(areas))
    owners = np.zeros(len(places), dtype=np.intp)
    nearest = np.full(len(places), np.inf)
    for i in range(n):
        if i:
            chosen[i] = int(np.argmax(nearest))
        distance = np.linalg.norm(places - places[chosen[i]], axis=1)
        owners[distance < nearest] = i
        nearest = np.minimum(nearest, distance)
    return chosen, owners
