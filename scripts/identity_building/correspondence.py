"""Our skin laid on the mean of the scans: landmarks of both, curves, and closest points."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.alignment import Similarity
from faceposer.geometry.mesh import TriangleMesh
from faceposer.geometry.nearest_surface import NearestSurface
from faceposer.geometry.picking import SurfacePoints
from faceposer.geometry.polygon_mesh import triangle_fans
from faceposer.identity.anatomy.loops import LASH_RING
from faceposer.identity.registration import LandmarkPairs, Registration, RegistrationSettings, align, register
from faceposer.identity.scan_surface import ScanSurface
from faceposer.identity.template import head_template
from faceposer.landmarks.drawing import PaintedMesh
from faceposer.landmarks.on_meshes import find_mesh_landmarks
from faceposer.landmarks.reference import reference
from faceposer.model.character import Character
from faceposer.progress import Progress
from scripts.asset_building.head import Skin
from scripts.identity_building.curves import contact_points, lid_points
from scripts.identity_building.marked_points import EAR, NOSE
from scripts.identity_building.scans import N_SKIN, Floats, ScannedPeople

#: Our feature points and the scans' landmarks, of the 68, at the corners of the mouth. Others differ: the networks tell
#: that the scheme's middle of the upper lip is a millimetre above our border of the lip's red, for one.
_SAME = {"8.3": 54, "8.4": 48}
_FLIP = np.array([-1.0, 1.0, 1.0])
#: Trust in points of both meshes that are the same by construction, and spread of the networks' points, in centimetres,
#: at which the trust in them is half.
_EXACT, _CURVE, _HALF_SPREAD = 4.0, 100.0, 0.15
#: Height above our neck's end, in centimetres, from which the skin looks for the scans' surface.
_NECK_LEFT_OUT = 5.0

SETTINGS = RegistrationSettings(
    stiffness=(1000.0, 300.0, 100.0, 30.0, 10.0, 3.0), rounds=3, farthest=(2.0, 0.5), least_cosine=0.5
)


@dataclass(frozen=True, eq=False)
class Correspondence:
    """Our skin on the mean of the scans.

    Attributes:
        registration: The result of the registration, in our frame, with the size of the scans.
        scale: Factor from the built-in man's size to that of the scans.
        known: Mask of the vertices whose places on the scans are known, shape (N,).
        points: Their points on the triangles of the scans' skin.
        on_curves: Vertices along the lids' edges and the lips' contact, shape (k,).
    """

    registration: Registration
    scale: float
    known: NDArray[np.bool_]
    points: SurfacePoints
    on_curves: NDArray[np.int64]


def correspondence(man: Character, skin: Skin, people: ScannedPeople, progress: Progress) -> Correspondence:
    """Lay the skin of ``man``, whose topology is ``skin``, on the mean of ``people``."""
    part = man.parts[0]
    own = man.vertices[slice(*part.vertices)].astype(np.float64)
    triangles = skin.fine.quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    target = TriangleMesh(people.mean[:N_SKIN], people.triangles)
    pairs, inner = _pairs(man, own, triangles, skin, people)
    scale = 1.0 / float(_frame(pairs, own, triangles).scale)
    searching = _searching(own, skin, inner)
    found = register(TriangleMesh(scale * own, triangles), target, pairs, SETTINGS, progress, searching=searching)
    known = found.used | _on_curves(pairs, len(own))
    mirror = head_template().mirror
    even = _even(found, mirror, target)
    return Correspondence(even, scale, known & known[mirror], even.points, inner)


def _even(found: Registration, mirror: NDArray[np.int64], target: TriangleMesh) -> Registration:
    """Return ``found`` with each vertex in the middle of its place and the mirror image of its partner's.

    The mean of the scans is symmetric, within .05 mm, and so is our topology. Without this, the vertices lie about
    half a millimetre further along the surface on one side than on the other. Heads and their mirror images would then
    differ by more than their form, and what tells them apart would become a mode, which no scan shows.
    """
    there = found.in_target()
    middle = 0.5 * (there + there[mirror] * _FLIP)
    points, distances = ScanSurface.of(target).nearest.points(middle)
    scale = float(found.frame.scale)
    return replace(found, vertices=found.frame.apply(middle), points=points, distances=scale * distances)


def _frame(pairs: LandmarkPairs, own: Floats, triangles: NDArray[np.int32]) -> Similarity:
    return align(pairs.on_target, pairs.on_template.positions(own, triangles), pairs.weights)


def _pairs(
    man: Character, own: Floats, triangles: NDArray[np.int32], skin: Skin, people: ScannedPeople
) -> tuple[LandmarkPairs, NDArray[np.int64]]:
    """Return all corresponding points, and our vertices on curves."""
    upright = Similarity(np.eye(3), np.zeros(3), np.array(1.0))
    seen_mesh = PaintedMesh(people.mean, triangle_fans(people.shown), people.colours)
    found = find_mesh_landmarks(seen_mesh, upright)
    assert found is not None, "no face is seen on the mean of the scans"
    ours, apart = NearestSurface(own, triangles, np.arange(len(triangles))).points(reference().places)
    partner = reference().mirror
    there = 0.5 * (found.points + found.points[partner] * _FLIP)
    spread = np.fmax(found.spread, found.spread[partner])
    seen = np.flatnonzero(np.isfinite(there).all(axis=1) & (apart < 0.5))
    trust = 1.0 / (1.0 + (spread[seen] / _HALF_SPREAD) ** 2)
    marked = [*EAR, *NOSE]
    mirrored, _ = NearestSurface(own, triangles, np.arange(len(triangles))).at_vertices(
        own[[v for v, _ in marked]] * _FLIP
    )
    exact = np.array(
        [man.feature_points[name] for name in _SAME] + [v for v, _ in marked] + (-1 - mirrored.faces).tolist()
    )
    ears = np.array([place for _, place in marked])
    places = np.concatenate([people.mean[people.landmarks[list(_SAME.values())]], ears, ears * _FLIP])
    curves = [*lid_points(skin, own, people), contact_points(skin, own, people)]
    on_curves = np.concatenate([curve.vertices for curve in curves])
    points = ours.subset(seen).joined(SurfacePoints.at_vertices(exact)).joined(SurfacePoints.at_vertices(on_curves))
    where = np.concatenate([there[seen], places, *(curve.places for curve in curves)])
    weights = np.concatenate([trust, np.full(len(exact), _EXACT), np.full(len(on_curves), _CURVE)])
    return LandmarkPairs(points, where, weights), on_curves


def _searching(own: Floats, skin: Skin, on_curves: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return the mask of the vertices that look for closest points: outer skin above the end of the neck."""
    result = own[:, 1] > own[:, 1].min() + _NECK_LEFT_OUT
    result[on_curves] = False
    left = np.concatenate([ring.astype(np.int64) for ring in skin.rings_left[: LASH_RING + 2]])
    inside = np.concatenate([left, skin.mirror[left], np.unique(skin.quads[skin.in_mouth])])
    # New vertices follow if all the old ones around them do.
    follows = np.zeros(len(skin.base_ids))
    follows[inside] = 1.0
    result &= skin.fine.split @ follows < 0.99
    return result


def _on_curves(pairs: LandmarkPairs, n: int) -> NDArray[np.bool_]:
    result = np.zeros(n, dtype=bool)
    result[-1 - pairs.on_template.faces[pairs.weights == _CURVE]] = True
    return result
