"""Times of warm solves for each kind of constraint, and their growth with the number of constraints."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from faceposer.evaluation.feature_lines import FEATURE_LINES, feature_line, width_of
from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.geometry.strokes import stroke_pixels
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.model.feature_curves import FEATURES, feature_curves
from faceposer.solve.constraints.curve import CurveConstraint
from faceposer.solve.constraints.distance import DistanceConstraint
from faceposer.solve.constraints.fixed import FixedConstraint
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.constraints.sketch import SketchConstraint
from faceposer.solve.constraints.stroke import StrokeConstraint, as_pixels
from faceposer.solve.map_solver import solve
from faceposer.solve.problem import PoseProblem
from faceposer.training.capture import read_capture
from faceposer.training.expressions import Recipe, clean, learn_from_frames
from scripts.benchmarking.timing import Row, elapsed, row

# Openings of mouth, eyelids and brows, which an artist sets with sliders.
_PAIRS = (("2.2", "2.3"), ("8.3", "8.4"), ("3.1", "3.3"), ("4.1", "4.2"))
# Corners of the mouth, chin and lips.
_DRAGGED = ("8.3", "8.4", "2.1", "8.1", "8.2")
# Features of an expression that is drawn completely.
_DRAWN = (
    *(f"{side} {name}" for name in ("brow", "upper lid", "lower lid") for side in ("left", "right")),
    "outer upper lip",
    "outer lower lip",
)
_EXPRESSION = {"mouthSmileLeft": 0.6, "mouthSmileRight": 0.6, "browInnerUp": 0.6, "jawOpen": 0.15}
_FRAMES = (1000, 4000)
Offsets = Iterator[tuple[float, float]]


def circle(moves: int) -> Offsets:
    """Yield the offset from the start, in pixels, at each move of a drag that circles out and back."""
    for step in range(moves):
        angle = 2 * np.pi * step / 120
        radius = 22 * abs(np.sin(np.pi * step / moves))
        yield float(radius * np.cos(angle)), float(radius * np.sin(angle))


def warm_row(name: str, model: FaceModel, drag: Iterator[Sequence[Constraint]]) -> Row:
    """Measure a live drag: at each move, set up the problem and solve it from the last pose."""
    p, times, evaluations = model.neutral(), [], []
    for constraints in drag:

        def move(given: Sequence[Constraint] = constraints) -> None:
            nonlocal p
            solution = solve(PoseProblem(model, given), p)
            p = solution.coefficients
            evaluations.append(solution.evaluations)

        times.append(elapsed(move))
    return row(name, times[1:], evaluations[1:])


def dragged_points(
    model: FaceModel, camera: Camera, vertices: Sequence[int], moved: int, moves: int
) -> Iterator[list[PointConstraint]]:
    """Yield points at ``vertices`` at each move of a drag of the first ``moved`` of them."""
    anchors = [SurfacePoint.at_vertex(model.triangles, vertex) for vertex in vertices]
    pixels = camera.project(model.character.vertices[list(vertices)]).tolist()
    still = [PointConstraint(anchor, (u, v), camera) for anchor, (u, v) in zip(anchors, pixels, strict=True)]
    for du, dv in circle(moves):
        yield [
            *(replace(pin, target=(pin.target[0] + du, pin.target[1] + dv)) for pin in still[:moved]),
            *still[moved:],
        ]


def dragged_distances(model: FaceModel, camera: Camera, moves: int) -> Iterator[list[DistanceConstraint]]:
    """Yield four distances, the first of which a slider moves out and back by about 24 pixels."""
    features = model.character.feature_points
    still = []
    for first, second in _PAIRS:
        pair = DistanceConstraint((features[first], features[second]), 0.0, camera)
        still.append(replace(pair, target=pair.measured(model, model.neutral())))
    for step in range(moves):
        longer = 12.0 * (1.0 - np.cos(2 * np.pi * step / 120))
        yield [replace(still[0], target=still[0].target + float(longer)), *still[1:]]


def brow_stroke(model: FaceModel, camera: Camera, pixels: int) -> StrokeConstraint:
    """Return a stroke of about ``pixels`` pixels along the left brow, with its own position as target."""
    line = feature_line(model, model.character.vertices, camera, FEATURE_LINES["brow_left"])
    way = as_pixels(line)
    return StrokeConstraint(way, way, width_of(line, pixels), camera).resolved(model, model.neutral())


def dragged_stroke(model: FaceModel, camera: Camera, pixels: int, moves: int) -> Iterator[list[StrokeConstraint]]:
    """Yield a stroke of ``pixels`` pixels with a target that moves by about a pixel at each move."""
    stroke = brow_stroke(model, camera, pixels)
    for offset in circle(moves):
        yield [stroke.nudged(offset)]


def dragged_curve(model: FaceModel, camera: Camera, moves: int) -> Iterator[list[CurveConstraint]]:
    """Yield a curve with five control points along the upper lip, with the middle one being dragged."""
    names = ("8.4", "8.9", "8.1", "8.10", "8.3")
    way = as_pixels(feature_line(model, model.character.vertices, camera, names))
    curve = CurveConstraint(way, way, camera).resolved(model, model.neutral())
    for du, dv in circle(moves):
        yield [curve.with_target(2, (way[2][0] + du, way[2][1] + dv))]


def dragged_with_fixed(model: FaceModel, camera: Camera, count: int, moves: int) -> Iterator[list[Constraint]]:
    """Yield five dragged points around the mouth, and ``count`` fixed vertices of the skin above it."""
    character = model.character
    first, last = character.part("skin").vertices
    above = first + np.flatnonzero(
        character.vertices[first:last, 1] > character.vertices[character.feature_points["9.3"], 1]
    )
    held = np.random.default_rng(0).permutation(above)[:count]
    hold = FixedConstraint(SurfacePoints.at_vertices(held)).resolved(model, model.neutral())
    for points in dragged_points(model, camera, [character.feature_points[name] for name in _DRAGGED], 5, moves):
        yield [*points, hold]


def drawn_features(model: FaceModel, camera: Camera) -> list[SketchConstraint]:
    """Return eight sketches of the lines of an expression."""
    character = model.character
    pose = model.coefficients_of(np.array([_EXPRESSION.get(name, 0.0) for name in character.shape_names]))
    sketches = []
    for feature in _DRAWN:
        curve = feature_curves(character)[feature][0]
        line = camera.project(model.positions_at(curve.points, pose))
        matched = zip(FEATURES[feature].points, as_pixels(line[curve.knots]), strict=True)
        sketch = SketchConstraint(as_pixels(line), camera, feature, tuple(matched))
        sketches.append(sketch.resolved(model, model.neutral()))
    return sketches


def dragged_with_sketches(model: FaceModel, camera: Camera, moves: int) -> Iterator[list[Constraint]]:
    """Yield eight sketches and a dragged mouth corner."""
    sketches = drawn_features(model, camera)
    corner = model.character.feature_points["8.3"]
    for points in dragged_points(model, camera, [corner], 1, moves):
        yield [*sketches, *points]


def constraint_rows(model: FaceModel, camera: Camera, moves: int) -> list[Row]:
    """Measure a warm solve for each kind of constraint, including the set-up of the problem."""
    return [
        warm_row("solve/distances-4/mfa", model, dragged_distances(model, camera, moves)),
        *(
            warm_row(f"solve/stroke-{pixels}/mfa", model, dragged_stroke(model, camera, pixels, moves))
            for pixels in (450, 900)
        ),
        warm_row("solve/curve-5/mfa", model, dragged_curve(model, camera, moves)),
        *(
            warm_row(f"solve/fixed-{count}/mfa", model, dragged_with_fixed(model, camera, count, moves))
            for count in (100, 1000)
        ),
        warm_row("solve/sketches-8/mfa", model, dragged_with_sketches(model, camera, moves)),
    ]


def scaling_rows(model: FaceModel, camera: Camera, moves: int) -> list[Row]:
    """Measure warm solves by the number of points, of pixels in a stroke and of fixed vertices."""
    regions = model.character.regions
    places = np.concatenate([regions[name] for name in ("mouth", "brow_left", "brow_right", "cheek_left", "nose")])
    corner = model.character.feature_points["8.3"]
    others = [v for v in np.random.default_rng(0).permutation(places).tolist() if v != corner]
    return [
        *(
            warm_row(
                f"scaling/points-{count}",
                model,
                dragged_points(model, camera, [corner, *others[: count - 1]], 1, moves),
            )
            for count in (1, 4, 16, 64)
        ),
        *(
            warm_row(f"scaling/stroke-{pixels}", model, dragged_stroke(model, camera, pixels, moves))
            for pixels in (225, 450, 900, 1800)
        ),
        *(
            warm_row(f"scaling/fixed-{count}", model, dragged_with_fixed(model, camera, count, moves))
            for count in (100, 1000, 5000)
        ),
    ]


def example_rows(model: FaceModel, camera: Camera, moves: int) -> list[Row]:
    """Measure warm solves by the number of examples; return no rows without FACEPOSER_CAPTURES.

    A solve uses only the learned mixture, which has the size set by the recipe, and no examples.
    """
    folder = os.environ.get("FACEPOSER_CAPTURES")
    if not folder:
        return []
    recipe = Recipe()
    frames = np.concatenate([clean(read_capture(path), recipe) for path in sorted(Path(folder).glob("alex_rom_*.csv"))])
    rows = []
    for count in _FRAMES:
        chosen = frames[np.linspace(0, len(frames) - 1, count).round().astype(int)]
        statistics = learn_from_frames(chosen, ARKIT_SHAPES, recipe)
        learned = build_face_model(model.character, statistics, model.n_coefficients)
        corners = [model.character.feature_points[name] for name in _DRAGGED]
        rows.append(warm_row(f"scaling/examples-{count}", learned, dragged_points(learned, camera, corners, 5, moves)))
    return rows


def pick_rows(model: FaceModel, camera: Camera, repeats: int) -> list[Row]:
    """Measure picking 900 pixels of a stroke on the face, with and without the image of triangle indices.

    Without OpenGL, only picking without the image is measured.
    """
    from faceposer.errors import FacePoserError
    from faceposer.render.offscreen import offscreen_context
    from faceposer.render.scene import Scene

    stroke = brow_stroke(model, camera, 900)
    pixels = stroke_pixels(stroke.target, stroke.width)
    neutral = model.neutral()
    rows = []
    try:
        with offscreen_context() as ctx:
            scene = Scene(ctx)
            scene.set_model(model)
            redrawn, drawn = [], []
            for repeat in range(repeats + 1):
                # A slightly different view, so that the previous image cannot be reused.
                other = replace(camera, translation=camera.translation + (1e-6 * repeat, 0.0, 0.0))
                redrawn.append(elapsed(lambda view=other: scene.pick_many(view, pixels)))  # type: ignore[misc]
                drawn.append(elapsed(lambda view=other: scene.pick_many(view, pixels)))  # type: ignore[misc]
            scene.release()
        rows = [row("pick/stroke-900", redrawn[1:]), row("pick/stroke-900/drawn", drawn[1:])]
    except FacePoserError as error:
        print(f"without the image of triangle indices: {error}")
    numpy_times = [elapsed(lambda: model.pick(neutral, camera, pixels)) for _ in range(repeats)]
    return [*rows, row("pick/stroke-900/numpy", numpy_times)]
