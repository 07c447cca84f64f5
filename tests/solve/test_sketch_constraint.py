"""Sketches of the features of a known pose bring it back, however they are drawn."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from faceposer.geometry.alignment import Similarity
from faceposer.geometry.camera import Camera, OrbitView
from faceposer.geometry.mirror import SurfaceMirror
from faceposer.geometry.picking import SurfacePoint
from faceposer.model.face_model import FaceModel
from faceposer.model.feature_curves import FEATURES, feature_curves
from faceposer.solve.conflicts import find_conflicts
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.constraints.registry import constraint_from_json
from faceposer.solve.constraints.sketch import SketchConstraint
from faceposer.solve.constraints.sketch_matching import distances
from faceposer.solve.constraints.sketch_term import SketchTerm
from faceposer.solve.constraints.stroke import as_pixels
from faceposer.solve.map_solver import solve
from faceposer.solve.problem import PoseProblem, gather_points
from faceposer.solve.term import PoseState

Array = np.ndarray
EXPRESSION = {
    "browInnerUp": 0.6,
    "browOuterUpLeft": 0.5,
    "jawOpen": 0.3,
    "mouthSmileLeft": 0.5,
    "mouthSmileRight": 0.3,
    "eyeBlinkLeft": 0.5,
    "eyeBlinkRight": 0.3,
}


def view_of(model: FaceModel, name: str) -> Camera:
    lower, upper = model.character.vertices.min(axis=0), model.character.vertices.max(axis=0)
    return OrbitView.preset(lower, upper, name).camera((900, 800))


@pytest.fixture(params=["front", "three-quarter"])
def camera(request: pytest.FixtureRequest, model: FaceModel) -> Camera:
    return view_of(model, request.param)


def curve_pixels(model: FaceModel, feature: str, p: Array, camera: Camera) -> Array:
    return camera.project(model.positions_at(feature_curves(model.character)[feature][0].points, p))


def drawn(
    model: FaceModel, feature: str, p: Array, camera: Camera, backwards: bool = False, keep: slice = slice(None)
) -> SketchConstraint:
    """Return a sketch of ``feature`` as it looks at ``p``, of the feature points that ``keep`` selects."""
    curve = feature_curves(model.character)[feature][0]
    pixels = curve_pixels(model, feature, p, camera)
    knots = curve.knots[: len(FEATURES[feature].chains[0])][keep]
    matched = tuple(zip(FEATURES[feature].chains[0][keep], as_pixels(pixels[knots]), strict=True))
    part = pixels if keep == slice(None) else pixels[knots[0] : knots[-1] + 1]
    stroke = as_pixels(part[::-1] if backwards else part)
    return SketchConstraint(stroke, camera, feature, matched).resolved(model, p)


def off(model: FaceModel, feature: str, p: Array, truth: Array, camera: Camera) -> float:
    a, b = (curve_pixels(model, feature, pose, camera) for pose in (p, truth))
    return float(np.hypot(*(a - b).T).mean())


@pytest.mark.parametrize("backwards", [False, True])
def test_each_feature_takes_the_drawn_shape(model: FaceModel, camera: Camera, backwards: bool) -> None:
    truth = model.coefficients_of(EXPRESSION)
    # The jaw follows a stroke that is well off its contour only; see test_artist_strokes.py.
    for feature in sorted(set(FEATURES) - {"mouth line", "jaw line"}):
        sketch = drawn(model, feature, truth, camera, backwards)
        p = solve(PoseProblem(model, [sketch]), model.neutral()).coefficients
        before = off(model, feature, model.neutral(), truth, camera)
        # A stroke determines the course of a cheek, not where on it each point is, and cheeks are stiff.
        cheek = "cheek" in feature
        assert cheek or off(model, feature, p, truth, camera) < max(0.4 * before, 1.0), feature
        assert sketch.residual_px(model, p) < (3.5 if cheek else 1.6), feature
        assert sketch.residual_px(model, truth) < 1.0, feature


def test_sketches_of_brows_lids_and_lips_bring_back_the_face(model: FaceModel, camera: Camera) -> None:
    truth = model.coefficients_of(EXPRESSION)
    sides = [f"{side} {name}" for side in ("left", "right") for name in ("brow", "upper lid", "lower lid")]
    lips = [f"{edge} {which} lip" for edge in ("outer", "inner") for which in ("upper", "lower")]
    sketches = [drawn(model, feature, truth, camera) for feature in (*sides, *lips)]
    p = solve(PoseProblem(model, sketches), model.neutral()).coefficients
    regions = model.character.regions
    ids = np.concatenate([regions[name] for name in ("mouth", "brow_left", "brow_right", "lids_left", "lids_right")])
    error, moved = (
        np.linalg.norm((model.instance(truth) - model.instance(pose))[ids], axis=1).mean()
        for pose in (p, model.neutral())
    )
    assert error < 0.25 * moved
    assert find_conflicts(PoseProblem(model, sketches), p) == []


def test_errors_of_a_hand_cost_less_than_they_are(model: FaceModel) -> None:
    """Shifts of 6 px, of each stroke its own, and smooth deviations of 3 px leave most of the expression."""
    camera, truth = view_of(model, "front"), model.coefficients_of(EXPRESSION)
    features = ("left brow", "right brow", "outer upper lip", "outer lower lip", "inner upper lip", "inner lower lip")
    ids = np.concatenate([model.character.regions[name] for name in ("mouth", "brow_left", "brow_right")])
    errors = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        sketches = []
        for feature in features:
            exact = drawn(model, feature, truth, camera)
            at = np.linspace(0.0, 1.0, len(exact.stroke))[:, None]
            waves = rng.normal(0.0, 2.1, (2, 2))
            bend = waves[0] * np.sin(2.0 * np.pi * at) + waves[1] * np.cos(3.0 * np.pi * at)
            stroke = as_pixels(np.array(exact.stroke) + bend + rng.normal(0.0, 6.0, 2))
            knots = feature_curves(model.character)[feature][0].knots
            matched = tuple(zip(FEATURES[feature].points, [stroke[k] for k in knots], strict=True))
            sketches.append(replace(exact, stroke=stroke, matched=matched).resolved(model, truth))
        p = solve(PoseProblem(model, sketches), model.neutral()).coefficients
        errors.append(np.linalg.norm((model.instance(truth) - model.instance(p))[ids], axis=1).mean())
    moved = np.linalg.norm((model.instance(truth) - model.character.vertices)[ids], axis=1).mean()
    assert np.mean(errors) < 0.5 * moved


def test_a_heavier_sketch_is_followed_more_closely(model: FaceModel, camera: Camera) -> None:
    sketch = drawn(model, "left brow", model.neutral(), camera).nudged((0.0, -10.0))
    residuals = []
    for weight in (0.1, 1.0, 10.0):
        heavier = replace(sketch, weight=weight)
        residuals.append(solve(PoseProblem(model, [heavier]), model.neutral()).residuals_px[0])
    assert residuals == sorted(residuals, reverse=True)
    assert residuals[-1] < 1.5


def test_a_line_along_the_mouth_closes_both_lips_on_it(model: FaceModel, camera: Camera) -> None:
    smile = model.coefficients_of({"mouthSmileLeft": 0.7, "mouthSmileRight": 0.7})
    upper = drawn(model, "inner upper lip", smile, camera)
    line = replace(upper, feature="mouth line").resolved(model, smile)
    assert len(line.points) > 1.8 * len(upper.points)
    opened = model.coefficients_of({"jawOpen": 0.4})
    p = solve(PoseProblem(model, [line], start=opened), opened).coefficients
    for lip in ("inner upper lip", "inner lower lip"):
        assert off(model, lip, p, smile, camera) < 0.35 * off(model, lip, opened, smile, camera)


def test_closed_features_are_drawn_from_any_point_in_both_directions(model: FaceModel, camera: Camera) -> None:
    truth = model.coefficients_of(EXPRESSION)
    for feature in ("mouth outline", "left eye outline"):
        whole = drawn(model, feature, truth, camera)
        loop = np.array(whole.stroke[:-1])
        for shift in (0, len(loop) // 3, len(loop) // 2):
            for way in (1, -1):
                turned = np.roll(loop, shift, axis=0)[::way]
                sketch = replace(whole, stroke=as_pixels(turned)).resolved(model, truth)
                assert len(sketch.points) == len(whole.points)
                reached = camera.project(model.positions_at(sketch.points, truth))
                assert np.hypot(*(reached - sketch.on_face.targets).T).mean() < 3.0


def test_a_part_of_an_outline_moves_only_that_part(model: FaceModel) -> None:
    camera, truth = view_of(model, "front"), model.coefficients_of(EXPRESSION)
    part = drawn(model, "mouth outline", truth, camera, keep=slice(2, 5))
    names = [FEATURES["mouth outline"].points[i] for i in (2, 3, 4)]
    ids = [model.character.feature_points[name] for name in names]
    places = part.points.positions(model.character.vertices, model.triangles)
    span = model.character.vertices[ids]
    assert len(part.points) < 30
    assert places[:, 0].min() > span[:, 0].min() - 0.3
    assert places[:, 0].max() < span[:, 0].max() + 0.3


def test_points_between_matched_ones_correspond_by_length(model: FaceModel) -> None:
    camera = view_of(model, "front")
    sketch = drawn(model, "outer upper lip", model.neutral(), camera)
    # The middle third drawn at twice the scale: pieces stretch on their own.
    names = dict(sketch.matched)
    assert list(names) == list(FEATURES["outer upper lip"].points)
    flat = [(100.0, 300.0), (600.0, 300.0)]
    at = np.linspace(100.0, 600.0, 7) + (0, 0, 0, 40, 0, 0, 0)
    straight = replace(
        sketch, stroke=as_pixels(flat), matched=tuple((name, (u, 300.0)) for name, u in zip(names, at, strict=True))
    ).resolved(model, model.neutral())
    traced = straight.on_face
    np.testing.assert_allclose(traced.targets[traced.matched][:, 0], at, atol=1e-6)
    np.testing.assert_allclose(traced.targets[:, 1], 300.0, atol=1e-6)
    assert (np.diff(traced.targets[:, 0]) > 0).all()
    knots = np.flatnonzero(traced.matched)
    for a, b in pairwise(knots.tolist()):
        steps = np.diff(traced.targets[a : b + 1, 0])
        assert steps.max() < 2.5 * steps.min()


def test_matched_points_out_of_order_are_left_to_the_line(model: FaceModel, camera: Camera) -> None:
    truth = model.coefficients_of(EXPRESSION)
    sketch = drawn(model, "outer upper lip", truth, camera)
    (name, _), (_, far) = sketch.matched[1], sketch.matched[-2]
    matched = (sketch.matched[0], (name, far), *sketch.matched[2:])
    swapped = replace(sketch, matched=matched).resolved(model, truth)
    assert swapped.on_face.matched.sum() == len(matched) - 1
    reached = camera.project(model.positions_at(swapped.points, truth))
    assert np.hypot(*(reached - swapped.on_face.targets).T).mean() < 3.0


def test_a_single_matched_point_is_enough(model: FaceModel, camera: Camera) -> None:
    truth = model.coefficients_of(EXPRESSION)
    for backwards in (False, True):
        sketch = drawn(model, "left brow", truth, camera, backwards)
        single = replace(sketch, matched=sketch.matched[1:2]).resolved(model, truth)
        reached = camera.project(model.positions_at(single.points, truth))
        assert np.hypot(*(reached - single.on_face.targets).T).mean() < 4.0


def test_what_does_not_show_the_face_is_refused(model: FaceModel, camera: Camera) -> None:
    def resolved(stroke: list[tuple[float, float]], camera: Camera) -> SketchConstraint:
        sketch = SketchConstraint(as_pixels(stroke), camera, "left brow", (("4.1", stroke[0]), ("4.3", stroke[1])))
        return sketch.resolved(model, model.neutral())

    usual = [(400.0, 300.0), (450.0, 300.0)]
    resolved(usual, camera)
    for stroke in ([(-1e6, -1e6), (1e6, 1e6)], [(9e5, 9e5), (9e5 + 1e-3, 9e5)]):
        with pytest.raises(ValueError, match="heights of the face away"):
            resolved(stroke, camera)
    for depth, said in ((-110.0, "in front of it"), (0.0, "in front of it"), (1e9, "heights of the face away")):
        with pytest.raises(ValueError, match=said):
            resolved(usual, replace(camera, translation=np.array([0.0, 0.0, depth])))
    with pytest.raises(ValueError, match="no length"):
        resolved([(400.0, 300.0), (400.0 + 5e-10, 300.0)] * 4999, camera)


def test_large_and_tiny_strokes_give_finite_poses(model: FaceModel, camera: Camera) -> None:
    for stroke in ([(-500.0, -500.0), (1500.0, 1500.0)], [(400.0, 400.0), (400.0, 400.1)]):
        for feature in ("left brow", "mouth outline", "mouth line"):
            names = FEATURES[feature].chains[0]
            matched = ((names[0], stroke[0]), (names[1], stroke[1]))
            sketch = SketchConstraint(as_pixels(stroke), camera, feature, matched).resolved(model, model.neutral())
            solution = solve(PoseProblem(model, [sketch]), model.neutral())
            assert np.isfinite(solution.coefficients).all()
            assert np.isfinite(solution.residuals_px).all()


def test_a_moved_sketch_is_the_sketch_drawn_there(model: FaceModel, camera: Camera) -> None:
    sketch = drawn(model, "left brow", model.coefficients_of(EXPRESSION), camera)
    moved = sketch.nudged((3.0, -7.0))
    again = constraint_from_json(moved.to_json(), "constraints[0]").resolved(model, model.neutral())
    assert again == moved
    np.testing.assert_allclose(again.points.faces, moved.points.faces)
    np.testing.assert_allclose(again.on_face.targets, moved.on_face.targets, atol=1e-6)


def test_mirrored_sketches_do_the_same_across(model: FaceModel, camera: Camera) -> None:
    mirror = SurfaceMirror(model.character.vertices, model.triangles, 0.05)
    truth = model.coefficients_of(EXPRESSION)
    for feature in ("left brow", "right upper lid", "left eye outline", "right nose wing", "left cheek line"):
        sketch = drawn(model, feature, truth, camera)
        across = sketch.mirrored(mirror, model, model.neutral())
        assert across is not None
        assert across.feature == FEATURES[feature].mirror
        assert across.mirrored(mirror, model, model.neutral()) == pytest.approx(sketch) or (
            np.abs(np.array(across.mirrored(mirror, model, truth).stroke) - sketch.stroke).max() < 0.1
        )
        p = solve(PoseProblem(model, [sketch, across]), model.neutral()).coefficients
        vertices = model.instance(p)
        np.testing.assert_allclose(vertices[mirror.vertices] * (-1, 1, 1), vertices, atol=0.05)


def test_a_mirrored_mouth_is_the_mouth(model: FaceModel, camera: Camera) -> None:
    mirror = SurfaceMirror(model.character.vertices, model.triangles, 0.05)
    sketch = drawn(model, "outer upper lip", model.coefficients_of({"mouthSmileLeft": 0.8}), camera)
    across = sketch.mirrored(mirror, model, model.neutral())
    assert across is not None
    assert across.feature == "outer upper lip"
    p = solve(PoseProblem(model, [across]), model.neutral()).coefficients
    other = model.coefficients_of({"mouthSmileRight": 0.8})
    assert off(model, "outer upper lip", p, other, across.camera) < 2.0


def test_a_sketch_follows_its_character_to_another_version(model: FaceModel, camera: Camera) -> None:
    sketch = drawn(model, "left brow", model.coefficients_of(EXPRESSION), camera)
    assert sketch.places is None
    assert sketch.with_rest(model).rest is None
    frame = Similarity(np.eye(3), np.array([0.0, 5.0, 0.0]), np.asarray(2.0))
    moved = sketch.rebound(None, frame, np.zeros((0, 3)))
    assert (moved.stroke, moved.matched) == (sketch.stroke, sketch.matched)
    point = model.character.vertices[:1].astype(float)
    np.testing.assert_allclose(moved.camera.project(frame.apply(point)), camera.project(point), atol=1e-6)
    with pytest.raises(RuntimeError, match="not resolved"):
        _ = moved.points


def test_a_feature_that_the_character_lacks_is_refused(model: FaceModel, camera: Camera) -> None:
    sketch = drawn(model, "left brow", model.neutral(), camera)
    points = {name: vertex for name, vertex in model.character.feature_points.items() if not name.startswith("4.")}
    titles = {name: title for name, title in model.character.feature_titles.items() if name in points}
    browless = replace(model, character=replace(model.character, feature_points=points, feature_titles=titles))
    with pytest.raises(ValueError, match=r"the character has no left brow: it lacks the feature points 4.1, 4.3, 4.5"):
        sketch.resolved(browless, model.neutral())
    assert drawn(model, "right brow", model.neutral(), camera).mirrored(None, browless, model.neutral()) is None


def test_a_shift_of_a_hand_is_no_conflict(model: FaceModel, camera: Camera) -> None:
    sketches = [
        drawn(model, f"{side} nose wing", model.neutral(), camera).nudged((4.0, 6.0)) for side in ("left", "right")
    ]
    problem = PoseProblem(model, sketches)
    solution = solve(problem)
    assert max(solution.residuals_px) > 3.0
    assert find_conflicts(problem, solution.coefficients) == []


def test_sketches_that_contradict_are_reported(model: FaceModel, camera: Camera) -> None:
    sketch = drawn(model, "left brow", model.neutral(), camera)
    up, down = sketch.nudged((0.0, -25.0)), sketch.nudged((0.0, 25.0))
    problem = PoseProblem(model, [up, down])
    conflicts = find_conflicts(problem, solve(problem).coefficients)
    assert {(c.index, c.opponent) for c in conflicts} == {(0, 1), (1, 0)}


def test_many_sketches_cost_what_each_does(model: FaceModel, camera: Camera) -> None:
    truth, p = model.coefficients_of(EXPRESSION), 0.3 * model.coefficients_of(EXPRESSION)
    sketches = [
        replace(drawn(model, name, truth, camera), weight=weight)
        for name, weight in (("left brow", 1.0), ("jaw line", 0.5), ("mouth outline", 2.0))
    ]

    def cost(*chosen: SketchConstraint) -> tuple[float, Array, Array, Array]:
        anchored, slots = gather_points(model, chosen)
        (term,) = SketchConstraint.terms(chosen, slots, model)
        state = PoseState(anchored, p)
        rows, residual = term.linearised(state)
        assert float(residual @ residual) == pytest.approx(term.value_and_gradient(state)[0])
        return *term.value_and_gradient(state), term.curvature(state), rows.T @ rows

    each = [cost(sketch) for sketch in sketches]
    for whole, parts in zip(cost(*sketches), zip(*each, strict=True), strict=True):
        np.testing.assert_allclose(whole, sum(parts), rtol=1e-9, atol=1e-9 * np.abs(whole).max())


def test_a_dragged_point_beside_sketches_gives_the_pose_of_new_terms(model: FaceModel, camera: Camera) -> None:
    truth = model.coefficients_of(EXPRESSION)
    sketches = [drawn(model, name, truth, camera) for name in ("left brow", "outer upper lip")]
    chin = SurfacePoint.at_vertex(model.triangles, model.character.feature_points["2.1"])
    start = 0.2 * truth
    for x, begin in ((400.0, None), (410.0, None), (410.0, start)):
        constraints = [*sketches, PointConstraint(chin, (x, 700.0), camera)]
        kept = solve(PoseProblem(model, constraints, begin), model.neutral()).coefficients
        new = [sketch.resolved(model, model.neutral()) for sketch in sketches]
        fresh = solve(PoseProblem(model, [*new, constraints[-1]], begin), model.neutral()).coefficients
        np.testing.assert_allclose(kept, fresh, atol=1e-9)


def test_distances_from_a_line() -> None:
    rng = np.random.default_rng(0)
    line = np.cumsum(rng.normal(size=(60, 2)), axis=0) + 800.0
    line[3] = line[4]
    points = np.concatenate([line[[0, 7]], line[rng.integers(0, 60, 20)] + 5.0 * rng.normal(size=(20, 2))])
    dense = np.concatenate([np.linspace(a, b, 400) for a, b in pairwise(line)])
    nearest = np.sqrt(((points[:, None] - dense) ** 2).sum(axis=2)).min(axis=1)
    np.testing.assert_allclose(distances(points, line), nearest, atol=1e-2)


def moved(model: FaceModel, sketch: SketchConstraint, name: str, spread: float = 0.5) -> tuple[float, Array]:
    """Return the largest motion of the feature point ``name`` and its neighbours in cm, and the pose."""
    p = solve(PoseProblem(model, [sketch], spread=spread)).coefficients
    vertices = model.character.vertices
    near = np.linalg.norm(vertices - vertices[model.character.feature_points[name]], axis=1) < 1.0
    moves = np.linalg.norm(model.instance(p) - model.instance(model.neutral()), axis=1)
    return float(moves[near].max()), p


def test_a_raised_nose_wing_sneers(model: FaceModel) -> None:
    camera = view_of(model, "front")
    sketch = (
        drawn(model, "left nose wing", model.neutral(), camera).nudged((0.0, -12.0)).resolved(model, model.neutral())
    )
    lip, p = moved(model, sketch, "8.1")
    weights = dict(zip(model.character.shape_names, model.weights_of(p), strict=True))
    assert max(weights, key=lambda name: abs(weights[name])) == "noseSneerLeft"
    assert lip < 0.15
    # With the whole face, what usually comes with it may move, too.
    assert moved(model, sketch, "8.1", spread=1.0)[0] > lip


def test_the_tremor_of_a_nose_wing_does_not_move_the_mouth(model: FaceModel) -> None:
    still = drawn(model, "left nose wing", model.neutral(), view_of(model, "front"))
    line = np.array(still.stroke)
    wave = 3.0 * np.stack([np.sin(0.9 * np.arange(len(line))), np.cos(1.3 * np.arange(len(line)))], axis=1)
    sketch = replace(still, stroke=as_pixels(line + wave)).resolved(model, model.neutral())
    assert moved(model, sketch, "8.1")[0] < 0.05
    assert moved(model, sketch, "8.3")[0] < 0.05


def test_a_sketch_beyond_the_range_is_explained(model: FaceModel) -> None:
    camera = view_of(model, "front")
    sketch = drawn(model, "left brow", model.neutral(), camera).nudged((0.0, -90.0)).resolved(model, model.neutral())
    problem = PoseProblem(model, [sketch])
    p = solve(problem).coefficients
    ((index, opponent, mobility),) = [(c.index, c.opponent, c.mobility) for c in find_conflicts(problem, p)]
    assert (index, opponent) == (0, None)
    assert mobility is not None
    assert mobility > 0.9
    mouth = moved(model, sketch, "8.3")[0]
    assert mouth < 0.05


def test_limits_of_sketches_fade_with_trust(model: FaceModel, camera: Camera) -> None:
    sketch = (
        drawn(model, "left nose wing", model.neutral(), camera).nudged((9.0, -9.0)).resolved(model, model.neutral())
    )
    anchored, slots = gather_points(model, [sketch])
    (term,) = SketchConstraint.terms([sketch], slots, model)
    assert isinstance(term, SketchTerm)
    state = PoseState(anchored, model.neutral())
    limits = model.rig_density.limits
    limited = [term.within_reach(model, state, limits, trust) for trust in (0.0, 0.5, 1.0)]
    assert limited[0].lost > 1.0
    assert limited[1].lost == pytest.approx(0.5 * limited[0].lost)
    assert limited[2].lost == pytest.approx(0.0)
    whole = term.value_and_gradient(state)
    np.testing.assert_allclose(limited[2].value_and_gradient(state)[1], whole[1])
    gradient = limited[0].value_and_gradient(state)[1]
    assert np.abs(gradient - whole[1]).max() > 0.1 * np.abs(whole[1]).max()
    assert term.within_reach(model, state, limits, 0.5) is term.within_reach(model, state, limits, 0.5)
