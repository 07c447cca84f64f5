"""Shapes that were moved, scaled, turned or mirrored are laid on the neutral; others than expressions are found."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from faceposer.errors import FacePoserError
from faceposer.geometry.obj_io import write_obj
from faceposer.geometry.rig_io import read_rig
from faceposer.geometry.shape_alignment import implausible, lay_on

Array = np.ndarray
TURN = Rotation.from_euler("xyz", [10, 30, -20], degrees=True).as_matrix()


def head() -> tuple[Array, Array]:
    """Return an egg of 400 vertices, and it with the chin moved."""
    rng = np.random.default_rng(3)
    points = rng.standard_normal((400, 3))
    neutral = points / np.linalg.norm(points, axis=1, keepdims=True) * (7.0, 11.0, 9.0) + (0.4, 3.0, 1.0)
    move = np.where(neutral[:, 1:2] < -2.0, [[0.0, -1.5, 0.5]], 0.0)
    return neutral, neutral + move


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda v: 100.0 * v, "scaled by 100"),
        (lambda v: 0.01 * v, "scaled by 0.01"),
        (lambda v: v / 2.54, "scaled by 0.3937"),
        (lambda v: v + (0.1, 0.0, 0.0), "moved"),
        (lambda v: v + (300.0, -20.0, 5.0), "moved"),
        (lambda v: v @ TURN.T, "turned by"),
        (lambda v: v[:, [0, 2, 1]] * (1.0, -1.0, 1.0), "turned by 90"),
        (lambda v: 0.01 * v @ TURN.T + (1.0, 2.0, 3.0), "scaled by 0.01 and turned by"),
        (lambda v: v * (-1.0, 1.0, 1.0), "mirrored"),
        (lambda v: v * (1.0, 1.0, -1.0), "mirrored"),
    ],
)
def test_shapes_are_laid_on_the_neutral_by_what_keeps_still(change: Callable[[Array], Array], said: str) -> None:
    neutral, shape = head()
    aligned = lay_on(change(shape), neutral)
    assert said in aligned.change
    np.testing.assert_allclose(aligned.vertices, shape, atol=1e-3)
    assert not implausible(aligned.vertices, neutral)


def test_what_lies_on_the_neutral_or_is_noisy_stays() -> None:
    neutral, shape = head()
    noise = 0.05 * np.random.default_rng(0).standard_normal(shape.shape)
    for vertices in (shape, neutral, shape + noise):
        aligned = lay_on(vertices, neutral)
        assert not aligned.change
        assert aligned.vertices is vertices
        assert not implausible(vertices, neutral)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda v: v[::-1], "another order"),
        (lambda v: v[np.random.default_rng(1).permutation(len(v))], "another order"),
        (lambda v: 0.0 * v, "times the size"),
        (lambda v: v * (1.0, 1.2, 1.1), "no part of it keeps still"),
        (lambda v: v + 30.0 * (v[:, 1:2] < -5.0), "times the size"),
        (lambda v: np.where(np.arange(len(v))[:, None] == 3, 1e200, v), "too far away"),
    ],
)
def test_what_is_no_expression_is_told(change: Callable[[Array], Array], said: str) -> None:
    neutral, shape = head()
    assert said in implausible(lay_on(change(shape), neutral).vertices, neutral)


def test_a_folder_says_what_was_done_and_which_file_is_wrong(tmp_path: Path) -> None:
    neutral, shape = head()
    faces = np.array([[i, i + 1, i + 2] for i in range(398)])
    write_obj(tmp_path / "neutral.obj", neutral, faces)
    write_obj(tmp_path / "jawOpen.obj", 100.0 * shape, faces)
    write_obj(tmp_path / "smile.obj", shape[::-1], faces)
    rig = read_rig(tmp_path)
    np.testing.assert_allclose(rig.targets["jawOpen"], shape - neutral, atol=1e-3)
    assert re.search("The shape 'jawOpen' was scaled by 100 against the neutral face", rig.notes[0])
    assert list(rig.unusable) == ["smile"]
    assert re.search(r"smile\.obj' is not an expression of .*neutral\.obj': .* another order", rig.unusable["smile"])


def test_alignment_can_be_turned_off(tmp_path: Path) -> None:
    neutral, shape = head()
    faces = np.array([[i, i + 1, i + 2] for i in range(398)])
    write_obj(tmp_path / "neutral.obj", neutral, faces)
    write_obj(tmp_path / "jawOpen.obj", shape + (0.1, 0.0, 0.0), faces)
    np.testing.assert_allclose(read_rig(tmp_path).targets["jawOpen"], shape - neutral, atol=1e-3)
    raw = read_rig(tmp_path, align=False)
    np.testing.assert_allclose(raw.targets["jawOpen"], shape + (0.1, 0.0, 0.0) - neutral, atol=1e-3)
    assert not raw.notes
    write_obj(tmp_path / "jawOpen.obj", 100.0 * shape, faces)
    assert list(read_rig(tmp_path, align=False).unusable) == ["jawOpen"]


@pytest.mark.parametrize("suffix", [".obj", ".ply"])
def test_shapes_with_vertices_in_another_order_are_put_in_order_by_their_faces(suffix: str, tmp_path: Path) -> None:
    neutral, shape = head()
    faces = np.array([[i, i + 1, i + 2] for i in range(398)])
    order = np.random.default_rng(5).permutation(400)
    place = np.argsort(order)
    write_obj(tmp_path / "neutral.obj", neutral, faces)

    def write(vertices: Array, polygons: Array) -> None:
        if suffix == ".obj":
            write_obj(tmp_path / "jawOpen.obj", vertices, polygons)
        else:
            rows = [" ".join(map(repr, row)) for row in vertices.tolist()]
            rows += ["3 " + " ".join(map(str, row)) for row in polygons.tolist()]
            head = (
                "ply\nformat ascii 1.0\nelement vertex 400\nproperty double x\nproperty double y\nproperty double z\n"
            )
            head += "element face 398\nproperty list uchar int vertex_indices\nend_header\n"
            (tmp_path / "jawOpen.ply").write_text(head + "\n".join(rows) + "\n")

    write(shape[order], place[faces])
    rig = read_rig(tmp_path)
    np.testing.assert_allclose(rig.targets["jawOpen"], shape - neutral, atol=1e-3)
    assert "The shape 'jawOpen' has its vertices in another order than the neutral face" in rig.notes[0]
    write(shape[order], place[faces[::-1]])
    with pytest.raises(FacePoserError, match=r"The faces of the shape '.*jawOpen.*' differ from the neutral face"):
        read_rig(tmp_path)
