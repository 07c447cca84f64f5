"""The study of heads and expressions from synthetic photos: trials, one per person, and rows of their errors."""

import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from faceposer.geometry.alignment import rigid_alignment
from faceposer.identity.identity import Identity
from faceposer.identity.photos.dense_fit import DenseFitter
from faceposer.identity.photos.face_crop import FaceCrop
from faceposer.identity.photos.face_places import FacePlaces, load_face_places
from faceposer.identity.photos.head_basis import HeadBasis, head_basis
from faceposer.identity.photos.head_from_photos import PAINTED
from faceposer.identity.photos.landmark_fit import PhotoFace, fit_landmarks
from faceposer.identity.photos.skin_samples import shipped_samples
from faceposer.identity.photos.unknowns import FitState
from faceposer.landmarks.points import N_POINTS, find_landmarks
from scripts.identity_study.eos_fit import has_eos
from scripts.photo_study.eos_photos import EosPhotos
from scripts.photo_study.paintings import painted
from scripts.photo_study.synthetic import SIZE, Person, Photo, photo_of, random_person, random_weights

Array = NDArray[np.float64]

METHODS = ("mean", "eos", "landmarks", "dense", "dense-segments")
# Rows, the trials that they are of, and the error.
_TESTS = (
    ("synthetic", "synthetic", "head"),
    ("expression", "synthetic", "expression"),
    ("scan-photo", "scan-photo", "head"),
)
_FIRST_SEED = 5000
#: Turns of the face, in radians, between which those of three views are drawn.
YAWS = ((-0.3, 0.3), (-0.7, -0.35), (0.35, 0.7))
# Distance of the vertices measured from the landmarks, in centimetres.
_REACH = 1.2
_DRAWS = 1000


@dataclass(frozen=True)
class Trial:
    """Errors of one method on one person, in millimetres.

    Attributes:
        method: Name of the method.
        views: Number of photos.
        head: Mean distance of the vertices of the face after a similarity.
        expression: Mean distance of their displacements by the expression, over the photos.
        seconds: Time of the processor for the fit.
        test: "synthetic" for people who were drawn, "scan-photo" for a scan, the median distance of whose surface is
            taken, and which has no expression.
    """

    method: str
    views: int
    head: float
    expression: float
    seconds: float
    test: str = "synthetic"


class Study:
    """Trials on random people who are not in the model's training data."""

    def __init__(self, other_lights: bool = False, paintings: bool = False, likelihood: float = 1.0) -> None:
        """Prepare the model of heads.

        Args:
            other_lights: Light the people with several lamps and the sky, which the fit does not have.
            paintings: Make paintings of the photos, and fit them as such.
            likelihood: Weight of the density of heads.
        """
        self.other_lights, self.paintings = other_lights, paintings
        self.likelihood = likelihood * (PAINTED if paintings else 1.0)
        self.basis: HeadBasis = head_basis()
        self.places: FacePlaces = load_face_places()
        self.samples = shipped_samples(self.basis, self.places)
        skin = self.basis.character.vertices[: self.basis.n_skin]
        landmarks = self.basis.landmarks(self.places).mean[:N_POINTS]
        self.rival: EosPhotos | None = None
        if has_eos():
            self.rival = EosPhotos(self.basis, self.places)
        else:
            print("eos is not installed (pip install eos-py): its rows are left out.", file=sys.stderr)
        self.measured = cKDTree(landmarks).query(skin)[0] < _REACH

    def trials(self, number: int, views: Sequence[int] = (1, 3)) -> Iterator[Trial]:
        """Yield the trials of person ``number``."""
        rng = np.random.default_rng(1000 + number)
        person = random_person(self.basis.editor, self.basis.character, _FIRST_SEED + number)
        many = np.random.default_rng(number) if self.other_lights else None
        photos = []
        for low, high in YAWS[: max(views)]:
            yaw = float(rng.uniform(low, high))
            weights = random_weights(self.basis.model, rng)
            photo = photo_of(person, self.basis.character, weights, rng, yaw, many=many)
            photos.append(replace(photo, pixels=painted(photo.pixels, rng)) if self.paintings else photo)
        found = [(photo, find_landmarks(photo.pixels)) for photo in photos]
        crops = [
            (photo, FaceCrop.of(PhotoFace(face, (SIZE, SIZE), 2.0 * SIZE, 0.3), photo.pixels))
            for photo, face in found
            if face is not None
        ]
        for count in views:
            if len(crops) >= count:
                yield from self._of(person, crops[:count])

    def _of(self, person: Person, crops: Sequence[tuple[Photo, FaceCrop]]) -> Iterator[Trial]:
        n = len(crops)
        mean = np.zeros((4, self.basis.n_identity))
        still = float(np.mean([self._displacement(person, photo, None) for photo, _ in crops]))
        yield Trial("mean", n, self._head_error(person, mean), still, 0.0)
        if self.rival is not None and n == 1:
            begun = time.process_time()
            fitted = self.rival.fit(crops[0][1])
            seconds = time.process_time() - begun
            head = self._head_error(person, np.tile(fitted.rows, (4, 1)))
            yield Trial("eos", n, head, self._displacement(person, crops[0][0], fitted.pose), seconds)
        begun = time.process_time()
        start = fit_landmarks([crop.face for _, crop in crops], self.basis, self.places, self.likelihood)
        seconds = time.process_time() - begun
        rows = np.tile(start.state.shape, (4, 1))
        yield Trial(
            "landmarks", n, self._head_error(person, rows), self._expressions(person, crops, start.state), seconds
        )
        begun = time.process_time() - seconds
        fitter = DenseFitter([crop for _, crop in crops], start, self.basis, self.samples)
        for method, dense in zip(("dense", "dense-segments"), fitter.stages(), strict=True):
            seconds = time.process_time() - begun
            head, expression = self._head_error(person, dense.rows), self._expressions(person, crops, dense.state)
            yield Trial(method, n, head, expression, seconds)

    def _head_error(self, person: Person, rows: Array) -> float:
        """Return the mean distance of the face with coefficients ``rows``, after a similarity, in millimetres."""
        skin = self.basis.editor.skin(Identity.of(rows))[self.measured]
        truth = person.vertices[: self.basis.n_skin][self.measured]
        aligned = rigid_alignment(skin, truth, np.ones(len(skin)), scale=True)
        return float(10.0 * np.linalg.norm(aligned.apply(skin) - truth, axis=1).mean())

    def _expressions(self, person: Person, crops: Sequence[tuple[Photo, FaceCrop]], state: FitState) -> float:
        pairs = zip(crops, state.views, strict=True)
        return float(np.mean([self._displacement(person, photo, view.pose) for (photo, _), view in pairs]))

    def _displacement(self, person: Person, photo: Photo, pose: Array | None) -> float:
        """Return the mean error of the displacements by the expression of ``photo``, in millimetres."""
        n = self.basis.n_skin
        truth = np.tensordot(photo.weights, person.shapes[:, :n], 1)
        found = np.zeros_like(truth)
        if pose is not None:
            found = self.basis.model.instance(pose)[:n] - self.basis.character.vertices[:n]
        return float(10.0 * np.linalg.norm((found - truth)[self.measured], axis=1).mean())


def rows_of(trials: Sequence[Trial]) -> list[dict[str, Any]]:
    """Return one row per test, method and number of views, with the confidence of the mean by the bootstrap."""
    rows = []
    for test, source, value in _TESTS:
        for views in sorted({trial.views for trial in trials}):
            for method in METHODS:
                kind = (source, method, views)
                chosen = [trial for trial in trials if (trial.test, trial.method, trial.views) == kind]
                if not chosen:
                    continue
                errors = np.array([getattr(trial, value) for trial in chosen])
                draws = np.random.default_rng(0).choice(errors, (_DRAWS, len(errors))).mean(axis=1)
                rows.append(
                    {
                        "test": test,
                        "method": method,
                        "views": views,
                        "n": len(errors),
                        "error_mm_mean": round(float(errors.mean()), 3),
                        "error_mm_median": round(float(np.median(errors)), 3),
                        "ci95": np.quantile(draws, (0.025, 0.975)).round(3).tolist(),
                        "seconds": round(float(np.median([trial.seconds for trial in chosen])), 2),
                    }
                )
    return rows
