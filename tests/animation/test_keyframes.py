"""Keys, their edits, and the motion between them."""

import time
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from faceposer.animation.keyframes import INBETWEENS, LONGEST, Key, Keyframes, KeyframesJson
from faceposer.errors import FacePoserError
from faceposer.files.json_documents import convert
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance

FRAMES = (0, 9, 20, 33, 50)


def pose(model: FaceModel, **weights: float) -> NDArray[np.float64]:
    return model.coefficients_of(weights)


def random_keys(model: FaceModel, frames: tuple[int, ...], seed: int = 0, **settings: object) -> Keyframes:
    rng = np.random.default_rng(seed)
    keys = []
    for frame in frames:
        weights = rng.random(len(model.character.shape_names)) * (rng.random(len(model.character.shape_names)) < 0.3)
        keys.append(Key.of(frame, model.coefficients_of(weights)))
    return Keyframes(tuple(keys), **settings)  # type: ignore[arg-type]


@pytest.mark.parametrize("inbetweens", INBETWEENS)
def test_the_motion_passes_through_the_keys(model: FaceModel, inbetweens: str) -> None:
    for loop in (False, True):
        keyframes = random_keys(model, FRAMES, loop=loop, inbetweens=inbetweens)
        performance = keyframes.performance(model)
        assert len(performance) == 60
        assert performance.rate == 30.0
        for key in keyframes.keys:
            np.testing.assert_array_equal(performance.coefficients[key.frame], key.pose)


@pytest.mark.parametrize("loop", [False, True])
def test_no_weight_leaves_the_range_between_two_keys(model: FaceModel, loop: bool) -> None:
    directions = model.subspace.directions
    for seed in range(8):
        keyframes = random_keys(model, FRAMES, seed, loop=loop)
        for first, second in zip(keyframes.keys, keyframes.keys[1:], strict=False):
            frames = np.linspace(first.frame, second.frame, 40)
            weights = keyframes.sampled(model, frames) @ directions.T
            ends = np.stack([first.pose, second.pose]) @ directions.T
            # What the subspace leaves out is all that can be beyond.
            assert (weights - ends.max(axis=0)).max() < 0.02
            assert (ends.min(axis=0) - weights).max() < 0.02


@pytest.mark.parametrize("inbetweens", INBETWEENS)
def test_the_motion_is_smooth_and_rests_at_its_ends(model: FaceModel, inbetweens: str) -> None:
    keyframes = random_keys(model, FRAMES, inbetweens=inbetweens)
    step = 1e-4
    for frame in FRAMES[1:-1]:
        before, here, after = keyframes.sampled(model, [frame - step, frame, frame + step])
        # No kink: the velocity on both sides of a key agrees.
        np.testing.assert_allclose((here - before) / step, (after - here) / step, atol=1e-2)
    for frame, inside in ((FRAMES[0], step), (FRAMES[-1], -step)):
        ends = keyframes.sampled(model, [frame, frame + inside])
        assert np.abs(np.diff(ends, axis=0)).max() / step < 1e-2
    np.testing.assert_array_equal(keyframes.sampled(model, [FRAMES[-1] + 5.0])[0], keyframes.keys[-1].pose)


@pytest.mark.parametrize("inbetweens", INBETWEENS)
def test_a_loop_runs_smoothly_through_its_end(model: FaceModel, inbetweens: str) -> None:
    keyframes = random_keys(model, FRAMES, loop=True, inbetweens=inbetweens)
    np.testing.assert_allclose(keyframes.sampled(model, [60.0])[0], keyframes.keys[0].pose, atol=1e-12)
    np.testing.assert_allclose(keyframes.sampled(model, [61.5]), keyframes.sampled(model, [1.5]), atol=1e-12)
    between = keyframes.sampled(model, [55.0])[0]
    assert np.abs(between - keyframes.keys[-1].pose).max() > 1e-2, "it is on its way back to the first key"
    before, here, after = keyframes.sampled(model, [60.0 - 1e-4, 60.0, 60.0 + 1e-4])
    np.testing.assert_allclose(here - before, after - here, atol=1e-6)
    # A key after the end is not played, and does not count.
    longer = keyframes.with_key(70, pose(model, jawOpen=1.0))
    np.testing.assert_array_equal(longer.performance(model).coefficients, keyframes.performance(model).coefficients)


def test_feature_points_run_through_keys_where_weights_rest(model: FaceModel) -> None:
    # The jaw opens half at the second key; at the third it opens no wider, and the spline swings beyond.
    poses = [pose(model, jawOpen=value) for value in (0.0, 0.6, 0.6, 0.0)]
    keys = tuple(Key.of(frame, one) for frame, one in zip((0, 10, 20, 30), poses, strict=True))
    ours = Keyframes(keys, length=31)
    points = replace(ours, inbetweens="feature points")
    jaw = model.character.shape_names.index("jawOpen")
    held = np.arange(11, 20)
    np.testing.assert_allclose(model.weights_of(ours.sampled(model, held)[4])[jaw], 0.6, atol=0.02)
    assert model.weights_of(points.sampled(model, held)[4])[jaw] > 0.65
    assert not points.same(ours)
    assert points.reduced(model, 0.02).inbetweens == "feature points"


def test_a_frame_by_feature_points_is_quick(model: FaceModel) -> None:
    keyframes = random_keys(model, FRAMES, length=600, inbetweens="feature points")
    keyframes.sampled(model, [0])
    began = time.process_time()
    keyframes.performance(model)
    assert (time.process_time() - began) / keyframes.length < 2e-3


def test_none_one_and_two_keys(model: FaceModel) -> None:
    smile = pose(model, mouthSmileLeft=0.5)
    assert not Keyframes(length=3).performance(model).coefficients.any()
    one = Keyframes(length=3, loop=True).with_key(1, smile)
    np.testing.assert_array_equal(one.performance(model).coefficients, np.stack([smile] * 3))
    two = Keyframes(length=11).with_key(0, model.neutral()).with_key(10, smile)
    shares = two.performance(model).coefficients @ smile / (smile @ smile)
    assert (np.diff(shares) > 0).all()
    assert shares[1] < 0.05, "it begins slowly"
    assert shares[5] == pytest.approx(0.5)


def test_edits_leave_the_original_alone(model: FaceModel) -> None:
    keyframes = random_keys(model, (0, 10, 20, 30))
    poses = {key.frame: key.pose for key in keyframes.keys}
    moved = keyframes.moved({10, 20}, 5)
    assert moved.frames == (0, 15, 25, 30)
    assert moved.at(15) is not None
    assert moved.at(15).pose is poses[10]
    assert keyframes.moved({20}, 10).frames == (0, 10, 30), "it takes the place of the key that lies there"
    assert keyframes.moved({20}, 10).at(30).pose is poses[20]
    assert keyframes.moved({10}, -50).frames == (0, 20, 30), "no key is before the first frame"
    assert keyframes.copied({0, 10}, 40).frames == (0, 10, 20, 30, 40, 50)
    assert keyframes.copied({0, 10}, 10).at(20).pose is poses[10]
    assert keyframes.without({0, 30}).frames == (10, 20)
    assert keyframes.with_key(10, np.zeros(3)).frames == keyframes.frames
    assert keyframes.copied({30}, LONGEST).frames[-1] == LONGEST - 1
    assert keyframes.frames == (0, 10, 20, 30)
    assert [keyframes.next_frame(10), keyframes.previous_frame(10)] == [20, 0]
    assert [keyframes.next_frame(30), keyframes.previous_frame(0)] == [None, None]
    with pytest.raises(ValueError, match="read-only"):
        keyframes.keys[0].pose[0] = 1.0
    assert keyframes.same(random_keys(model, (0, 10, 20, 30)))
    assert not keyframes.same(moved)
    assert not keyframes.same(None)


def test_few_keys_tell_of_all_frames(model: FaceModel) -> None:
    few = random_keys(model, (0, 12, 25, 40))
    performance = few.performance(model)
    dense = Keyframes.of_performance(performance)
    assert dense.frames == tuple(range(60))
    reduced = dense.reduced(model, 0.02)
    assert len(reduced.keys) < 16
    assert {0, 59} <= set(reduced.frames)
    off = (reduced.performance(model).coefficients - performance.coefficients) @ model.subspace.directions.T
    assert np.abs(off).max() <= 0.02
    assert len(dense.reduced(model, 0.2).keys) < len(reduced.keys)
    with pytest.raises(FacePoserError, match="100001 frames"):
        Keyframes.of_performance(Performance(np.zeros((LONGEST + 1, 1)), 30.0))


def test_wrong_animations_are_refused_with_their_place(model: FaceModel) -> None:
    good = random_keys(model, (0, 10), loop=True)
    again = convert(good.to_json(), KeyframesJson, "animation").keyframes()
    assert again.same(good)
    assert "inbetweens" not in good.to_json(), "files are as they were"
    points = replace(good, inbetweens="feature points")
    assert convert(points.to_json(), KeyframesJson, "animation").keyframes().same(points)
    for change, expected in (
        ({"rate": 0}, "animation.rate"),
        ({"length": 0}, "animation.length"),
        ({"length": LONGEST + 1}, "animation.length"),
        ({"loop": 1}, "animation.loop"),
        ({"keys": 3}, "animation.keys"),
        ({"speed": 3}, "'speed'"),
        ({"inbetweens": "points"}, "animation.inbetweens"),
        ({"keys": [{"frame": -1, "coefficients": []}]}, r"animation.keys\[0\].frame"),
        ({"keys": [{"frame": LONGEST, "coefficients": []}]}, r"animation.keys\[0\].frame"),
        ({"keys": [{"frame": 1, "coefficients": ["a"]}]}, r"animation.keys\[0\].coefficients\[0\]"),
        ({"keys": [{"frame": 1, "coefficients": [0]}] * 2}, r"animation.keys\[1\].frame must be greater than 1"),
    ):
        with pytest.raises(FacePoserError, match=expected):
            convert(good.to_json() | change, KeyframesJson, "animation")
    for wrong in (
        {"rate": -1.0},
        {"inbetweens": "points"},
        {"length": 0},
        {"keys": (Key.of(3, [0.0]), Key.of(3, [0.0]))},
    ):
        with pytest.raises(ValueError, match=r".+"):
            Keyframes(**wrong)  # type: ignore[arg-type]
