"""Expressions on other faces: they stay the same expression, by distances and by weights."""

from dataclasses import replace

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.model.performance import Performance
from faceposer.progress import CancelledError, Progress
from faceposer.solve.constraints.gaze import gaze_direction
from faceposer.solve.problem import PoseProblem
from faceposer.transfer.distances import DistanceTransfer
from faceposer.transfer.pairs import DEFAULT_PAIRS, PAPER_PAIRS, Pair
from faceposer.transfer.ranges import measure_ranges, scaled
from faceposer.transfer.terms import PairPoints, RigWeightTerm, SpaceDistanceTerm
from faceposer.transfer.transfer import make_transfer, transfer_performance
from faceposer.transfer.weights import WeightMap, WeightTransfer
from tests.rigs import with_wholes

SMILE = {"mouthSmileLeft": 0.8, "mouthSmileRight": 0.8, "cheekSquintLeft": 0.5, "cheekSquintRight": 0.5}
SURPRISE = {"jawOpen": 0.5, "browInnerUp": 0.9, "browOuterUpLeft": 0.9, "browOuterUpRight": 0.9, "eyeWideLeft": 0.7}
WINK = {"eyeBlinkLeft": 1.0, "mouthSmileLeft": 0.6, "cheekSquintLeft": 0.5}
EXPRESSIONS = (SMILE, SURPRISE, WINK)


def error(model: FaceModel, pose: np.ndarray, truth: np.ndarray) -> float:
    """How far the skin of ``pose`` is from that of ``truth``, relative to the neutral face."""
    skin = slice(*model.character.part("skin").vertices)
    off = np.linalg.norm(model.instance(pose)[skin] - model.instance(truth)[skin], axis=1).sum()
    return off / np.linalg.norm(model.instance(truth)[skin] - model.character.vertices[skin], axis=1).sum()


def distance(model: FaceModel, pose: np.ndarray, first: str, second: str) -> float:
    return float(PairPoints(model, [Pair("", first, second)]).distances(pose[None])[0, 0])


def test_terms_agree_with_finite_differences(model: FaceModel) -> None:
    rng = np.random.default_rng(0)
    problem = PoseProblem(model, ())
    count = len(DEFAULT_PAIRS)
    distances = SpaceDistanceTerm(
        PairPoints(model, DEFAULT_PAIRS), rng.uniform(0, 9, count), rng.uniform(0.1, 2, count)
    )
    for term in (distances, RigWeightTerm(model, [3, 5, 8], [0.1, 0.4, 0.9], 7.0)):
        p = rng.normal(size=model.n_coefficients) * np.sqrt(model.subspace.variances)
        state = problem.state(p)
        gradient = term.value_and_gradient(state)[1]
        steps = 1e-6 * np.eye(len(p))
        numeric = [
            (term.value_and_gradient(problem.state(p + s))[0] - term.value_and_gradient(problem.state(p - s))[0]) / 2e-6
            for s in steps
        ]
        np.testing.assert_allclose(gradient, numeric, rtol=1e-4, atol=1e-5 * np.abs(gradient).max())
        step = 1e-7 * rng.normal(size=len(p))
        change = term.residual(problem.state(p + step)) - term.residual(problem.state(p - step))
        np.testing.assert_allclose(term.jacobian(state) @ (2 * step), change, rtol=1e-3, atol=1e-9)


def test_scaling_takes_neutral_to_neutral_and_the_papers_takes_ends_to_ends(
    model: FaceModel, creature: FaceModel
) -> None:
    ours, theirs = measure_ranges(model, DEFAULT_PAIRS), measure_ranges(creature, DEFAULT_PAIRS)
    assert (ours.least <= ours.neutral).all()
    assert (ours.neutral <= ours.greatest).all()
    np.testing.assert_allclose(scaled(ours.neutral[None], ours, theirs)[0], theirs.neutral)
    np.testing.assert_allclose(scaled(ours.least[None], ours, theirs, "paper")[0], theirs.least)
    np.testing.assert_allclose(scaled(ours.greatest[None], ours, theirs, "paper")[0], theirs.greatest)
    assert np.abs(scaled(ours.neutral[None], ours, theirs, "paper")[0] - theirs.neutral).max() > 0.2
    growing = scaled(np.linspace(ours.least, ours.greatest, 9), ours, theirs)
    assert (np.diff(growing, axis=0) >= 0.0).all()
    eye = [pair.name for pair in DEFAULT_PAIRS].index("left eye height")
    assert scaled(ours.least[None], ours, theirs)[0, eye] == pytest.approx(theirs.least[eye])


def test_a_relaxed_face_stays_relaxed(model: FaceModel, low: FaceModel, creature: FaceModel) -> None:
    for target in (low, creature):
        moved = target.instance(DistanceTransfer(model, target).pose(model.neutral())) - target.character.vertices
        assert np.abs(moved).max() < 0.01


def test_expressions_arrive_where_the_rig_would_put_them(model: FaceModel, low: FaceModel) -> None:
    every, three = DistanceTransfer(model, low), DistanceTransfer(model, low, PAPER_PAIRS)
    errors = []
    for weights in EXPRESSIONS:
        pose, truth = model.coefficients_of(weights), low.coefficients_of(weights)
        errors.append((error(low, every.pose(pose), truth), error(low, three.pose(pose), truth)))
    assert np.mean(errors, axis=0)[0] < 0.25
    assert np.mean(errors, axis=0)[1] > 0.5


def test_a_mouth_is_opened_by_the_jaw_and_not_by_lips_that_pass_each_other(model: FaceModel, low: FaceModel) -> None:
    transfer = DistanceTransfer(model, low, PAPER_PAIRS)
    pose = transfer.pose(model.coefficients_of({"jawOpen": 0.6, "mouthLowerDownLeft": 0.3, "mouthLowerDownRight": 0.3}))
    weights = dict(zip(low.character.shape_names, low.weights_of(pose).tolist(), strict=True))
    assert weights["jawOpen"] > 0.3
    assert weights["mouthClose"] < 0.25
    ranges = measure_ranges(low, (*PAPER_PAIRS, Pair("", "8.3", "3.7")))
    assert (ranges.axes[:3, 1] > 0.85).all()
    assert not ranges.axes[3].any()


def test_there_and_back_is_the_same_face(model: FaceModel, low: FaceModel) -> None:
    there, back = DistanceTransfer(model, low), DistanceTransfer(low, model)
    poses = [model.coefficients_of(weights) for weights in EXPRESSIONS]
    assert np.mean([error(model, back.pose(there.pose(pose)), pose) for pose in poses]) < 0.3


def test_a_smile_and_a_wink_read_so_on_a_face_without_such_shapes(model: FaceModel, creature: FaceModel) -> None:
    transfer = DistanceTransfer(model, creature)
    neutral = creature.neutral()
    smile = transfer.pose(model.coefficients_of(SMILE))
    assert distance(creature, smile, "8.3", "8.4") > 1.05 * distance(creature, neutral, "8.3", "8.4")
    for corner, eye in (("8.3", "3.7"), ("8.4", "3.12")):
        assert distance(creature, smile, corner, eye) < 0.95 * distance(creature, neutral, corner, eye)
    wink = transfer.pose(model.coefficients_of(WINK))
    open_eye = distance(creature, neutral, "3.2", "3.4")
    assert distance(creature, wink, "3.1", "3.3") < 0.25 * open_eye
    assert distance(creature, wink, "3.2", "3.4") > 0.75 * open_eye
    lifted = [
        distance(creature, neutral, *ends) - distance(creature, wink, *ends)
        for ends in (("8.3", "3.7"), ("8.4", "3.12"))
    ]
    assert lifted[0] > 0.2
    assert abs(lifted[1]) < 0.5 * lifted[0]


def test_gaze_goes_by_weights_where_both_rigs_have_them_and_by_distances_elsewhere(
    model: FaceModel, low: FaceModel, creature: FaceModel
) -> None:
    looking = {"eyeLookOutLeft": 0.7, "eyeLookInRight": 0.5, "mouthSmileLeft": 0.5, "mouthSmileRight": 0.5}
    pose = model.coefficients_of(looking)
    by_name = DistanceTransfer(model, low)
    assert not any(pair.of_gaze for pair in by_name.pairs)
    result = by_name.pose(pose)
    weights = dict(zip(low.character.shape_names, low.weights_of(result).tolist(), strict=True))
    assert weights["eyeLookOutLeft"] == pytest.approx(0.7, abs=0.05)
    assert weights["eyeLookInRight"] == pytest.approx(0.5, abs=0.05)
    assert gaze_direction(low, result) == pytest.approx(gaze_direction(model, pose), abs=1.5)
    transfer = DistanceTransfer(model, creature)
    assert sum(pair.of_gaze for pair in transfer.pairs) == 6
    found = transfer.pose(pose)
    for pupil, corner in (("3.5", "3.7"), ("3.6", "3.8")):
        assert distance(creature, found, pupil, corner) < distance(creature, creature.neutral(), pupil, corner) - 0.1


def test_weights_are_the_same_by_name_and_stay_within_limits(model: FaceModel, low: FaceModel) -> None:
    transfer = WeightTransfer(model, low)
    for weights in EXPRESSIONS:
        assert error(low, transfer.pose(model.coefficients_of(weights)), low.coefficients_of(weights)) < 0.03
    beyond = transfer.pose(2.0 * model.coefficients_of(SMILE))
    assert low.weights_of(beyond).max() < 1.1


def test_halves_of_a_shape_become_the_whole_and_the_other_way(model: FaceModel) -> None:
    whole = with_wholes(model.character)
    halved = replace(
        model.character,
        shape_names=tuple(name.replace("browInnerUpRight", "browInnerUp_R") for name in model.character.shape_names),
    )
    row = whole.shape_names.index("browInnerUp")
    halves = [halved.shape_names.index(name) for name in ("browInnerUpLeft", "browInnerUp_R")]
    whole_to_halves, halves_to_whole = WeightMap(whole, halved), WeightMap(halved, whole)
    assert whole_to_halves.matrix[halves, row].tolist() == [1.0, 1.0]
    assert halves_to_whole.matrix[row, halves].tolist() == [0.5, 0.5]
    assert not whole_to_halves.missing
    fewer = replace(whole, shapes=whole.shapes * (np.arange(52) != row)[:, None, None].astype(np.float32))
    assert WeightMap(whole, fewer).missing == ("browInnerUp",)


def test_a_pose_goes_from_halves_to_a_whole_and_back(model: FaceModel) -> None:
    whole = build_face_model(with_wholes(model.character))
    back = WeightTransfer(model, whole).pose(model.coefficients_of({"browInnerUpLeft": 1.0, "jawOpen": 0.4}))
    assert error(whole, back, whole.coefficients_of({"browInnerUp": 0.5, "jawOpen": 0.4})) < 0.05
    there = WeightTransfer(whole, model).pose(whole.coefficients_of({"browInnerUp": 0.7}))
    assert error(model, there, model.coefficients_of({"browInnerUpLeft": 0.7, "browInnerUpRight": 0.7})) < 0.05


def test_what_cannot_be_carried_over_is_said_in_a_sentence(model: FaceModel, creature: FaceModel) -> None:
    with pytest.raises(FacePoserError, match=r"Goblin \('creature'\) has none of ARKit's shapes.*by distances"):
        make_transfer(model, creature, "weights")
    with pytest.raises(FacePoserError, match=r"measured on both Man and Goblin \('creature'\)"):
        make_transfer(model, creature, "distances", [Pair("", "8.3", "99.1")])
    bare = replace(model, character=replace(model.character, feature_points={}, feature_titles={}))
    with pytest.raises(FacePoserError, match="The character Man has no feature points"):
        make_transfer(model, bare)


def test_a_pair_that_is_off_or_that_hardly_moves_does_not_count(model: FaceModel, low: FaceModel) -> None:
    off = Pair("off", "8.3", "8.4", enabled=False)
    stiff = Pair("ears", "10.1", "10.2")
    transfer = DistanceTransfer(model, low, [*PAPER_PAIRS, off, stiff])
    assert transfer.pairs == PAPER_PAIRS
    assert transfer.still == (stiff,)


def test_a_performance_follows_frame_by_frame_with_news_and_can_be_stopped(model: FaceModel, low: FaceModel) -> None:
    shares = np.concatenate([np.linspace(0.0, 1.0, 8), np.linspace(1.0, 0.0, 8)])
    source = Performance(shares[:, None] * model.coefficients_of(SMILE), 25.0)
    news: list[float] = []
    result = transfer_performance(make_transfer(model, low), source, Progress(lambda stage, share: news.append(share)))
    assert result.rate == 25.0
    assert news == [pytest.approx((i + 1) / 16) for i in range(16)]
    truth = shares[:, None] * low.coefficients_of(SMILE)
    assert error(low, result.coefficients[7], truth[7]) < 0.3
    # A frame does not depend on how it was reached.
    alone = make_transfer(model, low).pose(source.coefficients[10])
    np.testing.assert_allclose(low.instance(result.coefficients[10]), low.instance(alone), atol=0.02)
    with pytest.raises(CancelledError):
        transfer_performance(make_transfer(model, low), source, Progress(cancelled=lambda: True))
