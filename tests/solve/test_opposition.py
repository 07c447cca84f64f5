"""From one expression to its opposite: what is pulled against ends, and nothing else does."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from faceposer.geometry.camera import Camera, OrbitView
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.map_solver import solve
from faceposer.solve.opposition import _bounded_least_squares, fading
from faceposer.solve.problem import PoseProblem

CORNERS = ("8.3", "8.4")
SIDES = ("Left", "Right")
SMILE = {
    "mouthSmile": 0.7,
    "cheekSquint": 0.5,
    "eyeSquint": 0.2,
    "mouthUpperUp": 0.35,
    "mouthLowerDown": 0.35,
    "mouthDimple": 0.15,
}


@pytest.fixture(scope="module")
def camera(model: FaceModel) -> Camera:
    vertices = model.character.vertices
    return OrbitView.preset(vertices.min(axis=0), vertices.max(axis=0)).camera((960, 960))


def expression(model: FaceModel, **central: float) -> np.ndarray:
    both = {f"{name}{side}": value for name, value in SMILE.items() for side in SIDES}
    return model.coefficients_of({**both, **central})


def pulled(
    model: FaceModel, camera: Camera, start: np.ndarray, pulls: dict[str, tuple[float, float]]
) -> list[PointConstraint]:
    """Pins on feature points, pulled by pixels from where they are in the start pose."""
    found = []
    for name, pull in pulls.items():
        vertex = model.character.feature_points[name]
        here = camera.project(model.positions_at(SurfacePoints.at_vertices([vertex]), start))[0]
        u, v = (here + pull).tolist()
        found.append(PointConstraint(vertex, (u, v), camera))
    return found


def weights(model: FaceModel, p: np.ndarray) -> dict[str, float]:
    return dict(zip(model.character.shape_names, model.weights_of(p).tolist(), strict=True))


def corner_height(model: FaceModel, p: np.ndarray) -> float:
    places = SurfacePoints.at_vertices([model.character.feature_points[name] for name in (*CORNERS, "2.2", "2.3")])
    heights = model.positions_at(places, p)[:, 1]
    return float(heights[:2].mean() - heights[2:].mean())


def linearised(model: FaceModel, pins: list[PointConstraint], start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    problem = PoseProblem(model, pins, start, bare=True)
    (term,) = PointConstraint.terms(pins, [np.array([i]) for i in range(len(pins))], model)
    return term.linearised(problem.state(start))  # type: ignore[attr-defined,no-any-return]


def test_corners_pulled_down_from_a_broad_smile_frown(model: FaceModel, camera: Camera) -> None:
    start = expression(model, jawOpen=0.1)
    pose = solve(PoseProblem(model, pulled(model, camera, start, dict.fromkeys(CORNERS, (0.0, 60.0))), start))
    after = weights(model, pose.coefficients)
    assert corner_height(model, start) > 0.1
    assert corner_height(model, pose.coefficients) < -0.5, "centimetres"
    for side in SIDES:
        assert after[f"mouthFrown{side}"] > 0.85
        for ended in ("mouthSmile", "cheekSquint", "eyeSquint", "mouthUpperUp", "mouthDimple"):
            assert after[f"{ended}{side}"] < 0.06, ended
    assert after["jawOpen"] < 0.05


def test_targets_between_smile_and_frown_are_met(model: FaceModel, camera: Camera) -> None:
    start = expression(model)
    for pull in (8.0, 20.0, 32.0):
        pins = pulled(model, camera, start, dict.fromkeys(CORNERS, (0.0, pull)))
        assert max(solve(PoseProblem(model, pins, start)).residuals_px) < 3.0


def test_the_way_from_a_smile_to_a_frown_has_no_jumps(model: FaceModel, camera: Camera) -> None:
    start = pose = expression(model, jawOpen=0.1)
    before, steps = model.instance(pose), []
    for pull in np.linspace(0.0, 60.0, 61):
        pins = pulled(model, camera, start, dict.fromkeys(CORNERS, (0.0, float(pull))))
        pose = solve(PoseProblem(model, pins, start), pose).coefficients
        now = model.instance(pose)
        steps.append(float(np.linalg.norm(now - before, axis=1).max()))
        before = now
    assert steps[0] < 1e-3, "pins that are met move nothing"
    assert max(steps) < 3.0 * float(np.mean(steps))


def test_a_wide_open_jaw_and_a_kiss_stay(model: FaceModel, camera: Camera) -> None:
    start = expression(model, jawOpen=0.6, mouthPucker=0.6)
    pins = pulled(model, camera, start, dict.fromkeys(CORNERS, (0.0, 60.0)))
    part = fading(model, start, *linearised(model, pins, start))
    assert part is not None
    gone = weights(model, part)
    assert gone["mouthSmileLeft"] > 0.6
    assert gone["jawOpen"] < 0.2


def test_what_is_pulled_further_or_elsewhere_stays(model: FaceModel, camera: Camera) -> None:
    start = expression(model, browOuterUpLeft=0.8, browOuterUpRight=0.8)
    upwards = pulled(model, camera, start, dict.fromkeys(CORNERS, (0.0, -12.0)))
    part = fading(model, start, *linearised(model, upwards, start))
    assert part is None or max(weights(model, part).values()) < 0.05
    brow = fading(model, start, *linearised(model, pulled(model, camera, start, {"4.5": (0.0, 20.0)}), start))
    assert brow is not None
    gone = weights(model, brow)
    assert gone["browOuterUpLeft"] > 0.4
    assert max(abs(value) for name, value in gone.items() if name.startswith(("mouth", "cheek", "jaw"))) < 0.02
    assert abs(gone["browOuterUpRight"]) < 0.05, "the other side is not pulled"


def test_raised_brows_end_their_frown_and_wrinkle_the_nose_no_further(model: FaceModel, camera: Camera) -> None:
    start = model.coefficients_of({f"{n}{s}": w for n, w in (("browDown", 0.9), ("noseSneer", 0.4)) for s in SIDES})
    pins = pulled(model, camera, start, dict.fromkeys(("4.1", "4.2"), (0.0, -25.0)))
    after = weights(model, solve(PoseProblem(model, pins, start)).coefficients)
    for side in SIDES:
        assert after[f"browDown{side}"] < 0.05
        assert after[f"browInnerUp{side}"] > 0.2
        assert after[f"noseSneer{side}"] < 0.2


def test_one_corner_ends_the_smile_of_its_side(model: FaceModel, camera: Camera) -> None:
    start = expression(model)
    part = fading(model, start, *linearised(model, pulled(model, camera, start, {"8.3": (0.0, 40.0)}), start))
    assert part is not None
    gone = weights(model, part)
    assert gone["mouthSmileLeft"] > 0.6
    assert gone["cheekSquintLeft"] > 0.4
    assert max(gone["mouthSmileRight"], gone["cheekSquintRight"], gone["mouthLowerDownRight"]) < 0.05


def test_a_neutral_face_has_nothing_to_end(model: FaceModel, camera: Camera) -> None:
    start = model.neutral()
    pins = pulled(model, camera, start, dict.fromkeys(CORNERS, (0.0, 40.0)))
    assert fading(model, start, *linearised(model, pins, start)) is None
    smiling = expression(model)
    pins = pulled(model, camera, smiling, dict.fromkeys(CORNERS, (0.0, 40.0)))
    assert fading(model, smiling, *linearised(model, pins, smiling), 0.0) is None


def test_shares_are_the_bounded_least_squares_solution() -> None:
    rng = np.random.default_rng(4)
    for _ in range(20):
        columns, residual, bounds = rng.normal(size=(6, 8)), 3.0 * rng.normal(size=8), rng.uniform(0.0, 1.0, 6)
        bounds[0] = 0.0
        found = _bounded_least_squares(columns, residual, bounds)
        free = bounds > 0.0
        stacked = np.vstack([columns[free].T, np.eye(int(free.sum()))])
        exact = lsq_linear(stacked, np.concatenate([-residual, np.zeros(int(free.sum()))]), (0.0, bounds[free]))
        assert found[0] == 0.0
        np.testing.assert_allclose(found[free], exact.x, atol=2e-3)
