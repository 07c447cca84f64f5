"""Strokes along features are recognised, from any view, in any size; strokes along none are not."""

import time
from collections.abc import Iterator
from functools import lru_cache

import numpy as np
import pytest

from faceposer.geometry.camera import Camera
from faceposer.geometry.mirror import mirrored_camera, mirrored_pixels
from faceposer.model.character_file import load_character
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.model.feature_curves import FEATURES
from faceposer.model.framing import face_view
from faceposer.sketch.curve_density import FeatureRows, visibility
from faceposer.sketch.recognition import DrawnStroke
from faceposer.sketch.training_poses import TrainingPoses
from faceposer.sketch.whole_stroke import WholeStrokeRecogniser

# Features that are drawn only where the mouth is open; all characters rest with a closed one.
CLOSED_MOUTH = {"inner upper lip", "inner lower lip"}
VIEWS = ("front", "three-quarter", "left")


@lru_cache(maxsize=4)
def fitted(name: str) -> tuple[FaceModel, WholeStrokeRecogniser, FeatureRows]:
    model = build_face_model(load_character(name))
    return model, WholeStrokeRecogniser.of(model, TrainingPoses.of(model, 120)), FeatureRows.of(model)


def camera_of(model: FaceModel, view: str = "front", height: int = 960) -> Camera:
    return face_view(model.character, view).camera((height, height))


def line_of(rows: FeatureRows, model: FaceModel, camera: Camera, feature: str, pose: np.ndarray) -> np.ndarray:
    track = rows.tracks[feature]
    return camera.project(rows.neutral[track.rows] + rows.jacobian[track.rows] @ pose)


def visible_features(rows: FeatureRows, camera: Camera) -> Iterator[str]:
    for name, share in visibility(rows, camera).items():
        if share > 0.9 and name not in CLOSED_MOUTH:
            yield name


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("name", ["man", "woman", "low", "creature"])
def test_features_are_recognised_from_every_view(name: str, view: str) -> None:
    model, recogniser, rows = fitted(name)
    camera, pose = camera_of(model, view), model.neutral()
    wrong = []
    for feature in visible_features(rows, camera):
        line = line_of(rows, model, camera, feature, pose)
        for stroke in (line, line[::-1]):
            found = recogniser.recognise(DrawnStroke(stroke, camera), pose)
            names = [candidate.feature for candidate in found.candidates]
            # The goblin's upper lip has no height.
            alike = {"mouth line", "outer upper lip"}
            if name == "creature" and feature in alike:
                names = [name for name in names if name not in alike - {feature}]
            if not found.accepted or names[0] != feature:
                wrong.append((feature, names))
    # From the side, lines lie on each other.
    assert len(wrong) <= (0 if view != "left" else 2), wrong


def test_matched_points_are_those_of_the_curve() -> None:
    model, recogniser, rows = fitted("man")
    camera, pose = camera_of(model), model.neutral()
    for feature in visible_features(rows, camera):
        line = line_of(rows, model, camera, feature, pose)
        best = recogniser.recognise(DrawnStroke(line[::-1], camera), pose).best
        assert best is not None
        names = [point.feature_point for point in best.points]
        assert names == list(FEATURES[feature].points), feature
        known = model.character.vertices[[model.character.feature_points[point] for point in names]]
        found = np.array([point.pixel for point in best.points])
        # A closed mouth's line lies between the two rows of points.
        limit = 12.0 if feature == "mouth line" else 8.0
        assert np.hypot(*(found - camera.project(known)).T).max() < limit, feature
        assert all(0.0 < point.probability <= 1.0 for point in best.points)


def test_image_size_and_zoom_change_nothing() -> None:
    model, recogniser, rows = fitted("man")
    pose = model.neutral()
    views = [
        face_view(model.character, "front"),
        face_view(model.character, "front").zoomed(1.7).panned(40, 20, (960, 960)),
    ]
    for feature in ("left brow", "outer upper lip", "right lower lid"):
        found = []
        for view, height in ((views[0], 960), (views[0], 240), (views[0], 3000), (views[1], 960)):
            camera = view.camera((height, height))
            candidate = recogniser.recognise(
                DrawnStroke(line_of(rows, model, camera, feature, pose), camera), pose
            ).best
            assert candidate is not None
            assert candidate.feature == feature
            found.append(candidate.probability)
        assert np.ptp(found[:3]) < 0.01
        assert np.ptp(found) < 0.2


def test_mirrored_strokes_are_of_mirrored_features() -> None:
    model, recogniser, rows = fitted("man")
    camera, pose = camera_of(model, "three-quarter"), model.neutral()
    other = mirrored_camera(camera)
    for feature in visible_features(rows, camera):
        line = line_of(rows, model, camera, feature, pose)
        best = recogniser.recognise(DrawnStroke(mirrored_pixels(line, camera), other), pose).best
        assert best is not None
        assert best.feature == FEATURES[feature].mirror


def test_closed_strokes_begin_anywhere() -> None:
    model, recogniser, rows = fitted("man")
    camera, pose = camera_of(model), model.neutral()
    for feature in ("mouth outline", "left eye outline", "right eye outline"):
        line = line_of(rows, model, camera, feature, pose)[:-1]
        for start in (0.1, 0.37, 0.8):
            turned = np.roll(line, -round(start * len(line)), axis=0)
            stroke = np.concatenate([turned, turned[: len(turned) // 10]])
            best = recogniser.recognise(DrawnStroke(stroke, camera), pose).best
            assert best is not None
            assert best.feature == feature
            assert [point.feature_point for point in best.points] == list(FEATURES[feature].points)


def test_pieces_match_only_their_own_points() -> None:
    model, recogniser, rows = fitted("man")
    camera, pose = camera_of(model), model.neutral()
    line = line_of(rows, model, camera, "outer lower lip", pose)
    candidates = recogniser.recognise(DrawnStroke(line[: len(line) // 2 + 2], camera), pose, feature="outer lower lip")
    assert candidates.best is not None
    names = {point.feature_point for point in candidates.best.points}
    assert {"8.4", "8.8"} <= names
    assert "8.3" not in names


def test_the_feature_can_be_given() -> None:
    model, recogniser, rows = fitted("man")
    camera, pose = camera_of(model), model.neutral()
    line = line_of(rows, model, camera, "left brow", pose)
    recognition = recogniser.recognise(DrawnStroke(line, camera), pose, feature="left upper lid")
    assert [candidate.feature for candidate in recognition.candidates] == ["left upper lid"]
    assert recognition.accepted


def test_an_open_mouth_has_two_lines() -> None:
    model, recogniser, rows = fitted("man")
    camera = camera_of(model)
    opened = model.coefficients_of({"jawOpen": 0.6})
    for feature in ("inner upper lip", "inner lower lip"):
        stroke = DrawnStroke(line_of(rows, model, camera, feature, opened), camera)
        best = recogniser.recognise(stroke, opened).best
        assert best is not None
        assert best.feature == feature


def test_what_was_drawn_tells_close_features_apart() -> None:
    model, recogniser, rows = fitted("man")
    camera = camera_of(model)
    raised = model.coefficients_of({"jawOpen": 0.5})
    lower = DrawnStroke(line_of(rows, model, camera, "outer lower lip", raised), camera, "outer lower lip")
    stroke = DrawnStroke(line_of(rows, model, camera, "inner lower lip", raised), camera)
    alone = recogniser.recognise(stroke, model.neutral())
    after = recogniser.recognise(stroke, model.neutral(), [lower])
    share = [sum(c.probability for c in found.candidates if c.feature == "inner lower lip") for found in (alone, after)]
    assert share[1] > share[0]
    assert after.best is not None
    assert after.best.feature == "inner lower lip"


def test_a_feature_can_be_drawn_again() -> None:
    model, recogniser, rows = fitted("man")
    camera = camera_of(model)
    up, down = (
        model.coefficients_of({"browInnerUp": 0.9, "browOuterUpLeft": 0.9}),
        model.coefficients_of({"browDownLeft": 0.9}),
    )
    first = DrawnStroke(line_of(rows, model, camera, "left brow", up), camera, "left brow")
    second = DrawnStroke(line_of(rows, model, camera, "left brow", down), camera)
    best = recogniser.recognise(second, up, [first]).best
    assert best is not None
    assert best.feature == "left brow"


def scribbles(camera: Camera) -> Iterator[np.ndarray]:
    t = np.linspace(0.0, 6.0 * np.pi, 200)[:, None]
    middle = np.array(camera.size) / 2.0
    yield middle + np.concatenate([120.0 * np.cos(t) + 8.0 * t, 90.0 * np.sin(t)], axis=1)
    yield middle + np.stack([np.arange(10) * 40.0 - 200.0, np.where(np.arange(10) % 2, 90.0, -90.0)], axis=1)
    yield np.array([[200.0, 150.0], [760.0, 800.0]])
    yield np.array([[480.0, 100.0], [480.0, 860.0]])
    yield middle + np.concatenate([60.0 * np.cos(t), 60.0 * np.sin(t)], axis=1) * (0.2 + t / 10.0)


def test_scribbles_are_not_accepted() -> None:
    model, recogniser, _ = fitted("man")
    camera = camera_of(model)
    for stroke in scribbles(camera):
        assert not recogniser.recognise(DrawnStroke(stroke, camera), model.neutral()).accepted


def test_strokes_off_the_face_are_not_accepted() -> None:
    model, recogniser, rows = fitted("man")
    camera = camera_of(model)
    line = line_of(rows, model, camera, "left brow", model.neutral())
    for offset in ((350.0, -250.0), (-600.0, 0.0), (0.0, 2000.0), (1e6, 1e6)):
        recognition = recogniser.recognise(DrawnStroke(line + offset, camera), model.neutral())
        assert not recognition.accepted
        assert recognition.best is None


@pytest.mark.parametrize(
    "pixels",
    [
        np.zeros((0, 2)),
        np.array([[400.0, 300.0]]),
        np.array([[400.0, 300.0], [400.0, 300.0]]),
        np.array([[400.0, 300.0], [401.0, 301.0], [400.0, 300.0]]),
        np.array([[np.nan, 300.0], [400.0, np.inf]]),
        np.array([[1e300, 300.0], [400.0, 1e300]]),
        np.random.default_rng(0).uniform(0.0, 960.0, (10_000, 2)),
        np.repeat([[480.0, 480.0]], 10_000, axis=0),
    ],
    ids=["none", "one", "same", "dot", "not finite", "huge", "many", "many the same"],
)
def test_degenerate_strokes_are_safe_and_fast(pixels: np.ndarray) -> None:
    model, recogniser, _ = fitted("man")
    camera = camera_of(model)
    recogniser.recognise(DrawnStroke(pixels, camera), model.neutral())
    began = time.process_time()
    recognition = recogniser.recognise(DrawnStroke(pixels, camera), model.neutral())
    assert time.process_time() - began < 0.2
    assert not recognition.accepted


def test_cameras_without_the_face_are_safe() -> None:
    model, recogniser, rows = fitted("man")
    camera = camera_of(model)
    behind = Camera(camera.rotation, -camera.translation, camera.focal, camera.size)
    line = line_of(rows, model, camera, "left brow", model.neutral())
    assert not recogniser.recognise(DrawnStroke(line, behind), model.neutral()).accepted


def test_probabilities_are_a_distribution() -> None:
    model, recogniser, rows = fitted("man")
    camera = camera_of(model)
    line = line_of(rows, model, camera, "outer upper lip", model.neutral()) + (0.0, 9.0)
    found = recogniser.recognise(DrawnStroke(line, camera), model.neutral())
    shares = [candidate.probability for candidate in found.candidates]
    assert shares == sorted(shares, reverse=True)
    assert sum(shares) <= 1.0 + 1e-9
    assert found.runner_up is not None


def test_a_character_without_feature_points_has_no_features() -> None:
    from dataclasses import replace

    character = replace(load_character("low"), feature_points={}, feature_titles={})
    model = build_face_model(character)
    recogniser = WholeStrokeRecogniser(model, np.zeros((2, model.n_coefficients)))
    stroke = DrawnStroke(np.array([[100.0, 100.0], [300.0, 120.0]]), camera_of(model))
    assert recogniser.recognise(stroke, model.neutral()).best is None


def test_ticks_and_zigzags_are_no_features() -> None:
    model, recogniser, rows = fitted("man")
    camera, rng = camera_of(model), np.random.default_rng(4)
    middle = camera.project(rows.middle[None])[0]
    accepted: dict[str, list[bool]] = {"tick": [], "zigzag": [], "huge": []}
    for length in (8.0, 12.0, 16.0, 24.0, 40.0, 60.0, 100.0):
        for _ in range(12):
            begin, angle = middle + rng.uniform(-200, 200, 2), rng.uniform(0.0, 2.0 * np.pi)
            tick = np.stack([begin, begin + length * np.array([np.cos(angle), np.sin(angle)])])
            accepted["tick"].append(recogniser.recognise(DrawnStroke(tick, camera), model.neutral()).accepted)
    for size in (10.0, 20.0, 40.0):
        for _ in range(12):
            across = np.linspace(0.0, rng.uniform(60.0, 200.0), 30)
            zigzag = middle + rng.uniform(-150, 100, 2) + np.stack([across, size * (np.arange(30) % 2)], axis=1)
            accepted["zigzag"].append(recogniser.recognise(DrawnStroke(zigzag, camera), model.neutral()).accepted)
    for size in (2e3, 1e5, 1e6):
        for _ in range(12):
            line = rng.uniform(-size, size, (2, 2))
            accepted["huge"].append(recogniser.recognise(DrawnStroke(line, camera), model.neutral()).accepted)
    assert {kind: float(np.mean(of_kind)) for kind, of_kind in accepted.items() if np.mean(of_kind) > 0.05} == {}


@pytest.mark.parametrize("feature", ["left brow", "right brow", "outer upper lip", "outer lower lip"])
def test_halves_of_features_are_recognised(feature: str) -> None:
    model, recogniser, rows = fitted("man")
    camera = camera_of(model)
    line = line_of(rows, model, camera, feature, model.neutral())
    for half in (line[: len(line) // 2 + 1], line[len(line) // 2 :]):
        best = recogniser.recognise(DrawnStroke(half, camera), model.neutral()).best
        assert best is not None
        assert best.feature == feature


def test_cameras_that_do_not_show_the_face_are_no_error() -> None:
    model, recogniser, rows = fitted("man")
    rng, usual = np.random.default_rng(11), camera_of(model)
    line = line_of(rows, model, usual, "right brow", model.neutral())
    for _ in range(150):
        axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        axes *= np.sign(np.linalg.det(axes))
        place = rng.normal(size=3) * 10 ** rng.uniform(-1, 3) + [0.0, 0.0, 10 ** rng.uniform(0, 4)]
        size = int(10 ** rng.uniform(0, 4)), int(10 ** rng.uniform(0, 4))
        camera = Camera(axes, place, float(10 ** rng.uniform(-1, 5)), size)
        stroke = rng.uniform(-1, 1, (rng.integers(2, 12), 2)) * 10 ** rng.uniform(0, 6) + np.array(size) / 2
        others = [DrawnStroke(line, camera, "right brow")]
        for named in (None, "left brow"):
            found = recogniser.recognise(DrawnStroke(stroke, camera), model.neutral(), others, named)
            for candidate in found.candidates:
                assert np.isfinite([*candidate.points[0].pixel, candidate.probability]).all()
