"""Strokes drawn over earlier ones: what is replaced, what adds up."""

from dataclasses import replace

import numpy as np
import pytest

from faceposer.geometry.camera import Camera
from faceposer.model.face_model import FaceModel
from faceposer.model.feature_curves import FEATURES, feature_curves
from faceposer.model.framing import face_view
from faceposer.sketch.combining import combined, components_of, covered_edges, overlap
from faceposer.solve.constraints.gaze import GazeConstraint
from faceposer.solve.constraints.registry import constraint_from_json
from faceposer.solve.constraints.sketch import SketchConstraint
from faceposer.solve.constraints.stroke import as_pixels


@pytest.fixture(scope="module")
def camera(man: FaceModel) -> Camera:
    return face_view(man.character, "front", 1.0).camera((800, 800))


def sketch(
    model: FaceModel, camera: Camera, feature: str, first: int = 0, last: int | None = None, chain: int = 0
) -> SketchConstraint:
    """Return a sketch of ``feature`` as it is on the neutral face, from one of its feature points to another."""
    curve = feature_curves(model.character)[feature][chain]
    pixels = camera.project(curve.points.positions(model.character.vertices, model.triangles))
    last = len(curve.names) - 1 if last is None else last
    knots = curve.knots[first : last + 1]
    names = dict.fromkeys(curve.names[first : last + 1])
    matched = tuple(zip(names, as_pixels(pixels[knots]), strict=False))
    stroke = as_pixels(pixels[knots[0] : knots[-1] + 1])
    return SketchConstraint(stroke, camera, feature, matched).resolved(model, model.neutral())


def features(constraints: tuple) -> list[str]:
    return [one.feature for one in constraints if isinstance(one, SketchConstraint)]


def test_all_edges_of_whole_features_are_covered(man: FaceModel, camera: Camera) -> None:
    for name, feature in FEATURES.items():
        shares = covered_edges(sketch(man, camera, name))
        edges = sum(len(chain) - (not feature.closed) for chain in feature.chains)
        assert len(shares) == edges, name
        assert min(shares.values()) > 0.95, name


def test_a_redrawn_feature_replaces_the_first(man: FaceModel, camera: Camera) -> None:
    first, other = sketch(man, camera, "left brow"), sketch(man, camera, "right brow")
    again = first.nudged((2.0, 3.0))
    gaze = GazeConstraint((3.0, 4.0))
    result = combined((first, gaze, other), again)
    assert result == (gaze, other, again)
    assert result[-1] is again


def test_pieces_of_a_feature_add_up_until_they_are_redrawn(man: FaceModel, camera: Camera) -> None:
    left, right = (sketch(man, camera, "outer upper lip", *ends) for ends in ((0, 3), (3, 6)))
    both = combined(combined((), left), right)
    assert both == (left, right)
    most = sketch(man, camera, "outer upper lip", 1, 4)
    # It covers two of the three edges of the left piece, and one of the three of the right one.
    assert combined(both, most) == (right, most)
    whole = sketch(man, camera, "outer upper lip")
    assert combined(both, whole) == (whole,)


def test_an_outline_replaces_its_components(man: FaceModel, camera: Camera) -> None:
    for outline in ("left eye outline", "mouth outline", "mouth line"):
        parts = tuple(sketch(man, camera, name) for name in FEATURES[outline].components)
        whole = sketch(man, camera, outline)
        assert combined(parts, whole) == (whole,)


@pytest.mark.parametrize("outline", ["left eye outline", "right eye outline", "mouth outline", "mouth line"])
def test_a_component_replaces_its_part_of_an_outline(man: FaceModel, camera: Camera, outline: str) -> None:
    whole = sketch(man, camera, outline)
    for name, other in (FEATURES[outline].components, FEATURES[outline].components[::-1]):
        new = sketch(man, camera, name)
        result = combined((whole,), new)
        assert features(result) == [other, name]
        rest = result[0]
        assert isinstance(rest, SketchConstraint)
        assert {n for n, _ in rest.matched} <= set(FEATURES[other].points)
        assert overlap(covered_edges(rest), covered_edges(sketch(man, camera, other))) > 0.95
        # A file of it has the same points at the same places.
        again = constraint_from_json(rest.to_json(), "constraints[0]").resolved(man, man.neutral())
        assert isinstance(again, SketchConstraint)
        if outline != "mouth line":
            assert len(again.points) == len(rest.points)
            assert np.hypot(*(again.on_face.targets - rest.on_face.targets).T).mean() < 2.0


def test_the_components_of_a_part_are_those_that_it_shows(man: FaceModel, camera: Camera) -> None:
    lower = sketch(man, camera, "mouth outline", 6, 10)
    assert [part.feature for part in components_of(lower)] == ["outer lower lip"]


def test_locked_and_disabled_sketches_stay(man: FaceModel, camera: Camera) -> None:
    first = sketch(man, camera, "jaw line")
    kept = (replace(first, locked=True), replace(first, enabled=False))
    assert combined((*kept, first), first.nudged((1.0, 1.0)))[:-1] == kept


def test_neighbours_do_not_replace_each_other(man: FaceModel, camera: Camera) -> None:
    drawn: tuple = ()
    names = [name for name, feature in FEATURES.items() if not feature.components]
    for name in names:
        drawn = combined(drawn, sketch(man, camera, name))
    assert features(drawn) == names
