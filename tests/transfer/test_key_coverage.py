"""Coverage of long animations, and keys that are chosen from them."""

import tracemalloc

import numpy as np
import pytest

from faceposer.model.face_model import FaceModel
from faceposer.progress import CancelledError, Progress
from faceposer.transfer import key_coverage
from faceposer.transfer.examples import ExampleTransfer, KeyPair
from faceposer.transfer.key_coverage import chosen_frames, coverage, helpful_frames
from faceposer.transfer.key_parameters import Regions


def transfer_by_keys(low: FaceModel, regions: Regions) -> ExampleTransfer:
    poses = [low.coefficients_of({name: 0.8}) for name in ("jawOpen", "mouthSmileLeft", "browDownLeft", "eyeBlinkLeft")]
    return ExampleTransfer(low, low, [KeyPair(str(i), pose, pose) for i, pose in enumerate(poses)], regions=regions)


def test_coverage_in_blocks_is_that_of_all_frames(low: FaceModel, monkeypatch: pytest.MonkeyPatch) -> None:
    transfer = transfer_by_keys(low, "halves")
    poses = np.random.default_rng(2).normal(scale=0.5, size=(40, low.n_coefficients))
    whole, frames = coverage(transfer, poses), helpful_frames(transfer, poses, 4, (7,))
    monkeypatch.setattr(key_coverage, "_BLOCK", 9)
    parts = coverage(transfer, poses)
    for name in ("distances", "motions", "strengths"):
        np.testing.assert_allclose(getattr(parts, name), getattr(whole, name), rtol=1e-9)
    again = helpful_frames(transfer, poses, 4, (7,))
    assert [frame.frame for frame in again] == [frame.frame for frame in frames]
    np.testing.assert_allclose([frame.missed for frame in again], [frame.missed for frame in frames], rtol=1e-9)
    with pytest.raises(CancelledError):
        coverage(transfer, poses, Progress(cancelled=lambda: True))


def test_long_animations_need_little_memory(low: FaceModel) -> None:
    transfer = transfer_by_keys(low, "whole")
    poses = np.zeros((20_000, low.n_coefficients))
    poses[:, 0] = np.linspace(0.0, 1.0, len(poses))
    tracemalloc.start()
    try:
        coverage(transfer, poses)
        # Displacements of all points in all frames alone are more.
        assert tracemalloc.get_traced_memory()[1] < 0.5 * 8 * len(poses) * 3 * len(transfer.points)
    finally:
        tracemalloc.stop()


def test_frames_are_chosen_by_the_threshold_of_the_keys(low: FaceModel) -> None:
    wide, hint = low.coefficients_of({"jawOpen": 1.0}), low.coefficients_of({"mouthSmileLeft": 0.3})
    keys, poses = np.array([wide, hint]), np.array([0.5 * wide, 0.5 * hint])
    # Both are combinations of the keys, and the first is the farther one; but a threshold may drop the second key.
    assert chosen_frames(low, keys, poses, 1)[0].frame == 0
    assert chosen_frames(low, keys, poses, 1, threshold=0.3)[0].frame == 1
