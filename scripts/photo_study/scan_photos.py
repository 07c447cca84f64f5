"""Trials on photos of a real scan with its own texture, whose surface is known: what no model has drawn."""

import time
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.alignment import Similarity, rigid_alignment
from faceposer.geometry.nearest_surface import NearestSurface
from faceposer.identity.identity import Identity
from faceposer.identity.photos.dense_fit import DenseFitter
from faceposer.identity.photos.face_crop import FaceCrop
from faceposer.identity.photos.landmark_fit import PhotoFace, fit_landmarks
from faceposer.identity.registration import align
from faceposer.identity.scans.head_from_scans import read_scan
from faceposer.identity.scans.scan import find_scan_landmarks
from faceposer.landmarks.drawing import PaintedMesh
from faceposer.landmarks.points import find_landmarks
from faceposer.landmarks.reference import reference
from scripts.photo_study.study import YAWS, Study, Trial
from scripts.photo_study.synthetic import SIZE, picture_of

Array = NDArray[np.float64]

_FIRST_SEED = 70_000
_ROUNDS = 30
# Distance in centimetres above which a vertex has no counterpart on the scan.
_FAR = 1.0


class ScanStudy:
    """Trials on random photos of a scan.

    Attributes:
        mesh: The scan, upright and in centimetres.
    """

    def __init__(self, study: Study, path: str) -> None:
        """Prepare the scan in the file ``path``, upright and in centimetres by its landmarks."""
        self._study = study
        mesh, landmarks = find_scan_landmarks(read_scan(path).mesh, path)
        points = landmarks.points
        known = np.isfinite(points).all(axis=1)
        frame = align(points[known], reference().places[known])
        self.mesh = PaintedMesh(
            frame.apply(mesh.vertices), mesh.triangles, mesh.colours, mesh.uv, mesh.image_of, mesh.images
        )
        triangles = self.mesh.triangles
        self._surface = NearestSurface(self.mesh.vertices, triangles, np.arange(len(triangles)))
        edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
        pairs, counts = np.unique(edges, axis=0, return_counts=True)
        self._border = np.zeros(len(self.mesh.vertices), dtype=bool)
        self._border[pairs[counts == 1].ravel()] = True

    def trials(self, number: int, views: Sequence[int]) -> Iterator[Trial]:
        """Yield the trials with the random photos ``number``."""
        study = self._study
        rng = np.random.default_rng(_FIRST_SEED + number)
        crops = []
        for low, high in YAWS[: max(views)]:
            pixels, _ = picture_of(self.mesh, rng, float(rng.uniform(low, high)))
            face = find_landmarks(pixels)
            if face is not None:
                crops.append(FaceCrop.of(PhotoFace(face, (SIZE, SIZE), 2.0 * SIZE, 0.3), pixels))
        for count in views:
            if len(crops) < count:
                continue
            yield self._trial("mean", count, np.zeros((4, study.basis.n_identity)), 0.0)
            begun = time.process_time()
            start = fit_landmarks([crop.face for crop in crops[:count]], study.basis, study.places)
            yield self._trial("landmarks", count, np.tile(start.state.shape, (4, 1)), time.process_time() - begun)
            fitter = DenseFitter(crops[:count], start, study.basis, study.samples)
            for method, dense in zip(("dense", "dense-segments"), fitter.stages(), strict=True):
                yield self._trial(method, count, dense.rows, time.process_time() - begun)

    def _trial(self, method: str, views: int, rows: Array, seconds: float) -> Trial:
        return Trial(method, views, self.distance(rows), 0.0, seconds, "scan-photo")

    def distance(self, rows: Array) -> float:
        """Return the median distance of the face with coefficients ``rows`` from the scan, after a similarity, in mm.

        The similarity brings the nearest points of the scan to the face, by iterated closest points.
        """
        skin = self._study.basis.editor.skin(Identity.of(rows))[self._study.measured]
        frame = Similarity(np.eye(3), np.zeros(3), np.array(1.0))
        for _ in range(_ROUNDS):
            moved = frame.apply(skin)
            found, _ = self._surface.points(moved)
            corners = found.corners(self.mesh.triangles)
            places = found.positions(self.mesh.vertices, self.mesh.triangles)
            far = np.linalg.norm(places - moved, axis=1)
            used = (far < _FAR) & ~self._border[corners].any(axis=1)
            frame = rigid_alignment(skin[used], places[used], np.ones(int(used.sum())), scale=True)
        return float(10.0 * np.median(far[used]) / float(frame.scale))
