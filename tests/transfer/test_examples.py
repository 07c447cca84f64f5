"""Cloning by examples: at a key the clone is the key, and in between the expressions of the source follow."""

from dataclasses import replace

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.model.face_model import FaceModel
from faceposer.transfer.examples import ExampleTransfer, KeyPair
from faceposer.transfer.key_coverage import chosen_frames, coverage, helpful_frames
from faceposer.transfer.key_parameters import PAPER_POINTS, Regions, grouped
from faceposer.transfer.region_blending import region_projections, region_shares
from faceposer.transfer.transfer import make_transfer

SMILE = {"mouthSmileLeft": 0.9, "mouthSmileRight": 0.9}
BROWS = {"browInnerUpLeft": 1.0, "browInnerUpRight": 1.0, "browOuterUpLeft": 1.0, "browOuterUpRight": 1.0}
OPEN = {"jawOpen": 0.7}
PUCKER = {"mouthPucker": 0.8}
KEYS = {"smile": SMILE, "brows": BROWS, "open": OPEN, "pucker": PUCKER}


@pytest.fixture(scope="module")
def pairs(low: FaceModel, creature: FaceModel) -> list[KeyPair]:
    """Keys of the low head with answers of the creature that are nothing like it."""
    rng = np.random.default_rng(5)
    spread = np.sqrt(creature.subspace.variances)
    return [
        KeyPair(name, low.coefficients_of(weights), rng.normal(size=creature.n_coefficients) * spread)
        for name, weights in KEYS.items()
    ]


def apart(model: FaceModel, one: np.ndarray, other: np.ndarray) -> float:
    return float(np.abs(model.instance(one) - model.instance(other)).max())


@pytest.mark.parametrize("points", [None, PAPER_POINTS])
def test_at_a_key_the_clone_is_the_key(
    low: FaceModel, creature: FaceModel, pairs: list[KeyPair], points: tuple[str, ...] | None
) -> None:
    transfer = ExampleTransfer(low, creature, pairs, points)
    for pair in pairs:
        assert apart(creature, transfer.pose(pair.source), pair.target) < 1e-4
    assert apart(creature, transfer.pose(low.neutral()), creature.neutral()) < 1e-4


def test_half_an_expression_is_about_half_the_key(low: FaceModel, creature: FaceModel, pairs: list[KeyPair]) -> None:
    transfer = ExampleTransfer(low, creature, pairs)
    half = transfer.pose(0.5 * pairs[0].source)
    np.testing.assert_allclose(half, 0.5 * pairs[0].target, atol=0.15 * np.abs(pairs[0].target).max())


def test_a_known_linear_relation_is_recovered_on_poses_that_are_no_keys(low: FaceModel, creature: FaceModel) -> None:
    rng = np.random.default_rng(2)
    relation = 0.2 * rng.normal(size=(low.n_coefficients, creature.n_coefficients))
    sources = [low.coefficients_of(weights) for weights in KEYS.values()]
    keys = [KeyPair(str(i), s, s @ relation) for i, s in enumerate(sources)]
    new = rng.uniform(0.0, 1.0, size=(6, len(sources))) @ np.array(sources)
    for threshold, error in ((1e-12, 1e-6), (None, 1e-2)):
        found = ExampleTransfer(low, creature, keys, threshold=threshold).poses(new)
        np.testing.assert_allclose(found, new @ relation, atol=error * np.abs(new @ relation).max())


def test_errors_of_many_keys_are_damped_and_exact_keys_are_followed(low: FaceModel) -> None:
    rng = np.random.default_rng(7)
    count = len(low.character.shape_names)
    weights = rng.uniform(size=(60, count)) * (rng.uniform(size=(60, count)) < 0.25)
    poses = np.array([low.coefficients_of(row) for row in weights])
    wrong = np.array([low.coefficients_of(row) for row in weights * (1.0 + 0.2 * rng.normal(size=weights.shape))])
    new = np.array([low.coefficients_of(rng.uniform(size=count) * (rng.uniform(size=count) < 0.2)) for _ in range(12)])

    def error(targets: np.ndarray, threshold: float | None) -> float:
        keys = [KeyPair(str(i), pose, target) for i, (pose, target) in enumerate(zip(poses, targets, strict=True))]
        return float(np.linalg.norm(ExampleTransfer(low, low, keys, threshold=threshold).poses(new) - new))

    assert error(poses, None) < 0.2 * error(poses, 1e-3)
    assert error(wrong, None) < 0.5 * error(wrong, 1e-8)
    assert error(wrong, None) < 1.2 * min(error(wrong, threshold) for threshold in (1e-3, 1e-4, 1e-5))


def test_a_pair_called_neutral_is_the_base(low: FaceModel, creature: FaceModel, pairs: list[KeyPair]) -> None:
    base = KeyPair("neutral", low.coefficients_of({"eyeBlinkLeft": 0.3}), 0.1 * pairs[0].target)
    transfer = ExampleTransfer(low, creature, [base, *pairs])
    assert len(transfer.pairs) == len(pairs)
    assert apart(creature, transfer.pose(base.source), base.target) < 1e-4
    assert apart(creature, transfer.pose(pairs[1].source), pairs[1].target) < 1e-4


def test_one_key_is_enough(low: FaceModel, creature: FaceModel, pairs: list[KeyPair]) -> None:
    transfer = ExampleTransfer(low, creature, pairs[:1])
    np.testing.assert_allclose(transfer.pose(2.0 * pairs[0].source), 2.0 * pairs[0].target, rtol=1e-3, atol=1e-6)


@pytest.mark.parametrize("regions", ["halves", "parts"])
def test_regions_combine_keys_that_were_made_separately(low: FaceModel, regions: Regions) -> None:
    sources = {name: low.coefficients_of(weights) for name, weights in KEYS.items()}
    pairs = [KeyPair(name, pose, pose) for name, pose in sources.items()]
    whole, parts = ExampleTransfer(low, low, pairs), ExampleTransfer(low, low, pairs, regions=regions)
    assert len(parts.regions) == (2 if regions == "halves" else 5)
    for pose in sources.values():
        assert apart(low, parts.pose(pose), pose) < 0.12
    # One brow alone is no combination of the keys, except of those of its region.
    brow = low.coefficients_of({"browInnerUpLeft": 1.0, "browOuterUpLeft": 1.0})
    region = low.character.regions["brow_left"], low.character.regions["brow_right"]
    moved = [low.instance(transfer.pose(brow)) - low.character.vertices for transfer in (whole, parts)]
    left, right = (np.linalg.norm(moved[1][ids], axis=1).max() for ids in region)
    if regions == "parts":
        assert right < 0.15 * left
    assert np.linalg.norm(moved[0][region[1]], axis=1).max() > 0.15 * left


def test_the_shares_of_regions_add_up(low: FaceModel) -> None:
    groups = grouped(tuple(low.character.feature_points), "parts")
    shares = region_shares(low, groups)
    np.testing.assert_allclose(shares.sum(axis=0), 1.0)
    np.testing.assert_allclose(region_projections(low, shares).sum(axis=0), np.eye(low.n_coefficients), atol=1e-9)


def test_frames_beyond_the_keys_are_told_and_the_best_of_them_helps_most(
    low: FaceModel, creature: FaceModel, pairs: list[KeyPair]
) -> None:
    transfer = ExampleTransfer(low, creature, pairs)
    inside = np.array([0.5 * pairs[0].source + 0.5 * pairs[2].source, 2.0 * pairs[1].source])
    sneer = low.coefficients_of({"noseSneerLeft": 1.0, "noseSneerRight": 1.0})
    blink = low.coefficients_of({"eyeBlinkLeft": 1.0, "eyeBlinkRight": 1.0})
    poses = np.vstack([inside, sneer, 0.9 * blink, blink, 0.8 * blink])
    found = coverage(transfer, poses)
    assert found.distances[:2].max() < 1e-6
    assert found.strengths[1] == pytest.approx(2.0, abs=0.01)
    assert found.distances[2:].min() > 0.01
    helpful = helpful_frames(transfer, poses, 5)
    # A blink explains three frames, the sneer one.
    assert low.weights_of(poses[helpful[0].frame])[low.character.shape_names.index("eyeBlinkLeft")] > 0.7
    assert [frame.frame for frame in helpful][1] == 2
    assert helpful[0].missed < found.missed
    assert helpful[1].missed < 1e-9
    assert len(helpful) == 2


def test_keys_chosen_from_frames_reach_all_of_them(low: FaceModel) -> None:
    names = ("jawOpen", "mouthSmileLeft", "browDownLeft", "eyeBlinkRight", "mouthPucker")
    basis = np.array([low.coefficients_of({name: 1.0}) for name in names])
    poses = np.random.default_rng(4).uniform(size=(60, 5)) @ basis
    chosen = [poses[frame.frame] for frame in chosen_frames(low, np.zeros((0, low.n_coefficients)), poses, 5)]
    assert len(chosen) == 5
    pairs = [KeyPair(str(i), pose, pose) for i, pose in enumerate(chosen)]
    transfer = ExampleTransfer(low, low, pairs, threshold=1e-9)
    assert apart(low, transfer.pose(poses[0]), poses[0]) < 1e-3
    assert coverage(transfer, poses).missed < 1e-9
    # A threshold leaves out the smallest motions.
    assert 1e-9 < coverage(ExampleTransfer(low, low, pairs, threshold=1e-4), poses).missed < 0.02


def test_when_nothing_is_missed_the_frames_farthest_from_all_keys_are_chosen(low: FaceModel) -> None:
    jaw = low.coefficients_of({"jawOpen": 1.0})
    poses = np.outer([0.2, 0.21, 0.5, 0.52, 0.9, 0.98, 1.0], jaw)
    found = chosen_frames(low, np.zeros((0, low.n_coefficients)), poses, 7)
    assert [frame.frame for frame in found[:3]] == [6, 2, 1]
    assert all(frame.missed < 1e-9 for frame in found)
    again = chosen_frames(low, poses[[6, 2]], poses, 1)
    assert [frame.frame for frame in again] == [1]


def test_what_cannot_be_a_key_is_said_in_a_sentence(low: FaceModel, creature: FaceModel, pairs: list[KeyPair]) -> None:
    with pytest.raises(FacePoserError, match="needs a key besides the neutral face"):
        ExampleTransfer(low, creature, [])
    same = KeyPair("again", pairs[0].source, pairs[1].target)
    with pytest.raises(FacePoserError, match="'smile' and 'again' are the same expression"):
        make_transfer(low, creature, "examples", keys=[*pairs, same])
    still = KeyPair("still", low.neutral(), pairs[0].target)
    with pytest.raises(FacePoserError, match="'neutral' and 'still' are the same"):
        ExampleTransfer(low, creature, [still])
    for bad in (np.full(creature.n_coefficients, np.nan), np.full(creature.n_coefficients, 1e6)):
        with np.errstate(all="ignore"), pytest.raises(FacePoserError, match="The target of the key 'bad' is no face"):
            ExampleTransfer(low, creature, [KeyPair("bad", pairs[0].source, bad)])
    with pytest.raises(FacePoserError, match="has 3 coefficients"):
        ExampleTransfer(low, creature, [KeyPair("short", pairs[0].source, np.zeros(3))])
    bare = replace(low, character=replace(low.character, feature_points={}, feature_titles={}))
    with pytest.raises(FacePoserError, match="fewer than three"):
        ExampleTransfer(bare, creature, pairs)
