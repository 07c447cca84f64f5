"""The fit of frames: derivatives, and expressions and places of a head that are known."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from faceposer.film.film import FilmFrame, Span
from faceposer.film.following import follow_head
from faceposer.film.frame_fit import N_PLACE, FrameFit, Placing
from faceposer.film.person import Person
from faceposer.film.shots import Shot
from faceposer.film.tracking import Track
from faceposer.geometry.camera import Camera
from faceposer.identity.photos.face_camera import FaceCamera, rotation_of
from faceposer.identity.photos.face_places import LandmarkErrors, load_face_places
from faceposer.identity.photos.head_basis import head_basis
from faceposer.landmarks.points import Landmarks
from tests.identity.photos.test_landmark_fit import landmarks_at

_SIZE = (400, 400)


@pytest.fixture(scope="module")
def person() -> Person:
    """The average head, whose landmarks are exact."""
    basis = head_basis()
    points = basis.landmarks_of(basis.model, load_face_places())
    focal = 900.0
    return Person(
        basis.model,
        points,
        basis.prior,
        None,
        LandmarkErrors.plain(0.02),
        math.log(focal),
        points.mean.mean(axis=0),
        (0,),
    )


@pytest.fixture(scope="module")
def placing(person: Person) -> Placing:
    facing = np.diag([1.0, -1.0, -1.0])
    camera = Camera(facing, np.array([0.0, 0.0, 60.0]) - facing @ person.middle, 900.0, _SIZE)
    return Placing(facing, FaceCamera.of(camera, person.middle))


def face_of(person: Person, placing: Placing, unknowns: np.ndarray) -> Landmarks:
    places = person.points.at(np.zeros(0), unknowns[:-N_PLACE])
    return landmarks_at(placing.camera_at(unknowns[-N_PLACE:]).project(places))


def test_derivatives_match_finite_differences(person: Person, placing: Placing) -> None:
    rng = np.random.default_rng(0)
    r = person.model.n_coefficients
    place = placing.place_of(placing.camera)
    face = face_of(person, placing, np.concatenate([np.zeros(r), place]))
    unknowns = np.concatenate([0.1 * rng.standard_normal(r), place + (0.3, -0.5, 0.2, 0.4, -0.3, 0.05)])
    fit = FrameFit(person, placing, face, unknowns)
    slope = fit.quadratic(unknowns).slope
    for k in (0, 5, r - 1, *range(r, r + N_PLACE)):
        step = 1e-5 * np.eye(len(unknowns))[k]
        ahead, behind = (
            fit._cost(tried) - person.prior.cost(tried[:r]) for tried in (unknowns + step, unknowns - step)
        )
        assert slope[k] == pytest.approx((ahead - behind) / 2e-5, rel=1e-3, abs=1e-2)


def test_places_and_cameras_stand_for_each_other(placing: Placing) -> None:
    place = np.array([0.4, -0.9, 0.2, 1.0, -2.0, 2.6])
    camera = placing.camera_at(place)
    np.testing.assert_allclose(placing.place_of(camera), place, atol=1e-9)
    assert camera.log_focal == pytest.approx(math.log(900.0))
    np.testing.assert_allclose(camera.rotation, rotation_of(place[:3]) @ placing.reference)


class StillFilm:
    """A film that is not read, since the person has no colours."""

    path, size, rate, n_frames, notes = Path("film.mp4"), _SIZE, 30.0, None, ()

    def frames(self, span: Span, largest: int) -> Iterator[FilmFrame]:
        raise AssertionError("it is read")


def test_a_known_motion_is_recovered_across_a_gap(person: Person, placing: Placing) -> None:
    """Exact landmarks of a moving head that opens its mouth give both back, also where some frames show no face."""
    count, r = 24, person.model.n_coefficients
    jaw = 0.3 * (1.0 - np.cos(2.0 * np.pi * np.arange(count) / count))
    poses = np.array([person.model.coefficients_of({"jawOpen": weight, "mouthSmileLeft": 0.3}) for weight in jaw])
    base = placing.place_of(placing.camera)
    turns = 0.3 * np.sin(2.0 * np.pi * np.arange(count) / count)
    places = np.array([base + (0.0, turn, 0.0, turn, 0.0, 0.1 * turn) for turn in turns])
    unknowns = np.concatenate([poses, places], axis=1)
    faces = [face_of(person, placing, row) for row in unknowns]
    shown = [None if 9 <= k < 12 else face for k, face in enumerate(faces)]
    track = Track(_SIZE, np.arange(count), tuple(shown), Shot(0, count - 1))
    head = follow_head(StillFilm(), Span(), track, person)
    assert head.seen.sum() == count - 3
    found = head.poses @ person.model.subspace.directions.T
    names = person.model.character.shape_names
    off = np.abs(found[:, names.index("jawOpen")] - jaw)
    assert off[head.seen].max() < 0.05
    assert off.max() < 0.1
    np.testing.assert_allclose(found[:, names.index("mouthSmileLeft")], 0.3, atol=0.06)
    rotations = [head.placing.camera_at(place).rotation for place in head.places]
    for turn, rotation in zip(turns, rotations, strict=True):
        expected = rotation_of(np.array([0.0, turn, 0.0])) @ placing.reference
        assert np.abs(rotation - expected).max() < 0.02
    assert r == 54
