"""Augmentation does what it says, and statistics of known examples come out as they are."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.expression_statistics import load_expression_statistics
from faceposer.model.muscles import muscle_of_shape
from faceposer.training.capture import Capture
from faceposer.training.expressions import Recipe, augment, couple, fit_statistics, learn, mirror_indices

RECIPE = Recipe(n_examples=2000, n_components=3, n_factors=2)
NAMES = list(ARKIT_SHAPES)


def performance(n_frames: int = 400) -> np.ndarray:
    """Frames in which a smile always comes with a blink, and the tongue never moves."""
    rng = np.random.default_rng(0)
    frames = np.zeros((n_frames, len(NAMES)))
    smile = rng.random(n_frames)
    for name in ("mouthSmileLeft", "mouthSmileRight"):
        frames[:, NAMES.index(name)] = 0.9 * smile
    frames[:, NAMES.index("eyeBlinkLeft")] = smile
    frames[:, NAMES.index("jawOpen")] = rng.random(n_frames)
    return frames


def correlation(examples: np.ndarray, one: str, other: str) -> float:
    return float(np.corrcoef(examples[:, NAMES.index(one)], examples[:, NAMES.index(other)])[0, 1])


def test_mirrored_names() -> None:
    indices = mirror_indices(NAMES)
    np.testing.assert_array_equal(indices[indices], np.arange(len(NAMES)))
    assert NAMES[indices[NAMES.index("mouthLeft")]] == "mouthRight"
    assert NAMES[indices[NAMES.index("jawOpen")]] == "jawOpen"


def test_augmentation_breaks_coincidences_and_keeps_what_belongs_together() -> None:
    frames = performance()
    examples = augment(frames, NAMES, RECIPE)
    assert examples.shape == (2000, 52)
    assert examples.min() >= 0.0
    assert examples.max() <= 1.0
    assert correlation(frames, "mouthSmileLeft", "eyeBlinkLeft") > 0.99
    assert correlation(examples, "mouthSmileLeft", "eyeBlinkLeft") < 0.7
    assert correlation(examples, "mouthSmileLeft", "mouthSmileRight") > 0.7
    assert np.ptp(examples[:, NAMES.index("tongueOut")]) > 0.3
    assert examples[:, NAMES.index("eyeBlinkRight")].mean() == pytest.approx(
        examples[:, NAMES.index("eyeBlinkLeft")].mean(), rel=0.2
    )
    np.testing.assert_array_equal(examples, augment(frames, NAMES, RECIPE))


def test_without_any_share_augmentation_only_mirrors_and_scales() -> None:
    recipe = replace(RECIPE, halves=0.0, sides=0.0, extras=0.0)
    examples = augment(performance(), NAMES, recipe)
    ratio = examples[:, NAMES.index("mouthSmileLeft")] - examples[:, NAMES.index("mouthSmileRight")]
    np.testing.assert_allclose(ratio, 0.0, atol=1e-12)
    assert not examples[:, NAMES.index("tongueOut")].any()


def test_statistics_have_the_moments_of_the_examples() -> None:
    examples = augment(performance(), NAMES, RECIPE)
    statistics = fit_statistics(examples, NAMES, RECIPE, "made up")
    assert statistics.weights.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(statistics.mean, examples.mean(axis=0))
    np.testing.assert_allclose(statistics.weights @ statistics.means, statistics.mean, atol=0.01)
    np.testing.assert_allclose(statistics.covariance, np.cov(examples.T), atol=1e-4)
    assert np.linalg.eigvalsh(statistics.covariances).min() > 0.0


def test_learning_takes_each_performers_rest() -> None:
    frames = performance()
    rested, shifted = (learn([Capture(tuple(NAMES), frames + offset)], RECIPE, "made up") for offset in (0.0, 0.05))
    np.testing.assert_allclose(rested.mean, shifted.mean, atol=1e-6)
    with pytest.raises(ValueError, match="at least one capture"):
        learn([], RECIPE)


def test_captures_of_different_shapes_are_learned_together() -> None:
    frames = performance()
    without = [name for name in NAMES if name not in ("tongueOut", "mouthSmileRight", "cheekPuff")]
    columns = [NAMES.index(name) for name in without]
    jaw = Capture(("tongueOut", "jawOpen"), frames[:, [NAMES.index("jawOpen")] * 2])
    recipe = replace(RECIPE, extras=0.0, jump=np.inf)
    statistics = learn([Capture(tuple(without), frames[:, columns]), jaw], recipe)
    # cheekPuff is in neither; mouthSmileRight learns from the mirrored left.
    assert statistics.shape_names == tuple(name for name in ARKIT_SHAPES if name != "cheekPuff")
    mean = dict(zip(statistics.shape_names, statistics.mean, strict=True))
    assert mean["mouthSmileRight"] == pytest.approx(mean["mouthSmileLeft"], rel=0.2)
    # In half of the frames the tongue rests, since their capture does not have it.
    assert mean["tongueOut"] == pytest.approx(0.5 * mean["jawOpen"], rel=0.1)


def test_statistics_survive_their_file(tmp_path: Path) -> None:
    statistics = fit_statistics(augment(performance(), NAMES, RECIPE), NAMES, RECIPE, "made up")
    path = tmp_path / "statistics.npz"
    statistics.save(path)
    loaded = load_expression_statistics(path)
    assert loaded.shape_names == statistics.shape_names
    assert loaded.credits == "made up"
    for name in ("weights", "means", "covariances", "mean", "covariance"):
        np.testing.assert_allclose(getattr(loaded, name), getattr(statistics, name), atol=1e-6)
    assert [child.name for child in tmp_path.iterdir()] == ["statistics.npz"]


@pytest.mark.parametrize("damage", ["missing", "text", "cut", "flipped", "other"])
def test_damaged_statistics_are_refused_in_one_sentence(tmp_path: Path, damage: str) -> None:
    path = tmp_path / "statistics.npz"
    fit_statistics(augment(performance(), NAMES, RECIPE), NAMES, RECIPE, "").save(path)
    data = path.read_bytes()
    if damage == "missing":
        path.unlink()
    elif damage == "text":
        path.write_text("weights")
    elif damage == "cut":
        path.write_bytes(data[: len(data) // 2])
    elif damage == "flipped":
        middle = len(data) // 2
        path.write_bytes(data[:middle] + bytes(255 - byte for byte in data[middle : middle + 64]) + data[middle + 64 :])
    else:
        np.savez(path, weights=np.ones(3))
    with pytest.raises(FacePoserError, match=r"statistics\.npz'") as caught:
        load_expression_statistics(path)
    assert "\n" not in str(caught.value)


def test_shipped_statistics_cover_every_shape() -> None:
    statistics = load_expression_statistics()
    assert statistics.shape_names == ARKIT_SHAPES
    assert (np.diag(statistics.covariance) > 5e-4).all()
    assert "MIT" in statistics.credits


def test_regions_are_coupled_only_where_the_take_says_so_throughout() -> None:
    rng = np.random.default_rng(4)
    frames = np.zeros((600, len(NAMES)))
    jaw = rng.random(600)
    frames[:, NAMES.index("jawOpen")] = jaw
    frames[:, NAMES.index("noseSneerLeft")] = frames[:, NAMES.index("noseSneerRight")] = 0.8 * jaw
    frames[:, NAMES.index("browInnerUp")] = rng.random(600)
    plain = replace(RECIPE, halves=0.0, sides=0.0, extras=0.0)
    coupling = couple(frames, NAMES, plain)
    jaw_row = coupling[NAMES.index("jawOpen")]
    # A brow is up half the time whatever the jaw does: that much, and no more, is told.
    assert jaw_row[NAMES.index("noseSneerLeft")] > 0.7
    assert jaw_row[NAMES.index("browInnerUp")] < 0.5
    np.testing.assert_allclose(np.diag(coupling), 1.0)


def test_regions_and_coupling_are_saved(tmp_path: Path) -> None:
    shipped = load_expression_statistics()
    assert set(shipped.regions) == {muscle_of_shape(name) for name in ARKIT_SHAPES}
    shipped.save(tmp_path / "a.npz")
    again = load_expression_statistics(tmp_path / "a.npz")
    assert again.regions == shipped.regions
    np.testing.assert_allclose(again.factors, shipped.factors, atol=1e-6)
