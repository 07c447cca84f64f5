"""Scanned identities on our topology: modes carried over, heads cleaned, and their rigid motion and size removed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.alignment import rigid_alignment
from faceposer.identity.anatomy.loops import LASH_RING
from faceposer.identity.template import HeadTemplate
from scripts.asset_building.head import Skin
from scripts.asset_building.identity import NECK_TOP, close_lips
from scripts.asset_building.source import BaseMesh
from scripts.identity_building.correspondence import Correspondence
from scripts.identity_building.filling import Filler, eroded, links_of
from scripts.identity_building.scans import N_SKIN, Floats, ScannedPeople

_FLIP = np.array([-1.0, 1.0, 1.0])
#: Rings of vertices around those without correspondence whose places are not trusted.
_UNSURE_RINGS = 2
#: Height of the crown over the origin, in centimetres, as of the shipped characters.
_CROWN = 12.5
#: Difference in height of the neck's end between front and back, in centimetres, as of the shipped characters.
_NECK_DROP = 1.5


@dataclass(frozen=True, eq=False)
class CarriedModes:
    """The mean and the modes of the scans on our topology.

    Attributes:
        mean: Control vertices, shape (C, 3).
        modes: Offsets per standard deviation, shape (K, C, 3).
        skin: The mean on the fine skin before it was approximated by control vertices, shape (N, 3).
        skin_modes: The modes there, shape (K, N, 3).
        known: Mask of the vertices of the skin with correspondence, shape (N,).
    """

    mean: Floats
    modes: Floats
    skin: Floats
    skin_modes: Floats
    known: NDArray[np.bool_]


def carry(found: Correspondence, template: HeadTemplate, people: ScannedPeople) -> CarriedModes:
    """Return the mean and the modes on our topology; vertices without correspondence follow those around them."""
    registration = found.registration
    links = links_of(template.quads, template.n_skin)
    kept = np.zeros(template.n_skin, dtype=bool)
    kept[found.on_curves] = True
    known = eroded(found.known, links, kept, _UNSURE_RINGS)
    rest = found.scale * template.rest
    laid = rigid_alignment(rest[known], registration.vertices[known]).apply(rest)
    # The end of the neck stays where it is on the man.
    end = _neck_end(template)
    fixed = known | end
    mean = laid + Filler(fixed, links)(np.where(known[:, None], registration.vertices - laid, 0.0))
    points = found.points.subset(np.flatnonzero(known))
    corners = points.corners(people.triangles)
    filler = Filler(known, links)
    modes = np.zeros((len(people.modes), template.n_skin, 3))
    for mode, own in zip(people.modes[:, :N_SKIN], modes, strict=True):
        offsets = np.einsum("nc,ncd->nd", points.barycentric, mode[corners].astype(np.float64))
        own[known] = registration.frame.apply_to_directions(offsets)
        own[:] = filler(own)
    control = template.control(mean)
    return CarriedModes(control, np.stack([template.control(mode) for mode in modes]), mean, modes, known)


def _neck_end(template: HeadTemplate) -> NDArray[np.bool_]:
    edges = np.stack([template.quads, np.roll(template.quads, -1, axis=1)], axis=-1).reshape(-1, 2)
    _, number, counts = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
    result = np.zeros(template.n_skin, dtype=bool)
    result[edges[counts[number.reshape(-1)] == 1]] = True
    return result


class Cleaner:
    """Makes heads comparable: lips closed, neck's end level, rigid motion and size removed."""

    def __init__(self, template: HeadTemplate, skin: Skin, base: BaseMesh, mean: Floats) -> None:
        """Prepare for heads around ``mean``, (C, 3)."""
        self._skin, self._mirror = skin, template.mirror[: template.n_control]
        above = base.vertices[skin.base_ids, 1] > NECK_TOP
        links = links_of(skin.quads, len(skin.base_ids))
        border = np.zeros(len(above), dtype=bool)
        border[skin.border] = True
        self._filler = Filler(above | border, links)
        self.weights = self._alignment_weights(above)
        level = self._even(self._level(close_lips(mean, skin.lip_contact), None))
        low, high = (ends(template.skin(level), axis=0) for ends in (np.min, np.max))
        # The origin is in the head as in the shipped characters.
        self.mean = level - [0.0, high[1] - _CROWN, 0.5 * (low[2] + high[2])]
        self._end = self.mean[skin.border, 1].copy()

    def __call__(self, head: Floats) -> Floats:
        """Return ``head``, (C, 3), on the mean, with closed lips and a level neck."""
        closed = close_lips(head, self._skin.lip_contact)
        laid = rigid_alignment(closed, self.mean, self.weights, scale=True).apply(closed)
        return self._level(laid, self._end)

    def mirrored(self, head: Floats) -> Floats:
        """Return the mirror image of ``head``, (C, 3)."""
        return head[self._mirror] * _FLIP

    def _even(self, head: Floats) -> Floats:
        return 0.5 * (head + self.mirrored(head))

    def _level(self, head: Floats, end: Floats | None) -> Floats:
        """Return ``head`` with the heights of the neck's border at ``end``, or in one plane, fading out upwards."""
        ring = head[self._skin.border]
        if end is None:
            end = ring[:, 1].mean() + _NECK_DROP * ((ring[:, 2].max() - ring[:, 2]) / np.ptp(ring[:, 2]) - 0.5)
        change = np.zeros((len(head), 1))
        change[self._skin.border, 0] = end - ring[:, 1]
        result = head.copy()
        result[:, 1] += self._filler(change)[:, 0]
        return result

    def _alignment_weights(self, above: NDArray[np.bool_]) -> Floats:
        """Return the weights by which heads are aligned: outer skin above the neck, without the ears."""
        skin = self._skin
        left = np.concatenate(skin.rings_left[:LASH_RING])
        weights = above.astype(np.float64)
        weights[left] = weights[skin.mirror[left]] = 0.0
        weights[np.unique(skin.quads[skin.in_mouth])] = 0.0
        return weights
