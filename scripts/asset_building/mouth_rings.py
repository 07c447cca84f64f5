"""Rings of the skin's control mesh around the loop along which the lips touch."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.identity.anatomy.lids import upper_and_lower
from scripts.asset_building.head import Skin
from scripts.asset_building.piece import Floats, Ints


@dataclass(frozen=True)
class MouthRings:
    """Vertices around the mouth by their distance in the mesh from the loop of contact, which is the first ring.

    Attributes:
        rings: Control vertices of each ring, on the face and inside the mouth.
        parents: For each ring after the first, adjacency of its vertices to those of the previous ring, shape
            (n, n of the previous ring), with zeros and ones.
        along: Position along the lips of each vertex of the loop: 0 in the middle, 1 at the corners, shape (L,).
        lower: True for vertices that belong only to the lower lip, shape (L,).
    """

    rings: tuple[Ints, ...]
    parents: tuple[NDArray[np.bool_], ...]
    along: Floats
    lower: NDArray[np.bool_]

    def spread(self, values: Floats, count: int) -> tuple[Ints, Floats]:
        """Return vertices of the first ``count`` rings with ``values`` of the loop, (L,) or (L, k), spread outwards."""
        ids, result = [self.rings[0]], [values]
        for ring, parents in zip(self.rings[1:count], self.parents[: count - 1], strict=True):
            ids.append(ring)
            result.append((parents / parents.sum(axis=1, keepdims=True)) @ result[-1])
        return np.concatenate(ids), np.concatenate(result)


def mouth_rings(skin: Skin, control: Floats, count: int) -> MouthRings:
    """Return ``count`` rings of the ``skin``, whose control vertices on the base mesh are ``control``, shape (C, 3)."""
    loop = skin.lip_contact
    edges = np.stack([skin.quads, np.roll(skin.quads, -1, axis=1)], axis=-1).reshape(-1, 2)
    joined = np.concatenate([edges, edges[:, ::-1]])
    rings, parents = [loop], []
    seen = np.isin(np.arange(len(control)), loop)
    for _ in range(count - 1):
        outwards = joined[np.isin(joined[:, 0], rings[-1]) & ~seen[joined[:, 1]]]
        ring = np.unique(outwards[:, 1])
        pairs = np.zeros((len(ring), len(rings[-1])), dtype=bool)
        order = np.argsort(rings[-1], kind="stable")
        pairs[np.searchsorted(ring, outwards[:, 1]), order[np.searchsorted(rings[-1][order], outwards[:, 0])]] = True
        rings.append(ring.astype(np.int32))
        parents.append(pairs)
        seen[ring] = True
    x = np.abs(control[loop, 0])
    _, lower = upper_and_lower(control, loop, "Left")
    return MouthRings(tuple(rings), tuple(parents), x / x.max(), np.isin(loop, lower[1:-1]))
