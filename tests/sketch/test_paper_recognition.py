"""The paper's recognition of strokes."""

import numpy as np
import pytest

from faceposer.geometry.alignment import Similarity
from faceposer.model.face_model import FaceModel
from faceposer.model.feature_curves import FEATURES, MIRRORED_POINTS
from faceposer.sketch.paper_recognition import FAR, PaperRecogniser, path_lengths
from faceposer.sketch.polyline import evenly
from faceposer.sketch.recognition import DrawnStroke
from faceposer.sketch.training_poses import TrainingPoses
from tests.sketch.drawing import camera_of, mirrored_camera, moved_world, stroke_along, tilted

_DISTINCT = (
    *("left brow", "right brow", "left cheek line", "right cheek line"),
    *("left nose wing", "right nose wing", "left eye outline", "right eye outline"),
)


@pytest.fixture(scope="module")
def recogniser(low: FaceModel) -> PaperRecogniser:
    return PaperRecogniser(low, TrainingPoses.of(low))


@pytest.mark.parametrize("view", ["front", "three-quarter", "tilted"])
def test_exact_strokes_are_recognised(view: str, low: FaceModel, recogniser: PaperRecogniser) -> None:
    camera = camera_of(low, "front" if view == "tilted" else view)
    if view == "tilted":
        camera = tilted(camera, -20.0, 15.0, 40.0, low.character.vertices.mean(axis=0).astype(np.float64))
    right = 0
    for feature in FEATURES:
        stroke = stroke_along(low, low.neutral(), feature, camera)
        found = recogniser.recognise(stroke, low.neutral())
        right += found.best is not None and found.best.feature == feature
        if feature not in _DISTINCT:
            continue
        assert found.best is not None
        assert found.best.feature == feature
        # No feature point is missing, and each is nearest to its own corner of the stroke or to a neighbour.
        assert {match.feature_point for match in found.best.points} == set(FEATURES[feature].points)
        chain = FEATURES[feature].chains[0]
        for match in found.best.points:
            corner = int(np.linalg.norm(stroke.pixels[: len(chain)] - match.pixel, axis=1).argmin())
            apart = abs(corner - chain.index(match.feature_point))
            assert min(apart, len(chain) - apart if FEATURES[feature].closed else apart) <= 1, feature
    assert right >= 0.7 * len(FEATURES)


def test_either_direction_gives_the_same_matches(low: FaceModel, recogniser: PaperRecogniser) -> None:
    stroke = stroke_along(low, low.neutral(), "outer upper lip", camera_of(low))
    forwards = recogniser.recognise(stroke, low.neutral()).best
    backwards = recogniser.recognise(DrawnStroke(stroke.pixels[::-1], stroke.camera), low.neutral()).best
    assert forwards is not None
    assert backwards is not None
    assert forwards.feature == backwards.feature
    assert [m.feature_point for m in forwards.points] == [m.feature_point for m in backwards.points]
    pixels = [np.array([m.pixel for m in found.points]) for found in (forwards, backwards)]
    assert np.abs(pixels[0] - pixels[1]).max() < 12.0


def test_a_known_feature_is_kept(low: FaceModel, recogniser: PaperRecogniser) -> None:
    stroke = stroke_along(low, low.neutral(), "outer upper lip", camera_of(low))
    found = recogniser.recognise(stroke, low.neutral(), feature="inner lower lip")
    assert found.accepted
    assert [candidate.feature for candidate in found.candidates] == ["inner lower lip"]
    assert recogniser.recognise(stroke, low.neutral(), feature="tail").candidates == ()


def test_strokes_far_from_every_feature_are_refused(low: FaceModel, recogniser: PaperRecogniser) -> None:
    camera = camera_of(low)
    rng = np.random.default_rng(0)
    brow = stroke_along(low, low.neutral(), "left brow", camera).pixels
    scribble = brow.mean(axis=0) + 120.0 * rng.normal(size=(25, 2))
    for pixels in (brow - [0.0, 130.0], scribble[:4]):
        found = recogniser.recognise(DrawnStroke(pixels, camera), low.neutral())
        assert not found.accepted
        assert found.best is None
        assert found.runner_up is found.candidates[0]
    for pixels, reason in ((scribble, "longer"), (np.tile([[20.0, 20.0]], (2, 1)), "no length")):
        found = recogniser.recognise(DrawnStroke(pixels, camera), low.neutral())
        assert not found.accepted
        assert reason in found.reason


def test_probabilities(low: FaceModel, recogniser: PaperRecogniser) -> None:
    found = recogniser.recognise(stroke_along(low, low.neutral(), "right brow", camera_of(low)), low.neutral())
    chances = [candidate.probability for candidate in found.candidates]
    assert chances == sorted(chances, reverse=True)
    assert 0.5 < sum(chances) <= 1.0 + 1e-9
    assert all(0.0 <= match.probability <= 1.0 for c in found.candidates for match in c.points)


def test_a_turned_character_is_recognised_alike(low: FaceModel, recogniser: PaperRecogniser) -> None:
    angle = 0.7
    turn = np.array([[np.cos(angle), 0.0, np.sin(angle)], [0.0, 1.0, 0.0], [-np.sin(angle), 0.0, np.cos(angle)]])
    turned = moved_world(low, turn, {})
    other = PaperRecogniser(turned, TrainingPoses.of(turned))
    camera = camera_of(low, "three-quarter")
    followed = camera.following(Similarity(turn, np.zeros(3), np.array(1.0)))
    for feature in ("left brow", "outer lower lip", "inner upper lip", "right eye outline"):
        stroke = stroke_along(low, low.neutral(), feature, camera)
        a = recogniser.recognise(stroke, low.neutral())
        b = other.recognise(DrawnStroke(stroke.pixels, followed), turned.neutral())
        assert [c.feature for c in a.candidates[:3]] == [c.feature for c in b.candidates[:3]]
        places = [[(m.feature_point, m.pixel) for m in each.candidates[0].points] for each in (a, b)]
        assert places[0] == places[1]
        assert a.candidates[0].probability == pytest.approx(b.candidates[0].probability, abs=0.02)


def test_mirrored_input_gives_mirrored_output(
    low: FaceModel, recogniser: PaperRecogniser, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = MIRRORED_POINTS
    mirror = np.diag([-1.0, 1.0, 1.0])
    world = moved_world(low, mirror, names)
    other = PaperRecogniser(world, TrainingPoses.of(world))
    # Polygons that turn round are split otherwise, so that the same random choice gives other samples of the surface.
    for name, sign in (
        ("_rows", [[-1.0], [1.0], [1.0]]),
        ("_neutral", [-1.0, 1.0, 1.0]),
        ("_normals", [-1.0, 1.0, 1.0]),
    ):
        monkeypatch.setattr(other._surface, name, getattr(recogniser._surface, name) * sign)
    camera = camera_of(low, "three-quarter")
    seen = mirrored_camera(camera)
    for feature in ("left brow", "right eye outline", "mouth outline", "right cheek line"):
        stroke = stroke_along(low, low.neutral(), feature, camera)
        flipped = DrawnStroke(np.array([camera.size[0], 0.0]) + stroke.pixels * [-1.0, 1.0], seen)
        a = recogniser.recognise(stroke, low.neutral()).candidates[0]
        b = other.recognise(flipped, world.neutral()).candidates[0]
        assert b.feature == FEATURES[a.feature].mirror
        expected = {names[m.feature_point]: (camera.size[0] - m.pixel[0], m.pixel[1]) for m in a.points}
        assert {m.feature_point: pytest.approx(m.pixel, abs=1e-6) for m in b.points} == expected


def test_path_lengths() -> None:
    names = ("3.11", "3.1", "3.7", "3.3", "8.4", "8.3", "5.1")
    lengths = path_lengths((*names, *(n for n in FEATURES["mouth outline"].points if n not in names), "5.3"))
    at = {name: i for i, name in enumerate(names)}
    # As in the paper: 2 between the corners of an eye, 1 between either corner and the top.
    assert lengths[at["3.11"], at["3.7"]] == 2
    assert lengths[at["3.11"], at["3.1"]] == lengths[at["3.7"], at["3.1"]] == 1
    assert lengths[at["3.1"], at["3.3"]] == 2
    assert lengths[at["8.4"], at["8.3"]] == 4
    assert lengths[at["5.1"], at["8.3"]] == 1
    assert lengths[at["3.1"], at["8.4"]] == FAR
    assert np.array_equal(lengths, lengths.T)


def test_resampling_keeps_the_ends() -> None:
    line = np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [1.0, 3.0]])
    even = evenly(line, 9)
    assert even[[0, -1]] == pytest.approx(line[[0, -1]])
    assert np.linalg.norm(np.diff(even, axis=0), axis=1) == pytest.approx(0.5, rel=0.01)
    assert evenly(np.zeros((3, 2)), 5) == pytest.approx(np.zeros((5, 2)))
