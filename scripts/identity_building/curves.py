"""Corresponding points along the edges of the lids and the line where the lips meet, by shares of the arc length."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.identity.anatomy.loops import LASH_RING, ordered_ring
from scripts.asset_building.head import Skin
from scripts.identity_building.scans import Floats, Ints, ScannedPeople, openings, rings

#: Rings of quads from the border of the eye's socket to the lashes, and from that of the mouth to the lips' contact.
_SCAN_LASHES, _SCAN_CONTACT = 4, 7
#: Corners of the scans' eyes at the nose, of the left and the right one, in the 68 landmarks.
_CANTHI = (42, 39)
#: Share of the eye's width at the nose where the scans' lids end in a wall, which the caruncle covers.
_WALL = 0.17


@dataclass(frozen=True, eq=False)
class CurvePoints:
    """Vertices of our skin and their places on the scans.

    Attributes:
        vertices: Shape (n,).
        places: Shape (n, 3).
    """

    vertices: NDArray[np.int64]
    places: Floats


def lid_points(skin: Skin, own: Floats, people: ScannedPeople) -> list[CurvePoints]:
    """Return the points along the edges of the lids of the left and the right eye; ``own``, (N, 3), is our skin."""
    result = []
    for side, canthus in zip((1.0, -1.0), _CANTHI, strict=True):
        ring = ordered_ring(skin.quads, skin.rings_left[LASH_RING]).astype(np.int64)
        ours = ring if side > 0.0 else skin.mirror[ring].astype(np.int64)
        theirs = _scan_lids(people, side, int(people.landmarks[canthus]))
        pairs = [_matched(chain, own, places) for chain, places in zip(_halves(own, ours, side), theirs, strict=True)]
        result.append(_joined(pairs))
    return result


def contact_points(skin: Skin, own: Floats, people: ScannedPeople) -> CurvePoints:
    """Return the points along the line where the lips meet."""
    border = min(
        openings(people.quads), key=lambda loop: float(np.linalg.norm(people.mean[loop].mean(axis=0) - _MOUTH))
    )
    ring = _in_order(people.quads, rings(people.quads, border, _SCAN_CONTACT)[-1])
    ours, theirs = (_halves(v, loop, 1.0) for v, loop in ((own, skin.lip_contact), (people.mean, ring)))
    return _joined([_matched(a, own, people.mean[b]) for a, b in zip(ours, theirs, strict=True)])


_MOUTH = np.array([0.0, -3.4, 10.3])
_EYES = np.array([3.2, 3.5, 9.0])


def _scan_lids(people: ScannedPeople, side: float, canthus: int) -> list[Floats]:
    """Return the places of the upper and the lower lid's edge from the nose to the temple."""
    eye = _EYES * (side, 1.0, 1.0)
    border = min(openings(people.quads), key=lambda loop: float(np.linalg.norm(people.mean[loop].mean(axis=0) - eye)))
    ring = _in_order(people.quads, rings(people.quads, border, _SCAN_LASHES)[-1])
    chains = []
    for chain in _halves(people.mean, ring, side):
        along = side * people.mean[chain, 0]
        kept = along > along.min() + _WALL * np.ptp(along)
        chains.append(np.concatenate([people.mean[[canthus]], people.mean[chain[kept]]]))
    return chains


def _in_order(quads: Ints, ring: NDArray[np.int64]) -> NDArray[np.int64]:
    return ordered_ring(quads, ring).astype(np.int64)


def _halves(vertices: Floats, loop: NDArray[np.integer], side: float) -> list[NDArray[np.int64]]:
    """Return the upper and the lower part of a ``loop``, each from its least to its largest ``side`` times x."""
    along = side * vertices[loop, 0]
    turned = np.roll(np.asarray(loop, dtype=np.int64), -int(along.argmin()))
    end = int((side * vertices[turned, 0]).argmax())
    chains = [turned[: end + 1], np.append(turned[end:], turned[0])[::-1]]
    return sorted(chains, key=lambda chain: -float(vertices[chain, 1].mean()))


def _matched(chain: NDArray[np.int64], own: Floats, places: Floats) -> CurvePoints:
    """Return the vertices of ``chain`` with the places at the same shares of the length of the line ``places``."""
    shares, theirs = _shares(own[chain]), _shares(places)
    return CurvePoints(chain, np.stack([np.interp(shares, theirs, axis) for axis in places.T], axis=1))


def _shares(line: Floats) -> Floats:
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    return lengths / lengths[-1]


def _joined(pairs: list[CurvePoints]) -> CurvePoints:
    """Return all points once; the ends of the parts are common."""
    vertices, first = np.unique(np.concatenate([pair.vertices for pair in pairs]), return_index=True)
    return CurvePoints(vertices, np.concatenate([pair.places for pair in pairs])[first])
