"""Dragging of points of a head."""

import numpy as np
import pytest

from faceposer.geometry.camera import OrbitView
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.identity.dragging import HeadDrag
from faceposer.identity.editing import HeadEditor
from faceposer.identity.identity import Identity
from faceposer.model.face_model import FaceModel

CAMERA = OrbitView((0.0, 1.0, 2.0), 0.3, 0.1).camera((800, 800))


@pytest.fixture(scope="module")
def editor(man: FaceModel) -> HeadEditor:
    return HeadEditor(man.character)


def _drag(editor: HeadEditor, name: str, **options: object) -> tuple[HeadDrag, SurfacePoints, np.ndarray]:
    triangles = editor.character.triangles
    point = SurfacePoints.of([SurfacePoint.at_vertex(triangles, editor.character.feature_points[name])])
    position = point.positions(editor.skin(editor.own), triangles)
    return HeadDrag(editor, editor.own, point, position, **options), point, position  # type: ignore[arg-type]


def _positions(editor: HeadEditor, points: SurfacePoints, identity: Identity) -> np.ndarray:
    return points.positions(editor.skin(identity), editor.character.triangles)


def test_the_derivatives_are_those_of_the_skin(editor: HeadEditor) -> None:
    drag, points, _ = _drag(editor, "9.3")
    rng = np.random.default_rng(0)
    step = 0.01 * rng.standard_normal(editor.own.shape.shape)
    moved = Identity(editor.own.shape + step, editor.own.detail_steps)
    expected = _positions(editor, points, moved) - _positions(editor, points, editor.own)
    np.testing.assert_allclose(drag._rows @ step.ravel(), expected, atol=1e-9)


@pytest.mark.parametrize("name", ["9.3", "2.1", "8.3", "5.1"])
@pytest.mark.parametrize("offset", [(0.0, -10.0), (6.0, 4.0)])
def test_the_point_comes_to_the_pointer(editor: HeadEditor, name: str, offset: tuple[float, float]) -> None:
    drag, points, position = _drag(editor, name)
    target = CAMERA.project(position) + offset
    identity = drag.moved_to(target, CAMERA)
    reached = CAMERA.project(_positions(editor, points, identity))
    assert np.linalg.norm(reached - target) < 2.5
    assert editor.distance(identity) < editor.distance(editor.own) + 0.6


def test_heads_go_no_farther_than_heads_do(editor: HeadEditor) -> None:
    drag, points, position = _drag(editor, "9.3")
    lengths = []
    for pixels in (10.0, 60.0, 600.0, 6000.0):
        identity = drag.moved_to(CAMERA.project(position) - (0.0, pixels), CAMERA)
        lengths.append(float(np.linalg.norm(_positions(editor, points, identity) - position)))
        assert np.linalg.norm(identity.shape - editor.own.shape, axis=1).max() < 6.0
    assert lengths[0] < lengths[1] < lengths[2] < 2.5
    assert lengths[3] < 1.05 * lengths[2]


def test_what_is_far_away_stays_the_more_the_less_the_spread(editor: HeadEditor) -> None:
    far = editor.character.regions["ear_left"]
    moved = []
    for spread in (0.0, 1.0):
        drag, _, position = _drag(editor, "9.3", spread=spread)
        identity = drag.moved_to(CAMERA.project(position) + (0.0, -20.0), CAMERA)
        change = editor.skin(identity) - editor.skin(editor.own)
        moved.append(float(np.linalg.norm(change[far], axis=1).mean()))
    assert moved[0] < 0.05 < moved[1]


def test_locked_segments_stay(editor: HeadEditor) -> None:
    free = [name == "mouth" for name in editor.segment_names]
    drag, _, position = _drag(editor, "8.3", free=free)
    identity = drag.moved_to(CAMERA.project(position) + (8.0, 0.0), CAMERA)
    locked = ~np.array(free)
    np.testing.assert_array_equal(identity.shape[locked], editor.own.shape[locked])
    assert not np.array_equal(identity.shape, editor.own.shape)


def test_points_off_the_skin_and_locked_heads_are_refused(editor: HeadEditor) -> None:
    eye = SurfacePoints.of([SurfacePoint.at_vertex(editor.character.triangles, 17300)])
    with pytest.raises(ValueError, match="not on the skin"):
        HeadDrag(editor, editor.own, eye, np.zeros((1, 3)))
    nose = SurfacePoints.of([SurfacePoint.at_vertex(editor.character.triangles, 100)])
    with pytest.raises(ValueError, match="no segment is free"):
        HeadDrag(editor, editor.own, nose, np.zeros((1, 3)), free=[False] * 4)
