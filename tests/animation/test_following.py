"""A face follows trajectories: terms against finite differences, known sequences, noise, gaps, and stopping."""

from dataclasses import replace

import numpy as np
import pytest

from faceposer.animation import following
from faceposer.animation.following import solve_trajectories
from faceposer.animation.smoothing import smooth_poses
from faceposer.animation.terms import CHANGE, SmoothnessTerm, TrackTerm, regional_metrics, smoothness_metric
from faceposer.animation.trajectories import Trajectories
from faceposer.geometry.camera import Camera, OrbitView
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.face_model import FaceModel
from faceposer.progress import CancelledError, Progress
from faceposer.solve.constraints.fixed import FixedConstraint
from faceposer.solve.map_solver import solve
from faceposer.solve.problem import PoseProblem
from faceposer.solve.term import Array, Term

SEVEN = ("4.1", "4.2", "8.1", "8.2", "8.3", "8.4", "2.10")
SHAPES = {"jawOpen": 0.6, "mouthSmileLeft": 0.7, "mouthSmileRight": 0.7, "browInnerUp": 0.8}


def front(model: FaceModel) -> Camera:
    vertices = model.character.vertices
    return OrbitView.preset(vertices.min(axis=0), vertices.max(axis=0)).camera((800, 800))


def performed(model: FaceModel, n_frames: int) -> Array:
    """A face that smiles, opens its mouth and raises its brows, each in its own time."""
    time = np.arange(n_frames) / 30.0
    poses = np.zeros((n_frames, model.n_coefficients))
    for i, (name, most) in enumerate(SHAPES.items()):
        strength = most * 0.5 * (1.0 - np.cos(2.0 * np.pi * time / (1.0 + 0.3 * (i // 2))))
        poses += strength[:, None] * model.coefficients_of({name: 1.0})
    return poses


def tracked(model: FaceModel, poses: Array, noise_px: float = 0.0, in_space: bool = False) -> Trajectories:
    """The trajectories of seven feature points of the face ``poses``, (F, r)."""
    points = SurfacePoints.at_vertices([model.character.feature_points[name] for name in SEVEN])
    rng = np.random.default_rng(0)
    places = np.array([model.positions_at(points, p) for p in poses])
    if in_space:
        return Trajectories(SEVEN, points, places + rng.normal(size=places.shape) * noise_px / 25.0, 30.0)
    camera = front(model)
    pixels = np.array([camera.project(frame) for frame in places])
    return Trajectories(SEVEN, points, pixels + rng.normal(size=pixels.shape) * noise_px, 30.0, camera)


def vertices(model: FaceModel, poses: Array) -> Array:
    """Every tenth vertex in millimetres, shape (F, n, 3)."""
    basis = model.basis.reshape(model.n_coefficients, -1, 3)[:, ::10]
    return 10.0 * np.einsum("fr,rnd->fnd", poses, basis)


def error(model: FaceModel, poses: Array, truth: Array) -> float:
    return float(np.linalg.norm(vertices(model, poses) - vertices(model, truth), axis=2).mean())


def jerk(model: FaceModel, poses: Array) -> float:
    return float(np.sqrt((np.diff(vertices(model, poses), 3, axis=0) ** 2).sum(axis=2).mean()))


def terms(model: FaceModel) -> dict[str, Term]:
    rng = np.random.default_rng(1)
    points = SurfacePoints(rng.integers(0, len(model.triangles), 5), rng.dirichlet(np.ones(3), 5))
    rows, neutral = model.jacobian_at(points)
    weights = rng.uniform(0.5, 2.0, 5)
    camera = front(model)
    poses = rng.normal(size=(2, model.n_coefficients)) * np.sqrt(model.subspace.variances)
    return {
        "picture": TrackTerm(rows, neutral, camera.project(neutral) + rng.normal(size=(5, 2)) * 9.0, weights, camera),
        "space": TrackTerm(rows, neutral, neutral + rng.normal(size=(5, 3)), weights, None),
        "smoothness": SmoothnessTerm(smoothness_metric(model, 1.0, 30.0), *poses),
    }


@pytest.mark.parametrize("kind", ["picture", "space", "smoothness"])
def test_gradient_and_curvature_agree_with_finite_differences(model: FaceModel, kind: str) -> None:
    term = terms(model)[kind]
    rng = np.random.default_rng(2)
    p = rng.normal(size=model.n_coefficients) * np.sqrt(model.subspace.variances)
    state = PoseProblem(model, []).state

    def value(x: Array) -> float:
        return term.value_and_gradient(state(x))[0]

    steps = 1e-6 * np.eye(len(p))
    numeric = np.array([(value(p + step) - value(p - step)) / 2e-6 for step in steps])
    gradient = term.value_and_gradient(state(p))[1]
    np.testing.assert_allclose(gradient, numeric, rtol=1e-3, atol=1e-4 * np.abs(gradient).max())
    if kind == "picture":
        return  # of its curvature, what comes from the perspective's own is left out
    way = rng.normal(size=len(p))
    slopes = [term.value_and_gradient(state(p + sign * 1e-3 * way))[1] for sign in (1.0, -1.0)]
    np.testing.assert_allclose(term.curvature(state(p)) @ way, (slopes[0] - slopes[1]) / 2e-3, rtol=1e-6)


def test_smoothness_costs_the_same_in_time_at_any_rate_and_for_any_mesh(model: FaceModel) -> None:
    poses = performed(model, 240)

    def cost(every: int) -> float:
        metric = smoothness_metric(model, 1.0, 240.0 / every)
        changes = np.diff(poses[::every], 2, axis=0)
        return float(np.einsum("fi,ij,fj->", changes, metric, changes))

    assert cost(1) == pytest.approx(cost(2), rel=0.05)
    change = poses[30] - 2.0 * poses[29] + poses[28]
    spread = model.basis.astype(np.float64)
    size = float(((spread * np.sqrt(model.subspace.variances)[:, None]) ** 2).sum())
    plain = float(np.sum((change @ spread) ** 2)) / size
    weighted = float(change @ change) / float(model.subspace.variances.sum())
    expected = 0.5 * (plain + weighted) / CHANGE**2
    assert change @ smoothness_metric(model, 1.0, 30.0) @ change == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("in_space", [False, True])
def test_a_known_sequence_comes_back_from_seven_points(model: FaceModel, in_space: bool) -> None:
    truth = performed(model, 45)
    performance = solve_trajectories(model, tracked(model, truth, in_space=in_space), prior="whole")
    assert len(performance) == 45
    assert performance.rate == 30.0
    assert error(model, performance.coefficients, truth) < 0.35 * error(model, np.zeros_like(truth), truth)


def test_smoothness_takes_jitter_out_and_comes_nearer(model: FaceModel) -> None:
    truth = performed(model, 45)
    noisy = tracked(model, truth, noise_px=1.5)
    smooth, ahead_not, rough = (
        solve_trajectories(model, noisy, smoothness=weight, look_ahead=ahead).coefficients
        for weight, ahead in ((1.0, True), (0.1, False), (0.0, True))
    )
    assert jerk(model, smooth) < 0.3 * jerk(model, rough)
    assert jerk(model, ahead_not) < 0.8 * jerk(model, rough)
    assert error(model, smooth, truth) < error(model, rough, truth)


def test_all_poses_together_are_at_a_minimum(model: FaceModel) -> None:
    poses = performed(model, 12)
    tracks = tracked(model, poses, noise_px=1.5)
    rows, neutral = model.jacobian_at(tracks.points)
    problems = [
        PoseProblem(model, [], extra_terms=[TrackTerm(rows, neutral, targets, np.ones(len(SEVEN)), tracks.camera)])
        for targets in tracks.positions
    ]
    metric = smoothness_metric(model, 1.0, 30.0)
    before = poses[:2]
    found = smooth_poses(problems, metric, np.zeros_like(poses), before, Progress())

    def energy(x: Array) -> float:
        changes = np.diff(np.concatenate([before, x]), 2, axis=0)
        own = sum(problem.energy_and_gradient(p)[0] for problem, p in zip(problems, x, strict=True))
        return own + float(np.einsum("fi,ij,fj->", changes, metric, changes))

    rng = np.random.default_rng(3)
    least = energy(found)
    for _ in range(5):
        way = rng.normal(size=found.shape) * 0.02 * np.sqrt(model.subspace.variances)
        assert energy(found + way) > least
        assert energy(found - way) > least
    assert least < energy(poses)


class Bowl:
    """The energy (x - at)^2 / (2 sigma^2) of two coefficients."""

    def __init__(self, at: Array, sigma: float) -> None:
        self.at, self.precision = at, 1.0 / sigma**2

    def energy_and_gradient(self, p: Array) -> tuple[float, Array]:
        off = p - self.at
        return 0.5 * self.precision * float(off @ off), self.precision * off

    def curvature(self, p: Array) -> Array:
        return self.precision * np.eye(len(p))


def test_sudden_changes_pass_while_what_hardly_moves_is_steady() -> None:
    """One coefficient speaks five times a second at 30 frames per second, the other rests; both are noisy."""
    rng, frames = np.random.default_rng(0), np.arange(60)
    truth = np.stack([0.2 * np.sin(2.0 * np.pi * 5.0 * frames / 30.0), np.zeros(60)], axis=1)
    noisy = truth + rng.normal(0.0, 0.01, truth.shape)
    metrics = np.array([np.diag([1e4, 0.0]), np.diag([0.0, 1e4])])
    problems = [Bowl(at, 0.03) for at in noisy]
    usual = smooth_poses(problems, metrics.sum(axis=0), noisy, noisy[:0], Progress())
    kept = smooth_poses(problems, metrics, noisy, noisy[:0], Progress(), 0.3)
    share = [float(found[:, 0] @ truth[:, 0] / (truth[:, 0] @ truth[:, 0])) for found in (usual, kept)]
    assert share[0] < 0.5
    assert share[1] > 0.95
    resting = [float(np.diff(found[:, 1], 3).std()) for found in (noisy, kept)]
    assert resting[1] < 0.1 * resting[0]


def test_poses_with_sudden_changes_are_at_a_minimum() -> None:
    rng = np.random.default_rng(1)
    at, before = rng.normal(0.0, 0.1, (12, 2)), rng.normal(0.0, 0.1, (2, 2))
    metrics = np.array([np.diag([300.0, 0.0]), np.array([[50.0, 20.0], [20.0, 100.0]])])
    problems = [Bowl(row, 0.1) for row in at]
    found = smooth_poses(problems, metrics, at, before, Progress(), 0.5)

    def energy(x: Array) -> float:
        changes = np.diff(np.concatenate([before, x]), 2, axis=0)
        costs = np.array([[d @ metric @ d for metric in metrics] for d in changes])
        return sum(problem.energy_and_gradient(p)[0] for problem, p in zip(problems, x, strict=True)) + float(
            0.5 * np.log1p(costs / 0.5).sum()
        )

    for row, column in rng.integers(0, (12, 2), (8, 2)):
        step = np.zeros_like(found)
        step[row, column] = 1e-5
        slope = (energy(found + step) - energy(found - step)) / 2e-5
        scale = (energy(at + step) - energy(at - step)) / 2e-5
        assert abs(slope) < 0.02 * max(abs(scale), 1.0)
    assert energy(found) < energy(at)


def test_regions_share_the_cost_of_a_change(model: FaceModel) -> None:
    metric = smoothness_metric(model, 1.0, 30.0)
    parts = regional_metrics(model, metric)
    jaw = model.coefficients_of({"jawOpen": 0.3})
    costs = np.einsum("i,gij,j->g", jaw, parts, jaw)
    regions = list(dict.fromkeys(model.rig_density.regions))
    assert costs.min() > -1e-9
    assert regions[int(np.argmax(costs))] == "jaw"
    assert costs.max() > 0.8 * jaw @ metric @ jaw


def test_a_long_take_in_parts_is_as_good_as_in_one(model: FaceModel, monkeypatch: pytest.MonkeyPatch) -> None:
    tracks = tracked(model, performed(model, 70), noise_px=1.5)
    whole = solve_trajectories(model, tracks).coefficients
    monkeypatch.setattr(following, "_WINDOW", 40)
    monkeypatch.setattr(following, "_OVERLAP", 20)
    parts = solve_trajectories(model, tracks).coefficients
    assert error(model, parts, whole) < 0.1 * error(model, np.zeros_like(whole), whole)


def test_points_that_are_not_seen_do_not_pull(model: FaceModel) -> None:
    truth = performed(model, 20)
    tracks = tracked(model, truth)
    positions = tracks.positions.copy()
    positions[5:9, 3] = np.nan
    positions[6, 4, 0] = np.nan
    gappy = replace(tracks, positions=positions)
    assert not gappy.seen[6, 4]
    assert error(model, solve_trajectories(model, gappy).coefficients, truth) < 1.2 * error(
        model, solve_trajectories(model, tracks).coefficients, truth
    )


def test_without_any_point_the_face_goes_from_the_pose_before_to_the_pose_after(model: FaceModel) -> None:
    truth = np.linspace(0.0, 1.0, 40)[:, None] * performed(model, 16)[15]
    tracks = tracked(model, truth)
    positions = tracks.positions.copy()
    positions[12:28] = np.nan
    positions[36:] = np.nan
    poses = solve_trajectories(model, replace(tracks, positions=positions)).coefficients
    size = np.linalg.norm(vertices(model, poses), axis=2).mean(axis=1)
    assert (np.diff(size[10:30]) > 0).all()
    assert jerk(model, poses[10:30]) < 0.05
    assert size[39] == pytest.approx(size[35], rel=0.15)
    blind = solve_trajectories(model, replace(tracks, positions=np.full_like(positions, np.nan))).coefficients
    np.testing.assert_allclose(blind, 0.0, atol=1e-6)


def test_weights_and_further_constraints_count(model: FaceModel) -> None:
    tracks = tracked(model, performed(model, 16))
    ignored = solve_trajectories(model, replace(tracks, weights=np.zeros(len(SEVEN)))).coefficients
    np.testing.assert_allclose(ignored, 0.0, atol=1e-6)
    brows = SurfacePoints.at_vertices(model.character.regions["brow_left"][::20])
    held = FixedConstraint(brows, weight=20.0).resolved(model, model.neutral())
    free, fixed = (solve_trajectories(model, tracks, constraints=extra).coefficients for extra in ((), (held,)))

    def moved(poses: Array) -> float:
        return float(np.linalg.norm(model.jacobian_at(brows)[0] @ poses[-1], axis=1).mean())

    assert moved(fixed) < 0.3 * moved(free)


def test_frames_are_told_in_order_and_it_stops_when_asked(model: FaceModel) -> None:
    tracks = tracked(model, performed(model, 10))
    told: list[int] = []
    solve_trajectories(model, tracks, progress=Progress(lambda stage, share: told.append(round(10 * share) - 1)))
    assert told == list(range(10))
    told.clear()
    with pytest.raises(CancelledError):
        solve_trajectories(
            model, tracks, progress=Progress(lambda stage, share: told.append(len(told)), lambda: len(told) == 4)
        )
    assert told == list(range(4))


def test_stopping_while_all_are_made_smooth(model: FaceModel) -> None:
    tracks = tracked(model, performed(model, 3), noise_px=1.5)
    asked: list[bool] = []

    def late() -> bool:
        asked.append(True)
        return len(asked) > 3

    with pytest.raises(CancelledError):
        solve_trajectories(model, tracks, progress=Progress(cancelled=late))


def test_other_evidence_pulls_and_is_seen_by_the_prior(model: FaceModel) -> None:
    tracks = tracked(model, performed(model, 16))
    rows, neutral = model.jacobian_at(tracks.points)
    term = TrackTerm(rows, neutral, tracks.positions[15], np.ones(len(SEVEN)), tracks.camera)
    with_it, without = PoseProblem(model, [], extra_terms=[term]), PoseProblem(model, [])
    assert not np.allclose(with_it.mixture.covariances, without.mixture.covariances)
    assert not with_it.at_rest
    off = np.abs(term.residual(with_it.state(solve(with_it).coefficients)))
    assert off.max() < 0.3 * np.abs(term.residual(with_it.state(model.neutral()))).max()


def test_how_a_face_came_to_a_pose_leaves_little_trace(model: FaceModel, monkeypatch: pytest.MonkeyPatch) -> None:
    truth = np.concatenate([performed(model, 40), np.zeros((30, model.n_coefficients))])
    tracks = tracked(model, truth)

    def trace() -> float:
        return error(model, solve_trajectories(model, tracks).coefficients[-5:], truth[-5:])

    little = trace()
    monkeypatch.setattr(following, "_START_PRIOR", 0.0)
    assert little < 0.5 * trace()


@pytest.mark.parametrize("weight", [0.0, 1e6])
def test_no_prior_and_absurd_targets_still_give_a_face(model: FaceModel, weight: float) -> None:
    tracks = tracked(model, performed(model, 6))
    absurd = replace(tracks, positions=1e4 * tracks.positions, weights=np.full(len(SEVEN), 1e6))
    poses = solve_trajectories(model, absurd, prior_weight=weight, smoothness=1e6).coefficients
    assert np.isfinite(poses).all()


def test_jumps_are_left_out_and_movements_stay(model: FaceModel) -> None:
    clean = tracked(model, performed(model, 60), noise_px=1.0)
    assert clean.without_jumps()[1] == 0
    positions = clean.positions.copy()
    hit = np.zeros(clean.seen.shape, dtype=bool)
    hit[[10, 11, 30], [0, 0, 5]] = True
    positions[hit] += 40.0
    steady, count = replace(clean, positions=positions).without_jumps()
    np.testing.assert_array_equal(~steady.seen, hit)
    assert count == 3


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"positions": np.zeros((4, 7, 3))}, "positions of 7 points in 2 axes"),
        ({"positions": np.zeros((0, 7, 2))}, "positions of 7 points"),
        ({"names": ("a",)}, "1 names"),
        ({"rate": 0.0}, "frames per second"),
        ({"weights": np.ones(3)}, "weights of shape"),
        ({"weights": -np.ones(7)}, "at least 0"),
    ],
)
def test_trajectories_that_do_not_fit_are_refused(model: FaceModel, change: dict[str, object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        replace(tracked(model, performed(model, 4)), **change)


@pytest.mark.parametrize("prior_weight", [0.0, 1.0])
def test_a_point_held_beyond_its_range_does_not_wear_the_limits_down(model: FaceModel, prior_weight: float) -> None:
    camera, points = front(model), SurfacePoints.at_vertices([model.character.feature_points["4.1"]])
    here = camera.project(model.positions_at(points, model.neutral()))
    away = np.minimum(np.arange(60) / 20.0, 1.0)[:, None, None] * (0.0, -120.0)
    held = Trajectories(("brow",), points, here + away, 30.0, camera)
    poses = solve_trajectories(model, held, prior_weight=prior_weight).coefficients
    lower, upper = model.character.shape_limits.T
    weights = np.array([model.weights_of(pose) for pose in poses])
    beyond = np.maximum(lower - weights, weights - upper)[:, upper > lower].max(axis=1)
    assert beyond.max() < 0.25
    assert beyond[-1] < beyond[25] + 0.01
