"""Samples spread evenly over the skin, which measure the motion of a whole face by a few of its vertices."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.mesh import vertex_areas
from faceposer.model.character import Character
from faceposer.model.local_moments import RigDensity

Array = NDArray[np.float64]

_SAMPLES = 150
# Skin that no shape moves by more than this share of the largest displacement counts as rigid.
_STILL = 1e-3
#: Height from chin to crown of the reference head in which motion is measured, in centimetres.
HEAD_CM = 22.0


@dataclass(frozen=True, eq=False)
class MotionSamples:
    """Motion of n sample vertices of the skin as a function of a face's coefficients.

    Displacements are in centimetres on a head of height ``HEAD_CM``.

    Attributes:
        vertices: Vertex ids, shape (n,).
        areas: Share of the moving skin's area that each sample represents, shape (n,), summing to 1.
        rows: Displacements per coefficient, coordinates stacked, shape (3 n, r).
        single: The same for single muscles, without the co-contraction of others
            (X = S L^-1 D with the shapes' displacements S, L of ``RigDensity.along`` and the weights' directions D).
        scale: Centimetres on the reference head per unit of the face.
    """

    vertices: NDArray[np.intp]
    areas: Array
    rows: Array
    single: Array
    scale: float

    @cached_property
    def single_by_place(self) -> NDArray[np.float32]:
        """``single`` by sample, shape (n, 3, r), in single precision."""
        places: NDArray[np.float32] = self.single.reshape(len(self.areas), 3, -1).astype(np.float32)
        return places

    @cached_property
    def gram(self) -> Array:
        """Sum over the samples of area times X^T X, shape (r, r)."""
        return gram_of_places(self.single_by_place, self.areas)


def gram_of_places(rows: NDArray[np.float32], weights: Array) -> Array:
    """Return the sum over samples of ``weights``, (n,), times X^T X for their ``rows`` X, (n, 3, r)."""
    # Single precision suffices for relative weights and halves the time.
    scaled = (rows * np.sqrt(weights).astype(np.float32)[:, None, None]).reshape(-1, rows.shape[-1])
    return (scaled.T @ scaled).astype(np.float64)


def sample_motion(character: Character, density: RigDensity) -> MotionSamples:
    """Return samples of the moving skin of ``character``, chosen by farthest point sampling, with their areas."""
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
    """Return the largest displacement of any vertex by each of the shapes ``rows``, in centimetres, shape (W,).

    Eyeballs count, so that a gaze shape, which moves the lids as well, is not mistaken for the target of a pull on a
    lid.
    """
    offsets = character.shapes[rows]
    squares = np.einsum("snd,snd->sn", offsets, offsets)
    largest = np.sqrt(squares.max(axis=1, initial=0.0)).astype(np.float64)
    return np.maximum(largest, 1e-9)


def _skin(character: Character) -> NDArray[np.bool_]:
    """Return the mask of skin vertices, shape (N,); all True if no part is skin."""
    skin = np.zeros(len(character.vertices), dtype=bool)
    for part in character.parts:
        if part.material == "skin":
            skin[slice(*part.vertices)] = True
    return skin if skin.any() else ~skin


def _farthest(places: Array, areas: Array, n: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return ``n`` of the ``places``, (m, 3), by farthest point sampling, and the nearest of these to each place."""
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
