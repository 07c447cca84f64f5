"""Names of places, on every character of the program and on imported rigs where there are any."""

import os
from pathlib import Path

import numpy as np
import pytest

from faceposer.model.subject import Subject
from faceposer.model.subject_file import available_subjects, load_subject
from faceposer.session.place_names import PointNames

RIGS = Path(os.environ.get("FACEPOSER_RIGS", ""))
NAMES = [name for name, _ in available_subjects()]
IMPORTED = ["facecap.glb", "facecap_multi.glb"]


def subject_of(name: str) -> Subject:
    if not name.endswith(".glb"):
        return load_subject(name)
    if not (RIGS / name).is_file():
        pytest.skip("FACEPOSER_RIGS has no such rig")
    from faceposer.training.request import TrainingRequest, train

    return train(TrainingRequest(kind="rig", source=RIGS / name, name="head", title="Head"))


@pytest.fixture(scope="module", params=[*NAMES, *IMPORTED])
def subject(request: pytest.FixtureRequest) -> Subject:
    return subject_of(request.param)


def place(subject: Subject, feature: str) -> np.ndarray:
    return subject.vertices[subject.feature_points[feature]].astype(float)


def skin(subject: Subject) -> tuple[int, int]:
    """Return the range of the skin's vertices."""
    return next(part.vertices for part in subject.parts if part.material == "skin")


def nearest(subject: Subject, position: np.ndarray) -> int:
    """The vertex of the skin that lies nearest to ``position``."""
    first, last = skin(subject)
    return first + int(np.argmin(np.linalg.norm(subject.vertices[first:last] - position, axis=1)))


def test_feature_points_are_called_what_they_are(subject: Subject) -> None:
    names = PointNames(subject)
    for feature, vertex in subject.feature_points.items():
        title = subject.feature_titles.get(feature)
        if title is None or feature in ("3.5", "3.6"):
            continue
        others = {
            other
            for name, other in subject.feature_titles.items()
            if name in subject.feature_points
            and np.linalg.norm(place(subject, name) - place(subject, feature)) < 1e-6 * subject.height
        }
        assert names.name(vertex) in {title, *others}


@pytest.mark.parametrize(
    ("side", "eye", "brow", "ear"), [("left", "3.7", "4.5", "10.1"), ("right", "3.12", "4.6", "10.2")]
)
def test_beside_eye_and_brow_is_the_temple_and_not_the_cheek(
    subject: Subject, side: str, eye: str, brow: str, ear: str
) -> None:
    names = PointNames(subject)
    corner, end, back = (place(subject, name) for name in (eye, brow, ear))
    for share in (0.35, 0.5):
        for height in (0.3, 0.8):
            position = corner + share * (back - corner)
            position[1] = corner[1] + height * (end[1] - corner[1])
            vertex = nearest(subject, position)
            if subject.vertices[vertex, 1] < corner[1] - 0.02 * subject.height:
                continue
            found = names.name(vertex)
            assert "cheek" not in found
            if found not in ("scalp", "forehead"):
                assert side in found


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (("4.5", "4.3"), "left brow"),
        (("4.3", "4.1"), "left brow"),
        (("4.6", "4.4"), "right brow"),
        (("4.4", "4.2"), "right brow"),
    ],
)
def test_a_place_on_a_brow_is_called_after_it_and_not_after_a_lid(
    subject: Subject, points: tuple[str, str], words: str
) -> None:
    names = PointNames(subject)
    begin, end = (place(subject, name) for name in points)
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        found = names.name(nearest(subject, begin + share * (end - begin)))
        assert words in found


def test_the_middle_of_the_face_has_no_side_and_the_mouth_is_at_the_mouth(subject: Subject) -> None:
    names = PointNames(subject)
    first, last = skin(subject)
    vertices = np.arange(first, last)
    middle = vertices[np.abs(subject.vertices[vertices, 0]) < 1e-4 * subject.height]
    lips = place(subject, "8.1")
    # What lies in the mouth is left out.
    for vertex in middle[subject.vertices[middle, 2] > lips[2] - 0.1 * subject.height].tolist():
        found = names.name(vertex)
        away = np.linalg.norm(subject.vertices[vertex] - lips) / subject.height
        if away > 0.3:
            assert "mouth" not in found
            assert "lip" not in found
        assert found != "face" or away > 0.3


def test_between_the_eyes_is_no_cheek(subject: Subject) -> None:
    names = PointNames(subject)
    left, right = place(subject, "3.11"), place(subject, "3.8")
    for share in (0.2, 0.35, 0.5, 0.65, 0.8):
        for up in (0.0, 0.02, 0.04):
            position = left + share * (right - left) + (0.0, up * subject.height, 0.02 * subject.height)
            assert "cheek" not in names.name(nearest(subject, position))


def test_both_sides_have_the_same_words(subject: Subject) -> None:
    names = PointNames(subject)
    for feature, title in subject.feature_titles.items():
        if "left" not in title or feature not in subject.feature_points:
            continue
        other = title.replace("left", "right")
        assert other in subject.feature_titles.values()
        vertex = subject.feature_points[feature]
        assert "right" not in names.name(vertex)
